//! What hangs on the machine beside the chain that was measured, where nothing says how it stood.

use serde::{Deserialize, Serialize};

use crate::machine::{Machine, SideBranch};

/// A side branch whose joints have no column in some recording: its weight is not told from that of what carries it.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnseenSideBranch {
    /// Frame that carries it.
    pub on: String,
    /// Columns that would say how it stands.
    pub columns: Vec<String>,
    /// Name of the machine as which it is recorded, where the machine file says so: a call may name those recordings too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recorded_as: Option<String>,
}

/// Side branches that the machine has and that the machine as it was seen has not.
pub(super) fn unseen(machine: &Machine, seen: &Machine) -> Vec<UnseenSideBranch> {
    let hidden = machine.side_branches().iter().filter(|side| !seen.side_branches().contains(side));
    let one = |side: &SideBranch| UnseenSideBranch {
        recorded_as: side.recorded_as.clone(),
        on: side.on.clone(),
        columns: side.columns().map(|(name, unit)| format!("{name}[{unit}]")).collect(),
    };
    hidden.map(one).collect()
}

//! Other machines that recordings may be of: those that come with the program, and the same with its branches exchanged.

use super::thinned::{Sample, Thinned};
use crate::error::Result;
use crate::machine::{Machine, MachineForm, SHIPPED};
use crate::recording::Recording;

/// A machine in place of the one that was given.
pub(super) struct Other {
    /// As the part of a sentence that follows "with".
    pub what: String,
    pub mend: String,
    pub machine: Machine,
}

/// Every machine whose commands have the same names and kinds.
pub(super) fn others(machine: &Machine) -> Vec<Other> {
    let joints = |m: &Machine| {
        let mut all: Vec<(String, bool)> = (m.commands().iter().enumerate())
            .map(|(c, name)| (name.clone(), super::change::turns(m, c)))
            .collect();
        all.sort();
        all
    };
    let own = joints(machine);
    let mut all: Vec<Other> = (shipped().into_iter())
        .filter(|other| other.name() != machine.name() && joints(other) == own)
        .map(|other| Other {
            what: format!("machine {}", other.name()),
            mend: format!("take the file of {}", other.name()),
            machine: other,
        })
        .collect();
    all.extend(exchanged(machine).map(|other| Other {
        what: "the branches exchanged".into(),
        mend: "exchange `workpiece` and `tool` in the machine file: what carries the part, and what carries the tool".into(),
        machine: other,
    }));
    all
}

/// The machines that come with the program.
pub(super) fn shipped() -> Vec<Machine> {
    SHIPPED.iter().filter_map(|(name, text)| Machine::parse(name, text).ok()).collect()
}

/// The machine with its branches exchanged; none where something hangs beside the chain.
fn exchanged(machine: &Machine) -> Option<Machine> {
    let mut form: MachineForm<()> = machine.to_form();
    if !form.side_branches.is_empty() {
        return None;
    }
    std::mem::swap(&mut form.workpiece, &mut form.tool);
    form.workpiece.as_mut()?.last_mut()?.frame = "w".into();
    form.tool.as_mut()?.last_mut()?.frame = "t".into();
    Machine::from_form(&form).ok()
}

impl Other {
    /// The recordings as of this machine.
    pub fn recordings(&self, of: &Machine, thinned: &[Thinned]) -> Result<Vec<Recording>> {
        let from: Vec<usize> = (self.machine.commands().iter())
            .filter_map(|name| of.commands().iter().position(|own| own == name))
            .collect();
        let one = |thinned: &Thinned| {
            let mut other = thinned.clone();
            other.head.retain(|line| !line.trim_start_matches('#').trim_start().starts_with("machine"));
            let turned =
                |s: &Sample| Sample { commands: from.iter().map(|c| s.commands[*c]).collect(), ..s.clone() };
            other.samples = thinned.samples.iter().map(turned).collect();
            other.recording(&self.machine)
        };
        thinned.iter().map(one).collect()
    }
}

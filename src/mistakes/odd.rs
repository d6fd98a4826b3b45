//! What is odd in recordings that belong to their machine.

use serde::{Deserialize, Serialize};

use super::moved::{Moved, moved};
use super::rows::Rows;
use super::unsettled::{Unsettled, unsettled};
use crate::error::Result;
use crate::machine::Machine;
use crate::recording::Recording;

/// What happened while recordings were made.
#[non_exhaustive]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Odd {
    /// An instrument that was moved while its set-up kept its name.
    pub moved: Option<Moved>,
    /// Joints that were read before the machine had settled.
    pub unsettled: Option<Unsettled>,
}

/// Calibrates thinned recordings, and looks at what is left in the order of time.
///
/// # Errors
/// If a recording cannot be read.
pub fn odd(machine: &Machine, recordings: &[Recording], progress: &dyn Fn(&str)) -> Result<Odd> {
    progress("looking at what is left in the order of time");
    // What cannot be calibrated is refused for its own reason.
    let Ok(rows) = Rows::of(machine, recordings, progress) else { return Ok(Odd::default()) };
    Ok(Odd { moved: moved(machine, &rows)?, unsettled: unsettled(machine, &rows)? })
}

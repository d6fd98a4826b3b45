//! A course: what the machine is commanded to do, sample by sample.

use std::fmt;

use crate::error::{Error, Result};
use crate::machine::{JointKind, Machine};

/// Commands at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Since the start of the course, s.
    pub time: f64,
    /// Commands, m or rad, machine order.
    pub q: Vec<f64>,
    /// Directions of approach of all commands, where the sample is a settled position; 0: not known to have moved.
    pub directions: Option<Vec<i8>>,
    /// Whether the instrument records here; the machine moves all the same.
    pub recorded: bool,
    /// Where on the course it is, for messages.
    pub at: At,
}

/// Where on a course a sample is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum At {
    /// Angle of the turn, rad.
    Turn(f64),
    /// Line of an NC program or of a table of commands.
    Line(usize),
    /// Number of the pose, from 1.
    Pose(usize),
}

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            At::Turn(u) => {
                // Rounding must not show as -0.000.
                let degrees = (u.to_degrees() * 1e3).round() / 1e3 + 0.0;
                write!(f, "at {degrees} deg of the turn")
            }
            At::Line(line) => write!(f, "in line {line}"),
            At::Pose(number) => write!(f, "at pose {number}"),
        }
    }
}

/// The samples of a course, in the order of time.
pub type Samples<'a> = Box<dyn Iterator<Item = Result<Sample>> + Send + 'a>;

/// Something that can be run: each call of [`Course::samples`] runs it anew, with the same samples.
pub trait Course: Send + Sync {
    /// The samples from the start. Nothing but what a sample needs is held.
    ///
    /// # Errors
    /// A file that cannot be opened; each sample may bring [`Error::Motion`] or a fault in a file.
    fn samples(&self) -> Result<Samples<'_>>;
}

/// Refuses commands beyond the machine's travel.
pub(super) fn within_travel(machine: &Machine, q: &[f64], at: At) -> Result<()> {
    for (c, value) in q.iter().enumerate() {
        let (from, to) = machine.travel(c);
        // Rounding of a solved axis is no violation.
        if *value < from - 1e-9 || *value > to + 1e-9 {
            let name = &machine.commands()[c];
            let (scale, unit) = match machine.command_joint(c).kind {
                JointKind::Prismatic => (1e3, "mm"),
                JointKind::Revolute => (1f64.to_degrees(), "deg"),
            };
            let what = format!(
                "{name} leaves its travel {at}: {:.3} {unit}, limits {} to {} {unit}",
                value * scale,
                round(from * scale),
                round(to * scale)
            );
            let mend = "shorten or shift the motion, or correct `travel` in the machine file";
            return Err(Error::Motion { what, mend: mend.into() });
        }
    }
    Ok(())
}

/// Without the last digits that come from conversion.
fn round(x: f64) -> f64 {
    (x * 1e6).round() / 1e6
}

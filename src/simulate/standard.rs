//! The kinematic tests of ISO 10791-6 for machines with two rotary axes: which machine runs which, and about which axis.

use std::fmt;

use super::follow::commands_of;
use crate::error::{Error, Result};
use crate::machine::{Branch, JointKind, Machine};

/// Where a machine has its two rotary axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// AK: both in the tool list, a head.
    Head,
    /// BK: both in the workpiece list, a table.
    Table,
    /// CK: one in each.
    Mixed,
}

impl Family {
    /// The family of a machine, if it has exactly two rotary axes.
    pub fn of(machine: &Machine) -> Option<Family> {
        let rotary = commands_of(machine, JointKind::Revolute);
        let [a, b] = <[usize; 2]>::try_from(rotary).ok()?;
        Some(match (branch(machine, a), branch(machine, b)) {
            (Branch::Tool, Branch::Tool) => Family::Head,
            (Branch::Workpiece, Branch::Workpiece) => Family::Table,
            _ => Family::Mixed,
        })
    }

    fn letter(self) -> char {
        match self {
            Family::Head => 'A',
            Family::Table => 'B',
            Family::Mixed => 'C',
        }
    }

    fn words(self) -> &'static str {
        match self {
            Family::Head => "both rotary axes in the tool list (a head)",
            Family::Table => "both rotary axes in the workpiece list (a table)",
            Family::Mixed => "one rotary axis in the workpiece list and one in the tool list",
        }
    }
}

/// A test of ISO 10791-6.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Standard {
    /// AK, BK or CK.
    pub family: Family,
    /// 1: the axis that tilts, 2: the axis that turns, 4: cone frustum with all five.
    pub number: u8,
}

impl fmt::Display for Standard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}K{}", self.family.letter(), self.number)
    }
}

impl Standard {
    /// The rotary command that tests 1 and 2 turn; `None` for the cone frustum.
    ///
    /// The axis that tilts (1) is the one nearer to the base on a table, the one nearer to the tool in a head, and that of the
    /// head where table and head have one each; the other turns (2).
    ///
    /// # Errors
    /// [`Error::Motion`] where the test is for other machines.
    pub fn axis(self, machine: &Machine) -> Result<Option<usize>> {
        let rotary = commands_of(machine, JointKind::Revolute);
        let family = Family::of(machine);
        if family != Some(self.family) {
            let names = |which: Branch| -> Vec<&str> {
                let of = rotary.iter().filter(|c| branch(machine, **c) == which);
                of.map(|c| machine.commands()[*c].as_str()).collect()
            };
            let list = |names: Vec<&str>| if names.is_empty() { "none".into() } else { names.join(", ") };
            let what = format!(
                "{self} is for machines with {}; this one has in the workpiece list: {}, in the tool list: {}",
                self.family.words(),
                list(names(Branch::Workpiece)),
                list(names(Branch::Tool))
            );
            let mend = match family {
                Some(family) => format!("run {}", Standard { family, ..self }),
                None => "run one rotary axis (`rotary --axis NAME`), a circle (`circle`) or random poses (`poses`)".into(),
            };
            return Err(Error::Motion { what, mend });
        }
        let (tilts, turns) = match self.family {
            Family::Table => (rotary[0], rotary[1]),
            Family::Head => (rotary[1], rotary[0]),
            Family::Mixed => (rotary[1], rotary[0]),
        };
        Ok(match self.number {
            1 => Some(tilts),
            2 => Some(turns),
            _ => None,
        })
    }
}

/// Branch of the joint that a command names.
fn branch(machine: &Machine, command: usize) -> Branch {
    let name = &machine.commands()[command];
    let own = machine.joints().find(|(_, joint)| joint.name == *name);
    machine.branch(own.map_or(0, |(j, _)| j))
}

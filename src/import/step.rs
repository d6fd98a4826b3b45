//! What leads from one link to the next: elementary moves and joints.

use std::path::PathBuf;

use crate::error::Place;
use crate::lie::{Pose, Vec3};
use crate::machine::{FileUnits, JointKind, MoveForm};

/// A move from one frame to the next, m and rad: elementary, about or along the axis 0, 1, 2; or any.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Move {
    Turn(usize, f64),
    Shift(usize, f64),
    Pose(Pose<f64>),
}

impl From<MoveForm> for Move {
    fn from(step: MoveForm) -> Self {
        match step {
            MoveForm::Tx(by) => Move::Shift(0, by),
            MoveForm::Ty(by) => Move::Shift(1, by),
            MoveForm::Tz(by) => Move::Shift(2, by),
            MoveForm::Rx(by) => Move::Turn(0, by),
            MoveForm::Ry(by) => Move::Turn(1, by),
            MoveForm::Rz(by) => Move::Turn(2, by),
        }
    }
}

impl Move {
    pub fn pose(self) -> Pose<f64> {
        let unit = |axis: usize| Vec3(std::array::from_fn(|i| f64::from(u8::from(i == axis))));
        match self {
            Move::Turn(axis, by) => Pose::turn(unit(axis), by),
            Move::Shift(axis, by) => Pose::translation(unit(axis).times(by)),
            Move::Pose(pose) => pose,
        }
    }

    /// Whether it leaves everything where it is.
    pub fn is_none(&self) -> bool {
        match self {
            Move::Turn(_, by) | Move::Shift(_, by) => *by == 0.0,
            Move::Pose(pose) => *pose == Pose::identity(0.0),
        }
    }

    /// All of them, one behind the other.
    pub fn all(moves: &[Move]) -> Pose<f64> {
        moves.iter().fold(Pose::identity(0.0), |pose, m| pose * m.pose())
    }

    /// Along x, y and z.
    pub fn shifts(by: Vec3<f64>) -> [Move; 3] {
        std::array::from_fn(|axis| Move::Shift(axis, by.0[axis]))
    }
}

/// A joint that follows another one: displacement = factor × the leader's + offset.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Mimic {
    pub leader: String,
    pub factor: f64,
    pub offset: f64,
}

/// What a joint of a description does.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Motion {
    Fixed,
    /// About or along a unit vector.
    Moving {
        kind: JointKind,
        axis: Vec3<f64>,
        travel: Option<(f64, f64)>,
        mimic: Option<Mimic>,
    },
    /// What no machine file holds, and why.
    Refused {
        what: String,
        mend: String,
    },
}

/// A joint of a description, between two links by index.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub name: String,
    pub line: usize,
    pub parent: usize,
    pub child: usize,
    pub moves: Vec<Move>,
    pub motion: Motion,
}

/// Mass, kg, and its centre in the link's frame, m.
pub(super) type Mass = (f64, Vec3<f64>);

/// A link.
#[derive(Clone, Debug)]
pub(super) struct Link {
    pub name: String,
    pub line: usize,
    pub mass: Option<Mass>,
    /// Whether it is a part of the robot. What only marks a place on one is an end where it is named as such, never by itself.
    pub is_part: bool,
}

/// A description of a robot, as it stands in the file.
#[derive(Clone, Debug)]
pub(super) struct Robot {
    pub file: PathBuf,
    pub name: String,
    /// What it calls its links.
    pub noun: &'static str,
    /// Files and lines by line, where the text was put together from several files.
    pub lines: Vec<(PathBuf, usize)>,
    /// Units of the machine file.
    pub units: FileUnits,
    pub links: Vec<Link>,
    pub steps: Vec<Step>,
    pub told: Vec<String>,
}

impl Robot {
    pub fn place(&self, line: usize) -> Place {
        match line.checked_sub(1).and_then(|i| self.lines.get(i)) {
            Some((file, line)) => Place::at(file, *line, 0),
            None => Place::at(&self.file, line, 0),
        }
    }

    /// A line as notes name it.
    pub fn line(&self, line: usize) -> String {
        let place = self.place(line);
        match place.file == self.file {
            true => format!("line {}", place.line),
            false => {
                let folder = self.file.parent().unwrap_or(&self.file);
                let file = place.file.strip_prefix(folder).unwrap_or(&place.file);
                format!("line {} of {}", place.line, file.display())
            }
        }
    }
}

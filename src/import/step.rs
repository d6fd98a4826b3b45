//! What leads from one link to the next: elementary moves and joints.

use std::path::{Path, PathBuf};

use crate::error::Place;
use crate::lie::{Pose, Vec3};
use crate::machine::JointKind;

/// An elementary move: letter of its axis, whether it turns, and by how much (m or rad).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Move {
    pub turn: bool,
    pub axis: usize,
    pub by: f64,
}

impl Move {
    pub fn pose(self) -> Pose<f64> {
        let mut unit = Vec3([0.0; 3]);
        unit.0[self.axis] = 1.0;
        if self.turn { Pose::turn(unit, self.by) } else { Pose::translation(unit.times(self.by)) }
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
}

/// A description of a robot, as it stands in the file.
#[derive(Clone, Debug)]
pub(super) struct Robot {
    pub file: PathBuf,
    pub name: String,
    pub links: Vec<Link>,
    pub steps: Vec<Step>,
    pub told: Vec<String>,
}

impl Robot {
    pub fn place(&self, line: usize) -> Place {
        Place::at(Path::new(&self.file), line, 0)
    }
}

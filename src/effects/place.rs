//! Where on a machine an effect sits.

use super::family::{Family, Partner, Seat, Which};
use crate::machine::{Joint, JointKind, Machine};

/// Where an effect sits on a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Place {
    /// On the joint of this dyad.
    Joint(usize),
    /// On the joint of the first dyad, depending on that of the second.
    Pair(usize, usize),
    /// On the frame of this dyad.
    Frame(usize),
    /// On what the instrument reads.
    Measurement,
}

impl Place {
    /// As in findings: the name of a joint or a frame, or `measurement`.
    pub fn name(self, machine: &Machine) -> String {
        match self {
            Place::Joint(j) | Place::Pair(j, _) => joint_name(machine, j),
            Place::Frame(j) => machine.dyads()[j].frame.clone(),
            Place::Measurement => "measurement".into(),
        }
    }

    /// The dyad, if it is on the machine.
    pub fn dyad(self) -> Option<usize> {
        match self {
            Place::Joint(j) | Place::Pair(j, _) | Place::Frame(j) => Some(j),
            Place::Measurement => None,
        }
    }

    /// The same without the other joint of a pair.
    pub(crate) fn seat(self) -> Place {
        match self {
            Place::Pair(j, _) => Place::Joint(j),
            other => other,
        }
    }

    /// Name of the other joint of a pair.
    pub fn partner(self, machine: &Machine) -> Option<String> {
        match self {
            Place::Pair(_, partner) => Some(joint_name(machine, partner)),
            _ => None,
        }
    }
}

/// Name of the joint of a dyad, or of its frame where it has none.
pub(super) fn joint_name(machine: &Machine, j: usize) -> String {
    machine.dyads()[j]
        .joint
        .as_ref()
        .map_or_else(|| machine.dyads()[j].frame.clone(), |joint| joint.name.clone())
}

/// Every place of the machine where a family can sit.
pub(super) fn places(family: &Family, machine: &Machine) -> Vec<Place> {
    let mut places = Vec::new();
    let sits = |kind: JointKind| family.sits.iter().any(|seat| seat.joint() == Some(kind));
    let along = |j: usize, k: usize| machine.branch(k) == machine.branch(j);
    let here = |j: usize| match family.which {
        Which::All => true,
        Which::First => machine.joints().all(|(k, _)| k >= j || !along(j, k)),
        Which::Last => (j + 1..machine.dyads().len()).all(|k| !along(j, k)),
        Which::Outer => {
            let turns =
                |(k, joint): &(usize, &Joint)| *k > j && along(j, *k) && joint.kind == JointKind::Revolute;
            machine.joints().filter(turns).count() <= 1
        }
    };
    for (j, _) in machine.joints().filter(|(j, joint)| sits(joint.kind) && here(*j)) {
        let Some(partner) = family.partner else {
            places.push(Place::Joint(j));
            continue;
        };
        let fits = |kind: JointKind| match partner {
            Partner::Joint => true,
            Partner::Prismatic => kind == JointKind::Prismatic,
            Partner::Revolute => kind == JointKind::Revolute,
        };
        places.extend(
            machine.joints().filter(|(k, other)| *k != j && fits(other.kind)).map(|(k, _)| Place::Pair(j, k)),
        );
    }
    if family.sits.contains(&Seat::Frame) {
        places.extend((0..machine.dyads().len()).filter(|j| here(*j)).map(Place::Frame));
    }
    if family.sits.contains(&Seat::Measurement) {
        places.push(Place::Measurement);
    }
    places
}

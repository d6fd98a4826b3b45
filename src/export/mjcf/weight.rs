//! What pulls at springs besides the masses that the machine file states: stand-ins for masses that nobody has stated.

use crate::lie::Vec3;
use crate::machine::{JointKind, Machine};

/// Half of the distance between two weights that make a first moment, m.
const HALF: f64 = 0.5;

/// A weight in the model, fixed to what a dyad moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Weight {
    /// Index of the dyad.
    pub dyad: usize,
    /// kg; below zero it pulls upwards.
    pub mass: f64,
    /// In the dyad's frame behind its joint, m.
    pub centre: Vec3<f64>,
}

/// What a spring asks for besides the masses that the machine file states, as parts of its compliance.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Pull {
    /// Of so many kg at the end of the branch.
    pub load: f64,
    /// Of a first moment of mass in kg m, fixed to what a dyad moves, along a direction in its frame.
    pub moments: Vec<(usize, Vec3<f64>, f64)>,
}

/// The dyad and the direction of a lever of joint `j`, as the expression counts them; none of a linear joint.
pub(super) fn lever(machine: &Machine, j: usize, beyond: u8, direction: u8) -> Option<(usize, Vec3<f64>)> {
    let own = machine.branch(j);
    let (k, joint) =
        machine.joints().filter(|(k, _)| *k >= j && machine.branch(*k) == own).nth(usize::from(beyond))?;
    let across = joint.axis.across().get(usize::from(direction)).copied()?;
    (joint.kind == JointKind::Revolute).then_some((k, across))
}

/// All of a model, given what the spring of a joint asks for.
pub(super) fn weights<'a>(machine: &Machine, pull_of: impl Fn(&str) -> Option<&'a Pull>) -> Vec<Weight> {
    let mut weights: Vec<Weight> = Vec::new();
    let at_origin = |dyad, mass| Weight { dyad, mass, centre: Vec3([0.0; 3]) };
    let dyads = machine.dyads();
    for (j, joint) in machine.joints() {
        let Some(pull) = pull_of(&joint.name) else { continue };
        let mut beyond = (j..dyads.len()).filter(|k| machine.branch(*k) == machine.branch(j));
        let stated = beyond.clone().any(|k| dyads[k].mass.is_some_and(|mass| mass.mass > 0.0));
        let end = beyond.next_back();
        if !stated {
            // One kilogram at every frame beyond, as the effect counts them; springs nearer to the base see the same ones.
            let new = (j + 1..dyads.len())
                .filter(|k| machine.branch(*k) == machine.branch(j))
                .filter(|k| !weights.iter().any(|weight| weight.dyad == *k))
                .collect::<Vec<usize>>();
            weights.extend(new.into_iter().map(|k| at_origin(k, 1.0)));
        }
        if let Some(end) = end.filter(|_| pull.load != 0.0) {
            weights.push(at_origin(end, pull.load));
        }
        for (dyad, direction, moment) in &pull.moments {
            // Two weights that pull against each other.
            for side in [HALF, -HALF] {
                let mass = moment * side.signum();
                weights.push(Weight { dyad: *dyad, mass, centre: direction.times(side) });
            }
        }
    }
    weights
}

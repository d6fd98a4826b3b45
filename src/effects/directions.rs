//! In which directions of se(3) an effect acts at its place.

use super::facts::RecordingFacts;
use super::family::{Directions, Family, Pivot};
use super::place::Place;
use crate::feature::Dimension;
use crate::lie::{Twist, Vec3};
use crate::machine::Machine;
use crate::units::Quantity;
use crate::variation::Slot;

/// Name, slot, direction and unit of each direction at a place.
pub(super) fn directions(
    family: &Family,
    place: Place,
    machine: &Machine,
    facts: &RecordingFacts,
) -> Vec<(String, Slot, Twist<f64>, Dimension)> {
    let zero = Vec3([0.0; 3]);
    let slot = |j| match family.pivot {
        Pivot::Before => Slot::Before(j),
        Pivot::After => Slot::After(j),
    };
    let joint = place.dyad().and_then(|j| machine.dyads()[j].joint.as_ref());
    let axis = joint.map_or(Vec3([0.0, 0.0, 1.0]), |joint| joint.axis);
    let mut all = Vec::new();
    for set in &family.directions {
        if *set == Directions::Readings {
            for (i, _) in facts.readings.iter().enumerate().filter(|(_, q)| reads(facts, **q)) {
                let mut weights = [0.0; 6];
                weights[i] = 1.0;
                let unit = Dimension::of_quantity(facts.readings[i]);
                all.push((format!("r{i}"), Slot::Reading, Twist::from_array(weights), unit));
            }
            continue;
        }
        let Some(j) = place.dyad() else { continue };
        let mut translation =
            |v: Vec3<f64>| all.push((named('v', v), slot(j), Twist::new(v, zero), Dimension::LENGTH));
        match set {
            Directions::Translations => basis().into_iter().for_each(&mut translation),
            Directions::Across => axis.across().into_iter().for_each(&mut translation),
            Directions::Slide => translation(axis),
            _ => {}
        }
        let mut rotation =
            |w: Vec3<f64>| all.push((named('w', w), slot(j), Twist::new(zero, w), Dimension::ANGLE));
        match set {
            Directions::Rotations => basis().into_iter().for_each(&mut rotation),
            Directions::Tilts => axis.across().into_iter().for_each(&mut rotation),
            Directions::Turn => rotation(axis),
            _ => {}
        }
        if let (Directions::Along, Some(joint)) = (set, joint) {
            all.push(("along".into(), slot(j), joint.twist(), Dimension::of_joint(joint.kind)));
        }
    }
    all
}

/// Lengths, or angles where the instrument reads nothing else.
fn reads(facts: &RecordingFacts, quantity: Quantity) -> bool {
    quantity == Quantity::Length || !facts.readings.contains(&Quantity::Length)
}

fn basis() -> [Vec3<f64>; 3] {
    [Vec3([1.0, 0.0, 0.0]), Vec3([0.0, 1.0, 0.0]), Vec3([0.0, 0.0, 1.0])]
}

/// `vx` for a frame's own vector, `v` with its components for another.
fn named(letter: char, vector: Vec3<f64>) -> String {
    for (k, name) in ["x", "y", "z"].into_iter().enumerate() {
        if (vector.0[k].abs() - 1.0).abs() < 1e-12 {
            return format!("{letter}{name}");
        }
    }
    let [x, y, z] = vector.0;
    format!("{letter}({x:.3},{y:.3},{z:.3})")
}

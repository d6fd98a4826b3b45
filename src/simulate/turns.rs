//! How often, in which senses and how fast a test turns: legs made from what a user asks for.

use super::follow::commands_of;
use super::profile::{Leg, Pace};
use crate::chain::Chain;
use crate::error::{Error, Result};
use crate::lie::Vec3;
use crate::machine::{JointKind, Machine};

/// Sense of a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// From the start to the end.
    Positive,
    /// From the end to the start.
    Negative,
}

/// A turn and how it is run.
#[derive(Clone, Debug, PartialEq)]
pub struct Turns {
    /// Start, rad.
    pub from: f64,
    /// End, rad.
    pub to: f64,
    /// Senses, one after the other.
    pub senses: Vec<Sense>,
    /// Equal parts with a stop after each.
    pub parts: u32,
    /// How often the whole is done.
    pub repeat: u32,
    /// What is turned before and behind the recorded part, rad.
    pub overshoot: f64,
    /// Standstill after each leg, s.
    pub dwell: f64,
    /// Paces, one after the other.
    pub paces: Vec<Pace>,
}

impl Turns {
    /// The legs, one after the other; where a turn does not start where the last one ended, a leg that is not recorded leads
    /// there.
    pub fn legs(&self) -> Vec<Leg> {
        let sign = if self.to < self.from { -1.0 } else { 1.0 };
        let (start, end) = (self.from - sign * self.overshoot, self.to + sign * self.overshoot);
        let window = Some((self.from.min(self.to), self.from.max(self.to)));
        let mut legs: Vec<Leg> = Vec::new();
        for pace in &self.paces {
            for sense in (0..self.repeat).flat_map(|_| &self.senses) {
                let (a, b) = if *sense == Sense::Positive { (start, end) } else { (end, start) };
                let at = |k: u32| {
                    if k == self.parts { b } else { a + (b - a) * f64::from(k) / f64::from(self.parts) }
                };
                if let Some(last) = legs.last().filter(|last| last.to != a) {
                    legs.push(Leg { from: last.to, to: a, pace: *pace, dwell: self.dwell, recorded: None });
                }
                legs.extend((0..self.parts).map(|k| Leg {
                    from: at(k),
                    to: at(k + 1),
                    pace: *pace,
                    dwell: self.dwell,
                    recorded: window,
                }));
            }
        }
        legs
    }
}

/// Range of a rotary axis that a test of it turns through where the user says nothing: once round if travel allows, else from
/// -90° to 90° as far as travel goes.
pub fn usual_range(machine: &Machine, command: usize) -> (f64, f64) {
    use std::f64::consts::{FRAC_PI_2, TAU};
    let (from, to) = machine.travel(command);
    if from <= 0.0 && to >= TAU { (0.0, TAU) } else { (from.max(-FRAC_PI_2), to.min(FRAC_PI_2)) }
}

/// Where axes stand that nobody moves: at 0, or in the middle of a travel without 0.
pub fn rest(machine: &Machine) -> Vec<f64> {
    let one = |c: usize| {
        let (from, to) = machine.travel(c);
        if (from..=to).contains(&0.0) { 0.0 } else { 0.5 * (from + to) }
    };
    (0..machine.commands().len()).map(one).collect()
}

/// Orthonormal directions in frame `w` of the plane that two linear axes span: that in which the tool moves with the first
/// one, and that of the second square to it. `held`: commands of the other axes.
///
/// # Errors
/// [`Error::Motion`] where an axis is none of the linear ones, or both move the same way.
pub fn plane_of_axes(machine: &Machine, names: [&str; 2], held: &[f64]) -> Result<[Vec3<f64>; 2]> {
    let linear = commands_of(machine, JointKind::Prismatic);
    let known: Vec<&str> = linear.iter().map(|c| machine.commands()[*c].as_str()).collect();
    let chain = Chain::nominal(machine);
    let point = |q: &[f64]| chain.w_from_t(q).translation;
    let mut directions = [Vec3([0.0; 3]); 2];
    for (direction, name) in directions.iter_mut().zip(names) {
        let Some(c) = linear.iter().find(|c| machine.commands()[**c] == name) else {
            let what = format!("\"{name}\" is no linear axis of this machine");
            let mend = match known.is_empty() {
                true => "it has none; give the plane by its normal (`--normal`)".into(),
                false => format!("linear axes: {}", known.join(", ")),
            };
            return Err(Error::Motion { what, mend });
        };
        let mut moved = held.to_vec();
        moved[*c] += 1.0;
        *direction = point(&moved) - point(held);
    }
    let [first, second] = directions;
    let first = first.times(first.norm().recip());
    let square = second - first.times(first.dot(second));
    if square.norm() < 1e-6 {
        return Err(Error::Motion {
            what: format!("the axes {} and {} move the tool along one line", names[0], names[1]),
            mend: "name two axes that span a plane".into(),
        });
    }
    Ok([first, square.times(square.norm().recip())])
}

/// Orthonormal directions of the plane across a unit vector: the first is the x axis (or, where the normal runs along it, the y
/// axis) as far as it lies in the plane, the second square to it, so that a positive turn about the normal leads from one to
/// the other.
pub fn plane_across(normal: Vec3<f64>) -> [Vec3<f64>; 2] {
    let along = if normal.0[0].abs() < 0.9 { Vec3([1.0, 0.0, 0.0]) } else { Vec3([0.0, 1.0, 0.0]) };
    let first = along - normal.times(normal.dot(along));
    let first = first.times(first.norm().recip());
    [first, normal.cross(first)]
}

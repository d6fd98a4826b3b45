//! Error motions of the axes as an identification has found them, `docs/model.md` (32): smooth deviations along the travel of a joint, and
//! how its play varies there.

mod form;
mod room;

pub(crate) use form::{MotionForm, forms, read};
pub(crate) use room::{Motions, eliminate};

use std::f64::consts::TAU;

use crate::lie::Twist;
use crate::machine::Machine;

/// Harmonics of one joint.
pub const HARMONICS: usize = 4;

/// The error motion of one joint: at the displacement `s` its dyad deviates by the sum over `h` of
/// `cosines[h-1] cos(h u) + sines[h-1] sin(h u)`, `u = 2π (s - from) / period`.
#[derive(Clone, Debug, PartialEq)]
pub struct JointMotion {
    /// The dyad; the deviation stands before its joint, beside the constant one.
    pub dyad: usize,
    /// Displacement at which `u` is zero, m or rad.
    pub from: f64,
    /// Displacement after which it comes again, m or rad.
    pub period: f64,
    /// By harmonic, m and rad.
    pub cosines: [Twist<f64>; HARMONICS],
    /// By harmonic, m and rad.
    pub sines: [Twist<f64>; HARMONICS],
    /// What `cos u` and `sin u` times the direction of travel of the joint add along its axis: play that varies; m or rad.
    pub play: [f64; 2],
}

/// Direction of travel of the joint of dyad `j`, out of those of all commands; 0 where it is not known.
pub(crate) fn direction_of(machine: &Machine, j: usize, directions: &[i8]) -> f64 {
    match machine.drive(j).map(|drive| &drive.terms[..]) {
        Some([(c, factor)]) => f64::from(directions.get(*c).copied().unwrap_or(0)) * factor.signum(),
        _ => 0.0,
    }
}

/// Cosines and sines of the harmonics of `u`.
pub(crate) fn harmonics(u: f64) -> [(f64, f64); HARMONICS] {
    let (sin, cos) = u.sin_cos();
    let mut now = (1.0, 0.0);
    std::array::from_fn(|_| {
        now = (now.0 * cos - now.1 * sin, now.1 * cos + now.0 * sin);
        now
    })
}

/// The error motions of a machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ErrorMotions {
    /// Joints that have one.
    pub joints: Vec<JointMotion>,
}

impl ErrorMotions {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// Adds to the deviations `dh` (one per dyad, m and rad) what the error motions make at the commands `q` (m and rad), under these
    /// directions of travel of all commands (-1, 0, 1; none given: not known).
    pub fn add(&self, machine: &Machine, q: &[f64], directions: &[i8], dh: &mut [Twist<f64>]) {
        if self.is_empty() {
            return;
        }
        let displacements = machine.displacements(q);
        for joint in &self.joints {
            dh[joint.dyad] = dh[joint.dyad] + joint.at(machine, displacements[joint.dyad], directions);
        }
    }
}

impl JointMotion {
    /// The deviation at a displacement, m and rad; directions of all commands as in [`ErrorMotions::add`].
    pub fn at(&self, machine: &Machine, displacement: f64, directions: &[i8]) -> Twist<f64> {
        let harmonics = harmonics(TAU * (displacement - self.from) / self.period);
        let direction = direction_of(machine, self.dyad, directions);
        let play = direction * (self.play[0] * harmonics[0].0 + self.play[1] * harmonics[0].1);
        let along = machine.dyads()[self.dyad].joint.as_ref().map(|joint| joint.twist().times(play));
        let both = self.cosines.iter().zip(&self.sines).zip(harmonics);
        both.fold(along.unwrap_or(Twist::zero(0.0)), |sum, ((of_cos, of_sin), (cos, sin))| {
            sum + of_cos.times(cos) + of_sin.times(sin)
        })
    }
}

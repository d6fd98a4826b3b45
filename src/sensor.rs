//! What an instrument reads on a machine, and how that reading changes with every unknown.
//!
//! A [`Sensor`] turns a [`Sweep`] into up to six scalar readings. Each reading comes with one wrench (how it answers to a small
//! twist of the tool seen from the workpiece), which the chain carries into the row of the Jacobian, `docs/model.md` (15) to (19).

use crate::chain::Sweep;
use crate::lie::{Mat3, Vec3, Wrench, inverse_left_jacobian_so3};
use crate::scalar::Scalar;
use crate::units::Quantity;

/// The most readings that one sample has: a pose.
pub const MOST_READINGS: usize = 6;

/// Kind of instrument, with what is known of it.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq)]
pub enum Sensor {
    /// Distance from the workpiece point to the tool point, less the nominal length unless `absolute`, m.
    Distance {
        /// Whether the reading is the distance itself.
        absolute: bool,
    },
    /// Position of the tool point in frame `w`, m.
    Position,
    /// Position of the tool point in frame `w`, m, and the rotation of the target there, rad.
    Pose,
    /// Movement of the tool point along a unit vector of frame `w`, m.
    Displacement {
        /// The unit vector.
        direction_w: Vec3<f64>,
    },
    /// Displacement of one joint, m or rad.
    Joint {
        /// Index of the dyad whose joint it is.
        dyad: usize,
    },
}

/// Values that belong to an instrument and may be unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorState<S> {
    /// Measured point in frame `t`, m.
    pub tool_point_t: Vec3<S>,
    /// How the target of a pose is turned in frame `t`.
    pub tool_rotation_t: Mat3<S>,
    /// Measured point in frame `w`, m.
    pub workpiece_point_w: Vec3<S>,
    /// Nominal length that a relative distance refers to, m.
    pub length: S,
    /// Reading at zero, m or rad.
    pub zero: S,
}

/// One scalar reading of the model.
#[derive(Clone, Copy, Debug)]
pub struct Reading<S> {
    /// What the instrument would read, m or rad. For the rotation part of a pose: minus the residual, see [`Sensor::readings`].
    pub value: S,
    /// Change of the reading with a small twist of the tool seen from the workpiece, in frame `w`.
    pub by_twist_w: Wrench<S>,
    /// Change of the reading with the tool point, in frame `t`.
    pub by_tool_point_t: Vec3<S>,
    /// Change of the reading with a small turn of the target, in its own frame.
    pub by_tool_rotation: Vec3<S>,
}

impl Sensor {
    /// The kind as recordings spell it.
    pub fn name(&self) -> &'static str {
        match self {
            Sensor::Distance { .. } => "distance",
            Sensor::Position => "position",
            Sensor::Pose => "pose",
            Sensor::Displacement { .. } => "displacement",
            Sensor::Joint { .. } => "joint",
        }
    }

    /// How many scalar readings a sample has.
    pub fn reading_count(&self) -> usize {
        match self {
            Sensor::Position => 3,
            Sensor::Pose => 6,
            Sensor::Distance { .. } | Sensor::Displacement { .. } | Sensor::Joint { .. } => 1,
        }
    }

    /// Whether this sensor's zero shifts its readings.
    pub fn has_zero(&self) -> bool {
        matches!(self, Sensor::Displacement { .. } | Sensor::Joint { .. })
    }

    /// The quantity of reading `i`; `prismatic` says so of the joint that [`Sensor::Joint`] reads.
    pub fn quantity(&self, i: usize, prismatic: bool) -> Quantity {
        match self {
            Sensor::Pose if i >= 3 => Quantity::Angle,
            Sensor::Joint { .. } if !prismatic => Quantity::Angle,
            _ => Quantity::Length,
        }
    }

    /// What the instrument reads on the machine at this sweep, for every kind but [`Sensor::Joint`] (which no chain is needed for).
    ///
    /// `measured_rotation_w` is the measured rotation of the target in `w`; the rotation readings of a pose are relative to it,
    /// `-log(R_measured R_modelᵀ)`, so that measured minus model is the rotation vector that is missing.
    pub fn readings<S: Scalar>(
        &self,
        sweep: &Sweep<S>,
        state: &SensorState<S>,
        measured_rotation_w: Mat3<f64>,
    ) -> ([Reading<S>; MOST_READINGS], usize) {
        let w_from_t = sweep.w_from_t();
        let p_w = w_from_t.transform(state.tool_point_t);
        let like = p_w.0[0];
        let t_from_w = w_from_t.rotation.transpose();
        let of_point = |i: usize| {
            let (value, n_w) = self.of_point(i, p_w, state);
            let (by_twist_w, by_tool_rotation) = (Wrench::at_point(n_w, p_w), Vec3::zero(like));
            Reading { value, by_twist_w, by_tool_point_t: t_from_w * n_w, by_tool_rotation }
        };
        let mut readings = [of_point(0); MOST_READINGS];
        match self {
            Sensor::Distance { .. } | Sensor::Displacement { .. } => {}
            Sensor::Position => (readings[1], readings[2]) = (of_point(1), of_point(2)),
            Sensor::Pose => {
                (readings[1], readings[2]) = (of_point(1), of_point(2));
                // (18): φ = log(R_measured R_modelᵀ); its change with a turn of the model is -J⁻¹(-φ).
                let target_from_w = (w_from_t.rotation * state.tool_rotation_t).transpose();
                let missing = crate::lie::Pose {
                    rotation: measured_rotation_w.lift(like) * target_from_w,
                    translation: Vec3::zero(like),
                };
                let phi = missing.rotation_vector();
                let jacobian = inverse_left_jacobian_so3(-phi);
                for k in 0..3 {
                    readings[3 + k] = Reading {
                        value: -phi.0[k],
                        by_twist_w: Wrench::couple(Vec3(jacobian.0[k])),
                        by_tool_point_t: Vec3::zero(like),
                        by_tool_rotation: target_from_w * Vec3(jacobian.0[k]),
                    };
                }
            }
            Sensor::Joint { .. } => unreachable!("a joint's reading needs no sweep"),
        }
        (readings, self.reading_count())
    }

    /// Value of reading `i`, m, where the tool point is at `p_w`, and the unit vector of `w` along which it answers to that point: lengths,
    /// and the position part of a pose.
    #[inline(always)]
    pub(crate) fn of_point<S: Scalar>(&self, i: usize, p_w: Vec3<S>, state: &SensorState<S>) -> (S, Vec3<S>) {
        let like = p_w.0[0];
        match self {
            Sensor::Distance { absolute } => {
                // (16): the unit vector along the bar is the force of the wrench.
                let bar = p_w - state.workpiece_point_w;
                let distance = bar.norm();
                let value = if *absolute { distance } else { distance - state.length };
                (value, bar.times(distance.recip()))
            }
            Sensor::Displacement { direction_w } => {
                // (17)
                let n = direction_w.lift(like);
                (n.dot(p_w) + state.zero, n)
            }
            // (15)
            _ => {
                let (o, l, [x, y, z]) = (like.lift(0.0), like.lift(1.0), p_w.0);
                match i {
                    0 => (x, Vec3([l, o, o])),
                    1 => (y, Vec3([o, l, o])),
                    _ => (z, Vec3([o, o, l])),
                }
            }
        }
    }
}

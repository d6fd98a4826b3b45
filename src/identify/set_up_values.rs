//! What the recordings leave unknown of their set-ups beside frame `w`: tool points and rotations, zeros, lengths.

use super::source::{Known, Source, Sources};
use crate::lie::{Mat3, Vec3};
use crate::sensor::SensorState;

/// Present values, in the order of [`Sources`].
#[derive(Clone, Debug)]
pub(crate) struct SetUpValues {
    /// In frame `t`, m.
    pub tool_points: Vec<Vec3<f64>>,
    /// m or rad.
    pub zeros: Vec<f64>,
    /// m.
    pub lengths: Vec<f64>,
    /// Of targets in frame `t`.
    pub tool_rotations: Vec<Mat3<f64>>,
}

impl SetUpValues {
    /// All zero, targets turned as frame `t`.
    pub fn zero(sources: &Sources) -> Self {
        SetUpValues {
            tool_points: vec![Vec3([0.0; 3]); sources.tool_points.len()],
            zeros: vec![0.0; sources.zeros.len()],
            lengths: vec![0.0; sources.lengths.len()],
            tool_rotations: vec![Mat3::identity(0.0); sources.tool_rotations.len()],
        }
    }

    /// The instrument's own values for a source.
    pub fn sensor_state(&self, source: &Source) -> SensorState<f64> {
        SensorState {
            tool_point_t: source.tool_point.among(&self.tool_points),
            tool_rotation_t: source.tool_rotation.among(&self.tool_rotations),
            workpiece_point_w: source.recording.header().workpiece_point,
            length: source.length.among(&self.lengths),
            zero: source.zero.among(&self.zeros),
        }
    }
}

impl<T: Copy> Known<T> {
    /// The value, if need be the present one of the unknown.
    pub fn among(self, unknowns: &[T]) -> T {
        match self {
            Known::Value(value) => value,
            Known::Unknown(i) => unknowns[i],
        }
    }
}

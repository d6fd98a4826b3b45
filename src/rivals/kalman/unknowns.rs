//! The state's unknowns, and how readings depend on them.

use nalgebra::{DMatrix, DVector};

use super::Kalman;
use crate::chain::{Chain, deviation_jacobian};
use crate::identify::Known;
use crate::lie::{Mat3, Pose, Twist, Vec3};
use crate::rivals::scheme::measured_rotation;
use crate::sensor::{Sensor, SensorState};

/// Where an unknown stands in the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
    Dyad(usize),
    Frame(usize),
    ToolPoint(usize),
    ToolRotation(usize),
    Zero(usize),
    Length(usize),
}

#[derive(Clone, Debug)]
pub(super) struct Block {
    pub role: Role,
    pub offset: usize,
    pub scale: Vec<f64>,
}

/// Frame `w` of one set-up.
#[derive(Clone, Debug)]
pub(super) struct FrameW {
    pub setup: String,
    /// In the frame before it; where it is found from nothing this is what moves.
    pub previous_from_w: Pose<f64>,
    pub dh: Twist<f64>,
    pub free: bool,
}

#[derive(Clone, Debug)]
pub(super) struct Values {
    pub dh: Vec<Twist<f64>>,
    pub frames: Vec<FrameW>,
    pub tool_points: Vec<(String, Vec3<f64>)>,
    pub tool_rotations: Vec<(String, Mat3<f64>)>,
    /// Set-up, channel, value; `None` until the first reading.
    pub zeros: Vec<(String, String, Option<f64>)>,
    pub lengths: Vec<(String, Option<f64>)>,
}

/// A stream of samples, and which unknowns its readings depend on.
#[derive(Clone, Debug)]
pub(super) struct Opened {
    pub sensor: Sensor,
    pub frame: usize,
    pub tool_point: Known<Vec3<f64>>,
    pub tool_rotation: Known<Mat3<f64>>,
    pub workpiece_point: Vec3<f64>,
    pub zero: Known<f64>,
    pub length: Known<f64>,
    pub sigmas: Vec<f64>,
}

impl Kalman {
    /// The values moved by an offset in units of the scales.
    pub(super) fn moved(&self, offset: &DVector<f64>) -> Values {
        let mut next = self.values.clone();
        for block in &self.blocks {
            let at = |k: usize| offset[block.offset + k] * block.scale[k];
            let twist = || Twist::from_array(std::array::from_fn(at));
            match block.role {
                Role::Dyad(j) => next.dh[j] = next.dh[j] + twist(),
                Role::Frame(i) => next.frames[i].dh = next.frames[i].dh + twist(),
                Role::ToolPoint(i) => {
                    next.tool_points[i].1 = next.tool_points[i].1 + Vec3(std::array::from_fn(at));
                }
                Role::ToolRotation(i) => {
                    let turn = Twist::new(Vec3([0.0; 3]), Vec3(std::array::from_fn(at)));
                    let rotation = &mut next.tool_rotations[i].1;
                    *rotation = *rotation * Pose::exp(turn).rotation;
                }
                Role::Zero(i) => next.zeros[i].2 = next.zeros[i].2.map(|z| z + at(0)),
                Role::Length(i) => next.lengths[i].1 = next.lengths[i].1.map(|l| l + at(0)),
            }
        }
        next
    }

    /// Residuals at the values moved by `offset`, and the rows of the readings over the scaled state there.
    pub(super) fn linearised(
        &self,
        opened: &Opened,
        commands: &[f64],
        measured: &[f64],
        offset: &DVector<f64>,
    ) -> (DVector<f64>, DMatrix<f64>) {
        let values = self.moved(offset);
        let count = opened.sensor.reading_count();
        let mut residuals = DVector::zeros(count);
        let mut rows = DMatrix::zeros(count, offset.len());
        let frame = &values.frames[opened.frame];
        let zero = match opened.zero {
            Known::Value(zero) => zero,
            Known::Unknown(i) => values.zeros[i].2.unwrap_or(0.0),
        };
        let block = |role: Role| self.blocks.iter().find(|b| b.role == role);
        let mut put = |i: usize, role: Role, row: &[f64]| {
            if let Some(block) = block(role) {
                row.iter()
                    .zip(&block.scale)
                    .enumerate()
                    .for_each(|(k, (x, s))| rows[(i, block.offset + k)] = x * s);
            }
        };
        if let Sensor::Joint { dyad } = opened.sensor {
            let xi = self.machine.dyads()[dyad].joint.as_ref().map_or(Twist::zero(0.0), |j| j.twist());
            let dh = values.dh[dyad];
            let displacement = self.machine.displacements(commands)[dyad];
            residuals[0] = measured[0] - (displacement + xi.v.dot(dh.v) + xi.w.dot(dh.w) + zero);
            put(0, Role::Dyad(dyad), &xi.to_array());
            if let Some(i) = opened.zero.unknown() {
                put(0, Role::Zero(i), &[1.0]);
            }
            return (residuals, rows);
        }
        let w = self.machine.w_index();
        let mut chain = Chain::new(&self.machine, &values.dh);
        chain.set_previous_from_frame(w, frame.previous_from_w * Pose::exp(frame.dh));
        let sweep = chain.sweep(commands);
        let state = SensorState {
            tool_point_t: match opened.tool_point {
                Known::Value(at) => at,
                Known::Unknown(i) => values.tool_points[i].1,
            },
            tool_rotation_t: match opened.tool_rotation {
                Known::Value(rotation) => rotation,
                Known::Unknown(i) => values.tool_rotations[i].1,
            },
            workpiece_point_w: opened.workpiece_point,
            length: match opened.length {
                Known::Value(length) => length,
                Known::Unknown(i) => values.lengths[i].1.unwrap_or(0.0),
            },
            zero,
        };
        let (readings, _) =
            opened.sensor.readings(&sweep, &state, measured_rotation(&opened.sensor, measured));
        let mut row = vec![0.0; 6 * self.machine.dyads().len()];
        for (i, reading) in readings.iter().take(count).enumerate() {
            residuals[i] = if i < 3 { measured[i] } else { 0.0 } - reading.value;
            sweep.error_row(reading.by_twist_w, &mut row);
            for (j, own) in row.chunks(6).enumerate() {
                let (role, dh) = if j == w {
                    (Role::Frame(opened.frame), frame.dh)
                } else {
                    (Role::Dyad(j), values.dh[j])
                };
                // (12): from the increment to the deviation's own coordinates.
                let turn = deviation_jacobian(dh);
                let by_dh: [f64; 6] = std::array::from_fn(|k| (0..6).map(|m| own[m] * turn[m][k]).sum());
                put(i, role, &by_dh);
            }
            if let Some(p) = opened.tool_point.unknown() {
                put(i, Role::ToolPoint(p), &reading.by_tool_point_t.0);
            }
            if let Some(r) = opened.tool_rotation.unknown() {
                put(i, Role::ToolRotation(r), &reading.by_tool_rotation.0);
            }
            if let Some(z) = opened.zero.unknown() {
                put(i, Role::Zero(z), &[1.0]);
            }
            if let Some(l) = opened.length.unknown() {
                put(i, Role::Length(l), &[-1.0]);
            }
        }
        (residuals, rows)
    }
}

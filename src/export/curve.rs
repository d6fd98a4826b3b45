//! The position error of one joint over its travel, approached from either side.

use crate::calibration::{CalibratedMachine, LeftOut};
use crate::error::Result;
use crate::predict::predict;
use crate::recording::Arrays;

use super::travel::{Passage, at_zero};

/// Errors (actual minus commanded) of one joint, all others at zero; m or rad.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub command: usize,
    pub positions: Vec<f64>,
    /// Approached in the positive sense.
    pub forward: Vec<f64>,
    /// Approached in the negative sense.
    pub backward: Vec<f64>,
    pub left_out: Vec<LeftOut>,
}

impl Curve {
    /// Of a command at so many points.
    ///
    /// # Errors
    /// As [`predict`].
    pub fn new(calibrated: &CalibratedMachine, command: usize, points: usize) -> Result<Curve> {
        let machine = calibrated.machine();
        let Passage { path, positions, up, down } = Passage::new(calibrated, command, points);
        let joint = machine.commands()[command].clone();
        let mut arrays = Arrays::joint(&joint, &vec![0.0; path.len()]);
        let still = vec![0.0; path.len()];
        for (c, name) in machine.commands().iter().enumerate() {
            arrays = arrays.command(name, if c == command { &path } else { &still });
        }
        let recording = arrays.recording("travel", machine)?;
        let mut rows = Vec::new();
        let prediction = predict(calibrated, &recording, Some(&mut rows))?;
        let rows = String::from_utf8_lossy(&rows);
        // The last columns are model and residual, and nothing was measured.
        let read: Vec<f64> = (rows.lines().filter(|line| !line.starts_with('#')).skip(1))
            .map(|line| line.rsplit(',').nth(1).and_then(|cell| cell.parse().ok()).unwrap_or(0.0))
            .collect();
        let error = |k: &usize| read.get(*k).map_or(0.0, |read| read - path[*k]);
        let mut curve = Curve {
            command,
            positions,
            forward: up.iter().map(error).collect(),
            backward: down.iter().map(error).collect(),
            left_out: prediction.left_out,
        };
        let zero = at_zero(&curve.positions, &curve.forward, &curve.backward);
        let shift = |errors: &mut Vec<f64>| errors.iter_mut().for_each(|e| *e -= zero);
        shift(&mut curve.forward);
        shift(&mut curve.backward);
        Ok(curve)
    }

    /// Whether the joint errs at all; what is below a picometre is rounding.
    pub fn is_zero(&self) -> bool {
        self.forward.iter().chain(&self.backward).all(|e| e.abs() < 1e-12)
    }

    /// Mean difference of both directions, m or rad: what a backlash parameter takes.
    pub fn backlash(&self) -> f64 {
        let sum: f64 = self.forward.iter().zip(&self.backward).map(|(f, b)| b - f).sum();
        sum / self.positions.len() as f64
    }
}

//! The position error of one joint over its travel, approached from either side.

use crate::calibration::{CalibratedMachine, LeftOut};
use crate::error::Result;
use crate::predict::predict;
use crate::recording::Arrays;

use super::travel::range;

/// Steps between two points of a table, so that what depends on the way is followed.
const BETWEEN: usize = 8;
/// By what part of its range a joint overruns its ends, so that play is taken up before the first point.
const OVERRUN: f64 = 0.02;

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
        let (from, to) = range(calibrated, command);
        let (count, steps) = (points.max(2), (points.max(2) - 1) * BETWEEN);
        let position = |i: usize| from + (to - from) * i as f64 / steps as f64;
        let over = OVERRUN * (to - from);
        let up: Vec<f64> =
            std::iter::once(from - over).chain((0..=steps).map(position)).chain([to + over]).collect();
        // Up, down and up again: the first way up has no history.
        let path: Vec<f64> = up.iter().chain(up.iter().rev()).chain(&up).copied().collect();
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
        let length = up.len();
        let error = |k: usize| read.get(k).map_or(0.0, |read| read - path[k]);
        let way_up = |i: usize| error(2 * length + 1 + i * BETWEEN);
        let way_down = |i: usize| error(2 * length - 2 - i * BETWEEN);
        let mut curve = Curve {
            command,
            positions: (0..count).map(|i| position(i * BETWEEN)).collect(),
            forward: (0..count).map(way_up).collect(),
            backward: (0..count).map(way_down).collect(),
            left_out: prediction.left_out,
        };
        let zero = curve.at_zero();
        let shift = |errors: &mut Vec<f64>| errors.iter_mut().for_each(|e| *e -= zero);
        shift(&mut curve.forward);
        shift(&mut curve.backward);
        Ok(curve)
    }

    /// The mean of both directions at the zero of the joint, or at the point of the travel next to it.
    fn at_zero(&self) -> f64 {
        let mean = |i: usize| 0.5 * (self.forward[i] + self.backward[i]);
        let after = self.positions.partition_point(|p| *p < 0.0);
        match after {
            0 => mean(0),
            n if n == self.positions.len() => mean(n - 1),
            n => {
                let (a, b) = (self.positions[n - 1], self.positions[n]);
                mean(n - 1) + (mean(n) - mean(n - 1)) * (0.0 - a) / (b - a)
            }
        }
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

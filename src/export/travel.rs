//! Commands spread evenly over the travel.

use std::f64::consts::PI;

use crate::calibration::CalibratedMachine;
use crate::machine::JointKind;

/// How far a linear axis without limits goes to either side, m.
const REACH: f64 = 0.25;
/// Bases of the sequence, one for each command; primes.
const PRIMES: [usize; 16] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53];

/// Steps between two points of a table, so that what depends on the way is followed.
const BETWEEN: usize = 8;
/// By what part of its range a joint overruns its ends, so that play is taken up before the first point.
const OVERRUN: f64 = 0.02;

/// The way of one joint through its range, there and back.
pub(super) struct Passage {
    /// Every position on the way, m or rad.
    pub path: Vec<f64>,
    /// The points that are told, rising.
    pub positions: Vec<f64>,
    /// Where on the way they are reached in the positive sense.
    pub up: Vec<usize>,
    /// The same in the negative sense.
    pub down: Vec<usize>,
}

impl Passage {
    /// Of a command with so many points.
    pub fn new(calibrated: &CalibratedMachine, command: usize, points: usize) -> Passage {
        let (from, to) = range(calibrated, command);
        let (count, steps) = (points.max(2), (points.max(2) - 1) * BETWEEN);
        let position = |i: usize| from + (to - from) * i as f64 / steps as f64;
        let over = OVERRUN * (to - from);
        let up: Vec<f64> =
            std::iter::once(from - over).chain((0..=steps).map(position)).chain([to + over]).collect();
        // Up, down and up again: the first way up has no history.
        let length = up.len();
        Passage {
            path: up.iter().chain(up.iter().rev()).chain(&up).copied().collect(),
            positions: (0..count).map(|i| position(i * BETWEEN)).collect(),
            up: (0..count).map(|i| 2 * length + 1 + i * BETWEEN).collect(),
            down: (0..count).map(|i| 2 * length - 2 - i * BETWEEN).collect(),
        }
    }
}

/// The mean of both directions at the zero of the joint, or at the point of the travel next to it.
pub(super) fn at_zero(positions: &[f64], forward: &[f64], backward: &[f64]) -> f64 {
    let mean = |i: usize| 0.5 * (forward[i] + backward[i]);
    let after = positions.partition_point(|p| *p < 0.0);
    match after {
        0 => mean(0),
        n if n == positions.len() => mean(n - 1),
        n => {
            let (a, b) = (positions[n - 1], positions[n]);
            mean(n - 1) + (mean(n) - mean(n - 1)) * (0.0 - a) / (b - a)
        }
    }
}

/// Range of a command over which errors are told, m or rad: its travel, of a joint that turns on and on one turn.
pub(super) fn range(calibrated: &CalibratedMachine, command: usize) -> (f64, f64) {
    let machine = calibrated.machine();
    let (from, to) = machine.travel(command);
    let revolute = machine.command_joint(command).kind == JointKind::Revolute;
    let reach = if revolute { PI } else { REACH };
    match (from.is_finite(), to.is_finite()) {
        (true, true) if revolute && to - from > 2.0 * PI => (-PI, PI),
        (true, true) => (from, to),
        (true, false) => (from, from + 2.0 * reach),
        (false, true) => (to - 2.0 * reach, to),
        (false, false) => (-reach, reach),
    }
}

/// Commands all over the travel (Halton's sequence), home first; m and rad, machine order.
pub(super) fn poses(calibrated: &CalibratedMachine, count: usize) -> Vec<Vec<f64>> {
    let commands = calibrated.machine().commands().len();
    let ranges: Vec<(f64, f64)> = (0..commands).map(|c| range(calibrated, c)).collect();
    let home = vec![0.0; commands];
    let at = |k: usize| {
        ranges.iter().enumerate().map(|(c, (from, to))| from + (to - from) * halton(k, c)).collect()
    };
    std::iter::once(home).chain((1..count).map(at)).collect()
}

/// Member `k` of van der Corput's sequence of a base; beyond the table of primes the golden ratio goes on.
fn halton(k: usize, c: usize) -> f64 {
    let Some(base) = PRIMES.get(c) else {
        return (k as f64 * 0.618_033_988_749_894_9 * (c as f64 + 1.0)).fract();
    };
    let (mut k, mut unit, mut sum) = (k, 1.0, 0.0);
    while k > 0 {
        unit /= *base as f64;
        sum += unit * (k % base) as f64;
        k /= base;
    }
    sum
}

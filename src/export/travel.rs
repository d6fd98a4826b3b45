//! Commands spread evenly over the travel.

use std::f64::consts::PI;

use crate::calibration::CalibratedMachine;
use crate::machine::JointKind;

/// How far a linear axis without limits goes to either side, m.
const REACH: f64 = 0.25;
/// Bases of the sequence, one for each command; primes.
const PRIMES: [usize; 16] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53];

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

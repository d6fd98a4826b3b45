//! The path and the preset errors of the paper, as its tables print them.

use super::profile::Pace;
use super::turning::{Balls, Figure, Rounding, Turning};
use super::turns::{Sense, Turns, rest};
use crate::error::Result;
use crate::lie::Vec3;
use crate::machine::Machine;

/// The executed path of the paper (tables 7 and 9) with a bar of `length` (m): the cone without tool centre point function, both
/// rotary axes against the sense that aims the tool, a stop after each half turn, to 360° and back, a position every `step` (rad;
/// the paper has 0.1°), rounded as the tables are. `docs/simulate.md` says how that was found out.
///
/// # Errors
/// [`Error::Motion`](crate::Error::Motion) where the machine has not two rotary axes, or does not reach the path.
pub fn paper_path(machine: &Machine, length: f64, step: f64) -> Result<Turning> {
    let Figure::Cone { half_apex, inclination, lead, .. } = Figure::cone() else {
        unreachable!("a cone is one")
    };
    let figure = Figure::Cone { half_apex, inclination, lead, tool_centre_point: false, reversed: true };
    let origin = Vec3([0.0; 3]);
    let balls = Balls { workpiece_point_w: origin, tool_point_t: origin, length };
    let turns = Turns {
        from: 0.0,
        to: std::f64::consts::TAU,
        senses: vec![Sense::Positive, Sense::Negative],
        parts: 2,
        repeat: 1,
        overshoot: 0.0,
        dwell: 0.0,
        paces: vec![Pace::Steps(step)],
    };
    let rounding = Rounding { direction_decimals: Some(5), rotary_step: Some(1e-3f64.to_radians()) };
    Turning::new(machine, figure, balls, &rest(machine), turns.legs(), 100.0, rounding)
}

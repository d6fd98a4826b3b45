//! Position errors of the joints over their travel as a table.

use std::fmt::Write;

use super::curve::Curve;
use super::numbers::{In, fixed, heading};
use super::{Exported, Remainder, refused};
use crate::calibration::CalibratedMachine;
use crate::error::{Error, Result};

/// Points of one joint.
pub(super) const POINTS: usize = 21;

/// The curves of all joints that err along themselves.
///
/// # Errors
/// Where there is none.
pub(super) fn curves(calibrated: &CalibratedMachine, points: usize) -> Result<Vec<Curve>> {
    let machine = calibrated.machine();
    let mut found = Vec::new();
    for command in 0..machine.commands().len() {
        let curve = Curve::new(calibrated, command, points)?;
        if !curve.is_zero() {
            found.push(curve);
        }
    }
    if found.is_empty() { Err(none(calibrated)) } else { Ok(found) }
}

fn none(calibrated: &CalibratedMachine) -> Error {
    refused(
        format!(
            "no axis of machine \"{}\" has a position error that depends on where it is",
            calibrated.machine().name()
        ),
        "find play and position errors by `kincal diagnose MACHINE.ron REC.csv -o CALIBRATED.ron`, or by `calibrate --directions`",
    )
}

/// Effects that the curves are without.
pub(super) fn left_out(curves: &[Curve]) -> Vec<Remainder> {
    let mut found: Vec<Remainder> = Vec::new();
    for left in curves.iter().flat_map(|curve| &curve.left_out) {
        let what = format!("{} at {}", left.effect, left.at);
        if found.iter().all(|known| known.what != what) {
            found.push(Remainder { what, max_m: None, rms_m: None, because: left.because.clone() });
        }
    }
    found
}

pub(super) fn write(calibrated: &CalibratedMachine) -> Result<Exported> {
    let machine = calibrated.machine();
    let curves = curves(calibrated, POINTS)?;
    let told = vec![
        "error: actual minus commanded position, approached from below (forward) and from above (backward), all other axes at zero".to_string(),
        "the mean of both directions at the zero of the axis is taken off: where its zero lies is no position error".to_string(),
    ];
    let mut text = format!("# {}\n", heading(machine.name(), "position errors"));
    told.iter().for_each(|line| text.push_str(&format!("# {line}\n")));
    text.push_str("joint,position,position_unit,forward,backward,error_unit\n");
    for curve in &curves {
        let joint = machine.command_joint(curve.command);
        let (at, error) = (In::position(joint.kind), In::error(joint.kind));
        for (i, position) in curve.positions.iter().enumerate() {
            let _ = writeln!(
                text,
                "{},{},{},{},{},{}",
                machine.commands()[curve.command],
                fixed(position * at.per_si),
                at.symbol,
                fixed(curve.forward[i] * error.per_si),
                fixed(curve.backward[i] * error.per_si),
                error.symbol
            );
        }
    }
    Ok(Exported { text, numbers: Vec::new(), left_out: left_out(&curves), told })
}

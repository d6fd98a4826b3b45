//! Compensation tables that controls read: LinuxCNC's `COMP_FILE`, Siemens' `ENC_COMP`.

use std::fmt::Write;

use super::curve::Curve;
use super::numbers::{DEG, MM, fixed, heading};
use super::table::{POINTS, curves, left_out};
use super::{ExportOptions, Exported, refused};
use crate::calibration::CalibratedMachine;
use crate::error::Result;
use crate::machine::{JointKind, Machine};

/// Most lines that LinuxCNC reads.
const MOST: usize = 256;

/// A curve in the program's own numbers, mm or deg, positions rising.
struct Programmed {
    positions: Vec<f64>,
    forward: Vec<f64>,
    backward: Vec<f64>,
    unit: &'static str,
}

fn programmed(machine: &Machine, curve: &Curve) -> Programmed {
    let joint = machine.command_joint(curve.command);
    let unit = if joint.kind == JointKind::Revolute { DEG } else { MM };
    let sign = f64::from(joint.nc_word().sign);
    let scaled = |values: &[f64]| -> Vec<f64> {
        let mut values: Vec<f64> = values.iter().map(|x| sign * x * unit.per_si).collect();
        if sign < 0.0 {
            values.reverse();
        }
        values
    };
    // Forward in the program is backward of the joint where the signs differ.
    let (up, down) =
        if sign < 0.0 { (&curve.backward, &curve.forward) } else { (&curve.forward, &curve.backward) };
    Programmed {
        positions: scaled(&curve.positions),
        forward: scaled(up),
        backward: scaled(down),
        unit: unit.symbol,
    }
}

/// One axis as LinuxCNC's `COMP_FILE` of type 0.
pub(super) fn comp_file(calibrated: &CalibratedMachine, options: &ExportOptions) -> Result<Exported> {
    let machine = calibrated.machine();
    let curves = curves(calibrated, POINTS)?;
    let names: Vec<&str> = curves.iter().map(|c| machine.commands()[c.command].as_str()).collect();
    let chosen = match &options.axis {
        Some(axis) => curves.iter().find(|c| machine.commands()[c.command] == *axis).ok_or_else(|| {
            refused(
                format!("axis \"{axis}\" has no position error that depends on where it is"),
                format!("name by --axis one of: {}", names.join(", ")),
            )
        })?,
        None => match &curves[..] {
            [only] => only,
            _ => {
                return Err(refused(
                    format!(
                        "LinuxCNC reads one file an axis, and {} axes have position errors",
                        curves.len()
                    ),
                    format!("name by --axis one of: {}", names.join(", ")),
                ));
            }
        },
    };
    let own = programmed(machine, chosen);
    let name = &machine.commands()[chosen.command];
    let told = vec![
        format!(
            "COMP_FILE of axis {name}, COMP_FILE_TYPE = 0: commanded position, then where the axis really is, forward and backward, {}",
            own.unit
        ),
        "it holds play as well: leave BACKLASH of this joint at 0".to_string(),
        "look at one position with an indicator before and after: the error must become smaller".to_string(),
    ];
    let mut text = String::new();
    for i in 0..own.positions.len().min(MOST) {
        let at = own.positions[i];
        let _ =
            writeln!(text, "{} {} {}", fixed(at), fixed(at + own.forward[i]), fixed(at + own.backward[i]));
    }
    Ok(Exported { text, numbers: Vec::new(), left_out: left_out(&curves), told })
}

/// All axes with position errors as a part program that fills `$AA_ENC_COMP`.
pub(super) fn enc_comp(calibrated: &CalibratedMachine) -> Result<Exported> {
    let machine = calibrated.machine();
    let curves = curves(calibrated, POINTS)?;
    let mut told = vec![
        "ENC_COMP: a positive value moves the axis in the negative direction; so each value is the error, actual minus commanded position, in mm or deg".to_string(),
        "the mean of both directions, 0 at the zero of the axis, which must be its reference point".to_string(),
        "MD38000 must allow the points, MD32700 switches the table on once the program has run and the axis is referenced".to_string(),
        "axes bear the address of the machine file and 1 (X1): write the control's own names where they differ".to_string(),
    ];
    let mut text = format!("; {}\n", heading(machine.name(), "encoder compensation"));
    let mut body = String::new();
    for curve in &curves {
        let own = programmed(machine, curve);
        let joint = machine.command_joint(curve.command);
        let address = joint.nc_word().address;
        let axis = if address.len() == 1 { format!("{address}1") } else { address };
        let half =
            0.5 * curve.backlash().abs() * if joint.kind == JointKind::Revolute { DEG } else { MM }.per_si;
        if half > 1e-6 {
            told.push(format!(
                "axis {axis} besides has {} {} of play in the mean, which ENC_COMP cannot hold",
                fixed(2.0 * half),
                own.unit
            ));
        }
        let mean = |i: usize| 0.5 * (own.forward[i] + own.backward[i]);
        if (0..own.positions.len()).all(|i| mean(i).abs() < 1e-9) {
            continue;
        }
        let (first, last) = (own.positions[0], own.positions[own.positions.len() - 1]);
        let step = (last - first) / (own.positions.len() - 1) as f64;
        for i in 0..own.positions.len() {
            let _ = writeln!(body, "$AA_ENC_COMP[0,{i},{axis}]={}", fixed(mean(i)));
        }
        let _ = writeln!(body, "$AA_ENC_COMP_STEP[0,{axis}]={}", fixed(step));
        let _ = writeln!(body, "$AA_ENC_COMP_MIN[0,{axis}]={}", fixed(first));
        let _ = writeln!(body, "$AA_ENC_COMP_MAX[0,{axis}]={}", fixed(last));
        let _ = writeln!(body, "$AA_ENC_COMP_IS_MODULO[0,{axis}]=0");
    }
    if body.is_empty() {
        return Err(refused(
            format!("the axes of machine \"{}\" have play alone, which ENC_COMP cannot hold", machine.name()),
            "--to table shows it; a control takes play as backlash",
        ));
    }
    told.iter().for_each(|line| text.push_str(&format!("; {line}\n")));
    text.push_str(&body);
    text.push_str("M17\n");
    Ok(Exported { text, numbers: Vec::new(), left_out: left_out(&curves), told })
}

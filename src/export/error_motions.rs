//! Error motions of every axis over its travel, under their names of ISO 230-1, as a table.
//!
//! For the axis at `q`, all others at zero, with the constant geometry taken off:
//!
//! ```text
//! E(q) = ± (p, phi)(q) - ± (p, phi)(0)          + in the tool branch, - in the workpiece branch
//! ```
//!
//! `p`, `phi`: how the tool is displaced and turned as the workpiece sees it, at the tip, in directions of the base.

use std::fmt::Write;

use super::numbers::{In, UM, URAD, fixed, heading};
use super::travel::{Passage, at_zero};
use super::{Exported, Remainder, refused};
use crate::calibration::CalibratedMachine;
use crate::error::Result;
use crate::lie::Vec3;
use crate::machine::Branch;
use crate::predict::residuals;
use crate::recording::Arrays;

/// Points of one axis.
const POINTS: usize = 21;
/// Letters of the six error motions: displacements, then turns.
const LETTERS: [&str; 6] = ["X", "Y", "Z", "A", "B", "C"];
/// What is below this comes from constant tilts of the axes, m or rad.
const DUST: f64 = 1e-9;

/// One error motion of an axis, m or rad.
struct Motion {
    positions: Vec<f64>,
    forward: Vec<f64>,
    backward: Vec<f64>,
}

pub(super) fn write(calibrated: &CalibratedMachine) -> Result<Exported> {
    let machine = calibrated.machine();
    let told = vec![
        "all other axes at zero, constant geometry taken off (--to iso230 has it); each is 0 in the mean of both directions at the zero of its axis".to_string(),
        "displacements (um) are those of the tip of the tool, turns (urad) right-handed, along the axes of the base; of an axis that carries the workpiece they are the workpiece's".to_string(),
        "forward: approached from below; reversal B: forward less backward".to_string(),
    ];
    let mut text = format!("# {}\n", heading(machine.name(), "error motions after ISO 230-1"));
    told.iter().for_each(|line| text.push_str(&format!("# {line}\n")));
    text.push_str("axis,name,position,position_unit,forward,backward,reversal,error_unit\n");
    let mut left_out: Vec<Remainder> = Vec::new();
    let mut found = false;
    for (command, name) in machine.commands().iter().enumerate() {
        let at = In::position(machine.command_joint(command).kind);
        for (k, motion) in motions(calibrated, command, &mut left_out)?.iter().enumerate() {
            if motion.forward.iter().chain(&motion.backward).all(|e| e.abs() < DUST) {
                continue;
            }
            found = true;
            let unit = if k < 3 { UM } else { URAD };
            for (i, position) in motion.positions.iter().enumerate() {
                let (forward, backward) = (motion.forward[i], motion.backward[i]);
                let _ = writeln!(
                    text,
                    "{name},E{}{},{},{},{},{},{},{}",
                    LETTERS[k],
                    name.to_uppercase(),
                    fixed(position * at.per_si),
                    at.symbol,
                    fixed(forward * unit.per_si),
                    fixed(backward * unit.per_si),
                    fixed((forward - backward) * unit.per_si),
                    unit.symbol
                );
            }
        }
    }
    if !found {
        return Err(refused(
            format!("no axis of machine \"{}\" has an error that depends on where it is", machine.name()),
            "find play and error motions by `kincal diagnose MACHINE.ron REC.csv -o CALIBRATED.ron`, or by `calibrate --directions`",
        ));
    }
    Ok(Exported { text, numbers: Vec::new(), left_out, told })
}

/// The six of an axis.
fn motions(
    calibrated: &CalibratedMachine,
    command: usize,
    left_out: &mut Vec<Remainder>,
) -> Result<Vec<Motion>> {
    let machine = calibrated.machine();
    let Passage { path, positions, up, down } = Passage::new(calibrated, command, POINTS);
    let chain = calibrated.chain();
    let pose = |q: &f64| {
        let mut all = vec![0.0; machine.commands().len()];
        all[command] = *q;
        let sweep = chain.sweep(&all);
        (sweep.w_from_t(), sweep.b_from_w().rotation)
    };
    let poses: Vec<_> = path.iter().map(pose).collect();
    let mut arrays = Arrays::pose(&poses.iter().map(|(w_from_t, _)| *w_from_t).collect::<Vec<_>>());
    let still = vec![0.0; path.len()];
    for (c, name) in machine.commands().iter().enumerate() {
        arrays = arrays.command(name, if c == command { &path } else { &still });
    }
    let joint = machine.joints().find(|(_, joint)| joint.name == machine.commands()[command]);
    let carries_workpiece = joint.is_some_and(|(j, _)| machine.branch(j) == Branch::Workpiece);
    let sign = if carries_workpiece { -1.0 } else { 1.0 };
    let mut errors: Vec<[f64; 6]> = Vec::with_capacity(path.len());
    let each = |left: &[f64]| {
        let Some((_, b_from_w)) = poses.get(errors.len()) else { return };
        // What was given as read is the constant geometry: the model is off by minus the residual.
        let turned = |k: usize| *b_from_w * Vec3([left[k], left[k + 1], left[k + 2]]).times(-sign);
        let (p, phi) = (turned(0).0, turned(3).0);
        errors.push([p[0], p[1], p[2], phi[0], phi[1], phi[2]]);
    };
    let prediction = residuals(calibrated, &arrays.recording("travel", machine)?, each)?;
    for left in prediction.left_out {
        let what = format!("{} at {}", left.effect, left.at);
        if left_out.iter().all(|known| known.what != what) {
            left_out.push(Remainder { what, max_m: None, rms_m: None, because: left.because });
        }
    }
    let one = |k: usize| {
        let of = |places: &[usize]| -> Vec<f64> {
            places.iter().map(|i| errors.get(*i).map_or(0.0, |own| own[k])).collect()
        };
        let (mut forward, mut backward) = (of(&up), of(&down));
        let zero = at_zero(&positions, &forward, &backward);
        forward.iter_mut().chain(&mut backward).for_each(|e| *e -= zero);
        Motion { positions: positions.clone(), forward, backward }
    };
    Ok((0..6).map(one).collect())
}

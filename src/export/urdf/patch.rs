//! A URDF file with the origins of one chain written anew.

use std::path::Path;

use super::{origin, told, triple};
use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::error::{Error, Place, Result};
use crate::export::travel::poses;
use crate::export::{Exported, Remainder};
use crate::import::{Edit, Ends, Held, origins, read};
use crate::lie::{Pose, Twist};
use crate::machine::{Dyad, Machine};

/// A base file is that of a machine if frames agree to this, m and rad: machine files may have been written with fewer digits.
const SAME: f64 = 1e-6;
/// What is written must stand where the calibrated machine does, m and rad; rounding of a dozen products.
const ROUNDING: f64 = 1e-9;

/// The text of `file` with the calibrated origins of the chain between `ends`; all other bytes are kept.
///
/// # Errors
/// [`Error::Input`] where the file is no URDF, or not the machine's.
pub(in crate::export) fn patched(
    calibrated: &CalibratedMachine,
    file: &Path,
    text: &str,
    ends: &Ends,
) -> Result<Exported> {
    let (imported, held) = origins(file, text, ends)?;
    is_same(calibrated, &imported.machine, file, &held)?;
    let machine = calibrated.machine();
    let mut exported = told(calibrated)?;
    exported.told.extend(imported.told);
    let dh = calibrated.deviations();
    let is_zero = |j: usize| dh[j].to_array() == [0.0; 6];
    let w = machine.w_index();
    // A frame that bears the name of a link has no joint of its own: nothing in the file can move it.
    let fixed = |j: usize| held[j].origins.is_empty();
    let mut goal: Vec<Pose<f64>> =
        (0..held.len()).map(|j| calibrated.chain().previous_from_frame(j)).collect();
    let mut changed: Vec<bool> = (0..held.len()).map(|j| !is_zero(j)).collect();
    let mut kept = dh.to_vec();
    if fixed(w) && !is_zero(w) && w == 0 {
        // With no joint between base and workpiece the base may stand anywhere: the first tool frame takes it.
        goal[1] = goal[0].inverse() * goal[1];
        goal[0] = Pose::identity(0.0);
        (changed[0], changed[1]) = (false, true);
    }
    for j in 0..held.len() {
        if fixed(j) && changed[j] {
            (changed[j], kept[j]) = (false, Twist::zero(0.0));
            exported.left_out.push(unheld(calibrated, j, &kept));
        }
    }
    let mut edits: Vec<(usize, usize, String)> = Vec::new();
    for (j, held) in held.iter().enumerate().filter(|(j, _)| changed[*j]) {
        edits.extend(edit(held, goal[j]));
    }
    edits.sort_by_key(|(from, _, _)| *from);
    let mut out = String::with_capacity(text.len() + 64 * edits.len());
    let mut at = 0;
    for (from, to, new) in &edits {
        let Some(before) = text.get(at..*from) else { return Err(crossed(file)) };
        out.push_str(before);
        out.push_str(new);
        at = *to;
    }
    out.push_str(text.get(at..).ok_or_else(|| crossed(file))?);
    stands_there(calibrated, &kept, file, &out, ends)?;
    let joints = held.iter().zip(&changed).filter(|(_, changed)| **changed);
    let joints: Vec<String> =
        joints.filter_map(|(held, _)| Some(held.origins.last()?.joint.clone())).collect();
    exported.told.push(if joints.is_empty() {
        "no origin is changed: the file holds no deviation of them".into()
    } else {
        format!("origins written anew: {}; every other byte is as it was", joints.join(", "))
    });
    exported.text = out;
    Ok(exported)
}

/// The origin of the last joint on the way to a frame, so that the frame has this pose in the one before it.
fn edit(held: &Held, previous_from_frame: Pose<f64>) -> Vec<(usize, usize, String)> {
    let Some((last, before)) = held.origins.split_last() else { return Vec::new() };
    let before = before.iter().fold(Pose::identity(0.0), |pose, o| pose * o.parent_from_joint);
    let (xyz, rpy) = origin(before.inverse() * previous_from_frame * held.offset.inverse());
    match &last.edit {
        Edit::Whole(at) => {
            vec![(*at, *at, format!("<origin xyz=\"{}\" rpy=\"{}\"/>", triple(xyz), triple(rpy)))]
        }
        Edit::Values { xyz: in_xyz, rpy: in_rpy, missing } => {
            let mut edits = Vec::new();
            let mut absent = String::new();
            for (name, range, numbers) in [("xyz", in_xyz, xyz), ("rpy", in_rpy, rpy)] {
                match range {
                    Some(range) => edits.push((range.start, range.end, triple(numbers))),
                    None => absent.push_str(&format!(" {name}=\"{}\"", triple(numbers))),
                }
            }
            if !absent.is_empty() {
                edits.push((*missing, *missing, absent));
            }
            edits
        }
    }
}

fn crossed(file: &Path) -> Error {
    Error::mistake(
        Place::file(file),
        "the origins of this file cannot be written anew one by one",
        "write the numbers themselves into the joints, no entities of a DTD",
    )
}

/// Whether the machine was imported from this file.
fn is_same(calibrated: &CalibratedMachine, found: &Machine, file: &Path, held: &[Held]) -> Result<()> {
    let machine = calibrated.machine();
    let fault = |line: usize, what: String| {
        let mend = "give the file that the machine was imported from, and the same --base and --tip";
        Err(Error::mistake(Place::at(file, line, 0), what, mend))
    };
    let frames = |m: &Machine| m.dyads().iter().map(|d| d.frame.clone()).collect::<Vec<_>>();
    let (own, other) = (frames(machine), frames(found));
    if own != other || machine.workpiece_count() != found.workpiece_count() {
        let what = format!(
            "this file's chain has the frames {}, machine \"{}\" has {}",
            other.join(", "),
            machine.name(),
            own.join(", ")
        );
        return fault(0, what);
    }
    for (j, (a, b)) in machine.dyads().iter().zip(found.dyads()).enumerate() {
        let line = held[j].origins.last().map_or(0, |o| o.line);
        let gap = (a.placement.pose().inverse() * b.placement.pose()).log().to_array();
        if gap.iter().any(|x| x.abs() > SAME) {
            let what = format!(
                "frame {} stands elsewhere in this file than machine \"{}\" declares it",
                a.frame,
                machine.name()
            );
            return fault(line, what);
        }
        let moves = |d: &Dyad| d.joint.as_ref().map(|joint| (joint.kind, joint.axis));
        let same = match (moves(a), moves(b)) {
            (Some((kind, axis)), Some((other, other_axis))) => {
                kind == other && (axis - other_axis).norm() < SAME
            }
            (None, None) => true,
            _ => false,
        };
        if !same {
            let what = format!(
                "joint {} moves otherwise in this file than in machine \"{}\"",
                a.frame,
                machine.name()
            );
            return fault(line, what);
        }
    }
    Ok(())
}

/// The deviation of a frame that no joint of the file carries. `kept`: what the file holds.
fn unheld(calibrated: &CalibratedMachine, j: usize, kept: &[Twist<f64>]) -> Remainder {
    let machine = calibrated.machine();
    let mut without = calibrated.deviations().to_vec();
    without[j] = kept[j];
    let (all, left) = (calibrated.chain(), Chain::new(machine, &without));
    let errors: Vec<f64> = poses(calibrated, 200)
        .iter()
        .map(|q| (all.w_from_t(q).translation - left.w_from_t(q).translation).norm())
        .collect();
    Remainder {
        what: format!("the deviation of frame {}", machine.dyads()[j].frame),
        max_m: Some(errors.iter().copied().fold(0.0, f64::max)),
        rms_m: Some((errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()),
        because: "no joint of the file lies between it and the joint before; import with a link on a fixed joint as --tip or --base".into(),
    }
}

/// Reads what was written, and compares.
fn stands_there(
    calibrated: &CalibratedMachine,
    kept: &[Twist<f64>],
    file: &Path,
    text: &str,
    ends: &Ends,
) -> Result<()> {
    let written = Chain::nominal(&read(file, text, ends)?.machine);
    let goal = Chain::new(calibrated.machine(), kept);
    let off = poses(calibrated, 20).iter().any(|q| {
        let gap = (written.w_from_t(q).inverse() * goal.w_from_t(q)).log().to_array();
        gap.iter().any(|x| x.is_nan() || x.abs() > ROUNDING + SAME)
    });
    if off { Err(crossed(file)) } else { Ok(()) }
}

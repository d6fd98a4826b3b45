//! URDF: a file of its own, or the origins of a file that is there, every other byte kept.

mod patch;

use std::fmt::Write;

pub(super) use patch::patched;

use super::known::Known;
use super::numbers::{exact, heading, one_line};
use super::varying::varying;
use super::{Exported, Remainder, refused};
use crate::calibration::CalibratedMachine;
use crate::error::Result;
use crate::lie::{Pose, Vec3};
use crate::machine::{Branch, Dyad, Joint, JointKind, Machine};

/// What stays out of every URDF file.
const CONSTANT: &str = "URDF holds constant geometry only; `compensate` and `predict` take it";

/// `xyz` and `rpy` of a pose: R = Rz(yaw) Ry(pitch) Rx(roll). Each angle is taken out before the next is read, so that the three give the
/// rotation to rounding where pitch is a quarter turn, too.
pub(super) fn origin(pose: Pose<f64>) -> ([f64; 3], [f64; 3]) {
    let turned_back = |axis: usize, angle: f64, pose: Pose<f64>| {
        Pose::turn(Vec3(std::array::from_fn(|i| f64::from(u8::from(i == axis)))), -angle) * pose
    };
    let r = pose.rotation.0;
    let yaw = r[1][0].atan2(r[0][0]);
    let rest = turned_back(2, yaw, pose);
    let pitch = (-rest.rotation.0[2][0]).atan2(rest.rotation.0[0][0]);
    let rest = turned_back(1, pitch, rest);
    let roll = rest.rotation.0[2][1].atan2(rest.rotation.0[1][1]);
    (pose.translation.0, [roll, pitch, yaw])
}

/// Three numbers of an attribute.
pub(super) fn triple(numbers: [f64; 3]) -> String {
    numbers.map(exact).join(" ")
}

/// A text between quotes of an attribute, or between comments.
fn escaped(text: &str) -> String {
    let text = one_line(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    text.replace('"', "&quot;").replace("--", "- -")
}

/// A whole file from the calibrated machine.
///
/// # Errors
/// A joint that follows others as URDF cannot say.
pub(super) fn write(calibrated: &CalibratedMachine) -> Result<Exported> {
    let machine = calibrated.machine();
    let chain = calibrated.chain();
    let mut exported = told(calibrated)?;
    let names: Vec<&str> = machine.dyads().iter().map(|d| d.frame.as_str()).collect();
    let root = ["base", "floor", "root", "base_link"].into_iter().find(|name| !names.contains(name));
    let root = root.map_or_else(|| format!("base_of_{}", names.join("_")), str::to_string);
    let mut text =
        format!("<?xml version=\"1.0\"?>\n<!-- {} -->\n", escaped(&heading(machine.name(), "URDF")));
    let _ = writeln!(text, "<!-- import it by kincal import with base w and tip t -->");
    exported.told.iter().for_each(|line| {
        let _ = writeln!(text, "<!-- {} -->", escaped(line));
    });
    let _ = writeln!(text, "<robot name=\"{}\">\n  <link name=\"{root}\"/>", escaped(machine.name()));
    for (j, dyad) in machine.dyads().iter().enumerate() {
        let first = j == 0 || j == machine.workpiece_count();
        let parent = if first { root.as_str() } else { names[j - 1] };
        link(&mut text, dyad);
        joint(&mut text, machine, j, parent, chain.previous_from_frame(j))?;
    }
    text.push_str("</robot>\n");
    if !machine.side_branches().is_empty() {
        exported.left_out.push(Remainder {
            what: "side branches of the machine".into(),
            max_m: None,
            rms_m: None,
            because: "they are not measured, and no part of the chain from w to t".into(),
        });
    }
    exported.text = text;
    Ok(exported)
}

/// What is told of every URDF file.
pub(super) fn told(calibrated: &CalibratedMachine) -> Result<Exported> {
    let mut told = vec![
        "origins hold the calibrated geometry, zero positions of joints included; lengths in m, angles in rad".to_string(),
        "no calibration tags: those of URDF (rising, falling) say where a reference switch is, not how a zero is off".to_string(),
        "the numbers belong together: take all or none, since deviations are shared out between neighbouring frames".to_string(),
    ];
    told.extend(Known::new(calibrated).sentence());
    told.extend(super::known::open_at_tool(calibrated));
    Ok(Exported { left_out: varying(calibrated, CONSTANT)?, told, ..Exported::default() })
}

fn link(text: &mut String, dyad: &Dyad) {
    let name = escaped(&dyad.frame);
    match dyad.mass {
        None => {
            let _ = writeln!(text, "  <link name=\"{name}\"/>");
        }
        Some(mass) => {
            let _ = writeln!(
                text,
                "  <link name=\"{name}\">\n    <inertial><origin xyz=\"{}\"/><mass value=\"{}\"/><inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/></inertial>\n  </link>",
                triple(mass.centre.0),
                exact(mass.mass)
            );
        }
    }
}

fn joint(text: &mut String, machine: &Machine, j: usize, parent: &str, pose: Pose<f64>) -> Result<()> {
    let dyad = &machine.dyads()[j];
    let (xyz, rpy) = origin(pose);
    let (name, kind) = match &dyad.joint {
        None => (format!("to_{}", dyad.frame), "fixed"),
        Some(joint) => (joint.name.clone(), kind(joint)),
    };
    let _ = writeln!(text, "  <joint name=\"{}\" type=\"{kind}\">", escaped(&name));
    let _ = writeln!(
        text,
        "    <parent link=\"{}\"/><child link=\"{}\"/>",
        escaped(parent),
        escaped(&dyad.frame)
    );
    let _ = writeln!(text, "    <origin xyz=\"{}\" rpy=\"{}\"/>", triple(xyz), triple(rpy));
    if let Some(joint) = &dyad.joint {
        let _ = writeln!(text, "    <axis xyz=\"{}\"/>", triple(joint.axis.0));
        let limit = match joint.travel {
            Some((from, to)) => Some((from, to)),
            None if joint.kind == JointKind::Prismatic => Some((-1e3, 1e3)),
            None => None,
        };
        if let Some((from, to)) = limit {
            let _ = writeln!(
                text,
                "    <limit lower=\"{}\" upper=\"{}\" effort=\"0\" velocity=\"0\"/>",
                exact(from),
                exact(to)
            );
        }
        mimic(text, machine, j, joint)?;
    }
    text.push_str("  </joint>\n");
    Ok(())
}

fn kind(joint: &Joint) -> &'static str {
    match (joint.kind, joint.travel) {
        (JointKind::Prismatic, _) => "prismatic",
        (JointKind::Revolute, Some(_)) => "revolute",
        (JointKind::Revolute, None) => "continuous",
    }
}

/// The joint that this one follows, if it follows one.
fn mimic(text: &mut String, machine: &Machine, j: usize, joint: &Joint) -> Result<()> {
    let terms = machine.drive(j).map_or(&[][..], |drive| &drive.terms);
    match terms {
        [(c, factor)] if machine.commands()[*c] == joint.name && *factor == 1.0 => Ok(()),
        [(c, factor)] if machine.commands()[*c] != joint.name => {
            let leader = escaped(&machine.commands()[*c]);
            let _ = writeln!(text, "    <mimic joint=\"{leader}\" multiplier=\"{}\"/>", exact(*factor));
            Ok(())
        }
        _ => Err(refused(
            format!(
                "joint \"{}\" on the {} side moves with several commands, which URDF cannot say",
                joint.name,
                if machine.branch(j) == Branch::Tool { "tool" } else { "workpiece" }
            ),
            "a mimic joint of URDF follows one other joint; export such a machine by --to dh or mdh",
        )),
    }
}

//! MJCF: the calibrated geometry as a model of MuJoCo, and of the named effects what MuJoCo can hold.

mod drive;
mod term;
mod weight;

use std::fmt::Write;

use self::drive::{Drive, MOTOR, Refused, STEP, drives, is_plain};
use self::weight::{Weight, weights};
use super::known::Known;
use super::numbers::{exact, heading, one_line};
use super::varying::varying;
use super::{Exported, Number, Remainder};
use crate::calibration::CalibratedMachine;
use crate::error::Result;
use crate::lie::{Mat3, Pose};
use crate::machine::{Dyad, JointKind, Machine};

/// Why an effect stays out.
const CONSTANT: &str = "a model of MuJoCo has no place for it; `compensate` and `predict` take it";

/// A limit that gives way as little as MuJoCo can make it.
const HARD: &str = "solreflimit=\"0.002 1\" solimplimit=\"0.999 0.9999 0.000001\"";

/// Friction that holds: MuJoCo's own creeps under a load.
const HOLDS: &str = "solreffriction=\"-1 -2000\" solimpfriction=\"0.9999 0.9999 0.000001\"";

/// Acceleration of gravity, m/s2.
const GRAVITY: f64 = 9.80665;

pub(super) fn write(calibrated: &CalibratedMachine) -> Result<Exported> {
    let machine = calibrated.machine();
    let (drives, refused) = drives(calibrated)?;
    let pull_of = |joint: &str| drives.iter().find(|drive| drive.joint == joint)?.pull.as_ref();
    let weights = weights(machine, pull_of);
    let mut exported = told(calibrated, &drives, &refused, !weights.is_empty())?;
    let mut text = format!("<!-- {} -->\n", escaped(&heading(machine.name(), "MJCF")));
    exported.told.iter().for_each(|line| {
        let _ = writeln!(text, "<!-- {} -->", escaped(line));
    });
    let _ = writeln!(text, "<mujoco model=\"{}\">", escaped(machine.name()));
    // Bodies without a mass of their own have one that moves nothing.
    text.push_str(
        "  <compiler angle=\"radian\" autolimits=\"true\" boundmass=\"1e-6\" boundinertia=\"1e-9\"/>\n",
    );
    let _ = writeln!(
        text,
        "  <option timestep=\"{}\" integrator=\"implicitfast\" gravity=\"{}\"/>",
        exact(STEP),
        numbers(machine.gravity_b().0.map(|g| GRAVITY * g))
    );
    text.push_str("  <worldbody>\n");
    let (workpiece, tool) = machine.dyads().split_at(machine.workpiece_count());
    let chain = calibrated.chain();
    for (from, list) in [(0, workpiece), (workpiece.len(), tool)] {
        for (depth, dyad) in list.iter().enumerate() {
            body(&mut text, dyad, chain.previous_from_frame(from + depth), 2 + depth, &drives);
            let own = weights.iter().filter(|weight| weight.dyad == from + depth);
            own.enumerate().for_each(|(k, weight)| stand_in(&mut text, &dyad.frame, k, weight, 3 + depth));
        }
        for depth in (0..list.len()).rev() {
            let _ = writeln!(text, "{:1$}</body>", "", 2 * (2 + depth));
        }
    }
    for drive in drives.iter().filter(|drive| drive.has_motor()) {
        beside(&mut text, drive, "motor", drive.motor, 0.0);
        if drive.has_gear() {
            beside(&mut text, drive, "gear", drive.gear, drive.hold);
        }
    }
    text.push_str("  </worldbody>\n");
    coupled(&mut text, machine, &drives);
    actuated(&mut text, &drives);
    text.push_str("</mujoco>\n");
    exported.numbers.extend(drives.iter().flat_map(named));
    exported.text = text;
    Ok(exported)
}

/// The numbers of a drive.
fn named(drive: &Drive) -> Vec<Number> {
    let turns = drive.kind == JointKind::Revolute;
    let by = |linear: &str, angular: &str| if turns { angular.to_string() } else { linear.to_string() };
    let mut numbers = Vec::new();
    let mut number = |what: &str, value: f64, declared: f64, unit: String| {
        let name = format!("{what} of {}", drive.joint);
        numbers.push(Number { name, value: Some(value), declared, unit, because: None });
    };
    if drive.play > 0.0 {
        number("play", drive.play, 0.0, by("m", "rad"));
    }
    if let Some(spring) = drive.spring {
        number("stiffness", spring.stiffness, 0.0, by("N/m", "Nm/rad"));
    }
    for (force, take_up) in &drive.friction {
        number("friction", *force, 0.0, by("N", "Nm"));
        number("take-up", *take_up, 0.0, by("m", "rad"));
    }
    for (what, time) in [("delay", drive.delay), ("low-pass", drive.low_pass)] {
        if time > 0.0 {
            number(what, time, 0.0, "s".into());
        }
    }
    if drive.leads() {
        number("feed-forward", drive.forward, 1.0, "1".into());
    }
    numbers
}

/// What is told of the model, and what it does not hold.
fn told(
    calibrated: &CalibratedMachine,
    drives: &[Drive],
    refused: &[Refused],
    weights: bool,
) -> Result<Exported> {
    let machine = calibrated.machine();
    let mut told = vec![
        "positions of bodies hold the calibrated geometry, zero positions of joints included; m, rad, kg"
            .to_string(),
        "a position in the model is the displacement of the joint; the tool is body t, as body w sees it"
            .to_string(),
        format!(
            "set a command on actuator position of its name, and its rate on actuator velocity of its name: without the rate a joint follows {} ms late",
            exact(2e3 / MOTOR)
        ),
        "the machine moves as it was measured, and motors and what hangs on them are as heavy as that takes: forces on actuators are not the machine's".to_string(),
    ];
    if machine.dyads().iter().any(|dyad| dyad.mass.is_some()) {
        told.push("masses are points at their centres: the machine file states no moments of inertia".into());
    }
    let any = |of: &dyn Fn(&Drive) -> bool| drives.iter().any(of);
    if any(&|drive| drive.play > 0.0) {
        told.push("a joint with play hangs on a motor of its own by a coupling that is limited in length, and friction keeps it where it was left".into());
    }
    if any(&|drive| drive.pull.is_some()) {
        told.push(
            "a joint that yields to its weight hangs on a motor of its own by a spring with a damper".into(),
        );
    }
    if any(&|drive| drive.spring.is_some() && drive.pull.is_none()) {
        told.push("a joint that yields to its acceleration or its friction hangs on a motor of its own by a spring with a damper; the load on it stands for the effect, and is no mass of the machine".into());
    }
    if weights {
        told.push("bodies named weight stand for masses that the machine file does not state: with the stiffness they make the deflection that was found, and neither is the machine's by itself".into());
    }
    if any(&|drive| !drive.friction.is_empty()) {
        told.push(
            "friction that winds a spring is a passive dcmotor with the friction of LuGre: MuJoCo 4".into(),
        );
    }
    if any(&|drive| drive.delay > 0.0) {
        told.push(format!(
            "a delayed actuator keeps a history of its commands, enough for steps of {} ms and more: MuJoCo 4; start it with mj_initCtrlHistory where the first command is not zero",
            exact(1e3 * STEP)
        ));
    }
    for (j, joint) in machine.joints().filter(|(j, joint)| !is_plain(machine, *j, joint)) {
        let terms = machine.drive(j).map_or(&[][..], |drive| &drive.terms);
        let own = |(c, _): &(usize, f64)| machine.commands()[*c] == joint.name;
        if terms.iter().any(own) {
            told.push(format!(
                "joint {} has a command of its own besides those that it follows, and stays free in the model: set its displacement",
                joint.name
            ));
        }
    }
    told.extend(Known::new(calibrated).sentence());
    told.extend(super::known::open_at_tool(calibrated));
    let mut left_out = varying(calibrated, CONSTANT)?;
    left_out.retain(|left| !drives.iter().any(|drive| drive.holds.contains(&left.what)));
    for left in &mut left_out {
        if let Some(refused) = refused.iter().find(|refused| refused.what == left.what) {
            left.because = format!("{}; `compensate` and `predict` take it", refused.because);
        }
    }
    if !machine.side_branches().is_empty() {
        left_out.push(Remainder {
            what: "side branches of the machine".into(),
            max_m: None,
            rms_m: None,
            because: "they are not measured, and no part of the chain from w to t".into(),
        });
    }
    Ok(Exported { told, left_out, ..Exported::default() })
}

fn body(text: &mut String, dyad: &Dyad, pose: Pose<f64>, depth: usize, drives: &[Drive]) {
    let indent = 2 * depth;
    let _ = writeln!(
        text,
        "{:indent$}<body name=\"{}\" pos=\"{}\" quat=\"{}\">",
        "",
        body_name(&dyad.frame),
        numbers(pose.translation.0),
        numbers(quaternion(pose.rotation))
    );
    if let Some(mass) = dyad.mass.filter(|mass| mass.mass > 0.0) {
        let _ = writeln!(
            text,
            "{:indent$}  <inertial pos=\"{}\" mass=\"{}\" diaginertia=\"1e-9 1e-9 1e-9\"/>",
            "",
            numbers(mass.centre.0),
            exact(mass.mass)
        );
    }
    if let Some(joint) = &dyad.joint {
        let range =
            joint.travel.map_or(String::new(), |(from, to)| format!(" range=\"{}\"", numbers([from, to])));
        let drive = drives.iter().find(|drive| drive.joint == joint.name);
        let heavy = drive.map_or(String::new(), |drive| match (drive.has_motor(), drive.has_gear()) {
            (false, _) => inertia(drive.motor, 0.0),
            (true, false) => inertia(drive.load, drive.hold),
            (true, true) => inertia(drive.load, 0.0),
        });
        let _ = writeln!(
            text,
            "{:indent$}  <joint name=\"{}\" type=\"{}\" axis=\"{}\"{range}{heavy}/>",
            "",
            escaped(&joint.name),
            kind(joint.kind),
            numbers(joint.axis.0)
        );
    }
}

/// A weight that nobody has stated, on the body of a frame.
fn stand_in(text: &mut String, frame: &str, number: usize, weight: &Weight, depth: usize) {
    // What is lifted by twice its weight pulls upwards.
    let indent = 2 * depth;
    let up = if weight.mass < 0.0 { " gravcomp=\"2\"" } else { "" };
    let _ = writeln!(
        text,
        "{:indent$}<body name=\"weight {} of {}\" pos=\"{}\"{up}><inertial pos=\"0 0 0\" mass=\"{}\" diaginertia=\"1e-9 1e-9 1e-9\"/></body>",
        "",
        number + 1,
        escaped(frame),
        numbers(weight.centre.0),
        exact(weight.mass.abs())
    );
}

/// A body that stands beside the machine, and moves as one joint does.
fn beside(text: &mut String, drive: &Drive, what: &str, armature: f64, hold: f64) {
    let name = escaped(&drive.joint);
    let _ = writeln!(
        text,
        "    <body name=\"{what} of {name}\" gravcomp=\"1\"><joint name=\"{what} of {name}\" type=\"{}\" axis=\"1 0 0\"{}/></body>",
        kind(drive.kind),
        inertia(armature, hold)
    );
}

/// What a joint of the model has of a drive.
fn inertia(armature: f64, hold: f64) -> String {
    let hold = match hold > 0.0 {
        true => format!(" frictionloss=\"{}\" {HOLDS}", exact(hold)),
        false => String::new(),
    };
    format!(" armature=\"{}\"{hold}", exact(armature))
}

/// Joints that follow others, and those that hang on motors.
fn coupled(text: &mut String, machine: &Machine, drives: &[Drive]) {
    let (mut tendons, mut equalities) = (String::new(), String::new());
    for drive in drives {
        let name = escaped(&drive.joint);
        let (gear, motor) = (format!("gear of {name}"), format!("motor of {name}"));
        let difference = |a: &str, b: &str| {
            format!("<joint joint=\"{a}\" coef=\"1\"/><joint joint=\"{b}\" coef=\"-1\"/></fixed>")
        };
        if drive.play > 0.0 {
            let half = drive.play / 2.0;
            let _ = writeln!(
                tendons,
                "    <fixed name=\"play of {name}\" limited=\"true\" range=\"{}\" {HARD}>{}",
                numbers([-half, half]),
                difference(if drive.has_gear() { &gear } else { &name }, &motor)
            );
        }
        if let Some(spring) = drive.spring {
            let _ = writeln!(
                tendons,
                "    <fixed name=\"compliance of {name}\" springlength=\"0\" stiffness=\"{}\" damping=\"{}\">{}",
                exact(spring.stiffness),
                exact(spring.damping),
                difference(&name, if drive.has_gear() { &gear } else { &motor })
            );
        }
    }
    for (j, joint) in machine.joints().filter(|(j, joint)| !is_plain(machine, *j, joint)) {
        let terms = machine.drive(j).map_or(&[][..], |drive| &drive.terms);
        if terms.iter().any(|(c, _)| machine.commands()[*c] == joint.name) {
            continue;
        }
        let name = escaped(&joint.name);
        let leaders: String = terms
            .iter()
            .map(|(c, factor)| {
                format!("<joint joint=\"{}\" coef=\"{}\"/>", escaped(&machine.commands()[*c]), exact(-factor))
            })
            .collect();
        let _ = writeln!(
            tendons,
            "    <fixed name=\"drive of {name}\"><joint joint=\"{name}\" coef=\"1\"/>{leaders}</fixed>"
        );
        let _ = writeln!(equalities, "    <tendon tendon1=\"drive of {name}\" polycoef=\"0 0 0 0 0\"/>");
    }
    for (element, list) in [("tendon", tendons), ("equality", equalities)] {
        if !list.is_empty() {
            let _ = write!(text, "  <{element}>\n{list}  </{element}>\n");
        }
    }
}

/// Two actuators for every command: on its position, and on its rate, which is fed forward. Friction has one that hears no command.
fn actuated(text: &mut String, drives: &[Drive]) {
    text.push_str("  <actuator>\n");
    for drive in drives {
        let name = escaped(&drive.joint);
        let joint = if drive.has_motor() { format!("motor of {name}") } else { name.clone() };
        let (kp, kv) = (drive.motor * MOTOR * MOTOR, 2.0 * drive.motor * MOTOR);
        let mut late = String::new();
        if drive.low_pass > 0.0 {
            let _ = write!(
                late,
                " dyntype=\"filterexact\" dynprm=\"{}\" actearly=\"true\"",
                exact(drive.low_pass)
            );
        }
        if drive.delay > 0.0 {
            let kept = (drive.delay / STEP).ceil() + 2.0;
            let _ = write!(late, " delay=\"{}\" nsample=\"{kept}\" interp=\"linear\"", exact(drive.delay));
        }
        for (what, gain, bias) in
            [("position", kp, [0.0, -kp, 0.0]), ("velocity", kv * drive.forward, [0.0, 0.0, -kv])]
        {
            let _ = writeln!(
                text,
                "    <general name=\"{what} of {name}\" joint=\"{joint}\" gainprm=\"{}\" biastype=\"affine\" biasprm=\"{}\"{late}/>",
                exact(gain),
                numbers(bias)
            );
        }
        for (k, (force, take_up)) in drive.friction.iter().enumerate() {
            let number = if k > 0 { format!(" {}", k + 1) } else { String::new() };
            let force = exact(*force);
            let _ = writeln!(
                text,
                "    <dcmotor name=\"friction{number} of {name}\" joint=\"{name}\" input=\"none\" motorconst=\"0 0\" resistance=\"1\" lugre=\"{} 0 {force} {force} 1\"/>",
                exact(drive.friction[k].0 / take_up),
            );
        }
    }
    text.push_str("  </actuator>\n");
}

fn kind(kind: JointKind) -> &'static str {
    if kind == JointKind::Revolute { "hinge" } else { "slide" }
}

fn numbers<const N: usize>(numbers: [f64; N]) -> String {
    numbers.map(exact).join(" ")
}

/// Unit quaternion (w, x, y, z) of a rotation, by its largest component.
fn quaternion(Mat3(r): Mat3<f64>) -> [f64; 4] {
    let squares = [
        1.0 + r[0][0] + r[1][1] + r[2][2],
        1.0 + r[0][0] - r[1][1] - r[2][2],
        1.0 - r[0][0] + r[1][1] - r[2][2],
        1.0 - r[0][0] - r[1][1] + r[2][2],
    ];
    let largest = (0..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    let s = squares[largest];
    let four = match largest {
        0 => [s, r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]],
        1 => [r[2][1] - r[1][2], s, r[0][1] + r[1][0], r[0][2] + r[2][0]],
        2 => [r[0][2] - r[2][0], r[0][1] + r[1][0], s, r[1][2] + r[2][1]],
        _ => [r[1][0] - r[0][1], r[0][2] + r[2][0], r[1][2] + r[2][1], s],
    };
    let length = four.iter().map(|x| x * x).sum::<f64>().sqrt();
    four.map(|x| x / length)
}

/// A frame as a body; the world is one of MuJoCo's own.
fn body_name(frame: &str) -> String {
    if frame == "world" { "frame world".into() } else { escaped(frame) }
}

/// A text between quotes of an attribute, or between comments.
fn escaped(text: &str) -> String {
    let text = one_line(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    text.replace('"', "&quot;").replace("--", "- -")
}

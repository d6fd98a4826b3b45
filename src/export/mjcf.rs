//! MJCF: the calibrated geometry as a model of MuJoCo, and of the named effects what MuJoCo can hold.

use std::fmt::Write;

use super::curve::Curve;
use super::known::Known;
use super::numbers::{exact, heading, one_line};
use super::table::POINTS;
use super::varying::varying;
use super::{Exported, Number, Remainder};
use crate::calibration::CalibratedMachine;
use crate::effects::StoredSlot;
use crate::error::Result;
use crate::feature::Expression;
use crate::lie::{Mat3, Pose};
use crate::machine::{Dyad, Joint, JointKind, Machine};

/// Why an effect stays out.
const CONSTANT: &str = "a model of MuJoCo has no place for it; `compensate` and `predict` take it";

/// Families that a coupling with play holds.
const PLAY: [&str; 2] = ["backlash", "crossed_play"];

/// A limit that gives way as little as MuJoCo can make it.
const HARD: &str = "solreflimit=\"0.002 1\" solimplimit=\"0.999 0.9999 0.000001\"";

/// Acceleration of gravity, m/s2.
const GRAVITY: f64 = 9.80665;

/// A joint with play: lost motion between its motor and what it moves, m or rad.
struct Play {
    joint: String,
    kind: JointKind,
    width: f64,
    /// Its name among the effects.
    what: String,
}

/// A joint with a compliance by weight: a spring between its motor and what it moves, N/m or Nm/rad.
struct Spring {
    joint: String,
    kind: JointKind,
    stiffness: f64,
    /// Its name among the effects.
    what: String,
}

pub(super) fn write(calibrated: &CalibratedMachine) -> Result<Exported> {
    let machine = calibrated.machine();
    let plays = plays(calibrated)?;
    let springs = springs(calibrated, &plays);
    let mut exported = told(calibrated, &plays, &springs)?;
    let mut text = format!("<!-- {} -->\n", escaped(&heading(machine.name(), "MJCF")));
    exported.told.iter().for_each(|line| {
        let _ = writeln!(text, "<!-- {} -->", escaped(line));
    });
    let _ = writeln!(text, "<mujoco model=\"{}\">", escaped(machine.name()));
    // Bodies without a mass of their own have one that moves nothing.
    text.push_str(
        "  <compiler angle=\"radian\" autolimits=\"true\" boundmass=\"1e-6\" boundinertia=\"1e-9\"/>\n",
    );
    let _ = writeln!(text, "  <option gravity=\"{}\"/>", numbers(machine.gravity_b().0.map(|g| GRAVITY * g)));
    text.push_str("  <worldbody>\n");
    let (workpiece, tool) = machine.dyads().split_at(machine.workpiece_count());
    let chain = calibrated.chain();
    for (from, list) in [(0, workpiece), (workpiece.len(), tool)] {
        for (depth, dyad) in list.iter().enumerate() {
            body(&mut text, dyad, chain.previous_from_frame(from + depth), 2 + depth);
        }
        for depth in (0..list.len()).rev() {
            let _ = writeln!(text, "{:1$}</body>", "", 2 * (2 + depth));
        }
    }
    let motors = plays.iter().map(|play| (&play.joint, play.kind));
    for (joint, of) in motors.chain(springs.iter().map(|spring| (&spring.joint, spring.kind))) {
        let name = escaped(joint);
        let _ = writeln!(
            text,
            "    <body name=\"motor of {name}\" gravcomp=\"1\"><joint name=\"motor of {name}\" type=\"{}\" axis=\"1 0 0\"/></body>",
            kind(of)
        );
    }
    text.push_str("  </worldbody>\n");
    coupled(&mut text, machine, &plays, &springs);
    text.push_str("</mujoco>\n");
    for play in &plays {
        let unit = if play.kind == JointKind::Revolute { "rad" } else { "m" };
        exported.numbers.push(Number {
            name: format!("play of {}", play.joint),
            value: Some(play.width),
            declared: 0.0,
            unit: unit.into(),
            because: None,
        });
    }
    for spring in &springs {
        exported.numbers.push(Number {
            name: format!("stiffness of {}", spring.joint),
            value: Some(spring.stiffness),
            declared: 0.0,
            unit: if spring.kind == JointKind::Revolute { "Nm/rad" } else { "N/m" }.into(),
            because: None,
        });
    }
    exported.text = text;
    Ok(exported)
}

/// What is told of the model, and what it does not hold.
fn told(calibrated: &CalibratedMachine, plays: &[Play], springs: &[Spring]) -> Result<Exported> {
    let machine = calibrated.machine();
    let mut told = vec![
        "positions of bodies hold the calibrated geometry, zero positions of joints included; m, rad, kg"
            .to_string(),
        "a position in the model is the displacement of the joint; the tool is body t, as body w sees it"
            .to_string(),
    ];
    if machine.dyads().iter().any(|dyad| dyad.mass.is_some()) {
        told.push("masses are points at their centres: the machine file states no moments of inertia".into());
    }
    if !plays.is_empty() {
        told.push("a joint with play hangs on a motor of its own by a coupling that is limited in length; put actuators on the motors".into());
    }
    if !springs.is_empty() {
        told.push("a joint that yields to its weight hangs on a motor of its own by a spring; put actuators on the motors, and damping where it must not ring".into());
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
    let holds = |left: &Remainder| {
        plays.iter().any(|play| play.what == left.what)
            || springs.iter().any(|spring| spring.what == left.what)
    };
    left_out.retain(|left| !holds(left));
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

/// Joints with play, in the order of the effects; one for each joint.
fn plays(calibrated: &CalibratedMachine) -> Result<Vec<Play>> {
    let machine = calibrated.machine();
    let mut plays: Vec<Play> = Vec::new();
    for effect in calibrated.effects().iter().filter(|effect| PLAY.contains(&effect.effect.as_str())) {
        let Some(command) = machine.commands().iter().position(|name| *name == effect.at) else { continue };
        if plays.iter().any(|play| play.joint == effect.at) || effect.of_setup {
            continue;
        }
        let bare = CalibratedMachine::nominal(machine.clone());
        let mut bands = calibrated.variation().dead_bands.clone();
        bands.resize(machine.commands().len(), 0.0);
        // It was bound when the file was read.
        let Ok(alone) = bare.with_effects(vec![effect.clone()], bands) else { continue };
        // Differences of positions: what is below a picometre is rounding.
        let width = (1e12 * Curve::new(&alone, command, POINTS)?.backlash()).round() / 1e12;
        if width > 0.0 {
            let kind = machine.command_joint(command).kind;
            let what = format!("{} at {}", effect.effect, effect.at);
            plays.push(Play { joint: effect.at.clone(), kind, width, what });
        }
    }
    Ok(plays)
}

/// Joints whose displacement is one number times the pull of the masses that the machine file states: springs, and nothing else. Where play
/// stands between motor and joint too, nobody has said in which order; masses of side branches are not in the model.
fn springs(calibrated: &CalibratedMachine, plays: &[Play]) -> Vec<Spring> {
    let machine = calibrated.machine();
    let mut springs: Vec<Spring> = Vec::new();
    for effect in calibrated.effects().iter().filter(|effect| !effect.of_setup) {
        let Some((j, joint)) = machine.joints().find(|(_, joint)| joint.name == effect.at) else { continue };
        let taken = plays.iter().map(|play| &play.joint).chain(springs.iter().map(|own| &own.joint));
        if !is_plain(machine, j, joint)
            || !machine.side_branches().is_empty()
            || taken.into_iter().any(|own| *own == effect.at)
        {
            continue;
        }
        // Without a mass that is stated, the model of the effect counts 1 kg at every frame.
        let beyond = machine.dyads().iter().enumerate().skip(j);
        let weighs = beyond
            .filter(|(k, _)| machine.branch(*k) == machine.branch(j))
            .any(|(_, dyad)| dyad.mass.is_some_and(|mass| mass.mass > 0.0));
        let terms: Vec<_> = effect.terms.iter().filter(|term| term.value != 0.0).collect();
        let [term] = &terms[..] else { continue };
        let [part] = &term.parts[..] else { continue };
        let twist = joint.twist();
        let triple = |v: (f64, f64, f64)| [v.0, v.1, v.2];
        let along = triple(part.v) == twist.v.0 && triple(part.w) == twist.w.0;
        let frame = &machine.dyads()[j].frame;
        let here = matches!(&part.slot, StoredSlot::Before(own) | StoredSlot::After(own) if own == frame);
        let pull = match &part.feature {
            Expression::Of(of, feature) => *of == joint.name && **feature == Expression::Gravity,
            _ => false,
        };
        if weighs && along && here && pull && term.value > 0.0 {
            let what = format!("{} at {}", effect.effect, effect.at);
            springs.push(Spring {
                joint: effect.at.clone(),
                kind: joint.kind,
                stiffness: term.value.recip(),
                what,
            });
        }
    }
    springs
}

fn body(text: &mut String, dyad: &Dyad, pose: Pose<f64>, depth: usize) {
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
        let _ = writeln!(
            text,
            "{:indent$}  <joint name=\"{}\" type=\"{}\" axis=\"{}\"{range}/>",
            "",
            escaped(&joint.name),
            kind(joint.kind),
            numbers(joint.axis.0)
        );
    }
}

/// Joints that follow others, and those with play.
fn coupled(text: &mut String, machine: &Machine, plays: &[Play], springs: &[Spring]) {
    let (mut tendons, mut equalities) = (String::new(), String::new());
    for play in plays {
        let (name, half) = (escaped(&play.joint), play.width / 2.0);
        let _ = writeln!(
            tendons,
            "    <fixed name=\"play of {name}\" limited=\"true\" range=\"{}\" {HARD}><joint joint=\"{name}\" coef=\"1\"/><joint joint=\"motor of {name}\" coef=\"-1\"/></fixed>",
            numbers([-half, half])
        );
    }
    for spring in springs {
        let name = escaped(&spring.joint);
        let _ = writeln!(
            tendons,
            "    <fixed name=\"compliance of {name}\" springlength=\"0\" stiffness=\"{}\"><joint joint=\"{name}\" coef=\"1\"/><joint joint=\"motor of {name}\" coef=\"-1\"/></fixed>",
            exact(spring.stiffness)
        );
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

/// Whether a joint does what its own command says, and nothing else.
fn is_plain(machine: &Machine, j: usize, joint: &Joint) -> bool {
    match machine.drive(j).map(|drive| &drive.terms[..]) {
        Some([(c, factor)]) => machine.commands()[*c] == joint.name && *factor == 1.0,
        _ => false,
    }
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

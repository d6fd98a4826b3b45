//! `kincal describe`

use std::fmt::Write;
use std::path::PathBuf;

use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::describe::{Description, DyadDescription, MOST_FRAMES, describe, describe_whole};
use crate::identify::reach;
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::JointKind;
use crate::units::{Quantity, amount};
use serde_json::{Value, json};

use super::Common;
use super::keep::Keep;
use super::output::{
    Failure, Kind, Outcome, Shown, angle, count, decimals, length, open_machine, open_recordings,
};
use super::table::table;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine file, calibrated or not
    #[arg(value_name = "MACHINE.ron")]
    machine: PathBuf,
    /// Recordings: how many combinations they see, all together, before anything is identified
    #[arg(value_name = "REC.csv")]
    recordings: Vec<PathBuf>,
    /// Where t is in w besides at home: joints with their displacements, those left out at 0, such as x=100mm,c=30deg
    #[arg(long, value_name = "JOINT=AMOUNT", value_delimiter = ',', allow_hyphen_values = true)]
    at: Vec<String>,
    /// List every combination that a measurement does not see
    #[arg(long)]
    unseen: bool,
    #[command(flatten)]
    keep: Keep,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let calibrated = open_machine(&args.machine, |path| CalibratedMachine::open(path))?;
    let of = if args.unseen { describe_whole } else { describe };
    let description = of(calibrated.machine());
    let mut text = render(&description, args.unseen);
    let mut result = serde_json::to_value(&description).map_err(|e| Failure::Answer(e.to_string()))?;
    let poses = poses(&calibrated, &args.at)?;
    text.push_str(&render_poses(&poses));
    let data = |(name, pose): &(String, Pose<f64>)| json!({"at": name, "translation_m": pose.translation.0, "rotation_rad": pose.rotation_vector().0});
    result["w_from_t"] = poses.iter().map(data).collect();
    if calibrated.samples() > 0 {
        text.push_str(&render_calibration(&calibrated));
        result["calibration"] = calibration(&calibrated);
    }
    if !args.recordings.is_empty() {
        let machine = calibrated.machine();
        let recordings = args.keep.within(open_recordings(&args.recordings, machine, &args.machine)?);
        let reach = reach(machine, &recordings)?;
        let _ = writeln!(
            text,
            "\nthese recordings ({}) see {} of {} combinations of the unknowns, set-ups included; on general poses the same \
             instruments would see {}",
            count(reach.samples, "sample", "samples"),
            reach.rank,
            reach.unknowns,
            reach.rank_in_general
        );
        result["recordings"] = serde_json::to_value(&reach).map_err(|e| Failure::Answer(e.to_string()))?;
    }
    args.common.say(&text)?;
    args.common.write_json(&result)
}

/// Where `t` is in `w` with all commands at zero, and with those asked for.
fn poses(calibrated: &CalibratedMachine, at: &[String]) -> Outcome<Vec<(String, Pose<f64>)>> {
    let machine = calibrated.machine();
    let chain = Chain::new(machine, calibrated.deviations());
    let mut q = vec![0.0; machine.commands().len()];
    let mut poses = vec![("home, all commands 0".to_string(), chain.w_from_t(&q))];
    for text in at {
        let (name, size) = text.split_once('=').unwrap_or((text, ""));
        let wrong = |what: String, mend: String| Failure::Told { what: format!("--at {text}: {what}"), mend };
        let Some(c) = machine.commands().iter().position(|own| own == name.trim()) else {
            let mend = format!("name one of: {}", machine.commands().join(", "));
            return Err(wrong(format!("\"{}\" is no joint of {}", name.trim(), machine.name()), mend));
        };
        let quantity = machine.command_joint(c).kind.quantity();
        let unit = if quantity == Quantity::Angle { "deg" } else { "mm" };
        let mend = || format!("write the joint with its displacement, such as {}=10{unit}", name.trim());
        q[c] = amount(size, quantity).map_err(|what| wrong(what, mend()))?;
    }
    if !at.is_empty() {
        poses.push((at.join(", "), chain.w_from_t(&q)));
    }
    Ok(poses)
}

fn render_poses(poses: &[(String, Pose<f64>)]) -> String {
    let mut text = "\npose of t in w (origin, rotation vector)\n".to_string();
    let rows: Vec<Vec<String>> = (poses.iter())
        .map(|(name, pose)| {
            let at = format!("at {} mm", triple(pose.translation.0, Kind::Length));
            let turned = format!("turned {} deg", triple(pose.rotation_vector().0, Kind::Angle));
            vec![name.clone(), at, turned]
        })
        .collect();
    text.push_str(&table("  ", &[], &rows));
    text
}

/// The description as people read it.
pub(crate) fn render(d: &Description, unseen: bool) -> String {
    let mut text = d.machine.clone();
    if let Some(about) = &d.about {
        let _ = write!(text, ": {about}");
    }
    text.push_str("\n\ntopology\n");
    for line in &d.topology {
        let _ = writeln!(text, "  {line}");
    }
    text.push_str(
        "\nmodel (exp(dh_j): small deviation twist (v; w) in frame j; M_j: declared initial pose)\n",
    );
    for line in &d.equation {
        let _ = writeln!(text, "  {line}");
    }
    text.push_str("\ndyads (R: revolute, P: prismatic; tolerance of translations and of rotations)\n");
    let rows: Vec<Vec<String>> = d.dyads.iter().map(row).collect();
    text.push_str(&table("  ", &[false, false, false, false, false, true, true], &rows));
    if let Some(why) = &d.uncounted {
        let ask = if unseen { String::new() } else { format!("; --unseen counts it up to {MOST_FRAMES}") };
        let _ = writeln!(text, "\nnote: {why}{ask}");
        return text;
    }
    let _ = writeln!(
        text,
        "\nidentifiable on general poses with measured points off the axes, of {} components of deviations",
        d.parameters
    );
    let mut rows =
        vec![["measurement", "seen", "smallest seen", "largest not seen"].map(String::from).to_vec()];
    for kind in &d.identifiable {
        let [last, next] = kind.gap;
        let seen = format!("{} of {}", kind.rank, kind.of);
        // What is left of an unseen direction is rounding, and differs from processor to processor.
        let next = if next < 1e-12 { "rounding".to_string() } else { format!("{next:.0e}") };
        rows.push(vec![kind.measurement.clone(), seen, format!("{last:.0e}"), next]);
    }
    text.push_str(&table("  ", &[false, true, true, true], &rows));
    text.push_str("  (singular values relative to the largest, components scaled by their tolerances");
    if !unseen {
        text.push_str("; --unseen lists the combinations that are not seen)\n");
        return text;
    }
    text.push_str(")\n");
    for kind in &d.identifiable {
        let _ = writeln!(text, "\nnot seen by {}: shifts (m, rad) that change no reading", kind.measurement);
        for combination in &kind.unseen {
            let parts: Vec<String> = combination.iter().map(|(name, x)| format!("{x:+.4} {name}")).collect();
            let _ = writeln!(text, "  {}", parts.join("  "));
        }
    }
    text
}

fn row(dyad: &DyadDescription) -> Vec<String> {
    let turned = match dyad.rotation_rad {
        [0.0, 0.0, 0.0] => String::new(),
        rotation => format!("turned {} deg", triple(rotation, Kind::Angle)),
    };
    let [t, r] = dyad.tolerance;
    vec![
        dyad.frame.clone(),
        dyad.branch.clone(),
        dyad.joint.clone().unwrap_or_else(|| "fixed".into()),
        format!("at {} mm", triple(dyad.at_m, Kind::Length)),
        turned,
        length(t),
        angle(r),
    ]
}

/// Lengths in mm, angles in deg.
fn triple(si: [f64; 3], kind: Kind) -> String {
    let factor = if kind == Kind::Length { 1e3 } else { 1f64.to_degrees() };
    // Adding 0 takes the sign from a zero.
    let parts = si.map(|x| format!("{:.4}", (x * factor * 1e4).round() / 1e4 + 0.0));
    format!("({})", parts.join(", "))
}

/// What a calibrated file adds, as people read it.
fn render_calibration(calibrated: &CalibratedMachine) -> String {
    let machine = calibrated.machine();
    let rms = calibrated.rms();
    let left: Vec<String> = rms.m.map(length).into_iter().chain(rms.rad.map(angle)).collect();
    let samples = count(calibrated.samples(), "sample", "samples");
    let mut text = format!("\ncalibrated on {samples}, left over {} RMS\n", left.join(" and "));
    let largest = |pick: fn(&Twist<f64>) -> Vec3<f64>| {
        let all = calibrated.deviations().iter().flat_map(move |dh| pick(dh).0);
        all.fold(0.0, |largest: f64, x| largest.max(x.abs()))
    };
    let (v, w) = (Kind::Length.unit(largest(|dh| dh.v)), Kind::Angle.unit(largest(|dh| dh.w)));
    let places = |unit: Shown, largest: f64| decimals(largest * unit.per_si, 4).min(4);
    let (v_places, w_places) = (places(v, largest(|dh| dh.v)), places(w, largest(|dh| dh.w)));
    let (mm, rad) = (v.symbol, w.symbol);
    let _ = writeln!(text, "\ndeviations dh_j (v in {mm}, w in {rad}, each in its own frame)");
    let mut rows = vec![["frame", "vx", "vy", "vz", "wx", "wy", "wz"].map(String::from).to_vec()];
    for (dyad, dh) in machine.dyads().iter().zip(calibrated.deviations()) {
        let cell = |x: f64, unit: Shown, places: usize| {
            let text = format!("{:+.places$}", x * unit.per_si);
            if text.contains(['1', '2', '3', '4', '5', '6', '7', '8', '9']) { text } else { "0".into() }
        };
        let mut row = vec![dyad.frame.clone()];
        row.extend(dh.v.0.map(|x| cell(x, v, v_places)));
        row.extend(dh.w.0.map(|x| cell(x, w, w_places)));
        rows.push(row);
    }
    text.push_str(&table("  ", &[false, true, true, true, true, true, true], &rows));
    let mut rows = Vec::new();
    let of =
        |name: &str| if name.is_empty() { "default set-up".to_string() } else { format!("set-up {name}") };
    for (name, pose) in calibrated.setups() {
        let (at, turned) =
            (triple(pose.translation.0, Kind::Length), triple(pose.rotation_vector().0, Kind::Angle));
        rows.push(vec![of(name), format!("frame w at {at} mm, turned {turned} deg")]);
    }
    for (name, at) in calibrated.tool_points() {
        rows.push(vec![
            format!("tool point {name}"),
            format!("at {} mm in frame t", triple(at.0, Kind::Length)),
        ]);
    }
    for (name, turned) in calibrated.tool_rotations() {
        rows.push(vec![
            format!("target {name}"),
            format!("turned {} deg in frame t", triple(turned.0, Kind::Angle)),
        ]);
    }
    for (name, channel, value) in calibrated.zeros() {
        let (scaled, unit) = in_mm_or_deg(calibrated, channel, value);
        rows.push(vec![of(name), format!("zero of {channel}: {scaled:+.5} {unit}")]);
    }
    for (name, value) in calibrated.lengths() {
        rows.push(vec![of(name), format!("nominal length {:.5} mm", value * 1e3)]);
    }
    for (c, joint) in machine.commands().iter().enumerate() {
        if let Some((from, to)) = calibrated.seen(c) {
            let ((from, unit), (to, _)) =
                (in_mm_or_deg(calibrated, joint, from), in_mm_or_deg(calibrated, joint, to));
            rows.push(vec![format!("joint {joint}"), format!("seen from {from:.3} to {to:.3} {unit}")]);
        }
    }
    if !rows.is_empty() {
        text.push('\n');
        text.push_str(&table("  ", &[], &rows));
    }
    text
}

/// A joint's reading in mm or deg; whatever is no revolute joint is a length.
fn in_mm_or_deg(calibrated: &CalibratedMachine, joint: &str, si: f64) -> (f64, &'static str) {
    let joint = calibrated.machine().joints().find(|(_, j)| j.name == joint);
    match joint {
        Some((_, joint)) if joint.kind == JointKind::Revolute => (si.to_degrees(), "deg"),
        _ => (si * 1e3, "mm"),
    }
}

/// What a calibrated file adds, as data in SI.
fn calibration(calibrated: &CalibratedMachine) -> Value {
    let machine = calibrated.machine();
    let deviations: Vec<Value> = (machine.dyads().iter().zip(calibrated.deviations()))
        .map(|(dyad, dh)| json!({"frame": dyad.frame, "v_m": dh.v.0, "w_rad": dh.w.0}))
        .collect();
    let setups: Vec<Value> = calibrated
        .setups()
        .map(|(name, pose)| {
            json!({"name": name, "at_m": pose.translation.0, "rotation_rad": pose.rotation_vector().0})
        })
        .collect();
    let tool_points: Vec<Value> =
        calibrated.tool_points().map(|(name, at)| json!({"name": name, "at_m": at.0})).collect();
    let tool_rotations: Vec<Value> = calibrated
        .tool_rotations()
        .map(|(name, turned)| json!({"name": name, "rotation_rad": turned.0}))
        .collect();
    let zeros: Vec<Value> = calibrated
        .zeros()
        .map(|(setup, of, value)| json!({"setup": setup, "of": of, "value": value}))
        .collect();
    let lengths: Vec<Value> =
        calibrated.lengths().map(|(setup, value)| json!({"setup": setup, "value_m": value})).collect();
    let seen: Vec<Value> = (machine.commands().iter().enumerate())
        .filter_map(|(c, joint)| {
            let (from, to) = calibrated.seen(c)?;
            Some(json!({"joint": joint, "from": from, "to": to}))
        })
        .collect();
    json!({
        "samples": calibrated.samples(), "rms_m": calibrated.rms().m, "rms_rad": calibrated.rms().rad,
        "deviations": deviations, "setups": setups, "tool_points": tool_points,
        "tool_rotations": tool_rotations, "zeros": zeros,
        "lengths": lengths, "seen": seen,
    })
}

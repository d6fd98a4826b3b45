//! `kincal simulate`

mod amounts;
mod args;
mod build;
mod path;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::calibration::CalibratedMachine;
use crate::machine::JointKind;
use crate::simulate::{Session, Style, Written};
use serde_json::json;

use super::files::Files;
use super::output::{Kind, Outcome, count, length, open_machine, write_recording, write_whole};
use super::table::table;
pub(crate) use amounts::time;
pub(crate) use args::Args;
use args::DropAs;
use build::{Built, build, usage};
pub(crate) use path::{input_of, path};

pub(crate) fn run(args: &Args, named: &Files) -> Outcome {
    if let Some(option) = args.useless() {
        return Err(usage(
            format!("`{option}` means nothing to the test `{}`", args.test.word()),
            "leave it out, or run another test; --help says which test an option belongs to",
        ));
    }
    let machine = open_machine(&args.machine, |path| CalibratedMachine::open(path))?;
    let progress = args.common.progress();
    progress.say("solving the path");
    let Built { plant, runs, lengths } = build(args, &machine)?;
    let style = Style {
        commands: args.units,
        measured: args.measured_units,
        time: !args.no_time,
        drop_out: if args.drop_out_as == DropAs::Nan { "NaN" } else { "" },
    };
    let files = names(&args.output, runs.len());
    named.with_outputs("--output", &files).check()?;
    let mut session = Session::new(&plant, &runs, &style, args.pause, args.seed)?.beginning_at(args.begin);
    let mut all: Vec<Written> = Vec::new();
    for file in &files {
        let mut rows = 0u64;
        let mut written = None;
        write_recording(file, |out| {
            written = session.record(out, |_| {
                rows += 1;
                if rows.is_multiple_of(20_000) {
                    progress.say(&format!("{}: {}", file.display(), count(rows, "sample", "samples")));
                }
            })?;
            Ok(())
        })?;
        all.extend(written);
    }
    if let Some(path) = &args.nc {
        progress.say("writing the NC program");
        write_whole(path, |out| crate::simulate::write_program(plant.machine(), &runs, out))?;
    }
    if let Some(path) = &args.truth {
        let truth = plant.truth(&machine);
        write_whole(path, |out| {
            // Watched: an error here is told of the output.
            let _ = out.write_all(truth.to_ron().as_bytes());
            Ok(())
        })?;
    }
    drop(progress);
    args.common.say(&summary(args, machine.machine(), &plant, &files, &all, &lengths))?;
    args.common.write_json(&result(args, machine.machine(), &plant, &files, &all, &lengths))
}

/// `REC.csv`, or `REC_1.csv`, `REC_2.csv` ...
fn names(output: &Path, runs: usize) -> Vec<PathBuf> {
    if runs == 1 {
        return vec![output.to_path_buf()];
    }
    let numbered = |i: usize| {
        let mut name = output.file_stem().unwrap_or_default().to_os_string();
        name.push(format!("_{i}"));
        if let Some(extension) = output.extension() {
            name.push(".");
            name.push(extension);
        }
        output.with_file_name(name)
    };
    (1..=runs).map(numbered).collect()
}

fn summary(
    args: &Args,
    machine: &crate::machine::Machine,
    plant: &crate::simulate::Plant,
    files: &[PathBuf],
    all: &[Written],
    lengths: &[Option<f64>],
) -> String {
    let rows: u64 = all.iter().map(|w| w.rows).sum();
    let mut text = format!(
        "{} on {}: {}, {}\n",
        args.test.word(),
        machine.name(),
        count(all.len() as u64, "recording", "recordings"),
        count(rows, "sample", "samples")
    );
    let lines = files.iter().zip(all).zip(lengths).map(|((file, w), l)| {
        let dropped = if w.dropped > 0 { count(w.dropped, "drop-out", "drop-outs") } else { String::new() };
        let bar = l.map_or(String::new(), |l| format!("length {}", length(l)));
        vec![
            file.display().to_string(),
            count(w.rows, "sample", "samples"),
            format!("{:.1} s", w.seconds),
            bar,
            dropped,
        ]
    });
    text.push_str(&table("  ", &[false, true, true], &lines.collect::<Vec<_>>()));
    if rows == 0 {
        text.push_str("note: nothing moves, so there is no sample\n");
        return text;
    }
    text.push_str("travel used\n");
    let mut lines = Vec::new();
    for (c, name) in machine.commands().iter().enumerate() {
        let (low, high) = range(all, c);
        let kind = machine.command_joint(c).kind;
        let (scale, unit) =
            if kind == JointKind::Prismatic { (1e3, "mm") } else { (1f64.to_degrees(), "deg") };
        // Rounded first: -0.000 is written as zero.
        let show = |x: f64| format!("{:.3}", (x * scale * 1e3).round() / 1e3 + 0.0);
        let limit = |x: f64| {
            if x.is_finite() { format!("{}", (x * scale * 1e6).round() / 1e6) } else { "no limit".into() }
        };
        let (from, to) = machine.travel(c);
        lines.push(vec![
            name.clone(),
            show(low),
            "to".into(),
            show(high),
            unit.into(),
            format!("of {} to {}", limit(from), limit(to)),
        ]);
    }
    text.push_str(&table("  ", &[false, true, false, true], &lines));
    let largest = |angle: bool| {
        let parts = plant.constant().iter().flat_map(|dh| if angle { dh.w.0 } else { dh.v.0 });
        parts.fold(0.0f64, |most, x| most.max(x.abs()))
    };
    let (v, w) = (largest(false), largest(true));
    if v > 0.0 || w > 0.0 {
        let _ =
            writeln!(text, "constant deviations up to {} and {}", Kind::Length.show(v), Kind::Angle.show(w));
    } else {
        text.push_str("no constant deviations\n");
    }
    if plant.varies_with_direction() {
        text.push_str("deviations that change with directions of travel, as the machine file says\n");
    }
    for effect in plant.effects() {
        let _ = writeln!(text, "{} at {}: {}", effect.effect, effect.at, effect.says);
    }
    for left in plant.left_out() {
        let _ = writeln!(text, "note: {} at {} is left out: {}", left.effect, left.at, left.because);
    }
    if plant.varies_with_position() {
        text.push_str("joints with play\n");
        if args.truth.is_some() {
            text.push_str("the file of the truth does not hold the play\n");
        }
    }
    text
}

fn range(all: &[Written], c: usize) -> (f64, f64) {
    all.iter()
        .map(|w| w.travel[c])
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (a, b)| (l.min(a), h.max(b)))
}

fn result(
    args: &Args,
    machine: &crate::machine::Machine,
    plant: &crate::simulate::Plant,
    files: &[PathBuf],
    all: &[Written],
    lengths: &[Option<f64>],
) -> serde_json::Value {
    let travel = |w: &Written| -> Vec<serde_json::Value> {
        let one = |(name, (from, to)): (&String, &(f64, f64))| json!({"joint": name, "from": from, "to": to});
        // Without a sample there is no range.
        machine.commands().iter().zip(&w.travel).filter(|(_, (from, to))| from <= to).map(one).collect()
    };
    let recordings: Vec<serde_json::Value> = files
        .iter()
        .zip(all)
        .zip(lengths)
        .map(|((file, w), length)| {
            let mut value = json!({
                "file": file.display().to_string(), "samples": w.rows - w.dropped, "dropped": w.dropped,
                "seconds": w.seconds, "travel": travel(w),
            });
            if let Some(length) = length {
                value["nominal_length_m"] = json!(length);
            }
            value
        })
        .collect();
    let deviations: Vec<serde_json::Value> = machine
        .dyads()
        .iter()
        .zip(plant.constant())
        .map(|(dyad, dh)| json!({"frame": dyad.frame, "v_m": dh.v.0, "w_rad": dh.w.0}))
        .collect();
    json!({
        "machine": machine.name(), "test": args.test.word(), "seed": args.seed, "recordings": recordings,
        "deviations": deviations, "varies": plant.varies(),
    })
}

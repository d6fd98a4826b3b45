//! `kincal compare`

use std::path::PathBuf;

use crate::calibration::CalibratedMachine;
use crate::machine::Machine;
use crate::rivals::{Arena, Rival, Tuning, Verdict, split};
use serde::Serialize;

use super::Common;
use super::calibrate::{positive, relative};
use super::keep::Keep;
use super::output::{Failure, Outcome, angle, count, length, open_machine, open_recordings};
use super::table::table;
use super::verdict;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine file
    #[arg(value_name = "MACHINE.ron")]
    machine: PathBuf,
    /// Recordings that every rival is fitted to
    #[arg(required = true, value_name = "REC.csv")]
    recordings: Vec<PathBuf>,
    /// Recordings that rivals are judged by, in place of the fitted ones
    #[arg(long, value_name = "OTHER.csv", num_args = 1..)]
    judge: Vec<PathBuf>,
    /// The true machine: poses and tool axes are judged too
    #[arg(long, value_name = "TRUE.ron")]
    truth: Option<PathBuf>,
    /// Fit to so many evenly spread samples of each recording, judge by the others
    #[arg(long, value_parser = clap::value_parser!(u64).range(2..))]
    samples: Option<u64>,
    /// Which rivals, separated by commas
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    rivals: Vec<String>,
    /// Fixed damping, relative to the largest diagonal element
    #[arg(long, default_value_t = Tuning::default().tau, value_parser = positive, allow_negative_numbers = true)]
    tau: f64,
    /// Relative singular value below which a direction is truncated
    #[arg(long, default_value_t = Tuning::default().cut, value_parser = relative, allow_negative_numbers = true)]
    cut: f64,
    /// Steps of the damped and truncated schemes
    #[arg(long, default_value_t = Tuning::default().steps as u64, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    steps: u64,
    /// Find the set-ups of the recordings to judge by again, from those recordings
    #[arg(long)]
    fit_setup: bool,
    /// Go on although recordings and machine do not belong together
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    keep: Keep,
    #[command(flatten)]
    common: Common,
}

#[derive(Serialize)]
struct Comparison<'a> {
    machine: &'a str,
    fitted_samples: u64,
    judged_by: &'static str,
    tau: f64,
    cut: f64,
    steps: usize,
    rivals: &'a [Verdict],
}

pub(crate) fn run(args: &Args) -> Outcome {
    let tuning = Tuning { tau: args.tau, cut: args.cut, steps: args.steps as usize };
    let rivals = chosen(&args.rivals, tuning)?;
    let machine = open_machine(&args.machine, |path| Machine::open(path))?;
    let open = |paths: &[PathBuf]| {
        Ok::<_, Failure>(args.keep.within(open_recordings(paths, &machine, &args.machine)?))
    };
    let (mut fit_on, mut judge_on) = (open(&args.recordings)?, open(&args.judge)?);
    let truth = match &args.truth {
        None => None,
        Some(path) => Some(same_frames(&machine, open_machine(path, |p| CalibratedMachine::open(p))?, path)?),
    };
    let mut judged_by = if judge_on.is_empty() { "the same samples" } else { "other recordings" };
    if let Some(samples) = args.samples {
        let (mut picked, mut rest) = (Vec::new(), Vec::new());
        for recording in &fit_on {
            let (own, others) = split(recording, &machine, samples)?;
            picked.extend(own);
            rest.extend(others);
        }
        if judge_on.is_empty() && !rest.is_empty() {
            (judge_on, judged_by) = (rest, "the other samples");
        }
        fit_on = picked;
    }
    let arena = Arena {
        machine: &machine,
        fit_on: &fit_on,
        judge_on: &judge_on,
        truth: truth.as_ref(),
        fit_setup: args.fit_setup,
    };
    let progress = args.common.progress();
    let note = verdict::beforehand(&machine, &fit_on, args.force, &|text| progress.say(text))?;
    let mut verdicts = Vec::new();
    for (name, rival) in &rivals {
        progress.say(name);
        verdicts.push(arena.judge(name, rival)?);
    }
    drop(progress);
    let mut fitted_samples = 0;
    for recording in &fit_on {
        fitted_samples += recording.scan()?.samples;
    }
    let mut text = render(machine.name(), fitted_samples, judged_by, truth.is_some(), &verdicts);
    if let Some(note) = note {
        text.push_str(&format!("note: {note}\n"));
    }
    args.common.say(&text)?;
    args.common.write_json(&Comparison {
        machine: machine.name(),
        fitted_samples,
        judged_by,
        tau: args.tau,
        cut: args.cut,
        steps: args.steps as usize,
        rivals: &verdicts,
    })
}

/// The rivals of these names, or all that have one.
fn chosen(names: &[String], tuning: Tuning) -> Outcome<Vec<(&'static str, Rival)>> {
    let all = Rival::named(tuning);
    if names.is_empty() {
        return Ok(all);
    }
    let find = |name: &String| {
        all.iter().find(|(known, _)| known == name).copied().ok_or_else(|| Failure::Told {
            what: format!("there is no rival `{name}`"),
            mend: format!("choose from: {}", all.iter().map(|(n, _)| *n).collect::<Vec<_>>().join(", ")),
        })
    };
    names.iter().map(find).collect()
}

/// A true machine must have the frames and joints of the declared one, in their order.
fn same_frames(
    machine: &Machine,
    truth: CalibratedMachine,
    path: &std::path::Path,
) -> Outcome<CalibratedMachine> {
    let shape = |m: &Machine| {
        let joint = |d: &crate::machine::Dyad| d.joint.as_ref().map(|j| (j.name.clone(), j.kind));
        let dyads: Vec<_> = m.dyads().iter().map(|d| (d.frame.clone(), joint(d))).collect();
        (dyads, m.workpiece_count())
    };
    if shape(machine) == shape(truth.machine()) {
        return Ok(truth);
    }
    Err(Failure::Told {
        what: format!("{}: its frames and joints are not those of {}", path.display(), machine.name()),
        mend: "give the same machine file with the true deviations, as `kincal calibrate` would write it"
            .into(),
    })
}

fn render(machine: &str, samples: u64, judged_by: &str, has_truth: bool, verdicts: &[Verdict]) -> String {
    let mut text =
        format!("{machine}: fitted to {}, judged by {judged_by}\n\n", count(samples, "sample", "samples"));
    let truth_heads = if has_truth { ["dp", "dr", "tilt", "true reading"] } else { [""; 4] };
    let mut head = vec!["rival", "steps", "fitted", "judged", "largest"];
    head.extend(truth_heads);
    let mut rows = vec![head.into_iter().map(String::from).collect::<Vec<_>>()];
    let mut failed: Vec<(&str, Vec<&str>)> = Vec::new();
    for verdict in verdicts {
        if let Some(why) = &verdict.failed {
            match failed.iter_mut().find(|(reason, _)| reason == why) {
                Some((_, names)) => names.push(&verdict.rival),
                None => failed.push((why, vec![&verdict.rival])),
            }
        }
        let both = |m: Option<f64>, rad: Option<f64>| {
            m.map(length).into_iter().chain(rad.map(angle)).collect::<Vec<_>>().join(", ")
        };
        let steps = verdict.steps.map_or_else(|| "failed".to_string(), |n| n.to_string());
        let fitted = verdict.fitted.map_or_else(String::new, |r| both(r.mean.m, r.mean.rad));
        let judged = verdict.judged.map_or_else(String::new, |r| both(r.mean.m, r.mean.rad));
        let largest = verdict.judged.map_or_else(String::new, |r| both(r.max.m, r.max.rad));
        let mut row = vec![verdict.rival.clone(), steps, fitted, judged, largest];
        if let Some(t) = verdict.truth {
            row.extend([length(t.dp_m), angle(t.dr_rad), angle(t.tilt_rad), length(t.reading_m)]);
        }
        rows.push(row);
    }
    let right = [false, true, true, true, true, true, true, true, true];
    text.push_str(&table("  ", &right, &rows));
    text.push_str("\nfitted, judged: mean residual over samples; largest: of the judged ones\n");
    if has_truth {
        text.push_str(
            "dp, dr, tilt: mean distance of the measured point, angle of the tool frame and of its axis, from the true machine's;\n\
             true reading: mean difference from readings without noise\n",
        );
    }
    for (why, names) in failed {
        text.push_str(&format!("\n{} failed: {why}\n", names.join(", ")));
    }
    text
}

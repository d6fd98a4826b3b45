//! `kincal predict`

use std::path::PathBuf;

use kincal::CalibratedMachine;
use kincal::identify::{Loss, fit_setup};
use kincal::predict::{Prediction, predict};
use kincal::recording::Recording;

use super::Common;
use super::output::{Outcome, angle, length, write_whole};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine file, calibrated or not
    machine: PathBuf,
    /// Recording
    recording: PathBuf,
    /// Where to write the recording with model and residual columns
    #[arg(short, long, value_name = "OUT.csv")]
    output: Option<PathBuf>,
    /// Find again what belongs to the set-up (frame w, tool point, zero, length); the machine stays as it is
    #[arg(long)]
    fit_setup: bool,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let mut calibrated = CalibratedMachine::open(&args.machine)?;
    let recordings = [Recording::open(&args.recording, calibrated.machine())?];
    let spinner = args.common.spinner();
    if args.fit_setup {
        calibrated = fit_setup(&calibrated, &recordings, Loss::default())?;
    } else {
        recordings[0].scan()?;
    }
    let mut prediction = None;
    match &args.output {
        None => prediction = Some(predict(&calibrated, &recordings[0], None)?),
        Some(path) => write_whole(path, |out| {
            prediction = Some(predict(&calibrated, &recordings[0], Some(out))?);
            Ok(())
        })?,
    }
    if let Some(spinner) = spinner {
        spinner.finish_and_clear();
    }
    let Some(prediction) = prediction else { return Ok(()) };
    args.common.say(&render(&prediction, recordings[0].name()));
    args.common.write_json(&prediction)
}

fn render(p: &Prediction, name: &str) -> String {
    let mut text = format!("{name}: {} samples", p.samples);
    if p.dropped > 0 {
        text.push_str(&format!(", {} rows left out as drop-outs", p.dropped));
    }
    text.push('\n');
    let kinds: [([Option<f64>; 3], fn(f64) -> String); 2] =
        [([p.rms_m, p.max_m, p.mean_m], length), ([p.rms_rad, p.max_rad, p.mean_rad], angle)];
    for (figures, show) in kinds {
        if let [Some(rms), Some(max), Some(mean)] = figures {
            text.push_str(&format!(
                "residual: RMS {}, largest {}, mean {}\n",
                show(rms),
                show(max),
                show(mean)
            ));
        }
    }
    if p.extrapolated_samples > 0 {
        text.push_str(&format!(
            "note: at {} samples a joint leaves the range that the calibration has seen\n",
            p.extrapolated_samples
        ));
    }
    text
}

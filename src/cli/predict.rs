//! `kincal predict`

use std::io::Write;
use std::path::PathBuf;

use crate::calibration::CalibratedMachine;
use crate::identify::{Loss, fit_setup};
use crate::predict::{Beyond, Prediction, predict};

use super::Common;
use super::files::Output;
use super::keep::Keep;
use super::output::{Failure, Kind, Outcome, count, open_machine, open_recordings, write_recording};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine file, calibrated or not
    #[arg(value_name = "CALIBRATED.ron")]
    machine: PathBuf,
    /// Recording
    #[arg(value_name = "REC.csv")]
    recording: PathBuf,
    /// Recordings of the same moments of what hangs on the machine, such as its other arm
    #[arg(value_name = "BESIDE.csv")]
    beside: Vec<PathBuf>,
    /// Where to write the recording with model and residual columns
    #[arg(short, long, value_name = "OUT.csv")]
    output: Option<Output>,
    /// Find again what belongs to the set-up (frame w, tool point, zero, length, effects of where it stands); the machine stays as it is
    #[arg(long)]
    fit_setup: bool,
    #[command(flatten)]
    keep: Keep,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let files: Vec<PathBuf> = std::iter::once(&args.recording).chain(&args.beside).cloned().collect();
    let progress = args.common.progress();
    let mut calibrated = open_machine(&args.machine, |path| CalibratedMachine::open(path))?;
    let recordings = args.keep.within(open_recordings(&files, calibrated.machine(), &args.machine)?);
    if recordings.len() > 1 {
        return Err(Failure::Told {
            what: format!(
                "{} recordings of this machine were given, and one is predicted at a time",
                recordings.len()
            ),
            mend:
                "predict each by itself; only recordings of what hangs on the machine go beside another one"
                    .into(),
        });
    }
    let recordings: Vec<_> = recordings.into_iter().map(|recording| progress.passing(recording)).collect();
    if args.fit_setup {
        progress.say("finding the set-up");
        calibrated = fit_setup(&calibrated, &recordings, Loss::default())?;
    }
    progress.say(&format!("predicting {}", recordings[0].name()));
    let predicted = |out: Option<&mut dyn Write>| {
        let prediction = predict(&calibrated, &recordings[0], out)?;
        if prediction.samples == 0 {
            // Says what is missing.
            recordings[0].scan()?;
        }
        Ok(prediction)
    };
    let prediction = match &args.output {
        None => predicted(None)?,
        Some(path) => write_recording(path, |out| predicted(Some(out)))?,
    };
    drop(progress);
    let mut text = render(&prediction, recordings[0].name());
    if let Some(path) = &args.output {
        text.push_str(&format!("written to {}\n", path.display()));
    }
    args.common.say(&text)?;
    args.common.write_json(&prediction)
}

fn by_how_much(beyond: &Beyond) -> String {
    match beyond.unit.as_str() {
        "rad" => format!("{} by up to {:.3} deg", beyond.joint, beyond.by.to_degrees()),
        _ => format!("{} by up to {:.3} mm", beyond.joint, beyond.by * 1e3),
    }
}

fn render(p: &Prediction, name: &str) -> String {
    let mut text = format!("{name}: {}", count(p.samples, "sample", "samples"));
    if p.dropped > 0 {
        text.push_str(&format!(", {} left out as drop-outs", count(p.dropped, "row", "rows")));
    }
    text.push('\n');
    for (figures, kind) in
        [([p.rms.m, p.max.m, p.mean.m], Kind::Length), ([p.rms.rad, p.max.rad, p.mean.rad], Kind::Angle)]
    {
        if let [Some(rms), Some(max), Some(mean)] = figures.map(|x| x.map(|x| kind.show(x))) {
            text.push_str(&format!(
                "residual (measured minus model): RMS {rms}, largest {max}, mean {mean}\n"
            ));
        }
    }
    if p.extrapolated_samples > 0 {
        text.push_str(&format!(
            "note: at {} a joint leaves the range that the calibration has seen: {}\n",
            count(p.extrapolated_samples, "sample", "samples"),
            p.beyond.iter().map(by_how_much).collect::<Vec<_>>().join(", ")
        ));
    }
    for left in &p.left_out {
        text.push_str(&format!("note: {} at {} is left out: {}\n", left.effect, left.at, left.because));
    }
    if p.unseen_directions > 0 {
        text.push_str(&format!(
            "note: at {} the axes travel in a pattern of directions that the calibration has not seen ({}); it is predicted from what single directions have shown\n",
            count(p.unseen_directions, "sample", "samples"),
            p.unseen_pieces.join(", ")
        ));
    }
    text
}

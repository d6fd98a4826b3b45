//! `kincal merge`

use std::fmt::Write;
use std::path::PathBuf;

use serde::Serialize;

use crate::identify::{CalibrateOptions, Fit, Merged, PartialEquations, Plausibility, merge};

use super::Common;
use super::calibrate::{render, write_machine};
use super::files::Output;
use super::output::{Failure, Outcome, write_whole};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// What `kincal normal` has written, all of one round
    #[arg(required = true, value_name = "PART.ron")]
    parts: Vec<PathBuf>,
    /// Where to write the calibrated machine, or the round that is still needed
    #[arg(short, long, value_name = "MODEL.ron")]
    output: Output,
    /// Go on although recordings and machine do not belong together
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    common: Common,
}

/// What is told in JSON.
#[derive(Serialize)]
struct Told<'a> {
    converged: bool,
    /// The round that is needed.
    #[serde(skip_serializing_if = "Option::is_none")]
    round: Option<usize>,
    #[serde(flatten)]
    fit: Option<&'a Fit>,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let parts = args.parts.iter().map(PartialEquations::open).collect::<Result<Vec<_>, _>>()?;
    match merge(&parts, CalibrateOptions::default())? {
        Merged::Another(round) => {
            write_whole(&args.output, |out| {
                // Watched: an error here is told of the output.
                let _ = out.write_all(round.text().as_bytes());
                Ok(())
            })?;
            let (number, path) = (round.number(), args.output.display());
            args.common.say(&format!(
                "round {number} is needed, written to {path}; next, for each part: kincal normal MACHINE.ron REC.csv... --at {path} -o PART.ron\n"
            ))?;
            args.common.write_json(&Told { converged: false, round: Some(number), fit: None })
        }
        Merged::Found(found) => {
            let (calibrated, fit) = &*found;
            if let Some(p) = fit.plausibility.iter().find(|p| !p.holds()).filter(|_| !args.force) {
                return Err(nonsense(p));
            }
            write_machine(&args.output, calibrated)?;
            let mut text = render(fit, false);
            let _ = writeln!(text, "\nwritten to {}", args.output.display());
            args.common.say(&text)?;
            args.common.write_json(&Told { converged: true, round: None, fit: Some(fit) })
        }
    }
}

fn nonsense(p: &Plausibility) -> Failure {
    Failure::Told {
        what: format!(
            "{}: what is left is {:.1} times what tolerances, instrument and motion could make of it",
            p.recording,
            p.excess()
        ),
        mend: "`kincal calibrate` on this recording names the mistake; --force goes on all the same".into(),
    }
}

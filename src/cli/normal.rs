//! `kincal normal`

use std::path::PathBuf;

use serde::Serialize;

use crate::identify::{PartialEquations, Round};
use crate::machine::Machine;

use super::Common;
use super::files::Output;
use super::keep::Keep;
use super::output::{Failure, Outcome, count, open_machine, open_recordings, write_whole};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine file
    #[arg(value_name = "MACHINE.ron")]
    machine: PathBuf,
    /// Recordings
    #[arg(required = true, value_name = "REC.csv")]
    recordings: Vec<PathBuf>,
    /// The round that `kincal merge` has written; none at first
    #[arg(long, value_name = "ROUND.ron")]
    at: Option<PathBuf>,
    /// Where to write what these recordings add
    #[arg(short, long, value_name = "PART.ron")]
    output: Output,
    /// Refused: directions of travel go across recordings
    #[arg(long, value_name = "AXES", hide = true)]
    directions: Option<String>,
    #[command(flatten)]
    keep: Keep,
    #[command(flatten)]
    common: Common,
}

#[derive(Serialize)]
struct Told {
    rounds: usize,
    recordings: usize,
}

pub(crate) fn run(args: &Args) -> Outcome {
    if args.directions.is_some() {
        return Err(Failure::Told {
            what: "--directions: pieces by direction of travel cannot be merged from parts".into(),
            mend: "use `kincal calibrate --directions` on all recordings; parts are for constant deviations"
                .into(),
        });
    }
    let machine = open_machine(&args.machine, |path| Machine::open(path))?;
    let round = args.at.as_ref().map(Round::open).transpose()?;
    let progress = args.common.progress();
    let recordings = args.keep.within(open_recordings(&args.recordings, &machine, &args.machine)?);
    let recordings = progress.reading(recordings);
    progress.say("summing");
    let part = PartialEquations::of(&machine, &recordings, round.as_ref())?;
    drop(progress);
    write_whole(&args.output, |out| {
        // Watched: an error here is told of the output.
        let _ = out.write_all(part.text().as_bytes());
        Ok(())
    })?;
    let of = count(part.recordings() as u64, "recording", "recordings");
    let text = match part.rounds() {
        0 => format!("heads and ranges of {of}"),
        n => format!("sums of {of}, round {n}"),
    };
    args.common.say(&format!(
        "{text}\nwritten to {}; next: kincal merge PART.ron... -o ROUND.ron\n",
        args.output.display()
    ))?;
    args.common.write_json(&Told { rounds: part.rounds(), recordings: part.recordings() })
}

//! `kincal join`

use std::path::PathBuf;

use crate::recording::join;

use super::Common;
use super::files::Output;
use super::output::{Outcome, count, write_recording};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Recording that keeps its columns
    #[arg(value_name = "REC.csv")]
    recording: PathBuf,
    /// Recording of the same moments, row by row
    #[arg(value_name = "OTHER.csv")]
    other: PathBuf,
    /// What the names of its columns begin with: column q1 becomes NAME.q1
    #[arg(long = "as", value_name = "NAME")]
    name: String,
    /// Where to write the recording with both
    #[arg(short, long, value_name = "OUT.csv")]
    output: Output,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let joined = join(&args.recording, &args.other, &args.name)?;
    write_recording(&args.output, |out| {
        // Watched: an error here is told of the output.
        let _ = out.write_all(joined.text.as_bytes());
        Ok(())
    })?;
    args.common.say(&format!(
        "{} with {} of {}: {}\nthe same in both: {}\nwritten to {}\n",
        count(joined.rows, "row", "rows"),
        count(joined.added.len() as u64, "column", "columns"),
        args.other.display(),
        joined.added.join(", "),
        joined.shared.join(", "),
        args.output.display()
    ))?;
    args.common.write_json(&joined)
}

//! `kincal demo`

use std::fmt::Write;

use kincal::demo::demo;

use super::Common;
use super::calibrate::render;
use super::output::{Outcome, check_outputs, length};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Seed of errors and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    check_outputs(&[args.common.json_file()], &[])?;
    let demo = demo(args.seed)?;
    let mut text = format!(
        "The AC table-tilting reference machine, with random errors of its declared tolerances in every frame, is measured by a \
         simulated ballbar\non two cones in both senses of travel (ISO 10791-6 BK4, inclined by 10 and 30 deg; bar 100 mm, noise \
         0.5 um): {} distances.\n\n",
        demo.fit.samples
    );
    text.push_str(&render(&demo.fit, false));
    if let Some(rms) = demo.fit.rms_m {
        let _ = writeln!(
            text,
            "\nThe bar's deviation falls from {} to {} RMS.",
            length(rms.nominal),
            length(rms.geometric)
        );
    }
    args.common.say(&text);
    args.common.write_json(&demo.fit)
}

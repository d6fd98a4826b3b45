//! `kincal demo`

use std::fmt::Write;
use std::path::Path;

use crate::circular::circular_tests;
use crate::demo::{REFERENCE, demo};

use super::diagnose::Told;
use super::files::Output;
use super::output::{Outcome, length};
use super::report::{self, Frame, Measured, Source, of_measured, write_page};
use super::{Common, calibrate};

/// Where the report goes unless told otherwise.
const REPORT: &str = "kincal_demo.html";

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Seed of errors and noise
    #[arg(long, default_value_t = 2)]
    seed: u64,
    /// Where to write the report with its pictures: one HTML file
    #[arg(long, value_name = "OUT.html", default_value = REPORT)]
    report: Output,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let page_path: &Path = &args.report;
    let progress = args.common.progress();
    let demo = demo(args.seed, &|text| progress.say(text));
    let demo = demo?;
    progress.say("drawing the report");
    let machine = demo.calibrated.machine();
    let recordings = demo.read()?;
    let mut sources = vec![Source::of_text("machine", "ac_table_tilting.ron", REFERENCE)];
    let texts = recordings.iter().zip(&demo.recordings);
    sources.extend(texts.map(|(recording, text)| Source::of_text("recording", recording.name(), text)));
    let circular = circular_tests(&demo.diagnosed, &recordings)?;
    let measured = Measured {
        machine,
        recordings: &recordings,
        geometry: (&demo.calibrated, &demo.fit),
        diagnosis: Some((&demo.diagnosis, Some(&demo.diagnosed))),
        circular: &circular,
    };
    let frame = Frame { command: "kincal demo", sources, notes: Vec::new() };
    let page = of_measured(&measured, &frame)?;
    drop(progress);
    let mut text = format!(
        "The AC table-tilting reference machine, with random errors of its declared tolerances in every frame, is measured by a \
         simulated ballbar\non two cones in both senses of travel (ISO 10791-6 BK4, inclined by 10 and 30 deg; bar 100 mm, noise \
         0.5 um): {} distances.\nConcealed besides: axis a has 12 arcsec of play, the worm of c errs by 6.2 arcsec to and fro with each of its 72 teeth.\n\n\
         First, what constant geometry explains (kincal calibrate):\n\n",
        demo.fit.samples
    );
    text.push_str(&calibrate::render(&demo.fit, false));
    if let Some(rms) = demo.fit.rms.m {
        let _ = writeln!(
            text,
            "\nThe bar's deviation falls from {} to {} RMS, and not to the noise.\n\nThen, what the geometry leaves over (kincal diagnose):\n",
            length(rms.nominal),
            length(rms.geometric)
        );
    }
    text.push_str(&report::render(&demo.diagnosis));
    write_page(page_path, &page)?;
    let _ = writeln!(text, "\nreport with pictures written to {}", page_path.display());
    args.common.say(&text)?;
    let verdict = report::of_diagnosis(&demo.diagnosis);
    args.common.write_json(&Told { verdict, diagnosis: &demo.diagnosis, circular_tests: &circular })
}

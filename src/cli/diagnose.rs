//! `kincal diagnose`

use std::fmt::Write;
use std::path::PathBuf;

use kincal::Machine;
use kincal::diagnose::{Diagnosis, Request, diagnose};
use kincal::effects::Library;
use kincal::recording::Recording;

use super::Common;
use super::output::{Outcome, check_outputs, length, open_machine, open_recording, write_whole};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine file
    #[arg(value_name = "MACHINE.ron")]
    machine: PathBuf,
    /// Recordings
    #[arg(required = true, value_name = "REC.csv")]
    recordings: Vec<PathBuf>,
    /// Families of effects to add to the library, or to replace in it by name
    #[arg(long, value_name = "FILE.ron")]
    effects: Vec<PathBuf>,
    /// Leave a family out
    #[arg(long, value_name = "NAME")]
    without: Vec<String>,
    /// Where to write the calibrated machine with what was found
    #[arg(short, long, value_name = "CALIBRATED.ron")]
    output: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    check_outputs(&[args.output.as_deref(), args.common.json_file()], &args.recordings)?;
    let machine = open_machine(&args.machine, |path| Machine::open(path))?;
    let recordings: Vec<Recording> =
        args.recordings.iter().map(|path| open_recording(path, &machine)).collect::<Result<_, _>>()?;
    let mut library = Library::standard();
    for path in &args.effects {
        library = library.with_file(path)?;
    }
    for name in &args.without {
        library = library.without(name)?;
    }
    let progress = args.common.progress();
    let request = Request::default();
    let found = diagnose(&machine, &recordings, &library, &request, &|text| progress.say(text)).and_then(
        |mut found| {
            let wanted = args.output.is_some() || !found.findings.is_empty();
            let model = match wanted {
                true => {
                    Some(found.model(&machine, &recordings, request.options, &|text| progress.say(text))?)
                }
                false => None,
            };
            Ok((found, model))
        },
    );
    drop(progress);
    let (diagnosis, model) = found?;
    let mut text = render(&diagnosis);
    if let (Some(path), Some(model)) = (&args.output, model) {
        write_whole(path, |out| {
            // Watched: an error here is told of the output.
            let _ = out.write_all(model.to_ron().as_bytes());
            Ok(())
        })?;
        let _ = writeln!(text, "written to {}", path.display());
    }
    args.common.say(&text);
    args.common.write_json(&diagnosis)
}

fn render(diagnosis: &Diagnosis) -> String {
    let mut text = format!("{}: {} samples\n", diagnosis.machine, diagnosis.samples);
    if let Some(noise) = diagnosis.noise_floor_m {
        let _ = writeln!(text, "noise {}", length(noise));
    }
    for finding in &diagnosis.findings {
        let _ = writeln!(text, "\n{} (probability {:.2})", finding.explanation, finding.probability);
        if let Some(held) = &finding.held_out_rms_m {
            let _ = writeln!(
                text,
                "  on stretches left out of the fit: {} without it, {} with it",
                length(held.before),
                length(held.after)
            );
        }
        for other in &finding.confusable_with {
            let _ = writeln!(
                text,
                "  may also be {} at {} ({:.2}); to tell them apart: {}",
                other.effect, other.at, other.probability, other.separate_by
            );
        }
    }
    match &diagnosis.unexplained {
        Some(unexplained) => {
            let _ = writeln!(text, "\n{}", unexplained.explanation);
        }
        None if diagnosis.findings.is_empty() => {
            text.push_str("\nconstant geometry explains these recordings to the noise\n");
        }
        None => {}
    }
    text
}

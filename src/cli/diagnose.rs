//! `kincal diagnose`

use std::fmt::Write;
use std::path::PathBuf;

use crate::calibration::CalibratedMachine;
use crate::circular::{CircularTest, circular_tests};
use crate::diagnose::{DiagnoseOptions, Diagnosis, HeldOutPair, diagnose};
use crate::effects::Library;
use crate::feature::as_seen_in;
use crate::identify::{calibrate, declared};
use crate::machine::Machine;
use crate::recording::Recording;
use crate::units::Quantity;

use super::Common;
use super::files::Output;
use super::keep::Keep;
use super::output::{Outcome, angle, length, open_machine, open_recordings, write_whole};
use super::report::{Frame, Measured, Source, of_diagnosis, of_measured, render, write_page};
use super::verdict;

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
    /// Leave a family out, with its forms; one that --effects brings stays
    #[arg(long, value_name = "NAME")]
    without: Vec<String>,
    /// Where to write families of effects for what has no name: the shortest law for each, for `--effects`
    #[arg(long, value_name = "NEW.ron")]
    propose: Option<Output>,
    /// Where to write the calibrated machine with what was found
    #[arg(short, long, value_name = "CALIBRATED.ron")]
    output: Option<Output>,
    /// Where to write the report with its pictures: one HTML file
    #[arg(long, value_name = "OUT.html")]
    report: Option<Output>,
    /// Go on although recordings and machine do not belong together
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    keep: Keep,
    #[command(flatten)]
    common: Common,
}

/// What is told in JSON.
#[derive(serde::Serialize)]
pub(crate) struct Told<'a> {
    pub verdict: String,
    #[serde(flatten)]
    pub diagnosis: &'a Diagnosis,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub circular_tests: &'a [CircularTest],
}

/// Diagnoses, and models what was found if the model is `wanted` or has more than geometry; nonsense is refused, with `force` it is a note.
pub(crate) fn judged(
    machine: &Machine,
    recordings: &[Recording],
    library: &Library,
    request: &DiagnoseOptions,
    (wanted, force): (bool, bool),
    progress: &dyn Fn(&str),
) -> Outcome<(Diagnosis, Option<CalibratedMachine>, Option<String>)> {
    let note = verdict::beforehand(machine, recordings, force, progress)?;
    let mut found = diagnose(machine, recordings, library, request, progress)?;
    let model = match wanted || found.has_more_than_geometry() {
        true => Some(found.model(machine, recordings, request.options, progress)?),
        false => None,
    };
    Ok((found, model, note))
}

pub(crate) fn run(args: &Args) -> Outcome {
    let machine = open_machine(&args.machine, |path| Machine::open(path))?;
    let progress = args.common.progress();
    let recordings = args.keep.within(open_recordings(&args.recordings, &machine, &args.machine)?);
    let recordings = progress.reading(recordings);
    let mut library = Library::standard();
    for path in &args.effects {
        library = library.with_file(path)?;
    }
    let known: Vec<String> = library.names().into_iter().map(String::from).collect();
    for name in &args.without {
        // A form goes with what it is a form of.
        if library.family(name).is_some() || !known.contains(name) {
            library = library.without(name)?;
        }
    }
    let request = DiagnoseOptions { propose: args.propose.is_some(), ..DiagnoseOptions::default() };
    let (diagnosis, model, note) =
        judged(&machine, &recordings, &library, &request, (args.output.is_some(), args.force), &|text| {
            progress.say(text)
        })?;
    let mut notes: Vec<String> = note.into_iter().collect();
    for recording in &recordings {
        notes.extend(recording.warnings().iter().map(|w| format!("{}: {w}", recording.name())));
    }
    let mut text = render(&diagnosis);
    for note in &notes {
        let _ = writeln!(text, "note: {note}");
    }
    // Where a set-up has to be found first, the angles are those of the machine as declared.
    let circular = match &model {
        _ if args.report.is_none() && !args.common.wants_json() => Vec::new(),
        Some(model) => circular_tests(model, &recordings)?,
        None => circular_tests(&declared(&machine, &recordings)?, &recordings)?,
    };
    let page = match &args.report {
        None => None,
        Some(_) => {
            progress.say("drawing the report");
            let seen = as_seen_in(&machine, &recordings);
            let (geometry, fit) = calibrate(&seen, &recordings, DiagnoseOptions::default().options)?;
            let mut sources = vec![Source::of("machine", &args.machine)];
            sources.extend(args.recordings.iter().map(|path| Source::of("recording", path)));
            sources.extend(args.effects.iter().map(|path| Source::of("effects", path)));
            let measured = Measured {
                machine: &seen,
                recordings: &recordings,
                geometry: (&geometry, &fit),
                diagnosis: Some((&diagnosis, model.as_ref())),
                circular: &circular,
            };
            Some(of_measured(&measured, &Frame { command: "kincal diagnose", sources, notes })?)
        }
    };
    drop(progress);
    if let (Some(path), Some(model)) = (&args.output, &model) {
        write_whole(path, |out| {
            // Watched: an error here is told of the output.
            let _ = out.write_all(model.to_ron().as_bytes());
            Ok(())
        })?;
        let _ = writeln!(text, "\nwritten to {}", path.display());
    }
    if let Some(path) = &args.propose {
        text += &proposed(&diagnosis);
        if let Some(library) = diagnosis.proposed_library() {
            write_whole(path, |out| {
                let _ = out.write_all(library.as_bytes());
                Ok(())
            })?;
            let _ = writeln!(text, "proposals written to {}", path.display());
        }
    }
    if let (Some(path), Some(page)) = (&args.report, page) {
        write_page(path, &page)?;
        let _ = writeln!(text, "\nreport written to {}", path.display());
    }
    args.common.say(&text)?;
    args.common.write_json(&Told {
        verdict: of_diagnosis(&diagnosis),
        diagnosis: &diagnosis,
        circular_tests: &circular,
    })
}

/// What is proposed, in words.
fn proposed(diagnosis: &Diagnosis) -> String {
    if diagnosis.proposals.is_empty() {
        return "\nnothing is proposed: no free function is in the model\n".into();
    }
    let mut text = String::new();
    for proposal in &diagnosis.proposals {
        let beside = proposal.partner.as_ref().map_or(String::new(), |partner| format!(" with {partner}"));
        let what = if proposal.free { "the free function itself" } else { "a law" };
        let _ = write!(
            text,
            "\n{} at {}{beside}: {what}, {}",
            proposal.name,
            proposal.at,
            proposal.law.join("; ")
        );
        for (quantity, HeldOutPair { before, after }) in proposal.held_out_rms.there() {
            let shown = |value: f64| if quantity == Quantity::Angle { angle(value) } else { length(value) };
            let _ = write!(text, "\n  left-out stretches {} -> {}", shown(before), shown(after));
            if let Some(free) = proposal.free_held_out_rms[quantity] {
                let _ = write!(text, " (with any function: {})", shown(free.after));
            }
        }
        text.push('\n');
    }
    text
}

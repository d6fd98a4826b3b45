//! Reports of `calibrate`, `diagnose` and `compensate`: what each says, in words and as one HTML page with pictures.

mod before_after;
mod findings;
mod headline;
mod page;
mod plot;
mod provenance;
mod residuals;
mod style;
mod table;
mod text;
mod track;

use std::path::Path;

use maud::{Markup, html};

use super::output::{Outcome, count, write_whole};
use crate::calibration::CalibratedMachine;
use crate::compensate;
use crate::diagnose::Diagnosis;
use crate::identify::{Fit, Loss, fit_setup};
use crate::machine::Machine;
use crate::recording::Recording;
use crate::units::Rms;
use track::{Stage, tracks};

pub(crate) use headline::{of_compensation, of_diagnosis, of_fit};
pub(crate) use provenance::Source;
pub(crate) use text::render;

/// What all pages have.
pub(crate) struct Frame<'a> {
    /// The command, as it is typed: `kincal calibrate`.
    pub command: &'a str,
    /// What the call has read.
    pub sources: Vec<Source>,
    /// What else has to be told.
    pub notes: Vec<String>,
}

/// What a calibration or a diagnosis is of.
pub(crate) struct Measured<'a> {
    pub machine: &'a Machine,
    pub recordings: &'a [Recording],
    /// The machine with constant deviations, and what its fit says.
    pub geometry: (&'a CalibratedMachine, &'a Fit),
    /// The diagnosis, and the machine with what it named.
    pub diagnosis: Option<(&'a Diagnosis, Option<&'a CalibratedMachine>)>,
}

/// The page of a calibration or a diagnosis.
///
/// # Errors
/// If a recording cannot be read again.
pub(crate) fn of_measured(measured: &Measured, frame: &Frame) -> crate::error::Result<String> {
    let Measured { machine, recordings, geometry: (calibrated, fit), diagnosis } = measured;
    let declared = fit_setup(&CalibratedMachine::nominal((*machine).clone()), recordings, Loss::Squares)?;
    let mut stages = vec![
        Stage { name: "as declared", calibrated: &declared },
        Stage { name: "geometry calibrated", calibrated },
    ];
    let named = diagnosis.filter(|(found, _)| found.has_more_than_geometry()).and_then(|(_, named)| named);
    if let Some(named) = named {
        stages.push(Stage { name: "and what was found", calibrated: named });
    }
    let names: Vec<&'static str> = stages.iter().map(|stage| stage.name).collect();
    let found = diagnosis.map(|(found, _)| found);
    let (tracks, figures) = tracks(machine, recordings, &stages)?;
    let verdict = found.map_or_else(|| of_fit(fit), of_diagnosis);
    let samples = found.map_or(fit.samples, |found| found.samples);
    let mut sections = vec![before_after::before_after(&figures, &names, &totals(fit, found))];
    if let Some(found) = found {
        sections.push(findings::found(found));
    }
    sections.push(residuals::residuals(machine, &tracks, &names, found));
    if let Some(found) = found {
        sections.push(findings::left(found));
    }
    sections.push(findings::geometry(found.map_or(&fit.location_errors, |found| &found.location_errors)));
    sections.push(notes(&frame.notes));
    sections.push(provenance::provenance(&frame.sources, recordings, frame.command));
    let what = if found.is_some() { "Diagnosis" } else { "Calibration" };
    let subtitle = format!(
        "{} in {}.",
        count(samples, "sample", "samples"),
        count(recordings.len() as u64, "recording", "recordings")
    );
    Ok(page::page(&format!("{what} of {}", machine.name()), &verdict, &subtitle, &sections))
}

/// Over all recordings, by model, as text and JSON have them.
fn totals(fit: &Fit, found: Option<&Diagnosis>) -> Vec<Rms> {
    let by = |nominal: [Option<f64>; 2]| Rms { m: nominal[0], rad: nominal[1] };
    match found {
        None => vec![
            by([fit.rms.m.map(|r| r.nominal), fit.rms.rad.map(|r| r.nominal)]),
            by([fit.rms.m.map(|r| r.geometric), fit.rms.rad.map(|r| r.geometric)]),
        ],
        Some(found) => {
            let (m, rad) = (found.rms.m, found.rms.rad);
            let mut all = vec![
                by([m.map(|r| r.nominal), rad.map(|r| r.nominal)]),
                by([m.map(|r| r.geometric), rad.map(|r| r.geometric)]),
            ];
            if found.has_more_than_geometry() {
                all.push(by([m.map(|r| r.r#final), rad.map(|r| r.r#final)]));
            }
            all
        }
    }
}

fn notes(notes: &[String]) -> Markup {
    html! {
        @if !notes.is_empty() {
            h2 { "Notes" }
            ul { @for note in notes { li { (note) } } }
        }
    }
}

/// The page of a compensated program; `told`: what the command says of it, a line each.
pub(crate) fn of_compensated(
    calibrated: &CalibratedMachine,
    report: &compensate::Report,
    told: &str,
    frame: &Frame,
) -> String {
    let machine = calibrated.machine();
    let sections = [
        html! { h2 { "What was done" } ul { @for line in told.lines() { li { (line) } } } },
        notes(&frame.notes),
        provenance::provenance(&frame.sources, &[], frame.command),
    ];
    let subtitle =
        format!("{}, {}.", count(report.blocks, "line", "lines"), count(report.moves, "move", "moves"));
    page::page(&format!("Compensation on {}", machine.name()), &of_compensation(report), &subtitle, &sections)
}

/// Writes a page, whole or not at all.
pub(crate) fn write_page(path: &Path, page: &str) -> Outcome {
    write_whole(path, |out| {
        // Watched: an error here is told of the output.
        let _ = out.write_all(page.as_bytes());
        Ok(())
    })
}

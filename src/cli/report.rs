//! Reports of `calibrate`, `diagnose` and `compensate`: what each says, in words and as one HTML page with pictures.

mod actions;
mod before_after;
mod enter;
mod findings;
mod headline;
mod known;
mod page;
mod plot;
mod polar;
mod provenance;
mod residuals;
mod skeleton;
mod style;
mod table;
mod terminal;
mod text;
mod track;

use std::path::Path;

use maud::{Markup, html};

use super::output::{Outcome, count, write_whole};
use crate::calibration::CalibratedMachine;
use crate::circular::CircularTest;
use crate::compensate;
use crate::diagnose::Diagnosis;
use crate::identify::{Fit, declared};
use crate::machine::Machine;
use crate::recording::Recording;
use crate::units::Rms;
use table::prose;
use track::{Stage, tracks};

pub(crate) use headline::{of_compensation, of_diagnosis, of_fit};
pub(crate) use provenance::Source;
pub(crate) use terminal::{geometry_to_do, render};

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
    /// Recordings along circles and cones.
    pub circular: &'a [CircularTest],
}

/// The page of a calibration or a diagnosis.
///
/// # Errors
/// If a recording cannot be read again.
pub(crate) fn of_measured(measured: &Measured, frame: &Frame) -> crate::error::Result<String> {
    let Measured { machine, recordings, geometry: (calibrated, fit), diagnosis, circular } = measured;
    let declared = declared(machine, recordings)?;
    let mut stages = vec![
        Stage { name: "as declared", calibrated: &declared },
        Stage { name: "geometry calibrated", calibrated },
    ];
    let named = diagnosis.filter(|(found, _)| found.has_more_than_geometry()).and_then(|(_, named)| named);
    if let Some(named) = named {
        stages.push(Stage { name: "with what was found", calibrated: named });
    }
    let names: Vec<&'static str> = stages.iter().map(|stage| stage.name).collect();
    let found = diagnosis.map(|(found, _)| found);
    let location = found.map_or(&fit.location_errors, |found| &found.location_errors);
    let (tracks, figures) = tracks(machine, recordings, &stages)?;
    let still = still(machine, recordings)?;
    let still: Vec<&str> = still.iter().map(String::as_str).collect();
    let mut sections = vec![
        actions::to_do(&actions::actions(found, location)),
        before_after::before_after(&figures, &names, &totals(fit, found)),
        polar::circular(circular, &tracks, names.last().copied().unwrap_or_default()),
    ];
    if let Some(found) = found {
        sections.push(findings::found(found));
    }
    sections.push(residuals::residuals(machine, &tracks, &names, found));
    if let Some(found) = found {
        sections.push(findings::left(found));
    }
    sections.extend([
        findings::geometry(location),
        enter::to_enter(named.unwrap_or(calibrated)),
        known::uncertainty(fit),
        known::unseen(fit, found),
        known::next(fit, found, &still),
        skeleton::skeleton(machine),
        notes(&frame.notes),
        provenance::provenance(&frame.sources, recordings, frame.command),
    ]);
    let verdict = found.map_or_else(|| of_fit(fit), of_diagnosis);
    let samples = found.map_or(fit.samples, |found| found.samples);
    let what = if found.is_some() { "Diagnosis" } else { "Calibration" };
    let subtitle = format!(
        "Root mean square of {} in {}.",
        count(samples, "sample", "samples"),
        count(recordings.len() as u64, "recording", "recordings")
    );
    Ok(page::page(&format!("{what} of {}", machine.name()), &verdict, &subtitle, &sections))
}

/// Commands that no recording moves.
fn still(machine: &Machine, recordings: &[Recording]) -> crate::error::Result<Vec<String>> {
    let mut moved = vec![false; machine.commands().len()];
    for recording in recordings {
        moved.iter_mut().zip(recording.scan()?.moving).for_each(|(moved, own)| *moved |= own);
    }
    let names = machine.commands().iter().zip(moved);
    Ok(names.filter(|(_, moved)| !moved).map(|(name, _)| name.clone()).collect())
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
            ul { @for note in notes { li { (prose(note)) } } }
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
    // What could not be seen has a section.
    let is_own = |line: &&str| !line.starts_with("  ") && !line.starts_with("not seen by ");
    let sections = [
        html! { h2 { "What was done" } ul { @for line in told.lines().filter(is_own) { li { (prose(line)) } } } },
        corrections(report),
        enter::to_enter(calibrated),
        skeleton::skeleton(machine),
        notes(&frame.notes),
        provenance::provenance(&frame.sources, &[], frame.command),
    ];
    let subtitle =
        format!("{}, {}.", count(report.blocks, "line", "lines"), count(report.moves, "move", "moves"));
    page::page(&format!("Compensation on {}", machine.name()), &of_compensation(report), &subtitle, &sections)
}

/// How far the tip is off before and after, and what of it nobody has measured.
fn corrections(report: &compensate::Report) -> Markup {
    let rows = [
        ("before: largest correction of the tip", report.largest_correction_m),
        ("after: left at the end of a move", report.largest_left_m),
        ("after: left along a straight move", report.largest_mid_line_m),
        ("after: left where lines stand for an arc", report.largest_arc_m),
        ("after: left by drilling cycles", report.largest_cycle_m),
        ("step where a direction of travel changes", report.largest_reversal_m),
    ];
    let rows: Vec<_> = rows.into_iter().filter(|(_, worst)| worst.line > 0).collect();
    let unit = table::residual_unit(false, table::largest(rows.iter().map(|(_, worst)| worst.value)));
    let row = |(what, worst): &(&str, compensate::Worst)| {
        let line = table::written(worst.line.to_string(), worst.line as f64);
        vec![table::word(*what), table::number(worst.value, unit), line]
    };
    let seen = report.unseen.as_ref().filter(|unseen| !unseen.patterns.is_empty());
    html! {
        h2 { "Before and after" }
        (table::table(&["what", &format!("at the tip, {}", unit.symbol), "line"], rows.iter().map(row).collect()))
        @if let Some(unseen) = seen {
            h2 { "What could not be seen" }
            p { "One standard deviation of the tip over these moves that no recording has shown: " (super::output::length(unseen.tip_m)) "." }
            ul { @for pattern in unseen.patterns.iter().take(8) {
                li { (pattern.mostly.join(" with ")) ": " (super::output::length(pattern.tip_m)) }
            } }
        }
    }
}

/// Writes a page, whole or not at all.
pub(crate) fn write_page(path: &Path, page: &str) -> Outcome {
    write_whole(path, |out| {
        // Watched: an error here is told of the output.
        let _ = out.write_all(page.as_bytes());
        Ok(())
    })
}

//! The verdict in one or two sentences: how far the machine is off, what of it geometry and what was named take away.

use super::text::{amount, places_of};
use crate::cli::output::{count, length};
use crate::compensate;
use crate::diagnose::{Diagnosis, Finding};
use crate::identify::Fit;

/// What is left within this many times the noise is noise.
const NOISE: f64 = 1.3;
/// Geometry that leaves more than this part of the error has nothing to do with it.
const NOTHING: f64 = 0.98;

/// Combinations of deviations that come mostly from the data.
pub(crate) fn numbers_of(fit: &Fit) -> u64 {
    fit.combinations.iter().filter(|c| c.share > 0.5).count() as u64
}

/// Of a calibration.
pub(crate) fn of_fit(fit: &Fit) -> String {
    let mut parts = Vec::new();
    for (pair, angle) in [(fit.rms.m, false), (fit.rms.rad, true)] {
        if let Some(pair) = pair {
            parts.push((pair.nominal, pair.geometric, None, angle));
        }
    }
    sentence(&parts, numbers_of(fit), &[])
}

/// Of a diagnosis.
pub(crate) fn of_diagnosis(diagnosis: &Diagnosis) -> String {
    let more = diagnosis.has_more_than_geometry();
    let mut parts = Vec::new();
    for (rms, angle) in [(diagnosis.rms.m, false), (diagnosis.rms.rad, true)] {
        if let Some(rms) = rms {
            parts.push((rms.nominal, rms.geometric, more.then_some(rms.r#final), angle));
        }
    }
    let mut names: Vec<String> = Vec::new();
    for finding in &diagnosis.findings {
        let is_like = |f: &&Finding| (&f.effect, &f.at) == (&finding.effect, &finding.at);
        // Forms are told where the name alone would be there twice.
        let is_alone = diagnosis.findings.iter().filter(is_like).count() == 1;
        let form = finding.form.as_ref().filter(|_| !is_alone);
        let effect = form.unwrap_or(&finding.effect).replace('_', " ");
        let at = if finding.at == "measurement" { "the measurement".into() } else { places_of(finding) };
        let name = format!("{effect} of {at}");
        if !names.contains(&name) {
            names.push(name);
        }
    }
    if diagnosis.unexplained.as_ref().is_some_and(|u| u.parts.iter().any(|part| part.modelled)) {
        names.push("what has no name".into());
    }
    let left = left_over_noise(diagnosis);
    let is_noise = left.is_some_and(|times| times <= NOISE);
    let is_bare = diagnosis.unexplained.is_none() && !more && is_noise;
    if is_bare && parts.iter().all(|(nominal, last, ..)| *last > NOTHING * nominal) {
        return format!("The machine is {} off, which is noise.", joined(&parts, |p| Some((p.0, p.3))));
    }
    let mut text = sentence(&parts, diagnosis.geometry_numbers, &names);
    if let Some(unexplained) = &diagnosis.unexplained {
        text += &format!(" Something at {} is left that no name explains.", unexplained.at);
    } else if is_noise {
        text += " What is left is noise.";
    } else if let Some(times) = left {
        text += &format!(" What is left is {times:.1} times the noise.");
    }
    text
}

/// What is left in units of the noise, of lengths or of angles, whichever is more; nothing where outliers are part of it.
fn left_over_noise(diagnosis: &Diagnosis) -> Option<f64> {
    let pairs =
        [(&diagnosis.rms.m, diagnosis.noise_floor.m), (&diagnosis.rms.rad, diagnosis.noise_floor.rad)];
    let ratios = pairs
        .into_iter()
        .filter_map(|(rms, noise)| Some(rms.as_ref()?.r#final / noise?.max(f64::MIN_POSITIVE)));
    ratios.max_by(f64::total_cmp).filter(|_| diagnosis.outliers.is_empty())
}

/// Root mean squares as declared, with geometry, with what was found, and whether they are angles.
type Part = (f64, f64, Option<f64>, bool);

/// One figure of each part.
fn joined(parts: &[Part], of: impl Fn(&Part) -> Option<(f64, bool)>) -> String {
    let figures = parts.iter().filter_map(of).map(|(si, angle)| amount(si, angle));
    figures.collect::<Vec<_>>().join(" and ")
}

/// `The machine is 85 um off; 2.7 um after 13 numbers of its geometry, 0.50 um with play of a.`
fn sentence(parts: &[Part], numbers: u64, names: &[String]) -> String {
    let mut text = format!("The machine is {} off", joined(parts, |p| Some((p.0, p.3))));
    let idle = parts.iter().all(|(nominal, geometric, ..)| *geometric > NOTHING * nominal);
    if idle {
        text += "; geometry takes nothing of that away";
    } else {
        let numbers = count(numbers, "number", "numbers");
        text += &format!("; {} after {numbers} of its geometry", joined(parts, |p| Some((p.1, p.3))));
    }
    let last = joined(parts, |p| Some((p.2?, p.3)));
    if !last.is_empty() {
        let names = match names.split_last() {
            Some((last, [])) => last.clone(),
            Some((last, others)) => format!("{} and {last}", others.join(", ")),
            None => "what every joint has more or less".into(),
        };
        text += &format!("{} {last} with {names}", if idle { ";" } else { "," });
    }
    text + "."
}

/// Of a compensated program.
pub(crate) fn of_compensation(report: &compensate::Report) -> String {
    if !report.has_corrected() {
        return "There is nothing to correct in this program.".into();
    }
    let left = report.largest_left_m.value.max(report.largest_mid_line_m.value);
    format!(
        "This program would be cut up to {} off; as it is written now, {} is left, says the model.",
        length(report.largest_correction_m.value),
        length(left)
    )
}

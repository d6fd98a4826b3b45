//! Effects that are given by name, not searched for, as terms of a model.
//!
//! An effect is written `effect@joint`, or `effect@*` for every joint; `:p;q` behind it are its parameters in SI, `#n` its first `n`
//! features in place of the least number. A list is separated by commas.

use kincal::effects::{Candidate, Candidates, Library, RecordingFacts};
use kincal::feature::{Samples, samples_of};
use kincal::variation::{Part, Term, Varying};

use crate::outcome::{Failure, Outcome};
use crate::sets::Set;

/// Coefficients may be this many usual sizes large.
const ROOM: f64 = 30.0;
/// The same where one axis is measured by itself, and nothing else could be taken for it.
const ROOM_ALONE: f64 = 1e6;
/// A feature with less than this over the recordings says nothing.
const LEAST: f64 = 1e-9;

/// One effect as it is written.
struct Asked<'a> {
    effect: &'a str,
    at: &'a str,
    parameters: Vec<f64>,
    features: Option<usize>,
}

impl<'a> Asked<'a> {
    fn parse(text: &'a str) -> Option<Self> {
        let (text, features) = text.split_once('#').unwrap_or((text, ""));
        let (place, numbers) = text.split_once(':').unwrap_or((text, ""));
        let (effect, at) = place.split_once('@')?;
        let parameters: Result<Vec<f64>, _> =
            numbers.split(';').filter(|n| !n.is_empty()).map(str::parse).collect();
        Some(Asked { effect, at, parameters: parameters.ok()?, features: features.parse().ok() })
    }
}

/// The terms of the effects that are asked for, on the machine and recordings of a set.
pub fn terms(set: &Set, asked: &str) -> Outcome<Varying> {
    let recordings = set.whole()?;
    let facts = RecordingFacts::of(&set.machine, &recordings)?;
    let library = Library::standard();
    let candidates = library.candidates(&set.machine, &facts);
    let mut samples = Vec::new();
    for recording in &recordings {
        samples.extend(samples_of(recording, &set.machine, &facts.dead_bands)?);
    }
    let mut varying = Varying::default();
    for text in asked.split(',') {
        let broken = |what: &str| Failure::Broken(format!("{}: {what} `{}`", set.name, text.trim()));
        let asked = Asked::parse(text.trim()).ok_or_else(|| broken("cannot read"))?;
        let before = varying.terms.len();
        of_effect(set, &candidates, &samples, &asked, &mut varying.terms);
        if varying.terms.len() == before {
            return Err(broken("no candidate is"));
        }
    }
    Ok(varying)
}

fn of_effect(set: &Set, candidates: &Candidates, samples: &[Samples], asked: &Asked, terms: &mut Vec<Term>) {
    let machine = &set.machine;
    let fits =
        |c: &&Candidate| c.effect == asked.effect && (asked.at == "*" || c.place.name(machine) == asked.at);
    let room = if machine.commands().len() == 1 { ROOM_ALONE } else { ROOM };
    for candidate in candidates.all.iter().filter(fits) {
        let parameters = if asked.parameters.is_empty() {
            &candidate.grid[candidate.grid.len() / 2]
        } else {
            &asked.parameters
        };
        let taken = asked.features.unwrap_or(candidate.least);
        for coefficient in candidate.coefficients.iter().filter(|c| c.order < taken) {
            let feature = |f: usize| candidate.features[f].with(parameters);
            let first = feature(coefficient.parts[0].feature);
            let column = first.over(samples, &[]);
            let rms = (column.iter().map(|x| x * x).sum::<f64>() / column.len() as f64).sqrt();
            // What weighs only in a frame that is not found yet is nothing here, and something in the fit.
            let rms = if first.needs_gravity() { rms.max(1.0) } else { rms };
            if rms.is_nan() || rms < LEAST {
                continue;
            }
            let parts = coefficient.parts.iter().map(|part| Part {
                slot: part.slot,
                direction: part.direction,
                feature: feature(part.feature),
            });
            terms.push(Term {
                parts: parts.collect(),
                scale: room * coefficient.size / rms,
                prior: true,
                of_setup: false,
            });
        }
    }
}

//! Effects that are given to a set of recordings by name, and what they leave.
//!
//! A term is `effect@joint`, `effect@joint/partner`, `*` for every joint, and `:p;q` behind it its parameters in SI, `#n` its first `n`
//! features instead of the least number.

use kincal::CalibratedMachine;
use kincal::effects::{Candidate, Library, RecordingFacts};
use kincal::feature::samples_of;
use kincal::identify::{CalibrateOptions, ErrorModel, calibrate_model, fit_setup};
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::variation::{Part, Term, Varying};
use rayon::prelude::*;

use super::sets::{Fold, Judged, Set};

/// Coefficients may be this many usual sizes large.
const ROOM: f64 = 30.0;
/// The same where one axis is measured by itself, and nothing else could be taken for it.
const ROOM_ALONE: f64 = 1e6;

/// A term as it is written: effect, joint, partner, parameters.
struct Asked<'a> {
    effect: &'a str,
    at: &'a str,
    with: Option<&'a str>,
    parameters: Vec<f64>,
    features: Option<usize>,
}

impl<'a> Asked<'a> {
    fn parse(text: &'a str) -> Self {
        let (text, features) = text.split_once('#').unwrap_or((text, ""));
        let (place, numbers) = text.split_once(':').unwrap_or((text, ""));
        let (effect, at) = place.split_once('@').expect("effect@joint");
        let (at, with) = at.split_once('/').map_or((at, None), |(at, with)| (at, Some(with)));
        let parameters = numbers.split(';').filter(|n| !n.is_empty()).map(|n| n.parse().expect("a number"));
        Asked { effect, at, with, parameters: parameters.collect(), features: features.parse().ok() }
    }
}

/// The terms of effects that are asked for, on a machine with these recordings.
pub fn terms(set: &Set, library: &Library, asked: &str) -> (Varying, Vec<String>) {
    let recordings = set.whole();
    let facts = RecordingFacts::of(&set.machine, &recordings).unwrap_or_else(|e| panic!("{e}"));
    let candidates = library.candidates(&set.machine, &facts);
    let samples: Vec<_> = (recordings.iter())
        .flat_map(|r| samples_of(r, &set.machine, &facts.dead_bands).unwrap_or_else(|e| panic!("{e}")))
        .collect();
    let (mut varying, mut names) = (Varying::default(), Vec::new());
    for text in asked.split(',').filter(|t| !t.is_empty()) {
        let asked = Asked::parse(text.trim());
        let fits = |c: &&Candidate| {
            let is = |wanted: &str, name: Option<String>| wanted == "*" || name.as_deref() == Some(wanted);
            c.effect == asked.effect
                && is(asked.at, Some(c.place.name(&set.machine)))
                && asked.with.is_none_or(|with| is(with, c.place.partner(&set.machine)))
        };
        let before = varying.terms.len();
        for candidate in candidates.all.iter().filter(fits) {
            let parameters = if asked.parameters.is_empty() {
                &candidate.grid[candidate.grid.len() / 2]
            } else {
                &asked.parameters
            };
            let taken = asked.features.unwrap_or(candidate.least);
            for coefficient in candidate.coefficients.iter().filter(|c| c.order < taken) {
                let feature = |f: usize| candidate.features[f].with(parameters);
                let column = feature(coefficient.parts[0].feature).over(&samples, &[]);
                let rms = (column.iter().map(|x| x * x).sum::<f64>() / column.len() as f64).sqrt();
                // What weighs only in a frame that is not found yet is nothing here, and something in the fit.
                let weighs = feature(coefficient.parts[0].feature).needs_gravity();
                let rms = if weighs { rms.max(1.0) } else { rms };
                if rms.is_nan() || rms < 1e-9 {
                    continue;
                }
                let parts = (coefficient.parts.iter()).map(|p| Part {
                    slot: p.slot,
                    direction: p.direction,
                    feature: feature(p.feature),
                });
                let room = if set.machine.commands().len() == 1 { ROOM_ALONE } else { ROOM };
                let scale = room * coefficient.size / rms;
                varying.terms.push(Term { parts: parts.collect(), scale, prior: true, of_setup: false });
                names.push(format!(
                    "{}@{} {}.{} (rms {rms:.3e}, size {:.1e})",
                    candidate.effect,
                    candidate.place.name(&set.machine),
                    coefficient.order,
                    coefficient.direction,
                    coefficient.size
                ));
            }
        }
        if varying.terms.len() == before {
            let why = candidates.skipped.iter().filter(|s| s.effect == asked.effect);
            panic!("no candidate {text}: {:?}", why.collect::<Vec<_>>());
        }
    }
    (varying, names)
}

/// Sum of squares, mm or mdeg, and samples.
fn squares(calibrated: &CalibratedMachine, recordings: &[Recording]) -> (f64, u64) {
    recordings.iter().fold((0.0, 0), |(sum, count), recording| {
        let found = predict(calibrated, recording, None).unwrap_or_else(|e| panic!("{e}"));
        let rms = found.rms.m.map(|m| 1e3 * m).or(found.rms.rad.map(|r| 1e3 * r.to_degrees()));
        (sum + rms.expect("readings").powi(2) * found.samples as f64, count + found.samples)
    })
}

/// RMS on all rows and on rows left out, mm or mdeg.
#[derive(Clone, Copy, Debug)]
pub struct Figures {
    pub fitted: f64,
    pub left_out: f64,
}

/// Calibrates a set with these terms, on all rows and on each part in turn.
pub fn figures(set: &Set, varying: &Varying, names: &[String]) -> Figures {
    let model = ErrorModel::default().with_varying(varying.clone());
    let calibrated = |recordings: &[Recording]| {
        calibrate_model(&set.machine, recordings, &model, CalibrateOptions::default(), &|_| {})
            .unwrap_or_else(|e| panic!("{}: {e}", set.name))
    };
    let whole = || {
        let whole = set.whole();
        let (found, fit) = calibrated(&whole);
        (squares(&found, &whole), fit)
    };
    let without = || -> Vec<(f64, u64)> {
        let one = |fold: Fold| {
            let (learnt, _) = calibrated(&fold.train);
            let judged = |Judged { setup, test }: &Judged| {
                if setup.is_empty() {
                    return squares(&learnt, test);
                }
                let placed = fit_setup(&learnt, setup, CalibrateOptions::default().loss);
                squares(&placed.unwrap_or_else(|e| panic!("{e}")), test)
            };
            fold.judged.iter().map(judged).collect::<Vec<_>>()
        };
        set.folds().into_par_iter().flat_map_iter(one).collect()
    };
    let (((sum, count), fit), folds) = rayon::join(whole, without);
    for (name, c) in names.iter().zip(&fit.coefficients) {
        println!("  {name:<60} {:11.4e} ± {:.1e}", c.value, c.std_error);
    }
    let (left, judged) = folds.iter().fold((0.0, 0), |(left, judged), (l, j)| (left + l, judged + j));
    Figures { fitted: (sum / count as f64).sqrt(), left_out: (left / judged as f64).sqrt() }
}

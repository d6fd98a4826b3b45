//! Physics by name on recordings of real machines: effects that are given, not searched for, judged where they were not fitted.
//!
//! `cargo test --release --test real_physics -- --nocapture` prints the figures of `docs/real-recordings.md`. With
//! `KINCAL_SET=hilti_jaibot KINCAL_TERMS=gravity_compliance@q2,backlash@q1` one set is fitted with those effects;
//! `KINCAL_EFFECTS=FILE` adds families. A term is `effect@joint`, `effect@joint/partner`, `*` for every joint, and
//! `:p;q` behind it its parameters in SI, `#n` its first `n` features instead of the least number.

mod common;

use common::sets::{Set, axes, hilti, justin, kuka, pandas};
use kincal::CalibratedMachine;
use kincal::effects::{Candidate, Library, RecordingFacts, Slot as EffectSlot};
use kincal::feature::samples_of;
use kincal::identify::{Model, Options, calibrate_model, fit_setup};
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::variation::{Part, Slot, Term, Varying};

/// Coefficients may be this many usual sizes large.
const ROOM: f64 = 30.0;

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
fn terms(set: &Set, library: &Library, asked: &str) -> (Varying, Vec<String>) {
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
                if rms.is_nan() || rms < 1e-9 {
                    continue;
                }
                let parts = (coefficient.parts.iter()).map(|p| Part {
                    slot: match p.slot {
                        EffectSlot::Before(j) => Slot::Before(j),
                        EffectSlot::After(j) => Slot::Carried(j),
                        EffectSlot::Reading => Slot::Reading(0),
                    },
                    direction: p.direction,
                    feature: feature(p.feature),
                });
                let scale = ROOM * coefficient.size / rms;
                varying.terms.push(Term { parts: parts.collect(), scale, prior: true });
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
        let rms = found.rms_m.map(|m| 1e3 * m).or(found.rms_rad.map(|r| 1e3 * r.to_degrees()));
        (sum + rms.expect("readings").powi(2) * found.samples as f64, count + found.samples)
    })
}

/// RMS on all rows and on rows left out, mm or mdeg.
#[derive(Clone, Copy, Debug)]
struct Figures {
    fitted: f64,
    left_out: f64,
}

fn figures(set: &Set, varying: &Varying, names: &[String]) -> Figures {
    let model = Model { varying: varying.clone(), ..Model::default() };
    let calibrated = |recordings: &[Recording]| {
        calibrate_model(&set.machine, recordings, &model, Options::default(), &|_| {})
            .unwrap_or_else(|e| panic!("{}: {e}", set.name))
    };
    let whole = set.whole();
    let (found, fit) = calibrated(&whole);
    let (sum, count) = squares(&found, &whole);
    for (name, c) in names.iter().zip(&fit.coefficients) {
        println!("  {name:<60} {:11.4e} ± {:.1e}", c.value, c.std_error);
    }
    let (mut left, mut judged) = (0.0, 0);
    for fold in set.folds() {
        let (mut learnt, _) = calibrated(&fold.train);
        if !fold.setup.is_empty() {
            learnt =
                fit_setup(&learnt, &fold.setup, Options::default().loss).unwrap_or_else(|e| panic!("{e}"));
        }
        let (sum, count) = squares(&learnt, &fold.test);
        left += sum;
        judged += count;
    }
    Figures { fitted: (sum / count as f64).sqrt(), left_out: (left / judged as f64).sqrt() }
}

fn sets() -> Vec<Set> {
    let mut sets: Vec<Set> = kuka().into_iter().collect();
    sets.extend(pandas());
    sets.extend(hilti());
    sets.extend(justin());
    sets.extend(axes());
    sets
}

#[test]
fn a_set_with_the_terms_that_are_asked_for() {
    let (Ok(name), Ok(asked)) = (std::env::var("KINCAL_SET"), std::env::var("KINCAL_TERMS")) else {
        println!("skipped: set KINCAL_SET and KINCAL_TERMS");
        return;
    };
    let mut library = Library::standard();
    if let Some(file) = std::env::var_os("KINCAL_EFFECTS") {
        library = library.with_file(file).unwrap_or_else(|e| panic!("{e}"));
    }
    for set in sets().iter().filter(|s| s.name.starts_with(&name)) {
        for asked in asked.split('|') {
            let start = std::time::Instant::now();
            let (varying, names) = terms(set, &library, asked);
            let quiet = std::env::var_os("KINCAL_QUIET").is_some();
            let found = figures(set, &varying, if quiet { &[] } else { &names });
            println!(
                "{:<24} {:>3} terms  fitted {:8.4}  left out {:8.4}  {:5.1} s  {asked}",
                set.name,
                varying.terms.len(),
                found.fitted,
                found.left_out,
                start.elapsed().as_secs_f64()
            );
        }
    }
}

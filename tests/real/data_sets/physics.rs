//! Physics by name on recordings of real machines: effects that are given, not searched for, judged where they were not fitted.
//!
//! `cargo test --release --test real_physics -- --nocapture` prints the figures of `docs/real-recordings.md`. With
//! `KINCAL_SET=hilti_jaibot KINCAL_TERMS=gravity_compliance@q2,backlash@q1` one set is fitted with those effects;
//! `KINCAL_EFFECTS=FILE` adds families. A term is `effect@joint`, `effect@joint/partner`, `*` for every joint, and
//! `:p;q` behind it its parameters in SI, `#n` its first `n` features instead of the least number.

use std::sync::LazyLock;

use super::sets::{Fold, Set, axes, hilti, justin, justin_with_both_arms, kuka, pandas};
use kincal::CalibratedMachine;
use kincal::effects::{Candidate, Library, RecordingFacts};
use kincal::feature::samples_of;
use kincal::identify::{Model, Options, calibrate_model, fit_setup};
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::variation::{Part, Term, Varying};
use rayon::prelude::*;

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
    let whole = || {
        let whole = set.whole();
        let (found, fit) = calibrated(&whole);
        (squares(&found, &whole), fit)
    };
    let without = || -> Vec<(f64, u64)> {
        let one = |fold: Fold| {
            let (mut learnt, _) = calibrated(&fold.train);
            if !fold.setup.is_empty() {
                learnt = fit_setup(&learnt, &fold.setup, Options::default().loss)
                    .unwrap_or_else(|e| panic!("{e}"));
            }
            squares(&learnt, &fold.test)
        };
        set.folds().into_par_iter().map(one).collect()
    };
    let (((sum, count), fit), folds) = rayon::join(whole, without);
    for (name, c) in names.iter().zip(&fit.coefficients) {
        println!("  {name:<60} {:11.4e} ± {:.1e}", c.value, c.std_error);
    }
    let (left, judged) = folds.iter().fold((0.0, 0), |(left, judged), (l, j)| (left + l, judged + j));
    Figures { fitted: (sum / count as f64).sqrt(), left_out: (left / judged as f64).sqrt() }
}

static SETS: LazyLock<Vec<Set>> = LazyLock::new(|| {
    let mut sets = vec![kuka(), hilti()];
    sets.extend(pandas());
    sets.extend(justin());
    sets.extend(justin_with_both_arms());
    sets.extend(axes());
    sets
});

fn set(name: &str) -> &'static Set {
    SETS.iter().find(|set| set.name == name).unwrap_or_else(|| panic!("no set {name}"))
}

#[test]
#[ignore = "needs the data sets"]
fn a_set_with_the_terms_that_are_asked_for() {
    let (Ok(name), Ok(asked)) = (std::env::var("KINCAL_SET"), std::env::var("KINCAL_TERMS")) else {
        println!("skipped: set KINCAL_SET and KINCAL_TERMS");
        return;
    };
    let mut library = Library::standard();
    if let Some(file) = std::env::var_os("KINCAL_EFFECTS") {
        library = library.with_file(file).unwrap_or_else(|e| panic!("{e}"));
    }
    for set in SETS.iter().filter(|s| s.name.starts_with(&name)) {
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

/// What given physics must reach: set, terms, RMS on all rows and on rows left out, mm or mdeg; limits a few percent above what is
/// reached.
const REACHED: [(&str, &str, f64, f64); 16] = [
    ("kuka_14", "gravity_compliance@*#1", 0.082, 0.100),
    ("panda_3", "gravity_compliance@*#1,cyclic_error@*:240#2", 0.156, 0.175),
    ("panda_4", "gravity_compliance@*#1,cyclic_error@*:240#2", 0.180, 0.315),
    ("panda_7 right", "cyclic_error@*:240#2", 0.136, 0.190),
    ("dlr_justin left", "gravity_compliance@*", 8.5, 9.0),
    ("dlr_justin right", "gravity_compliance@*", 9.3, 9.9),
    ("dlr_justin left with right", "gravity_compliance@*#40,lateral_compliance@*", 2.75, 3.9),
    ("dlr_justin right with left", "gravity_compliance@*#40,lateral_compliance@*", 2.9, 4.2),
    ("tracker", "position_dependent_backlash@c#3,positioning_error@c#2", 0.66, 0.71),
    ("stroke", "cyclic_error@c:61.5#2", 2.1, 2.1),
    ("resolver_fourth", RESOLVER, 695.0, 695.0),
    ("resolver_second", RESOLVER, 250.0, 250.0),
    ("reversals", "presliding_friction@c", 3.0, 3.0),
    ("open_loop", "cyclic_error@x:0.00025#4", 0.00105, 0.00105),
    ("axis1_laser_10.0", "positioning_error@x#4,position_dependent_backlash@x#3", 0.0028, 0.0033),
    ("axis2_laser_10.2", "positioning_error@x#4,position_dependent_backlash@x#2", 0.0036, 0.0038),
];
const RESOLVER: &str = "servo_lag@c,graduation_error@c:4#4,coupling_misalignment@c,encoder_eccentricity@c";
const COLUMN: &str = "gravity_compliance@*#1,lateral_compliance@*,column_compliance@column#9,\
     guide_clearance@column:30;1.98#6,straightness@column#3,angular_error@column#3";

fn reaches(name: &str, asked: &str, fitted: f64, left_out: f64) {
    let set = set(name);
    let library = Library::standard();
    let bare = figures(set, &Varying::default(), &[]);
    let (varying, names) = terms(set, &library, asked);
    let found = figures(set, &varying, &names);
    println!(
        "{name:<18} fitted {:.4} -> {:.4}  left out {:.4} -> {:.4}  {asked}",
        bare.fitted, found.fitted, bare.left_out, found.left_out
    );
    assert!(found.fitted <= fitted, "{name}: {:.4} on all rows, expected {fitted} at most", found.fitted);
    assert!(
        found.left_out <= left_out,
        "{name}: {:.4} left out, expected {left_out} at most",
        found.left_out
    );
    assert!(found.left_out < bare.left_out, "{name}: {asked} does not help on rows left out");
}

#[test]
#[ignore = "needs the data sets"]
fn named_physics_explains_what_geometry_leaves_on_rows_left_out() {
    REACHED.iter().for_each(|(name, asked, fitted, left_out)| reaches(name, asked, *fitted, *left_out));
}

#[test]
#[ignore = "needs the data sets"]
fn a_lifting_column_that_bends_and_leans_explains_its_robot() {
    reaches("hilti_jaibot", COLUMN, 1.38, 1.78);
}

/// The terms that a set is given.
fn asked_of(name: &str) -> &'static str {
    REACHED.iter().find(|reached| reached.0 == name).expect("a set of the list").1
}

/// Of a set and one term of it: its coefficients.
fn coefficients(name: &str, asked: &str) -> Vec<f64> {
    let set = set(name);
    let (varying, _) = terms(set, &Library::standard(), asked);
    let model = Model { varying, ..Model::default() };
    let found = calibrate_model(&set.machine, &set.whole(), &model, Options::default(), &|_| {});
    let (_, fit) = found.unwrap_or_else(|e| panic!("{e}"));
    fit.coefficients.iter().map(|c| c.value).collect()
}

/// Within a part of what an independent source says.
fn near(what: &str, found: f64, expected: f64, part: f64) {
    println!("{what}: {found:.4}, expected {expected}");
    assert!((found - expected).abs() <= part * expected.abs(), "{what}: {found} instead of {expected}");
}

#[test]
#[ignore = "needs the data sets"]
fn sizes_agree_with_what_independent_sources_say() {
    let mdeg = |rad: f64| 1e3 * rad.to_degrees();
    let c = coefficients("tracker", asked_of("tracker"));
    // Width at 0, 20 and 40 deg: ends and middle of the travel.
    near("play at 0 deg, mdeg", mdeg(c[0] - c[1] + c[2]), 34.1, 0.02);
    near("play at 20 deg, mdeg", mdeg(c[0] - c[2]), 38.6, 0.02);
    near("play at 40 deg, mdeg", mdeg(c[0] + c[1] + c[2]), 31.2, 0.02);
    let c = coefficients("stroke", asked_of("stroke"));
    near("pinion, mdeg", mdeg(c[0].hypot(c[1])), 4.3, 0.05);
    let c = coefficients("resolver_fourth", RESOLVER);
    near("delay, s", c[0], 0.034, 0.05);
    near("fourth harmonic, deg", c[1].hypot(c[2]).to_degrees(), 8.16, 0.05);
    let c = coefficients("resolver_second", RESOLVER);
    near("delay, s", c[0], 0.034, 0.05);
    near("second harmonic, deg", c[5].hypot(c[6]).to_degrees(), 1.54, 0.05);
    let c = coefficients("open_loop", asked_of("open_loop"));
    near("cyclic error of 0.250 mm, um", 1e6 * c[0].hypot(c[1]), 20.6, 0.02);
}

//! Sets of real recordings in ways that no test judges: losses and tolerances side by side, effects given by name.

use std::path::Path;

use kincal::Machine;
use kincal::effects::Library;
use kincal::identify::{CalibrateOptions, Loss};
use kincal::machine::Tolerance;

use crate::left_out::cross_validate;
use crate::sets::{SETS, Set, fanuc, gen3_lites, hilti, justin, kuka, pandas};
use crate::terms::{figures, terms};

/// What each loss leaves on rows left out.
pub fn losses() {
    let losses = [
        ("squares", Loss::Squares),
        ("huber 3", Loss::Huber { k: 3.0 }),
        ("huber 2", Loss::Huber { k: 2.0 }),
        ("huber 1.345", Loss::Huber { k: 1.345 }),
        ("tukey 4.685", Loss::Tukey { c: 4.685 }),
    ];
    for set in all() {
        let folds = set.folds();
        let column = losses.map(|(name, loss)| {
            let (_, held_out) =
                cross_validate(&set, &folds, &set.machine, CalibrateOptions::default().with_loss(loss));
            format!("{name} {held_out:7.4}")
        });
        println!("{:<24} left out, mm: {}", set.name, column.join("  "));
    }
}

/// The machine with another tolerance (mm, deg) of the frames that state none.
fn with_tolerance(machine: &Machine, mm: f64, deg: f64) -> Machine {
    let tolerance = Tolerance { translation: 1e-3 * mm, rotation: deg.to_radians() };
    machine.clone().with_tolerance(tolerance).expect("positive")
}

/// The same by the tolerance of frames that state none.
pub fn tolerances() {
    const DEGREES: [f64; 5] = [0.03, 0.1, 0.3, 1.0, 3.0];
    for set in all() {
        let folds = set.folds();
        println!("{}, left out, mm; across: tolerance {DEGREES:?} deg", set.name);
        for mm in [0.2, 0.5, 1.0, 2.0, 5.0] {
            let held_out = DEGREES.map(|deg| {
                let machine = with_tolerance(&set.machine, mm, deg);
                format!("{:7.3}", cross_validate(&set, &folds, &machine, CalibrateOptions::default()).1)
            });
            println!("{mm:8} mm  {}", held_out.join("  "));
        }
    }
}

/// Fits the sets whose names begin so with effects that are given.
pub fn given(name: &str, asked: &str, effects: Option<&Path>, quiet: bool) {
    let mut library = Library::standard();
    if let Some(file) = effects {
        library = library.with_file(file).unwrap_or_else(|e| panic!("{e}"));
    }
    for set in SETS.iter().filter(|s| s.name.starts_with(name)) {
        for asked in asked.split('|') {
            let start = std::time::Instant::now();
            let (varying, names) = terms(set, &library, asked);
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

/// All arms.
fn all() -> Vec<Set> {
    let mut sets = vec![kuka()];
    sets.extend(pandas());
    sets.extend(gen3_lites());
    sets.push(hilti());
    sets.extend(justin());
    sets.push(fanuc());
    sets
}

//! Constant geometry, learnt from a part of a set and judged on the rest.

use kincal::identify::{CalibrateOptions, calibrate, fit_setup};
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::{CalibratedMachine, Machine};

use super::sets::{Fold, Judged, Set};

/// Root mean square over recordings, mm.
fn rms(calibrated: &CalibratedMachine, recordings: &[Recording]) -> (f64, u64) {
    recordings.iter().fold((0.0, 0), |(sum, count), recording| {
        let found = predict(calibrated, recording, None).unwrap_or_else(|e| panic!("{e}"));
        let mm = 1e3 * found.rms.m.expect("positions");
        (sum + mm * mm * found.samples as f64, count + found.samples)
    })
}

/// Cross-validation of a set with a machine, which may differ from the set's own in its tolerances.
pub fn cross_validate(set: &Set, folds: &[Fold], machine: &Machine, options: CalibrateOptions) -> (f64, f64) {
    let nominal = CalibratedMachine::nominal(machine.clone());
    let (mut before, mut after, mut samples) = (0.0, 0.0, 0);
    for fold in folds {
        let (learnt, _) =
            calibrate(machine, &fold.train, options).unwrap_or_else(|e| panic!("{}: {e}", set.name));
        for Judged { setup, test } in &fold.judged {
            let place = if setup.is_empty() { &fold.train } else { setup };
            let placed = |known: &CalibratedMachine| {
                fit_setup(known, place, options.loss).unwrap_or_else(|e| panic!("{}: {e}", set.name))
            };
            // What was learnt knows where its own set-up stands.
            let (sum, count) =
                if setup.is_empty() { rms(&learnt, test) } else { rms(&placed(&learnt), test) };
            before += rms(&placed(&nominal), test).0;
            after += sum;
            samples += count;
        }
    }
    let mean = |sum: f64| (sum / samples as f64).sqrt();
    (mean(before), mean(after))
}

//! What a model that was learnt from a part says of the rest.

use kincal::identify::{CalibrateOptions, ErrorModel, Loss, calibrate_model, fit_setup};
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::{CalibratedMachine, Machine};
use rayon::prelude::*;

use crate::outcome::{Outcome, given};
use crate::sets::{Fold, Set};

/// Squares of residual norms over samples: mm, or mdeg where only angles were measured.
#[derive(Clone, Copy, Default)]
pub struct Squares {
    sum: f64,
    samples: u64,
}

impl Squares {
    pub fn of(calibrated: &CalibratedMachine, recordings: &[Recording]) -> Outcome<Self> {
        let mut all = Squares::default();
        for recording in recordings {
            let found = predict(calibrated, recording, None)?;
            let rms = found.rms.m.map(|m| 1e3 * m).or(found.rms.rad.map(|r| 1e3 * r.to_degrees()));
            all.sum += given(rms, "readings")?.powi(2) * found.samples as f64;
            all.samples += found.samples;
        }
        Ok(all)
    }

    pub fn with(self, other: Self) -> Self {
        Squares { sum: self.sum + other.sum, samples: self.samples + other.samples }
    }

    pub fn rms(self) -> f64 {
        (self.sum / self.samples as f64).sqrt()
    }
}

/// RMS on rows left out: with the machine as declared, and calibrated.
#[derive(Clone, Copy)]
pub struct LeftOut {
    pub nominal: f64,
    pub calibrated: f64,
}

/// Every fold of the set in turn, with a machine that may differ from the set's own in its tolerances.
pub fn left_out(
    set: &Set,
    machine: &Machine,
    model: &ErrorModel,
    options: CalibrateOptions,
) -> Outcome<LeftOut> {
    let nominal = CalibratedMachine::nominal(machine.clone());
    let one = |fold: Fold| -> Outcome<[Squares; 2]> {
        let (learnt, _) = calibrate_model(machine, &fold.train, model, options, &|_| {})?;
        let own = fold.setup.is_empty();
        let placed = |known: &CalibratedMachine, loss: Loss| {
            fit_setup(known, if own { &fold.train } else { &fold.setup }, loss)
        };
        // What was learnt knows where its own set-up stands; the machine as declared does not.
        let learnt = if own { learnt } else { placed(&learnt, options.loss)? };
        let before = Squares::of(&placed(&nominal, options.loss)?, &fold.test)?;
        Ok([before, Squares::of(&learnt, &fold.test)?])
    };
    let folds: Outcome<Vec<[Squares; 2]>> = set.folds()?.into_par_iter().map(one).collect();
    let [before, after] =
        folds?.into_iter().fold([Squares::default(); 2], |[a, b], [c, d]| [a.with(c), b.with(d)]);
    Ok(LeftOut { nominal: before.rms(), calibrated: after.rms() })
}

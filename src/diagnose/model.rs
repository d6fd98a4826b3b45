//! The result as a machine: constant deviations and the effects that were found, fitted together on the real model.

use super::Diagnosis;
use super::diagnosis::{Named, RmsByModel};
use crate::calibration::{CalibratedMachine, terms};
use crate::effects::{RecordingFacts, StoredEffect};
use crate::error::{Error, Result};
use crate::feature::as_seen_in;
use crate::identify::{CalibrateOptions, ErrorModel, calibrate_model};
use crate::machine::Machine;
use crate::recording::Recording;
use crate::sensor::Sensor;
use crate::variation::{Term, Varying};

impl Diagnosis {
    /// Fits geometry and what was found together on the real model, where the search worked on its linearisation, and puts the
    /// RMS that this leaves into the diagnosis. Nonlinear parameters (periods, time constants, places) stay where
    /// `docs/diagnosis-method.md` (74) has put them.
    ///
    /// # Errors
    /// As [`calibrate_model`].
    pub fn model(
        &mut self,
        machine: &Machine,
        recordings: &[Recording],
        options: CalibrateOptions,
        progress: &dyn Fn(&str),
    ) -> Result<CalibratedMachine> {
        let machine = &as_seen_in(machine, recordings);
        let facts = RecordingFacts::of(machine, recordings)?;
        let named: Vec<Named> = self.named.iter().map(|n| taking_part(n, recordings)).collect();
        let mut all: Vec<Term> = Vec::new();
        for Named { effect, scales } in &named {
            let own = terms(machine, effect).map_err(|unbound| Error::Undetermined {
                what: format!(
                    "effect {} at {} cannot be put into the model: {unbound}",
                    effect.effect, effect.at
                ),
                mend: "leave the family out with --without".into(),
            })?;
            all.extend(own.into_iter().zip(scales).map(|((_, term), scale)| Term {
                scale: *scale,
                prior: true,
                ..term
            }));
        }
        progress("fitting geometry and effects together");
        let model = ErrorModel {
            varying: Varying { directions: None, terms: all },
            dead_bands: by_command(machine, &facts.dead_bands),
            approaches: self.approaches.clone(),
            ..ErrorModel::default()
        };
        let (calibrated, fit) = calibrate_model(machine, recordings, &model, options, progress)?;
        let last = |by: &mut Option<RmsByModel>, rms: Option<f64>| {
            if let (Some(by), Some(rms)) = (by, rms) {
                by.r#final = rms;
            }
        };
        self.location_errors = fit.location_errors;
        let rms = calibrated.rms();
        last(&mut self.rms.m, fit.rms.m.and(rms.m));
        last(&mut self.rms.rad, fit.rms.rad.and(rms.rad));
        let mut values = calibrated.variation().coefficients.clone().into_iter();
        let effects: Vec<StoredEffect> = (named.into_iter())
            .map(|Named { mut effect, .. }| {
                effect.terms.iter_mut().zip(values.by_ref()).for_each(|(term, value)| term.value = value);
                effect
            })
            .collect();
        let with_effects = !effects.is_empty();
        let calibrated = calibrated.with_names(effects);
        Ok(if with_effects { calibrated.with_clock(facts.time) } else { calibrated })
    }
}

/// The effect without the coefficients that take no part, and with the instrument that it belongs to.
fn taking_part(named: &Named, recordings: &[Recording]) -> Named {
    let Named { mut effect, scales } = named.clone();
    let taken: Vec<bool> =
        effect.terms.iter().zip(&scales).map(|(t, s)| t.value != 0.0 && s.is_finite() && *s > 0.0).collect();
    let mut keep = taken.iter();
    effect.terms.retain(|_| *keep.next().unwrap_or(&false));
    let scales = scales.iter().zip(&taken).filter(|(_, t)| **t).map(|(s, _)| *s).collect();
    let kind = |recording: &Recording| Sensor::of(recording.header()).name();
    let first = recordings.first().map(kind);
    let alike = recordings.iter().all(|r| Some(kind(r)) == first);
    if effect.at == "measurement" && alike {
        effect.instrument = first.map(str::to_string);
    }
    Named { effect, scales }
}

/// Dead bands of the commands from those of the joints that follow one command alone.
fn by_command(machine: &Machine, by_dyad: &[f64]) -> Vec<Option<f64>> {
    let mut bands = vec![None; machine.commands().len()];
    for (j, _) in machine.joints() {
        if let Some([(c, factor)]) = machine.drive(j).map(|drive| drive.terms.as_slice())
            && *factor != 0.0
        {
            bands[*c] = Some(by_dyad[j] / factor.abs());
        }
    }
    bands
}

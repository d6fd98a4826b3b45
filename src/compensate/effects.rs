//! A calibrated machine with named effects, as a program drives it.

use std::borrow::Cow;

use super::model::{Model, at_rest, is_zero};
use crate::calibration::{CalibratedMachine, LeftOut};
use crate::chain::Chain;
use crate::feature::{Feature, Walk};
use crate::identify::by_dyad;
use crate::lie::{Pose, Twist};
use crate::motion::Tracker;
use crate::variation::{Slot, Variation};

/// Deviations that depend on position and on how it was reached.
///
/// A program has positions and their order, and neither a clock nor channels: what depends on time stands as it did at the
/// end of the recordings, what depends on speed or belongs to the instrument is left out.
pub(super) struct Effects<'a> {
    calibrated: &'a CalibratedMachine,
    variation: Variation,
    left_out: Vec<LeftOut>,
    held: Vec<LeftOut>,
    walk: Walk,
    tracker: Tracker,
    /// The pattern of directions among pieces, where there are some.
    pattern: usize,
    chain: Chain<f64>,
    /// Where the program stands; nothing at its start.
    at: Option<Vec<f64>>,
    /// Steps by one where a direction changes.
    piece: usize,
}

impl<'a> Effects<'a> {
    pub fn new(calibrated: &'a CalibratedMachine) -> Self {
        let end = calibrated.clock().map(|(_, to)| to);
        let (variation, left_out) =
            calibrated.variation_without(|effect, features| unknown_to_programs(effect, features, end));
        let gone = |effect: &str, at: &str| left_out.iter().any(|l| l.effect == effect && l.at == at);
        let mut held = Vec::new();
        calibrated.variation_without(|effect, features| {
            if features.iter().any(|f| f.needs_time()) && !gone(&effect.effect, &effect.at) {
                held.push(LeftOut {
                    effect: effect.effect.clone(),
                    at: effect.at.clone(),
                    because: format!("it is as at the end of the recordings, {:.0} s", end.unwrap_or(0.0)),
                });
            }
            None
        });
        let walk = walk(calibrated, &variation);
        let tracker = at_rest(calibrated);
        let chain = calibrated.chain();
        let pattern = 0;
        let mut model = Effects {
            calibrated,
            variation,
            left_out,
            held,
            walk,
            tracker,
            pattern,
            chain,
            at: None,
            piece: 0,
        };
        model.restart();
        model
    }

    /// The chain with these values of the features.
    fn with(&self, features: &[f64]) -> Chain<f64> {
        let machine = self.calibrated.machine();
        let parts = self.variation.direction_part(self.pattern, machine.dyads().len());
        let mut before: Vec<Twist<f64>> =
            self.calibrated.deviations().iter().zip(&parts).map(|(dh, part)| *dh + *part).collect();
        let mut behind = vec![Twist::zero(0.0); before.len()];
        let mut values = features.iter();
        for (term, coefficient) in self.variation.varying.terms.iter().zip(&self.variation.coefficients) {
            for part in &term.parts {
                let by = coefficient * values.next().copied().unwrap_or(0.0);
                match part.slot {
                    Slot::Before(j) => before[j] = before[j] + part.direction.times(by),
                    Slot::Carried(j) => behind[j] = behind[j] + part.direction.times(by),
                    Slot::Reading(_) => {}
                }
            }
        }
        let mut chain = Chain::new(machine, &before);
        for (j, error) in behind.iter().enumerate().filter(|(_, e)| e.to_array() != [0.0; 6]) {
            chain.set_carried(j, Pose::exp(*error));
        }
        chain
    }
}

/// Why an effect is not corrected; `end`: of the recordings, s.
fn unknown_to_programs(
    effect: &crate::effects::StoredEffect,
    features: &[&Feature],
    end: Option<f64>,
) -> Option<String> {
    if effect.at == "measurement" {
        return Some("it belongs to the measurement, not to the machine".into());
    }
    if features.iter().any(|f| f.needs_rates()) {
        return Some("it depends on velocity or acceleration, and a program's feeds are no clock".into());
    }
    if let Some((name, unit)) = features.iter().flat_map(|f| f.channels()).next() {
        return Some(format!("it depends on {name}[{unit}], of which a program says nothing"));
    }
    let timeless = end.is_none() && features.iter().any(|f| f.needs_time());
    timeless.then(|| "it depends on time, and the file does not say when its recordings ended".into())
}

fn walk(calibrated: &CalibratedMachine, variation: &Variation) -> Walk {
    let machine = calibrated.machine();
    let features = variation.varying.features().cloned().collect();
    let nowhere = vec![0; machine.dyads().len()];
    Walk::new(machine, features, &by_dyad(machine, &variation.dead_bands), &nowhere)
}

impl Model for Effects<'_> {
    fn advance(&mut self, commands: &[f64]) {
        if self.at.as_deref() == Some(commands) {
            return;
        }
        self.tracker.advance(commands, |_| None);
        let directions = self.tracker.directions();
        let pattern = self.variation.varying.directions.as_ref().map_or(0, |d| d.piece(&directions));
        let before = (self.pattern, self.walk.directions());
        let end = self.calibrated.clock().map(|(_, to)| to);
        let values = self.walk.step(self.calibrated.machine(), commands, end, false, |_| None);
        self.pattern = pattern;
        self.piece += usize::from(before != (pattern, self.walk.directions()));
        self.chain = self.with(&values);
        self.at = Some(commands.to_vec());
    }

    fn chain(&self) -> &Chain<f64> {
        &self.chain
    }

    fn chain_at(&self, commands: &[f64]) -> Cow<'_, Chain<f64>> {
        if self.at.as_deref().is_none_or(|at| at == commands) {
            return Cow::Borrowed(&self.chain);
        }
        Cow::Owned(self.with(&self.walk.passing(self.calibrated.machine(), commands)))
    }

    fn piece(&self) -> usize {
        self.piece
    }

    fn unseen_piece(&self) -> Option<String> {
        let directions = self.variation.varying.directions.as_ref()?;
        let seen = self.calibrated.variation().has_seen_alike(self.pattern);
        (!seen).then(|| directions.name(self.calibrated.machine(), self.pattern))
    }

    fn is_nominal(&self) -> bool {
        is_zero(self.calibrated.deviations())
            && self.variation.parts.iter().all(|part| is_zero(part))
            && self.variation.coefficients.iter().all(|c| *c == 0.0)
    }

    fn extrapolates(&self, commands: &[f64]) -> bool {
        self.calibrated.extrapolates(commands)
    }

    fn restart(&mut self) {
        self.walk = walk(self.calibrated, &self.variation);
        self.tracker = at_rest(self.calibrated);
        let still = self.tracker.directions();
        self.pattern = self.variation.varying.directions.as_ref().map_or(0, |d| d.piece(&still));
        (self.at, self.piece) = (None, 0);
    }

    fn unseen(&self) -> Option<&[Vec<Twist<f64>>]> {
        self.calibrated.unseen()
    }

    fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }

    fn held(&self) -> &[LeftOut] {
        &self.held
    }
}

//! A calibrated machine with named effects, as a program drives it.

use std::borrow::Cow;

use super::model::Model;
use super::pieces::{at_rest, is_zero};
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
#[derive(Clone)]
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
    /// Commands whose direction of travel counts.
    keyed: Vec<usize>,
}

impl<'a> Effects<'a> {
    pub fn new(calibrated: &'a CalibratedMachine) -> Self {
        let end = calibrated.clock().map(|(_, to)| to);
        let (variation, left_out) =
            calibrated.variation_without(|effect, features| unknown_to_programs(effect, features, end));
        let gone = |effect: &str, at: &str| left_out.iter().any(|l| l.effect == effect && l.at == at);
        let mut held = Vec::new();
        calibrated.variation_without(|effect, features| {
            if features.iter().any(|f| f.needs_moment()) && !gone(&effect.effect, &effect.at) {
                let when = end.map_or_else(String::new, |end| format!(", {end:.0} s"));
                held.push(LeftOut {
                    effect: effect.effect.clone(),
                    at: effect.at.clone(),
                    because: format!("it is as at the end of the recordings{when}"),
                });
            }
            None
        });
        let still = vec![0; calibrated.machine().commands().len()];
        let walk = walk(calibrated, &variation, &still);
        let tracker = at_rest(calibrated, &still);
        let keyed = keyed(calibrated, &variation);
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
            keyed,
        };
        model.restart(&still);
        model
    }

    /// The chain with these values of the features.
    fn with(&self, features: &[f64], commands: &[f64]) -> Chain<f64> {
        let machine = self.calibrated.machine();
        let parts = self.variation.direction_part(self.pattern, machine.dyads().len());
        let mut before: Vec<Twist<f64>> =
            self.calibrated.deviations().iter().zip(&parts).map(|(dh, part)| *dh + *part).collect();
        let mut behind = vec![Twist::zero(0.0); before.len()];
        if !self.variation.motions.is_empty() {
            self.variation.motions.add(machine, commands, &self.tracker.directions(), &mut before);
        }
        let mut values = features.iter();
        for (term, coefficient) in self.variation.varying.terms.iter().zip(&self.variation.coefficients) {
            for part in &term.parts {
                let by = coefficient * values.next().copied().unwrap_or(0.0);
                match part.slot {
                    Slot::Before(j) => before[j] = before[j] + part.direction.times(by),
                    Slot::After(j) => behind[j] = behind[j] + part.direction.times(by),
                    Slot::Reading => {}
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
    if effect.of_setup {
        return Some("it belongs to where the machine stood when it was measured".into());
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

fn walk(calibrated: &CalibratedMachine, variation: &Variation, first: &[i8]) -> Walk {
    let machine = calibrated.machine();
    let features = variation.varying.features().cloned().collect();
    let mut by_joint = vec![0; machine.dyads().len()];
    for (j, _) in machine.joints() {
        if let Some([(c, factor)]) = machine.drive(j).map(|drive| drive.terms.as_slice()) {
            by_joint[j] = if *factor < 0.0 { -first[*c] } else { first[*c] };
        }
    }
    Walk::new(machine, features, &by_dyad(machine, &variation.dead_bands), &by_joint)
}

/// Commands of the joints whose way counts for an effect, and those that choose the piece.
fn keyed(calibrated: &CalibratedMachine, variation: &Variation) -> Vec<usize> {
    let machine = calibrated.machine();
    let history = variation.varying.features().filter(|f| f.needs_history()).flat_map(Feature::joints);
    let commands = history.filter_map(|j| machine.drive(j)).flat_map(|d| d.terms.iter().map(|(c, _)| *c));
    let axes = variation.varying.directions.iter().flat_map(|d| d.axes().iter().copied());
    let mut all: Vec<usize> = commands.chain(axes).collect();
    all.sort_unstable();
    all.dedup();
    all
}

impl Model for Effects<'_> {
    fn advance(&mut self, commands: &[f64], ways: &[bool]) {
        if self.at.as_deref() == Some(commands) {
            return;
        }
        (0..commands.len()).filter(|c| !ways[*c]).for_each(|c| self.tracker.lose(c));
        self.tracker.advance(commands, |_| None);
        let directions = self.tracker.directions();
        let pattern = self.variation.varying.directions.as_ref().map_or(0, |d| d.piece(&directions));
        let before = (self.pattern, self.walk.directions());
        let end = self.calibrated.clock().map(|(_, to)| to);
        let values = self.walk.step(self.calibrated.machine(), commands, end, false, |_| None);
        self.pattern = pattern;
        self.piece += usize::from(before != (pattern, self.walk.directions()));
        self.chain = self.with(&values, commands);
        self.at = Some(commands.to_vec());
    }

    fn chain(&self) -> &Chain<f64> {
        &self.chain
    }

    fn chain_at(&self, commands: &[f64]) -> Cow<'_, Chain<f64>> {
        if self.at.as_deref().is_none_or(|at| at == commands) {
            return Cow::Borrowed(&self.chain);
        }
        Cow::Owned(self.with(&self.walk.passing(self.calibrated.machine(), commands), commands))
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

    fn nearest_seen(&self, commands: &[f64]) -> Vec<f64> {
        self.calibrated.nearest_seen(commands)
    }

    fn restart(&mut self, first: &[i8]) {
        self.walk = walk(self.calibrated, &self.variation, first);
        self.tracker = at_rest(self.calibrated, first);
        let still = self.tracker.directions();
        self.pattern = self.variation.varying.directions.as_ref().map_or(0, |d| d.piece(&still));
        (self.at, self.piece) = (None, 0);
    }

    fn ahead(&self) -> Box<dyn Model + '_> {
        Box::new(self.clone())
    }

    fn keyed(&self) -> &[usize] {
        &self.keyed
    }

    fn directions(&self) -> Vec<i8> {
        self.tracker.directions()
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

//! What an effect takes away together with what nobody knows of it: how it was before anybody looked, and its shape.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::beside::Beside;
use super::discrepancy;
use super::equations::Equations;
use super::evidence::log_mean_exp;
use super::past::Past;
use super::policy::Rule;
use super::score::Field;
use super::search::{LARGE, MANY, Search};
use super::terms::{Hypothesis, ModelTerm};
use crate::effects::Candidate;
use crate::feature::Feature;

/// Effects with a memory are looked at with what they were before down to this part of the best one's weight, and so many of them.
const DISTANT: f64 = 0.15;
const REMEMBERED: usize = 12;
/// A name that needs another shape than its own is credited with so much less of what that takes away: another one may not need it.
const FOREIGN: f64 = 0.01;

/// Evidence that a shape of its own may lend a hypothesis, as part of the energy that it takes away.
const OWN: f64 = 0.25;

/// An effect together with what nobody knows of how it was before.
pub(super) struct WithState {
    /// Logarithm of the evidence that this adds.
    pub evidence: f64,
    /// Half the misfit energy that both take away.
    pub reach: f64,
}

impl Search<'_> {
    /// Brings up effects with a memory that take away much with what nobody knows of how they were before: as far as their evidence with
    /// it, at their best point so far.
    pub fn bring_up(&self, hypotheses: &mut Vec<Hypothesis>, field: &Field) {
        let Some(best) = hypotheses.first().map(|best| (best.weight, best.score.gain / self.overdispersion))
        else {
            return;
        };
        if !self.in_motion || best.1 < LARGE || self.rows.whitener.count() < MANY {
            return;
        }
        let remembers =
            |r: &Hypothesis| self.candidates[r.candidate].features.iter().any(Feature::needs_history);
        let mut ranks: Vec<f64> = hypotheses.iter().map(|r| r.weight).collect();
        let worthy = hypotheses.iter().take_while(|r| r.weight > DISTANT * best.0).count();
        let chosen: Vec<usize> =
            (0..worthy).filter(|i| remembers(&hypotheses[*i])).take(REMEMBERED).collect();
        let with_initial =
            |i: &usize| self.with_initial(&self.candidates[hypotheses[*i].candidate], &hypotheses[*i], field);
        let more: Vec<Option<WithState>> = chosen.par_iter().map(with_initial).collect();
        for (i, more) in chosen.into_iter().zip(more) {
            let Some(more) = more else { continue };
            ranks[i] = hypotheses[i].weight + more.evidence.max(0.0);
            hypotheses[i].reach = more.reach;
        }
        let mut order: Vec<usize> = (0..hypotheses.len()).collect();
        order.sort_by(|a, b| ranks[*b].total_cmp(&ranks[*a]));
        if order.is_sorted() || !Rule::Remembers.decides() {
            return;
        }
        *hypotheses = order.into_iter().map(|i| hypotheses[i].clone()).collect();
    }

    /// What a hypothesis, taken for this candidate, says together with what it was before; `None` where it has no memory, or all of that is known.
    pub fn with_initial(
        &self,
        candidate: &Candidate,
        hypothesis: &Hypothesis,
        field: &Field,
    ) -> Option<WithState> {
        if !self.in_motion {
            return None;
        }
        let parameters = &hypothesis.score.parameters;
        let white = self.rows.of(candidate, parameters)?;
        let effect = self.enter_as(candidate, hypothesis, &white, (&field.marginal, &field.left))?;
        let both = self.with_unknown(candidate, &effect, &white, field, false).seen(1);
        if both.count() == 0 {
            return None;
        }
        let worth = both.worth(self.overdispersion);
        let score = self.rows.score_by(candidate, parameters, &both.others().last(), self.overdispersion);
        Some(WithState {
            evidence: worth + score.at_best - hypothesis.score.at_best,
            reach: score.gain + (worth * self.overdispersion).max(0.0),
        })
    }

    /// Columns of what an effect was before anybody looked, of its shape where that is asked for, and its own, beside a field.
    fn with_unknown(
        &self,
        candidate: &Candidate,
        effect: &ModelTerm,
        white: &DMatrix<f64>,
        field: &Field,
        with_shape: bool,
    ) -> Beside {
        let (rows, marginal, left) = (self.rows, &field.marginal, &field.left);
        let answers = discrepancy::answers(rows, candidate, effect);
        if let Some((past, features)) = Past::of(rows, candidate, effect, field).filter(|_| self.in_motion) {
            // Features of one history have its columns each.
            let size = discrepancy::amplitude(effect);
            let scales = [size * (features as f64).sqrt(), discrepancy::PART * size];
            let initial = discrepancy::own_initial_conditions(rows, candidate, effect, answers.clone()).white;
            if !with_shape {
                return Beside::with_past(rows, (&past, &scales[..1]), &[&initial, white], marginal, left);
            }
            let shape = discrepancy::shape(rows, candidate, effect, answers, false).white;
            return Beside::with_past(rows, (&past, &scales), &[&initial, &shape, white], marginal, left);
        }
        let initial = match self.in_motion {
            true => discrepancy::initial_conditions(rows, candidate, effect, answers.clone()).white,
            false => DMatrix::zeros(white.nrows(), 0),
        };
        if !with_shape {
            return Beside::new(&[&initial, white], marginal, left);
        }
        let shape = discrepancy::shape(rows, candidate, effect, answers, true).white;
        Beside::new(&[&initial, &shape, white], marginal, left)
    }

    /// The weight of a hypothesis of which as likely as not the shape departs from the family's, (66).
    pub fn with_discrepancy(&self, hypothesis: &Hypothesis, field: &Field) -> f64 {
        self.with_shape(hypothesis, field)
            .map_or(hypothesis.weight, |weight| log_mean_exp(&[hypothesis.weight, weight]))
    }

    /// The same where it does depart; `None` where a feature is not there.
    fn with_shape(&self, hypothesis: &Hypothesis, field: &Field) -> Option<f64> {
        let candidate = &self.candidates[hypothesis.candidate];
        let parameters = &hypothesis.score.parameters;
        let white = self.rows.of(candidate, parameters)?;
        let effect = self.enter_directed(hypothesis, &white, (&field.marginal, &field.left))?;
        let all = self.with_unknown(candidate, &effect, &white, field, true).seen(2);
        let with_initial = all.others();
        let grown = |own: &Equations| {
            let score = self.rows.score_by(candidate, parameters, own, self.overdispersion);
            score.at_best - hypothesis.score.at_best
        };
        let (by_initial, by_discrepancy) =
            (grown(&with_initial.last()), grown(&with_initial.others().last()));
        let initial = hypothesis.weight + all.worth(self.overdispersion);
        let discrepancy = (1.0 - FOREIGN) * with_initial.worth(self.overdispersion);
        // What owes more to a shape of its own than right names do owes it to something else.
        Some((initial + discrepancy + by_discrepancy).min(match Rule::OwnShapeIsLimited.decides() {
            true => initial + by_initial + OWN * hypothesis.reach / self.overdispersion,
            false => f64::INFINITY,
        }))
    }
}

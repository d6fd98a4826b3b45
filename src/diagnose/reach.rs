//! What an effect takes away together with what nobody knows of it: how it was before anybody looked, and its shape.

use super::evidence::log_mean_exp;
use super::score::Field;
use super::search::{LARGE, MANY, Rival, Search};
use super::shape;
use crate::effects::Candidate;
use crate::feature::Feature;

/// Effects with a memory are looked at with what they were before down to this part of the best one's weight, and so many of them.
const DISTANT: f64 = 0.15;
const REMEMBERED: usize = 12;
/// A name that needs another shape than its own is credited with so much less of what that takes away: another one may not need it.
const FOREIGN: f64 = 0.01;

/// Evidence that a shape of its own may lend a rival, as part of the energy that it takes away.
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
    pub fn bring_up(&self, rivals: &mut Vec<Rival>, field: &Field) {
        let Some(best) = rivals.first().map(|best| (best.weight, best.score.gain / self.heat)) else {
            return;
        };
        if !self.in_motion || best.1 < LARGE || self.rows.whitener.count() < MANY {
            return;
        }
        let remembers = |r: &Rival| self.candidates[r.candidate].features.iter().any(Feature::needs_history);
        let mut ranks: Vec<f64> = rivals.iter().map(|r| r.weight).collect();
        let worthy = rivals.iter().take_while(|r| r.weight > DISTANT * best.0).count();
        let chosen: Vec<usize> = (0..worthy).filter(|i| remembers(&rivals[*i])).take(REMEMBERED).collect();
        for i in chosen {
            let rival = &mut rivals[i];
            let Some(more) = self.with_state(&self.candidates[rival.candidate], rival, field) else {
                continue;
            };
            ranks[i] = rival.weight + more.evidence.max(0.0);
            rival.reach = more.reach;
        }
        let mut order: Vec<usize> = (0..rivals.len()).collect();
        order.sort_by(|a, b| ranks[*b].total_cmp(&ranks[*a]));
        *rivals = order.into_iter().map(|i| rivals[i].clone()).collect();
    }

    /// What a rival, taken for this candidate, says together with what it was before; `None` where it has no memory, or all of that is known.
    pub fn with_state(&self, candidate: &Candidate, rival: &Rival, field: &Field) -> Option<WithState> {
        let effect = self.enter_as(candidate, rival, &field.space).filter(|_| self.in_motion)?;
        let answers = shape::answers(self.rows, candidate, &effect);
        let state = shape::states(self.rows, candidate, &effect, answers).white;
        if state.ncols() == 0 {
            return None;
        }
        let beside = self.rows.field(field.space.with(&state));
        let score = self.rows.score_at(candidate, &rival.score.parameters, &beside, self.heat)?;
        let worth = field.space.worth(&state, &field.left, self.heat);
        Some(WithState {
            evidence: worth + score.at_best - rival.score.at_best,
            reach: score.gain + (worth * self.heat).max(0.0),
        })
    }

    /// The weight of a rival of which as likely as not the shape departs from the family's, (66).
    pub fn with_shape(&self, rival: &Rival, field: &Field) -> f64 {
        let Some(effect) = self.enter(rival, &field.space) else { return rival.weight };
        let with_state = self.rows.field(field.space.with(&effect.state));
        let shaped = self.rows.field(with_state.space.with(&effect.shape));
        let candidate = &self.candidates[rival.candidate];
        let grown = |field: &Field| {
            let score = self.rows.score_at(candidate, &rival.score.parameters, field, self.heat)?;
            Some(score.at_best - rival.score.at_best)
        };
        let (Some(by_state), Some(by_shape)) = (grown(&with_state), grown(&shaped)) else {
            return rival.weight;
        };
        let state = rival.weight + field.space.worth(&effect.state, &field.left, self.heat);
        let shape = (1.0 - FOREIGN) * with_state.space.worth(&effect.shape, &with_state.left, self.heat);
        // What owes more to a shape of its own than right names do owes it to something else.
        let weight = (state + shape + by_shape).min(state + by_state + OWN * rival.reach / self.heat);
        log_mean_exp(&[rival.weight, weight])
    }
}

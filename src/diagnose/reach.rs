//! What an effect takes away together with what nobody knows of it: how it was before anybody looked, and its shape.

use super::evidence::log_mean_exp;
use super::score::Field;
use super::search::{LARGE, MANY, Rival, Search};
use crate::feature::Feature;

/// Effects with a memory are looked at with what they were before down to this part of the best one's weight, and so many of them.
const DISTANT: f64 = 0.15;
const REMEMBERED: usize = 12;
/// A name that needs another shape than its own is credited with so much less of what that takes away: another one may not need it.
const FOREIGN: f64 = 0.01;

/// Evidence that a shape of its own may lend a rival, as part of the energy that it takes away.
const OWN: f64 = 0.25;

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
            let state = self.enter_bare(rival, &field.space).map(|effect| self.state_of(&effect));
            let Some(state) = state.filter(|state| state.ncols() > 0) else { continue };
            let beside = self.rows.field(field.space.with(&state));
            let candidate = &self.candidates[rival.candidate];
            let Some(score) = self.rows.score_at(candidate, &rival.score.parameters, &beside, self.heat)
            else {
                continue;
            };
            let worth = field.space.worth(&state, &field.left, self.heat);
            ranks[i] = rival.weight + (worth + score.at_best - rival.score.at_best).max(0.0);
            rival.reach = score.gain + (worth * self.heat).max(0.0);
        }
        let mut order: Vec<usize> = (0..rivals.len()).collect();
        order.sort_by(|a, b| ranks[*b].total_cmp(&ranks[*a]));
        *rivals = order.into_iter().map(|i| rivals[i].clone()).collect();
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

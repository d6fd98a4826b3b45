//! Another way to the same recordings: without the effect that came first, `docs/diagnosis-method.md` (79).

use std::sync::Mutex;

use super::search::{ENTER, Search};
use super::terms::ModelTerm;

/// Logarithm of what is expected of a candidate that has to stand aside.
const ASIDE: f64 = -1e9;

impl Search<'_> {
    /// These effects, or others that say more without the largest of them.
    ///
    /// What comes first takes the most by itself, and may do so because two others are there: weight on a tilted axis is nearly an eccentric
    /// encoder there and a wobble of the next axis. Swaps one by one do not find the two. It shows where shapes take up more than the least
    /// of the names.
    pub fn or_without_the_first(&self, in_model: Vec<ModelTerm>) -> Vec<ModelTerm> {
        let largest = in_model.iter().max_by(|a, b| a.score.gain.total_cmp(&b.score.gain));
        let least = in_model.iter().map(|effect| effect.score.gain).fold(f64::INFINITY, f64::min);
        let Some(largest) = largest.filter(|_| self.in_motion && (2..self.most()).contains(&in_model.len()))
        else {
            return in_model;
        };
        if self.shares(&in_model).discrepancies < 2.0 * least {
            return in_model;
        }
        let is_aside = |candidate: usize| self.is_form(candidate, largest.candidate);
        let prior = |(candidate, prior): (usize, &f64)| if is_aside(candidate) { ASIDE } else { *prior };
        let search = Search {
            base: self.base.clone(),
            priors: self.priors.iter().enumerate().map(prior).collect(),
            commonness: self.commonness.clone(),
            known: Mutex::default(),
            grounds: Mutex::default(),
            ..*self
        };
        let mut others = search.run(&[], |_| true);
        if others.len() > in_model.len() || !self.says_more(&others, &in_model) {
            return in_model;
        }
        // What stood aside may take its place again, as any hypothesis may; nobody competes twice.
        for effect in others.iter_mut().filter(|effect| !effect.near.contains(&largest.candidate)) {
            effect.near.push(largest.candidate);
        }
        others
    }

    /// Whether these effects say more than others, with the freedom of their shapes and without it.
    pub fn says_more(&self, these: &[ModelTerm], than: &[ModelTerm]) -> bool {
        self.worth(these) > self.worth(than) + ENTER
            && self.worth_plainly(these) > self.worth_plainly(than) + ENTER
    }

    /// Logarithm of the evidence of all effects in the model together, their shapes the families'.
    fn worth_plainly(&self, in_model: &[ModelTerm]) -> f64 {
        self.worth(&in_model.iter().map(ModelTerm::without_discrepancy).collect::<Vec<_>>())
    }
}

//! Which effects together explain the recordings best: forward, backward, swaps, each against all candidates.

use std::collections::HashSet;
use std::sync::Arc;

use super::folds;
use super::marginal::Marginal;
use super::policy::Rule;
use super::search::{ENTER, MANY, Search};
use super::shares::Shares;
use super::terms::{Hypothesis, ModelTerm, all_but};

/// So many candidates that came next to an effect are compared with it again and again.
pub(super) const NEAR: usize = 40;
/// So many times every effect is held against all that may stand in its place.
pub(super) const PASSES: usize = 2;
/// An effect that takes away less than this part of the structure that is left is a poor name for it.
const WORTH: f64 = 0.2;
/// The same among settled positions, where many joints give way a little each.
const WORTH_SETTLED: f64 = 0.08;
/// An effect that was taken for the shape of another is at least this part of it; it is looked for where shapes are this part of all.
const HIDDEN: f64 = 0.8;
const ODD: f64 = 0.12;

impl Search<'_> {
    /// Forward with full comparison, and after each step every effect against all others in its place.
    ///
    /// A step counts only if its evidence stands out from the structure that it leaves, and if it takes away more than the shape of
    /// what was found before may be off by.
    ///
    /// `from`: what had been found under another noise. `holds`: whether the noise is still what it is searched with; where nothing had been
    /// found and the first effect changes it, everything else is left to the search with the noise that is left. Among settled positions noise
    /// is what is left, and less of it with every effect: there all are judged by the same.
    pub fn run(&self, from: &[ModelTerm], holds: impl Fn(&[ModelTerm]) -> bool) -> Vec<ModelTerm> {
        let mut in_model: Vec<ModelTerm> = Vec::new();
        for effect in from {
            let marginal = self.beside(&in_model, None);
            let (rows, candidate) = (self.rows, &self.candidates[effect.candidate]);
            let Some(score) = rows.score_at(
                candidate,
                &effect.score.parameters,
                &rows.field(marginal.clone()),
                self.overdispersion,
            ) else {
                continue;
            };
            let hypothesis = Hypothesis::new(effect.candidate, score.evidence, score);
            in_model.extend(self.enter(&hypothesis, &marginal).map(|again| again.instead_of(effect)));
        }
        self.swap(&mut in_model);
        let mut tried: HashSet<Vec<usize>> = HashSet::new();
        let (mut sound, mut harmful) = (in_model.clone(), 0);
        while in_model.len() < self.most() {
            // Swaps may throw out what the next step takes in again.
            if !tried.insert(in_model.iter().map(|effect| effect.candidate).collect()) {
                break;
            }
            (self.progress)(&format!("looking for effect {} of {} at most", in_model.len() + 1, self.most()));
            let Some(entered) = self.next(&in_model) else { break };
            in_model.push(entered);
            if self.in_motion && from.is_empty() && in_model.len() == 1 && !holds(&in_model) {
                return in_model;
            }
            if in_model.len() > 1 {
                self.swap(&mut in_model);
            }
            // A name that makes stretches worse that were left out is a patch, unless the next one mends it.
            let is_patched = self.rows.whitener.count() > MANY
                && folds::is_patched(self, &in_model)
                && Rule::NoneDoesHarm.decides();
            harmful = if is_patched { harmful + 1 } else { 0 };
            match harmful {
                0 => sound.clone_from(&in_model),
                1 => {}
                _ => break,
            }
        }
        self.swap(&mut sound);
        sound
    }

    /// The effect to be taken in next: what stands out beside those found, else what was taken for their shape.
    fn next(&self, in_model: &[ModelTerm]) -> Option<ModelTerm> {
        let shares = self.shares(in_model);
        if shares.is_discrepant(in_model.len()) && Rule::ShapesFirst.decides() {
            return self.hidden(in_model, &self.hypotheses(in_model), &shares);
        }
        self.beyond(in_model).or_else(|| {
            let is_odd = shares.discrepancies > ODD * shares.total() && Rule::ShapesLast.decides();
            let ground = || Arc::new(self.beside_names(in_model));
            is_odd.then(|| self.hidden(in_model, &self.compare(ground(), None), &shares)).flatten()
        })
    }

    /// The effect that stands out beside those found and their shapes.
    fn beyond(&self, in_model: &[ModelTerm]) -> Option<ModelTerm> {
        let (hypotheses, marginal) = (self.hypotheses(in_model), self.ground(in_model, None));
        let before = self.leftover(&marginal);
        let best = self.best(&hypotheses, in_model)?;
        let least = if self.in_motion { WORTH } else { WORTH_SETTLED } * before.energy;
        let is_shape =
            best.score.gain < self.discrepancy_error(best, in_model) && Rule::LessThanShapes.decides();
        if is_shape || 2.0 * best.score.gain < least && Rule::TakesLittle.decides() {
            return None;
        }
        self.entered(best, &hypotheses, &marginal)
    }

    /// The effect that takes most of what was taken for the shape of those found; `hypotheses`: beside their names alone.
    fn hidden(
        &self,
        in_model: &[ModelTerm],
        hypotheses: &[Hypothesis],
        shares: &Shares,
    ) -> Option<ModelTerm> {
        let marginal = Arc::new(self.beside_names(in_model));
        let best = self.best(hypotheses, in_model)?;
        let is_most = 2.0 * best.score.gain >= HIDDEN * shares.discrepancies || !Rule::MostOfShapes.decides();
        let is_own =
            best.score.gain < self.discrepancy_error(best, in_model) || self.is_of_course(best, in_model);
        let entered = (is_most && !is_own).then(|| self.entered(best, hypotheses, &marginal)).flatten();
        entered.map(|effect| ModelTerm { hidden: true, ..effect })
    }

    /// The best hypothesis that is neither chance nor what was found already.
    fn best<'r>(&self, hypotheses: &'r [Hypothesis], in_model: &[ModelTerm]) -> Option<&'r Hypothesis> {
        let mut worthy = hypotheses.iter().take_while(|r| r.weight > ENTER);
        worthy.find(|r| !self.repeats(r, in_model))
    }

    /// A hypothesis taken in, if its evidence stands out from the structure that it leaves.
    fn entered(
        &self,
        best: &Hypothesis,
        hypotheses: &[Hypothesis],
        marginal: &Arc<Marginal>,
    ) -> Option<ModelTerm> {
        let near = hypotheses.iter().take(NEAR).map(|r| r.candidate).collect();
        let entered = ModelTerm { near, ..self.settle(best, marginal)? };
        let left =
            self.leftover(&marginal.with(&entered.columns).with(&entered.initial).with(&entered.discrepancy));
        (best.weight >= ENTER * (left.overdispersion / self.overdispersion).max(1.0)).then_some(entered)
    }

    /// Every effect gives its place to a better one, beside the others; one that is no longer needed goes.
    ///
    /// Among the others an effect has a shape of its own, in its place it has not: so exchanges may come back to where they were. Of sets
    /// that do not stand, the one stays that foretells best what was left out, (68); of settled positions, whose noise is only known by
    /// what is left, the last one.
    fn swap(&self, in_model: &mut Vec<ModelTerm>) {
        let mut before = Vec::new();
        for _ in 0..PASSES {
            before.push(in_model.clone());
            if !self.exchange(in_model) {
                return;
            }
        }
        let of = |set: &[ModelTerm]| -> Vec<usize> { set.iter().map(|effect| effect.candidate).collect() };
        let stands = before.last().is_some_and(|last| of(last) == of(in_model));
        if stands || !self.in_motion {
            return;
        }
        // Where one went, no set of before will do.
        let count = in_model.len();
        for set in before.into_iter().filter(|set| set.len() == count) {
            if folds::foretell_better(self, &set, in_model) {
                *in_model = set;
            }
        }
    }

    /// Every effect gives its place once, if there is a better one; whether one did.
    fn exchange(&self, in_model: &mut Vec<ModelTerm>) -> bool {
        let mut changed = false;
        let mut i = 0;
        while i < in_model.len() {
            let hypotheses = self.rivals_of(in_model, i);
            let Some(best) = self.best(&hypotheses, &all_but(in_model, Some(i))) else {
                in_model.remove(i);
                changed = true;
                continue;
            };
            // What it was worth when it was taken in counts no longer: the others have changed.
            let ground = self.ground(in_model, Some(i));
            let own = &in_model[i];
            let candidate = &self.candidates[own.candidate];
            let field = self.rows.field(ground.clone());
            let now = self.rows.score_at(candidate, &own.score.parameters, &field, self.overdispersion);
            let now = now.filter(|now| best.candidate == own.candidate && best.score.gain <= now.gain + 0.5);
            changed |= now.is_none();
            let hypothesis = now.map(|score| Hypothesis::new(own.candidate, best.weight, score));
            if let Some(entered) = self.settle(hypothesis.as_ref().unwrap_or(best), &ground) {
                in_model[i] = entered.instead_of(&in_model[i]);
            }
            i += 1;
        }
        changed
    }

    /// Every effect that is no longer the likeliest in its place gives it to the one that is, none goes; whether one did.
    pub fn likeliest(&self, in_model: &mut [ModelTerm]) -> bool {
        let mut changed = false;
        for i in 0..in_model.len() {
            let hypotheses = self.rivals_of(in_model, i);
            let best = self.best(&hypotheses, &all_but(in_model, Some(i)));
            let Some(best) = best.filter(|best| best.candidate != in_model[i].candidate) else { continue };
            if let Some(entered) = self.settle(best, &self.ground(in_model, Some(i))) {
                in_model[i] = entered.instead_of(&in_model[i]);
                changed = true;
            }
        }
        changed
    }
}

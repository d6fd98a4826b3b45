//! Several names in the place of a curve: what bends along a whole turn may be a line and the waves of an encoder,
//! `docs/diagnosis-method.md` (75).

use std::sync::Arc;

use super::discrepancy;
use super::folds;
use super::policy::Rule;
use super::search::{ENTER, Search};
use super::steps::NEAR;
use super::terms::{Hypothesis, ModelTerm, all_but};
use crate::effects::Candidate;

impl Search<'_> {
    /// Effects with every curve along the travel of a joint resolved into other names at that joint, where these say more than it.
    ///
    /// Names come one by one, and no two of them need say as much as a curve of eight orders: only together do they.
    pub fn unfolded(&self, in_model: Vec<ModelTerm>) -> Vec<ModelTerm> {
        let is_curve = |effect: &ModelTerm| {
            let candidate = &self.candidates[effect.candidate];
            discrepancy::is_curve(candidate) && effect.score.coefficients >= discrepancy::BENDS
        };
        let mut in_model = in_model;
        let mut i = 0;
        while i < in_model.len() {
            match is_curve(&in_model[i]).then(|| self.resolved(&in_model, i)).flatten() {
                Some(names) => in_model = names,
                None => i += 1,
            }
        }
        in_model
    }

    /// Effects with others in the place of curve `i`; `None` where they say no more.
    fn resolved(&self, in_model: &[ModelTerm], i: usize) -> Option<Vec<ModelTerm>> {
        let curve = &in_model[i];
        let others = all_but(in_model, Some(i));
        let alone = self.beside_names(&others);
        let own = self.candidates[curve.candidate].place;
        let is_simple =
            |c: &usize| self.candidates[*c].place == own && is_line_or_order(&self.candidates[*c]);
        let among: Vec<usize> = (0..self.candidates.len()).filter(is_simple).collect();
        let field = self.rows.field(alone);
        let candidate = &self.candidates[curve.candidate];
        let score = self.rows.score_at(candidate, &curve.score.parameters, &field, self.overdispersion)?;
        let most = score.evidence + self.priors[curve.candidate];
        let (mut names, mut sum): (Vec<ModelTerm>, f64) = (Vec::new(), 0.0);
        while others.len() + names.len() < self.most() {
            let marginal = Arc::new(self.beside_names(&[others.as_slice(), &names].concat()));
            let hypotheses = self.compare(marginal.clone(), Some(&among));
            let Some(next) = hypotheses.iter().find(|r| r.weight > ENTER && !self.repeats(r, &names)) else {
                break;
            };
            let near = hypotheses.iter().take(NEAR).map(|r| r.candidate).collect();
            // What a shape of its own would lend it is what the next name takes.
            let weight = next.score.evidence + self.priors[next.candidate];
            let Some(entered) = self.enter(next, &marginal) else { break };
            names.push(ModelTerm { near, ..entered });
            sum += weight;
            let resolved = [others.as_slice(), &names].concat();
            let is_useful = || folds::useful(self, &resolved, folds::least(self)).len() == resolved.len();
            // Beside the shapes of the others each has to stand out by itself.
            let stands_out = |i: usize| {
                let own = |r: &Hypothesis| r.candidate == resolved[i].candidate && r.weight > ENTER;
                self.rivals_of(&resolved, i).iter().any(own)
            };
            if sum > most + ENTER
                && folds::foretell_better(self, &resolved, in_model)
                && is_useful()
                && (0..resolved.len()).all(stands_out)
                && Rule::Unfolds.decides()
            {
                return Some(resolved);
            }
        }
        None
    }
}

/// Whether it is a straight line along the travel of one joint, or a wave of so many a turn.
fn is_line_or_order(candidate: &Candidate) -> bool {
    let is_wave = candidate.features.iter().all(|f| f.wave().is_some());
    discrepancy::is_of_position(candidate)
        && !discrepancy::is_curve(candidate)
        && candidate.parameters.iter().all(|p| p.whole)
        && (is_wave || candidate.coefficients.len() == 1)
}

//! Every candidate beside what has been taken in, the likeliest first.

use std::sync::{Arc, PoisonError};

use rayon::prelude::*;

use super::marginal::Marginal;
use super::policy::Rule;
use super::refine::refine;
use super::search::{LARGE, MANY, Search, VISIBLE};
use super::terms::{Hypothesis, Mark, ModelTerm};

/// Candidates with this part of the best one's weight come into question, and at most so many.
const CLOSE: f64 = 0.6;
const REFINED: usize = 8;
/// Where effects show their shape, hypotheses with this part of the best one's energy are looked at, so many.
const SIMILAR: f64 = 0.8;
const DISCREPANT: usize = 8;
/// What comes within this part of the best one's energy is a matter of shape, and a rare name gives way to a common one.
const UNKNOWN_DISCREPANCY: f64 = 0.002;

impl Search<'_> {
    /// Evidence of every candidate beside the effects in the model, better first.
    pub fn hypotheses(&self, in_model: &[ModelTerm]) -> Arc<Vec<Hypothesis>> {
        self.known_or(in_model, None, None)
    }

    /// Evidence of those that might take the place of effect `i`, beside all others.
    pub fn rivals_of(&self, in_model: &[ModelTerm], i: usize) -> Arc<Vec<Hypothesis>> {
        self.known_or(in_model, Some(i), Some(&in_model[i].near))
    }

    fn known_or(
        &self,
        in_model: &[ModelTerm],
        but: Option<usize>,
        among: Option<&[usize]>,
    ) -> Arc<Vec<Hypothesis>> {
        let others = in_model.iter().enumerate().filter(|(i, _)| Some(*i) != but);
        let mut marks: Vec<Mark> = others.map(|(_, effect)| effect.mark()).collect();
        marks.sort();
        let (of, hidden) = (but.map(|i| in_model[i].candidate), but.is_some_and(|i| in_model[i].hidden));
        let key = |of: Option<usize>| (of, marks.clone(), hidden);
        // Never held while other work is done: a thread may take another's up meanwhile.
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let before = {
            let known = known();
            known.get(&key(None)).or_else(|| known.get(&key(of))).cloned()
        };
        before.unwrap_or_else(|| {
            let hypotheses = Arc::new(self.compare(self.ground(in_model, but), among));
            known().insert(key(among.and(of)), hypotheses.clone());
            hypotheses
        })
    }

    pub(super) fn compare(&self, marginal: Arc<Marginal>, among: Option<&[usize]>) -> Vec<Hypothesis> {
        let field = self.rows.field(marginal);
        let (rows, priors, candidates, overdispersion) =
            (self.rows, &self.priors, self.candidates, self.overdispersion);
        let all: Vec<usize> = among.map_or_else(|| (0..candidates.len()).collect(), <[usize]>::to_vec);
        let mut hypotheses: Vec<Hypothesis> = (all.into_par_iter())
            .filter_map(|i| {
                let score = rows.screen(i, &candidates[i], &field, overdispersion)?;
                if !score.is_small(&candidates[i]) {
                    return None;
                }
                Some(Hypothesis::new(i, score.evidence + priors[i], score))
            })
            .collect();
        let better_first = |a: &Hypothesis, b: &Hypothesis| b.weight.total_cmp(&a.weight);
        hypotheses.sort_by(better_first);
        self.bring_up(&mut hypotheses, &field);
        // Between the points of its grid a candidate may be much better: those that come into question are refined.
        let near = hypotheses.iter().map(|r| r.weight).fold(0.0, f64::max) * CLOSE;
        let is_close = |r: &Hypothesis| r.weight > 0.0 && (r.weight >= near || r.reach > r.score.gain);
        let close = hypotheses.iter().take_while(|r| is_close(r)).count().min(REFINED);
        let refined: Vec<Hypothesis> = hypotheses[..close]
            .par_iter()
            .map(|r| refine(rows, &candidates[r.candidate], r, &field, overdispersion))
            .collect();
        hypotheses.splice(..close, refined);
        hypotheses[..close].sort_by(better_first);
        // No play is quite a step: what explains nearly as much may do so better once its shape may depart a little from the family's.
        let most = hypotheses[..close].iter().map(|r| r.reach / overdispersion).fold(0.0, f64::max);
        if most > LARGE && rows.whitener.count() > MANY && Rule::MayDepart.decides() {
            let alike: Vec<usize> = (0..close)
                .filter(|i| hypotheses[*i].reach / overdispersion > SIMILAR * most)
                .take(DISCREPANT)
                .collect();
            let weights: Vec<f64> =
                alike.par_iter().map(|i| self.with_discrepancy(&hypotheses[*i], &field)).collect();
            alike.iter().zip(weights).for_each(|(i, weight)| hypotheses[*i].weight = weight);
            let slack =
                (UNKNOWN_DISCREPANCY * most).min(VISIBLE * rows.whitener.count() as f64 / overdispersion);
            if Rule::RareGivesWay.decides() {
                let rare = |hypothesis: &Hypothesis| slack * self.commonness[hypothesis.candidate];
                hypotheses[..close].iter_mut().for_each(|hypothesis| hypothesis.weight += rare(hypothesis));
            }
            hypotheses.sort_by(better_first);
        }
        self.likeliest_name_first(&mut hypotheses);
        hypotheses
    }

    /// A name is as likely as all its forms at its place together: the best form of the likeliest one comes first.
    fn likeliest_name_first(&self, hypotheses: &mut [Hypothesis]) {
        let Some(most) = hypotheses.first().map(|best| best.weight) else { return };
        let mut names: Vec<(usize, f64)> = Vec::new();
        for (i, r) in hypotheses.iter().enumerate() {
            let weight = (r.weight - most).exp();
            match names.iter_mut().find(|(first, _)| self.is_form(hypotheses[*first].candidate, r.candidate))
            {
                Some((_, sum)) => *sum += weight,
                // One that is less than a thousandth as likely does not become the likeliest by its forms.
                None if weight > 1e-3 => names.push((i, weight)),
                None => {}
            }
        }
        // The earlier of two that are as likely.
        let likeliest = names.into_iter().rev().max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((i, _)) = likeliest.filter(|(i, _)| *i > 0 && Rule::FormsTogether.decides()) {
            hypotheses[..=i].rotate_right(1);
        }
    }
}

//! Wider names that add nothing to what has another name: a positioning error that is a straight line is a scale error,
//! `docs/diagnosis-method.md` (78).

use super::policy::Rule;
use super::search::Search;
use super::terms::{Hypothesis, ModelTerm};
use crate::effects::Candidate;

/// A name says no more than less does where it takes away no more than this part of half its energy beyond it, and this by chance.
const MORE: f64 = 0.004;
const CHANCE: f64 = 4.0;
/// Another name is at hand that is no rarer than this, as a logarithm.
const RARER: f64 = 3.0;

/// Whether effect `i` is no more than what its name says more than, and no other name for that is at hand: straight lines are no
/// positioning errors, even where nobody has told of scales.
pub(super) fn says_no_more(search: &Search, in_model: &[ModelTerm], i: usize) -> bool {
    let effect = &in_model[i];
    let candidate = &search.candidates[effect.candidate];
    if candidate.more_than.is_empty() {
        return false;
    }
    let field = search.rows.field(search.ground(in_model, Some(i)).with(&effect.initial));
    let gain = |candidate: &Candidate, parameters: &[f64]| {
        let score = search.rows.score_at(candidate, parameters, &field, search.overdispersion);
        score.map_or(0.0, |score| score.gain)
    };
    let own = gain(candidate, &effect.score.parameters);
    let enough = own - MORE * own - CHANCE * search.overdispersion;
    let is_empty =
        |candidate: &Candidate, at: &[f64]| candidate.more_than.iter().any(|less| gain(less, at) >= enough);
    let hypotheses = search.rivals_of(in_model, i);
    let weight = hypotheses.iter().find(|r| r.candidate == effect.candidate).map_or(0.0, |r| r.weight);
    // As much as it takes away less, and no rarer otherwise.
    let is_name = |hypothesis: &Hypothesis| {
        let other = &search.candidates[hypothesis.candidate];
        let takes = gain(other, &hypothesis.score.parameters);
        // Of a form of it, what it is told as is a name too.
        (other.told_as != candidate.told_as
            || other.effect != candidate.effect && other.effect == other.told_as)
            && other.place == candidate.place
            && takes >= enough
            && hypothesis.weight + (own - takes) / search.overdispersion + RARER > weight
            && !is_empty(other, &hypothesis.score.parameters)
    };
    is_empty(candidate, &effect.score.parameters)
        && !hypotheses.iter().any(is_name)
        && Rule::SaysNoMore.decides()
}

//! What a cause that cannot be one does as well, `docs/diagnosis-method.md` (70).

use nalgebra::DMatrix;

use super::equations::{Score, best, judge, lengths};
use super::search::Search;
use super::terms::{Hypothesis, ModelTerm};
use crate::effects::{Candidate, Place};
use crate::machine::Machine;

/// An effect with as many numbers, where it was found, and a meaningless cause.
#[derive(Clone)]
pub(super) struct Placebo {
    /// What drives it, as part of a sentence.
    pub cause: String,
    /// What it takes away as part of what the effect does.
    pub share: f64,
    /// By how much its evidence is above the effect's, a logarithm.
    pub ahead: f64,
    /// Its columns, m and rad.
    pub raw: DMatrix<f64>,
}

/// Weights are taken from poses that are so many of these parts of a recording away.
const PARTS: usize = 4;

/// The best one for effect `i`: driven by the motion of another joint, searched for over its whole grid as the effect itself was; of
/// weights, which are different numbers at every joint, those that act in other poses. `None` where there is no such thing.
pub(super) fn placebo(
    search: &Search,
    in_model: &[ModelTerm],
    i: usize,
    machine: &Machine,
) -> Option<Placebo> {
    let (effect, rows) = (&in_model[i], search.rows);
    let own = &search.candidates[effect.candidate];
    let field = rows.field(search.beside(in_model, Some(i)));
    let here = rows.score_at(own, &effect.score.parameters, &field, search.overdispersion)?;
    let weighs = own.features.iter().any(|feature| feature.needs_gravity());
    // Half the energy that it takes away, and its evidence; what it was before anybody looked is no less its own.
    let says = |candidate: &Candidate, score: &Score| {
        let hypothesis = Hypothesis::new(effect.candidate, score.at_best, score.clone());
        match search.with_initial(candidate, &hypothesis, &field) {
            Some(more) if more.evidence > 0.0 => (more.reach, score.at_best + more.evidence),
            _ => (score.gain, score.at_best),
        }
    };
    let (gain, evidence) = says(own, &here);
    let of = |cause: String, candidate: &Candidate, score: &Score, raw: &DMatrix<f64>| {
        let (own_gain, own_evidence) = says(candidate, score);
        Placebo {
            cause,
            share: own_gain / gain.max(f64::MIN_POSITIVE),
            ahead: own_evidence - evidence,
            raw: raw.columns(0, score.coefficients) * score.room,
        }
    };
    let driven = search.candidates.iter().enumerate().filter_map(|(k, other)| {
        let joint = moved_by(own, other)?;
        let candidate = Candidate { coefficients: own.coefficients.clone(), ..other.clone() };
        let score = rows.screen(k, &candidate, &field, search.overdispersion)?;
        let what = if weighs { "the weight on" } else { "the motion of" };
        let cause = format!("{what} {}", Place::Joint(joint).name(machine));
        Some(of(cause, &candidate, &score, &rows.raw(&candidate, &score.parameters)?))
    });
    let elsewhere = (1..if weighs { PARTS } else { 1 }).filter_map(|part| {
        let raw = rows.raw_elsewhere(own, &effect.score.parameters, part as f64 / PARTS as f64)?;
        let mut white = raw.clone();
        rows.whiten(&mut white);
        let usual = rows.usual_sizes(own, std::slice::from_ref(&effect.score.parameters));
        let (at, mut score) = (&effect.score.parameters, None);
        judge((&white, white.ncols()), &field.marginal, &field.left, &[0], &mut |_, equations| {
            score = Some(best(own, at, &lengths(own), equations, search.overdispersion, usual).at(at));
        });
        Some(of("the weights of other poses".into(), own, &score?, &raw))
    });
    driven.chain(elsewhere).max_by(|a, b| a.share.total_cmp(&b.share))
}

/// The joint that drives the other candidate, where it is the same family at another joint and its features tell the two apart.
fn moved_by(own: &Candidate, other: &Candidate) -> Option<usize> {
    let (Place::Joint(j), Place::Joint(k)) = (own.place, other.place) else { return None };
    let alike = own.family == other.family
        && own.features.len() == other.features.len()
        && own.coefficients.len() == other.coefficients.len()
        && own.parameters.len() == other.parameters.len();
    (j != k && alike && own.features != other.features).then_some(k)
}

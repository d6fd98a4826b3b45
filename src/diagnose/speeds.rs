//! Whether speeds allow to tell what goes with velocity from what goes with direction.

use super::policy::Rule;
use super::search::Search;
use super::terms::{Hypothesis, ModelTerm};
use crate::effects::Candidate;
use crate::feature::Feature;

/// At speed is what moves faster than this part of the fastest.
const AT_SPEED: f64 = 0.5;
/// There is one speed where the mean of those is more than this part of their root mean square.
const ONE: f64 = 0.995;
/// Cosine between two columns that do much the same at speed.
const ALIKE: f64 = 0.9;
/// The other name is taken where it is likelier by this, as a logarithm.
const LIKELIER: f64 = 2.0;

/// Effects of which one speed says no more than of another name, as that other one where its size is less rare: two degrees of play are
/// a rare thing, a delay of 30 ms is not.
pub(super) fn less_rare(search: &Search, in_model: Vec<ModelTerm>) -> Vec<ModelTerm> {
    let mut in_model = in_model;
    for i in 0..in_model.len() {
        let hypotheses = search.rivals_of(&in_model, i);
        let Some(own) = hypotheses.iter().find(|r| r.candidate == in_model[i].candidate) else { continue };
        let levelled = hypotheses.iter().filter_map(|r| Some((level_with(search, own, r)?, r)));
        let best = levelled
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(w, _)| *w > own.weight + LIKELIER && Rule::UsualSizeFirst.decides());
        let Some((_, other)) = best else { continue };
        if let Some(entered) = search.settle(other, &search.ground(&in_model, Some(i))) {
            in_model[i] = entered.instead_of(&in_model[i]);
        }
    }
    in_model
}

/// What a hypothesis weighs where speeds do not allow to tell it from `own`; `None` where they do.
fn level_with(search: &Search, own: &Hypothesis, r: &Hypothesis) -> Option<f64> {
    let candidate = |r: &Hypothesis| &search.candidates[r.candidate];
    let (lag, play) = match (by_velocity(candidate(own)), by_velocity(candidate(r))) {
        (true, false) if by_direction(candidate(r)) => (own, r),
        (false, true) if by_direction(candidate(own)) => (r, own),
        _ => return None,
    };
    let beforehand = |r: &Hypothesis| search.priors[r.candidate] + search.rows.rarity(candidate(r), &r.score);
    is_one_at_speed(search, lag, play).then(|| own.weight - beforehand(own) + beforehand(r))
}

fn by_velocity(candidate: &Candidate) -> bool {
    candidate.features.iter().all(|f| f.needs_rates() && !f.needs_history())
}

fn by_direction(candidate: &Candidate) -> bool {
    candidate.features.iter().all(|f| f.needs_history() && !f.needs_rates())
}

/// Whether a lag and what goes with direction hang on one joint alone, which has one speed, and do much the same to the readings
/// taken at that speed.
fn is_one_at_speed(search: &Search, lag: &Hypothesis, play: &Hypothesis) -> bool {
    let features = &search.candidates[lag.candidate].features;
    let joints = |features: &[Feature]| -> Vec<usize> { features.iter().flat_map(Feature::joints).collect() };
    if features.len() != 1 || joints(features) != joints(&search.candidates[play.candidate].features) {
        return false;
    }
    let column = |r: &Hypothesis| {
        let columns = search.rows.raw(&search.candidates[r.candidate], &r.score.parameters)?;
        (columns.ncols() == 1).then(|| columns.column(0).into_owned())
    };
    let (Some(by_lag), Some(by_play)) = (column(lag), column(play)) else { return false };
    let speed = features[0].over(&search.rows.linear.samples, &lag.score.parameters);
    let most = speed.iter().fold(0.0f64, |most, v| most.max(v.abs()));
    let at_speed = |sample: usize| speed[sample].abs() > AT_SPEED * most;
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for v in (0..speed.len()).filter(|sample| at_speed(*sample)).map(|sample| speed[sample].abs()) {
        (count, sum, squares) = (count + 1.0, sum + v, squares + v * v);
    }
    let (mut both, mut own) = (0.0, (0.0, 0.0));
    for row in (0..by_lag.len()).filter(|row| at_speed(search.rows.linear.sample[*row])) {
        let (a, b) = (by_lag[row], by_play[row]);
        (both, own) = (both + a * b, (own.0 + a * a, own.1 + b * b));
    }
    sum > ONE * f64::sqrt(count * squares) && f64::abs(both) > ALIKE * f64::sqrt(own.0 * own.1)
}

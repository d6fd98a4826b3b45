//! Whether speeds allow to tell what goes with velocity from what goes with direction.

use super::search::{Rival, Search};
use crate::effects::Candidate;
use crate::feature::Feature;

/// At speed is what moves faster than this part of the fastest.
const AT_SPEED: f64 = 0.5;
/// There is one speed where the mean of those is more than this part of their root mean square.
const ONE: f64 = 0.995;
/// Cosine between two columns that do much the same at speed.
const ALIKE: f64 = 0.9;

/// Rivals with what speeds do not allow to tell from `own` as likely as it is, but for how often each is met: where there is one speed
/// only, a lag and play differ in starts and stops alone, and those hang on shapes that nobody knows.
pub(super) fn levelled(search: &Search, own: &Rival, rivals: Vec<Rival>) -> Vec<Rival> {
    let candidate = |r: &Rival| &search.candidates[r.candidate];
    let level = |r: Rival| {
        let pair = match (by_velocity(candidate(own)), by_velocity(candidate(&r))) {
            (true, false) if by_direction(candidate(&r)) => Some((own, &r)),
            (false, true) if by_direction(candidate(own)) => Some((&r, own)),
            _ => None,
        };
        if !pair.is_some_and(|(lag, play)| is_one_at_speed(search, lag, play)) {
            return r;
        }
        let prior = |r: &Rival| search.priors[r.candidate];
        let weight = own.weight - prior(own) + prior(&r);
        Rival { weight: weight.max(r.weight), ..r }
    };
    rivals.into_iter().map(level).collect()
}

fn by_velocity(candidate: &Candidate) -> bool {
    candidate.features.iter().all(|f| f.needs_rates() && !f.needs_history())
}

fn by_direction(candidate: &Candidate) -> bool {
    candidate.features.iter().all(|f| f.needs_history() && !f.needs_rates())
}

/// Whether a lag and what goes with direction hang on one joint alone, which has one speed, and do much the same to the readings
/// taken at that speed.
fn is_one_at_speed(search: &Search, lag: &Rival, play: &Rival) -> bool {
    let features = &search.candidates[lag.candidate].features;
    let joints = |features: &[Feature]| -> Vec<usize> { features.iter().flat_map(Feature::joints).collect() };
    if features.len() != 1 || joints(features) != joints(&search.candidates[play.candidate].features) {
        return false;
    }
    let column = |r: &Rival| {
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

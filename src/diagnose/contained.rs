//! Names that say the same as a wider one that adds next to nothing: a scale that is off by 3000 ppm and bends by 10 is a scale error.
//! And wider names that add nothing to what has another name, `docs/diagnosis-method.md` (78).

use nalgebra::{DMatrix, DVector};

use super::discrepancy;
use super::marginal::{Marginal, gram};
use super::search::Search;
use super::terms::{Hypothesis, ModelTerm};
use crate::effects::Candidate;

/// What a wider name adds is next to nothing below this part of what it does, root mean square in m and rad; and below this part where the
/// simpler one is just what the wider one says more than, as lines along a travel are that bend a little.
const NOTHING: f64 = 0.03;
const LITTLE: f64 = 0.18;
/// The simpler one takes at least this part of the energy.
const NEARLY_ALL: f64 = 0.9;
/// By so much is it then likelier than the wider one, as a logarithm of odds.
const LIKELIER: f64 = 2.0;
/// Columns are contained that leave no more of themselves than this part, and the same as others that leave this part of their square.
const CONTAINED: f64 = 1e-4;
const SAME: f64 = 1e-10;

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
    is_empty(candidate, &effect.score.parameters) && !hypotheses.iter().any(is_name)
}

/// Puts simpler names above the best one where that contains them and hardly departs from them. `close`: those that come into question.
pub(super) fn prefer_simpler(
    search: &Search,
    hypotheses: &mut [Hypothesis],
    close: usize,
    marginal: &Marginal,
) {
    let Some(best) = hypotheses.first().cloned() else { return };
    let place = |r: &Hypothesis| search.candidates[r.candidate].place;
    let is_simpler = |r: &Hypothesis| {
        place(r) == place(&best)
            && r.score.coefficients < best.score.coefficients
            && r.score.gain >= NEARLY_ALL * best.score.gain
    };
    let simpler: Vec<usize> =
        (1..close.min(hypotheses.len())).filter(|i| is_simpler(&hypotheses[*i])).collect();
    if simpler.is_empty() {
        return;
    }
    let raw = |r: &Hypothesis| -> Option<DMatrix<f64>> {
        let all = search.rows.raw(&search.candidates[r.candidate], &r.score.parameters)?;
        Some(all.columns(0, r.score.coefficients).into_owned())
    };
    let Some((wide, effect)) = raw(&best).zip(search.enter(&best, marginal)) else { return };
    let does = DMatrix::from_columns(&[&wide * &effect.solution]);
    // Where zero is, is a matter of constant geometry.
    let constant: Vec<DVector<f64>> = (search.candidates[best.candidate].coefficients.iter())
        .flat_map(|c| &c.parts)
        .map(|part| DVector::from_column_slice(&search.rows.answer(part.slot, part.direction)))
        .collect();
    let constant = DMatrix::from_columns(&constant);
    let (does, wide) = (beside(&does, &constant), beside(&wide, &constant));
    let curve = Some(&search.candidates[best.candidate]).filter(|candidate| discrepancy::is_curve(candidate));
    let less: Vec<DMatrix<f64>> = (curve.iter().flat_map(|candidate| &candidate.more_than))
        .filter_map(|less| search.rows.raw(less, &best.score.parameters))
        .map(|less| beside(&less, &constant))
        .collect();
    for i in simpler {
        let Some(own) = raw(&hypotheses[i]) else { continue };
        let own = beside(&own, &constant);
        let is_less = less.iter().any(|less| left(&own, less) < CONTAINED && left(less, &own) < CONTAINED);
        let added = if is_less { LITTLE } else { NOTHING };
        // What says the same with other numbers is no simpler.
        let is_wider = left(&wide, &own) > CONTAINED;
        if is_wider && left(&own, &wide) < CONTAINED && left(&does, &own) < added {
            hypotheses[i].weight = hypotheses[i].weight.max(best.weight + LIKELIER);
        }
    }
}

/// What is left of columns by others.
fn beside(columns: &DMatrix<f64>, others: &DMatrix<f64>) -> DMatrix<f64> {
    let lengths: Vec<f64> = others.column_iter().map(|c| c.norm()).collect();
    let longest = lengths.iter().copied().fold(0.0, f64::max);
    let kept: Vec<usize> = (0..lengths.len()).filter(|i| lengths[*i] > SAME * longest).collect();
    let scaled: Vec<DVector<f64>> = kept.iter().map(|i| others.column(*i) / lengths[*i]).collect();
    if scaled.is_empty() {
        return columns.clone();
    }
    let scaled = DMatrix::from_columns(&scaled);
    let eigen = gram(&scaled, &scaled).symmetric_eigen();
    let most = eigen.eigenvalues.max();
    let kept: Vec<usize> = (0..scaled.ncols()).filter(|i| eigen.eigenvalues[*i] > SAME * most).collect();
    let mut basis = scaled * eigen.eigenvectors.select_columns(&kept);
    (basis.column_iter_mut().zip(&kept)).for_each(|(mut c, i)| c /= eigen.eigenvalues[*i].sqrt());
    columns - &basis * gram(&basis, columns)
}

/// Part of columns that others do not span, by their norms.
fn left(columns: &DMatrix<f64>, others: &DMatrix<f64>) -> f64 {
    beside(columns, others).norm() / columns.norm().max(f64::MIN_POSITIVE)
}

//! Parameters between the points of the grid: a candidate may be much better there.

use super::equations::Score;
use super::marginal::solved;
use super::score::{Field, Rows};
use super::terms::Hypothesis;
use crate::effects::{Candidate, Parameter};

/// Rounds over several parameters; parabolas at most, as long as they bring so much, or halvings of a step where nothing is smooth, for
/// each of them.
const ROUNDS: usize = 2;
const PARABOLAS: usize = 12;
const WORTHWHILE: f64 = 0.3;
const HALVINGS: usize = 9;

/// Sine and cosine; a wave whose own ones are smaller than this part of its overtone's is that overtone.
const PAIR: usize = 2;
const ALONE: f64 = 0.1;

/// Weight of what cannot be.
const NEVER: f64 = -1e6;

/// Moves the parameters between the points of the grid to where the evidence is greatest, from every point that may lead there.
pub(super) fn refine(
    rows: &Rows,
    candidate: &Candidate,
    hypothesis: &Hypothesis,
    field: &Field,
    overdispersion: f64,
) -> Hypothesis {
    let best = refined(rows, candidate, hypothesis, field, overdispersion);
    let others = hypothesis.score.also.iter().filter_map(|parameters| {
        let here = rows.score_at(candidate, parameters, field, overdispersion)?;
        let lower = hypothesis.score.at_best - here.at_best;
        let score = Score { evidence: hypothesis.score.evidence - lower, ..here };
        let start = Hypothesis { weight: hypothesis.weight - lower, score, ..hypothesis.clone() };
        Some(refined(rows, candidate, &start, field, overdispersion))
    });
    let all: Vec<Hypothesis> = others.chain([best.clone()]).collect();
    let weight = |r: &Hypothesis| {
        let is_half = |other: &Hypothesis| candidate.is_half(&other.score.parameters, &r.score.parameters);
        match all.iter().any(is_half) && is_overtone_alone(rows, candidate, &r.score, field) {
            true => NEVER,
            false => r.weight,
        }
    };
    all.iter().max_by(|a, b| weight(a).total_cmp(&weight(b))).cloned().unwrap_or(best)
}

/// Whether the wave itself is next to nothing beside its overtone: then that is the wave.
fn is_overtone_alone(rows: &Rows, candidate: &Candidate, score: &Score, field: &Field) -> bool {
    let Some(columns) = rows.of(candidate, &score.parameters).filter(|_| score.coefficients >= PAIR + PAIR)
    else {
        return false;
    };
    let columns = columns.columns(0, score.coefficients) * score.room;
    let along = field.marginal.along(&columns.as_view());
    let gram = columns.tr_mul(&columns) - along.tr_mul(&along);
    let Some(solution) = solved(gram, &columns.tr_mul(&field.left)) else { return false };
    let size = |from: usize| solution.rows(from, PAIR).norm();
    size(0) < ALONE * size(PAIR)
}

/// The same from one point; the evidence over the grid grows alike.
fn refined(
    rows: &Rows,
    candidate: &Candidate,
    hypothesis: &Hypothesis,
    field: &Field,
    overdispersion: f64,
) -> Hypothesis {
    let at = |parameters: &[f64]| rows.score_at(candidate, parameters, field, overdispersion);
    let start = hypothesis.score.at_best;
    let Some(here) = at(&hypothesis.score.parameters) else { return hypothesis.clone() };
    let mut best = Score { evidence: hypothesis.score.evidence, ..here };
    let free: Vec<usize> =
        (0..candidate.parameters.len()).filter(|p| !candidate.parameters[*p].whole).collect();
    let mut steps: Vec<f64> = free.iter().map(|p| 0.5 * spacing(candidate, *p, &best.parameters)).collect();
    for _ in 0..if free.len() > 1 { ROUNDS } else { 1 } {
        for (p, step) in free.iter().zip(&mut steps) {
            let (low, high) = candidate.parameters[*p].range_around(hypothesis.score.parameters[*p]);
            let moved = |to: f64, best: &mut Score| {
                let mut parameters = best.parameters.clone();
                parameters[*p] = to.clamp(low, high);
                let score = at(&parameters)?;
                let evidence = score.at_best;
                if evidence > best.at_best {
                    *best = Score { evidence: best.evidence, ..score };
                }
                Some(evidence)
            };
            // Parabolas through three points; where there is no summit, the step goes on or shrinks.
            for _ in 0..if candidate.parameters[*p].smooth { PARABOLAS } else { HALVINGS } {
                let (x, here) = (best.parameters[*p], best.at_best);
                let smooth = candidate.parameters[*p].smooth;
                let (Some(below), Some(above)) = (moved(x - *step, &mut best), moved(x + *step, &mut best))
                else {
                    break;
                };
                let bend = below + above - 2.0 * here;
                if smooth && bend < 0.0 {
                    let shift = (0.5 * *step * (below - above) / bend).clamp(-2.0 * *step, 2.0 * *step);
                    moved(x + shift, &mut best);
                    *step = (0.3 * *step).max(0.5 * shift.abs());
                } else if best.parameters[*p] == x {
                    *step *= 0.5;
                }
                if smooth && bend < 0.0 && best.at_best - here < WORTHWHILE {
                    break;
                }
            }
        }
    }
    // Nothing has its best moment where a recording begins or ends: what differs there is the recording.
    let ends = |(p, parameter): (&f64, &Parameter)| {
        parameter.pieces.iter().any(|(from, to)| (p - from).abs() < 1.0 || (p - to).abs() < 1.0)
    };
    if best.parameters.iter().zip(&candidate.parameters).any(ends) {
        return Hypothesis { weight: NEVER, ..hypothesis.clone() };
    }
    let grown = best.at_best - start;
    best.evidence += grown;
    let reach = hypothesis.reach + best.gain - hypothesis.score.gain;
    Hypothesis { candidate: hypothesis.candidate, weight: hypothesis.weight + grown, score: best, reach }
}

/// Distance to the next point of the grid with the same other parameters, or with any.
fn spacing(candidate: &Candidate, p: usize, at: &[f64]) -> f64 {
    let near = |alike: bool| {
        let others = |point: &[f64]| (0..at.len()).all(|k| k == p || point[k] == at[k]);
        let points = candidate.grid.iter().filter(|point| !alike || others(point));
        let apart = points.map(|point| (point[p] - at[p]).abs()).filter(|d| *d > 1e-12 * at[p].abs());
        apart.fold(f64::INFINITY, f64::min)
    };
    [near(true), near(false)].into_iter().find(|d| d.is_finite()).unwrap_or(0.0)
}

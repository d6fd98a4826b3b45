//! Which effects together explain the recordings best: forward, backward, swaps, each against all candidates.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::leftover::{Leftover, measure};
use super::score::{Field, Rows, Score};
use super::space::Space;
use crate::effects::Candidate;

/// An effect that has been taken in.
#[derive(Clone)]
pub(super) struct Active {
    /// Index of the candidate.
    pub candidate: usize,
    pub score: Score,
    /// Whitened columns, each times the size that its coefficient may have.
    pub columns: DMatrix<f64>,
}

/// A candidate that competes for one finding, and its weight.
#[derive(Clone, Debug)]
pub(super) struct Rival {
    pub candidate: usize,
    /// Logarithm of evidence and prior together.
    pub weight: f64,
    pub score: Score,
}

pub(super) struct Search<'a> {
    pub rows: &'a Rows<'a>,
    pub runs: &'a [Vec<usize>],
    pub base: Space,
    pub candidates: &'a [Candidate],
    /// Logarithm of what is expected of each candidate beforehand.
    pub priors: Vec<f64>,
    pub progress: &'a dyn Fn(&str),
}

/// Candidates with this part of the best one's weight come into question, and at most so many.
const CLOSE: f64 = 0.6;
const REFINED: usize = 8;
/// Coefficients of effects that are taken in may be this many times the usual size.
pub(super) const ROOM: f64 = 4.0;
/// An effect that takes away less than this part of the structure that is left is a poor name for it.
const WORTH: f64 = 0.2;
/// Part of an effect's energy by which its shape may depart from the family's, seen at its own place and anywhere else.
const OWN_SHAPE: f64 = 0.004;
const OTHER_SHAPE: f64 = 0.001;
/// More effects are not looked for.
const MOST: usize = 5;
/// Logarithm of the odds at which an effect is taken in.
const ENTER: f64 = 3.0;

impl Search<'_> {
    /// Evidence of every candidate beside what `space` knows, better first.
    pub fn rivals(&self, space: &Space, heat: f64) -> Vec<Rival> {
        let field = self.rows.field(space.clone());
        // What progress is told is no matter of the threads.
        let (rows, priors, candidates) = (self.rows, &self.priors, self.candidates);
        let mut rivals: Vec<Rival> = (candidates.par_iter().enumerate())
            .filter_map(|(i, candidate)| {
                let score = rows.score(candidate, &field, heat)?;
                Some(Rival { candidate: i, weight: score.evidence + priors[i], score })
            })
            .collect();
        let better_first = |a: &Rival, b: &Rival| b.weight.total_cmp(&a.weight);
        rivals.sort_by(better_first);
        // Between the points of its grid a candidate may be much better: those that come into question are refined.
        let near = rivals.first().map_or(0.0, |best| best.weight * CLOSE);
        let close = rivals.iter().take_while(|r| r.weight >= near && r.weight > 0.0).count().min(REFINED);
        let refined: Vec<Rival> = rivals[..close]
            .par_iter()
            .map(|r| refine(rows, &candidates[r.candidate], r, &field, heat))
            .collect();
        rivals.splice(..close, refined);
        rivals.sort_by(better_first);
        rivals
    }

    /// The space beside all active effects but one.
    pub fn beside(&self, active: &[Active], but: Option<usize>) -> Space {
        let others = active.iter().enumerate().filter(|(i, _)| Some(*i) != but);
        others.fold(self.base.clone(), |space, (_, effect)| space.with(&effect.columns))
    }

    /// What is left beside the active effects.
    pub fn leftover(&self, space: &Space) -> Leftover {
        let left = space.apply(&self.rows.residual);
        measure(left.as_slice(), self.runs, &self.rows.whitener.out)
    }

    /// Takes a rival in, at its best point.
    pub fn enter(&self, rival: &Rival) -> Option<Active> {
        let score = rival.score.clone();
        let columns = self.rows.of(&self.candidates[rival.candidate], &score.parameters)?;
        let columns = columns.columns(0, score.coefficients) * ROOM;
        Some(Active { candidate: rival.candidate, score, columns })
    }

    /// Forward with full comparison, and after each step every effect against all others in its place.
    ///
    /// A step counts only if its evidence stands out from the structure that it leaves, and if it takes away more than the shape of
    /// what was found before may be off by.
    pub fn run(&self) -> Vec<Active> {
        let mut active: Vec<Active> = Vec::new();
        while active.len() < MOST {
            (self.progress)(&format!("looking for effect {}", active.len() + 1));
            let space = self.beside(&active, None);
            let rivals = self.rivals(&space, 1.0);
            let Some(best) = rivals.first().filter(|r| r.weight > ENTER) else { break };
            let structure = self.leftover(&space).energy;
            if best.score.gain < self.shape_error(best, &active) || 2.0 * best.score.gain < WORTH * structure
            {
                break;
            }
            let Some(entered) = self.enter(best) else { break };
            active.push(entered);
            let left = self.leftover(&self.beside(&active, None));
            if best.weight < ENTER * left.heat {
                active.pop();
                break;
            }
            if active.len() > 1 {
                self.swap(&mut active);
            }
        }
        active
    }

    /// Half the energy that what was found may leave over because its shape departs from the family's: more at the same place.
    fn shape_error(&self, rival: &Rival, active: &[Active]) -> f64 {
        let place = |candidate: usize| self.candidates[candidate].place.dyad();
        let share = |effect: &Active| {
            if place(effect.candidate) == place(rival.candidate) { OWN_SHAPE } else { OTHER_SHAPE }
        };
        active.iter().map(|effect| share(effect) * effect.score.gain).sum()
    }

    /// Every effect gives its place to a better one, beside the others; one that is no longer needed goes.
    fn swap(&self, active: &mut Vec<Active>) {
        for _ in 0..2 {
            let mut changed = false;
            let mut i = 0;
            while i < active.len() {
                let space = self.beside(active, Some(i));
                let rivals = self.rivals(&space, 1.0);
                match rivals.first().filter(|r| r.weight > ENTER) {
                    None => {
                        active.remove(i);
                        changed = true;
                        continue;
                    }
                    Some(best) => {
                        if let Some(entered) = self.enter(best) {
                            changed |= best.candidate != active[i].candidate;
                            active[i] = entered;
                        }
                    }
                }
                i += 1;
            }
            if !changed {
                break;
            }
        }
    }
}

/// Moves the parameters between the points of the grid to where the evidence is greatest; the evidence over the grid grows alike.
fn refine(rows: &Rows, candidate: &Candidate, rival: &Rival, field: &Field, heat: f64) -> Rival {
    let at = |parameters: &[f64]| rows.score_at(candidate, parameters, field, heat);
    let mut best = rival.score.clone();
    let start = best.at_best;
    for round in 0..2 {
        for (p, parameter) in candidate.parameters.iter().enumerate().filter(|(_, p)| p.smooth) {
            let mut step = 0.5f64.powi(2 * round) * spacing(candidate, p, best.parameters[p]);
            for _ in 0..5 {
                step *= 0.5;
                for sign in [-1.0, 1.0] {
                    let mut moved = best.parameters.clone();
                    moved[p] += sign * step;
                    if moved[p] < parameter.range.0 || moved[p] > parameter.range.1 {
                        continue;
                    }
                    if let Some(score) = at(&moved).filter(|s| s.at_best > best.at_best) {
                        best = Score { evidence: best.evidence, ..score };
                        break;
                    }
                }
            }
        }
        if candidate.parameters.len() < 2 {
            break;
        }
    }
    let grown = best.at_best - start;
    best.evidence += grown;
    Rival { candidate: rival.candidate, weight: rival.weight + grown, score: best }
}

/// Distance to the next point of the grid.
fn spacing(candidate: &Candidate, p: usize, value: f64) -> f64 {
    let apart =
        candidate.grid.iter().map(|point| (point[p] - value).abs()).filter(|d| *d > 1e-12 * value.abs());
    let near = apart.fold(f64::INFINITY, f64::min);
    if near.is_finite() { near } else { 0.0 }
}

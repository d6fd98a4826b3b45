//! Parameters where nothing is left to be gained: Gauss and Newton with derivatives from dual numbers, coefficients, geometry and all
//! other effects solved with them, `docs/diagnosis-method.md` (74).

use nalgebra::{DMatrix, DVector};

use super::equations::Score;
use super::marginal::{Marginal, solved};
use super::search::Search;
use super::terms::{Hypothesis, ModelTerm, joined};

/// Times that all effects are looked at, where there are several; steps of each.
const ROUNDS: usize = 2;
const STEPS: usize = 4;
/// A step that brings no more than this, as a logarithm, is the last one.
const NOTHING: f64 = 1e-3;
/// No step goes farther than this part of a parameter's range.
const FARTHEST: f64 = 0.02;

impl Search<'_> {
    /// Effects with their smooth parameters moved to where the evidence is greatest.
    ///
    /// The search stops where a parameter is known well enough to tell names apart, some half of a standard deviation off.
    pub fn polished(&self, in_model: &[ModelTerm]) -> Vec<ModelTerm> {
        let mut in_model = in_model.to_vec();
        let is_smooth = |e: &ModelTerm| self.candidates[e.candidate].parameters.iter().any(|p| p.smooth);
        let smooth: Vec<usize> = (0..in_model.len()).filter(|i| is_smooth(&in_model[*i])).collect();
        for _ in 0..if smooth.len() > 1 { ROUNDS } else { 1 } {
            for i in &smooth {
                if let Some(moved) = self.moved(&in_model, *i) {
                    in_model[*i] = moved.instead_of(&in_model[*i]);
                }
            }
        }
        in_model
    }

    /// Effect `i` with its parameters moved; `None` where nothing is gained.
    fn moved(&self, in_model: &[ModelTerm], i: usize) -> Option<ModelTerm> {
        let effect = &in_model[i];
        let candidate = &self.candidates[effect.candidate];
        let beside = self.beside(in_model, Some(i));
        let field = self.rows.field(beside.with(&effect.initial));
        let at = |parameters: &[f64]| self.rows.score_at(candidate, parameters, &field, self.overdispersion);
        let start = at(&effect.score.parameters)?;
        let mut best = start.clone();
        for _ in 0..STEPS {
            let Some(there) = self.step(effect, &best, &field.marginal).and_then(|to| at(&to)) else { break };
            let gained = there.at_best - best.at_best;
            if gained > 0.0 {
                best = there;
            }
            if gained < NOTHING {
                break;
            }
        }
        if best.at_best <= start.at_best {
            return None;
        }
        let evidence = effect.score.evidence + best.at_best - start.at_best;
        let score =
            Score { evidence, at_best: best.at_best, parameters: best.parameters, ..effect.score.clone() };
        self.enter(&Hypothesis::new(effect.candidate, evidence, score), &beside)
    }

    /// Parameters one step on, beside a marginal.
    fn step(&self, effect: &ModelTerm, from: &Score, marginal: &Marginal) -> Option<Vec<f64>> {
        let candidate = &self.candidates[effect.candidate];
        let units = self.rows.units(candidate, &from.parameters);
        let own = self.rows.of(candidate, &from.parameters)?;
        let own = own.columns(0, effect.columns.ncols()) * from.room;
        let coefficients = self.solved_beside(&own, marginal)? * from.room;
        let free = candidate.parameters.iter().enumerate().filter(|(_, p)| p.smooth);
        let free: Vec<(usize, f64)> =
            free.map(|(p, parameter)| (p, parameter.range.1 - parameter.range.0)).collect();
        let by_parameter = self.rows.slopes(candidate, &from.parameters, &units);
        let mut slopes = DMatrix::zeros(own.nrows(), free.len());
        for (s, (p, range)) in free.iter().enumerate() {
            let slope = by_parameter[*p].columns(0, own.ncols()) * &coefficients * *range;
            slopes.set_column(s, &slope);
        }
        self.rows.whiten(&mut slopes);
        if slopes.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let both = joined(own, &slopes);
        let solution = self.solved_beside(&both, marginal)?;
        let mut to = from.parameters.clone();
        for ((p, range), step) in free.iter().zip(solution.rows_range(effect.columns.ncols()..).iter()) {
            let (low, high) = candidate.parameters[*p].range_around(to[*p]);
            to[*p] = (to[*p] + range * step.clamp(-FARTHEST, FARTHEST)).clamp(low, high);
        }
        Some(to)
    }

    /// Numbers of these whitened columns beside a marginal, with their prior.
    fn solved_beside(&self, columns: &DMatrix<f64>, marginal: &Marginal) -> Option<DVector<f64>> {
        let (gram, toward) = self.normal(columns, marginal);
        solved(gram, &toward)
    }
}

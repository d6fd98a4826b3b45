//! All coefficients together, with their covariance, and what they predict where they were not fitted.

use nalgebra::{DMatrix, DVector};

use super::marginal::{square, with_prior};
use super::search::Search;
use super::terms::{ModelTerm, joined};
use crate::effects::{Candidate, Identified, Library};

/// Constant deviations and effects solved together.
pub(super) struct Model {
    /// Whitened: constants, then of each effect its columns and what it may have been before anybody looked.
    columns: DMatrix<f64>,
    /// First column of each effect.
    offsets: Vec<usize>,
    solution: DVector<f64>,
}

/// Where a parameter that jumps costs this much, as a logarithm, it is two standard deviations off if it were normal.
const UNLIKELY: f64 = 2.0;
/// Halvings on the way there.
const HALVINGS: usize = 20;

/// Numbers of one effect.
pub(super) struct Solved {
    /// In SI, one per coefficient of the candidate; those that take no part are 0.
    pub coefficients: Vec<f64>,
    /// Coefficients before parameters.
    pub covariance: Vec<Vec<f64>>,
}

impl Solved {
    /// As an effect of its family, at these parameters.
    pub fn identified<'a>(
        self,
        candidate: &'a Candidate,
        library: &'a Library,
        parameters: Vec<f64>,
    ) -> Identified<'a> {
        Identified {
            family: &library.families()[candidate.family],
            candidate,
            coefficients: self.coefficients,
            parameters,
            covariance: Some(self.covariance),
        }
    }
}

impl Model {
    pub fn new(search: &Search, in_model: &[ModelTerm]) -> Self {
        let mut columns = search.always(in_model);
        search.rows.whiten(&mut columns);
        let mut offsets = Vec::new();
        for effect in in_model {
            let at = columns.ncols();
            offsets.push(at);
            for own in [&effect.columns, &effect.initial] {
                columns = joined(columns, own);
            }
        }
        let toward = columns.tr_mul(&search.rows.residual);
        let solution = match with_prior(square(&columns)) {
            Some(factor) => factor.solve(&toward),
            None => toward,
        };
        Model { columns, offsets, solution }
    }

    /// What is to be added to everything constant, in units of its columns.
    pub fn constants(&self, search: &Search) -> Vec<f64> {
        self.solution.as_slice()[..search.rows.linear.constant.ncols()].to_vec()
    }

    /// Coefficients of effect `i` in SI, those that take part.
    pub fn coefficients(&self, search: &Search, in_model: &[ModelTerm], i: usize) -> Vec<f64> {
        let effect = &in_model[i];
        let units = search.rows.units(&search.candidates[effect.candidate], &effect.score.parameters);
        let own = &self.solution.as_slice()[self.offsets[i]..self.offsets[i] + effect.columns.ncols()];
        own.iter().zip(units).map(|(x, unit)| x * unit * effect.score.room).collect()
    }

    /// Residuals in m and rad with everything taken away: constants, effects, and what these were before anybody looked. Columns are taken
    /// before whitening.
    pub fn residual(&self, search: &Search, in_model: &[ModelTerm]) -> Vec<f64> {
        let mut left = self.residual_without(search, in_model, |_| true);
        for early in (0..in_model.len()).filter_map(|i| self.early(search, in_model, i)) {
            left.iter_mut().zip(early).for_each(|(left, early)| *left -= early);
        }
        left
    }

    /// What effect `i` was before anybody looked, beside what its family says, m and rad; `None` where that is known.
    pub fn early(&self, search: &Search, in_model: &[ModelTerm], i: usize) -> Option<Vec<f64>> {
        let effect = &in_model[i];
        if effect.initial.ncols() == 0 {
            return None;
        }
        let initial = search.initial_conditions_of(effect)?;
        let numbers = self.solution.rows(self.offsets[i] + effect.columns.ncols(), effect.initial.ncols());
        Some(initial.sum(search.rows, numbers.as_slice()))
    }

    /// The same with the constants alone taken away, and the effects that fulfil a condition.
    pub fn residual_without(
        &self,
        search: &Search,
        in_model: &[ModelTerm],
        is_taken: impl Fn(&Candidate) -> bool,
    ) -> Vec<f64> {
        let linear = search.rows.linear;
        let mut left = DVector::from_column_slice(&linear.residual);
        let always = search.always(in_model);
        left -= &always * self.solution.rows(0, always.ncols());
        for (i, effect) in in_model.iter().enumerate() {
            let candidate = &search.candidates[effect.candidate];
            if !is_taken(candidate) {
                continue;
            }
            if let Some(raw) = search.rows.raw(candidate, &effect.score.parameters) {
                let count = effect.columns.ncols();
                left -=
                    raw.columns(0, count) * effect.score.room * self.solution.rows(self.offsets[i], count);
            }
        }
        left.as_slice().to_vec()
    }

    /// Coefficients of effect `i` with their covariance; parameters by their derivatives, all solved together. `discrepancy`: part of
    /// what shapes may depart from the families' by which they do.
    pub fn effect(&self, search: &Search, in_model: &[ModelTerm], i: usize, discrepancy: f64) -> Solved {
        let effect = &in_model[i];
        let candidate = &search.candidates[effect.candidate];
        let units = search.rows.units(candidate, &effect.score.parameters);
        let (k, all, parameters) =
            (effect.columns.ncols(), candidate.coefficients.len(), effect.score.parameters.len());
        let scale = |c: usize| effect.score.room * units[c];
        let mut coefficients = self.coefficients(search, in_model, i);
        coefficients.resize(all, 0.0);
        // Derivatives by the parameters join the columns.
        let weights = DVector::from_fn(k, |c, _| coefficients[c] / units[c].max(1e-300));
        let by_parameter = search.rows.slopes(candidate, &effect.score.parameters, &units);
        let mut slopes: Vec<(usize, DVector<f64>, f64)> = Vec::new();
        for (p, parameter) in candidate.parameters.iter().enumerate().filter(|(_, p)| p.smooth) {
            let slope = by_parameter[p].columns(0, k) * &weights;
            let mut white = DVector::<f64>::zeros(slope.len());
            search.rows.whitener.apply(slope.as_slice(), white.as_mut_slice());
            if white.iter().all(|x| x.is_finite()) {
                slopes.push((p, white, parameter.range.1 - parameter.range.0));
            }
        }
        let mut covariance = vec![vec![0.0; all + parameters]; all + parameters];
        let own = |c: usize| self.offsets[i] + c;
        let at = self.columns.ncols();
        let mut wide = self.columns.clone().insert_columns(at, slopes.len(), 0.0);
        for (s, (_, column, range)) in slopes.iter().enumerate() {
            wide.set_column(at + s, &(column * *range));
        }
        for effect in in_model {
            wide = joined(wide, &(&effect.discrepancy * discrepancy));
        }
        let Some(factor) = with_prior(square(&wide)) else { return Solved { coefficients, covariance } };
        let inverse = factor.inverse();
        let place = |x: usize| -> (usize, f64) {
            if x < k { (own(x), scale(x)) } else { (at + x - k, slopes[x - k].2) }
        };
        let to = |x: usize| if x < k { x } else { all + slopes[x - k].0 };
        for a in 0..k + slopes.len() {
            for b in 0..k + slopes.len() {
                let ((ia, sa), (ib, sb)) = (place(a), place(b));
                covariance[to(a)][to(b)] = sa * sb * inverse[(ia, ib)];
            }
        }
        Solved { coefficients, covariance }
    }

    /// Middle and standard deviation of a parameter that jumps, between the places where the data begin to speak against it.
    pub fn jumping(search: &Search, in_model: &[ModelTerm], i: usize, p: usize) -> Option<(f64, f64)> {
        let effect = &in_model[i];
        let candidate = &search.candidates[effect.candidate];
        let (at, parameter) = (&effect.score.parameters, &candidate.parameters[p]);
        let field = search.rows.field(search.beside(in_model, Some(i)));
        let evidence = |value: f64| {
            let mut moved = at.clone();
            moved[p] = value;
            search.rows.score_at(candidate, &moved, &field, search.overdispersion).map(|score| score.at_best)
        };
        let best = evidence(at[p])?;
        let edge = |to: f64| {
            let (mut inside, mut outside) = (at[p], to);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (inside + outside);
                match evidence(middle).is_some_and(|e| e > best - UNLIKELY) {
                    true => inside = middle,
                    false => outside = middle,
                }
            }
            0.5 * (inside + outside)
        };
        let range = parameter.range_around(at[p]);
        let (low, high) = (edge(range.0), edge(range.1));
        Some((0.5 * (low + high), (high - low) / 12f64.sqrt()))
    }
}

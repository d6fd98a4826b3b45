//! Effects that have been taken in, and hypotheses that compete for being so.

use nalgebra::{DMatrix, DVector};

use super::equations::Score;

/// An effect that has been taken in.
#[derive(Clone)]
pub(super) struct ModelTerm {
    /// Index of the candidate.
    pub candidate: usize,
    pub score: Score,
    /// Whitened columns, each times the size that its coefficient may have.
    pub columns: DMatrix<f64>,
    /// Its coefficients, in units of the columns.
    pub solution: DVector<f64>,
    /// Whitened columns of what it may have been before anybody looked.
    pub initial: DMatrix<f64>,
    /// Whitened columns by which its shape may depart from the family's.
    pub discrepancy: DMatrix<f64>,
    /// Candidates that might take its place.
    pub near: Vec<usize>,
    /// Whether it had been taken for the shape of the others, and so is judged beside their names alone.
    pub hidden: bool,
}

impl ModelTerm {
    pub(super) fn mark(&self) -> Mark {
        let parameters = self.score.parameters.iter().map(|x| x.to_bits()).collect();
        (self.candidate, self.score.coefficients, parameters)
    }

    /// With a shape that is quite the family's.
    pub(super) fn without_discrepancy(&self) -> ModelTerm {
        ModelTerm { discrepancy: DMatrix::zeros(self.columns.nrows(), 0), ..self.clone() }
    }

    /// In the place of another.
    pub(super) fn instead_of(self, other: &ModelTerm) -> ModelTerm {
        ModelTerm { near: other.near.clone(), hidden: other.hidden, ..self }
    }
}

/// What tells an effect that has been taken in: candidate, coefficients and parameters.
pub(super) type Mark = (usize, usize, Vec<u64>);

/// A candidate that competes for one finding, and its weight.
#[derive(Clone, Debug)]
pub(super) struct Hypothesis {
    pub candidate: usize,
    /// Logarithm of evidence and prior together.
    pub weight: f64,
    pub score: Score,
    /// Half the misfit energy that it takes away with what nobody knows of how it was before.
    pub reach: f64,
}

impl Hypothesis {
    pub fn new(candidate: usize, weight: f64, score: Score) -> Self {
        Hypothesis { candidate, weight, reach: score.gain, score }
    }
}

/// Columns of all parts.
pub(super) fn side_by_side(parts: &[&DMatrix<f64>], rows: usize) -> DMatrix<f64> {
    let mut joined = DMatrix::zeros(rows, parts.iter().map(|p| p.ncols()).sum());
    let mut at = 0;
    for part in parts {
        joined.columns_mut(at, part.ncols()).copy_from(part);
        at += part.ncols();
    }
    joined
}

/// Columns behind others of the same rows.
pub(super) fn joined(first: DMatrix<f64>, second: &DMatrix<f64>) -> DMatrix<f64> {
    let at = first.ncols();
    let mut all = first.insert_columns(at, second.ncols(), 0.0);
    all.columns_mut(at, second.ncols()).copy_from(second);
    all
}

/// All effects but one.
pub(super) fn all_but(in_model: &[ModelTerm], but: Option<usize>) -> Vec<ModelTerm> {
    in_model.iter().enumerate().filter(|(i, _)| Some(*i) != but).map(|(_, effect)| effect.clone()).collect()
}

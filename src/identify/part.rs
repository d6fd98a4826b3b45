//! What samples of one recording add to the normal equations, and the form in which that is written.

use nalgebra::{DMatrix, DVector};

use super::replay::PartForm;
use super::tally::{Sums, Tally};
use crate::units::ByQuantity;

/// What one chunk adds, by piece of the model; local columns: six of each dyad, the extras, the terms, the error motions.
pub(crate) struct Part {
    pub pieces: Vec<Option<Piece>>,
    pub loss: f64,
    pub tally: Tally,
}

/// Normal equations of the samples of one pattern of directions.
pub(crate) struct Piece {
    pub matrix: DMatrix<f64>,
    pub gradient: DVector<f64>,
}

impl Part {
    pub fn add(&mut self, other: Part) {
        for (own, other) in self.pieces.iter_mut().zip(other.pieces) {
            match (own, other) {
                (Some(own), Some(other)) => {
                    own.matrix += other.matrix;
                    own.gradient += other.gradient;
                }
                (own, Some(other)) => *own = Some(other),
                (_, None) => {}
            }
        }
        self.loss += other.loss;
        self.tally.add(&other.tally);
    }
}

impl From<Part> for PartForm {
    fn from(part: Part) -> Self {
        let form = |Piece { matrix, gradient }: Piece| {
            let lower = (0..matrix.nrows()).flat_map(|a| (0..=a).map(move |b| (a, b)));
            (lower.map(|at| matrix[at]).collect(), gradient.as_slice().to_vec())
        };
        let Tally { samples, residuals: ByQuantity { m, rad }, down_weighted } = part.tally;
        PartForm {
            pieces: part.pieces.into_iter().map(|piece| piece.map(form)).collect(),
            loss: part.loss,
            samples,
            down_weighted,
            residuals: [m, rad].map(|s| (s.rows, s.squares, s.inliers, s.inlier_squares)),
        }
    }
}

impl From<PartForm> for Part {
    fn from(form: PartForm) -> Self {
        let piece = |(lower, gradient): (Vec<f64>, Vec<f64>)| {
            let at = |a: usize, b: usize| lower.get(a.max(b) * (a.max(b) + 1) / 2 + a.min(b)).copied();
            let size = gradient.len();
            let matrix = DMatrix::from_fn(size, size, |a, b| at(a, b).unwrap_or(f64::NAN));
            Piece { matrix, gradient: DVector::from_vec(gradient) }
        };
        let sums = |(rows, squares, inliers, inlier_squares)| Sums { rows, squares, inliers, inlier_squares };
        let [m, rad] = form.residuals.map(sums);
        let (samples, down_weighted) = (form.samples, form.down_weighted);
        Part {
            pieces: form.pieces.into_iter().map(|own| own.map(piece)).collect(),
            loss: form.loss,
            tally: Tally { samples, residuals: ByQuantity { m, rad }, down_weighted },
        }
    }
}

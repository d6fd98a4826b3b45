//! One step from the triangle of a linear least-squares problem: the solvers of the literature.

use nalgebra::{Cholesky, DMatrix, DVector, QR, SVD};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// How a scheme takes its step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "name", rename_all = "snake_case")]
pub enum Step {
    /// Plain normal equations; refuses what is singular.
    GaussNewton,
    /// `mu = tau max diag(JᵀJ)` in every step.
    Damped {
        /// The factor.
        tau: f64,
    },
    /// The same `mu` in every step (units of `JᵀJ`, lengths in m and angles in rad).
    DampedBy {
        /// The damping.
        mu: f64,
    },
    /// Minimum-norm step along the singular vectors whose value exceeds `cut` times the largest.
    Truncated {
        /// The relative cut.
        cut: f64,
        /// Translations are counted in units of this many metres; 1 is plain m and rad.
        unit_m: f64,
    },
}

/// Singular values below this part of the largest mean that normal equations cannot be solved: their eigenvalues lie in the rounding.
const SINGULAR: f64 = 1e-7;

/// `J x ≈ r` reduced to an upper triangle, sample by sample in fixed memory; unlike normal equations it keeps every digit.
pub(super) struct Triangle {
    /// `[R | Qᵀ r]` above, rows not yet turned in below.
    stack: DMatrix<f64>,
    filled: usize,
}

/// Rows that are turned in together.
const BATCH: usize = 256;

impl Triangle {
    pub fn new(width: usize) -> Self {
        Triangle { stack: DMatrix::zeros(width + 1 + BATCH, width + 1), filled: 0 }
    }

    /// Adds one row and its residual.
    pub fn push(&mut self, row: &[f64], residual: f64) {
        let width = row.len();
        let at = width + 1 + self.filled;
        row.iter().chain([&residual]).enumerate().for_each(|(k, x)| self.stack[(at, k)] = *x);
        self.filled += 1;
        if self.filled == BATCH {
            self.turn_in();
        }
    }

    fn turn_in(&mut self) {
        let width = self.stack.ncols();
        let rows = width + self.filled;
        let r = QR::new(self.stack.rows(0, rows).into_owned()).unpack_r();
        self.stack.fill(0.0);
        self.stack.rows_mut(0, width).copy_from(&r);
        self.filled = 0;
    }

    /// `R` and `Qᵀ r`.
    pub fn finish(mut self) -> (DMatrix<f64>, DVector<f64>) {
        self.turn_in();
        let width = self.stack.ncols() - 1;
        (
            self.stack.view((0, 0), (width, width)).into_owned(),
            self.stack.view((0, width), (width, 1)).column(0).into_owned(),
        )
    }
}

impl Step {
    /// The step for `R x ≈ y`; `is_translation` says so of each parameter.
    ///
    /// # Errors
    /// [`Step::GaussNewton`] where the matrix is singular.
    pub(super) fn solve(
        self,
        r: &DMatrix<f64>,
        y: &DVector<f64>,
        is_translation: impl Fn(usize) -> bool,
    ) -> Result<DVector<f64>> {
        let damping = match self {
            Step::Truncated { cut, unit_m } => {
                let units = DVector::from_fn(y.len(), |k, _| if is_translation(k) { unit_m } else { 1.0 });
                let scaled = DMatrix::from_fn(r.nrows(), r.ncols(), |i, k| r[(i, k)] * units[k]);
                let svd = SVD::new(scaled, true, true);
                let least = cut * svd.singular_values.amax();
                // An SVD that was asked for both factors has them.
                let x = svd.solve(y, least).map_err(|what| singular(what.into()))?;
                return Ok(x.component_mul(&units));
            }
            Step::GaussNewton => {
                let values = r.clone().singular_values();
                let ratio = values.min() / values.amax();
                if ratio.is_nan() || ratio < SINGULAR {
                    return Err(singular(format!("smallest to largest singular value {ratio:.1e}")));
                }
                0.0
            }
            Step::Damped { tau } => {
                tau * r.column_iter().map(|column| column.norm_squared()).fold(0.0, f64::max)
            }
            Step::DampedBy { mu } => mu,
        };
        let mut matrix = r.tr_mul(r);
        (0..matrix.nrows()).for_each(|k| matrix[(k, k)] += damping);
        let cholesky = Cholesky::new(matrix).ok_or_else(|| singular("no Cholesky factor".into()))?;
        Ok(cholesky.solve(&r.tr_mul(y)))
    }
}

fn singular(what: String) -> Error {
    Error::Undetermined {
        what: format!("the normal equations are singular ({what})"),
        mend: "damp or truncate the step: these data do not see every parameter".into(),
    }
}

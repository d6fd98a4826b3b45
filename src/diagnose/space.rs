//! What is known already: geometry and the effects found so far, marginalised out of everything that is judged, `docs/diagnosis.md` (62).

use nalgebra::{Cholesky, DMatrix, DMatrixView, DVector, Dyn, SVD, U1};

/// The precision of whitened rows after columns with Gaussian priors have been marginalised: `M = I - W Wᵀ`.
#[derive(Clone)]
pub(super) struct Space {
    /// `W`, column by column.
    w: DMatrix<f64>,
    /// The same, row by row, for products with many columns.
    wt: DMatrix<f64>,
}

impl Space {
    /// From whitened columns, each times its prior standard deviation.
    pub fn new(columns: DMatrix<f64>) -> Self {
        let used: Vec<usize> =
            (0..columns.ncols()).filter(|c| columns.column(*c).norm_squared() > 1e-20).collect();
        let columns = columns.select_columns(&used);
        if columns.ncols() == 0 {
            return Space { wt: columns.transpose(), w: columns };
        }
        let qr = columns.qr();
        let (q, r) = (qr.q(), qr.r());
        let svd = SVD::new(r, true, false);
        let u = svd.u.expect("asked for");
        let mut turn = u;
        for (j, s) in svd.singular_values.iter().enumerate() {
            let kept = (s * s / (1.0 + s * s)).sqrt();
            turn.column_mut(j).scale_mut(kept);
        }
        let w = q * turn;
        Space { wt: w.transpose(), w }
    }

    /// From its factor `W`.
    pub fn of_factor(w: DMatrix<f64>) -> Self {
        Space { wt: w.transpose(), w }
    }

    /// `W`.
    pub fn factor(&self) -> &DMatrix<f64> {
        &self.w
    }

    /// With further columns, each times its prior standard deviation: `M - M C (I + CᵀM C)⁻¹ CᵀM`.
    pub fn with(&self, columns: &DMatrix<f64>) -> Self {
        if columns.ncols() == 0 {
            return self.clone();
        }
        let mut mc = columns.clone();
        mc.gemm(-1.0, &self.w, &self.along(&columns.as_view()), 1.0);
        let mut inner = gram(columns, &mc);
        (0..inner.nrows()).for_each(|i| inner[(i, i)] += 1.0);
        let Some(factor) = Cholesky::new(inner) else { return self.clone() };
        // W = M C L⁻ᵀ, so that Wᵀ = L⁻¹ (M C)ᵀ.
        let mut back = DMatrix::identity(columns.ncols(), columns.ncols());
        factor.l_dirty().solve_lower_triangular_mut(&mut back);
        let added = back * mc.transpose();
        let (old, new) = (self.wt.nrows(), added.nrows());
        let mut wt = self.wt.clone().resize_vertically(old + new, 0.0);
        wt.rows_mut(old, new).copy_from(&added);
        Space { w: wt.transpose(), wt }
    }

    /// Logarithm of the evidence of further columns, each times its prior standard deviation, with what is left of `y` beside the space.
    pub fn worth(&self, columns: &DMatrix<f64>, left: &DVector<f64>, heat: f64) -> f64 {
        let mut mc = columns.clone();
        mc.gemm(-1.0, &self.w, &self.along(&columns.as_view()), 1.0);
        let mut inner = gram(columns, &mc) / heat;
        (0..inner.nrows()).for_each(|i| inner[(i, i)] += 1.0);
        let Some(factor) = Cholesky::new(inner) else { return 0.0 };
        let toward = columns.tr_mul(left) / heat;
        0.5 * toward.dot(&factor.solve(&toward))
            - factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>()
    }

    /// How many columns `W` has.
    pub fn width(&self) -> usize {
        self.w.ncols()
    }

    /// Adds `Wᵀ x` of columns that are given for some rows from `first` on and are zero elsewhere.
    pub fn add_along(&self, first: usize, part: &DMatrixView<f64, U1, Dyn>, to: &mut DMatrix<f64>) {
        to.gemm(1.0, &self.wt.columns(first, part.nrows()), part, 1.0);
    }

    /// How many parameters it stands for, as far as the rows determine them: the trace of `I - M`.
    pub fn parameters(&self) -> f64 {
        self.w.norm_squared()
    }

    /// `M x`.
    pub fn apply(&self, x: &DVector<f64>) -> DVector<f64> {
        let along = self.w.tr_mul(x);
        let mut out = x.clone();
        out.gemv(-1.0, &self.w, &along, 1.0);
        out
    }

    /// `WᵀC`: what of columns lies in the space.
    pub fn along(&self, c: &DMatrixView<f64>) -> DMatrix<f64> {
        &self.wt * c
    }
}

/// `aᵀ b` of tall matrices, by blocks that stay in a core's cache; nalgebra's `tr_mul` goes column by column.
pub(super) fn gram(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    a.transpose() * b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_added_one_by_one_are_marginalised_as_all_at_once() {
        let column = |seed: f64| DVector::from_fn(50, |i, _| (seed * (i as f64 + 1.0)).sin());
        let all = DMatrix::from_columns(&[column(0.3) * 3.0, column(0.7), column(1.1) * 1e3]);
        let (first, rest) = (all.columns(0, 1).into_owned(), all.columns(1, 2).into_owned());
        let x = column(0.9);
        let at_once = Space::new(all.clone()).apply(&x);
        let in_turn = Space::new(first).with(&rest).apply(&x);
        // M = (I + C Cᵀ)⁻¹, the definition.
        let full = DMatrix::identity(50, 50) + &all * all.transpose();
        let exact = full.lu().solve(&x).expect("regular");
        assert!((&at_once - &exact).amax() < 1e-9, "{}", (&at_once - &exact).amax());
        assert!((&in_turn - &exact).amax() < 1e-9);
    }
}

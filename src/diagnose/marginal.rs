//! What is known already: geometry and the effects found so far, marginalised out of everything that is judged,
//! `docs/diagnosis-method.md` (62).

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DMatrixView, DVector, Dyn, MatrixView, SVD};
use rayon::prelude::*;

use super::panel::{Panel, WIDTH, add_along, take_away};

/// The precision of whitened rows after columns with Gaussian priors have been marginalised: `M = I - W Wᵀ`.
#[derive(Clone, Default)]
pub(super) struct Marginal {
    /// `W`, shared by the spaces that grew from this one.
    panels: Vec<Arc<Panel>>,
}

/// Rows that are turned at once.
const AT_ONCE: usize = 1024;
/// Readings that tell no more of a parameter than this part of what was known beforehand tell nothing.
const UNTOLD: f64 = 1e-9;

impl Marginal {
    /// From whitened columns, each times its prior standard deviation.
    pub fn new(columns: DMatrix<f64>) -> Self {
        let used: Vec<usize> =
            (0..columns.ncols()).filter(|c| columns.column(*c).norm_squared() > 1e-20).collect();
        let columns = columns.select_columns(&used);
        if columns.ncols() == 0 {
            return Marginal::default();
        }
        let qr = columns.qr();
        let (q, r) = (qr.q(), qr.r());
        let svd = SVD::new(r, true, false);
        let u = svd.u.expect("asked for");
        // Geometry has more parameters than readings can tell.
        let told: Vec<usize> = (0..u.ncols()).filter(|j| svd.singular_values[*j].powi(2) > UNTOLD).collect();
        let mut turn = u.select_columns(&told);
        for (j, mut column) in told.iter().zip(turn.column_iter_mut()) {
            let s = svd.singular_values[*j];
            column.scale_mut((s * s / (1.0 + s * s)).sqrt());
        }
        Marginal::default().and(&[turn.transpose() * q.transpose()])
    }

    /// With more columns of `W`, given row by row, some rows after the other.
    fn and(&self, transposed: &[DMatrix<f64>]) -> Self {
        let added = Panel::of_transposed(transposed).into_iter().map(Arc::new);
        Marginal { panels: self.panels.iter().cloned().chain(added).collect() }
    }

    /// On the blocks of a level, as `reduce` puts a panel together.
    pub fn reduced(&self, level: usize, reduce: impl Fn(&Panel) -> Panel) -> Self {
        Marginal { panels: self.panels.iter().map(|panel| panel.reduced(level, &reduce)).collect() }
    }

    /// `W` times an answer, summed over cells of rows: its panels with a row for each cell.
    pub fn gathered(&self, answer: &[f64], cell: &[usize], cells: usize) -> Vec<Arc<Panel>> {
        self.panels.iter().map(|panel| Arc::new(panel.gathered(answer, cell, cells))).collect()
    }

    /// With further columns, each times its prior standard deviation: `M - M C (I + CᵀM C)⁻¹ CᵀM`.
    pub fn with(&self, columns: &DMatrix<f64>) -> Self {
        if columns.ncols() == 0 {
            return self.clone();
        }
        let beside = self.beside(columns);
        let Some(factor) = with_prior(symmetric(columns, &beside)) else { return self.clone() };
        // W = M C L⁻ᵀ, so that Wᵀ = L⁻¹ (M C)ᵀ.
        let count = columns.ncols();
        let mut back = DMatrix::identity(count, count);
        factor.l_dirty().solve_lower_triangular_mut(&mut back);
        let Some(turned) = turned(beside.as_slice(), beside.shape()) else {
            return self.and(&[back * beside.transpose()]);
        };
        let starts: Vec<usize> = (0..beside.nrows()).step_by(AT_ONCE).collect();
        let some = |from: &usize| &back * turned.columns(*from, AT_ONCE.min(beside.nrows() - from));
        self.and(&starts.par_iter().map(some).collect::<Vec<_>>())
    }

    /// Logarithm of the evidence of further columns, each times its prior standard deviation, with what is left of `y` beside the marginal.
    pub fn worth(&self, columns: &DMatrix<f64>, left: &DVector<f64>, overdispersion: f64) -> f64 {
        let gram = square(columns) - square(&self.along(&columns.as_view()));
        worth_of(gram, &columns.tr_mul(left), overdispersion)
    }

    /// What of columns is across to these others: `C - D (DᵀM D)⁻¹ DᵀM C`.
    pub fn across(&self, columns: &DMatrix<f64>, others: &DMatrix<f64>) -> DMatrix<f64> {
        let beside = self.beside(others);
        match gram(others, &beside).pseudo_inverse(UNTOLD) {
            Ok(inverse) => columns - others * (inverse * gram(&beside, columns)),
            Err(_) => columns.clone(),
        }
    }

    /// How many columns `W` has, those included that are zero.
    pub fn width(&self) -> usize {
        self.panels.len() * WIDTH
    }

    /// Adds `Wᵀ x` of columns that are given for some rows from `first` on and are zero elsewhere.
    pub fn add_along(&self, first: usize, part: &DMatrixView<f64>, to: &mut DMatrix<f64>) {
        add_along(&self.panels, first, part, to);
    }

    /// How many parameters it stands for, as far as the rows determine them: the trace of `I - M`.
    pub fn parameters(&self) -> f64 {
        self.panels.iter().map(|panel| panel.norm_squared()).sum()
    }

    /// `M x`.
    pub fn apply(&self, x: &DVector<f64>) -> DVector<f64> {
        let beside = self.beside(&DMatrix::from_column_slice(x.len(), 1, x.as_slice()));
        DVector::from_vec(beside.as_slice().to_vec())
    }

    /// `M C`.
    fn beside(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let mut beside = columns.clone();
        take_away(&self.panels, &self.along(&columns.as_view()), &mut beside);
        beside
    }

    /// `WᵀC`: what of columns lies in the marginal.
    pub fn along(&self, c: &DMatrixView<f64>) -> DMatrix<f64> {
        let mut along = DMatrix::zeros(self.width(), c.ncols());
        self.add_along(0, c, &mut along);
        along
    }
}

/// What rounding makes of the square of a column, as part of it.
const ROUNDING: f64 = 1e-12;

/// Normal equations of columns whose coefficients are expected to be 1 at most, factored; what rounding hides is held back by as much more.
pub(super) fn with_prior(mut gram: DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    (0..gram.nrows()).for_each(|i| gram[(i, i)] += 1.0 + ROUNDING * gram[(i, i)]);
    Cholesky::new(gram)
}

/// Logarithm of the evidence of columns with this Gram matrix beside a marginal, which lead `toward` what that leaves of the residuals.
pub(super) fn worth_of(gram: DMatrix<f64>, toward: &DVector<f64>, overdispersion: f64) -> f64 {
    let Some(factor) = with_prior(gram / overdispersion) else { return 0.0 };
    let toward = toward / overdispersion;
    0.5 * toward.dot(&factor.solve(&toward)) - factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>()
}

/// Products of more rows and columns than this, of both factors, go by blocks.
const WIDE: usize = 5;

/// `aᵀ b` of tall matrices.
pub(super) fn gram(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    turned_times(a.as_slice(), a.shape(), &b.as_view())
}

/// Symmetric products of no more columns than this are computed whole, of more in halves: half of one tells all of it.
const WHOLE: usize = 32;
/// Products of columns with more numbers than this are shared between cores.
const WORTH_SHARING: usize = 1 << 16;

/// `aᵀ a` of tall matrices.
pub(super) fn square(a: &DMatrix<f64>) -> DMatrix<f64> {
    symmetric(a, a)
}

/// The same of columns that lie one behind the other.
pub(super) fn square_of(columns: &[f64], (rows, count): (usize, usize)) -> DMatrix<f64> {
    symmetric_of((columns, columns), rows, (0, count))
}

/// `aᵀ b` of tall matrices where that is symmetric.
fn symmetric(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    symmetric_of((a.as_slice(), b.as_slice()), a.nrows(), (0, a.ncols()))
}

/// `aᵀ b` of so many columns from `from` on, where that is symmetric.
fn symmetric_of((a, b): (&[f64], &[f64]), rows: usize, (from, count): (usize, usize)) -> DMatrix<f64> {
    let times = |of_a: usize, own: usize, of_b: usize, count: usize| {
        let other = DMatrixView::from_slice(&b[of_b * rows..(of_b + count) * rows], rows, count);
        turned_times(&a[of_a * rows..(of_a + own) * rows], (rows, own), &other)
    };
    if count <= WHOLE {
        return times(from, count, from, count);
    }
    // Blocks of eight rows and columns are multiplied at once.
    let first = (count / 2).next_multiple_of(8);
    let (middle, second) = (from + first, count - first);
    let halves = || {
        let half = |from: usize, count: usize| symmetric_of((a, b), rows, (from, count));
        (half(from, first), half(middle, second))
    };
    let rest = || times(middle, second, from, first);
    let ((upper, lower), across) = match rows * count > WORTH_SHARING {
        true => rayon::join(halves, rest),
        false => (halves(), rest()),
    };
    let mut whole = DMatrix::zeros(count, count);
    whole.view_mut((0, 0), (first, first)).copy_from(&upper);
    whole.view_mut((first, first), (second, second)).copy_from(&lower);
    whole.view_mut((first, 0), (second, first)).copy_from(&across);
    whole.view_mut((0, first), (first, second)).tr_copy_from(&across);
    whole
}

/// `aᵀ b`, of `a` the columns as they lie one behind the other: by blocks that stay in a core's cache; nalgebra's `tr_mul` goes column by column.
fn turned_times(columns: &[f64], shape: (usize, usize), b: &DMatrixView<'_, f64>) -> DMatrix<f64> {
    match turned(columns, shape).filter(|_| b.ncols() > WIDE) {
        Some(turned) => turned * b,
        None => DMatrixView::from_slice(columns, shape.0, shape.1).tr_mul(b),
    }
}

/// The transposed of columns that lie one behind the other, without a copy: blocks are packed from them as they lie. `None` of few rows or columns:
/// products with no more than [`WIDE`] of either nalgebra makes column by column, as if rows lay one behind the other, past the end of what is there.
fn turned(columns: &[f64], (rows, count): (usize, usize)) -> Option<MatrixView<'_, f64, Dyn, Dyn, Dyn, Dyn>> {
    (rows.min(count) > WIDE).then(|| {
        MatrixView::from_slice_with_strides_generic(columns, Dyn(count), Dyn(rows), Dyn(rows), Dyn(1))
    })
}

/// Coefficients from normal equations, with their prior.
pub(super) fn solved(gram: DMatrix<f64>, toward: &DVector<f64>) -> Option<DVector<f64>> {
    Some(with_prior(gram)?.solve(toward))
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
        let at_once = Marginal::new(all.clone()).apply(&x);
        let in_turn = Marginal::new(first).with(&rest).apply(&x);
        // M = (I + C Cᵀ)⁻¹, the definition.
        let full = DMatrix::identity(50, 50) + &all * all.transpose();
        let exact = full.lu().solve(&x).expect("regular");
        assert!((&at_once - &exact).amax() < 1e-9, "{}", (&at_once - &exact).amax());
        assert!((&in_turn - &exact).amax() < 1e-9);
    }

    #[test]
    fn products_of_few_rows_or_columns_are_those_of_many() {
        let matrix = |rows, columns| {
            DMatrix::from_fn(rows, columns, |i, k| (1.0 + i as f64 * 0.7 + k as f64 * 1.9).sin())
        };
        for (rows, a, b) in
            (0..9).flat_map(|rows| (1..9).flat_map(move |a| (1..9).map(move |b| (rows, a, b))))
        {
            let (one, other) = (matrix(rows, a), matrix(rows, b));
            let sum = |i: usize, k: usize| one.column(i).dot(&other.column(k));
            let exact = DMatrix::from_fn(a, b, sum);
            assert!((gram(&one, &other) - exact).amax() < 1e-12, "{rows} rows, {a} and {b} columns");
        }
    }

    #[test]
    fn what_is_across_shares_nothing_beside_the_marginal() {
        let column = |seed: f64| DVector::from_fn(50, |i, _| (seed * (i as f64 + 1.0)).sin());
        let marginal = Marginal::new(DMatrix::from_columns(&[column(0.3) * 3.0]));
        // One of the others says nothing, and one of the columns is a sum of theirs.
        let others = DMatrix::from_columns(&[column(0.7), column(1.1), column(0.5) * 0.0]);
        let columns = DMatrix::from_columns(&[column(0.7) - column(1.1) * 2.0, column(0.2)]);
        let across = marginal.across(&columns, &others);
        assert!(gram(&others, &marginal.beside(&across)).amax() < 1e-9);
        assert!(across.column(0).amax() < 1e-9 && across.column(1).amax() > 0.5);
    }
}

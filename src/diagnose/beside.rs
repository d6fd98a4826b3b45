//! Sets of columns beside a marginal by their products alone: what one set leaves of the others is told without another look at the rows,
//! `docs/diagnosis-method.md` (62).

use nalgebra::{DMatrix, DVector};

use super::discrepancy::seen;
use super::equations::Equations;
use super::marginal::{Marginal, square, with_prior, worth_of};
use super::past::Past;
use super::score::Rows;
use super::terms::side_by_side;

/// Products of sets of whitened columns, set by set.
pub(super) struct Beside {
    /// Columns of each set.
    counts: Vec<usize>,
    /// Gram matrix of the columns themselves.
    own: DMatrix<f64>,
    /// Gram matrix of what the marginal leaves of them.
    gram: DMatrix<f64>,
    /// The columns times the residuals that it leaves.
    toward: DVector<f64>,
}

impl Beside {
    /// `left`: what the marginal leaves of the residuals.
    pub fn new(sets: &[&DMatrix<f64>], marginal: &Marginal, left: &DVector<f64>) -> Self {
        let columns = side_by_side(sets, left.len());
        let own = square(&columns);
        let along = marginal.along(&columns.as_view());
        let gram = &own - square(&along);
        let counts = sets.iter().map(|set| set.ncols()).collect();
        Beside { counts, own, gram, toward: columns.tr_mul(left) }
    }

    /// The same where columns of a history are among the first sets, so many from the first on, each set's before its own columns. `scales`: of
    /// the history's columns in each of these.
    pub fn with_past(
        rows: &Rows,
        (past, scales): (&Past, &[f64]),
        sets: &[&DMatrix<f64>],
        marginal: &Marginal,
        left: &DVector<f64>,
    ) -> Self {
        let of_past = [past.before, past.toward.len() - past.before];
        let known: usize = of_past[..scales.len()].iter().sum();
        let columns = side_by_side(sets, left.len());
        let (along, of_own) = (marginal.along(&columns.as_view()), columns.ncols());
        let across = past.across(rows, &columns);
        let across = across.rows(0, known);
        let past_along = past.along.columns(0, known);
        let whole = |known_part: DMatrix<f64>, across: DMatrix<f64>, own: DMatrix<f64>| {
            let mut all = DMatrix::zeros(known + of_own, known + of_own);
            all.view_mut((0, 0), (known, known)).copy_from(&known_part);
            all.view_mut((0, known), (known, of_own)).copy_from(&across);
            all.view_mut((known, 0), (of_own, known)).tr_copy_from(&across);
            all.view_mut((known, known), (of_own, of_own)).copy_from(&own);
            all
        };
        let past_own = past.own.view((0, 0), (known, known)).into_owned();
        let own = square(&columns);
        let gram = whole(
            &past_own - square(&past_along.into_owned()),
            across - past_along.tr_mul(&along),
            &own - square(&along),
        );
        let own = whole(past_own, across.into_owned(), own);
        let mut toward = DVector::zeros(known + of_own);
        toward.rows_mut(0, known).copy_from(&past.toward.rows(0, known));
        toward.rows_mut(known, of_own).copy_from(&columns.tr_mul(left));
        // Set by set.
        let (mut order, mut by, mut counts) = (Vec::new(), Vec::new(), Vec::new());
        let (mut first, mut own_first) = (0, known);
        for (set, columns) in sets.iter().enumerate() {
            let of_past = scales.get(set).map_or(0, |_| of_past[set]);
            order.extend((first..first + of_past).chain(own_first..own_first + columns.ncols()));
            by.extend(vec![scales.get(set).copied().unwrap_or(1.0); of_past]);
            by.extend(vec![1.0; columns.ncols()]);
            counts.push(of_past + columns.ncols());
            (first, own_first) = (first + of_past, own_first + columns.ncols());
        }
        let count = order.len();
        let turned = |of: &DMatrix<f64>| {
            DMatrix::from_fn(count, count, |i, j| by[i] * by[j] * of[(order[i], order[j])])
        };
        let toward = DVector::from_fn(count, |i, _| by[i] * toward[order[i]]);
        Beside { counts, own: turned(&own), gram: turned(&gram), toward }
    }

    /// With the first sets, so many, without the combinations of their columns that noise hides.
    pub fn seen(&self, sets: usize) -> Self {
        let mixture = |(set, at): (usize, usize)| {
            let count = self.counts[set];
            match set < sets {
                true => seen(self.own.view((at, at), (count, count)).into_owned()),
                false => DMatrix::identity(count, count),
            }
        };
        let first = |set: usize| self.counts[..set].iter().sum();
        let each: Vec<DMatrix<f64>> = (0..self.counts.len()).map(|set| mixture((set, first(set)))).collect();
        let counts: Vec<usize> = each.iter().map(|mixture| mixture.ncols()).collect();
        let mut all = DMatrix::zeros(self.own.nrows(), counts.iter().sum());
        let (mut row, mut column) = (0, 0);
        for mixture in &each {
            all.view_mut((row, column), mixture.shape()).copy_from(mixture);
            (row, column) = (row + mixture.nrows(), column + mixture.ncols());
        }
        let mixed = |gram: &DMatrix<f64>| all.tr_mul(&(gram * &all));
        Beside { counts, own: mixed(&self.own), gram: mixed(&self.gram), toward: all.tr_mul(&self.toward) }
    }

    /// Columns of the first set.
    pub fn count(&self) -> usize {
        self.counts[0]
    }

    /// Logarithm of the evidence of the first set, each column times its prior standard deviation.
    pub fn worth(&self, overdispersion: f64) -> f64 {
        let gram = self.gram.view((0, 0), (self.count(), self.count())).into_owned();
        worth_of(gram, &self.toward.rows(0, self.count()).into_owned(), overdispersion)
    }

    /// The other sets beside the marginal with the first one: `B = (I + G₁₁)⁻¹ G₁₂` goes from `G₂₂` as `G₂₁ B`, and from what leads to the
    /// residuals as `Bᵀ g₁`.
    pub fn others(&self) -> Self {
        let (first, rest) = (self.count(), self.toward.len() - self.count());
        let whole = || {
            let own = self.own.view((first, first), (rest, rest)).into_owned();
            let gram = self.gram.view((first, first), (rest, rest)).into_owned();
            Beside {
                counts: self.counts[1..].to_vec(),
                own,
                gram,
                toward: self.toward.rows(first, rest).into_owned(),
            }
        };
        let mut others = whole();
        let gram = self.gram.view((0, 0), (first, first)).into_owned();
        let Some(factor) = with_prior(gram).filter(|_| first > 0) else { return others };
        let across = self.gram.view((0, first), (first, rest)).into_owned();
        let taken = factor.solve(&across);
        others.gram -= across.tr_mul(&taken);
        others.toward -= taken.tr_mul(&self.toward.rows(0, first));
        others
    }

    /// Normal equations of the last set.
    pub fn last(&self) -> Equations {
        let count = self.counts[self.counts.len() - 1];
        let from = self.toward.len() - count;
        let own = |of: &DMatrix<f64>| of.view((from, from), (count, count)).into_owned();
        Equations::new(own(&self.own), own(&self.gram), self.toward.rows(from, count).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_set_leaves_of_others_is_what_the_marginal_with_it_leaves() {
        let columns = |from: usize, count: usize| {
            DMatrix::from_fn(80, count, |i, j| (0.37 * (i as f64 + 1.0) * (from + j + 2) as f64).sin())
        };
        let (known, initial, shape, own) = (columns(0, 3), columns(3, 7), columns(10, 2), columns(12, 2));
        let residual = DVector::from_fn(80, |i, _| (0.9 * i as f64).cos());
        let start = Marginal::new(known);
        let (with_initial, left) = (start.with(&initial), start.apply(&residual));
        let with_both = with_initial.with(&shape);
        let all = Beside::new(&[&initial, &shape, &own], &start, &left);
        assert!((all.worth(1.5) - start.worth(&initial, &left, 1.5)).abs() < 1e-9);
        let others = all.others();
        let of_shape = with_initial.worth(&shape, &with_initial.apply(&residual), 1.5);
        assert!((others.worth(1.5) - of_shape).abs() < 1e-9);
        let Equations { gram, toward, .. } = others.others().last();
        let along = with_both.along(&own.as_view());
        assert!((gram - (own.tr_mul(&own) - along.tr_mul(&along))).amax() < 1e-9);
        assert!((toward - own.tr_mul(&with_both.apply(&residual))).amax() < 1e-9);
        // Mixtures that noise does not hide say the same.
        assert!((all.seen(2).others().worth(1.5) - of_shape).abs() < 1e-9);
    }
}

//! Over what sums are taken: features that rows are made of, `docs/model.md` (14), as few of them as there have to be.
//!
//! At given poses every number of an instrument's rows is a sum of features of the path, times constants, and some features are fixed sums
//! of others: one bar centre sees 14 directions of a five-axis machine's 42, on any path. Sums are taken over a basis alone,
//! `G = Σ φ φᵀ`, and made wide once behind the samples, `Bᵀ G B`. Which features they are shows at general commands, by Gram-Schmidt with
//! the largest first.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand::rngs::StdRng;

use super::gauge::Gauge;
use crate::chain::Moved;
use crate::check::random_command;
use crate::machine::Machine;

/// What is left of a feature beside those before it, over the largest, below which it follows from them: rounding.
const FOLLOWS: f64 = 1e-11;

/// Features, and how rows are made of them.
pub(crate) struct Basis {
    /// Their numbers.
    pub features: Vec<usize>,
    /// One row for each of them, over all columns of a row.
    whole: DMatrix<f64>,
}

impl Basis {
    /// All features that the columns which count have in them.
    pub fn plain(gauge: &Gauge, counts: &[bool]) -> Self {
        let rows = gauge.rows_by_feature();
        let counting: Vec<usize> = (0..counts.len()).filter(|c| counts[*c]).collect();
        let features: Vec<usize> =
            (0..rows.nrows()).filter(|i| counting.iter().any(|c| rows[(*i, *c)] != 0.0)).collect();
        let mut whole = DMatrix::zeros(features.len(), counts.len());
        for (k, feature) in features.iter().enumerate() {
            counting.iter().for_each(|c| whole[(k, *c)] = rows[(*feature, *c)]);
        }
        Basis { features, whole }
    }

    /// A basis of them.
    pub fn of(gauge: &Gauge, machine: &Machine, counts: &[bool]) -> Self {
        let Basis { features: open, whole: by_feature } = Basis::plain(gauge, counts);
        let seen = in_general(gauge, machine, &open);
        let scale: Vec<f64> = seen.column_iter().map(|x| x.norm()).collect();
        let largest = scale.iter().copied().fold(0.0, f64::max);
        // What is nothing but rounding has no part in it.
        let is_there: Vec<bool> = scale.iter().map(|x| *x > f64::EPSILON * largest).collect();
        let mut left = seen;
        for (mut column, (scale, is_there)) in left.column_iter_mut().zip(scale.iter().zip(&is_there)) {
            column.scale_mut(if *is_there { scale.recip() } else { 0.0 });
        }
        // How much of each unit vector found so far is in each column.
        let (mut found, mut amounts): (Vec<usize>, Vec<DVector<f64>>) = (Vec::new(), Vec::new());
        let mut squares = DVector::from_iterator(left.ncols(), left.column_iter().map(|x| x.norm_squared()));
        while found.len() < left.ncols() {
            let (next, square) = squares.argmax();
            if square.sqrt() < FOLLOWS {
                break;
            }
            let unit = left.column(next).normalize();
            let amount = left.tr_mul(&unit);
            left.ger(-1.0, &unit, &amount, 1.0);
            found.push(next);
            for (i, column) in left.column_iter().enumerate() {
                squares[i] = if found.contains(&i) { 0.0 } else { column.norm_squared() };
            }
            amounts.push(amount);
        }
        let rank = found.len();
        let upper = DMatrix::from_fn(rank, rank, |k, l| if k <= l { amounts[k][found[l]] } else { 0.0 });
        let all = DMatrix::from_fn(rank, open.len(), |k, i| amounts[k][i]);
        let mut solved = upper.solve_upper_triangular(&all).unwrap_or(all);
        for (i, scale_i) in scale.iter().enumerate() {
            let own = found.iter().position(|f| *f == i);
            for (k, base) in found.iter().enumerate() {
                solved[(k, i)] = match own {
                    Some(own) => f64::from(u8::from(own == k)),
                    None => solved[(k, i)] * scale_i / scale[*base],
                };
            }
        }
        Basis { features: found.iter().map(|i| open[*i]).collect(), whole: solved * by_feature }
    }

    /// Sums over the basis, as sums over all columns of a row.
    pub fn widened(&self, matrix: &DMatrix<f64>, gradient: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
        (self.whole.tr_mul(&(matrix * &self.whole)), self.whole.tr_mul(gradient))
    }
}

/// These features at random commands within limits, a column for each, more rows than columns.
fn in_general(gauge: &Gauge, machine: &Machine, features: &[usize]) -> DMatrix<f64> {
    let mut rng = StdRng::seed_from_u64(20_261_125);
    let (commands, state) = (machine.commands().len(), gauge.state(0.0));
    let mut all = vec![0.0; gauge.feature_count()];
    let mut seen = DMatrix::zeros(features.len() + 8, features.len());
    let mut moved = vec![Moved::none(0.0); gauge.joint_count().max(1)];
    for (n, mut row) in seen.row_iter_mut().enumerate() {
        let q: Vec<f64> = (0..commands).map(|c| random_command(machine, c, &mut rng)).collect();
        let p_w = gauge.go_to(&q, &state, &mut moved);
        let (_, n_w) = gauge.reading(n % gauge.reading_count(), p_w, &state);
        gauge.features(n_w, p_w, 1.0, &moved, &mut all[..]);
        row.iter_mut().zip(features).for_each(|(to, feature)| *to = all[*feature]);
    }
    seen
}

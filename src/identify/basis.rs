//! Which columns of a row the others follow from: one bar centre sees 14 directions of a five-axis machine's 42, on any path.
//!
//! At given poses every column of an instrument's rows is a function of the commands, and some are fixed sums of others: those are left
//! out while sums are taken over samples, `G = Σ rᵀ r` over the basis alone, and made from them once behind it, `Bᵀ G B`. Which they
//! are shows on rows at general commands, by Gram-Schmidt with the largest column first.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand::rngs::StdRng;

use super::gauge::Gauge;
use crate::chain::Moved;
use crate::check::random_command;
use crate::machine::Machine;

/// What is left of a column beside those before it, over the largest, below which it follows from them: rounding.
const FOLLOWS: f64 = 1e-11;

/// Columns, and how all others follow from them.
pub(crate) struct Basis {
    /// Their numbers in a row.
    pub columns: Vec<usize>,
    /// One row for each of them, over all columns; none where they are all that counts.
    whole: Option<DMatrix<f64>>,
    width: usize,
}

impl Basis {
    /// The columns that count, as they are.
    pub fn plain(counts: &[bool]) -> Self {
        let columns = (0..counts.len()).filter(|i| counts[*i]).collect();
        Basis { columns, whole: None, width: counts.len() }
    }

    /// A basis of the columns that count.
    pub fn of(gauge: &Gauge, machine: &Machine, counts: &[bool]) -> Self {
        let rows = general_rows(gauge, machine);
        let scale: Vec<f64> = (0..counts.len()).map(|c| rows.column(c).norm()).collect();
        let largest = scale.iter().copied().fold(0.0, f64::max);
        let open: Vec<usize> =
            (0..counts.len()).filter(|c| counts[*c] && scale[*c] > f64::EPSILON * largest).collect();
        let mut left: Vec<DVector<f64>> = open.iter().map(|c| rows.column(*c) / scale[*c]).collect();
        // How much of each unit vector found so far is in each column.
        let (mut found, mut amounts): (Vec<usize>, Vec<DVector<f64>>) = (Vec::new(), Vec::new());
        let mut squares = DVector::from_iterator(left.len(), left.iter().map(|x| x.norm_squared()));
        while !left.is_empty() {
            let (next, square) = squares.argmax();
            if square.sqrt() < FOLLOWS {
                break;
            }
            let unit = left[next].normalize();
            let amount = DVector::from_iterator(left.len(), left.iter().map(|x| x.dot(&unit)));
            for (i, column) in left.iter_mut().enumerate() {
                column.axpy(-amount[i], &unit, 1.0);
                squares[i] = if found.contains(&i) { 0.0 } else { column.norm_squared() };
            }
            squares[next] = 0.0;
            found.push(next);
            amounts.push(amount);
        }
        let rank = found.len();
        let upper = DMatrix::from_fn(rank, rank, |k, l| if k <= l { amounts[k][found[l]] } else { 0.0 });
        let all = DMatrix::from_fn(rank, open.len(), |k, i| amounts[k][i]);
        let solved = upper.solve_upper_triangular(&all).unwrap_or(all);
        let mut whole = DMatrix::zeros(rank, counts.len());
        for (i, column) in open.iter().enumerate() {
            for (k, base) in found.iter().enumerate() {
                whole[(k, *column)] = match found.iter().position(|f| *f == i) {
                    Some(own) => f64::from(u8::from(own == k)),
                    None => solved[(k, i)] * scale[*column] / scale[open[*base]],
                };
            }
        }
        let columns = found.iter().map(|i| open[*i]).collect();
        Basis { columns, whole: Some(whole), width: counts.len() }
    }

    /// Sums over the basis, as sums over all columns.
    pub fn widened(&self, matrix: &DMatrix<f64>, gradient: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
        if let Some(whole) = &self.whole {
            return (whole.tr_mul(&(matrix * whole)), whole.tr_mul(gradient));
        }
        let (mut wide, mut long) = (DMatrix::zeros(self.width, self.width), DVector::zeros(self.width));
        for (a, to_a) in self.columns.iter().enumerate() {
            long[*to_a] = gradient[a];
            for (b, to_b) in self.columns.iter().enumerate() {
                wide[(*to_a, *to_b)] = matrix[(a, b)];
            }
        }
        (wide, long)
    }
}

/// Rows at random commands within limits, more of them than columns.
fn general_rows(gauge: &Gauge, machine: &Machine) -> DMatrix<f64> {
    let mut rng = StdRng::seed_from_u64(20_261_125);
    let (width, commands, state) = (gauge.width(), machine.commands().len(), gauge.state(0.0));
    let mut rows = DMatrix::zeros(width, width + 8);
    let mut moved = vec![Moved::none(0.0); gauge.joint_count().max(1)];
    for (n, mut row) in rows.column_iter_mut().enumerate() {
        let q: Vec<f64> = (0..commands).map(|c| random_command(machine, c, &mut rng)).collect();
        let p_w = gauge.go_to(&q, &state, &mut moved);
        let (_, n_w) = gauge.reading(n % gauge.reading_count(), p_w, &state);
        gauge.row(n_w, p_w, 1.0, &moved, row.as_mut_slice());
    }
    rows.transpose()
}

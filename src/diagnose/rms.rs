//! What is left of the samples of a search: root mean squares, and squares of each stretch.

use std::collections::BTreeMap;

use super::search::Search;
use crate::units::{ByQuantity, Quantity};

/// Squares of what is left of each recording's stretches, m^2 and rad^2.
#[derive(Clone, Debug, Default)]
pub(super) struct LeftOut(BTreeMap<(usize, usize), ByQuantity<f64>>);

impl LeftOut {
    /// Takes what is left of one row.
    pub fn add(&mut self, recording: usize, stretch: usize, quantity: Quantity, left: f64) {
        self.0.entry((recording, stretch)).or_default()[quantity] += left.powi(2);
    }

    /// By how much these are less than those of another model, in parts of all of them, and the standard error of that.
    pub fn fall_from(&self, other: &LeftOut) -> (f64, f64) {
        let sums = ByQuantity::of(|quantity| {
            other.0.values().map(|squares| squares[quantity]).sum::<f64>().max(f64::MIN_POSITIVE)
        });
        let fall = |(stretch, before): (&(usize, usize), &ByQuantity<f64>)| {
            let after = self.0.get(stretch).copied().unwrap_or_default();
            (before.m - after.m) / sums.m + (before.rad - after.rad) / sums.rad
        };
        sum_and_error(&other.0.iter().map(fall).collect::<Vec<f64>>())
    }
}

/// The sum of what stretches have each, and its standard error from how much they differ.
pub(super) fn sum_and_error(of_stretches: &[f64]) -> (f64, f64) {
    let (count, sum) = (of_stretches.len() as f64, of_stretches.iter().sum::<f64>());
    let spread = of_stretches.iter().map(|x| (x - sum / count).powi(2)).sum::<f64>() / (count - 1.0);
    (sum, (count * spread).sqrt())
}

/// Root mean square over samples of the norm of residual lengths or angles.
pub(super) fn rms_of(search: &Search, residual: &[f64], angle: bool) -> Option<f64> {
    let all: Vec<usize> = (0..residual.len()).collect();
    rms_of_rows(search, residual, angle, &all)
}

/// The same over these rows.
pub(super) fn rms_of_rows(search: &Search, residual: &[f64], angle: bool, rows: &[usize]) -> Option<f64> {
    let linear = search.rows.linear;
    let rows = || rows.iter().copied().filter(|row| linear.angle[*row] == angle);
    let mut samples: Vec<usize> = rows().map(|row| linear.sample[row]).collect();
    samples.dedup();
    let squares: f64 = rows().map(|row| residual[row] * residual[row]).sum();
    (!samples.is_empty()).then(|| (squares / samples.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::LeftOut;
    use crate::units::Quantity;

    #[test]
    fn one_stretch_alone_is_worth_one_standard_error_however_much_is_left_there() {
        let of = |lefts: [f64; 5]| {
            let mut all = LeftOut::default();
            for (stretch, left) in lefts.into_iter().enumerate() {
                all.add(0, stretch, Quantity::Length, left);
            }
            all
        };
        for left in [2.0, 100.0] {
            let (fall, error) = of([1.0; 5]).fall_from(&of([1.0, 1.0, 1.0, 1.0, left]));
            assert!((fall / error - 1.0).abs() < 1e-12, "{left}");
        }
        let (fall, error) = of([1.0; 5]).fall_from(&of([2.0; 5]));
        assert!((fall - 0.75).abs() < 1e-12 && error < 1e-12);
    }
}

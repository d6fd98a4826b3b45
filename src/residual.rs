//! How large residuals are: sums over samples, from which root mean square, mean and largest follow.

use crate::units::{ByQuantity, Rms};

/// Sums over the Euclidean norms of residuals of one quantity, m or rad.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sizes {
    count: u64,
    squares: f64,
    largest: f64,
    /// Of the norms.
    total: f64,
    /// The same, but of scalars with their sign.
    signed: f64,
}

impl Sizes {
    /// The sums that belong to these figures of `count` samples.
    pub(crate) fn of(count: u64, rms: f64, mean: f64, largest: f64) -> Self {
        let n = count as f64;
        Sizes { count, squares: n * rms * rms, largest, total: n * mean, signed: n * mean }
    }

    /// One sample more.
    pub(crate) fn take(&mut self, residual: &[f64]) {
        let norm = residual.iter().map(|r| r * r).sum::<f64>().sqrt();
        let signed = if let [scalar] = residual { *scalar } else { norm };
        self.add(&Sizes { count: 1, squares: norm * norm, largest: norm, total: norm, signed });
    }

    pub(crate) fn add(&mut self, other: &Sizes) {
        self.count += other.count;
        self.squares += other.squares;
        self.largest = self.largest.max(other.largest);
        self.total += other.total;
        self.signed += other.signed;
    }

    fn over(&self, sum: f64) -> Option<f64> {
        (self.count > 0).then(|| sum / self.count as f64)
    }
}

impl ByQuantity<Sizes> {
    pub(crate) fn add(&mut self, other: &Self) {
        self.m.add(&other.m);
        self.rad.add(&other.rad);
    }

    /// Samples; of a pose, each counts for length and angle.
    pub(crate) fn samples(&self) -> u64 {
        self.m.count.max(self.rad.count)
    }

    pub(crate) fn rms(&self) -> Rms {
        self.map(|s| s.over(s.squares).map(f64::sqrt))
    }

    pub(crate) fn largest(&self) -> Rms {
        self.map(|s| (s.count > 0).then_some(s.largest))
    }

    /// Mean of the norms.
    pub(crate) fn mean(&self) -> Rms {
        self.map(|s| s.over(s.total))
    }

    /// Mean of scalars with their sign, of the norms of vectors.
    pub(crate) fn mean_signed(&self) -> Rms {
        self.map(|s| s.over(s.signed))
    }
}

//! How large the residuals of a pass are, summed up.

use crate::units::ByQuantity;

/// Samples with a smaller weight say nothing about the noise.
pub(super) const COUNTS: f64 = 0.25;

/// Sums over residuals of one quantity.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    /// Scalar rows, and the sum of their squares, m² or rad², unweighted.
    pub rows: u64,
    pub squares: f64,
    /// The same over the samples that count.
    pub inliers: u64,
    pub inlier_squares: f64,
}

impl Sums {
    fn add(&mut self, o: &Sums) {
        self.rows += o.rows;
        self.squares += o.squares;
        self.inliers += o.inliers;
        self.inlier_squares += o.inlier_squares;
    }
}

/// Sums over one source's samples that people read.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    pub samples: u64,
    pub residuals: ByQuantity<Sums>,
    /// Samples whose weight is below one half.
    pub down_weighted: u64,
}

impl Tally {
    pub fn add(&mut self, o: &Tally) {
        self.samples += o.samples;
        self.residuals.m.add(&o.residuals.m);
        self.residuals.rad.add(&o.residuals.rad);
        self.down_weighted += o.down_weighted;
    }
}

//! Candidates that are waves of one period, with overtones of it.

use super::candidate::{Candidate, Parameter};
use crate::feature::Dimension;

/// Periods are one another's half to within this.
const EQUAL: f64 = 0.01;

impl Candidate {
    /// Its period or its number of periods in a turn, if it has no other parameter and its features are sines and cosines.
    fn wave(&self) -> Option<&Parameter> {
        let is_wave = self.features.iter().all(|f| f.wave().is_some());
        self.parameters.first().filter(|_| is_wave && self.parameters.len() == 1)
    }

    /// Whether a wave's overtone is within its family's range too: what is finer than positions lie apart looks like something coarse.
    pub(crate) fn has_overtones(&self, at: &[f64]) -> bool {
        match self.wave() {
            Some(order) if order.dimension == Dimension::ONE => order.whole || 2.0 * at[0] <= order.range.1,
            Some(period) if [Dimension::LENGTH, Dimension::ANGLE].contains(&period.dimension) => {
                0.5 * at[0] >= period.range.0
            }
            _ => true,
        }
    }

    /// Whether the first of two waves has half the second one's period, and so is its overtone.
    pub(crate) fn is_half(&self, finer: &[f64], coarser: &[f64]) -> bool {
        self.wave().filter(|_| self.features.len() > 2).is_some_and(|parameter| {
            let is_period =
                [Dimension::LENGTH, Dimension::ANGLE, Dimension::TIME].contains(&parameter.dimension);
            let ratio = if is_period { coarser[0] / finer[0] } else { finer[0] / coarser[0] };
            (0.5 * ratio - 1.0).abs() < EQUAL
        })
    }
}

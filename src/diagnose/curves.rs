//! Columns of samples that shapes and whereabouts are made of.

use crate::feature::{JointSamples, Samples};

/// What the samples of all stretches say of one joint; nothing of a stretch that does not know it.
pub(super) fn column(stretches: &[Samples], j: usize, pick: impl Fn(&JointSamples) -> &Vec<f64>) -> Vec<f64> {
    let one = |s: &Samples| s.joints[j].as_ref().map(|c| pick(c).clone()).unwrap_or_default();
    stretches.iter().flat_map(one).collect()
}

/// Sample by sample.
pub(super) fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

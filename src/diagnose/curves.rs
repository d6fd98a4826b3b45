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

/// Sum of squares, several at once: each sum waits for the one before it.
pub(super) fn squares(x: &[f64]) -> f64 {
    let (eights, rest) = x.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for eight in eights {
        sums.iter_mut().zip(eight).for_each(|(sum, x)| *sum += x * x);
    }
    sums.iter().sum::<f64>() + rest.iter().map(|x| x * x).sum::<f64>()
}

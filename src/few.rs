//! Columns that are short: a value for each joint, axis or command of one machine.

use smallvec::SmallVec;

/// As many as most machines have need no memory of their own.
pub(crate) type Few<T> = SmallVec<[T; 8]>;

/// What `of` makes of each pair: written in the place of a copy, which is quicker than to collect them one by one.
pub(crate) fn pairwise(a: &[f64], b: &[f64], of: impl Fn(f64, f64) -> f64) -> Few<f64> {
    let mut made = Few::from_slice(a);
    made.iter_mut().zip(b).for_each(|(a, b)| *a = of(*a, *b));
    made
}

//! Root mean squares over the samples of a search.

use super::diagnosis::RmsByModel;
use super::search::Search;
use crate::identify::BeforeAfter;

pub(super) fn by_model(fit: Option<BeforeAfter>, last: Option<f64>) -> Option<RmsByModel> {
    let (fit, last) = (fit?, last?);
    Some(RmsByModel { nominal: fit.nominal, geometric: fit.geometric, r#final: last })
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

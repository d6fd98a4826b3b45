//! Samples that are no measurement of the machine: stale channels, lost reflectors, slips of a decimal point.
//!
//! They are left out of everything that is judged, and told.

use super::diagnosis::{Diagnosis, Outliers, WithoutOutliers};
use super::rms::rms_of;
use super::search::Search;
use crate::units::{ByQuantity, Quantity};

/// A reading that was left out counts as an outlier beyond so many standard deviations of the noise, and of what is left of others.
const FAR: f64 = 6.0;

/// Puts them into the diagnosis. `geometric`, `left`: residuals with constant deviations and with everything found, m and rad.
pub(super) fn fill(search: &Search, geometric: &[f64], left: &[f64], diagnosis: &mut Diagnosis) {
    let linear = search.rows.linear;
    let others = |angle: bool| {
        let rows =
            (0..left.len()).filter(|row| linear.angle[*row] == angle && !search.rows.whitener.out[*row]);
        let squares: Vec<f64> = rows.map(|row| left[row] * left[row]).collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    };
    let waiting = super::noise::waiting(linear);
    let others = ByQuantity::of(|quantity| others(quantity == Quantity::Angle));
    let floor = diagnosis.noise_floor;
    let scatter = |row: usize| {
        let quantity = if linear.angle[row] { Quantity::Angle } else { Quantity::Length };
        floor[quantity].map(|sigma| sigma.max(others[quantity]))
    };
    let is_far = |row: &usize| {
        search.rows.whitener.out[*row]
            && !waiting[*row]
            && scatter(*row).is_some_and(|sigma| left[*row].abs() > FAR * sigma)
    };
    let mut all = Vec::new();
    let mut without: Vec<usize> = Vec::new();
    for span in &linear.spans {
        let far: Vec<usize> = (span.rows.0..span.rows.1).filter(is_far).collect();
        let mut samples: Vec<usize> = far.iter().map(|row| linear.sample[*row]).collect();
        samples.dedup();
        if samples.is_empty() {
            continue;
        }
        let largest = |angle: bool| {
            let own = far.iter().filter(|row| linear.angle[**row] == angle).map(|row| left[*row].abs());
            own.max_by(f64::total_cmp)
        };
        all.push(Outliers {
            recording: span.label.clone(),
            lines: samples.iter().map(|sample| linear.lines[*sample]).collect(),
            largest: ByQuantity::of(|quantity| largest(quantity == Quantity::Angle)),
        });
        without.extend(samples);
    }
    if all.is_empty() {
        return;
    }
    let kept = |residual: &[f64], angle: bool| {
        let rows = residual.iter().zip(&linear.sample);
        let zeroed: Vec<f64> =
            rows.map(|(x, sample)| if without.contains(sample) { 0.0 } else { *x }).collect();
        let count = linear.lines.len() as f64;
        rms_of(search, &zeroed, angle)
            .map(|rms| rms * (count / (count - without.len() as f64).max(1.0)).sqrt())
    };
    let both = |angle: bool| {
        Some(WithoutOutliers { geometric: kept(geometric, angle)?, r#final: kept(left, angle)? })
    };
    diagnosis.rms_without_outliers = ByQuantity::of(|quantity| both(quantity == Quantity::Angle));
    diagnosis.outliers = all;
}

//! Structure along a joint's travel that no family's shape is needed for: is what is left a function of where the joint stands?
//!
//! Settled positions follow each other in no order, so that nothing smooth runs through them; but an error of a joint's own motion is one
//! function of its position, whatever that looks like, `docs/diagnosis-method.md` (65).

use nalgebra::{DMatrix, DVector};

use super::marginal::{Marginal, gram};
use super::search::Search;
use crate::machine::Machine;
use crate::variation::Slot;

/// Hats along the travel: at most so many, each over so many samples at least.
const HATS: usize = 24;
const SAMPLES: usize = 12;
/// Combinations that the rows see by less than this part of the best are left aside.
const SEEN: f64 = 1e-6;

/// A joint whose own motion, as any function of its position, takes up what is left.
#[derive(Clone, Copy, Debug)]
pub(super) struct Along {
    /// Index of the dyad.
    pub joint: usize,
    /// Energy that it takes up, less what chance would.
    pub energy: f64,
    /// How many standard deviations of chance that is.
    pub beyond: f64,
}

/// The joint of which that stands out most.
pub(super) fn along_travel(search: &Search, machine: &Machine, marginal: &Marginal) -> Option<Along> {
    let left = marginal.apply(&search.rows.residual);
    let all = machine.joints().filter_map(|(j, joint)| {
        let columns = hats(search, j, Slot::Before(j), joint.twist())?;
        let toward = columns.tr_mul(&left);
        let beside = gram(&columns, &columns) - {
            let along = marginal.along(&columns.as_view());
            along.tr_mul(&along)
        };
        let eigen = beside.symmetric_eigen();
        let most = eigen.eigenvalues.max();
        let seen: Vec<usize> = (0..toward.len()).filter(|i| eigen.eigenvalues[*i] > SEEN * most).collect();
        let taken = |i: &usize| eigen.eigenvectors.column(*i).dot(&toward).powi(2) / eigen.eigenvalues[*i];
        let (energy, count) = (seen.iter().map(taken).sum::<f64>(), seen.len() as f64);
        (count > 0.0).then(|| Along {
            joint: j,
            energy: energy - count,
            beyond: (energy - count) / (2.0 * count).sqrt(),
        })
    });
    all.max_by(|a, b| a.beyond.total_cmp(&b.beyond))
}

/// Whitened answers to the joint's own motion, times hats over its travel with as many samples each.
fn hats(search: &Search, j: usize, slot: Slot, twist: crate::lie::Twist<f64>) -> Option<DMatrix<f64>> {
    let linear = search.rows.linear;
    let mut position = Vec::with_capacity(linear.lines.len());
    for samples in &linear.samples {
        position.extend(&samples.joints[j].as_ref()?.position);
    }
    let mut sorted = position.clone();
    sorted.sort_by(f64::total_cmp);
    let count = (position.len() / SAMPLES).min(HATS);
    if count < 3 {
        return None;
    }
    let mut knots: Vec<f64> = (0..count).map(|k| sorted[k * (sorted.len() - 1) / (count - 1)]).collect();
    knots.dedup();
    if knots.len() < 3 {
        return None;
    }
    let answer = search.rows.answer(slot, twist);
    let mut columns = DMatrix::zeros(linear.residual.len(), knots.len());
    for (row, sample) in linear.sample.iter().enumerate() {
        let x = position[*sample];
        let right = knots.partition_point(|knot| *knot < x).clamp(1, knots.len() - 1);
        let part = ((x - knots[right - 1]) / (knots[right] - knots[right - 1])).clamp(0.0, 1.0);
        columns[(row, right - 1)] = answer[row] * (1.0 - part);
        columns[(row, right)] = answer[row] * part;
    }
    let lengths: DVector<f64> = DVector::from_iterator(knots.len(), columns.column_iter().map(|c| c.norm()));
    for (mut column, length) in columns.column_iter_mut().zip(lengths.iter()) {
        column /= length.max(f64::MIN_POSITIVE);
    }
    search.rows.whiten(&mut columns);
    Some(columns)
}

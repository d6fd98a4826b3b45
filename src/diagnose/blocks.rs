//! Candidates screened on blocks of samples, `coarse.rs`.

use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixViewMut, DVector};

use super::coarse::Level;
use super::equations::{BATCH, Best, Equations, best, judge, key, lengths};
use super::features::{AtPoint, Features};
use super::marginal::Marginal;
use super::score::{Field, Rows};
use crate::effects::Candidate;
use crate::lie::Twist;
use crate::variation::Slot;

/// Where features vanish on all but this part of the samples, only those are looked at.
const SPARSE: f64 = 0.3;

impl Rows<'_> {
    /// Fills the table at these points of the grid on the blocks of a level: all rows at once where features act everywhere, else those
    /// rows alone where they act.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn coarse_table(
        &self,
        candidate: &Candidate,
        grid: &[Vec<f64>],
        field: &Field,
        (number, kept): (usize, &Features),
        overdispersion: f64,
        points: &[usize],
        table: &mut [Option<Best>],
    ) {
        let (k, lengths) = (candidate.coefficients.len(), lengths(candidate));
        let usual = self.usual_sizes(candidate, grid);
        let level = &self.coarse.levels()[number];
        let (marginal, left) = self.on_level(field, number);
        let answers: Vec<Vec<Arc<Vec<f64>>>> = (candidate.coefficients.iter())
            .map(|c| c.parts.iter().map(|p| self.coarse_answer(number, p.slot, p.direction)).collect())
            .collect();
        let mut everywhere = Vec::new();
        let mut columns = DMatrix::zeros(left.len(), k);
        for i in points {
            let Some(features) = kept.at(*i) else { continue };
            if features.part() > SPARSE {
                everywhere.push(*i);
                continue;
            }
            let count = on_blocks(candidate, level, &answers, &features, &mut columns.as_view_mut(), false);
            let own = columns.rows(0, count);
            let (mut along, mut g, mut from) = (DMatrix::zeros(marginal.width(), k), DVector::zeros(k), 0);
            for run in features.runs {
                let (first, rows) = level.rows(*run);
                let part = own.rows(from, rows);
                marginal.add_along(first, &part, &mut along);
                g += part.tr_mul(&left.rows(first, rows));
                from += rows;
            }
            let equations = Equations::of(&own, &along.as_view(), g);
            table[*i] = Some(best(candidate, &grid[*i], &lengths, &equations, overdispersion, usual));
        }
        for batch in everywhere.chunks((BATCH / (k * left.len()).max(1)).max(1)) {
            let mut joined = DMatrix::zeros(left.len(), k * batch.len());
            for (b, i) in batch.iter().enumerate() {
                let Some(features) = kept.at(*i) else { continue };
                on_blocks(candidate, level, &answers, &features, &mut joined.columns_mut(b * k, k), true);
            }
            judge((&joined, k), marginal, left, batch, &mut |i, equations| {
                table[i] = Some(best(candidate, &grid[i], &lengths, equations, overdispersion, usual));
            });
        }
    }

    /// Marginal and residuals on the blocks of a level.
    pub(super) fn on_level<'f>(&self, field: &'f Field, number: usize) -> &'f (Marginal, DVector<f64>) {
        let level = &self.coarse.levels()[number];
        field.coarse[number].get_or_init(|| {
            if level.is_all() {
                return ((*field.marginal).clone(), field.left.clone());
            }
            let marginal = field.marginal.reduced(number, |panel| level.reduce_panel(panel));
            (marginal, DVector::from_vec(level.reduce(field.left.as_slice())))
        })
    }

    /// How the readings answer to a twist in a slot, whitened, on the blocks of a level.
    pub(super) fn coarse_answer(&self, level: usize, slot: Slot, direction: Twist<f64>) -> Arc<Vec<f64>> {
        let key = (level, key(slot, direction));
        if let Some(known) = self.coarse_columns.lock().ok().and_then(|map| map.get(&key).cloned()) {
            return known;
        }
        let (white, on) = (self.white_answer(slot, direction), &self.coarse.levels()[level]);
        let column = if on.is_all() { white } else { Arc::new(on.reduce(&white)) };
        if let Ok(mut map) = self.coarse_columns.lock() {
            map.insert(key, column.clone());
        }
        column
    }
}

/// Whitened columns of a candidate over the blocks where its features act, run after run, or each row in its place; how many rows that are.
fn on_blocks(
    candidate: &Candidate,
    level: &Level,
    answers: &[Vec<Arc<Vec<f64>>>],
    features: &AtPoint,
    to: &mut DMatrixViewMut<f64>,
    in_place: bool,
) -> usize {
    let mut count = 0;
    for (c, coefficient) in candidate.coefficients.iter().enumerate() {
        let unit = features.unit(coefficient);
        let mut column = to.column_mut(c);
        let column = column.as_mut_slice();
        for (p, (part, answer)) in coefficient.parts.iter().zip(&answers[c]).enumerate() {
            let (mut row, mut at) = (0, 0);
            for run in features.runs {
                let (first, rows) = level.rows(*run);
                let feature = &features.columns[part.feature][at..at + run.1];
                let (own, samples) = (first..first + rows, &level.sample[first..first + rows]);
                let to = if in_place { first } else { row };
                let both = column[to..to + rows].iter_mut().zip(&answer[own]);
                let put = |x: &mut f64, answer: &f64, feature: f32| {
                    let more = answer * f64::from(feature) * unit;
                    *x = if p == 0 { more } else { *x + more };
                };
                // One reading a sample: a row is its sample.
                match rows == run.1 {
                    true => both.zip(feature).for_each(|((x, answer), f)| put(x, answer, *f)),
                    false => both
                        .zip(samples)
                        .for_each(|((x, answer), sample)| put(x, answer, feature[sample - run.0])),
                }
                (row, at) = (row + rows, at + run.1);
            }
            count = row;
        }
    }
    count
}

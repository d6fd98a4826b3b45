//! Histories that hypotheses at a joint share: what their columns say is made once for all of them, `docs/diagnosis-method.md` (66).

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, DVectorView};

use super::discrepancy::{self, Unmixed, past_curves, whitened};
use super::equations::{Column, key};
use super::marginal::square;
use super::past::Past;
use super::score::{Field, Rows};
use super::terms::{ModelTerm, side_by_side};
use crate::effects::Candidate;

impl Past {
    /// What an effect has of a history that others have too, beside a field, and how many of its features have it; `None` of histories of its own,
    /// and where directions are mixed.
    pub fn of(
        rows: &Rows,
        candidate: &Candidate,
        in_model: &ModelTerm,
        field: &Field,
    ) -> Option<(Arc<Past>, usize)> {
        let (j, lasts, features) = discrepancy::history(candidate)?;
        let directions = discrepancy::directions(candidate, in_model);
        if directions.len() > discrepancy::MOST_DIRECTIONS {
            return None;
        }
        let name = (directions.iter().map(|(slot, d)| key(*slot, *d)).collect(), j, lasts);
        // Never held while other work is done: a thread may take another's up meanwhile.
        if let Some(known) = field.pasts.lock().ok().and_then(|map| map.get(&name).cloned()) {
            return Some((known, features));
        }
        let curves = past_curves(rows.linear, (j, lasts))?;
        let answers = directions.into_iter().map(|(slot, d)| rows.answer(slot, d)).collect();
        let past = Arc::new(Past::new(rows, answers, curves, field));
        if let Ok(mut map) = field.pasts.lock() {
            map.insert(name, past.clone());
        }
        Some((past, features))
    }

    fn new(rows: &Rows, answers: Vec<Column>, [before, sides]: [Vec<Column>; 2], field: &Field) -> Self {
        let white = |curves: &[Column]| whitened(rows, answers.clone(), curves.to_vec(), 1.0);
        let (first, second): (Unmixed, Unmixed) = (white(&before), white(&sides));
        let columns = side_by_side(&[&first.white, &second.white], rows.residual.len());
        let behind =
            second.made_of.into_iter().map(|(answer, curve, scale)| (answer, before.len() + curve, scale));
        Past {
            before: first.white.ncols(),
            made_of: first.made_of.into_iter().chain(behind).collect(),
            own: square(&columns),
            along: field.marginal.along(&columns.as_view()),
            toward: columns.tr_mul(&field.left),
            curves: [before, sides].concat(),
            answers,
        }
    }

    /// The columns times others, a row for each of its own: `(S c)ᵀ x = cᵀ (Sᵀ x)`.
    pub fn across(&self, rows: &Rows, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let samples = rows.linear.lines.len();
        let mut across = DMatrix::zeros(self.made_of.len(), columns.ncols());
        for (other, mut to) in columns.column_iter().zip(across.column_iter_mut()) {
            let back = rows.whitener.transposed(other.as_slice());
            let by_sample = |answer: &Column| {
                let mut sums = vec![0.0; samples];
                for ((a, x), sample) in answer.iter().zip(&back).zip(&rows.linear.sample) {
                    sums[*sample] += a * x;
                }
                DVector::from_vec(sums)
            };
            let sums: Vec<DVector<f64>> = self.answers.iter().map(by_sample).collect();
            for ((answer, curve, scale), to) in self.made_of.iter().zip(to.iter_mut()) {
                let curve = DVectorView::from_slice(&self.curves[*curve], samples);
                *to = scale * sums[*answer].dot(&curve);
            }
        }
        across
    }
}

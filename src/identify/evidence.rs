//! How large a prior the data themselves speak for, `docs/model.md` (33).

use nalgebra::{Cholesky, DMatrix, DVector};

use super::solve::Solution;
use super::unknowns::Layout;

/// Information on an unknown without prior, over the largest: keeps the matrix definite where the data say nothing, and is the same
/// for all candidates.
const HOLD: f64 = 1e-12;

/// A larger prior has to make the data so much more likely, as a logarithm: a ratio of 150, what Kass and Raftery call very strong. Chosen, like the
/// half weight beside it, with `tests/directions.rs` in view: docs/directions.md tells how it fares elsewhere.
const STRONG: f64 = 5.0;

/// The smallest of the factors whose prior the data do not speak against: more likely by [`STRONG`] with none of the others. `layout` is the one that the solution was found with; candidates differ from
/// it in their scales only.
pub(crate) fn smallest_likely(
    solution: &Solution,
    layout: &Layout,
    candidates: impl Iterator<Item = (f64, Layout)>,
) -> f64 {
    let normal = &solution.normal;
    let mut total = DVector::zeros(layout.len);
    for block in layout.blocks.iter().filter(|b| b.prior) {
        let values = solution.unknowns.total(block);
        (0..block.len).for_each(|k| total[block.offset + k] = values[k]);
    }
    // What the data pull towards, seen from zero.
    let pull = &normal.matrix * &total + &normal.gradient;
    let evidence = |candidate: &Layout| -> Option<f64> {
        let scales = candidate.scales();
        let mut matrix = DMatrix::from_fn(scales.len(), scales.len(), |a, b| {
            normal.matrix[(a, b)] * scales[a] * scales[b]
        });
        let largest = matrix.diagonal().amax();
        for (i, has_prior) in candidate.mask(|b| b.prior).into_iter().enumerate() {
            matrix[(i, i)] += if has_prior { 1.0 } else { HOLD * largest };
        }
        let pull = pull.component_mul(&scales);
        let cholesky = Cholesky::new(matrix)?;
        let half_log: f64 = cholesky.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        Some(0.5 * pull.dot(&cholesky.solve(&pull)) - half_log)
    };
    let told: Vec<(f64, f64)> =
        candidates.filter_map(|(factor, candidate)| Some((factor, evidence(&candidate)?))).collect();
    let top = told.iter().map(|(_, evidence)| *evidence).fold(f64::NEG_INFINITY, f64::max);
    let enough = told.iter().filter(|(_, evidence)| *evidence >= top - STRONG);
    enough.map(|(factor, _)| *factor).min_by(f64::total_cmp).unwrap_or(1.0)
}

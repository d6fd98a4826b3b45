//! How large a prior the data themselves speak for, `docs/model.md` (33).

use nalgebra::{Cholesky, DMatrix, DVector};

use super::solve::Solution;
use super::unknowns::Layout;
use crate::error_motion::{Motions, eliminate};

/// Information on an unknown without prior, over the largest: keeps the matrix definite where the data say nothing, and is the same
/// for all candidates.
const HOLD: f64 = 1e-12;

/// A larger prior has to make the data so much more likely, as a logarithm: a ratio of 150, what Kass and Raftery call very strong. Chosen
/// with `tests/engine/directions.rs` in view: docs/directions.md tells how it fares elsewhere.
const STRONG: f64 = 5.0;

/// Sizes of priors that the data have chosen, as factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sizes {
    /// On direction parts other than play.
    pub but_play: f64,
    /// On lengths and on angles of error motions.
    pub motions: [f64; 2],
}

impl Sizes {
    /// Whether it is worth while to identify again.
    pub fn differ(&self, other: &Sizes) -> bool {
        let far = |k: usize| (self.motions[k] / other.motions[k]).ln().abs() > 0.02;
        self.but_play != other.but_play || far(0) || far(1)
    }
}

/// Chooses the factor on direction parts, by the layouts of `candidates`, and the factors on error motions. Of the former the smallest that
/// the data do not speak against: more likely by [`STRONG`] with none of the others. Of the latter the mean of `of_motions` as logarithms,
/// each as likely as it is. `layout` and `motions` are those that the solution was found with, `present` the factors on the latter.
/// `None` where no room is left for error motions.
pub(crate) fn likely(
    solution: &Solution,
    layout: &Layout,
    motions: &Motions,
    present: [f64; 2],
    candidates: &[(f64, Layout)],
    of_motions: &[[f64; 2]],
) -> Option<Sizes> {
    let (matrix, gradient) = solution.normal.whole.as_ref()?;
    let mut total = DVector::zeros(layout.len);
    for block in layout.blocks.iter().filter(|b| b.prior) {
        let values = solution.unknowns.total(block);
        (0..block.len).for_each(|k| total[block.offset + k] = values[k]);
    }
    // What the data pull towards, seen from zero.
    let pull = gradient + matrix.columns(0, layout.len) * total;
    let mut told: Vec<(Sizes, f64)> = Vec::new();
    for sizes in of_motions {
        let mut factors = DVector::from_element(pull.len(), 1.0);
        let change = [0, 1].map(|k| sizes[k] / present[k]);
        factors.rows_mut(layout.len, motions.len()).copy_from(&motions.factors(change));
        let sized =
            DMatrix::from_fn(factors.len(), factors.len(), |a, b| matrix[(a, b)] * factors[a] * factors[b]);
        let rest = eliminate(&sized, &pull.component_mul(&factors), &vec![0.0; motions.len()]);
        for (but_play, candidate) in candidates {
            let Some(evidence) = evidence(&rest.matrix, &rest.gradient, candidate) else { continue };
            let sizes = Sizes { but_play: *but_play, motions: *sizes };
            told.push((sizes, evidence + rest.gain - rest.half_log_det()));
        }
    }
    let top = told.iter().map(|(_, evidence)| *evidence).fold(f64::NEG_INFINITY, f64::max);
    let enough = told.iter().filter(|(_, evidence)| *evidence >= top - STRONG);
    let but_play = enough.map(|(sizes, _)| sizes.but_play).min_by(f64::total_cmp)?;
    // One size alone would jump with the data; the mean of all, as likely as they are, goes along with them.
    let own: Vec<&(Sizes, f64)> = told.iter().filter(|(sizes, _)| sizes.but_play == but_play).collect();
    let weight = |evidence: f64| (evidence - top).exp();
    let all: f64 = own.iter().map(|(_, evidence)| weight(*evidence)).sum();
    let mean = |k: usize| {
        let logs = own.iter().map(|(sizes, evidence)| weight(*evidence) * sizes.motions[k].ln());
        (logs.sum::<f64>() / all).exp()
    };
    Some(Sizes { but_play, motions: [0, 1].map(mean) })
}

/// How likely the data are under the priors of a layout, as a logarithm and but for what all have in common: from the matrix and the pull from zero.
fn evidence(matrix: &DMatrix<f64>, pull: &DVector<f64>, layout: &Layout) -> Option<f64> {
    let scales = layout.scales();
    let mut scaled =
        DMatrix::from_fn(scales.len(), scales.len(), |a, b| matrix[(a, b)] * scales[a] * scales[b]);
    let largest = scaled.diagonal().amax();
    for (i, has_prior) in layout.mask(|b| b.prior).into_iter().enumerate() {
        scaled[(i, i)] += if has_prior { 1.0 } else { HOLD * largest };
    }
    let pull = pull.component_mul(&scales);
    let cholesky = Cholesky::new(scaled)?;
    let half_log: f64 = cholesky.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
    Some(0.5 * pull.dot(&cholesky.solve(&pull)) - half_log)
}

//! How large the residuals of some samples are, by piece of the model.

use serde::{Deserialize, Serialize};

use super::evaluator::{Evaluator, Moment};
use super::solve::Problem;
use super::source::Which;
use super::unknowns::Unknowns;
use crate::error::Result;
use crate::residual::Sizes;
use crate::units::{ByQuantity, Rms};

/// Residuals over some samples; norms of positions and rotations, absolute values of scalars. m and rad.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// How many samples.
    pub samples: u64,
    /// Root mean square.
    pub rms: Rms,
    /// Mean size.
    pub mean: Rms,
    /// Largest size.
    pub max: Rms,
}

/// One piece of a model.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PieceFit {
    /// Its name, such as `AFCR`: A forward, C reverse.
    pub name: String,
    /// Residuals of the samples that it was found from.
    pub fit: Figures,
    /// Residuals of samples that were held out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<Figures>,
}

impl From<&ByQuantity<Sizes>> for Figures {
    fn from(sizes: &ByQuantity<Sizes>) -> Self {
        Figures { samples: sizes.samples(), rms: sizes.rms(), mean: sizes.mean(), max: sizes.largest() }
    }
}

/// Residuals by piece under these unknowns, over the samples of the fit or those held out.
pub(crate) fn judge(problem: &Problem, unknowns: &Unknowns, which: Which) -> Result<Vec<ByQuantity<Sizes>>> {
    let (machine, sources) = (problem.machine, problem.sources);
    let evaluators: Vec<_> = sources.all.iter().map(|s| Evaluator::new(machine, unknowns, s)).collect();
    let pieces = problem.varying.directions.as_ref().map_or(1, |d| d.piece_count());
    let mut sums = vec![ByQuantity::<Sizes>::default(); pieces];
    sources.pass_over(
        which,
        |index, stretch| {
            let (source, evaluator) = (&sources.all[index], &evaluators[index]);
            let count = source.sensor.reading_count();
            let quantity = source.quantity(machine, 0);
            let mut own = vec![ByQuantity::<Sizes>::default(); pieces];
            for (k, residuals) in evaluator.all_residuals(stretch).chunks_exact(count).enumerate() {
                let sizes = &mut own[evaluator.piece(Moment::At(stretch, k))];
                sizes[quantity].take(&residuals[..count.min(3)]);
                if count == 6 {
                    sizes.rad.take(&residuals[3..6]);
                }
            }
            own
        },
        |_, own| sums.iter_mut().zip(&own).for_each(|(sum, own)| sum.add(own)),
    )?;
    Ok(sums)
}

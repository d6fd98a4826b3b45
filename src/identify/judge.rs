//! How large the residuals of some samples are, by piece of the model.

use serde::Serialize;

use super::evaluator::{Evaluator, Moment};
use super::solve::Problem;
use super::source::Which;
use super::unknowns::Unknowns;
use crate::error::Result;
use crate::rms::Rms;
use crate::units::Quantity;

/// Residuals over some samples; norms of positions and rotations, absolute values of scalars. m and rad.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
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
#[derive(Clone, Debug, Serialize)]
pub struct PieceFit {
    /// Its name, such as `AFCR`: A forward, C reverse.
    pub name: String,
    /// Residuals of the samples that it was found from.
    pub fit: Figures,
    /// Residuals of samples that were held out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out: Option<Figures>,
}

/// Sums over residual sizes, of lengths and of angles.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sizes {
    count: [u64; 2],
    squares: [f64; 2],
    total: [f64; 2],
    largest: [f64; 2],
}

impl Sizes {
    fn take(&mut self, kind: usize, residuals: &[f64]) {
        let size = residuals.iter().map(|r| r * r).sum::<f64>().sqrt();
        self.count[kind] += 1;
        self.squares[kind] += size * size;
        self.total[kind] += size;
        self.largest[kind] = self.largest[kind].max(size);
    }

    pub fn add(&mut self, other: &Sizes) {
        for kind in 0..2 {
            self.count[kind] += other.count[kind];
            self.squares[kind] += other.squares[kind];
            self.total[kind] += other.total[kind];
            self.largest[kind] = self.largest[kind].max(other.largest[kind]);
        }
    }

    pub fn figures(&self) -> Figures {
        let of = |value: &dyn Fn(usize) -> f64| {
            let some = |kind: usize| (self.count[kind] > 0).then(|| value(kind));
            Rms { m: some(0), rad: some(1) }
        };
        Figures {
            samples: self.count[0].max(self.count[1]),
            rms: of(&|k| (self.squares[k] / self.count[k] as f64).sqrt()),
            mean: of(&|k| self.total[k] / self.count[k] as f64),
            max: of(&|k| self.largest[k]),
        }
    }
}

/// Residuals by piece under these unknowns, over the samples of the fit or those held out.
pub(crate) fn judge(problem: &Problem, unknowns: &Unknowns, which: Which) -> Result<Vec<Sizes>> {
    let (machine, sources) = (problem.machine, problem.sources);
    let evaluators: Vec<_> = sources.all.iter().map(|s| Evaluator::new(machine, unknowns, s)).collect();
    let pieces = problem.varying.directions.as_ref().map_or(1, |d| d.piece_count());
    let mut sums = vec![Sizes::default(); pieces];
    sources.pass_over(
        which,
        |index, stretch| {
            let (source, evaluator) = (&sources.all[index], &evaluators[index]);
            let (count, width) = (source.sensor.reading_count(), source.recording.value_count());
            let angular = source.quantity(machine, 0) == Quantity::Angle;
            let mut own = vec![Sizes::default(); pieces];
            let mut work = evaluator.workspace();
            for k in 0..stretch.chunk.len {
                let q = stretch.q(k);
                let measured = &stretch.chunk.values[k * width..(k + 1) * width];
                let moment = Moment::At(stretch, k);
                let residuals = evaluator.residuals(q, measured, moment, &mut work, None);
                let sizes = &mut own[evaluator.piece(moment)];
                sizes.take(usize::from(count == 1 && angular), &residuals[..count.min(3)]);
                if count == 6 {
                    sizes.take(1, &residuals[3..6]);
                }
            }
            own
        },
        |_, own| sums.iter_mut().zip(&own).for_each(|(sum, own)| sum.add(own)),
    )?;
    Ok(sums)
}

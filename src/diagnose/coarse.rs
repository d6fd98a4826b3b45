//! Samples put together in blocks, for features that change little within one: grids of many points are screened on them.

use std::sync::OnceLock;

use nalgebra::DMatrix;

use crate::effects::Candidate;
use crate::feature::Samples;
use crate::identify::Linear;

/// Blocks of samples that stand for themselves.
pub(super) struct Coarse {
    /// Coarse row of each row.
    row: Vec<usize>,
    /// One over the root of how many rows a coarse row has.
    weight: Vec<f64>,
    /// Coarse sample of each coarse row.
    pub sample: Vec<usize>,
    /// What features see of the samples in the middle of the blocks.
    samples: Vec<Samples>,
    /// Sample in the middle of the block, for every sample.
    middle: Vec<usize>,
    /// Features of each candidate over its grid, once they have been asked for.
    kept: Vec<OnceLock<Option<Features>>>,
}

/// Features of a candidate at the middles of blocks, over its grid.
pub(super) struct Features {
    /// Point by point, feature by feature, sample by sample.
    values: Vec<f32>,
    features: usize,
    samples: usize,
}

impl Features {
    /// Of one point, one slice a feature; `None` where a value is not finite.
    pub fn at(&self, point: usize) -> Option<Vec<&[f32]>> {
        let width = self.features * self.samples;
        let all = &self.values[point * width..(point + 1) * width];
        all.iter().all(|x| x.is_finite()).then(|| all.chunks_exact(self.samples).collect())
    }
}

/// About so many coarse rows are kept, of blocks no longer than this.
const ROWS: usize = 1200;
const LONGEST: usize = 8;
/// A feature whose root mean square changes by less than this part within a block counts as smooth.
const ROUGH: f64 = 0.2;
/// Candidates with more numbers than this are not kept.
const MOST_KEPT: usize = 40_000_000;

impl Coarse {
    pub fn new(linear: &Linear, candidates: usize) -> Self {
        let size = (linear.residual.len() / ROWS).clamp(1, LONGEST);
        let mut coarse = Coarse {
            row: Vec::new(),
            weight: Vec::new(),
            sample: Vec::new(),
            samples: Vec::new(),
            middle: Vec::new(),
            kept: (0..candidates).map(|_| OnceLock::new()).collect(),
        };
        let mut samples = 0;
        for (s, span) in linear.spans.iter().enumerate() {
            let count = span.samples.1 - span.samples.0;
            let blocks: Vec<(usize, usize)> =
                (0..count).step_by(size).map(|from| (from, (from + size).min(count))).collect();
            let middles: Vec<usize> = blocks.iter().map(|(from, to)| (from + to - 1) / 2).collect();
            for ((from, to), middle) in blocks.iter().zip(&middles) {
                let first = coarse.weight.len();
                for _ in *from..*to {
                    coarse.row.extend(first..first + span.readings);
                    coarse.middle.push(span.samples.0 + middle);
                }
                coarse.weight.extend(vec![((to - from) as f64).sqrt().recip(); span.readings]);
                coarse.sample.extend(vec![samples; span.readings]);
                samples += 1;
            }
            coarse.samples.push(linear.samples[s].chosen(&middles));
        }
        coarse
    }

    /// Sums over blocks; white noise keeps its variance.
    pub fn reduce(&self, column: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.weight.len()];
        column.iter().zip(&self.row).for_each(|(x, row)| sums[*row] += x * self.weight[*row]);
        sums
    }

    pub fn reduce_all(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.weight.len(), columns.ncols());
        for (c, column) in columns.column_iter().enumerate() {
            let column: Vec<f64> = column.iter().copied().collect();
            out.column_mut(c).copy_from_slice(&self.reduce(&column));
        }
        out
    }

    /// Features of candidate `i` over its grid, if they change little within a block.
    pub fn features(&self, i: usize, candidate: &Candidate, fine: &[Samples]) -> Option<&Features> {
        self.kept[i].get_or_init(|| self.evaluate(candidate, fine)).as_ref()
    }

    fn evaluate(&self, candidate: &Candidate, fine: &[Samples]) -> Option<Features> {
        let features = candidate.features.len();
        let samples = self.sample.last().map_or(0, |last| last + 1);
        if candidate.grid.len() * features * samples > MOST_KEPT || !self.is_smooth(candidate, fine) {
            return None;
        }
        // What remembers the way it came is followed over every sample.
        let remembers = candidate.features.iter().any(|f| f.remembers());
        let mut values = Vec::with_capacity(candidate.grid.len() * features * samples);
        if !remembers {
            candidate.scan(&self.samples, |_, columns| {
                columns.iter().for_each(|column| values.extend(column.iter().map(|x| *x as f32)));
            });
            return Some(Features { values, features, samples });
        }
        let mut middles = self.middle.clone();
        middles.dedup();
        candidate.scan(fine, |_, columns| {
            columns.iter().for_each(|column| values.extend(middles.iter().map(|m| column[*m] as f32)));
        });
        Some(Features { values, features, samples })
    }

    /// Whether the features change little within a block, at both ends of the grid.
    fn is_smooth(&self, candidate: &Candidate, fine: &[Samples]) -> bool {
        let ends = [candidate.grid.first(), candidate.grid.last()];
        ends.into_iter().flatten().all(|point| {
            candidate.features.iter().all(|feature| {
                let column = feature.over(fine, point);
                let (mut off, mut all) = (0.0, 0.0);
                for (x, middle) in column.iter().zip(&self.middle) {
                    off += (x - column[*middle]).powi(2);
                    all += x * x;
                }
                off <= ROUGH * ROUGH * all
            })
        })
    }
}

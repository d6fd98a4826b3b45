//! Samples put together in blocks, for features that change little within one: grids of many points are screened on them.

use std::sync::OnceLock;

use super::cells::{AllCells, answers};
use super::equations::root_mean_square;
use super::features::{AtPoint, Features, Groups, is_near};
use super::linear::Linear;
use super::panel::{Panel, WIDTH};
use crate::effects::Candidate;
use crate::feature::Samples;

/// Long blocks of samples, and shorter ones for what changes faster.
pub(super) struct Coarse {
    levels: Vec<Level>,
    /// The first candidate that has the features of each over the same grid: what goes by the clock is alike at every frame.
    alike: Vec<usize>,
    /// Features of each candidate over its grid, once they have been asked for.
    kept: Vec<OnceLock<Option<OnLevel>>>,
    /// Samples put together where joints stand alike, whenever that was.
    pub cells: AllCells,
    /// Phases of the waves of each candidate, pair by pair, once they have been asked for.
    pub(super) waves: Vec<OnceLock<Option<Vec<Wave>>>>,
}

/// Features of a candidate on the blocks of a level.
pub(super) struct OnLevel {
    pub level: usize,
    pub features: Features,
    /// The same with blocks together that are alike, where those are many.
    pub groups: Option<Groups>,
}

/// Phase of a pair of features over the grid.
pub(super) struct Wave {
    /// Phase at every sample, over the largest.
    pub(super) x: Vec<f64>,
    /// The largest phase, at every point of the grid.
    pub(super) factors: Vec<f64>,
}

/// Blocks of samples that stand for themselves.
pub(super) struct Level {
    /// Coarse row of each row.
    row: Vec<usize>,
    /// One over the root of how many rows a coarse row has.
    weight: Vec<f64>,
    /// Coarse sample of each coarse row.
    pub sample: Vec<usize>,
    /// First coarse row of each coarse sample, and their number.
    pub first: Vec<usize>,
    /// What features see of the samples in the middle of the blocks.
    samples: Vec<Samples>,
    /// Sample in the middle of the block, for every sample.
    middle: Vec<usize>,
}

/// About so many coarse rows are kept, of blocks no longer than this; on the second level of blocks shorter by this factor.
const ROWS: usize = 1200;
const LONGEST: usize = 8;
const SHORTER: usize = 3;
impl Coarse {
    pub fn new(linear: &Linear, candidates: &[Candidate]) -> Self {
        let size = (linear.residual.len() / ROWS).clamp(1, LONGEST);
        let mut sizes = vec![size];
        if size >= 2 * SHORTER {
            sizes.push(size / SHORTER);
        }
        if size > 1 {
            sizes.push(1);
        }
        Coarse {
            levels: sizes.into_iter().map(|size| Level::new(linear, size)).collect(),
            alike: alike(candidates),
            kept: candidates.iter().map(|_| OnceLock::new()).collect(),
            cells: AllCells::new(candidates.len()),
            waves: candidates.iter().map(|_| OnceLock::new()).collect(),
        }
    }

    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// The candidate that stands for all that have the features of candidate `i` over the same grid.
    pub fn first_alike(&self, i: usize) -> usize {
        self.alike[i]
    }

    /// Features of candidate `i` over its grid, if they change little within a block of some level.
    pub fn features(&self, i: usize, candidate: &Candidate, fine: &[Samples]) -> Option<&OnLevel> {
        let first = || {
            let on = |(level, of): (usize, &Level)| {
                let features = of.evaluate(candidate, fine)?;
                Some(OnLevel { level, groups: features.grouped(), features })
            };
            self.levels.iter().enumerate().find_map(on)
        };
        self.kept[i].get_or_init(first).as_ref()
    }
}

/// For each candidate the first one that has its features over the same grid, for as many columns of as many answers of the machine.
fn alike(candidates: &[Candidate]) -> Vec<usize> {
    let mut first: Vec<(usize, usize)> = Vec::new();
    let is_alike = |(a, of_a): (&Candidate, usize), (b, of_b): (&Candidate, usize)| {
        of_a == of_b
            && a.coefficients.len() == b.coefficients.len()
            && a.features == b.features
            && a.parameters == b.parameters
            && a.grid == b.grid
    };
    let mut one = |i: usize| {
        let answers = answers(&candidates[i]).len();
        let known = |&&(j, of): &&(usize, usize)| is_alike((&candidates[j], of), (&candidates[i], answers));
        if let Some((j, _)) = first.iter().find(known) {
            return *j;
        }
        first.push((i, answers));
        i
    };
    (0..candidates.len()).map(&mut one).collect()
}

impl Level {
    fn new(linear: &Linear, size: usize) -> Self {
        let mut level = Level {
            row: Vec::new(),
            weight: Vec::new(),
            sample: Vec::new(),
            first: Vec::new(),
            samples: Vec::new(),
            middle: Vec::new(),
        };
        for (s, span) in linear.spans.iter().enumerate() {
            let count = span.samples.1 - span.samples.0;
            let blocks: Vec<(usize, usize)> =
                (0..count).step_by(size).map(|from| (from, (from + size).min(count))).collect();
            let middles: Vec<usize> = blocks.iter().map(|(from, to)| (from + to - 1) / 2).collect();
            for ((from, to), middle) in blocks.iter().zip(&middles) {
                let first = level.weight.len();
                for _ in *from..*to {
                    level.row.extend(first..first + span.readings);
                    level.middle.push(span.samples.0 + middle);
                }
                level.weight.extend(vec![((to - from) as f64).sqrt().recip(); span.readings]);
                level.sample.extend(vec![level.first.len(); span.readings]);
                level.first.push(first);
            }
            level.samples.push(linear.samples[s].chosen(&middles));
        }
        level
    }

    /// Coarse rows of coarse samples that follow each other: the first one and how many there are.
    pub fn rows(&self, (from, count): (usize, usize)) -> (usize, usize) {
        let end = self.first.get(from + count).copied().unwrap_or(self.weight.len());
        (self.first[from], end - self.first[from])
    }

    /// Sums over blocks; white noise keeps its variance.
    pub fn reduce(&self, column: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.weight.len()];
        column.iter().zip(&self.row).for_each(|(x, row)| sums[*row] += x * self.weight[*row]);
        sums
    }

    /// Whether every block is a single sample.
    pub fn is_all(&self) -> bool {
        self.weight.len() == self.row.len()
    }

    pub fn reduce_panel(&self, panel: &Panel) -> Panel {
        let mut sums = vec![[0.0; WIDTH]; self.weight.len()];
        for (row, to) in panel.rows().iter().zip(&self.row) {
            sums[*to].iter_mut().zip(row).for_each(|(sum, x)| *sum += x * self.weight[*to]);
        }
        Panel::new(sums)
    }

    fn evaluate(&self, candidate: &Candidate, fine: &[Samples]) -> Option<Features> {
        let follows = |column: &[f64]| self.follows(column);
        let rms = |at: &AtPoint, feature: usize| root_mean_square(at.columns[feature], at.samples);
        if !candidate.features.iter().any(|f| f.remembers()) {
            return Features::over(candidate, (fine, &self.samples), None, follows, rms);
        }
        // What remembers the way it came is followed over every sample.
        let mut middles = self.middle.clone();
        middles.dedup();
        Features::over(candidate, (fine, fine), Some(&middles), follows, rms)
    }

    /// Whether a column changes little within a block.
    pub fn follows(&self, column: &[f64]) -> bool {
        is_near(column, self.middle.iter().map(|middle| column[*middle]))
    }

    /// A column in the middles of the blocks.
    pub fn in_middles(&self, column: &[f64]) -> Vec<f64> {
        self.middle.chunk_by(|a, b| a == b).map(|block| column[block[0]]).collect()
    }
}

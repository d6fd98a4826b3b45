//! Features of a candidate over its grid, at samples that stand for others.

use super::equations::{is_of_number, unit_of};
use crate::effects::{Candidate, Coefficient};
use crate::feature::Samples;

/// A feature whose root mean square changes by less than this part within a block counts as smooth.
const ROUGH: f64 = 0.2;
/// Features vanish below this part of their largest value.
const VANISHES: f64 = 1e-6;
/// Candidates with more numbers than this are not kept.
const MOST_KEPT: usize = 40_000_000;

/// Features of a candidate at the middles of blocks, over its grid.
pub(super) struct Features {
    /// Point by point, feature by feature, sample by sample of its runs.
    values: Vec<f32>,
    /// Where each point's values begin, and its runs; whether all of them are finite.
    points: Vec<(usize, usize, bool)>,
    /// Runs of samples outside of which all features of a point vanish: first one, number.
    runs: Vec<(usize, usize)>,
    /// Root mean square of each feature over all that the samples stand for, point by point.
    rms: Vec<f64>,
    features: usize,
    samples: usize,
}

/// Features of one point.
pub(super) struct AtPoint<'a> {
    /// Samples outside of which they vanish.
    pub runs: &'a [(usize, usize)],
    /// One slice a feature, run after run.
    pub columns: Vec<&'a [f32]>,
    /// How many samples there are in all.
    pub samples: usize,
    /// Root mean squares over all that the samples stand for, one a feature.
    rms: &'a [f64],
}

impl AtPoint<'_> {
    /// What a coefficient is scaled by: the usual size over the root mean square of its first feature.
    pub fn unit(&self, coefficient: &Coefficient) -> f64 {
        let is_number = is_of_number(coefficient);
        let of = |feature: usize| unit_of(coefficient.size, self.rms[feature], is_number);
        coefficient.parts.first().map_or(0.0, |part| of(part.feature))
    }

    /// Part of the samples where they do not vanish.
    pub fn part(&self) -> f64 {
        self.columns.first().map_or(0.0, |column| column.len() as f64 / self.samples.max(1) as f64)
    }
}

impl Features {
    /// Of one point; `None` where a value is not finite.
    pub fn at(&self, point: usize) -> Option<AtPoint<'_>> {
        let is_finite = self.points[point].2;
        let rms = &self.rms[point * self.features..(point + 1) * self.features];
        is_finite.then(|| AtPoint { rms, ..self.values(point) })
    }

    /// The same, finite or not, before it is known how large they are.
    fn values(&self, point: usize) -> AtPoint<'_> {
        let (from, first, _) = self.points[point];
        let last = self.points.get(point + 1).map_or(self.runs.len(), |next| next.1);
        let runs = &self.runs[first..last];
        let count: usize = runs.iter().map(|run| run.1).sum();
        let all = &self.values[from..from + count * self.features];
        let columns = (0..self.features).map(|f| &all[f * count..(f + 1) * count]).collect();
        AtPoint { runs, columns, samples: self.samples, rms: &[] }
    }

    /// Of a candidate over its grid, at samples that stand for others, or of these those that are picked; `None` where there are too many numbers
    /// or they do not follow all samples. `rms`: root mean square of a feature at a point over all that the samples stand for.
    pub fn over(
        candidate: &Candidate,
        (all, seen): (&[Samples], &[Samples]),
        picked: Option<&[usize]>,
        follows: impl Fn(&[f64]) -> bool,
        rms: impl Fn(&AtPoint, usize) -> f64,
    ) -> Option<Self> {
        let features = candidate.features.len();
        let samples = picked.map_or_else(|| seen.iter().map(|s| s.len).sum(), <[usize]>::len);
        if candidate.grid.len() * features * samples > MOST_KEPT || !is_smooth(candidate, all, follows) {
            return None;
        }
        let (values, points, runs) = (Vec::new(), Vec::new(), Vec::new());
        let mut kept = Features { values, points, runs, rms: Vec::new(), features, samples };
        candidate.scan(seen, |_, columns| kept.push(columns, |k| picked.map_or(k, |picked| picked[k])));
        kept.values.shrink_to_fit();
        let each = |point: usize| {
            let (at, rms) = (kept.values(point), &rms);
            (0..features).map(move |feature| rms(&at, feature)).collect::<Vec<f64>>()
        };
        kept.rms = (0..kept.points.len()).flat_map(each).collect();
        Some(kept)
    }

    /// Puts a point behind the others.
    fn push(&mut self, columns: &[Vec<f64>], picked: impl Fn(usize) -> usize) {
        let (from, first) = (self.values.len(), self.runs.len());
        let largest: Vec<f64> =
            columns.iter().map(|c| c.iter().fold(0.0, |most, x| x.abs().max(most))).collect();
        let acts = |k: &usize| {
            columns.iter().zip(&largest).any(|(c, most)| {
                let x = c[picked(*k)];
                !x.is_finite() || x.abs() > VANISHES * most
            })
        };
        let mut k = 0;
        while let Some(from) = (k..self.samples).find(acts) {
            k = (from..self.samples).find(|k| !acts(k)).unwrap_or(self.samples);
            self.runs.push((from, k - from));
        }
        for column in columns {
            for (from, count) in &self.runs[first..] {
                self.values.extend((*from..from + count).map(|k| column[picked(k)] as f32));
            }
        }
        self.points.push((from, first, self.values[from..].iter().all(|x| x.is_finite())));
    }
}

/// Whether the features of a candidate follow all samples, at both ends of the grid; what jumps, in its middle.
fn is_smooth(candidate: &Candidate, all: &[Samples], follows: impl Fn(&[f64]) -> bool) -> bool {
    let grid = &candidate.grid;
    let points = match candidate.jumps() {
        true => [grid.get(grid.len() / 2), None],
        false => [grid.first(), grid.last()],
    };
    (points.into_iter().flatten())
        .all(|point| candidate.features.iter().all(|feature| follows(&feature.over(all, point))))
}

/// Whether a column is near what stands for it.
pub(super) fn is_near(column: &[f64], stands: impl Iterator<Item = f64>) -> bool {
    let (mut off, mut all) = (0.0, 0.0);
    for (x, stands) in column.iter().zip(stands) {
        off += (x - stands).powi(2);
        all += x * x;
    }
    off <= ROUGH * ROUGH * all
}

//! Features of a candidate over its grid, at samples that stand for others.

use super::equations::{is_of_number, unit_of};
use crate::effects::{Candidate, Coefficient};
use crate::feature::Samples;

/// A feature whose root mean square changes by less than this part within a block counts as smooth.
const ROUGH: f64 = 0.2;
/// Features vanish below this part of their largest value.
const VANISHES: f64 = 1e-6;
/// Samples are put together where so many to one are alike.
const ALIKE: usize = 4;
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

/// Samples that are alike over the whole grid, put together.
pub(super) struct Groups {
    /// Group of each sample.
    pub group: Vec<usize>,
    /// On the groups.
    pub features: Features,
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
    /// How many samples there are.
    pub fn samples(&self) -> usize {
        self.samples
    }

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

    /// The same where samples that follow each other and are alike at every point stand together, as those do between moments at which something
    /// may slip; `None` where that would be no fewer than so many to one.
    pub fn grouped(&self) -> Option<Groups> {
        let is_fine =
            |begins: &[bool]| begins.iter().filter(|begins| **begins).count() * ALIKE > self.samples;
        let mut begins = vec![false; self.samples];
        for point in 0..self.points.len() {
            let (at, mut from) = (self.values(point), 0);
            for (first, count) in at.runs {
                begins[*first] = true;
                if let Some(behind) = begins.get_mut(first + count) {
                    *behind = true;
                }
                for column in &at.columns {
                    let own = &column[from..from + count];
                    let changes =
                        own.windows(2).zip(&mut begins[first + 1..]).filter(|(two, _)| two[0] != two[1]);
                    changes.for_each(|(_, begins)| *begins = true);
                }
                from += count;
            }
            // Most are never alike, as the first point tells.
            if point == 0 && is_fine(&begins) {
                return None;
            }
        }
        begins[..self.samples.min(1)].fill(true);
        if is_fine(&begins) {
            return None;
        }
        let firsts: Vec<usize> = (0..self.samples).filter(|k| begins[*k]).collect();
        let mut groups = Features {
            values: Vec::new(),
            points: Vec::new(),
            runs: Vec::new(),
            rms: self.rms.clone(),
            features: self.features,
            samples: firsts.len(),
        };
        let mut columns = vec![Vec::new(); self.features];
        for point in 0..self.points.len() {
            let (at, mut from) = (self.values(point), 0);
            columns.iter_mut().for_each(|column| {
                column.clear();
                column.resize(self.samples, 0.0);
            });
            for (first, count) in at.runs {
                for (to, own) in columns.iter_mut().zip(&at.columns) {
                    let own = &own[from..from + count];
                    to[*first..first + count].iter_mut().zip(own).for_each(|(to, x)| *to = f64::from(*x));
                }
                from += count;
            }
            groups.push(&columns, |k| firsts[k]);
        }
        groups.values.shrink_to_fit();
        let group = begins.iter().scan(0, |count, begins| {
            *count += usize::from(*begins);
            Some(*count - 1)
        });
        Some(Groups { group: group.collect(), features: groups })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_that_are_alike_over_the_whole_grid_stand_together() {
        const SAMPLES: usize = 40;
        let nothing = || Features {
            values: Vec::new(),
            points: Vec::new(),
            runs: Vec::new(),
            rms: Vec::new(),
            features: 2,
            samples: SAMPLES,
        };
        let step = |at: usize, size: f64| (0..SAMPLES).map(|k| if k < at { 0.0 } else { size }).collect();
        let mut steps = nothing();
        for at in [7, 20, 33] {
            steps.push(&[step(at, 1.0), step(at + 2, 0.5)], |k| k);
        }
        let groups = steps.grouped().expect("few are different");
        assert_eq!(groups.features.samples(), 7);
        for point in 0..3 {
            let spread = |features: &Features, at: &dyn Fn(usize) -> usize| {
                let (of, mut columns) = (features.values(point), vec![vec![0.0; features.samples]; 2]);
                let mut from = 0;
                for (first, count) in of.runs {
                    for (column, own) in columns.iter_mut().zip(&of.columns) {
                        column[*first..first + count].copy_from_slice(&own[from..from + count]);
                    }
                    from += count;
                }
                columns.iter().map(|c| (0..SAMPLES).map(|k| c[at(k)]).collect()).collect::<Vec<Vec<f32>>>()
            };
            assert_eq!(spread(&steps, &|k| k), spread(&groups.features, &|k| groups.group[k]));
        }
        let mut smooth = nothing();
        let wave = |by: f64| (0..SAMPLES).map(|k| (by * k as f64).sin()).collect();
        smooth.push(&[wave(0.1), wave(0.2)], |k| k);
        assert!(smooth.grouped().is_none());
    }
}

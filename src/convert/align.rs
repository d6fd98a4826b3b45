//! Readings laid beside the path that ran: when it began and when it ended, and how sure that is.
//!
//! A reading at clock `x` belongs to the moment `(x - start) / (end - start)` of the path. For each trial of start and end the errors that
//! a machine can have ([`Shapes`]) are fitted; where the misfit is least, reversals, stops, beginning and end lie where the readings have
//! them. Readings before and behind the path are of a machine that stands.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use super::shapes::Shapes;

/// Readings that a coarse search looks at, and a finer one.
const COARSE: usize = 500;
const FINE: usize = 1500;
const FULL: usize = 6000;
/// Trials of the start and of the duration.
const STARTS: usize = 240;
const DURATIONS: usize = 70;
/// Part of the path that must lie within the readings, and how many times as long they may be where nobody knows their rate.
const COVERED: f64 = 0.9;
const LONGEST: f64 = 2.5;
/// Standard uncertainty of a clock and a feed that are told, as part of the whole.
const CLOCK: f64 = 1e-3;
/// Difference of misfits, in units of what chance makes of them, that settles which of two alignments holds, and that a path is followed.
pub(super) const SETTLED: f64 = 25.0;
/// Times that the shapes are made anew about what was found.
const ROUNDS: usize = 3;
/// Residuals beyond this many times the usual are of a bar that is out of its range.
const FAR: f64 = 8.0;

/// Readings with their clock: s, or numbers of samples from 0.
pub(super) struct Readings {
    pub clock: Vec<f64>,
    /// Row by row, m.
    pub values: Vec<f64>,
}

/// Where the path lies in the readings.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Clock at the start and at the end of the path.
    pub ends: [f64; 2],
    /// Their standard uncertainties.
    pub errors: [f64; 2],
    /// What a shift by these changes in the readings, m RMS.
    pub hides: f64,
    /// RMS of readings about their mean, of what the path leaves of them, and of their noise, m.
    pub spread: f64,
    pub left: f64,
    /// By how much the path explains the readings better than a constant does.
    pub followed: f64,
    /// The next best start and end, and how much worse they are.
    pub rival: Option<([f64; 2], f64)>,
}

struct Fit {
    misfit: f64,
    shapes: DVector<f64>,
}

/// A part of the readings, and what is compared with them.
#[derive(Clone)]
struct Trial<'a> {
    shapes: &'a Shapes,
    clock: Vec<f64>,
    values: Vec<f64>,
    /// 1 or 0.
    weights: Vec<f64>,
    noise: f64,
    /// Duration of the path by the clock if that is told.
    told: Option<f64>,
}

impl<'a> Trial<'a> {
    /// Means of neighbouring readings, so that about `count` are left.
    fn new(shapes: &'a Shapes, all: &Readings, noise: f64, told: Option<f64>, count: usize) -> Self {
        let (n, m) = (all.clock.len(), shapes.readings);
        let block = n.div_ceil(count).max(1);
        let (mut clock, mut values) = (Vec::new(), Vec::new());
        for from in (0..n).step_by(block) {
            let to = (from + block).min(n);
            let part = (to - from) as f64;
            clock.push(all.clock[from..to].iter().sum::<f64>() / part);
            for i in 0..m {
                values.push((from..to).map(|k| all.values[k * m + i]).sum::<f64>() / part);
            }
        }
        let weights = vec![1.0; clock.len()];
        Trial { shapes, clock, values, weights, noise: noise / (block as f64).sqrt(), told }
    }

    /// Nominal reading and shapes at a clock.
    fn row(&self, x: f64, i: usize, ends: [f64; 2], out: &mut [f64]) -> f64 {
        let s = self.shapes;
        let moments = s.nominal.len() / s.readings;
        let last = (moments - 1) as f64;
        let at = ((x - ends[0]) / (ends[1] - ends[0]) * last).clamp(0.0, last);
        let k = at.floor().min(last - 1.0);
        let (part, k) = (at - k, k as usize);
        let (a, b) = (k * s.readings + i, (k + 1) * s.readings + i);
        let (from, to) = (&s.rows[a * s.count..(a + 1) * s.count], &s.rows[b * s.count..(b + 1) * s.count]);
        for (out, (a, b)) in out.iter_mut().zip(from.iter().zip(to)) {
            *out = a + (b - a) * part;
        }
        s.nominal[a] + (s.nominal[b] - s.nominal[a]) * part
    }

    fn fit(&self, ends: [f64; 2]) -> Option<Fit> {
        if ends[1] <= ends[0] {
            return None;
        }
        let (m, r) = (self.shapes.readings, self.shapes.count);
        let mut normal = vec![0.0; r * r];
        let mut right = vec![0.0; r];
        let (mut square, mut row) = (0.0, vec![0.0; r]);
        let w = self.noise.powi(-2);
        for (k, x) in self.clock.iter().enumerate() {
            if self.weights[k] == 0.0 {
                continue;
            }
            for i in 0..m {
                let y = self.values[k * m + i] - self.row(*x, i, ends, &mut row);
                square += w * y * y;
                for a in 0..r {
                    let x = w * row[a];
                    right[a] += x * y;
                    for (sum, b) in normal[a * r..=a * r + a].iter_mut().zip(&row) {
                        *sum += x * b;
                    }
                }
            }
        }
        let mut matrix = DMatrix::from_row_slice(r, r, &normal);
        for a in 0..r {
            matrix[(a, a)] += 1.0;
        }
        let right = DVector::from_vec(right);
        let shapes = Cholesky::<f64, Dyn>::new(matrix)?.solve(&right);
        let mut misfit = square - right.dot(&shapes);
        if let Some(told) = self.told {
            misfit += (((ends[1] - ends[0]) / told - 1.0) / CLOCK).powi(2);
        }
        Some(Fit { misfit, shapes })
    }

    fn misfit(&self, ends: [f64; 2]) -> f64 {
        self.fit(ends).map_or(f64::INFINITY, |fit| fit.misfit)
    }

    fn model(&self, ends: [f64; 2], shapes: &DVector<f64>) -> Vec<f64> {
        let mut row = vec![0.0; self.shapes.count];
        let mut all = Vec::with_capacity(self.values.len());
        for x in &self.clock {
            for i in 0..self.shapes.readings {
                let nominal = self.row(*x, i, ends, &mut row);
                all.push(nominal + row.iter().zip(shapes.iter()).map(|(a, b)| a * b).sum::<f64>());
            }
        }
        all
    }

    fn residuals(&self, ends: [f64; 2], shapes: &DVector<f64>) -> Vec<f64> {
        self.model(ends, shapes).iter().zip(&self.values).map(|(model, y)| y - model).collect()
    }

    /// Goes downhill from `ends` by steps that halve.
    fn descend(&self, mut ends: [f64; 2], step: f64, finest: f64) -> ([f64; 2], f64) {
        let mut best = self.misfit(ends);
        let mut step = step;
        while step > finest {
            let ways = [[1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [1.0, -1.0]];
            let around = ways.iter().flat_map(|w| [[w[0], w[1]], [-w[0], -w[1]]]);
            let tried: Vec<[f64; 2]> =
                around.map(|w| [ends[0] + step * w[0], ends[1] + step * w[1]]).collect();
            let misfits: Vec<f64> = tried.par_iter().map(|ends| self.misfit(*ends)).collect();
            let least = (0..tried.len()).min_by(|a, b| misfits[*a].total_cmp(&misfits[*b])).unwrap_or(0);
            if misfits[least] < best {
                (ends, best) = (tried[least], misfits[least]);
            } else {
                step /= 2.0;
            }
        }
        (ends, best)
    }

    /// Trials of start and end, all over.
    fn coarse(&self) -> Vec<([f64; 2], f64, f64)> {
        let (first, last) = (self.clock[0], self.clock[self.clock.len() - 1]);
        let all = last - first;
        let durations: Vec<f64> = match self.told {
            Some(told) => vec![told],
            None => {
                let (low, high) = (all / LONGEST, all / COVERED);
                let of = |k: usize| low * (high / low).powf(k as f64 / (DURATIONS - 1) as f64);
                (0..DURATIONS).map(of).collect()
            }
        };
        let trials: Vec<([f64; 2], f64)> = durations
            .into_iter()
            .flat_map(|duration| {
                let outside = (1.0 - COVERED) * duration;
                let (low, high) = (first - outside, last - duration + outside);
                let step = (duration / STARTS as f64).max((high - low) / (20 * STARTS) as f64);
                let count = ((high - low) / step).ceil().max(0.0) as usize;
                (0..=count).map(move |k| {
                    let start = low + step * k as f64;
                    ([start, start + duration], step)
                })
            })
            .collect();
        let misfits: Vec<f64> = trials.par_iter().map(|(ends, _)| self.misfit(*ends)).collect();
        trials.into_iter().zip(misfits).map(|((ends, step), misfit)| (ends, step, misfit)).collect()
    }
}

/// Noise of readings, m: of their second differences; where these say nothing, the step of their numbers.
pub(super) fn noise(values: &[f64], readings: usize) -> f64 {
    let mut seconds: Vec<f64> = (2 * readings..values.len())
        .map(|k| (values[k] - 2.0 * values[k - readings] + values[k - 2 * readings]).abs() / 6f64.sqrt())
        .collect();
    if seconds.is_empty() {
        return 0.0;
    }
    seconds.sort_by(f64::total_cmp);
    let median = 1.4826 * seconds[seconds.len() / 2];
    // Most differences of coarse numbers are none.
    let rms = (seconds.iter().map(|x| x * x).sum::<f64>() / seconds.len() as f64).sqrt();
    if median > 0.0 { median } else { rms }
}

/// Start and end of the path in the readings. `told`: its duration by the clock of the readings, if that is in s; `about`: the shapes
/// about a machine with amounts of others, since lengths do not grow linearly with what is wrong, and play takes its own width to cross.
pub(super) fn align(
    shapes: &Shapes,
    about: impl Fn(&Shapes, &DVector<f64>) -> Shapes,
    readings: &Readings,
    noise: f64,
    told: Option<f64>,
) -> Option<Found> {
    let coarse = Trial::new(shapes, readings, noise, told, COARSE);
    let mut tried: Vec<([f64; 2], f64, f64)> = coarse.coarse();
    tried.retain(|t| t.2.is_finite());
    tried.sort_by(|a, b| a.2.total_cmp(&b.2));
    // The best of each neighbourhood.
    let mut valleys: Vec<([f64; 2], f64)> = Vec::new();
    for (ends, step, _) in &tried {
        let far = |(other, _): &([f64; 2], f64)| (0..2).any(|e| (ends[e] - other[e]).abs() > 6.0 * step);
        if valleys.iter().all(far) {
            valleys.push((*ends, *step));
        }
        if valleys.len() == 8 {
            break;
        }
    }
    let spacing =
        (readings.clock[readings.clock.len() - 1] - readings.clock[0]) / readings.clock.len() as f64;
    let fine = Trial::new(shapes, readings, noise, told, FINE);
    let mut ends: Vec<([f64; 2], f64)> =
        valleys.iter().map(|(ends, step)| fine.descend(*ends, *step, step / 12.0)).collect();
    ends.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (mut best, step) = (ends.first()?.0, valleys.first()?.1);

    let mut full = Trial::new(shapes, readings, noise, told, FULL);
    best = full.descend(best, step / 8.0, 0.5 * spacing).0;
    let fit = full.fit(best)?;
    full.leave_out(&full.residuals(best, &fit.shapes));
    let mut nearer = about(shapes, &full.fit(best)?.shapes);
    for _ in 1..ROUNDS {
        let trial = Trial { shapes: &nearer, ..full.clone() };
        best = trial.descend(best, 4.0 * spacing, 0.02 * spacing).0;
        nearer = about(&nearer, &trial.fit(best)?.shapes);
    }
    let full = Trial { shapes: &nearer, ..full };
    best = full.descend(best, 4.0 * spacing, 2e-3 * spacing).0;
    let fit = full.fit(best)?;
    let residuals = full.residuals(best, &fit.shapes);
    let scale = full.scale(&residuals);
    // The same for what is compared at fewer places.
    let fine_fit = fine.fit(best)?;
    let fine_scale = fine.scale(&fine.residuals(best, &fine_fit.shapes));
    let apart = |e: &[f64; 2]| (0..2).any(|k| (e[k] - best[k]).abs() > 2.0 * step);
    let rival = ends.iter().find(|(e, _)| apart(e)).map(|(e, m)| (*e, (m - fine_fit.misfit) / fine_scale));

    let (errors, model) = (full.errors(best, fit.misfit, scale, spacing)?, full.model(best, &fit.shapes));
    let hides = {
        let at = |k: usize| {
            let mut ends = best;
            ends[k] += errors[k];
            rms(full.model(ends, &fit.shapes).iter().zip(&model).map(|(a, b)| a - b))
        };
        at(0).hypot(at(1))
    };
    let constant = full.constant();
    // So many shapes follow noise by this much.
    let followed = (constant - fit.misfit) / scale - 2.0 * full.shapes.count as f64;
    let spread = full.noise * (constant / full.values.len() as f64).sqrt();
    let spread = (spread.powi(2) - full.noise.powi(2) + noise.powi(2)).max(0.0).sqrt();
    // Means of neighbours have less noise than a reading.
    let left = rms(residuals.iter().zip(full.all_weights()).map(|(r, w)| r * w));
    let left = (left.powi(2) - full.noise.powi(2) + noise.powi(2)).max(0.0).sqrt();
    Some(Found { ends: best, errors, hides, spread, left, followed, rival })
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(sum, n), x| (sum + x * x, n + 1));
    (sum / count.max(1) as f64).sqrt()
}

impl Trial<'_> {
    fn all_weights(&self) -> impl Iterator<Item = f64> + '_ {
        self.weights.iter().flat_map(|w| std::iter::repeat_n(*w, self.shapes.readings))
    }

    fn leave_out(&mut self, residuals: &[f64]) {
        let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let limit = FAR * 1.4826 * sizes[sizes.len() / 2].max(self.noise);
        let m = self.shapes.readings;
        for (k, weight) in self.weights.iter_mut().enumerate() {
            let far = residuals[k * m..(k + 1) * m].iter().any(|r| r.abs() > limit);
            *weight = if far { 0.0 } else { 1.0 };
        }
    }

    /// What misfits differ by for chance: residuals are larger than the noise, and neighbours of them alike.
    fn scale(&self, residuals: &[f64]) -> f64 {
        let m = self.shapes.readings;
        let own: Vec<f64> = residuals.iter().zip(self.all_weights()).map(|(r, w)| r * w).collect();
        let square: f64 = own.iter().map(|r| r * r).sum();
        let count = self.weights.iter().sum::<f64>().max(1.0) * m as f64;
        let size = square / count / self.noise.powi(2);
        let mut alike = 1.0;
        for lag in 1..self.clock.len() / 10 {
            let product: f64 = own[lag * m..].iter().zip(&own).map(|(a, b)| a * b).sum();
            let correlation = product / square.max(f64::MIN_POSITIVE);
            if correlation < 0.05 {
                break;
            }
            alike += 2.0 * correlation;
        }
        size.max(1e-6) * alike
    }

    /// Standard uncertainties of both ends, from how the misfit rises about them.
    fn errors(&self, ends: [f64; 2], least: f64, scale: f64, spacing: f64) -> Option<[f64; 2]> {
        let rise = |by: [f64; 2]| {
            let at = |sign: f64| self.misfit([ends[0] + sign * by[0], ends[1] + sign * by[1]]);
            0.5 * (at(1.0) + at(-1.0)) - least
        };
        let all = self.clock[self.clock.len() - 1] - self.clock[0];
        // Steps at which the misfit has risen for good.
        let step = |way: [f64; 2]| {
            let mut step = 0.02 * spacing;
            while rise(way.map(|w| w * step)) < 2.0 * scale {
                step *= 2.0;
                if step > all {
                    return None;
                }
            }
            Some(step)
        };
        let (a, b) = (step([1.0, 0.0])?, step([0.0, 1.0])?);
        // The same way along and across the valley of both.
        let (both, apart) = (step([1.0, 1.0])?, step([1.0, -1.0])?);
        let curvature = |way: [f64; 2], step: f64| 2.0 * rise(way.map(|w| w * step)) / (step * step);
        let (h00, h11) = (curvature([1.0, 0.0], a), curvature([0.0, 1.0], b));
        let h01 = 0.25 * (curvature([1.0, 1.0], both) - curvature([1.0, -1.0], apart));
        let determinant = h00 * h11 - h01 * h01;
        if determinant.is_nan() || determinant <= 1e-9 * h00 * h11 {
            return None;
        }
        Some([h11, h00].map(|h| (2.0 * scale * h / determinant).sqrt()))
    }

    /// Misfit of readings that do nothing but stand.
    fn constant(&self) -> f64 {
        let m = self.shapes.readings;
        let total = self.weights.iter().sum::<f64>().max(1.0);
        (0..m)
            .map(|i| {
                let own = || self.weights.iter().enumerate().map(move |(k, w)| (*w, self.values[k * m + i]));
                let mean = own().map(|(w, y)| w * y).sum::<f64>() / total;
                own().map(|(w, y)| w * (y - mean).powi(2)).sum::<f64>()
            })
            .sum::<f64>()
            / self.noise.powi(2)
    }
}

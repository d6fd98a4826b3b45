//! The noise of the instrument: how large it is, how long it remembers, and which samples are no noise at all.
//!
//! Noise is judged by how much neighbouring readings differ, which a misfit that runs smoothly along the path does not touch;
//! `docs/diagnosis-method.md` (60), (61).

use std::collections::HashMap;

use super::linear::{Linear, Span};
use super::policy::Rule;
use crate::effects::RecordingFacts;

/// Noise of one kind of reading: first-order autoregressive, and rounding to the step of its readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Noise {
    /// Standard deviation, m or rad.
    pub sigma: f64,
    /// Correlation of neighbouring readings, rounding left aside, 0 up to below 1.
    pub rho: f64,
    /// Standard deviation of the rounding, which no reading remembers, m or rad.
    pub rounding: f64,
}

impl Noise {
    /// Whether it remembers so long that a misfit may have been taken for it.
    pub fn is_long(&self) -> bool {
        self.rho > LONG
    }

    /// The same differences from reading to reading, with a shorter memory.
    pub fn shortened(&self) -> Noise {
        let rounding = self.rounding.powi(2);
        let fresh = (self.sigma.powi(2) - rounding) * (1.0 - self.rho);
        match self.is_long() {
            true => {
                Noise { sigma: (fresh / (1.0 - LONG) + rounding).sqrt(), rho: LONG, rounding: self.rounding }
            }
            false => *self,
        }
    }

    /// Whether the difference matters to nothing.
    pub fn is_close(&self, other: &Noise) -> bool {
        (self.sigma / other.sigma).ln().abs() < 0.04 && (self.rho - other.rho).abs() < 0.04
    }
}

/// Beyond so many standard deviations of its surroundings a reading is an outlier.
const OUTLIER: f64 = 5.0;
/// The same of what was none before effects were found.
const FAR: f64 = 8.0;
/// So many samples before and behind a reversal belong to it, and so many reversals at which readings are off are more than chance, if
/// they are half of all.
const TURNING: usize = 5;
const TWICE: usize = 2;
/// So many readings on either side tell how rough it is around one.
const AROUND: usize = 15;
/// Readings differ by this part of the step that they are rounded to at least, though most of them may be the same.
const STEPS: f64 = 0.5;
/// No instrument resolves less, m or rad.
const FINEST: f64 = 1e-10;
/// Two estimates of the memory that differ by less tell of the same noise.
const ALIKE: f64 = 0.1;
/// Longest memory that is told from a drift.
const MOST_RHO: f64 = 0.97;
/// Memory that is common among instruments.
const LONG: f64 = 0.7;
/// Rounding is at most this part of the variance: what is rounded more coarsely has no noise to speak of besides, and rounding is not white.
const MOST_ROUNDED: f64 = 0.7;

/// Rows of one reading of one recording, in their order, without pauses.
pub(super) fn runs(linear: &Linear) -> Vec<Vec<usize>> {
    let mut runs = Vec::new();
    for (s, span) in linear.spans.iter().enumerate() {
        for reading in 0..span.readings {
            let mut run = Vec::new();
            let mut last: Option<f64> = None;
            for row in (span.rows.0 + reading..span.rows.1).step_by(span.readings) {
                let local = linear.sample[row] - span.samples.0;
                let time = linear.samples[s].time.as_ref().map(|t| t[local]);
                if is_pause(span, last, time) && !run.is_empty() {
                    runs.push(std::mem::take(&mut run));
                }
                last = time;
                run.push(row);
            }
            runs.push(run);
        }
    }
    runs
}

fn is_pause(span: &Span, last: Option<f64>, now: Option<f64>) -> bool {
    matches!((last, now), (Some(last), Some(now)) if now - last > span.pause_after)
}

/// Rows that lie far off their neighbours: by the median of the two on either side.
/// `smooth`: along a continuous path one scale holds for all; settled positions are compared with those around them.
pub(super) fn outliers(linear: &Linear, runs: &[Vec<usize>], smooth: bool) -> Vec<bool> {
    beyond(OUTLIER, linear, &linear.residual, runs, smooth)
}

/// The same of settled positions where effects were found, `residual` beside them: what was no outlier among all that they did has to be
/// farther off.
pub(super) fn outliers_again(
    was: &[bool],
    linear: &Linear,
    residual: &[f64],
    runs: &[Vec<usize>],
) -> Vec<bool> {
    let [off, far] = [OUTLIER, FAR].map(|deviations| beyond(deviations, linear, residual, runs, false));
    (0..was.len()).map(|row| far[row] || off[row] && was[row]).collect()
}

/// `deviations`: how many standard deviations are too many.
fn beyond(
    deviations: f64,
    linear: &Linear,
    residual: &[f64],
    runs: &[Vec<usize>],
    smooth: bool,
) -> Vec<bool> {
    let mut out = vec![false; residual.len()];
    for run in runs.iter().filter(|run| run.len() > 20) {
        let mut off: Vec<(usize, f64)> = Vec::with_capacity(run.len());
        for (i, row) in run.iter().enumerate() {
            let from = i.saturating_sub(3).min(run.len() - 7);
            let mut near: Vec<f64> =
                run[from..from + 7].iter().filter(|r| *r != row).map(|r| residual[*r]).collect();
            near.sort_by(f64::total_cmp);
            off.push((*row, residual[*row] - 0.5 * (near[2] + near[3])));
        }
        let mut sizes: Vec<f64> = off.iter().map(|(_, d)| d.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let least = (STEPS * linear.step(linear.angle[run[0]])).max(FINEST);
        let scale = (1.4826 * sizes[sizes.len() / 2]).max(least);
        for (i, (row, d)) in off.iter().enumerate().filter(|(_, (_, d))| d.abs() > deviations * scale) {
            if smooth {
                out[*row] = true;
                continue;
            }
            // Where it is rough all around, that is how it is there.
            let from = i.saturating_sub(AROUND).min(off.len().saturating_sub(2 * AROUND + 1));
            let around = &off[from..(from + 2 * AROUND + 1).min(off.len())];
            let mut near: Vec<f64> = around.iter().map(|(_, d)| d.abs()).collect();
            near.sort_by(f64::total_cmp);
            out[*row] = d.abs() > deviations * (1.4826 * near[near.len() / 2]).max(least);
        }
        // A reading next to which the path itself jumps is none.
        let flagged = run.iter().filter(|row| out[**row]).count();
        if flagged > run.len() / 10 {
            run.iter().for_each(|row| out[*row] = false);
        }
    }
    out
}

/// Outliers of a continuous path that come where one joint turns round, time after time, are what it does there: play that is crossed
/// within a few samples, a spike. They are none.
pub(super) fn spare_reversals(linear: &Linear, out: &mut [bool]) {
    let count = linear.spans.last().map_or(0, |span| span.samples.1);
    let mut off = vec![false; count];
    (out.iter().zip(&linear.sample)).for_each(|(out, sample)| off[*sample] |= out);
    let mut spared = vec![false; count];
    for j in 0..linear.samples.first().map_or(0, |samples| samples.joints.len()) {
        let turns = linear.spans.iter().zip(&linear.samples).flat_map(|(span, samples)| {
            let side = samples.joints[j].as_ref().map_or(&[][..], |joint| &joint.direction);
            let around = |k: usize| {
                let from = span.samples.0 + (k + 1).saturating_sub(TURNING);
                from..(span.samples.0 + k + 1 + TURNING).min(span.samples.1)
            };
            (1..side.len()).filter(|k| side[*k] != side[*k - 1]).map(around).collect::<Vec<_>>()
        });
        let turns: Vec<_> = turns.collect();
        let is_off = |around: &&std::ops::Range<usize>| off[(*around).clone()].contains(&true);
        let loud: Vec<_> = turns.iter().filter(is_off).collect();
        if loud.len() >= TWICE && 2 * loud.len() >= turns.len() && Rule::SparesReversals.decides() {
            loud.into_iter().for_each(|around| spared[around.clone()].fill(true));
        }
    }
    (out.iter_mut().zip(&linear.sample)).for_each(|(out, sample)| *out &= !spared[*sample]);
}

/// A joint stands still within this part of its travel.
const STILL: f64 = 1e-4;

/// Rows before anything moves in its recording: nobody knows from where the joints came to where they wait, and so in what state play,
/// friction and filters are. Recordings that stand still for half of their samples or more are meant to.
pub(super) fn waiting(linear: &Linear) -> Vec<bool> {
    let mut waiting = vec![false; linear.residual.len()];
    for (span, samples) in linear.spans.iter().zip(&linear.samples) {
        let moved = samples.joints.iter().flatten().filter_map(|joint| {
            let start = *joint.position.first()?;
            let far = joint.position.iter().fold(0.0f64, |far, q| far.max((q - start).abs()));
            joint.position.iter().position(|q| (q - start).abs() > STILL * far)
        });
        let still = moved.min().filter(|still| 2 * still < samples.len).unwrap_or(0);
        let rows = span.rows.0..span.rows.1;
        for (waits, sample) in waiting[rows.clone()].iter_mut().zip(&linear.sample[rows]) {
            *waits = sample - span.samples.0 < still.saturating_sub(1);
        }
    }
    waiting
}

/// Noise of every run, from what a model leaves; runs of the same quantity share theirs.
pub(super) fn of(
    linear: &Linear,
    left: &[f64],
    runs: &[Vec<usize>],
    out: &[bool],
    facts: &RecordingFacts,
) -> Vec<Noise> {
    let smooth = facts.are_smooth();
    let estimate = |angle: bool| {
        let own: Vec<&Vec<usize>> =
            runs.iter().filter(|run| run.first().is_some_and(|r| linear.angle[*r] == angle)).collect();
        if facts.approached
            && let Some(noise) = repeated(linear, left, &own, out)
        {
            return noise;
        }
        match !smooth && facts.time.is_some() && without_order(linear) {
            true => remembered(left, &own, out, linear.step(angle)),
            false => estimate(left, &own, out, smooth, linear.step(angle)),
        }
    };
    let (length, angle) = (estimate(false), estimate(true));
    runs.iter()
        .map(|run| if run.first().is_some_and(|r| linear.angle[*r]) { angle } else { length })
        .collect()
}

/// Half the mean square of differences over `lag` readings, outliers left out, what is beyond four standard deviations cut off.
fn structure(residual: &[f64], runs: &[&Vec<usize>], out: &[bool], lag: usize) -> Option<f64> {
    let mut squares: Vec<f64> = Vec::new();
    for run in runs {
        for i in lag..run.len() {
            let (a, b) = (run[i - lag], run[i]);
            if !out[a] && !out[b] {
                squares.push(0.5 * (residual[b] - residual[a]).powi(2));
            }
        }
    }
    if squares.len() < 30 {
        return None;
    }
    let mut cut = f64::INFINITY;
    let mut mean = 0.0;
    for _ in 0..4 {
        mean = squares.iter().map(|s| s.min(cut)).sum::<f64>() / squares.len() as f64;
        cut = 16.0 * mean;
    }
    Some(mean)
}

/// Correlation of readings so many apart, as they are, less what rounding (its variance) adds to each.
fn neighbours(residual: &[f64], runs: &[&Vec<usize>], out: &[bool], rounding: f64, lag: usize) -> f64 {
    let (mut products, mut squares) = (0.0, 0.0);
    let pairs = runs.iter().flat_map(|run| run.iter().zip(run.iter().skip(lag)));
    for (first, second) in pairs.filter(|(first, second)| !out[**first] && !out[**second]) {
        let (a, b) = (residual[*first], residual[*second]);
        products += a * b;
        squares += 0.5 * (a * a + b * b) - rounding;
    }
    if squares > 0.0 { products / squares } else { 0.0 }
}

/// Noise of some runs that share it. `smooth`: whether the path is followed continuously, so that neighbours see the same misfit;
/// `step`: of the readings, m or rad.
fn estimate(residual: &[f64], runs: &[&Vec<usize>], out: &[bool], smooth: bool, step: f64) -> Noise {
    let all: Vec<f64> =
        runs.iter().flat_map(|run| run.iter()).filter(|r| !out[**r]).map(|r| residual[*r]).collect();
    let total = (all.iter().map(|r| r * r).sum::<f64>() / all.len().max(1) as f64).max(FINEST * FINEST);
    let white = Noise { sigma: total.sqrt(), rho: 0.0, rounding: 0.0 };
    if !smooth {
        return white;
    }
    let [Some(one), Some(two), Some(three)] = [1, 2, 3].map(|lag| structure(residual, runs, out, lag)) else {
        return white;
    };
    let rounding = (step * step / 12.0).min(MOST_ROUNDED * one);
    let [one, two, three] = [one, two, three].map(|v| v - rounding);
    // (60): V_k = σ² (1 - ρ^k). Two estimates of ρ from the first three; misfits only raise them, so the smaller counts.
    let by_two = two / one - 1.0;
    let ratio = (three / one - 1.0).max(0.0);
    let by_three = 0.5 * ((1.0 + 4.0 * ratio).sqrt() - 1.0);
    let least = by_two.min(by_three);
    // Where that comes to nearly the same, neighbours as they are say it most exactly.
    let direct = neighbours(residual, runs, out, rounding, 1);
    let rho = if (direct - least).abs() < ALIKE { direct } else { least }.clamp(0.0, MOST_RHO);
    let rho = if rho < 0.03 { 0.0 } else { rho };
    let sigma2 = rounding + if rho == 0.0 { one } else { one / (1.0 - rho) };
    let rounding = if rho == 0.0 { 0.0 } else { rounding.sqrt() };
    Noise { sigma: sigma2.min(1.05 * total).sqrt().max(FINEST), rho, rounding }
}

/// Neighbours that go together by less than this are in no order.
const NO_ORDER: f64 = 0.3;
/// So many readings tell whether noise is remembered from one position to the next, beyond so many standard deviations of chance.
const POSITIONS: usize = 40;
const REMEMBERED: f64 = 2.5;
/// Memory that lasts longer than it begins to, by so many standard deviations of the second partial correlation, is a misfit.
const LASTING: f64 = 5.0;

/// Whether settled positions follow each other without order, so that what neighbours have in common is no misfit of the machine.
fn without_order(linear: &Linear) -> bool {
    let joints = linear.samples.first().map_or(0, |s| s.joints.len());
    let alike = |j: usize| {
        let columns = || linear.samples.iter().filter_map(|s| s.joints[j].as_ref());
        let count = columns().map(|c| c.position.len()).sum::<usize>().max(1) as f64;
        let mean = columns().flat_map(|c| &c.position).sum::<f64>() / count;
        let own = columns().flat_map(|c| &c.position).map(|q| (q - mean).powi(2)).sum::<f64>();
        let pairs = columns().flat_map(|c| c.position.windows(2));
        let common = pairs.map(|pair| (pair[0] - mean) * (pair[1] - mean)).sum::<f64>();
        if own > 0.0 { common / own } else { 0.0 }
    };
    (0..joints).all(|j| alike(j) < NO_ORDER)
}

/// Noise of settled positions without order: what is left, and what neighbours have in common. `step`: of the readings, m or rad.
fn remembered(residual: &[f64], runs: &[&Vec<usize>], out: &[bool], step: f64) -> Noise {
    let noise = estimate(residual, runs, out, false, 0.0);
    let rounding = (step * step / 12.0).min(MOST_ROUNDED * noise.sigma.powi(2));
    let count = runs.iter().flat_map(|run| run.iter()).filter(|row| !out[**row]).count();
    let [one, two] = [1, 2].map(|lag| neighbours(residual, runs, out, rounding, lag));
    let is_chance = count < POSITIONS || one * (count as f64).sqrt() < REMEMBERED;
    if is_chance {
        return noise;
    }
    // What noise remembers over two readings is the square of what it does over one. What lasts longer than that begins to is no noise,
    // and by (60) it adds nothing to the difference that the second reading makes.
    let lasts = (two - one * one) / (1.0 - one * one) * (count as f64).sqrt() > LASTING;
    let rho = if lasts { ((one - two) / (1.0 - one)).clamp(0.0, one) } else { one };
    Noise { rho: rho.min(MOST_RHO), rounding: rounding.sqrt(), ..noise }
}

/// So many differences within groups of repeated approaches say what the noise is.
const REPEATS: usize = 8;
/// Positions that differ by less than this part of the travel are one.
const SAME_PLACE: f64 = 1e-4;

/// Noise of positions that were approached again and again from the same side: what their readings scatter, whatever the misfit.
/// `None` where too few were.
fn repeated(linear: &Linear, residual: &[f64], runs: &[&Vec<usize>], out: &[bool]) -> Option<Noise> {
    let extents: Vec<f64> = (0..linear.samples.first()?.joints.len())
        .map(|j| {
            let all = linear.samples.iter().flat_map(|s| s.joints[j].iter().flat_map(|c| &c.position));
            let (low, high) =
                all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
            (high - low).max(FINEST)
        })
        .collect();
    let mut groups: HashMap<Vec<i64>, Vec<f64>> = HashMap::new();
    for row in runs.iter().flat_map(|run| run.iter()).filter(|row| !out[**row]) {
        let sample = linear.sample[*row];
        let s = linear.spans.iter().position(|s| (s.samples.0..s.samples.1).contains(&sample))?;
        let k = sample - linear.spans[s].samples.0;
        let mut place = vec![s as i64, linear.reading[*row] as i64];
        for (joint, extent) in linear.samples[s].joints.iter().zip(&extents) {
            let Some(joint) = joint else { continue };
            place.push((joint.position[k] / (SAME_PLACE * extent)).round() as i64);
            place.push(joint.direction[k] as i64);
        }
        groups.entry(place).or_default().push(residual[*row]);
    }
    let (mut squares, mut differences) = (0.0, 0);
    for group in groups.values() {
        let mean = group.iter().sum::<f64>() / group.len() as f64;
        squares += group.iter().map(|r| (r - mean).powi(2)).sum::<f64>();
        differences += group.len() - 1;
    }
    (differences >= REPEATS).then(|| Noise {
        sigma: (squares / differences as f64).sqrt().max(FINEST),
        rho: 0.0,
        rounding: 0.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    const COUNT: usize = 3000;
    const STEP: f64 = 1.2e-5;

    /// Memory of readings at settled positions: each `of` what was before and a new normal number, rounded.
    fn memory(mut of: impl FnMut(f64, f64) -> (f64, f64)) -> f64 {
        let mut random = rand::rngs::StdRng::seed_from_u64(5);
        let mut before = 0.0;
        let readings: Vec<f64> = (0..COUNT)
            .map(|_| {
                let normal = (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
                let read;
                (before, read) = of(before, normal);
                (1e-5 * read / STEP).round() * STEP
            })
            .collect();
        let run: Vec<usize> = (0..COUNT).collect();
        remembered(&readings, &[&run], &[false; COUNT], STEP).rho
    }

    #[test]
    fn noise_that_remembers_is_told_from_its_rounding() {
        for rho in [0.3, 0.6, 0.9] {
            let found = memory(|before, normal| {
                let now = rho * before + (1.0f64 - rho * rho).sqrt() * normal;
                (now, now)
            });
            assert!((found - rho).abs() < 0.08, "{rho}: {found}");
        }
    }

    #[test]
    fn what_lasts_longer_than_it_begins_to_is_no_memory() {
        let mut count = 0u32;
        let found = memory(|before, normal| {
            count += 1;
            let side = if before == 0.0 { 1.0 } else { before };
            let now = if count.is_multiple_of(23) || count.is_multiple_of(31) { -side } else { side };
            (now, now + normal)
        });
        assert!(found < 0.1, "{found}");
    }
}

//! An instrument that was moved while its set-up kept its name: what is left splits into two rigid groups in time.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::rows::{Rows, Seen};
use super::thinned::{Sample, Thinned};
use crate::error::Result;
use crate::identify::{CalibrateOptions, Plausibility, calibrate};
use crate::lie::Vec3;
use crate::machine::Machine;
use crate::recording::Measurement;

/// So many samples of a set-up, evenly spread, show a step.
const ENOUGH: usize = 2000;
/// A part has as many readings for each of its six unknowns at least, so that as much is left over as is used up.
const READINGS_EACH: usize = 2;
/// Two places are tried in earnest where one recording in a hundred without a step would show as much.
const BY_CHANCE: f64 = 0.01;
/// Two places must leave less than this part of what one leaves: three quarters of it were the step. Whatever else a machine does differently
/// from one half of a recording to the other would have to be as large as all the rest together.
const MOSTLY_THE_STEP: f64 = 0.5;
/// So large a part of the step is there between neighbours of the change, as lines through the quarters of both sides next to it have it; what
/// creeps or swings from one place to the other is no step.
const SUDDEN: f64 = 0.5;
const NEXT_TO_IT: usize = 4;
/// Two groups by the direction or the speed of a joint must not explain so large a part of what the step does: play and lag change with the
/// motion, and the motion may have changed there.
const BY_MOTION: f64 = 0.5;
/// Eigenvalues below this part of the largest are not seen.
const UNSEEN: f64 = 1e-9;

/// A set-up whose instrument stands in two places, one after the other.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moved {
    /// Name of the set-up; empty for the default one.
    pub setup: String,
    /// Recording of the first sample that belongs to the second place.
    pub recording: String,
    /// Its line.
    pub line: u64,
    /// Time there, s.
    pub time: Option<f64>,
    /// By how much the point that it measures on average moved with it, m; its own origin where it measures no position.
    pub by_m: f64,
    /// By how much it turned, rad.
    pub by_rad: f64,
    /// What is left with one place.
    pub left: Plausibility,
    /// What is left of the same readings with two places, m or rad.
    pub then: f64,
}

/// Looks for a set-up whose instrument was moved.
pub(super) fn moved(machine: &Machine, rows: &Rows) -> Result<Option<Moved>> {
    let setups: BTreeSet<&str> = rows.thinned.iter().map(|t| t.header.setup.as_str()).collect();
    for setup in setups {
        let mut own: Vec<&Seen> =
            rows.seen.iter().filter(|s| rows.thinned[s.recording].header.setup == setup).collect();
        let time = |s: &Seen| rows.thinned[s.recording].samples[s.place].time;
        if own.iter().all(|s| time(s).is_some()) {
            own.sort_by(|a, b| time(a).partial_cmp(&time(b)).unwrap_or(std::cmp::Ordering::Equal));
        }
        let own: Vec<&Seen> = own.iter().copied().step_by(own.len().div_ceil(ENOUGH).max(1)).collect();
        let Some(at) = change_point(&own) else { continue };
        if let Some(moved) = in_earnest(machine, rows, setup, own[at])? {
            return Ok(Some(moved));
        }
    }
    Ok(None)
}

/// Normal equations of a rigid motion, and of one that goes on with the running number.
struct Sums {
    matrices: Vec<[DMatrix<f64>; 3]>,
    gradients: Vec<[DVector<f64>; 2]>,
    readings: Vec<usize>,
}

impl Sums {
    fn of(all: &[&Seen]) -> Sums {
        let zero = || DMatrix::<f64>::zeros(6, 6);
        let none = || DVector::<f64>::zeros(6);
        let mut sums = Sums {
            matrices: vec![[zero(), zero(), zero()]],
            gradients: vec![[none(), none()]],
            readings: vec![0],
        };
        for (k, seen) in all.iter().enumerate() {
            let s = k as f64 / all.len() as f64;
            let ([mut m0, mut m1, mut m2], [mut g0, mut g1]) =
                (sums.matrices[k].clone(), sums.gradients[k].clone());
            for (row, residual) in seen.by_frame.iter().zip(&seen.residuals) {
                let row = DVector::from_column_slice(row);
                m0.ger(1.0, &row, &row, 1.0);
                m1.ger(s, &row, &row, 1.0);
                m2.ger(s * s, &row, &row, 1.0);
                g0.axpy(*residual, &row, 1.0);
                g1.axpy(s * residual, &row, 1.0);
            }
            sums.matrices.push([m0, m1, m2]);
            sums.gradients.push([g0, g1]);
            sums.readings.push(sums.readings[k] + seen.residuals.len());
        }
        sums
    }

    /// Samples `from` to `to`: matrices and gradients with the running number counted from `at`.
    fn between(&self, from: usize, to: usize, at: f64) -> ([DMatrix<f64>; 3], [DVector<f64>; 2]) {
        let matrix = |i: usize| &self.matrices[to][i] - &self.matrices[from][i];
        let gradient = |i: usize| &self.gradients[to][i] - &self.gradients[from][i];
        let (m0, m1, m2) = (matrix(0), matrix(1), matrix(2));
        let (g0, g1) = (gradient(0), gradient(1));
        let moved1 = &m1 - at * &m0;
        let moved2 = m2 - 2.0 * at * m1 + at * at * &m0;
        let moved_g = g1 - at * &g0;
        ([m0, moved1, moved2], [g0, moved_g])
    }

    /// The best rigid motion of these samples, and by how much it lowers the sum of squares.
    fn still(&self, from: usize, to: usize) -> (DVector<f64>, f64) {
        let ([matrix, ..], [gradient, _]) = self.between(from, to, 0.0);
        solved(matrix, &gradient)
    }

    /// The same of a motion that goes on evenly: where it is at `at`.
    fn going_on(&self, from: usize, to: usize, at: f64) -> (DVector<f64>, f64) {
        let ([m0, m1, m2], [g0, g1]) = self.between(from, to, at);
        let mut matrix = DMatrix::zeros(12, 12);
        for (row, column, part) in [(0, 0, &m0), (0, 6, &m1), (6, 0, &m1), (6, 6, &m2)] {
            matrix.view_mut((row, column), (6, 6)).copy_from(part);
        }
        let gradient = DVector::from_iterator(12, g0.iter().chain(g1.iter()).copied());
        let (both, gain) = solved(matrix, &gradient);
        (both.rows(0, 6).into_owned(), gain)
    }
}

fn solved(matrix: DMatrix<f64>, gradient: &DVector<f64>) -> (DVector<f64>, f64) {
    let scales = matrix.diagonal().map(|x| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
    let scaled = DMatrix::from_diagonal(&scales) * matrix * DMatrix::from_diagonal(&scales);
    let eigen = SymmetricEigen::new(scaled);
    let largest = eigen.eigenvalues.amax();
    let along = eigen.eigenvectors.tr_mul(&gradient.component_mul(&scales));
    let inverse = |i: usize| {
        if eigen.eigenvalues[i] > UNSEEN * largest { 1.0 / eigen.eigenvalues[i] } else { 0.0 }
    };
    let amounts = DVector::from_fn(along.len(), |i, _| inverse(i) * along[i]);
    let gain = along.dot(&amounts);
    ((eigen.eigenvectors * amounts).component_mul(&scales), gain)
}

/// The sample with which a second place would begin, if a step explains more than chance, more than a place that goes on evenly, and is
/// there between neighbours.
fn change_point(all: &[&Seen]) -> Option<usize> {
    let sums = Sums::of(all);
    let (count, readings) = (all.len(), *sums.readings.last()?);
    let least = 6 * READINGS_EACH;
    let (_, alone) = sums.still(0, count);
    let gain = |at: usize| sums.still(0, at).1 + sums.still(at, count).1 - alone;
    let possible =
        (1..count).filter(|at| sums.readings[*at] >= least && readings - sums.readings[*at] >= least);
    let (at, gain) = possible.map(|at| (at, gain(at))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let squares: f64 = all.iter().flat_map(|s| &s.residuals).map(|r| r * r).sum();
    let noise = (squares - alone - gain).max(0.0) / (readings.saturating_sub(18).max(1)) as f64;
    let chance = ChiSquared::new(6.0).ok()?.inverse_cdf(1.0 - BY_CHANCE / count as f64);
    let (_, evenly) = sums.going_on(0, count, 0.0);
    if gain <= chance * noise || gain <= evenly - alone {
        return None;
    }
    // The step as constants have it, and as lines on both sides have it there.
    let s = at as f64 / count as f64;
    let enough = |from: usize, to: usize| sums.readings[to] - sums.readings[from] >= 2 * least;
    let from = (0..at).rev().find(|from| NEXT_TO_IT * (at - from) >= at && enough(*from, at)).unwrap_or(0);
    let to =
        (at + 1..count).find(|to| NEXT_TO_IT * (to - at) >= count - at && enough(at, *to)).unwrap_or(count);
    let step = |far: DVector<f64>, near: DVector<f64>| -> f64 {
        let rows = all[from..to].iter().flat_map(|seen| &seen.by_frame);
        let by = far - near;
        rows.map(|row| DVector::from_column_slice(row).dot(&by).powi(2)).sum::<f64>().sqrt()
    };
    let constant = step(sums.still(at, count).0, sums.still(0, at).0);
    let near = |from: usize, to: usize| match enough(from, to) {
        true => sums.going_on(from, to, s).0,
        false => sums.still(from, to).0,
    };
    let sudden = step(near(at, to), near(from, at)) >= SUDDEN * constant;
    let commands = all[0].way.len();
    let by_motion = |c: usize| {
        let speed = |part: &[&Seen]| {
            let mut all: Vec<f64> = part.iter().map(|seen| seen.way[c].abs()).collect();
            all.sort_by(f64::total_cmp);
            all[all.len() / 2]
        };
        let between = (speed(&all[..at]) * speed(&all[at..])).sqrt();
        let by_direction = grouped(all, |seen| seen.way[c] > 0.0);
        by_direction.max(grouped(all, |seen| seen.way[c].abs() > between)) - alone
    };
    (sudden && (0..commands).all(|c| by_motion(c) < BY_MOTION * gain)).then_some(at)
}

/// By how much two rigid motions lower the sum of squares, one of each group.
fn grouped(all: &[&Seen], is_one: impl Fn(&Seen) -> bool) -> f64 {
    let (one, other): (Vec<&Seen>, Vec<&Seen>) = all.iter().copied().partition(|seen| is_one(seen));
    [one, other].iter().map(|group| Sums::of(group).still(0, group.len()).1).sum()
}

/// Calibrates with two places from that sample on.
fn in_earnest(machine: &Machine, rows: &Rows, setup: &str, first: &Seen) -> Result<Option<Moved>> {
    let at = &rows.thinned[first.recording].samples[first.place];
    let names =
        ["(first place)", "(second place)"].map(|place| format!("{setup} {place}").trim().to_string());
    let mut parts = Vec::new();
    for (index, thinned) in rows.thinned.iter().enumerate() {
        if thinned.header.setup != setup {
            parts.push(thinned.clone());
            continue;
        }
        let is_before = |place: usize| match (thinned.samples[place].time, at.time) {
            (Some(t), Some(from)) => t < from,
            _ => (index, place) < (first.recording, first.place),
        };
        let count = thinned.samples.len();
        let before = (0..count).filter(|place| is_before(*place)).count();
        for ((from, to), name) in [(0, before), (before, count)].into_iter().zip(&names) {
            if from < to {
                parts.push(thinned.part(from, to, name));
            }
        }
    }
    let read = parts.iter().map(|t| t.recording(machine)).collect::<Result<Vec<_>>>()?;
    let Ok((calibrated, fit)) = calibrate(machine, &read, CalibrateOptions::default()) else {
        return Ok(None);
    };
    let name = |t: &Thinned| t.name();
    let of_setup: Vec<String> = rows.thinned.iter().filter(|t| t.header.setup == setup).map(name).collect();
    let mut best: Option<(&Plausibility, f64)> = None;
    for left in rows.plausibility.iter().filter(|p| of_setup.contains(&p.recording)) {
        let same =
            |p: &&Plausibility| p.of_angles == left.of_angles && p.recording.starts_with(&left.recording);
        let own = fit.plausibility.iter().filter(same).map(|p| p.left);
        let Some(then) = own.max_by(f64::total_cmp) else { continue };
        if then < MOSTLY_THE_STEP * left.left
            && best.is_none_or(|(of, least)| then / left.left < least / of.left)
        {
            best = Some((left, then));
        }
    }
    let place = |name: &str| calibrated.setups().find(|(own, _)| *own == name).map(|(_, pose)| pose);
    let (Some((left, then)), Some(one), Some(other)) = (best, place(&names[0]), place(&names[1])) else {
        return Ok(None);
    };
    let thinned = &rows.thinned[first.recording];
    let mut mean = Vec3([0.0; 3]);
    if matches!(thinned.measurement, Measurement::Position | Measurement::Pose) {
        let point = |s: &Sample| Vec3([s.values[0], s.values[1], s.values[2]]);
        let sum = thinned.samples.iter().fold(mean, |sum, s| sum + point(s));
        mean = sum.times(1.0 / thinned.samples.len() as f64);
    }
    Ok(Some(Moved {
        setup: setup.into(),
        recording: thinned.name(),
        line: at.line,
        time: at.time,
        by_m: (one.transform(mean) - other.transform(mean)).norm(),
        by_rad: (one.inverse() * other).rotation_vector().norm(),
        left: left.clone(),
        then,
    }))
}

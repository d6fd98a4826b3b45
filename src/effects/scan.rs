//! All columns of a candidate over its whole grid, fast.
//!
//! Waves are most of a grid: sines and cosines of something that grows by equal steps from point to point. There a column follows
//! from the one before it by a turn of every sample, `exp(i (φ + δ)) = exp(i φ) exp(i δ)`: four multiplications instead of a sine.

use super::candidate::Candidate;
use crate::feature::{Feature, Samples};
use crate::scalar::sines_cosines;

/// Points that are turned on from one another before sines are taken anew: rounding adds up to 1e-14 or so.
const BLOCK: usize = 64;
/// Steps of a phase that differ by no more than this are equal, rad.
const EQUAL: f64 = 1e-9;

/// Points of the complex plane, one a sample.
struct Turn {
    sine: Vec<f64>,
    cosine: Vec<f64>,
}

impl Turn {
    fn of(phase: &[f64]) -> Self {
        let (sine, cosine) = sines_cosines(phase);
        Turn { sine, cosine }
    }

    fn advance(&mut self, step: &Turn) {
        let by = step.sine.iter().zip(&step.cosine);
        for ((s, c), (ds, dc)) in self.sine.iter_mut().zip(&mut self.cosine).zip(by) {
            (*s, *c) = (*s * dc + *c * ds, *c * dc - *s * ds);
        }
    }
}

/// Features that are waves with one and the same phase.
struct Wave {
    phase: Feature,
    /// Feature and whether it is the cosine.
    members: Vec<(usize, bool)>,
}

impl Candidate {
    /// Every feature at every sample: [`Feature::over`] for all of them, sines and cosines of one phase at once.
    pub fn over(&self, stretches: &[Samples], parameters: &[f64]) -> Vec<Vec<f64>> {
        let waves = self.waves();
        let mut columns = vec![Vec::new(); self.features.len()];
        for wave in &waves {
            let turn = Turn::of(&wave.phase.over(stretches, parameters));
            for (i, cosine) in &wave.members {
                columns[*i].clone_from(if *cosine { &turn.cosine } else { &turn.sine });
            }
        }
        for (feature, column) in self.features.iter().zip(&mut columns).filter(|(_, c)| c.is_empty()) {
            *column = feature.over(stretches, parameters);
        }
        columns
    }

    /// Features that are sines and cosines, by their phase.
    fn waves(&self) -> Vec<Wave> {
        let mut waves: Vec<Wave> = Vec::new();
        for (i, feature) in self.features.iter().enumerate() {
            let Some((cosine, phase)) = feature.wave() else { continue };
            match waves.iter_mut().find(|wave| wave.phase == phase) {
                Some(wave) => wave.members.push((i, cosine)),
                None => waves.push(Wave { phase, members: vec![(i, cosine)] }),
            }
        }
        waves
    }

    /// Calls `visit` with the index of every point of the grid, in order, and one column for each feature: [`Feature::over`] for
    /// all of them, to rounding.
    pub fn scan(&self, stretches: &[Samples], mut visit: impl FnMut(usize, &[Vec<f64>])) {
        let waves = if self.parameters.len() == 1 { self.waves() } else { Vec::new() };
        let mut columns = vec![Vec::new(); self.features.len()];
        let is_wave = |i: usize| waves.iter().any(|wave| wave.members.iter().any(|(m, _)| *m == i));
        for (block, points) in self.grid.chunks(BLOCK).enumerate() {
            let mut turns: Vec<Option<(Turn, Turn)>> =
                waves.iter().map(|wave| start(&wave.phase, stretches, points)).collect();
            for (p, point) in points.iter().enumerate() {
                for (i, feature) in self.features.iter().enumerate().filter(|(i, _)| !is_wave(*i)) {
                    columns[i] = feature.over(stretches, point);
                }
                for (wave, turn) in waves.iter().zip(&mut turns) {
                    let fresh;
                    let now = match turn {
                        Some((now, step)) => {
                            if p > 0 {
                                now.advance(step);
                            }
                            &*now
                        }
                        None => {
                            fresh = Turn::of(&wave.phase.over(stretches, point));
                            &fresh
                        }
                    };
                    for (i, cosine) in &wave.members {
                        columns[*i].clear();
                        columns[*i].extend_from_slice(if *cosine { &now.cosine } else { &now.sine });
                    }
                }
                visit(block * BLOCK + p, &columns);
            }
        }
    }
}

/// First turn and step of a block, if the phase grows by equal steps within it.
fn start(phase: &Feature, stretches: &[Samples], points: &[Vec<f64>]) -> Option<(Turn, Turn)> {
    let [first, second, .., last] = points else { return None };
    let at = |point: &[f64]| phase.over(stretches, point);
    let (first, second, last) = (at(first), at(second), at(last));
    let steps = (points.len() - 1) as f64;
    let even = (first.iter().zip(&second).zip(&last))
        .all(|((a, b), z)| ((z - a) - steps * (b - a)).abs() <= EQUAL * steps);
    // The step from the whole block keeps rounding of a single one from adding up.
    let step: Vec<f64> = first.iter().zip(&last).map(|(a, z)| (z - a) / steps).collect();
    even.then(|| (Turn::of(&first), Turn::of(&step)))
}

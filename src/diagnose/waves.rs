//! Candidates that are sines and cosines of one phase, over their whole grid at once.

use std::sync::Arc;

use super::coarse::Wave;
use super::equations::{Column, Key, key};
use super::passing::{Passed, add_energies};
use super::score::{Field, Rows};
use super::spectrum;
use crate::effects::{Candidate, Coefficient};
use crate::feature::Feature;

/// Rows on which the energy of waves is judged.
const MEMORIES: usize = 256;
/// Phases that differ by no more than this part of the largest are multiples of each other.
const STRAIGHT: f64 = 1e-9;

/// Columns of one phase that share their sums: weights of the samples, up to two, and energies of each pair of features at its factors.
struct Sums<'a> {
    x: &'a [f64],
    weights: [Vec<f64>; 2],
    pairs: Vec<(&'a [f64], [Vec<f64>; 2])>,
}

impl Rows<'_> {
    /// Energy that pairs of sine and cosine of one phase take away, at every point of the grid, as if they had nothing in common with
    /// the marginal; `None` if the features are no such pairs, or a phase is no multiple of one column.
    pub(super) fn harmonics(&self, i: usize, candidate: &Candidate, field: &Field) -> Option<Vec<f64>> {
        let waves = self.waves(i, candidate)?;
        let dual = field.dual.get_or_init(|| self.whitener.transposed(field.left.as_slice()));
        let mut sums: Vec<Sums> = Vec::new();
        for (pair, wave) in waves.iter().enumerate() {
            let own: Vec<&Coefficient> =
                candidate.coefficients.iter().filter(|c| c.order == 2 * pair).collect();
            for two in own.chunks(2) {
                let mut weights = [vec![0.0; wave.x.len()], vec![0.0; wave.x.len()]];
                let mut energies = [vec![0.0; wave.factors.len()], vec![0.0; wave.factors.len()]];
                for (c, part) in
                    two.iter().enumerate().flat_map(|(c, one)| one.parts.iter().map(move |p| (c, p)))
                {
                    let answer = self.answer(part.slot, part.direction);
                    answer.iter().zip(dual).enumerate().for_each(|(row, (a, d))| {
                        weights[c][self.linear.sample[row]] += a * d;
                    });
                    let more = self.energies((i, pair, key(part.slot, part.direction)), &answer, wave);
                    energies[c].iter_mut().zip(more.iter()).for_each(|(sum, more)| *sum += more);
                }
                if energies.iter().flatten().all(|energy| *energy <= 0.0) {
                    continue;
                }
                let alike = |s: &&mut Sums| {
                    s.weights == weights && s.x.iter().zip(&wave.x).all(|(a, b)| (a - b).abs() < STRAIGHT)
                };
                match sums.iter_mut().find(alike) {
                    Some(known) => known.pairs.push((&wave.factors, energies)),
                    None => sums.push(Sums { x: &wave.x, weights, pairs: vec![(&wave.factors, energies)] }),
                }
            }
        }
        let mut gains = vec![0.0; candidate.grid.len()];
        for Sums { x, weights: [first, second], pairs } in sums {
            let factors: Vec<f64> = pairs.iter().flat_map(|(factors, _)| factors.iter().copied()).collect();
            let powers = spectrum::powers(x, [&first, &second], &factors)?;
            for ((_, energies), powers) in pairs.iter().zip(powers.chunks_exact(gains.len())) {
                for (i, (powers, gain)) in powers.iter().zip(&mut gains).enumerate() {
                    for (power, energies) in powers.iter().zip(energies) {
                        *gain += if energies[i] > 0.0 { power / (0.5 * energies[i]) } else { 0.0 };
                    }
                }
            }
        }
        Some(gains)
    }

    /// Phases of candidate `i`, pair by pair.
    fn waves(&self, i: usize, candidate: &Candidate) -> Option<&[Wave]> {
        let first = || {
            let is_paired = candidate.features.len().is_multiple_of(2) && !candidate.features.is_empty();
            let pairs = candidate.features.chunks_exact(2).filter(|_| is_paired);
            let waves = pairs.map(|features| self.wave(candidate, features)).collect::<Option<Vec<_>>>();
            waves.filter(|all| !all.is_empty())
        };
        self.coarse.waves[i].get_or_init(first).as_deref()
    }

    /// Phase of one pair of features.
    fn wave(&self, candidate: &Candidate, features: &[Feature]) -> Option<Wave> {
        let samples = &self.linear.samples;
        let (first, last) = (candidate.grid.first()?, candidate.grid.last()?);
        let ((_, phase), (_, other)) = (features[0].wave()?, features[1].wave()?);
        if phase != other {
            return None;
        }
        let x = phase.over(samples, first);
        let reference = (0..x.len()).max_by(|a, b| x[*a].abs().total_cmp(&x[*b].abs()))?;
        let at_last = phase.over(samples, last);
        let factor = at_last[reference] / x[reference];
        let straight = |k: usize| (at_last[k] - factor * x[k]).abs() <= STRAIGHT * at_last[reference].abs();
        if !(factor.is_finite() && (0..x.len()).all(straight)) {
            return None;
        }
        // The phase at one sample tells the factor at every point.
        let spans = &self.linear.spans;
        let s = spans.iter().position(|span| (span.samples.0..span.samples.1).contains(&reference))?;
        let one = [samples[s].chosen(&[reference - spans[s].samples.0])];
        let at = |point: &Vec<f64>| phase.over(&one, point).first().copied().unwrap_or(f64::NAN);
        let factors = candidate.grid.iter().map(at).collect();
        Some(Wave { x: x.iter().map(|phase| phase / x[reference]).collect(), factors })
    }

    /// Energy of an answer times a wave, at every point of the grid.
    fn energies(&self, key: (usize, usize, Key), answer: &[f64], wave: &Wave) -> Column {
        if let Some(known) = self.energies.lock().ok().and_then(|map| map.get(&key).cloned()) {
            return known;
        }
        let mut energies = vec![0.0; wave.factors.len()];
        self.wave_energies(answer, &wave.x, &wave.factors, &mut energies);
        let energies = Arc::new(energies);
        if let Ok(mut map) = self.energies.lock() {
            map.insert(key, energies.clone());
        }
        energies
    }

    /// Adds the energy of `answer` times a wave, whitened, at every factor of the phase: noise that remembers weighs fast waves more
    /// than slow ones.
    fn wave_energies(&self, answer: &[f64], x: &[f64], factors: &[f64], energies: &mut [f64]) {
        let mut plain = vec![0.0; answer.len()];
        self.whitener.plain(answer, &mut plain);
        let step = plain.len().div_ceil(MEMORIES).max(1);
        let looked_at = (0..plain.len()).step_by(step).map(|row| {
            let energy = plain[row] * plain[row] * step as f64;
            let (before, rho, rounded) = self.whitener.memory(row).unwrap_or((row, 0.0, 0.0));
            Passed {
                energy,
                rho,
                rounded,
                advance: x[self.linear.sample[row]] - x[self.linear.sample[before]],
            }
        });
        let (remembering, forgetful): (Vec<_>, Vec<_>) = looked_at.partition(|row| row.rho > 0.0);
        let constant: f64 = forgetful.iter().map(|row| row.energy).sum();
        add_energies(&remembering, constant, factors, energies);
    }
}

//! Candidates that are sines and cosines of one phase, over their whole grid at once.

use super::score::{Field, Rows};
use super::spectrum;
use crate::effects::{Candidate, Coefficient};

/// Rows on which the energy of waves is judged.
const MEMORIES: usize = 256;
/// Of more frequencies, the energy is asked at so many.
const KNOTS: usize = 1000;

impl Rows<'_> {
    /// Energy that a pair of sine and cosine of one phase takes away, at every point of the grid, as if it had nothing in common with
    /// the space; `None` if the features are no such pair, or the phase is no multiple of one column.
    pub(super) fn harmonics(&self, candidate: &Candidate, field: &Field) -> Option<Vec<f64>> {
        let samples = &self.linear.samples;
        let (first, last) = (candidate.grid.first()?, candidate.grid.last()?);
        let dual = self.whitener.transposed(field.left.as_slice());
        let mut gains = vec![0.0; candidate.grid.len()];
        if candidate.features.len() % 2 == 1 || candidate.features.is_empty() {
            return None;
        }
        for (pair, features) in candidate.features.chunks_exact(2).enumerate() {
            let ((_, phase), (_, other)) = (features[0].wave()?, features[1].wave()?);
            if phase != other {
                return None;
            }
            let x = phase.over(samples, first);
            let reference = (0..x.len()).max_by(|a, b| x[*a].abs().total_cmp(&x[*b].abs()))?;
            let at_last = phase.over(samples, last);
            let factor = at_last[reference] / x[reference];
            let straight = |k: usize| (at_last[k] - factor * x[k]).abs() <= 1e-9 * at_last[reference].abs();
            if !(factor.is_finite() && (0..x.len()).all(straight)) {
                return None;
            }
            // The phase at one sample tells the factor at every point.
            let spans = &self.linear.spans;
            let s = spans.iter().position(|span| (span.samples.0..span.samples.1).contains(&reference))?;
            let one = [samples[s].chosen(&[reference - spans[s].samples.0])];
            let factors: Vec<f64> = (candidate.grid.iter())
                .map(|point| phase.over(&one, point).first().map_or(f64::NAN, |phase| phase / x[reference]))
                .collect();
            let own: Vec<&Coefficient> =
                candidate.coefficients.iter().filter(|c| c.order == 2 * pair).collect();
            for two in own.chunks(2) {
                let mut weights = [vec![0.0; x.len()], vec![0.0; x.len()]];
                let mut energies = [vec![0.0; factors.len()], vec![0.0; factors.len()]];
                for (coefficient, (weights, energies)) in
                    two.iter().zip(weights.iter_mut().zip(&mut energies))
                {
                    for part in &coefficient.parts {
                        let answer = self.answer(part.slot, part.direction);
                        answer.iter().zip(&dual).enumerate().for_each(|(row, (a, d))| {
                            weights[self.linear.sample[row]] += a * d;
                        });
                        self.wave_energies(&answer, &x, &factors, energies);
                    }
                }
                if energies.iter().flatten().all(|energy| *energy <= 0.0) {
                    continue;
                }
                let powers = spectrum::powers(&x, [&weights[0], &weights[1]], &factors)?;
                for (i, (powers, gain)) in powers.iter().zip(&mut gains).enumerate() {
                    for (power, energies) in powers.iter().zip(&energies) {
                        *gain += if energies[i] > 0.0 { power / (0.5 * energies[i]) } else { 0.0 };
                    }
                }
            }
        }
        Some(gains)
    }

    /// Adds the energy of `answer` times a wave, whitened, at every factor of the phase: noise that remembers weighs fast waves more
    /// than slow ones.
    fn wave_energies(&self, answer: &[f64], x: &[f64], factors: &[f64], energies: &mut [f64]) {
        let mut plain = vec![0.0; answer.len()];
        self.whitener.plain(answer, &mut plain);
        let step = plain.len().div_ceil(MEMORIES).max(1);
        // (energy, what is remembered, what of that is rounding, advance of the phase) of the rows that are looked at.
        let looked_at = (0..plain.len()).step_by(step).map(|row| {
            let energy = plain[row] * plain[row] * step as f64;
            let (before, rho, rounded) = self.whitener.memory(row).unwrap_or((row, 0.0, 0.0));
            (energy, rho, rounded, x[self.linear.sample[row]] - x[self.linear.sample[before]])
        });
        let (remembering, forgetful): (Vec<_>, Vec<_>) = looked_at.partition(|(_, rho, ..)| *rho > 0.0);
        let constant: f64 = forgetful.iter().map(|(energy, ..)| energy).sum();
        let at = |factor: f64| {
            let of = |(energy, rho, rounded, advance): &(f64, f64, f64, f64)| {
                let cos = (factor * advance).cos();
                let passes = |part: f64| 1.0 + part * part - 2.0 * part * cos;
                energy * passes(*rho) / passes(*rounded)
            };
            constant + remembering.iter().map(of).sum::<f64>()
        };
        if remembering.is_empty() || factors.len() <= KNOTS {
            energies.iter_mut().zip(factors).for_each(|(sum, factor)| *sum += at(*factor));
            return;
        }
        // It changes as slowly with the factor as the phase advances from row to row: knots are enough.
        let stride = factors.len().div_ceil(KNOTS);
        for from in (0..factors.len()).step_by(stride) {
            let to = (from + stride).min(factors.len() - 1);
            let (first, last) = (at(factors[from]), at(factors[to]));
            for i in from..(from + stride).min(factors.len()) {
                let extent = factors[to] - factors[from];
                let part = if extent == 0.0 { 0.0 } else { (factors[i] - factors[from]) / extent };
                energies[i] += first + part * (last - first);
            }
        }
    }
}

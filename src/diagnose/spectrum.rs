//! Sums of weighted sines and cosines at many frequencies at once.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, PoisonError};

use rustfft::algorithm::Radix4;
use rustfft::algorithm::butterflies::{Butterfly12, Butterfly24};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftDirection};

use crate::scalar::sines_cosines;

/// Absolute values squared of `Σ_i w_i exp(i κ x_i)` at each of these `κ`, of two columns of weights; `None` where there is no extent.
///
/// Frequencies are taken band by band, each shifted to nought: a grid of positions fine enough for the highest one would be too long.
pub(super) fn powers(x: &[f64], weights: [&[f64]; 2], kappas: &[f64]) -> Option<Vec<[f64; 2]>> {
    let (from, to) =
        x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    let extent = to - from;
    let largest = kappas.iter().fold(0.0, |most: f64, kappa| most.max(kappa.abs()));
    if !(extent > 0.0 && extent.is_finite() && largest > 0.0 && largest.is_finite()) {
        return None;
    }
    // Of a real column, what stands at the opposite frequency is the conjugate: bands of a single one lie above nought, those of two
    // about it.
    let is_single = weights[1].iter().all(|w| *w == 0.0);
    let raised = if is_single { 1.0 } else { 0.0 };
    // The highest frequency needs no band of its own.
    let half = (largest / (1.0 + raised)).min(WIDEST * TAU / extent) * (1.0 + 1e-9);
    let band_of = |kappa: f64| (0.5 * (kappa.abs() / half + 1.0 - raised)) as usize;
    let mut order: Vec<usize> = (0..kappas.len()).collect();
    order.sort_by_key(|i| band_of(kappas[*i]));
    let mut powers = vec![[0.0; 2]; kappas.len()];
    for own in order.chunk_by(|a, b| band_of(kappas[*a]) == band_of(kappas[*b])) {
        let middle = half * (2.0 * band_of(kappas[own[0]]) as f64 + raised);
        let above = Band::new(x, (from, extent), weights, middle, half);
        if is_single {
            own.iter().for_each(|i| powers[*i][0] = above.at(kappas[*i].abs()).norm_sqr());
            continue;
        }
        let below = (middle > 0.0).then(|| Band::new(x, (from, extent), weights, -middle, half));
        for i in own {
            let kappa = kappas[*i].abs();
            let here = above.at(kappa);
            let mirrored = below.as_ref().unwrap_or(&above).at(-kappa).conj();
            powers[*i] = [here + mirrored, here - mirrored].map(|twice| 0.25 * twice.norm_sqr());
        }
    }
    Some(powers)
}

/// The sums about one frequency, up to phases that all columns share.
///
/// The weights are shared out over an even grid of positions, four to the shortest period, and transformed; between the frequencies of
/// the transform the nearest is taken, of which there are eight to the width of a line. Two real columns make one complex one.
struct Band {
    middle: f64,
    /// All frequencies of the grid alone, then those next to them, so many times.
    both: Vec<Complex<f64>>,
    shifts: usize,
    /// Between neighbouring frequencies of the transform, rad per unit of `x`.
    step: f64,
    /// Width of a cell of the grid.
    cell: f64,
}

/// Lines in half a band.
const WIDEST: f64 = 8192.0;
/// Frequencies to the width of a line.
const PADDED: usize = 8;
/// Grids of fewer cells are transformed with their zeros.
const SHORT: f64 = 12.0;

/// A transform, and by what the grid is turned for frequencies next to its own.
struct Transform {
    radix: Radix4<f64>,
    turns: Vec<Complex<f64>>,
}

/// The transforms so far, by length, for all threads: each is as large as what it transforms.
static TRANSFORMS: Mutex<BTreeMap<usize, Arc<Transform>>> = Mutex::new(BTreeMap::new());

impl Band {
    fn new(x: &[f64], (from, extent): (f64, f64), weights: [&[f64]; 2], middle: f64, half: f64) -> Self {
        let cells = (4.0 * extent * half / TAU).ceil() + 2.0;
        let cell = extent / (cells - 2.0);
        // The grid is followed by zeros; a long one is transformed alone, shift by shift.
        let (shifts, padded) = if cells < SHORT { (1, PADDED) } else { (PADDED, 1) };
        let length = fast(padded * cells as usize);
        let mut grid = vec![Complex::new(0.0, 0.0); length];
        let [first, second] = weights;
        let shift = (middle != 0.0).then(|| {
            let angles: Vec<f64> = x.iter().map(|x| -middle * (x - from)).collect();
            sines_cosines(&angles)
        });
        for (k, (x, (a, b))) in x.iter().zip(first.iter().zip(second)).enumerate() {
            let at = (x - from) / cell;
            let (index, part) = (at as usize, at.fract());
            let mut weight = Complex::new(*a, *b);
            if let Some((sines, cosines)) = &shift {
                weight *= Complex::new(cosines[k], sines[k]);
            }
            grid[index] += weight * (1.0 - part);
            grid[index + 1] += weight * part;
        }
        let transform = {
            let mut known = TRANSFORMS.lock().unwrap_or_else(PoisonError::into_inner);
            known.entry(length).or_insert_with(|| Arc::new(Transform::new(length))).clone()
        };
        let both = transform.shifted(grid, shifts);
        Band { middle, step: TAU / (both.len() as f64 * cell), both, shifts, cell }
    }

    fn at(&self, kappa: f64) -> Complex<f64> {
        let off = kappa - self.middle;
        let away = (off.abs() / self.step).round() as usize;
        let index = if off < 0.0 && away > 0 { self.both.len() - away } else { away };
        // Sharing a weight out between two cells dampens short periods, by the square of sin(h)/h, h up to 45°.
        let h = (0.5 * off * self.cell).powi(2);
        let sinc = 1.0 - h / 6.0 * (1.0 - h / 20.0 * (1.0 - h / 42.0));
        self.both[index % self.shifts * (self.both.len() / self.shifts) + index / self.shifts] / (sinc * sinc)
    }
}

impl Transform {
    fn new(length: usize) -> Self {
        let angles: Vec<f64> = (0..length).map(|n| -TAU * n as f64 / (PADDED * length) as f64).collect();
        let (sines, cosines) = sines_cosines(&angles);
        let turns = cosines.into_iter().zip(sines).map(|(cosine, sine)| Complex::new(cosine, sine)).collect();
        Transform { radix: transform(length), turns }
    }

    /// The transform of a grid that is followed by zeros, so many times as long with them: first every so manieth frequency, then those next to these,
    /// and so on. Each of them is a transform of the grid alone, which stays in a core's cache.
    fn shifted(&self, mut grid: Vec<Complex<f64>>, shifts: usize) -> Vec<Complex<f64>> {
        let mut scratch = vec![Complex::new(0.0, 0.0); self.radix.get_inplace_scratch_len()];
        let mut all = Vec::with_capacity(shifts * grid.len());
        for shift in 0..shifts {
            if shift > 0 {
                grid.iter_mut().zip(&self.turns).for_each(|(x, turn)| *x *= turn);
            }
            let from = all.len();
            all.extend_from_slice(&grid);
            self.radix.process_with_scratch(&mut all[from..], &mut scratch);
        }
        all
    }
}

/// The next length that is a power of two or three times one.
fn fast(least: usize) -> usize {
    let two = least.next_power_of_two();
    if two.is_multiple_of(4) && 3 * (two / 4) >= least { 3 * (two / 4) } else { two }
}

/// The transform of a length that [`fast`] gives.
///
/// rustfft's planner would compile its algorithms for every length and every set of instructions, a third of all code of this crate.
fn transform(length: usize) -> Radix4<f64> {
    let direction = FftDirection::Forward;
    if length.is_power_of_two() {
        return Radix4::new(length, direction);
    }
    let twos = length.trailing_zeros();
    let base: Arc<dyn Fft<f64>> = match twos % 2 {
        0 => Arc::new(Butterfly12::new(direction)),
        _ => Arc::new(Butterfly24::new(direction)),
    };
    Radix4::new_with_base((twos - 2) / 2, base)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_those_of_the_direct_sums() {
        let x: Vec<f64> = (0..700).map(|i| 3.0 + i as f64 * 0.01 + 0.004 * (i as f64).sin()).collect();
        let first: Vec<f64> = x.iter().map(|x| (17.3 * x).sin() + 0.2 * (40.0 * x).cos()).collect();
        let second: Vec<f64> = x.iter().map(|x| (25.0 * x + 0.3).sin()).collect();
        let direct = |w: &[f64], kappa: f64| {
            let (s, c) = x
                .iter()
                .zip(w)
                .fold((0.0, 0.0), |(s, c), (x, w)| (s + w * (kappa * x).sin(), c + w * (kappa * x).cos()));
            s * s + c * c
        };
        let largest = direct(&first, 17.3);
        let kappas = [5.0, 17.3, 17.5, 25.0, 40.0, 58.0];
        let powers = powers(&x, [&first, &second], &kappas).expect("an extent");
        for (kappa, powers) in kappas.into_iter().zip(powers) {
            for (found, w) in powers.into_iter().zip([&first, &second]) {
                let exact = direct(w, kappa);
                assert!((found - exact).abs() < 0.1 * exact + 2e-3 * largest, "{kappa}: {found} {exact}");
            }
        }
    }

    #[test]
    fn a_column_alone_has_the_powers_that_it_has_beside_another() {
        let x: Vec<f64> = (0..2000).map(|i| 0.3 * i as f64 + 0.1 * (i as f64).sin()).collect();
        let first: Vec<f64> = x.iter().map(|x| (0.7 * x).sin() + 0.3 * (2.9 * x).cos()).collect();
        let second: Vec<f64> = x.iter().map(|x| (1.3 * x).cos()).collect();
        let kappas: Vec<f64> = (1..=300).map(|i| 0.01 * f64::from(i)).collect();
        let beside = powers(&x, [&first, &second], &kappas).expect("an extent");
        let alone = powers(&x, [&first, &vec![0.0; x.len()]], &kappas).expect("an extent");
        let largest = alone.iter().map(|p| p[0]).fold(0.0, f64::max);
        for (kappa, (alone, beside)) in kappas.iter().zip(alone.iter().zip(&beside)) {
            assert!((alone[0] - beside[0]).abs() < 0.02 * largest, "{kappa}: {} {}", alone[0], beside[0]);
        }
    }

    #[test]
    fn bands_see_what_one_grid_would_be_too_long_for() {
        let x: Vec<f64> =
            (0..3000).map(|i| 0.35 * f64::from(i % 2999) / 2999.0 + 1e-5 * (f64::from(i)).sin()).collect();
        let lines: [f64; 3] = [1_234.5, 567_890.1, 1_400_000.7];
        let noise: Vec<f64> = x.iter().map(|x| (7.1e5 * x * x).sin()).collect();
        for line in lines {
            let wave: Vec<f64> = x.iter().map(|x| (line * x + 0.4).sin()).collect();
            let exact: f64 = x.iter().zip(&wave).map(|(x, w)| w * (line * x).sin()).sum::<f64>().powi(2)
                + x.iter().zip(&wave).map(|(x, w)| w * (line * x).cos()).sum::<f64>().powi(2);
            let kappas = [300.0, line, 1.5e6];
            let found = powers(&x, [&noise, &wave], &kappas).expect("an extent");
            assert!((found[1][1] / exact - 1.0).abs() < 0.1, "{line}: {} {exact}", found[1][1]);
            assert!(found[1][0] < 0.05 * exact && found[0][1] < 0.05 * exact && found[2][1] < 0.05 * exact);
        }
    }
}

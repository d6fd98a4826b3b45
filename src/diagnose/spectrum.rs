//! Sums of weighted sines and cosines at many frequencies at once.

use std::cell::RefCell;
use std::f64::consts::TAU;

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// `Σ_i w_i exp(i κ x_i)` as a function of `κ`, for `|κ|` up to a largest value, of two columns of weights.
///
/// The weights are shared out over an even grid of positions, four or more to the shortest period, and transformed; between the
/// frequencies of the transform the nearest is taken, of which there are eight to the width of a line. Two real columns make one
/// complex one.
pub(super) struct Spectrum {
    both: Vec<Complex<f64>>,
    /// Between neighbouring frequencies of the transform, rad per unit of `x`.
    step: f64,
    /// Width of a cell of the grid.
    cell: f64,
}

/// A longer transform is not made.
const LONGEST: usize = 1 << 22;
/// Frequencies to the width of a line.
const PADDED: usize = 8;

thread_local! {
    /// Keeps what transforms of one length have in common.
    static PLANNER: RefCell<FftPlanner<f64>> = RefCell::new(FftPlanner::new());
}

impl Spectrum {
    /// `None` where the grid would be too long or there is no extent.
    pub fn new(x: &[f64], weights: [&[f64]; 2], largest: f64) -> Option<Spectrum> {
        let (from, to) =
            x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
        let extent = to - from;
        if !(extent > 0.0 && extent.is_finite() && largest > 0.0) {
            return None;
        }
        let cells = (4.0 * extent * largest / TAU).ceil() + 2.0;
        if cells.is_nan() || cells * PADDED as f64 >= LONGEST as f64 {
            return None;
        }
        let cell = extent / (cells - 2.0);
        let length = fast(PADDED * cells as usize);
        let mut both = vec![Complex::new(0.0, 0.0); length];
        let [first, second] = weights;
        for (x, (a, b)) in x.iter().zip(first.iter().zip(second)) {
            let at = (x - from) / cell;
            let (index, part) = (at as usize, at.fract());
            let weight = Complex::new(*a, *b);
            both[index] += weight * (1.0 - part);
            both[index + 1] += weight * part;
        }
        PLANNER.with_borrow_mut(|planner| planner.plan_fft_forward(length)).process(&mut both);
        Some(Spectrum { step: TAU / (length as f64 * cell), both, cell })
    }

    /// Absolute values squared of both sums at `κ`.
    pub fn powers(&self, kappa: f64) -> [f64; 2] {
        let index = (kappa.abs() / self.step).round() as usize;
        let Some(here) = self.both.get(index) else { return [0.0; 2] };
        // Of a real column, what stands at the opposite frequency is the conjugate.
        let mirrored = self.both[(self.both.len() - index) % self.both.len()].conj();
        // Sharing a weight out between two cells dampens short periods.
        let half = 0.5 * kappa * self.cell;
        let sinc = if half.abs() < 1e-6 { 1.0 } else { half.sin() / half };
        [here + mirrored, here - mirrored].map(|twice| 0.25 * twice.norm_sqr() / sinc.powi(4))
    }
}

/// The next length that is a power of two or three times one.
fn fast(least: usize) -> usize {
    let two = least.next_power_of_two();
    if two.is_multiple_of(4) && 3 * (two / 4) >= least { 3 * (two / 4) } else { two }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_those_of_the_direct_sums() {
        let x: Vec<f64> = (0..700).map(|i| 3.0 + i as f64 * 0.01 + 0.004 * (i as f64).sin()).collect();
        let first: Vec<f64> = x.iter().map(|x| (17.3 * x).sin() + 0.2 * (40.0 * x).cos()).collect();
        let second: Vec<f64> = x.iter().map(|x| (25.0 * x + 0.3).sin()).collect();
        let spectrum = Spectrum::new(&x, [&first, &second], 60.0).expect("an extent");
        let direct = |w: &[f64], kappa: f64| {
            let (s, c) = x
                .iter()
                .zip(w)
                .fold((0.0, 0.0), |(s, c), (x, w)| (s + w * (kappa * x).sin(), c + w * (kappa * x).cos()));
            s * s + c * c
        };
        let largest = direct(&first, 17.3);
        for kappa in [5.0, 17.3, 17.5, 25.0, 40.0, 58.0] {
            for (found, w) in spectrum.powers(kappa).into_iter().zip([&first, &second]) {
                let exact = direct(w, kappa);
                assert!((found - exact).abs() < 0.1 * exact + 2e-3 * largest, "{kappa}: {found} {exact}");
            }
        }
    }
}

//! Sums of weighted sines and cosines at many frequencies at once.

use std::f64::consts::{PI, TAU};

/// `Σ_i w_i exp(i κ x_i)` as a function of `κ`, for `|κ|` up to a largest value; real and imaginary part.
///
/// The weights are shared out over an even grid of positions, four or more to the shortest period, and transformed; between the
/// frequencies of the transform the nearest is taken, of which there are eight to the width of a line.
pub(super) struct Spectrum {
    re: Vec<f64>,
    im: Vec<f64>,
    /// Between neighbouring frequencies of the transform, rad per unit of `x`.
    step: f64,
    /// Width of a cell of the grid.
    cell: f64,
    from: f64,
}

/// A longer transform is not made.
const LONGEST: usize = 1 << 22;

impl Spectrum {
    /// `None` where the grid would be too long or there is no extent.
    pub fn new(x: &[f64], w: &[f64], largest: f64) -> Option<Spectrum> {
        let (from, to) =
            x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
        let extent = to - from;
        if !(extent > 0.0 && extent.is_finite() && largest > 0.0) {
            return None;
        }
        let cells = (4.0 * extent * largest / TAU).ceil() + 2.0;
        if cells.is_nan() || cells * 8.0 >= LONGEST as f64 {
            return None;
        }
        let cell = extent / (cells - 2.0);
        let length = (8 * cells as usize).next_power_of_two();
        let (mut re, mut im) = (vec![0.0; length], vec![0.0; length]);
        for (x, w) in x.iter().zip(w) {
            let at = (x - from) / cell;
            let (index, part) = (at as usize, at.fract());
            re[index] += (1.0 - part) * w;
            re[index + 1] += part * w;
        }
        transform(&mut re, &mut im);
        Some(Spectrum { step: TAU / (length as f64 * cell), re, im, cell, from })
    }

    /// Absolute value squared of the sum at `κ`.
    pub fn power(&self, kappa: f64) -> f64 {
        let index = (kappa.abs() / self.step).round() as usize;
        let Some((re, im)) = self.re.get(index).zip(self.im.get(index)) else { return 0.0 };
        // Sharing a weight out between two cells dampens short periods.
        let half = 0.5 * kappa * self.cell;
        let sinc = if half.abs() < 1e-6 { 1.0 } else { half.sin() / half };
        let _ = self.from;
        (re * re + im * im) / sinc.powi(4)
    }
}

/// Fast Fourier transform in place, length a power of two: `X_k = Σ_n x_n exp(-2πi k n / N)`.
fn transform(re: &mut [f64], im: &mut [f64]) {
    let n = re.len();
    let shift = usize::BITS - n.trailing_zeros();
    for i in 0..n {
        let j = if n > 1 { i.reverse_bits() >> shift } else { 0 };
        if i < j {
            re.swap(i, j);
            im.swap(i, j);
        }
    }
    let mut half = 1;
    while half < n {
        let angle = -PI / half as f64;
        let twiddles: Vec<(f64, f64)> = (0..half).map(|k| (angle * k as f64).sin_cos()).collect();
        for start in (0..n).step_by(2 * half) {
            for (k, (sin, cos)) in twiddles.iter().enumerate() {
                let (a, b) = (start + k, start + k + half);
                let (x, y) = (re[b] * cos - im[b] * sin, re[b] * sin + im[b] * cos);
                (re[b], im[b]) = (re[a] - x, im[a] - y);
                (re[a], im[a]) = (re[a] + x, im[a] + y);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_is_that_of_the_direct_sum() {
        let x: Vec<f64> = (0..700).map(|i| 3.0 + i as f64 * 0.01 + 0.004 * (i as f64).sin()).collect();
        let w: Vec<f64> = x.iter().map(|x| (17.3 * x).sin() + 0.2 * (40.0 * x).cos()).collect();
        let spectrum = Spectrum::new(&x, &w, 60.0).expect("an extent");
        let direct = |kappa: f64| {
            let (s, c) = x
                .iter()
                .zip(&w)
                .fold((0.0, 0.0), |(s, c), (x, w)| (s + w * (kappa * x).sin(), c + w * (kappa * x).cos()));
            s * s + c * c
        };
        let largest = direct(17.3);
        for kappa in [5.0, 17.3, 17.5, 25.0, 40.0, 58.0] {
            let (found, exact) = (spectrum.power(kappa), direct(kappa));
            assert!((found - exact).abs() < 0.1 * exact + 2e-3 * largest, "{kappa}: {found} {exact}");
        }
    }
}

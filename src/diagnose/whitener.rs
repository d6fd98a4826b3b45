//! Rows that depend on the ones before them, turned into independent ones, `docs/diagnosis-method.md` (61).

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::noise::Noise;

/// Turns rows into independent ones of unit variance.
#[derive(Clone, Debug)]
pub(super) struct Whitener {
    /// Row before, where noise is remembered from it.
    previous: Vec<u32>,
    rho: Vec<f64>,
    /// Part of what was new in the row before that is no memory but rounding, times `rho`.
    rounded: Vec<f64>,
    scale: Vec<f64>,
    /// One over it.
    unscale: Vec<f64>,
    /// Whether no row remembers another.
    is_white: bool,
    /// Whether any row is left out.
    leaves_out: bool,
    /// Rows that are left out.
    pub out: Vec<bool>,
}

const NONE: u32 = u32::MAX;
/// Columns that are whitened side by side.
pub(super) const FEW: usize = 4;
/// Noise that remembers less than this is as good as white.
const FORGETFUL: f64 = 0.2;

impl Whitener {
    /// For rows of given noise, one per run.
    pub fn new(rows: usize, runs: &[Vec<usize>], noise: &[Noise], out: Vec<bool>) -> Self {
        let mut whitener = Whitener {
            previous: vec![NONE; rows],
            rho: vec![0.0; rows],
            rounded: vec![0.0; rows],
            scale: vec![0.0; rows],
            unscale: Vec::new(),
            is_white: true,
            leaves_out: out.contains(&true),
            out,
        };
        for (run, noise) in runs.iter().zip(noise) {
            let (rho, rounding) = (noise.rho, noise.rounding.powi(2));
            let remembered = noise.sigma.powi(2) - rounding;
            let (mut last, mut expected) = (NONE, remembered);
            for row in run {
                if whitener.out[*row] {
                    last = NONE;
                    continue;
                }
                // What is remembered has this variance before the reading, (61), and the reading tells this part of it.
                expected = match last == NONE || rho == 0.0 {
                    true => remembered,
                    false => {
                        rho * rho * expected * rounding / (expected + rounding)
                            + remembered * (1.0 - rho * rho)
                    }
                };
                whitener.scale[*row] = (expected + rounding).sqrt().recip();
                if last != NONE && rho > 0.0 {
                    let before = whitener.scale[last as usize];
                    whitener.previous[*row] = last;
                    whitener.rho[*row] = rho;
                    whitener.rounded[*row] = rho * rounding * before * before;
                }
                last = *row as u32;
            }
        }
        whitener.unscale = whitener.scale.iter().map(|scale| scale.recip()).collect();
        whitener.is_white = whitener.previous.iter().all(|before| *before == NONE);
        whitener
    }

    /// A column of rows, whitened, (61); rows that are left out become 0.
    pub fn apply(&self, column: &[f64], to: &mut [f64]) {
        self.side_by_side([column], [to]);
    }

    /// Sum of squares of a column of rows, whitened.
    pub fn energy(&self, column: &[f64]) -> f64 {
        let mut white = vec![0.0; column.len()];
        self.apply(column, &mut white);
        white.iter().map(|x| x * x).sum()
    }

    /// Columns of rows, whitened, in place.
    pub fn apply_all(&self, columns: &mut DMatrix<f64>) {
        let rows = columns.nrows().max(1);
        columns.as_mut_slice().par_chunks_mut(FEW * rows).for_each_init(
            || Vec::with_capacity(FEW * rows),
            |own, to| {
                own.clear();
                own.extend_from_slice(to);
                self.apply_few(own, to);
            },
        );
    }

    /// No more than [`FEW`] columns of rows, one behind the other.
    pub fn apply_few(&self, columns: &[f64], to: &mut [f64]) {
        let rows = self.scale.len().max(1);
        let own: Vec<&[f64]> = columns.chunks(rows).collect();
        let mut to: Vec<&mut [f64]> = to.chunks_mut(rows).collect();
        match (&own[..], &mut to[..]) {
            ([a, b, c, d], [to_a, to_b, to_c, to_d]) => {
                self.side_by_side([a, b, c, d], [to_a, to_b, to_c, to_d]);
            }
            (own, to) => own.iter().zip(to).for_each(|(own, to)| self.apply(own, to)),
        }
    }

    /// So many columns at once: each row waits for the one before, and others can be seen to meanwhile.
    fn side_by_side<const N: usize>(&self, columns: [&[f64]; N], mut to: [&mut [f64]; N]) {
        if self.is_white {
            return columns.into_iter().zip(to).for_each(|(column, to)| self.plain(column, to));
        }
        let memory = self.previous.iter().zip(&self.rho).zip(&self.rounded);
        for (row, (((previous, rho), rounded), scale)) in memory.zip(&self.scale).enumerate() {
            if *previous == NONE {
                (0..N).for_each(|n| to[n][row] = scale * columns[n][row]);
                continue;
            }
            let before = *previous as usize;
            let kept = rounded * self.unscale[before];
            for n in 0..N {
                let (column, to) = (columns[n], &mut to[n]);
                to[row] = scale * (column[row] - rho * column[before] + kept * to[before]);
            }
        }
    }

    /// The transposed of [`Whitener::apply`]: what `aᵀ apply(b)` makes of `a` is `transposed(a)ᵀ b`.
    pub fn transposed(&self, column: &[f64]) -> Vec<f64> {
        let (mut to, mut carried) = (vec![0.0; column.len()], column.to_vec());
        for row in (0..column.len()).rev() {
            let x = self.scale[row] * carried[row];
            to[row] += x;
            if self.previous[row] != NONE {
                let before = self.previous[row] as usize;
                to[before] -= self.rho[row] * x;
                carried[before] += self.rounded[row] * x / self.scale[before];
            }
        }
        to
    }

    /// A column over the noise of fast changes alone, memory left aside.
    pub fn plain(&self, column: &[f64], to: &mut [f64]) {
        to.iter_mut().zip(column).zip(&self.scale).for_each(|((to, x), scale)| *to = scale * x);
    }

    /// The row that the noise of this one remembers, how much of it, and how much of that is rounding.
    pub fn memory(&self, row: usize) -> Option<(usize, f64, f64)> {
        (self.previous[row] != NONE).then(|| (self.previous[row] as usize, self.rho[row], self.rounded[row]))
    }

    /// Whether the noise of many rows remembers the one before.
    pub fn remembers(&self) -> bool {
        self.rho.iter().filter(|rho| **rho > FORGETFUL).count() > self.rho.len() / 10
    }

    /// Which part of the square of a column lies in rows that count.
    pub fn part_in_use(&self, column: &[f64]) -> f64 {
        if !self.leaves_out {
            return 1.0;
        }
        let (mut used, mut all) = ([0.0; 8], [0.0; 8]);
        for (x, out) in column.chunks(8).zip(self.out.chunks(8)) {
            for (((used, all), x), out) in used.iter_mut().zip(&mut all).zip(x).zip(out) {
                *used += if *out { 0.0 } else { x * x };
                *all += x * x;
            }
        }
        used.iter().sum::<f64>() / all.iter().sum::<f64>()
    }

    /// How many rows count.
    pub fn count(&self) -> usize {
        self.scale.iter().filter(|s| **s > 0.0).count()
    }
}

#[cfg(test)]
mod tests {
    use super::{Noise, Whitener};
    use rand::{RngExt, SeedableRng};

    const NOISE: Noise = Noise { sigma: 2.0, rho: 0.8, rounding: 0.9 };
    const ROWS: usize = 20_000;

    /// Remembered noise and rounding, and a whitener of it with a few rows left out.
    fn noisy() -> (Vec<f64>, Whitener) {
        let mut random = rand::rngs::StdRng::seed_from_u64(11);
        let mut normal = || (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
        let fresh = (NOISE.sigma.powi(2) - NOISE.rounding.powi(2)).sqrt();
        let mut remembered = fresh * normal();
        let rows = (0..ROWS)
            .map(|_| {
                remembered = NOISE.rho * remembered + fresh * (1.0 - NOISE.rho.powi(2)).sqrt() * normal();
                remembered + NOISE.rounding * normal()
            })
            .collect();
        let out = (0..ROWS).map(|row| row % 97 == 5).collect();
        let runs = [(0..ROWS / 2).collect::<Vec<_>>(), (ROWS / 2..ROWS).collect()];
        (rows, Whitener::new(ROWS, &runs, &[NOISE; 2], out))
    }

    #[test]
    fn whitened_noise_has_unit_variance_and_no_memory() {
        let (rows, whitener) = noisy();
        let mut white = vec![0.0; ROWS];
        whitener.apply(&rows, &mut white);
        let product = |lag: usize| {
            let pairs = (lag..ROWS).map(|k| white[k] * white[k - lag]);
            pairs.sum::<f64>() / whitener.count() as f64
        };
        // Three standard deviations.
        let chance = 3.0 / (ROWS as f64).sqrt();
        assert!((product(0) - 1.0).abs() < chance * 2f64.sqrt(), "{}", product(0));
        for lag in 1..20 {
            assert!(product(lag).abs() < 1.2 * chance, "{lag}: {}", product(lag));
        }
    }

    #[test]
    fn columns_side_by_side_are_those_of_each_alone() {
        let (_, whitener) = noisy();
        let columns = nalgebra::DMatrix::from_fn(ROWS, 7, |i, j| (0.1 * i as f64 * (j + 1) as f64).sin());
        let mut white = columns.clone();
        whitener.apply_all(&mut white);
        for (column, white) in columns.column_iter().zip(white.column_iter()) {
            let mut alone = vec![0.0; ROWS];
            whitener.apply(column.as_slice(), &mut alone);
            assert_eq!(white.as_slice(), alone);
        }
    }

    #[test]
    fn the_transposed_whitener_is_its_transposed() {
        let (a, whitener) = noisy();
        let b: Vec<f64> = (0..ROWS).map(|k| (0.37 * k as f64).sin()).collect();
        let mut white = vec![0.0; ROWS];
        whitener.apply(&b, &mut white);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (one, other) = (dot(&a, &white), dot(&whitener.transposed(&a), &b));
        assert!((one - other).abs() < 1e-9 * one.abs().max(1.0), "{one} {other}");
    }

    #[test]
    fn sums_of_many_readings_scatter_as_the_memory_says() {
        let (rows, _) = noisy();
        let sums: Vec<f64> = rows.chunks(500).map(|part| part.iter().sum::<f64>()).collect();
        let variance = sums.iter().map(|s| s * s).sum::<f64>() / sums.len() as f64 / 500.0;
        // Variance of the mean of many readings over that of as many independent ones.
        let rounding = (NOISE.rounding / NOISE.sigma).powi(2);
        let memory = (1.0 - rounding) * (1.0 + NOISE.rho) / (1.0 - NOISE.rho) + rounding;
        let ratio = variance / (NOISE.sigma.powi(2) * memory);
        assert!((ratio - 1.0).abs() < 3.0 * (2.0 / sums.len() as f64).sqrt(), "{ratio}");
    }
}

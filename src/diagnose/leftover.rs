//! What is left when everything named has been taken away: is it noise?
//!
//! Sums over blocks of whitened residuals have the variance of noise alone, whatever the length of the block; a misfit that runs
//! smoothly along the path adds its energy. What oscillates is seen band by band: a stretch in which a band has far more power than
//! noise has adds that, `docs/diagnosis-method.md` (65).

use std::f64::consts::TAU;

/// Lengths of blocks, readings.
const LENGTHS: [usize; 5] = [4, 8, 16, 32, 64];
/// Longer ones, for the overdispersion alone.
const LONG: [usize; 2] = [128, 256];
/// Readings of a stretch, and bands into which its spectrum is divided.
const STRETCH: usize = 64;
const BANDS: usize = 8;
/// A band counts where its power is this many times that of noise: chance does so in fewer than one of three thousand.
const LOUD: f64 = 3.5;
/// Share of cells in which chance is as loud as that, at most (χ² with eight degrees of freedom: 0.0004), and outliers that stay.
const CHANCE_LOUD: f64 = 0.002;
/// By how much the power of a band may be off because the noise's memory is not quite known.
const BAND_OFF: (f64, f64) = (0.75, 1.35);

/// Structure among whitened residuals.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Leftover {
    /// Energy of what is no noise, in units of the noise's variance: the sum over rows.
    pub energy: f64,
    /// How far beyond chance it is at the length of block where that is most, standard deviations.
    pub beyond: f64,
    /// Variance of block sums over that of noise, at the length where that is most and there are enough blocks: 1 for noise.
    pub overdispersion: f64,
}

/// Measures whitened residuals along runs of rows; rows that are left out are skipped.
pub(super) fn measure(residual: &[f64], runs: &[Vec<usize>], out: &[bool]) -> Leftover {
    let kept: Vec<Vec<f64>> =
        runs.iter().map(|run| run.iter().filter(|r| !out[**r]).map(|r| residual[*r]).collect()).collect();
    let mut worst = Leftover { overdispersion: 1.0, ..Leftover::default() };
    for length in LENGTHS {
        let (mut count, mut excess) = (0usize, 0.0);
        for block in kept.iter().flat_map(|run| run.chunks_exact(length)) {
            let sum: f64 = block.iter().sum();
            excess += sum * sum / length as f64 - 1.0;
            count += 1;
        }
        if count < 8 {
            continue;
        }
        let beyond = excess / (2.0 * count as f64).sqrt();
        if beyond > worst.beyond {
            (worst.beyond, worst.energy) = (beyond, excess);
        }
        worst.overdispersion = worst.overdispersion.max(1.0 + excess / count as f64);
    }
    for length in LONG {
        let sums =
            kept.iter().flat_map(|run| run.chunks_exact(length)).map(|block| block.iter().sum::<f64>());
        let squares: Vec<f64> = sums.map(|sum| sum * sum / length as f64).collect();
        if squares.len() < 8 {
            continue;
        }
        let count = squares.len() as f64;
        // Few blocks: what chance alone may add is left out.
        let overdispersion = squares.iter().sum::<f64>() / count / (1.0 + 2.0 * (2.0 / count).sqrt());
        worst.overdispersion = worst.overdispersion.max(overdispersion);
    }
    let Some((energy, beyond)) = loud(&kept) else { return worst };
    if beyond > CHANCE {
        worst.energy = worst.energy.max(energy);
        worst.beyond = worst.beyond.max(beyond);
    }
    worst
}

/// Fewer standard deviations than this are chance, for cells.
const CHANCE: f64 = 5.0;

/// Energy of cells of time and frequency that are louder than noise, and by how many standard deviations there are too many of them.
fn loud(kept: &[Vec<f64>]) -> Option<(f64, f64)> {
    let half = STRETCH / 2;
    let per_band = half / BANDS;
    let waves: Vec<(Vec<f64>, Vec<f64>)> = (1..=half)
        .map(|k| (0..STRETCH).map(|i| (TAU * k as f64 * i as f64 / STRETCH as f64).sin_cos()).unzip())
        .collect();
    let mut cells: Vec<Vec<f64>> = vec![Vec::new(); BANDS];
    for stretch in kept.iter().flat_map(|run| run.chunks_exact(STRETCH)) {
        for (band, powers) in cells.iter_mut().enumerate() {
            let sum: f64 = waves[band * per_band..(band + 1) * per_band]
                .iter()
                .map(|(sin, cos)| {
                    let along = |wave: &[f64]| stretch.iter().zip(wave).map(|(x, w)| x * w).sum::<f64>();
                    (along(sin).powi(2) + along(cos).powi(2)) / (STRETCH / 2) as f64
                })
                .sum();
            powers.push(sum / (2 * per_band) as f64);
        }
    }
    let count = BANDS * cells[0].len();
    if cells[0].len() < 8 {
        return None;
    }
    let (mut energy, mut loud) = (0.0, 0usize);
    for powers in &cells {
        let mut sorted = powers.clone();
        sorted.sort_by(f64::total_cmp);
        // The median of χ² with eight degrees of freedom over its mean.
        let usual = sorted[sorted.len() / 2] / 0.918;
        let usual = usual.clamp(BAND_OFF.0, BAND_OFF.1);
        for power in powers.iter().map(|p| p / usual).filter(|p| *p > LOUD) {
            energy += (power - 1.0) * (2 * per_band) as f64;
            loud += 1;
        }
    }
    let expected = CHANCE_LOUD * count as f64;
    Some((energy, (loud as f64 - expected) / (expected.max(1.0)).sqrt()))
}

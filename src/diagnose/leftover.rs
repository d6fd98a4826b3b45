//! What is left when everything named has been taken away: is it noise?
//!
//! Sums over blocks of whitened residuals have the variance of noise alone, whatever the length of the block; a misfit that runs
//! smoothly along the path adds its energy, `docs/diagnosis.md` (65).

/// Lengths of blocks, readings.
const LENGTHS: [usize; 5] = [4, 8, 16, 32, 64];

/// Structure among whitened residuals.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Leftover {
    /// Energy of what is no noise, in units of the noise's variance: the sum over rows.
    pub energy: f64,
    /// How far beyond chance it is at the length of block where that is most, standard deviations.
    pub beyond: f64,
    /// Variance of block sums over that of noise, at the length where that is most and there are enough blocks: 1 for noise.
    pub heat: f64,
}

/// Measures whitened residuals along runs of rows; rows that are left out are skipped.
pub(super) fn measure(residual: &[f64], runs: &[Vec<usize>], out: &[bool]) -> Leftover {
    let mut worst = Leftover { heat: 1.0, ..Leftover::default() };
    for length in LENGTHS {
        let (mut count, mut excess) = (0usize, 0.0);
        for run in runs {
            let kept: Vec<f64> = run.iter().filter(|r| !out[**r]).map(|r| residual[*r]).collect();
            for block in kept.chunks_exact(length) {
                let sum: f64 = block.iter().sum();
                excess += sum * sum / length as f64 - 1.0;
                count += 1;
            }
        }
        if count < 8 {
            continue;
        }
        let beyond = excess / (2.0 * count as f64).sqrt();
        if beyond > worst.beyond {
            (worst.beyond, worst.energy) = (beyond, excess);
        }
        worst.heat = worst.heat.max(1.0 + excess / count as f64);
    }
    worst
}

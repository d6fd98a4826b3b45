//! The finest wave along a joint that positions can tell from a coarser one: by their spectral window, `docs/effects.md` (48).

use std::f64::consts::TAU;

use rustfft::num_complex::Complex;

/// Two waves that are this much alike at all positions cannot be told apart.
const ALIKE: f64 = 0.75;
/// Waves are tried down to this part of two gaps, where positions lie unevenly enough.
const FINER: f64 = 0.125;
/// More distinct positions than this are dense enough for what any family asks.
const DENSE: usize = 400;
/// Steps of the window over one width of its peak, and how many at most: what is finer, where positions gather in a few spots, is not
/// claimed to be told.
const STEPS: f64 = 8.0;
const MOST: f64 = 1e6;

/// Shortest period, m or rad, of a wave that no coarser one looks like at these positions, `gap` being what lies between two of them
/// as a rule.
///
/// Evenly spaced positions, `|W(ν)| = |mean exp(2πi ν q)| = 1` at one over their gap, tell no period shorter than two gaps (Nyquist).
/// Positions that lie unevenly tell finer ones: waves of `ν` and `ν'` look alike where `W` is large at their difference or their sum.
pub(super) fn finest(positions: &[f64], gap: f64) -> f64 {
    let wave = 2.0 * gap;
    let mut places = positions.to_vec();
    places.sort_by(f64::total_cmp);
    // What was approached again and again is one place.
    places.dedup_by(|a, b| (*a - *b).abs() < 0.1 * gap);
    let (Some(first), Some(last)) = (places.first(), places.last()) else { return wave };
    if places.len() > DENSE || last <= first || gap <= 0.0 {
        return wave;
    }
    // Beyond the peak at nothing, up to twice the finest that is asked for.
    let step = 1.0 / (STEPS * (last - first));
    let (from, to) = (1.0 / wave, 2.0 / (FINER * wave));
    let count = ((to - from) / step).ceil().min(MOST) as usize;
    // Of every place, where its wave stands, and by how much it turns from one frequency to the next.
    let turns = |frequency: f64| move |q: &f64| Complex::cis(TAU * frequency * (q - first));
    let mut waves: Vec<Complex<f64>> = places.iter().map(turns(from)).collect();
    let advance: Vec<Complex<f64>> = places.iter().map(turns(step)).collect();
    for i in 0..=count {
        if waves.iter().sum::<Complex<f64>>().norm() > ALIKE * places.len() as f64 {
            return (2.0 / (from + i as f64 * step)).min(wave);
        }
        waves.iter_mut().zip(&advance).for_each(|(wave, advance)| *wave *= advance);
    }
    2.0 / (from + count as f64 * step)
}

#[cfg(test)]
mod tests {
    use super::finest;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn even_positions_tell_no_wave_shorter_than_two_gaps() {
        let targets: Vec<f64> = (0..60).map(|k| 0.01 * f64::from(k)).collect();
        assert!((finest(&targets, 0.01) / 0.02 - 1.0).abs() < 0.02);
        // However often they are approached.
        let again: Vec<f64> = targets.iter().flat_map(|q| [*q, q + 2e-6]).collect();
        assert!((finest(&again, 0.01) / 0.02 - 1.0).abs() < 0.02);
    }

    #[test]
    fn uneven_positions_tell_finer_waves() {
        let mut random = rand::rngs::StdRng::seed_from_u64(3);
        let targets: Vec<f64> =
            (0..60).map(|k| 0.01 * (f64::from(k) + random.random_range(-0.3..0.3))).collect();
        assert!(finest(&targets, 0.01) < 0.01);
    }
}

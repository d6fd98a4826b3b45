//! Elementary functions of whole columns, on whatever lanes the machine has: most grids are of waves, bumps and what decays.

use pulp::Arch;

/// Arguments beyond these are left to the standard library: exponents, and angles in rad.
const FAR: f64 = 700.0;
const FAR_ROUND: f64 = 1e6;
/// Added to a number this rounds it to a whole one, which then stands in the last bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// `ln 2` in two parts: the first times a whole number up to 2000 is exact.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
/// `π/2` in three parts: the first two times a whole number below a million are exact.
const HALF_PI: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
/// Series of the exponential, of the sine over its angle and of the cosine by the square of the angle: one over the factorials, from the
/// highest one that makes a difference.
const EXPONENTIAL: [f64; 14] = [
    1.0 / 6_227_020_800.0,
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];
const SINE: [f64; 9] = [
    1.0 / 355_687_428_096_000.0,
    -1.0 / 1_307_674_368_000.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 39_916_800.0,
    1.0 / 362_880.0,
    -1.0 / 5_040.0,
    1.0 / 120.0,
    -1.0 / 6.0,
    1.0,
];
const COSINE: [f64; 9] = [
    1.0 / 20_922_789_888_000.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 479_001_600.0,
    -1.0 / 3_628_800.0,
    1.0 / 40_320.0,
    -1.0 / 720.0,
    1.0 / 24.0,
    -0.5,
    1.0,
];

/// `e` to the power of each, to one or two units in the last place.
pub(crate) fn exponentials(column: &mut [f64]) {
    if column.iter().all(|x| x.abs() < FAR) {
        Arch::new().dispatch(|| column.iter_mut().for_each(|x| *x = near(*x)));
    } else {
        column.iter_mut().for_each(|x| *x = x.exp());
    }
}

/// `exp x = 2ⁿ exp r`, `|r|` no larger than half of `ln 2`, without a branch.
#[inline(always)]
fn near(x: f64) -> f64 {
    let rounded = x * std::f64::consts::LOG2_E + ROUND;
    let n = rounded - ROUND;
    let r = (x - n * LN_2[0]) - n * LN_2[1];
    series(&EXPONENTIAL, r) * f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52)
}

/// Sines and cosines of angles in rad, to 1e-15.
pub(crate) fn sines_cosines(angles: &[f64]) -> (Vec<f64>, Vec<f64>) {
    if !angles.iter().all(|x| x.abs() < FAR_ROUND) {
        return angles.iter().map(|x| x.sin_cos()).unzip();
    }
    let (mut sines, mut cosines) = (angles.to_vec(), vec![0.0; angles.len()]);
    Arch::new().dispatch(|| {
        for (sine, cosine) in sines.iter_mut().zip(&mut cosines) {
            (*sine, *cosine) = turned(*sine);
        }
    });
    (sines, cosines)
}

/// Sine and cosine of what is left beside whole quarter turns, without a branch.
#[inline(always)]
fn turned(x: f64) -> (f64, f64) {
    let rounded = x * std::f64::consts::FRAC_2_PI + ROUND;
    let n = rounded - ROUND;
    let r = ((x - n * HALF_PI[0]) - n * HALF_PI[1]) - n * HALF_PI[2];
    let (quarter, square) = (rounded.to_bits(), r * r);
    let (sine, cosine) = (r * series(&SINE, square), series(&COSINE, square));
    let is_odd = quarter & 1 == 1;
    let (sine, cosine) = if is_odd { (cosine, sine) } else { (sine, cosine) };
    // A sign in the first bit: of the sine in the third and fourth quarter, of the cosine in the second and third.
    let signed = |x: f64, quarter: u64| f64::from_bits(x.to_bits() ^ (quarter & 2) << 62);
    (signed(sine, quarter), signed(cosine, quarter.wrapping_add(1)))
}

/// Sum of these times powers of `x`, the last one its constant.
#[inline(always)]
fn series<const N: usize>(coefficients: &[f64; N], x: f64) -> f64 {
    coefficients.iter().fold(0.0, |sum, c| sum * x + c)
}

#[cfg(test)]
mod tests {
    use super::{exponentials, sines_cosines};

    #[test]
    fn sines_and_cosines_are_those_of_the_standard_library() {
        for scale in [1e-3, 0.01, 1.0, 9.9] {
            let at: Vec<f64> = (-100_000..=100_000).map(|k| scale * (f64::from(k) + 0.3)).collect();
            let (sines, cosines) = sines_cosines(&at);
            for ((x, sine), cosine) in at.iter().zip(sines).zip(cosines) {
                let exact = x.sin_cos();
                assert!((sine - exact.0).abs() < 1e-15, "{x}: {sine} {}", exact.0);
                assert!((cosine - exact.1).abs() < 1e-15, "{x}: {cosine} {}", exact.1);
            }
        }
        let (sines, cosines) = sines_cosines(&[0.0, f64::NAN, 1e7]);
        assert!(sines[0] == 0.0 && cosines[0] == 1.0 && sines[1].is_nan() && sines[2] == 1e7f64.sin());
    }

    #[test]
    fn exponentials_are_those_of_the_standard_library() {
        let at: Vec<f64> =
            (-69_990..=69_990).map(|k| 0.01 * f64::from(k) + 1e-4 * f64::from(k % 7)).collect();
        let mut found = at.clone();
        exponentials(&mut found);
        for (x, found) in at.iter().zip(found) {
            assert!((found / x.exp() - 1.0).abs() < 1e-15, "{x}: {found} {}", x.exp());
        }
    }

    #[test]
    fn what_is_far_or_no_number_is_as_ever() {
        let mut column = [800.0, f64::NEG_INFINITY, f64::NAN, 1.0];
        exponentials(&mut column);
        assert!(column[0].is_infinite() && column[1] == 0.0 && column[2].is_nan() && column[3] == 1f64.exp());
    }
}

//! Elementary functions of whole columns, on whatever lanes the machine has: most grids are of waves, bumps and what decays.

use pulp::Arch;

/// Arguments beyond these are left to the standard library: exponents, and angles in rad.
const FAR: f64 = 700.0;
const FAR_ROUND: f64 = 1e6;
/// Added to a number this rounds it to a whole one, which then stands in the last bits.
pub(super) const ROUND: f64 = 6_755_399_441_055_744.0;
/// `ln 2` in two parts: the first times a whole number up to 2000 is exact.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
/// `π/2` in three parts: the first two times a whole number below a million are exact.
pub(super) const HALF_PI: [f64; 3] =
    [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
/// Series of the exponential: one over the factorials, from the highest one that makes a difference.
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
/// `(sin r / r - 1) / r²` and `(cos r - 1 + r²/2) / r⁴` up to an eighth of a turn, from the highest power of `r²`: of all polynomials those
/// whose largest error is least (Remez), 3.4e-18 of the sine and 4.7e-20 of the cosine.
pub(super) const SINE: [f64; 6] = [
    1.589_682_670_136_347_4e-10,
    -2.505_075_862_975_759_4e-8,
    2.755_731_369_505_555_8e-6,
    -1.984_126_982_981_637e-4,
    8.333_333_333_322_424e-3,
    -0.166_666_666_666_666_32,
];
pub(super) const COSINE: [f64; 6] = [
    -1.135_966_977_004_655_3e-11,
    2.087_572_368_232_159_6e-9,
    -2.755_731_435_522_394_3e-7,
    2.480_158_728_949_175_2e-5,
    -1.388_888_888_887_413_8e-3,
    0.041_666_666_666_666_6,
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

/// Sine and cosine of an angle in rad, to 1e-15.
#[inline(always)]
pub(super) fn sine_cosine(x: f64) -> (f64, f64) {
    if x.abs() < FAR_ROUND { turned(x) } else { x.sin_cos() }
}

/// Sine and cosine of what is left beside whole quarter turns, without a branch.
#[inline(always)]
fn turned(x: f64) -> (f64, f64) {
    let rounded = x * std::f64::consts::FRAC_2_PI + ROUND;
    let n = rounded - ROUND;
    let r = ((x - n * HALF_PI[0]) - n * HALF_PI[1]) - n * HALF_PI[2];
    let (quarter, square) = (rounded.to_bits(), r * r);
    let sine = r + (r * square) * series(&SINE, square);
    let cosine = 1.0 + square * (square * series(&COSINE, square) - 0.5);
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
    use super::exponentials;

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

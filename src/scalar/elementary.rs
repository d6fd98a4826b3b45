//! Elementary functions of whole columns, on whatever lanes the machine has: most grids are of waves, bumps and what decays.

use pulp::Arch;

/// Exponents beyond this are left to the standard library.
const FAR: f64 = 700.0;
/// Added to a number this rounds it to a whole one, which then stands in the last bits.
pub(super) const ROUND: f64 = 6_755_399_441_055_744.0;
/// `ln 2` in two parts: the first times a whole number up to 2000 is exact.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
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

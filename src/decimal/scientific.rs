//! Numbers as text with a fixed count of digits: what `{:.12e}` writes, in a fraction of its time.

use std::io::Write;

use super::PAIRS;

/// Most digits behind the point.
const MOST: usize = 15;

/// Of 2, times 2^20, rounded down.
const LOG10_2: i32 = 315_652;

/// `5^0` to `5^27`: all that 64 bits hold.
const FIVES: [u64; 28] = powers(5);
const TENS: [u64; MOST + 2] = powers(10);

const fn powers<const N: usize>(base: u64) -> [u64; N] {
    let mut all = [1; N];
    let mut k = 1;
    while k < N {
        all[k] = base * all[k - 1];
        k += 1;
    }
    all
}

/// Appends a number as `{:.decimals$e}` does, with at most 15 decimals: correctly rounded, a tie to the even digit.
pub(crate) fn push(text: &mut Vec<u8>, value: f64, decimals: usize) {
    let Some((digits, exponent)) = rounded(value.abs(), decimals) else {
        // Memory takes everything.
        let _ = write!(text, "{value:.decimals$e}");
        return;
    };
    // All digits with zeros before them, from the right, in halves that are worked on side by side.
    let mut written = [[b'0'; 2]; MOST.div_ceil(2)];
    let (upper, lower) = ((digits / 100_000_000) as u32, (digits % 100_000_000) as u32);
    for (half, mut rest) in written.chunks_exact_mut(4).zip([upper, lower]) {
        for pair in half.iter_mut().rev() {
            *pair = PAIRS[(rest % 100) as usize];
            rest /= 100;
        }
    }
    let written = &written.as_flattened()[MOST - decimals..];
    if value.is_sign_negative() {
        text.push(b'-');
    }
    text.push(written[0]);
    if decimals > 0 {
        text.push(b'.');
        text.extend_from_slice(&written[1..]);
    }
    text.extend_from_slice(if exponent < 0 { b"e-" } else { b"e" });
    let exponent = PAIRS[exponent.unsigned_abs() as usize % 100];
    text.extend_from_slice(if exponent[0] == b'0' { &exponent[1..] } else { &exponent });
}

/// The first `decimals + 1` digits of a positive number as an integer, and the power of ten of the first; `None` where exact integers do not
/// tell them.
fn rounded(value: f64, decimals: usize) -> Option<(u64, i32)> {
    if decimals > MOST || !value.is_normal() {
        return None;
    }
    // value = mantissa * 2^power
    let bits = value.to_bits();
    let (mantissa, power) = (bits & ((1 << 52) - 1) | 1 << 52, ((bits >> 52) & 0x7ff) as i32 - 1075);
    // The value is below 2^(power + 53): the exponent is this one or the one below.
    let mut exponent = ((power + 53) * LOG10_2) >> 20;
    loop {
        // digits = mantissa * 5^scale * 2^(scale + power)
        let scale = decimals as i32 - exponent;
        let five = *FIVES.get(usize::try_from(scale).ok()?)?;
        let product = u128::from(mantissa) * u128::from(five);
        let shift = -(scale + power);
        if !(1..=120).contains(&shift) {
            return None;
        }
        let (whole, part, half) = ((product >> shift) as u64, product & ((1 << shift) - 1), 1 << (shift - 1));
        if whole < TENS[decimals] {
            exponent -= 1;
            continue;
        }
        if whole >= TENS[decimals + 1] {
            return None;
        }
        let digits = whole + u64::from(part > half || part == half && whole % 2 == 1);
        return match digits < TENS[decimals + 1] {
            true => Some((digits, exponent)),
            false => Some((TENS[decimals], exponent + 1)),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::rngs::StdRng;
    use rand::{RngExt, SeedableRng};

    fn alike(value: f64, decimals: usize) {
        let mut text = Vec::new();
        push(&mut text, value, decimals);
        assert_eq!(
            String::from_utf8_lossy(&text),
            format!("{value:.decimals$e}"),
            "{value:?} with {decimals} decimals"
        );
    }

    #[test]
    fn numbers_are_written_as_the_standard_library_does() {
        let mut random = StdRng::seed_from_u64(40_913);
        for decimals in [0, 1, 6, 12, 15] {
            for _ in 0..20_000 {
                let size = 10f64.powf(random.random_range(-25.0..20.0));
                alike(size * random.random_range(-1.0..1.0), decimals);
                alike(f64::from_bits(random.random()), decimals);
                // Decimals of few digits, and the ties among them.
                alike(f64::from(random.random_range(-40_000i32..40_000)) / 32.0, decimals);
            }
            for k in -22..=22 {
                let power = 10f64.powi(k);
                for value in [power, power.next_up(), power.next_down(), 9.999_999_5 * power, -power] {
                    alike(value, decimals);
                }
            }
            for value in [0.0, -0.0, f64::NAN, f64::INFINITY, f64::MIN_POSITIVE, 5e-324, f64::MAX, 0.5, 2.5] {
                alike(value, decimals);
            }
        }
    }
}

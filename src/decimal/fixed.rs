//! Numbers with a fixed count of digits behind the point: what `{:.4}` writes, in a fraction of its time.

/// Most digits behind the point that whole numbers give.
const MOST: usize = 9;

/// `value` with so many decimals, as [`format!`] writes it.
pub(crate) fn fixed(value: f64, places: usize) -> String {
    if places <= MOST && value.is_sign_positive() {
        let scaled = value * 10f64.powi(places as i32);
        let whole = scaled.floor();
        let part = scaled - whole;
        // Where rounding may go either way, the product is not near enough to the value.
        if scaled < 1e12 && (part - 0.5).abs() > 1e-3 {
            return of_digits(whole as u64 + u64::from(part > 0.5), places);
        }
    }
    format!("{value:.places$}")
}

/// A whole number with a point before so many of its digits.
fn of_digits(mut number: u64, places: usize) -> String {
    let mut text = [0; 24];
    let mut at = text.len();
    let mut put = |byte: u8| {
        at -= 1;
        text[at] = byte;
    };
    let mut digit = || {
        let last = b'0' + (number % 10) as u8;
        number /= 10;
        (last, number > 0)
    };
    (0..places).for_each(|_| put(digit().0));
    if places > 0 {
        put(b'.');
    }
    loop {
        let (last, goes_on) = digit();
        put(last);
        if !goes_on {
            break;
        }
    }
    String::from_utf8_lossy(&text[at..]).into_owned()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Numbers as programs have them, and some that lie on the edge between two roundings.
    fn number() -> impl Strategy<Value = f64> {
        let edge =
            (0u64..2_000_000, 0u32..7).prop_map(|(n, places)| (n as f64 + 0.5) / 10f64.powi(places as i32));
        prop_oneof![
            0.0..1e4f64,
            0.0..1e-3f64,
            1e8..1e18f64,
            edge,
            Just(0.0),
            Just(f64::NAN),
            Just(f64::INFINITY)
        ]
    }

    proptest! {
        #[test]
        fn decimals_are_those_of_the_standard_library(value in number(), places in 0usize..12, below in any::<bool>()) {
            let value = if below { -value } else { value };
            prop_assert_eq!(fixed(value, places), format!("{value:.places$}"));
        }
    }
}

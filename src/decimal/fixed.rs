//! Numbers with a fixed count of digits behind the point: what `{:.4}` writes, in a fraction of its time.

use super::{PAIRS, TENS, Text};

/// Pairs of digits of a count of units.
const PAIRS_OF_UNITS: usize = 7;

/// Most digits behind the point that whole numbers give.
const MOST: usize = 9;

/// `value` with so many decimals, as [`format!`] writes it.
pub(crate) fn fixed(value: f64, places: usize) -> String {
    match Rounded::of(value, places) {
        Some(rounded) => String::from_utf8_lossy(&rounded.text(None, places > 0, true)).into_owned(),
        None => format!("{value:.places$}"),
    }
}

/// A number that is not negative, as a count of units of its last decimal.
#[derive(Clone, Copy)]
pub(crate) struct Rounded {
    units: u64,
    places: usize,
}

impl Rounded {
    /// `value` with so many decimals; `None` where that is not certain.
    pub fn of(value: f64, places: usize) -> Option<Self> {
        if places > MOST || !value.is_sign_positive() {
            return None;
        }
        let scaled = value * TENS[places];
        let whole = scaled as u64;
        let part = scaled - whole as f64;
        // Where rounding may go either way, the product is not near enough to the value.
        let is_certain = scaled < 1e12 && (part - 0.5).abs() > 1e-3;
        is_certain.then(|| Rounded { units: whole + u64::from(part > 0.5), places })
    }

    /// Without the zeros at its end that are more than `least` decimals.
    pub fn shortened(mut self, least: usize) -> Self {
        while self.places > least && self.units.is_multiple_of(10) {
            self.units /= 10;
            self.places -= 1;
        }
        self
    }

    pub fn is_zero(self) -> bool {
        self.units == 0
    }

    /// What its text is read as: both parts are exact, so that one division rounds once.
    pub fn value(self) -> f64 {
        self.units as f64 / TENS[self.places]
    }

    /// As text, behind a sign, if it has one. `has_point`: whether there is a point even where nothing is behind it; `has_zero`: whether
    /// there is a zero before it even where other digits are behind it.
    pub fn text(self, sign: Option<u8>, has_point: bool, has_zero: bool) -> Text {
        let mut digits = [b'0'; 2 * PAIRS_OF_UNITS];
        let mut rest = self.units;
        for pair in digits.chunks_exact_mut(2).rev() {
            pair.copy_from_slice(&PAIRS[(rest % 100) as usize]);
            rest /= 100;
        }
        // Units are below 10^12, so that there is a zero before them.
        let point = digits.len() - self.places;
        let first = digits[..point].iter().position(|digit| *digit != b'0').unwrap_or(point);
        let first = if first == point && (has_zero || self.places == 0) { point - 1 } else { first };
        let mut text = Text::new();
        text.extend(sign);
        text.extend_from_slice(&digits[first..point]);
        if has_point || self.places > 0 {
            text.push(b'.');
        }
        text.extend_from_slice(&digits[point..]);
        text
    }
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

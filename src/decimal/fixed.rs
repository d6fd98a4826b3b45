//! Numbers with a fixed count of digits behind the point: what `{:.4}` writes, in a fraction of its time.

use super::{PAIRS, TENS, Text};

/// Digits of a count of units with zeros before them: an even number, more than units have.
const DIGITS: usize = 14;

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
        // What stands behind the digits is copied with them, a whole register at a time, and then left out.
        let (mut digits, mut text) = ([b'0'; 2 * DIGITS], [b'0'; 2 * DIGITS]);
        let (mut rest, mut first) = (self.units, DIGITS);
        while rest >= 100 {
            first -= 2;
            digits[first..first + 2].copy_from_slice(&PAIRS[(rest % 100) as usize]);
            rest /= 100;
        }
        first -= 2;
        digits[first..first + 2].copy_from_slice(&PAIRS[rest as usize]);
        first += usize::from(rest < 10);
        let point = DIGITS - self.places;
        if first >= point {
            first = point - usize::from(has_zero || self.places == 0);
        }
        let mut end = 0;
        if let Some(sign) = sign {
            (text[0], end) = (sign, 1);
        }
        text[end..end + DIGITS].copy_from_slice(&digits[first..first + DIGITS]);
        end += point - first;
        if has_point || self.places > 0 {
            text[end] = b'.';
            end += 1;
        }
        text[end..end + MOST].copy_from_slice(&digits[point..point + MOST]);
        Text::from_slice(&text[..end + self.places])
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

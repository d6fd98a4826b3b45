//! Numbers as a program writes them: the value, and the habits of who wrote it.

use super::dialect::Dialect;
use crate::decimal::{self, Text};

/// Most digits behind the point that are ever written.
pub(super) const MOST_DECIMALS: usize = 300;

/// A plain number of a program, in programmed units (mm or inch, deg): nothing is converted here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number {
    /// The value as programmed, finite.
    pub value: f64,
    /// Digits behind the decimal point.
    pub decimals: usize,
    /// Digits before the decimal point; 0 in `.5`.
    pub whole: usize,
    /// Whether it has a decimal point (or, in Heidenhain programs, a decimal comma). Some controls take a number without one
    /// for a count of least increments.
    pub has_point: bool,
    /// Whether zeros pad it to `whole` digits, as in `007`.
    padded: bool,
    /// Whether a number that is not negative bears a `+`.
    plus: bool,
    comma: bool,
}

impl Number {
    /// The number that `text` is, all of it: a sign, digits, at most one decimal point, no exponent.
    pub fn parse(text: &[u8], dialect: Dialect) -> Option<Number> {
        let (number, end) = Number::at_start(text, dialect)?;
        (end == text.len()).then_some(number)
    }

    /// The number that `text` starts with, and how many bytes it has.
    pub(super) fn at_start(text: &[u8], dialect: Dialect) -> Option<(Number, usize)> {
        let heidenhain = dialect == Dialect::Heidenhain;
        let sign = text.first().filter(|b| matches!(b, b'+' | b'-')).copied();
        let start = usize::from(sign.is_some());
        let padded = |whole: usize| whole > 1 && text[start] == b'0';
        let plus = sign == Some(b'+') || (heidenhain && sign == Some(b'-'));
        if let Some((value, length)) = plain_value(&text[start..], heidenhain) {
            let point = text[start..start + length].iter().position(|b| *b == b'.');
            let whole = point.unwrap_or(length);
            let number = Number {
                value: if sign == Some(b'-') { -value } else { value },
                decimals: point.map_or(0, |point| length - point - 1),
                whole,
                has_point: point.is_some(),
                padded: padded(whole),
                plus,
                comma: false,
            };
            return Some((number, start + length));
        }
        let digits = |from: usize| text[from..].iter().take_while(|b| b.is_ascii_digit()).count();
        let whole = digits(start);
        let mut end = start + whole;
        let (mut decimals, mut has_point, mut comma) = (0, false, false);
        let point = text.get(end).copied();
        if point == Some(b'.') || (heidenhain && point == Some(b',')) {
            let behind = digits(end + 1);
            if whole + behind > 0 {
                (decimals, has_point, comma) = (behind, true, point == Some(b','));
                end += 1 + behind;
            }
        }
        if whole + decimals == 0 {
            return None;
        }
        let value = value_of(&text[start..end], sign == Some(b'-'))?;
        Some((Number { value, decimals, whole, has_point, padded: padded(whole), plus, comma }, end))
    }

    /// The number where it counts least increments of this size, if it has no point: such a count is written with one from then on.
    pub(super) fn in_increments(self, size: f64) -> Number {
        if self.has_point { self } else { Number { value: self.value * size, has_point: true, ..self } }
    }

    /// `value` as the writer of this number would have written it.
    ///
    /// It has `decimals` digits behind the point where that is more than this number has; of these, zeros at the end that go
    /// beyond the source's digits are left out. Kept are `+`, the point of `3.`, `.5` against `0.5`, leading zeros.
    /// Never an exponent, never a negative zero. A value without decimals gets no point that the source does not have.
    /// `value`: programmed units, finite (of another one comes a text that [`Block::replace`](super::Block::replace) refuses).
    pub fn write_like(&self, value: f64, decimals: Option<usize>) -> String {
        match self.rounded_like(value, decimals) {
            Some((text, _)) => String::from_utf8_lossy(&text).into_owned(),
            None => self.write_with_care(value, decimals),
        }
    }

    /// As [`Number::write_like`], with the value that the text has; `None` where it takes more than to round a number of few digits.
    pub(crate) fn rounded_like(&self, value: f64, decimals: Option<usize>) -> Option<(Text, f64)> {
        if self.padded || self.comma {
            return None;
        }
        let places = self.decimals.max(decimals.unwrap_or(0));
        let size = decimal::Rounded::of(value.abs(), places)?.shortened(self.decimals);
        let negative = value < 0.0 && !size.is_zero();
        let sign = if negative { Some(b'-') } else { self.plus.then_some(b'+') };
        let text = size.text(sign, self.has_point, self.whole > 0);
        Some((text, if negative { -size.value() } else { size.value() }))
    }

    fn write_with_care(&self, value: f64, decimals: Option<usize>) -> String {
        let places = self.decimals.max(decimals.unwrap_or(0)).min(MOST_DECIMALS);
        let mut digits = decimal::fixed(value.abs(), places);
        if !value.is_finite() {
            return digits;
        }
        if let Some(point) = digits.find('.') {
            let shortest = point + 1 + self.decimals;
            while digits.len() > shortest && digits.ends_with('0') {
                digits.pop();
            }
            if digits.ends_with('.') && !self.has_point {
                digits.pop();
            }
        } else if self.has_point {
            digits.push('.');
        }
        let is_zero = digits.bytes().all(|b| matches!(b, b'0' | b'.'));
        if self.whole == 0 && digits.len() > 2 && digits.starts_with("0.") {
            digits.remove(0);
        } else if self.padded {
            let whole = digits.find('.').unwrap_or(digits.len());
            digits.insert_str(0, &"0".repeat(self.whole.saturating_sub(whole)));
        }
        if self.comma {
            digits = digits.replace('.', ",");
        }
        match (value < 0.0 && !is_zero, self.plus) {
            (true, _) => digits.insert(0, '-'),
            (false, true) => digits.insert(0, '+'),
            (false, false) => {}
        }
        digits
    }
}

/// The value of the plain decimal that `text`, without sign, starts with, and how many bytes it has.
fn plain_value(text: &[u8], heidenhain: bool) -> Option<(f64, usize)> {
    let is_unsigned = text.first().is_some_and(|b| *b != b'-');
    let (value, length) = decimal::read(text, 0).filter(|_| is_unsigned)?;
    // A comma may be the point.
    (!heidenhain || text.get(length) != Some(&b',')).then_some((value, length))
}

/// The value of digits with at most one point or comma among them.
fn value_of(text: &[u8], negative: bool) -> Option<f64> {
    let plain = decimal::read(text, 0).filter(|(_, end)| *end == text.len());
    let value = match plain {
        Some((value, _)) => value,
        None => {
            String::from_utf8_lossy(text).replace(',', ".").parse().ok().filter(|v: &f64| v.is_finite())?
        }
    };
    Some(if negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn values_are_those_of_the_standard_library(text in "[+-]?[0-9]{0,12}\\.?[0-9]{0,12}") {
            let exact: Option<f64> = text.parse().ok();
            let read = Number::parse(text.as_bytes(), Dialect::Rs274).map(|n| n.value);
            prop_assert_eq!(read.map(f64::to_bits), exact.map(f64::to_bits));
        }

        #[test]
        fn numbers_of_few_digits_are_written_as_any(
            like in "[+-]?[0-9]{0,3}\\.?[0-9]{0,5}",
            value in prop_oneof![-1e4..1e4f64, -1e-3..1e-3f64, (-2000i32..2000).prop_map(|n| f64::from(n) / 1e3)],
            decimals in proptest::option::of(0usize..8),
        ) {
            for dialect in [Dialect::Rs274, Dialect::Heidenhain] {
                let Some(number) = Number::parse(like.as_bytes(), dialect) else { continue };
                if let Some((text, written)) = number.rounded_like(value, decimals) {
                    prop_assert_eq!(String::from_utf8_lossy(&text), number.write_with_care(value, decimals));
                    let read = Number::parse(&text, dialect).map(|n| n.value.to_bits());
                    prop_assert_eq!(read, Some(written.to_bits()));
                }
            }
        }
    }
}

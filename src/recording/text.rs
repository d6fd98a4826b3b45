//! Small tools for text that a user wrote: fields, numbers, names that are nearly right.

use super::RecordingFault;
use crate::wording;

/// A fault with its line and column, both from 1; 0 where the whole file or line is meant.
#[derive(Debug)]
pub(super) struct Fail {
    pub line: u64,
    pub column: usize,
    pub fault: Box<RecordingFault>,
}

impl Fail {
    pub fn at(line: u64, column: usize, fault: impl Into<Box<RecordingFault>>) -> Self {
        Fail { line, column, fault: fault.into() }
    }
}

/// Largest length, angle or measured value, SI.
pub(super) const LARGEST: f64 = 1e9;

/// Largest time or number of an extra channel, SI: a time of day counted from 1970 must pass.
pub(super) const LARGEST_OTHER: f64 = 1e15;

/// The field without blanks around it and without one pair of quotes.
pub(super) fn bare(field: &[u8]) -> &[u8] {
    let field = field.trim_ascii();
    match field {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        _ => field,
    }
}

/// A plain number; NaN for an empty field; `None` for text that is no number.
#[inline]
pub(super) fn number(field: &[u8]) -> Option<f64> {
    if let Some(value) = short_decimal(field) {
        return Some(value);
    }
    let field = bare(field);
    if field.is_empty() {
        return Some(f64::NAN);
    }
    std::str::from_utf8(field).ok()?.parse().ok()
}

/// `-12.3456`: sign, digits, one point, at most 15 digits. Mantissa and power of ten are then exact, and one division rounds
/// as the general reader would.
#[inline]
fn short_decimal(field: &[u8]) -> Option<f64> {
    const POWERS: [f64; 16] =
        [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    let (negative, digits) = match field {
        [b'-', rest @ ..] => (true, rest),
        _ => (false, field),
    };
    if digits.len() > 16 {
        return None;
    }
    let (mut mantissa, mut count, mut point) = (0u64, 0usize, None);
    for byte in digits {
        match byte {
            b'0'..=b'9' => {
                mantissa = mantissa * 10 + u64::from(byte - b'0');
                count += 1;
            }
            b'.' if point.is_none() => point = Some(count),
            _ => return None,
        }
    }
    if count == 0 || count > 15 {
        return None;
    }
    let decimals = point.map_or(0, |at| count - at);
    let value = mantissa as f64 / POWERS[decimals];
    Some(if negative { -value } else { value })
}

/// Fields of a line; a comma within quotes does not separate. Calls `each` with every field as written.
#[inline]
pub(super) fn split<'a>(line: &'a [u8], mut each: impl FnMut(&'a [u8])) {
    let (mut from, mut quoted, mut blank) = (0, false, true);
    for (i, byte) in line.iter().enumerate() {
        match byte {
            b',' if !quoted => {
                each(&line[from..i]);
                (from, blank) = (i + 1, true);
            }
            // Quotes count only around a whole field.
            b'"' if quoted || blank => (quoted, blank) = (!quoted, false),
            b' ' => {}
            _ => blank = false,
        }
    }
    each(&line[from..]);
}

/// Text for a message.
pub(super) fn shown(text: &[u8]) -> String {
    wording::shown(&String::from_utf8_lossy(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_decimals_are_read_as_by_the_general_reader() {
        for text in ["0", "-0.0159", "41.0652", "123456789012345", "0.00000000000001", "-.5", "7.", "0012.50"]
        {
            let general: f64 = text.parse().expect("a number");
            assert_eq!(short_decimal(text.as_bytes()).map(f64::to_bits), Some(general.to_bits()), "{text}");
        }
        for text in ["", "-", ".", "+1", "1e3", "1.2.3", "--1", "1 ", "1234567890123456"] {
            assert_eq!(short_decimal(text.as_bytes()), None, "{text}");
        }
        assert_eq!(number(b" \"+1.5e3\" "), Some(1500.0));
        assert!(number(b"  ").is_some_and(f64::is_nan));
        assert!(number(b"NaN").is_some_and(f64::is_nan));
        assert_eq!(number(b"12,5"), None);
        assert_eq!(number(b"\xff"), None);
    }

    #[test]
    fn commas_in_quotes_do_not_separate() {
        let fields = |line: &'static str| {
            let mut out = Vec::new();
            split(line.as_bytes(), |f| out.push(std::str::from_utf8(f).expect("text")));
            out
        };
        assert_eq!(fields("a,b"), ["a", "b"]);
        assert_eq!(fields(""), [""]);
        assert_eq!(fields(" \"a,b\" ,c,"), [" \"a,b\" ", "c", ""]);
        assert_eq!(fields("5\",6\""), ["5\"", "6\""]);
    }
}

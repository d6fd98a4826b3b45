//! One field of a foreign table: a number with its own decimal sign, a drop-out, a direction.

/// How a field counts when the form of a table is looked for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Number,
    DropOut,
    Moment,
    Words,
}

/// Spellings of a reading that is missing.
const DROP_OUTS: [&str; 12] =
    ["", "-", "--", "---", "nan", "na", "n/a", "#n/a", "null", "none", "missing", "invalid"];

/// Whether a field stands for a reading that is missing.
pub(super) fn is_drop_out(field: &str) -> bool {
    let plain = field.trim().to_ascii_lowercase();
    DROP_OUTS.contains(&plain.as_str()) || plain.trim_start_matches(['+', '-']).starts_with("nan")
}

/// The field as a plain decimal number with a point, if it is one; its digits stay as they are.
pub(crate) fn plain(field: &str, comma: bool) -> Option<String> {
    let field = field.trim();
    let field = field.strip_prefix('+').unwrap_or(field);
    let (has_point, has_comma) = (field.contains('.'), field.contains(','));
    let text = match (comma, has_point, has_comma) {
        (true, false, true) => field.replacen(',', ".", 1),
        (_, _, false) => field.to_string(),
        _ => return None,
    };
    // Fortran and old controllers write 1.5D+03.
    let text = text.replace(['D', 'd'], "e").replace('\u{2212}', "-");
    let fits = |b: u8| b.is_ascii_digit() || b"+-.eE".contains(&b);
    let number = text.bytes().all(fits) && text.parse::<f64>().is_ok_and(f64::is_finite);
    number.then_some(text)
}

/// The value of a field; `None` where it is no number.
pub(super) fn number(field: &str, comma: bool) -> Option<f64> {
    plain(field, comma)?.parse().ok()
}

/// Direction of approach, in the signs and words that reports use.
pub(super) fn direction(field: &str) -> Option<i8> {
    Some(match field.trim().to_ascii_lowercase().as_str() {
        "+" | "+1" | "1" | "1.0" | "forward" | "forwards" | "forw" | "fwd" | "pos" | "positive" | "up" => 1,
        "-" | "\u{2212}" | "-1" | "-1.0" | "backward" | "backwards" | "back" | "bwd" | "rev" | "reverse"
        | "neg" | "negative" | "down" => -1,
        "0" | "0.0" => 0,
        _ => return None,
    })
}

pub(super) fn kind(field: &str, comma: bool) -> Kind {
    if is_drop_out(field) {
        Kind::DropOut
    } else if plain(field, comma).is_some() {
        Kind::Number
    } else if super::moment::read(field).is_some() {
        Kind::Moment
    } else {
        Kind::Words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_of_a_number_stay() {
        assert_eq!(plain(" -12,500 ", true).as_deref(), Some("-12.500"));
        assert_eq!(plain("+1.25", false).as_deref(), Some("1.25"));
        assert_eq!(plain("7", true).as_deref(), Some("7"));
        assert_eq!(plain("1.5D+02", false).as_deref(), Some("1.5e+02"));
        for text in ["1.234,5", "1,234,5", "1e999", "12:30", "inf", ".", "abc"] {
            assert_eq!(plain(text, true), None, "{text}");
        }
        assert_eq!(plain("1,5", false), None);
        assert!(is_drop_out(" NaN") && is_drop_out("-") && is_drop_out("-nan(ind)") && !is_drop_out("-1"));
        assert_eq!(direction("-"), Some(-1));
    }
}

//! One field of a table: a number, a multiple of pi, or a joint's variable with what is added to it.

use crate::units::{Quantity, Unit};

/// What a field says, m or rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value {
    Number(f64),
    /// The joint's own displacement, such as `q1` or `q1 + 90`, with what is added.
    Variable(f64),
}

/// A leader of a joint and its factor.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Term {
    pub name: String,
    pub factor: f64,
}

/// The value of a field in this unit; `number` reads plain numbers.
pub(super) fn value(text: &str, unit: Unit, number: impl Fn(&str) -> Option<f64>) -> Option<Value> {
    let constant = |text: &str| -> Option<f64> {
        let text = text.trim();
        number(text).map(|x| unit.to_si(x)).or_else(|| part_of_pi(text, unit, &number))
    };
    if text.is_empty() {
        return Some(Value::Number(0.0));
    }
    if let Some(x) = constant(text) {
        return Some(Value::Number(x));
    }
    // A letter or a word, and perhaps a number: q, q1, q_1, theta1*, d3.
    let letters = text.chars().take_while(|c| c.is_alphabetic()).map(char::len_utf8).sum::<usize>();
    let word = text[..letters].to_lowercase();
    if !["q", "theta", "th", "\u{3b8}", "d", "s", "var"].contains(&word.as_str()) {
        return None;
    }
    let rest = text[letters..].trim_start_matches('_').trim_start_matches(|c: char| c.is_ascii_digit());
    let rest = rest.trim_start_matches('*').trim();
    match rest.chars().next() {
        None => Some(Value::Variable(0.0)),
        Some('+') => constant(&rest[1..]).map(Value::Variable),
        Some('-') => constant(rest[1..].trim()).map(|x| Value::Variable(-x)),
        Some(_) => None,
    }
}

/// `pi/2`, `-pi/2`, `2*pi`, `3 pi/4`, where the column is in rad.
fn part_of_pi(text: &str, unit: Unit, number: impl Fn(&str) -> Option<f64>) -> Option<f64> {
    if unit.quantity != Quantity::Angle || unit.symbol != "rad" {
        return None;
    }
    let (sign, text) = match text.strip_prefix('-') {
        Some(rest) => (-1.0, rest.trim()),
        None => (1.0, text.strip_prefix('+').unwrap_or(text).trim()),
    };
    let text = text.to_lowercase().replace('\u{3c0}', "pi");
    let (before, behind) = text.split_once("pi")?;
    let before = before.trim().trim_end_matches('*').trim();
    let times = if before.is_empty() { 1.0 } else { number(before)? };
    let over = match behind.trim() {
        "" => 1.0,
        behind => number(behind.strip_prefix('/')?.trim())?,
    };
    (over != 0.0).then_some(sign * times * std::f64::consts::PI / over)
}

/// A displacement as a sum of commands: `q2`, `-0.5 q1 + q2`. Nothing where it is none.
pub(super) fn terms(text: &str) -> Option<Vec<Term>> {
    let mut terms: Vec<Term> = Vec::new();
    let mut sign = 1.0;
    let mut factor = None;
    let mut wants_sign = false;
    for word in text.split_whitespace() {
        match word {
            "+" | "-" if wants_sign => {
                sign = if word == "-" { -1.0 } else { 1.0 };
                wants_sign = false;
            }
            "+" | "-" => return None,
            _ if wants_sign => return None,
            _ => match word.parse::<f64>() {
                Ok(x) if factor.is_none() && x.is_finite() => factor = Some(x),
                Ok(_) => return None,
                Err(_) => {
                    let factor = sign * factor.take().unwrap_or(1.0);
                    match terms.iter_mut().find(|term| term.name == word) {
                        Some(same) => same.factor += factor,
                        None => terms.push(Term { name: word.to_string(), factor }),
                    }
                    wants_sign = true;
                }
            },
        }
    }
    (wants_sign && terms.iter().all(|term| term.factor.is_finite())).then_some(terms)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_numbers_parts_of_pi_or_variables() {
        let read = |text: &str, unit: &str| {
            value(text, Unit::named(unit).expect("a unit"), |text| {
                text.parse().ok().filter(|x: &f64| x.is_finite())
            })
        };
        let quarter = std::f64::consts::FRAC_PI_2;
        assert_eq!(read("90", "deg"), Some(Value::Number(quarter)));
        assert_eq!(read("-pi/2", "rad"), Some(Value::Number(-quarter)));
        assert_eq!(read("2*pi/4", "rad"), Some(Value::Number(quarter)));
        assert_eq!(read("pi/2", "deg"), None);
        assert_eq!(read("pi/0", "rad"), None);
        assert_eq!(read("q1", "deg"), Some(Value::Variable(0.0)));
        assert_eq!(read("theta_3 - 90", "deg"), Some(Value::Variable(-quarter)));
        assert_eq!(read("d2*", "mm"), Some(Value::Variable(0.0)));
        assert_eq!(read("", "mm"), Some(Value::Number(0.0)));
        for text in ["x1", "q1 90", "q1 +", "inf", "+", "é"] {
            assert_eq!(read(text, "deg"), None, "{text}");
        }
    }

    #[test]
    fn a_displacement_is_a_sum_of_commands() {
        let named = |factor: f64, name: &str| Term { name: name.into(), factor };
        assert_eq!(terms("q2"), Some(vec![named(1.0, "q2")]));
        assert_eq!(terms("-0.5 hip + knee"), Some(vec![named(-0.5, "hip"), named(1.0, "knee")]));
        assert_eq!(terms("a - 1e-5 b"), Some(vec![named(1.0, "a"), named(-1e-5, "b")]));
        for text in ["", "+", "2", "a b", "a +", "1 2 a", "inf a"] {
            assert_eq!(terms(text), None, "{text}");
        }
    }
}

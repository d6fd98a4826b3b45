//! Words: an address and its value.

use std::ops::Range;

use super::address::Address;
use super::number::{MOST_DECIMALS, Number};

/// An address and its value, as in `X1.5`, `C1=90`, `X=AC(10)`, `X[#1+2]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Word {
    /// The address; Heidenhain's incremental `IX` is the address `X`.
    pub address: Address,
    /// What the value means, where the word itself says it.
    pub how: How,
    /// The value.
    pub value: Value,
    /// Bytes of the whole word in its line.
    pub span: Range<usize>,
    /// Bytes of the number (in `X=AC(10)` of `10`) or of the expression.
    pub value_span: Range<usize>,
}

impl Word {
    /// The plain number, programmed units, if the value is one.
    pub fn number(&self) -> Option<f64> {
        match self.value {
            Value::Number(number) => Some(number.value),
            Value::Expression => None,
        }
    }

    /// `value` (programmed units) as the writer of this word would have written it, for
    /// [`Block::replace`](super::Block::replace): only the number, the address and `=` stay where they are. See [`Number::write_like`]; where the source has an
    /// expression, a signed number with `decimals` digits.
    pub fn write_like(&self, value: f64, decimals: Option<usize>) -> String {
        match self.value {
            Value::Number(number) => number.write_like(value, decimals),
            Value::Expression => {
                let text = format!("{:.*}", decimals.unwrap_or(0).min(MOST_DECIMALS), value);
                match text.strip_prefix('-') {
                    Some(zero) if zero.bytes().all(|b| matches!(b, b'0' | b'.')) => zero.to_string(),
                    _ => text,
                }
            }
        }
    }
}

/// A word's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A plain number.
    Number(Number),
    /// Anything that only the control can evaluate: variables, parameters, arithmetic, strings.
    Expression,
}

/// What a word says of its own value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum How {
    /// Nothing: `G90` or `G91` decides.
    Modal,
    /// `AC(...)`.
    Absolute,
    /// `IC(...)`, Heidenhain's `IX`.
    Incremental,
    /// `DC(...)`: absolute, a rotary axis takes the short way.
    Shortest,
    /// `ACP(...)`: absolute, approached in the positive sense.
    Positive,
    /// `ACN(...)`: absolute, approached in the negative sense.
    Negative,
}

impl How {
    /// Of the name before the parenthesis.
    pub(super) fn of(name: &str) -> Option<How> {
        Some(match name {
            "AC" => How::Absolute,
            "IC" => How::Incremental,
            "DC" => How::Shortest,
            "ACP" => How::Positive,
            "ACN" => How::Negative,
            _ => return None,
        })
    }
}

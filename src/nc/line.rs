//! The bytes of a line: where a value, a name, an expression that starts somewhere ends.

use std::ops::Range;

use super::codes::OPERATORS;
use super::dialect::Dialect;
use super::number::Number;

/// A line with or without its line end. Every look goes over a byte a bounded number of times.
pub(super) struct Line<'a> {
    bytes: &'a [u8],
    dialect: Dialect,
}

/// Whether the byte only keeps pieces apart.
pub(super) fn is_blank(b: u8) -> bool {
    matches!(b, b' ' | b'\t' | b'\r' | b'\n' | 0x0b | 0x0c)
}

/// Whether a name may go on with the byte.
pub(super) fn of_name(b: u8) -> bool {
    b.is_ascii_alphanumeric() || matches!(b, b'_' | b'$')
}

/// Whether a name may start with the byte.
pub(super) fn starts_name(b: u8) -> bool {
    b.is_ascii_alphabetic() || matches!(b, b'_' | b'$')
}

/// Whether a number may start with the byte.
pub(super) fn starts_number(b: u8) -> bool {
    b.is_ascii_digit() || matches!(b, b'.' | b'+' | b'-')
}

impl<'a> Line<'a> {
    pub fn new(bytes: &'a [u8], dialect: Dialect) -> Self {
        Line { bytes, dialect }
    }

    pub fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    pub fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// The end of a value without `=` that starts at `at`; `at` where there is none.
    pub fn value_end(&self, at: usize) -> usize {
        self.value(at).0
    }

    /// As [`Line::value_end`], with the value where that is a plain number.
    pub fn value(&self, at: usize) -> (usize, Option<Number>) {
        let number = Number::at_start(&self.bytes[at..], self.dialect);
        let end = self.end_of_value(at, number.map(|(_, length)| length));
        (end, number.filter(|(_, length)| at + length == end).map(|(number, _)| number))
    }

    /// `number`: length of the plain number there.
    fn end_of_value(&self, at: usize, number: Option<usize>) -> usize {
        let sign = at + usize::from(matches!(self.byte(at), Some(b'+' | b'-')));
        let heidenhain = self.dialect == Dialect::Heidenhain;
        let end = match self.byte(sign) {
            Some(b'#') => return self.parameter(sign),
            Some(b'[') => return self.balanced(sign),
            Some(b'Q' | b'q') if heidenhain => {
                let kind =
                    usize::from(matches!(self.byte(sign + 1), Some(b'L' | b'R' | b'S' | b'l' | b'r' | b's')));
                return sign + 1 + kind + self.digits(sign + 1 + kind);
            }
            Some(b'"') => return self.string(sign),
            _ => match number {
                Some(length) => at + length,
                // A number too large for any control.
                None if self.digits(sign) > 0 => sign + self.digits(sign),
                None => return at,
            },
        };
        // What goes on without a blank is no plain number.
        match self.byte(end) {
            Some(b'.' | b'#' | b'[' | b'+' | b'-' | b'/' | b'^' | b'=' | b'_' | b'$') => {
                self.while_(end, |b| !is_blank(b) && !matches!(b, b';' | b'(' | b'"'))
            }
            Some(b'*') if !heidenhain => {
                self.while_(end, |b| !is_blank(b) && !matches!(b, b';' | b'(' | b'"'))
            }
            Some(b'E' | b'e') if self.exponent(end) => self.while_(end, of_name),
            _ => end,
        }
    }

    /// The end of an expression that starts at `at`, as it stands behind `=`; `at` where there is none.
    pub fn expression(&self, at: usize) -> usize {
        let mut end = at;
        let mut next = at;
        loop {
            next = self.blanks(next);
            while matches!(self.byte(next), Some(b'+' | b'-')) {
                next = self.blanks(next + 1);
            }
            end = match self.byte(next) {
                Some(b) if b.is_ascii_digit() || b == b'.' => {
                    let mut close = self.while_(next, |b| b.is_ascii_digit() || b == b'.');
                    if self.dialect == Dialect::Heidenhain && self.byte(close) == Some(b',') {
                        close = self.while_(close + 1, |b| b.is_ascii_digit());
                    }
                    if self.exponent(close) {
                        close = self.while_(close + 2, |b| b.is_ascii_digit() || matches!(b, b'+' | b'-'));
                    }
                    close
                }
                Some(b) if starts_name(b) => {
                    let mut close = self.while_(next, of_name);
                    if OPERATORS.contains(&self.upper(next..close).as_str()) {
                        next = close;
                        continue;
                    }
                    loop {
                        close = match self.byte(close) {
                            Some(b'(' | b'[') => self.balanced(close),
                            Some(b'.') => self.while_(close + 1, of_name),
                            _ => break,
                        };
                    }
                    close
                }
                Some(b'(' | b'[') => self.balanced(next),
                Some(b'"') => self.string(next),
                Some(b'\'') => self.quoted(next, b'\''),
                Some(b'#') => self.parameter(next),
                _ => return end,
            };
            let operator = self.blanks(end);
            next = match (self.byte(operator), self.byte(operator + 1)) {
                (Some(b'='), Some(b'=')) => operator + 2,
                (Some(b'<' | b'>'), _) => self.while_(operator, |b| matches!(b, b'<' | b'>' | b'=')),
                (Some(b'*'), _) if self.dialect == Dialect::Heidenhain && self.ends(operator + 1) => {
                    return end;
                }
                (Some(b'+' | b'-' | b'*' | b'/' | b'^'), _) => operator + 1,
                (Some(b), _) if starts_name(b) => {
                    let close = self.while_(operator, of_name);
                    if !OPERATORS.contains(&self.upper(operator..close).as_str()) {
                        return end;
                    }
                    close
                }
                _ => return end,
            };
        }
    }

    /// `EX3` behind a number: Siemens' exponent.
    pub fn exponent(&self, at: usize) -> bool {
        self.bytes[at..].len() > 2
            && self.bytes[at..at + 2].eq_ignore_ascii_case(b"EX")
            && starts_number(self.bytes[at + 2])
    }

    /// `#5`, `##5`, `#<name>`, `#[...]`: its end.
    pub fn parameter(&self, at: usize) -> usize {
        let name = self.while_(at, |b| b == b'#');
        match self.byte(name) {
            Some(b'[') => self.balanced(name),
            Some(b'<') => self.quoted(name, b'>'),
            Some(b'_') => self.while_(name, of_name),
            _ => name + self.digits(name),
        }
    }

    /// `=`, and not `==`.
    pub fn assigns(&self, at: usize) -> bool {
        self.byte(at) == Some(b'=') && self.byte(at + 1) != Some(b'=')
    }

    /// Whether nothing but blanks is left at `at`.
    pub fn ends(&self, at: usize) -> bool {
        self.blanks(at) == self.bytes.len()
    }

    /// The end of `( ... )` or `[ ... ]` with what it nests, strings included; the line's end where it does not close.
    pub fn balanced(&self, at: usize) -> usize {
        let mut depth = 0usize;
        let mut next = at;
        while let Some(b) = self.byte(next) {
            next = match b {
                b'"' => self.string(next),
                b'(' | b'[' => {
                    depth += 1;
                    next + 1
                }
                b')' | b']' => {
                    depth -= 1;
                    next + 1
                }
                _ => next + 1,
            };
            if depth == 0 {
                return next;
            }
        }
        self.content_end().max(at + 1)
    }

    /// Behind the string that starts at `at`.
    pub fn string(&self, at: usize) -> usize {
        self.quoted(at, b'"')
    }

    /// Behind the next `close` after `at`; the line's end where there is none.
    pub fn quoted(&self, at: usize, close: u8) -> usize {
        let found = self.bytes[at + 1..].iter().position(|b| *b == close);
        found.map_or_else(|| self.content_end().max(at + 1), |i| at + i + 2)
    }

    /// The line's end without blanks.
    pub fn content_end(&self) -> usize {
        self.bytes.len() - self.bytes.iter().rev().take_while(|b| is_blank(**b)).count()
    }

    /// A piece in upper case.
    pub fn upper(&self, span: Range<usize>) -> String {
        String::from_utf8_lossy(&self.bytes[span]).to_ascii_uppercase()
    }

    /// The byte at `at`, if the line goes so far.
    pub fn byte(&self, at: usize) -> Option<u8> {
        self.bytes.get(at).copied()
    }

    /// Behind the blanks at `at`.
    pub fn blanks(&self, at: usize) -> usize {
        self.while_(at, is_blank)
    }

    /// How many digits stand at `at`.
    pub fn digits(&self, at: usize) -> usize {
        self.while_(at, |b| b.is_ascii_digit()) - at.min(self.bytes.len())
    }

    /// The first byte from `at` on that is not one of these.
    pub fn while_(&self, at: usize, keep: impl Fn(u8) -> bool) -> usize {
        let at = at.min(self.bytes.len());
        self.bytes[at..].iter().position(|b| !keep(*b)).map_or(self.bytes.len(), |i| at + i)
    }
}

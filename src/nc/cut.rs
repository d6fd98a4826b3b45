//! Cuts a line into tokens. Never fails, looks at every byte a bounded number of times.

use std::ops::Range;

use super::codes::{FUNCTIONS, OPERATORS, takes_the_rest};
use super::{Dialect, How, Kind, Number, Token, Value, Word};

/// Walks along one line.
pub(super) struct Cutter<'a> {
    bytes: &'a [u8],
    dialect: Dialect,
    at: usize,
    tokens: Vec<Token>,
    words: Vec<Word>,
    /// A comment that does not balance was seen: comments of this line end at the first `)`.
    unbalanced: bool,
}

fn is_blank(b: u8) -> bool {
    matches!(b, b' ' | b'\t' | b'\r' | b'\n' | 0x0b | 0x0c)
}

fn of_name(b: u8) -> bool {
    b.is_ascii_alphanumeric() || matches!(b, b'_' | b'$')
}

fn starts_name(b: u8) -> bool {
    b.is_ascii_alphabetic() || matches!(b, b'_' | b'$')
}

fn starts_number(b: u8) -> bool {
    b.is_ascii_digit() || matches!(b, b'.' | b'+' | b'-')
}

impl Cutter<'_> {
    /// Tokens and words of a line, with or without its line end.
    pub fn cut(bytes: &[u8], dialect: Dialect) -> (Vec<Token>, Vec<Word>) {
        let mut cutter =
            Cutter { bytes, dialect, at: 0, tokens: Vec::new(), words: Vec::new(), unbalanced: false };
        if bytes.starts_with(b"\xef\xbb\xbf") {
            cutter.at = 3;
        }
        cutter.line();
        (cutter.tokens, cutter.words)
    }

    fn line(&mut self) {
        self.at = self.blanks(self.at);
        if self.byte(self.at) == Some(b'%') {
            return self.rest(Kind::Percent);
        }
        self.head();
        loop {
            self.at = self.blanks(self.at);
            if self.at == self.bytes.len() {
                return;
            }
            self.piece();
        }
    }

    /// Skip marks, block number, label.
    fn head(&mut self) {
        loop {
            self.at = self.blanks(self.at);
            let behind = self.at + 1;
            match self.byte(self.at) {
                Some(b'/') => {
                    let level = if self.dialect == Dialect::Heidenhain { 0 } else { self.digits(behind) };
                    self.push(Kind::Skip, behind + level);
                }
                Some(b'N' | b'n') => {
                    let digits = self.blanks(behind);
                    let end = digits + self.digits(digits);
                    let is_other = matches!(self.byte(end), Some(b'.' | b'_' | b'#' | b'['));
                    if end == digits || is_other || self.assigns(self.blanks(end)) {
                        break;
                    }
                    self.push(Kind::BlockNumber, end);
                }
                Some(b':') if self.digits(behind) > 0 => {
                    self.push(Kind::BlockNumber, behind + self.digits(behind))
                }
                Some(b'0'..=b'9') if self.dialect == Dialect::Heidenhain => {
                    self.push(Kind::BlockNumber, self.at + self.digits(self.at));
                    break;
                }
                _ => break,
            }
        }
        if self.dialect == Dialect::Siemens && self.byte(self.at).is_some_and(starts_name) {
            let end = self.while_(self.at, of_name);
            if self.byte(end) == Some(b':') && self.byte(end + 1) != Some(b'=') {
                self.push(Kind::Other, end + 1);
            }
        }
    }

    /// One token, or a name and all that belongs to it.
    fn piece(&mut self) {
        let at = self.at;
        match self.bytes[at] {
            b';' => self.rest(Kind::Comment),
            b'(' => {
                let end = self.comment(at);
                self.push(Kind::Comment, end);
            }
            b'*' if self.dialect == Dialect::Heidenhain && self.byte(self.blanks(at + 1)) == Some(b'-') => {
                self.rest(Kind::Comment)
            }
            b'"' => self.push(Kind::Other, self.string(at)),
            b'#' => {
                let end = self.parameter(at);
                self.other_assigned(end);
            }
            b'[' => {
                let end = self.balanced(at);
                self.other_assigned(end);
            }
            // Fanuc's corners: no axis word behind the comma.
            b',' if self.byte(at + 1).is_some_and(|b| b.is_ascii_alphabetic()) => {
                let value = self.blanks(at + 2);
                let end = self.value_end(value).max(at + 2);
                self.push(Kind::Other, end);
            }
            b if starts_name(b) => {
                let letters = self.while_(at, starts_name);
                if letters == at + 1 && b.is_ascii_alphabetic() { self.address() } else { self.name(letters) }
            }
            b if starts_number(b) => {
                let end = self.while_(at + 1, |b| b.is_ascii_digit() || b == b'.');
                self.push(Kind::Other, end);
            }
            _ => {
                let strange = |b: u8| {
                    !is_blank(b)
                        && !starts_name(b)
                        && !starts_number(b)
                        && !matches!(b, b';' | b'(' | b'"' | b'#' | b'[' | b',')
                };
                let end = self.while_(at + 1, strange);
                self.push(Kind::Other, end);
            }
        }
    }

    /// A single letter.
    fn address(&mut self) {
        let start = self.at;
        let digits = start + 1 + self.digits(start + 1);
        if matches!(self.byte(digits), Some(b'_' | b'$')) {
            return self.name(digits);
        }
        let equals = self.blanks(digits);
        if self.assigns(equals) {
            return self.assigned(digits, equals);
        }
        let value = self.blanks(start + 1);
        let end = self.value_end(value);
        if end == value {
            return self.push(Kind::Name, start + 1);
        }
        let address = self.upper(start..start + 1);
        self.word(address, How::Modal, value..end, end);
    }

    /// The end of a value without `=` that starts at `at`; `at` where there is none.
    fn value_end(&self, at: usize) -> usize {
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
            _ => match Number::at_start(&self.bytes[at..], self.dialect) {
                Some((_, length)) => at + length,
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

    /// Letters up to `letters`, two or more, or with digits and `_`.
    fn name(&mut self, letters: usize) {
        let start = self.at;
        if self.dialect == Dialect::Heidenhain && self.heidenhain_word(letters) {
            return;
        }
        let end = self.while_(letters, of_name);
        let name = self.upper(start..end);
        let behind = self.blanks(end);
        let next = self.byte(behind);
        if takes_the_rest(&name, self.dialect) {
            self.push(Kind::Name, end);
            return self.statement();
        }
        if next == Some(b'(') && (behind == end || self.dialect == Dialect::Siemens) {
            let close = self.balanced(behind);
            if self.assigns(self.blanks(close)) {
                return self.other_assigned(close);
            }
            return self.push(Kind::Call, close);
        }
        if self.byte(end) == Some(b'[') {
            let function = &name[1..];
            if FUNCTIONS.contains(&function) && name.as_bytes()[0].is_ascii_alphabetic() {
                let mut close = self.balanced(end);
                if self.byte(close) == Some(b'/') && self.byte(close + 1) == Some(b'[') {
                    close = self.balanced(close + 1);
                }
                return self.word(name[..1].to_string(), How::Modal, start + 1..close, close);
            }
            let mut close = self.balanced(end);
            while self.byte(close) == Some(b'[') {
                close = self.balanced(close);
            }
            return self.other_assigned(close);
        }
        if self.assigns(behind) {
            return self.assigned(end, behind);
        }
        self.push(Kind::Name, end);
    }

    /// `IX+10`, `PA+30`, `DR+`: letters directly before a sign.
    fn heidenhain_word(&mut self, letters: usize) -> bool {
        let start = self.at;
        let name = self.upper(start..letters);
        let signed = matches!(self.byte(letters), Some(b'+' | b'-'));
        let incremental = name.len() == 2
            && name.starts_with('I')
            && matches!(name.as_bytes()[1], b'A'..=b'C' | b'U'..=b'Z');
        let valued = self.byte(letters).is_some_and(|b| starts_number(b) || matches!(b, b'Q' | b'q'));
        if !(signed || incremental && valued) {
            return false;
        }
        let end = self.value_end(letters);
        if end == letters {
            self.push(Kind::Name, letters + usize::from(signed));
        } else if incremental {
            self.word(name[1..].to_string(), How::Incremental, letters..end, end);
        } else {
            self.word(name, How::Modal, letters..end, end);
        }
        true
    }

    /// An address that ends at `end`, and `=` at `equals`.
    fn assigned(&mut self, end: usize, equals: usize) {
        let address = self.upper(self.at..end);
        let value = self.blanks(equals + 1);
        let value_end = self.expression(value);
        if value_end == value {
            return self.push(Kind::Other, equals + 1);
        }
        let text = &self.bytes[value..value_end];
        if let Some(open) = text.iter().position(|b| *b == b'(').filter(|_| text.ends_with(b")")) {
            let name = String::from_utf8_lossy(&text[..open]).trim_end().to_ascii_uppercase();
            let inner = &text[open + 1..text.len() - 1];
            let number = inner.trim_ascii();
            if let Some(how) = How::of(&name) {
                if Number::parse(number, self.dialect).is_some() {
                    let blanks = inner.len() - inner.trim_ascii_start().len();
                    let from = value + open + 1 + blanks;
                    return self.word(address, how, from..from + number.len(), value_end);
                }
                return self.word(address, how, value..value_end, value_end);
            }
        }
        self.word(address, How::Modal, value..value_end, value_end);
    }

    /// The end of an expression that starts at `at`, as it stands behind `=`; `at` where there is none.
    fn expression(&self, at: usize) -> usize {
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
    fn exponent(&self, at: usize) -> bool {
        self.bytes[at..].len() > 2
            && self.bytes[at..at + 2].eq_ignore_ascii_case(b"EX")
            && starts_number(self.bytes[at + 2])
    }

    /// `#5`, `##5`, `#<name>`, `#[...]`: its end.
    fn parameter(&self, at: usize) -> usize {
        let name = self.while_(at, |b| b == b'#');
        match self.byte(name) {
            Some(b'[') => self.balanced(name),
            Some(b'<') => self.quoted(name, b'>'),
            Some(b'_') => self.while_(name, of_name),
            _ => name + self.digits(name),
        }
    }

    /// All up to the comment at the line's end.
    fn statement(&mut self) {
        let start = self.blanks(self.at);
        let mut end = start;
        while let Some(b) = self.byte(end) {
            end = match b {
                b';' => break,
                b'(' if self.dialect == Dialect::Rs274 => break,
                b'"' => self.string(end),
                b'[' if self.dialect == Dialect::Rs274 => self.balanced(end),
                _ => end + 1,
            };
        }
        while end > start && is_blank(self.bytes[end - 1]) {
            end -= 1;
        }
        self.at = start;
        if end > start {
            self.push(Kind::Other, end);
        }
    }

    /// What ends at `end` is passed through; with what is assigned to it.
    fn other_assigned(&mut self, end: usize) {
        let equals = self.blanks(end);
        let end = if self.assigns(equals) {
            let value = self.blanks(equals + 1);
            self.expression(value).max(equals + 1)
        } else {
            end
        };
        self.push(Kind::Other, end);
    }

    /// A word from here to `end`.
    fn word(&mut self, address: String, how: How, value_span: Range<usize>, end: usize) {
        let value = Number::parse(&self.bytes[value_span.clone()], self.dialect)
            .map_or(Value::Expression, Value::Number);
        let span = self.at..end;
        self.words.push(Word { address, how, value, span, value_span });
        self.push(Kind::Word(self.words.len() - 1), end);
    }

    fn push(&mut self, kind: Kind, end: usize) {
        self.tokens.push(Token { kind, span: self.at..end });
        self.at = end;
    }

    /// One token up to the line end, without blanks there.
    fn rest(&mut self, kind: Kind) {
        let blanks = self.bytes.iter().rev().take_while(|b| is_blank(**b)).count();
        self.push(kind, self.bytes.len() - blanks);
    }

    /// `=`, and not `==`.
    fn assigns(&self, at: usize) -> bool {
        self.byte(at) == Some(b'=') && self.byte(at + 1) != Some(b'=')
    }

    fn ends(&self, at: usize) -> bool {
        self.blanks(at) == self.bytes.len()
    }

    /// The end of `( ... )`: with what it nests if that is balanced, else at the first `)`.
    fn comment(&mut self, at: usize) -> usize {
        let mut depth = 0usize;
        let bytes = if self.unbalanced { &[] } else { &self.bytes[at..] };
        for (i, b) in bytes.iter().enumerate() {
            match b {
                b'(' => depth += 1,
                b')' => depth -= 1,
                _ => {}
            }
            if depth == 0 {
                return at + i + 1;
            }
        }
        self.unbalanced = true;
        let close = self.bytes[at..].iter().position(|b| *b == b')');
        close.map_or_else(|| self.content_end().max(at + 1), |i| at + i + 1)
    }

    /// The end of `( ... )` or `[ ... ]` with what it nests, strings included; the line's end where it does not close.
    fn balanced(&self, at: usize) -> usize {
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

    fn string(&self, at: usize) -> usize {
        self.quoted(at, b'"')
    }

    /// Behind the next `close` after `at`; the line's end where there is none.
    fn quoted(&self, at: usize, close: u8) -> usize {
        let found = self.bytes[at + 1..].iter().position(|b| *b == close);
        found.map_or_else(|| self.content_end().max(at + 1), |i| at + i + 2)
    }

    /// The line's end without blanks.
    fn content_end(&self) -> usize {
        self.bytes.len() - self.bytes.iter().rev().take_while(|b| is_blank(**b)).count()
    }

    fn upper(&self, span: Range<usize>) -> String {
        String::from_utf8_lossy(&self.bytes[span]).to_ascii_uppercase()
    }

    fn byte(&self, at: usize) -> Option<u8> {
        self.bytes.get(at).copied()
    }

    fn blanks(&self, at: usize) -> usize {
        self.while_(at, is_blank)
    }

    /// How many digits stand at `at`.
    fn digits(&self, at: usize) -> usize {
        self.while_(at, |b| b.is_ascii_digit()) - at.min(self.bytes.len())
    }

    fn while_(&self, at: usize, keep: impl Fn(u8) -> bool) -> usize {
        let at = at.min(self.bytes.len());
        self.bytes[at..].iter().position(|b| !keep(*b)).map_or(self.bytes.len(), |i| at + i)
    }
}

//! Cuts a line into tokens. Never fails, looks at every byte a bounded number of times.

use std::ops::Range;

use super::address::Address;
use super::codes::{FUNCTIONS, takes_the_rest};
use super::dialect::Dialect;
use super::line::{Line, is_blank, of_name, starts_name, starts_number};
use super::number::Number;
use super::token::{Kind, Token};
use super::words::{How, Value, Word};

/// Pieces of an ordinary line.
const ORDINARY: usize = 8;

/// Walks along one line.
pub(super) struct Cutter<'a> {
    line: Line<'a>,
    at: usize,
    tokens: Vec<Token>,
    words: Vec<Word>,
    /// A comment that does not balance was seen: comments of this line end at the first `)`.
    unbalanced: bool,
}

impl Cutter<'_> {
    /// Tokens and words of a line, with or without its line end; in the memory of those of another line.
    pub fn cut(
        bytes: &[u8],
        dialect: Dialect,
        (mut tokens, mut words): (Vec<Token>, Vec<Word>),
    ) -> (Vec<Token>, Vec<Word>) {
        let line = Line::new(bytes, dialect);
        tokens.clear();
        tokens.reserve(ORDINARY);
        words.clear();
        words.reserve(ORDINARY);
        let mut cutter = Cutter { line, at: 0, tokens, words, unbalanced: false };
        if bytes.starts_with(b"\xef\xbb\xbf") {
            cutter.at = 3;
        }
        cutter.whole();
        (cutter.tokens, cutter.words)
    }

    fn whole(&mut self) {
        self.at = self.line.blanks(self.at);
        if self.line.byte(self.at) == Some(b'%') {
            return self.rest(Kind::Percent);
        }
        self.head();
        loop {
            self.at = self.line.blanks(self.at);
            if self.at == self.line.bytes().len() {
                return;
            }
            self.piece();
        }
    }

    /// Skip marks, block number, label.
    fn head(&mut self) {
        loop {
            self.at = self.line.blanks(self.at);
            let behind = self.at + 1;
            match self.line.byte(self.at) {
                Some(b'/') => {
                    let level =
                        if self.line.dialect() == Dialect::Heidenhain { 0 } else { self.line.digits(behind) };
                    self.push(Kind::Skip, behind + level);
                }
                Some(b'N' | b'n') => {
                    let digits = self.line.blanks(behind);
                    let end = digits + self.line.digits(digits);
                    let is_other = matches!(self.line.byte(end), Some(b'.' | b'_' | b'#' | b'['));
                    if end == digits || is_other || self.line.assigns(self.line.blanks(end)) {
                        break;
                    }
                    self.push(Kind::BlockNumber, end);
                }
                Some(b':') if self.line.digits(behind) > 0 => {
                    self.push(Kind::BlockNumber, behind + self.line.digits(behind))
                }
                Some(b'0'..=b'9') if self.line.dialect() == Dialect::Heidenhain => {
                    self.push(Kind::BlockNumber, self.at + self.line.digits(self.at));
                    break;
                }
                _ => break,
            }
        }
        if self.line.dialect() == Dialect::Siemens && self.line.byte(self.at).is_some_and(starts_name) {
            let end = self.line.while_(self.at, of_name);
            if self.line.byte(end) == Some(b':') && self.line.byte(end + 1) != Some(b'=') {
                self.push(Kind::Other, end + 1);
            }
        }
    }

    /// One token, or a name and all that belongs to it.
    fn piece(&mut self) {
        let at = self.at;
        match self.line.bytes()[at] {
            b';' => self.rest(Kind::Comment),
            b'(' => {
                let end = self.comment(at);
                self.push(Kind::Comment, end);
            }
            b'*' if self.line.dialect() == Dialect::Heidenhain
                && self.line.byte(self.line.blanks(at + 1)) == Some(b'-') =>
            {
                self.rest(Kind::Comment)
            }
            b'"' => self.push(Kind::Other, self.line.string(at)),
            b'#' => {
                let end = self.line.parameter(at);
                self.other_assigned(end);
            }
            b'[' => {
                let end = self.line.balanced(at);
                self.other_assigned(end);
            }
            // Fanuc's corners: no axis word behind the comma.
            b',' if self.line.byte(at + 1).is_some_and(|b| b.is_ascii_alphabetic()) => {
                let value = self.line.blanks(at + 2);
                let end = self.line.value_end(value).max(at + 2);
                self.push(Kind::Other, end);
            }
            b if starts_name(b) => {
                let letters = self.line.while_(at, starts_name);
                if letters == at + 1 && b.is_ascii_alphabetic() { self.address() } else { self.name(letters) }
            }
            b if starts_number(b) => {
                let end = self.line.while_(at + 1, |b| b.is_ascii_digit() || b == b'.');
                self.push(Kind::Other, end);
            }
            _ => {
                let strange = |b: u8| {
                    !is_blank(b)
                        && !starts_name(b)
                        && !starts_number(b)
                        && !matches!(b, b';' | b'(' | b'"' | b'#' | b'[' | b',')
                };
                let end = self.line.while_(at + 1, strange);
                self.push(Kind::Other, end);
            }
        }
    }

    /// A single letter.
    fn address(&mut self) {
        let start = self.at;
        let digits = start + 1 + self.line.digits(start + 1);
        if matches!(self.line.byte(digits), Some(b'_' | b'$')) {
            return self.name(digits);
        }
        let equals = self.line.blanks(digits);
        if self.line.assigns(equals) {
            return self.assigned(digits, equals);
        }
        let from = self.line.blanks(start + 1);
        let (end, number) = self.line.value(from);
        if end == from {
            return self.push(Kind::Name, start + 1);
        }
        let address = Address::new(&self.line.bytes()[start..=start]);
        let value = number.map_or(Value::Expression, Value::Number);
        self.word_of(address, How::Modal, value, from..end, end);
    }

    /// Letters up to `letters`, two or more, or with digits and `_`.
    fn name(&mut self, letters: usize) {
        let start = self.at;
        if self.line.dialect() == Dialect::Heidenhain && self.heidenhain_word(letters) {
            return;
        }
        let end = self.line.while_(letters, of_name);
        let name = self.line.upper(start..end);
        let behind = self.line.blanks(end);
        let next = self.line.byte(behind);
        if takes_the_rest(&name, self.line.dialect()) {
            self.push(Kind::Name, end);
            return self.statement();
        }
        if next == Some(b'(') && (behind == end || self.line.dialect() == Dialect::Siemens) {
            let close = self.line.balanced(behind);
            if self.line.assigns(self.line.blanks(close)) {
                return self.other_assigned(close);
            }
            return self.push(Kind::Call, close);
        }
        if self.line.byte(end) == Some(b'[') {
            let function = &name[1..];
            if FUNCTIONS.contains(&function) && name.as_bytes()[0].is_ascii_alphabetic() {
                let mut close = self.line.balanced(end);
                if self.line.byte(close) == Some(b'/') && self.line.byte(close + 1) == Some(b'[') {
                    close = self.line.balanced(close + 1);
                }
                return self.word(Address::new(&name.as_bytes()[..1]), How::Modal, start + 1..close, close);
            }
            let mut close = self.line.balanced(end);
            while self.line.byte(close) == Some(b'[') {
                close = self.line.balanced(close);
            }
            return self.other_assigned(close);
        }
        if self.line.assigns(behind) {
            return self.assigned(end, behind);
        }
        self.push(Kind::Name, end);
    }

    /// `IX+10`, `PA+30`, `DR+`: letters directly before a sign.
    fn heidenhain_word(&mut self, letters: usize) -> bool {
        let start = self.at;
        let name = self.line.upper(start..letters);
        let signed = matches!(self.line.byte(letters), Some(b'+' | b'-'));
        let incremental = name.len() == 2
            && name.starts_with('I')
            && matches!(name.as_bytes()[1], b'A'..=b'C' | b'U'..=b'Z');
        let valued = self.line.byte(letters).is_some_and(|b| starts_number(b) || matches!(b, b'Q' | b'q'));
        if !(signed || incremental && valued) {
            return false;
        }
        let end = self.line.value_end(letters);
        if end == letters {
            self.push(Kind::Name, letters + usize::from(signed));
        } else if incremental {
            self.word(Address::new(&name.as_bytes()[1..]), How::Incremental, letters..end, end);
        } else {
            self.word(Address::new(name.as_bytes()), How::Modal, letters..end, end);
        }
        true
    }

    /// An address that ends at `end`, and `=` at `equals`.
    fn assigned(&mut self, end: usize, equals: usize) {
        let address = Address::new(&self.line.bytes()[self.at..end]);
        let value = self.line.blanks(equals + 1);
        let value_end = self.line.expression(value);
        if value_end == value {
            return self.push(Kind::Other, equals + 1);
        }
        let text = &self.line.bytes()[value..value_end];
        if let Some(open) = text.iter().position(|b| *b == b'(').filter(|_| text.ends_with(b")")) {
            let name = String::from_utf8_lossy(&text[..open]).trim_end().to_ascii_uppercase();
            let inner = &text[open + 1..text.len() - 1];
            let number = inner.trim_ascii();
            if let Some(how) = How::of(&name) {
                if Number::parse(number, self.line.dialect()).is_some() {
                    let blanks = inner.len() - inner.trim_ascii_start().len();
                    let from = value + open + 1 + blanks;
                    return self.word(address, how, from..from + number.len(), value_end);
                }
                return self.word(address, how, value..value_end, value_end);
            }
        }
        self.word(address, How::Modal, value..value_end, value_end);
    }

    /// All up to the comment at the line's end.
    fn statement(&mut self) {
        let start = self.line.blanks(self.at);
        let mut end = start;
        while let Some(b) = self.line.byte(end) {
            end = match b {
                b';' => break,
                b'(' if self.line.dialect() == Dialect::Rs274 => break,
                b'"' => self.line.string(end),
                b'[' if self.line.dialect() == Dialect::Rs274 => self.line.balanced(end),
                _ => end + 1,
            };
        }
        while end > start && is_blank(self.line.bytes()[end - 1]) {
            end -= 1;
        }
        self.at = start;
        if end > start {
            self.push(Kind::Other, end);
        }
    }

    /// What ends at `end` is passed through; with what is assigned to it.
    fn other_assigned(&mut self, end: usize) {
        let equals = self.line.blanks(end);
        let end = if self.line.assigns(equals) {
            let value = self.line.blanks(equals + 1);
            self.line.expression(value).max(equals + 1)
        } else {
            end
        };
        self.push(Kind::Other, end);
    }

    /// A word from here to `end`, its value a number if it is one.
    fn word(&mut self, address: Address, how: How, value_span: Range<usize>, end: usize) {
        let value = Number::parse(&self.line.bytes()[value_span.clone()], self.line.dialect())
            .map_or(Value::Expression, Value::Number);
        self.word_of(address, how, value, value_span, end);
    }

    /// A word from here to `end`.
    fn word_of(&mut self, address: Address, how: How, value: Value, value_span: Range<usize>, end: usize) {
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
        let blanks = self.line.bytes().iter().rev().take_while(|b| is_blank(**b)).count();
        self.push(kind, self.line.bytes().len() - blanks);
    }

    /// The end of `( ... )`: with what it nests if that is balanced, else at the first `)`.
    fn comment(&mut self, at: usize) -> usize {
        let mut depth = 0usize;
        let bytes = if self.unbalanced { &[] } else { &self.line.bytes()[at..] };
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
        let close = self.line.bytes()[at..].iter().position(|b| *b == b')');
        close.map_or_else(|| self.line.content_end().max(at + 1), |i| at + i + 1)
    }
}

//! The address of a word.

use std::fmt;
use std::ops::Deref;

/// An address in upper case, with its index: `X`, `C1`, `_X_HOME`. One of a single letter, as nearly all are, takes no memory and is
/// compared by its byte.
#[derive(Clone, PartialEq, Eq)]
pub struct Address(Form);

#[derive(Clone, PartialEq, Eq)]
enum Form {
    /// In upper case.
    Letter(u8),
    Text(Box<str>),
}

const LETTERS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZ";

impl Address {
    /// From bytes as a program has them.
    pub(super) fn new(bytes: &[u8]) -> Self {
        match bytes {
            [letter] if letter.is_ascii_alphabetic() => Address(Form::Letter(letter.to_ascii_uppercase())),
            _ => Address(Form::Text(String::from_utf8_lossy(bytes).to_ascii_uppercase().into())),
        }
    }

    /// As text.
    pub fn as_str(&self) -> &str {
        match &self.0 {
            Form::Letter(letter) => {
                let at = usize::from(letter - b'A');
                &LETTERS[at..=at]
            }
            Form::Text(text) => text,
        }
    }

    /// The letter, if it is one alone.
    pub fn letter(&self) -> Option<u8> {
        match self.0 {
            Form::Letter(letter) => Some(letter),
            Form::Text(_) => None,
        }
    }
}

impl Deref for Address {
    type Target = str;

    fn deref(&self) -> &str {
        self.as_str()
    }
}

impl PartialEq<str> for Address {
    #[inline]
    fn eq(&self, other: &str) -> bool {
        match &self.0 {
            Form::Letter(letter) => matches!(other.as_bytes(), [only] if only == letter),
            Form::Text(text) => **text == *other,
        }
    }
}

impl PartialEq<&str> for Address {
    #[inline]
    fn eq(&self, other: &&str) -> bool {
        *self == **other
    }
}

impl PartialEq<String> for Address {
    #[inline]
    fn eq(&self, other: &String) -> bool {
        *self == **other
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl fmt::Debug for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

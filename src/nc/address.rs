//! The address of a word.

use std::borrow::Cow;
use std::fmt;
use std::ops::Deref;

/// An address in upper case, with its index: `X`, `C1`, `_X_HOME`. One of a single letter, as nearly all are, takes no memory.
#[derive(Clone, PartialEq, Eq)]
pub struct Address(Cow<'static, str>);

const LETTERS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZ";

impl Address {
    /// From bytes as a program has them.
    pub(super) fn new(bytes: &[u8]) -> Self {
        match bytes {
            [letter] if letter.is_ascii_alphabetic() => {
                let at = usize::from(letter.to_ascii_uppercase() - b'A');
                Address(Cow::Borrowed(&LETTERS[at..=at]))
            }
            _ => Address(Cow::Owned(String::from_utf8_lossy(bytes).to_ascii_uppercase())),
        }
    }

    /// As text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Deref for Address {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl PartialEq<str> for Address {
    fn eq(&self, other: &str) -> bool {
        self.0 == other
    }
}

impl PartialEq<&str> for Address {
    fn eq(&self, other: &&str) -> bool {
        self.0 == *other
    }
}

impl PartialEq<String> for Address {
    fn eq(&self, other: &String) -> bool {
        self.0 == *other
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

impl fmt::Debug for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&*self.0, f)
    }
}

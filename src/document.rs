//! A RON text that a user wrote, and where in it each value stands.
//!
//! RON's reader knows places only while it reads. Checks that see the whole (a name twice, a joint on the last frame) come
//! later and name a value by its path, `tool[2].joint.axis`; [`Document::place_of`] finds it again.

use std::path::{Path, PathBuf};

use ron::extensions::Extensions;
use serde::de::DeserializeOwned;

use crate::error::{Error, Place, Result};
use crate::foreign;
use crate::wording::count;

/// Larger texts are refused: a machine is a few kilobytes.
const MOST_BYTES: usize = 8 << 20;
/// Deeper nesting is refused before any reader recurses into it.
const MOST_DEPTH: usize = 32;

const NO_TEXT: &str = "a machine file is plain text in RON; is this the right file?";

/// `travel: (0, 1)` instead of `Some((0, 1))`, and `Revolute(axis: "z")` instead of `Revolute((axis: "z"))`.
pub(crate) const EXTENSIONS: Extensions =
    Extensions::IMPLICIT_SOME.union(Extensions::UNWRAP_VARIANT_NEWTYPES);

/// A text in RON with the name of the file that it came from.
pub(crate) struct Document {
    file: PathBuf,
    text: String,
    /// Where the form of such a file is taught.
    guide: &'static str,
}

impl Document {
    pub fn new(file: impl AsRef<Path>, text: String) -> Result<Self> {
        let file = file.as_ref().to_path_buf();
        // Some editors begin a text with a byte order mark.
        let text = text.strip_prefix('\u{feff}').map(str::to_string).unwrap_or(text);
        let document = Document { file, text, guide: NOT_RON };
        if document.text.len() > MOST_BYTES {
            return Err(document.refuse(
                Place::file(&document.file),
                format!("file has {} bytes, more than {MOST_BYTES}", document.text.len()),
                "a machine file takes a few kilobytes; is this the right file?",
            ));
        }
        if let Some((line, column)) = too_deep(&document.text) {
            return Err(document.refuse(
                Place::at(&document.file, line, column),
                format!("brackets are nested deeper than {MOST_DEPTH}"),
                "close a bracket before this place",
            ));
        }
        Ok(document)
    }

    /// Reads a file whole.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let size = std::fs::metadata(path).map_err(|e| Error::file(path, e))?.len();
        if size > MOST_BYTES as u64 {
            return Err(Error::mistake(
                Place::file(path),
                format!("file has {size} bytes, more than {MOST_BYTES}"),
                "a machine file takes a few kilobytes; is this the right file?",
            ));
        }
        let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
        if let Some(foreign) = foreign::of(path, &bytes[..bytes.len().min(foreign::START)]) {
            let what = format!("this is {}, and no machine file", foreign.what);
            return Err(Error::mistake(Place::file(path), what, NO_TEXT));
        }
        let text = String::from_utf8(bytes).map_err(|e| {
            let good = String::from_utf8_lossy(&e.as_bytes()[..e.utf8_error().valid_up_to()]).into_owned();
            let (line, column) = line_and_column(&good, good.len());
            Error::mistake(Place::at(path, line, column), "this is not UTF-8 text", NO_TEXT)
        })?;
        Self::new(path, text)
    }

    /// The same text with another hint for whoever does not know its form.
    pub fn guided(mut self, guide: &'static str) -> Self {
        self.guide = guide;
        self
    }

    fn refuse(&self, place: Place, message: String, mend: &str) -> Error {
        Error::mistake(place, message, mend)
    }

    /// The text as a value; a mistake names its line and column.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T> {
        let options = ron::Options::default().with_default_extension(EXTENSIONS);
        options.from_str(&self.text).map_err(|e| {
            let start = e.span.start;
            let (message, mend) = match self.at_end(start.line, start.col, &e.code) {
                true if self.text.trim().is_empty() => ("the file is empty".into(), self.guide.into()),
                true => explain(&ron::Error::Eof, self.guide),
                false => explain(&e.code, self.guide),
            };
            Error::mistake(Place::at(&self.file, start.line, start.col), message, mend)
        })
    }

    /// Whether RON's reader stopped because nothing more came, whatever it was waiting for.
    fn at_end(&self, line: usize, column: usize, code: &ron::Error) -> bool {
        use ron::Error::{DuplicateStructField, MissingStructField, TrailingCharacters};
        let told =
            matches!(code, MissingStructField { .. } | DuplicateStructField { .. } | TrailingCharacters);
        !told && (line, column) >= line_and_column(&self.text, self.text.trim_end().len())
    }

    /// Where the value at `path` starts; where the path leads nowhere, its nearest parent.
    pub fn place_of(&self, path: &str) -> Place {
        let places = Scanner::new(&self.text).places();
        let mut path = path.to_string();
        loop {
            if let Some((_, offset)) = places.iter().find(|(p, _)| *p == path) {
                let (line, column) = line_and_column(&self.text, *offset);
                return Place::at(&self.file, line, column);
            }
            match path.rfind(['.', '[']) {
                Some(cut) => path.truncate(cut),
                None if path.is_empty() => return Place::file(&self.file),
                None => path.clear(),
            }
        }
    }
}

/// The mend where the text is not even near to what it should be.
const NOT_RON: &str = "docs/machines.md shows the form of a machine file";

/// What RON's reader says, in words that help, and the mend.
fn explain(code: &ron::Error, guide: &str) -> (String, String) {
    let list = |names: &[&str]| names.join(", ");
    match code {
        ron::Error::NoSuchStructField { expected, found, .. } => {
            (format!("unknown field `{found}`"), format!("write one of: {}", list(expected)))
        }
        ron::Error::NoSuchEnumVariant { expected, found, .. } => {
            (format!("unknown word `{found}`"), format!("write one of: {}", list(expected)))
        }
        ron::Error::MissingStructField { field, outer } => (
            match outer {
                Some(outer) => format!("field `{field}` of `{outer}` is missing"),
                None => format!("field `{field}` is missing"),
            },
            format!("add `{field}: ...`"),
        ),
        ron::Error::DuplicateStructField { field, .. } => {
            (format!("field `{field}` is given twice"), "keep one of them".into())
        }
        ron::Error::ExpectedComma | ron::Error::ExpectedArrayEnd => {
            ("expected a comma".into(), "separate fields and list entries with commas".into())
        }
        ron::Error::ExpectedMapColon => {
            ("expected a colon".into(), "write a field as name: value, with a colon between".into())
        }
        ron::Error::ExpectedFloat => {
            ("expected a number".into(), "write a plain number, such as 158.5".into())
        }
        ron::Error::ExpectedInteger => ("expected a whole number".into(), "write 1 or -1, say".into()),
        ron::Error::ExpectedString => {
            ("expected a text in quotes".into(), "put it in quotes: \"...\"".into())
        }
        ron::Error::ExpectedStringEnd => {
            ("this text in quotes never ends".into(), "close it with a quotation mark".into())
        }
        ron::Error::UnclosedBlockComment => ("this comment never ends".into(), "close it with */".into()),
        ron::Error::ExpectedIdentifier => {
            ("expected a word without quotes".into(), "leave out the quotes: length: mm".into())
        }
        ron::Error::ExpectedStructLikeEnd => (
            "expected a closing bracket `)`".into(),
            "close the bracket here; a decimal fraction takes a point, not a comma".into(),
        ),
        ron::Error::ExpectedStructLike | ron::Error::ExpectedArray => (
            "expected an opening bracket".into(),
            "three numbers go as (x, y, z), a list as [first, second]".into(),
        ),
        ron::Error::ExpectedNamedStructLike(name) => (
            match *name {
                "" => "expected an opening bracket `(`".into(),
                name => format!("expected `{name}` in brackets: (field: value, ...)"),
            },
            guide.into(),
        ),
        ron::Error::ExpectedDifferentLength { expected, found } => {
            let expected = if expected == "a tuple of size 3" { "three numbers" } else { expected };
            (
                format!("expected {expected}, found {}", count(*found as u64, "element", "elements")),
                "write (x, y, z)".into(),
            )
        }
        ron::Error::InvalidValueForType { expected, found } => {
            // RON calls a bare word a unit value.
            let found = if found == "a unit value" { "a word without quotes" } else { found };
            (format!("expected {expected}, found {found}"), format!("write {expected}"))
        }
        ron::Error::ExpectedDifferentStructName { expected, found } => {
            (format!("expected `{expected}`, found `{found}`"), format!("begin with {expected}("))
        }
        ron::Error::TrailingCharacters => {
            ("something follows the closing bracket".into(), "leave nothing after it but comments".into())
        }
        ron::Error::ExpectedAttribute => {
            ("`#` does not begin a comment".into(), "comments begin with //".into())
        }
        ron::Error::Eof => {
            ("the text ends too early".into(), "close every bracket and quotation mark".into())
        }
        other => (other.to_string(), guide.into()),
    }
}

fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = &text[..offset.min(text.len())];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |last| last.chars().count()) + 1;
    (line, column)
}

/// Place of the first bracket that nests too deep, comments and strings left out.
fn too_deep(text: &str) -> Option<(usize, usize)> {
    let (mut scanner, mut depth) = (Scanner::new(text), 0usize);
    loop {
        scanner.skip_blank();
        let at = scanner.at;
        match scanner.peek()? {
            '"' => scanner.skip_string(),
            '(' | '[' | '{' => {
                depth += 1;
                if depth > MOST_DEPTH {
                    return Some(line_and_column(text, at));
                }
                scanner.at += 1;
            }
            ')' | ']' | '}' => {
                depth = depth.saturating_sub(1);
                scanner.at += 1;
            }
            c => scanner.at += c.len_utf8(),
        }
    }
}

/// Walks over a text that RON's reader has accepted and notes where each value starts.
struct Scanner<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Scanner<'a> {
    fn new(text: &'a str) -> Self {
        Scanner { text, at: 0 }
    }

    fn peek(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    fn starts(&self, word: &str) -> bool {
        self.text[self.at..].starts_with(word)
    }

    fn skip_while(&mut self, keep: impl Fn(char) -> bool) {
        while let Some(c) = self.peek().filter(|c| keep(*c)) {
            self.at += c.len_utf8();
        }
    }

    fn skip_blank(&mut self) {
        loop {
            self.skip_while(char::is_whitespace);
            if self.starts("//") {
                self.skip_while(|c| c != '\n');
            } else if self.starts("/*") {
                let mut depth = 0;
                while self.at < self.text.len() {
                    if self.starts("/*") {
                        (depth, self.at) = (depth + 1, self.at + 2);
                    } else if self.starts("*/") {
                        (depth, self.at) = (depth - 1, self.at + 2);
                        if depth == 0 {
                            break;
                        }
                    } else {
                        self.at += self.peek().map_or(1, char::len_utf8);
                    }
                }
            } else {
                return;
            }
        }
    }

    fn skip_string(&mut self) {
        self.at += 1;
        while let Some(c) = self.peek() {
            self.at += c.len_utf8();
            match c {
                '"' => return,
                '\\' => self.at += self.peek().map_or(0, char::len_utf8),
                _ => {}
            }
        }
    }

    fn places(mut self) -> Vec<(String, usize)> {
        let mut places = Vec::new();
        self.skip_blank();
        self.value(String::new(), &mut places, 0);
        places
    }

    fn value(&mut self, path: String, places: &mut Vec<(String, usize)>, depth: usize) {
        places.push((path.clone(), self.at));
        if depth > MOST_DEPTH {
            return;
        }
        // A name before a bracket (`Revolute(`) belongs to the value that follows.
        self.skip_while(|c| c.is_alphanumeric() || matches!(c, '_' | '-' | '+' | '.' | '#'));
        let after_name = self.at;
        self.skip_blank();
        match self.peek() {
            Some('(' | '[' | '{') => self.members(&path, places, depth),
            Some('"') => self.skip_string(),
            _ => self.at = after_name,
        }
    }

    fn members(&mut self, path: &str, places: &mut Vec<(String, usize)>, depth: usize) {
        self.at += 1;
        for index in 0.. {
            self.skip_blank();
            match self.peek() {
                None => return,
                Some(')' | ']' | '}') => {
                    self.at += 1;
                    return;
                }
                Some(_) => {}
            }
            let start = self.at;
            let key = self.key();
            let member = match key {
                Some(key) if path.is_empty() => key,
                Some(key) => format!("{path}.{key}"),
                None => format!("{path}[{index}]"),
            };
            self.value(member, places, depth + 1);
            self.skip_blank();
            if self.peek() == Some(',') {
                self.at += 1;
            }
            if self.at == start {
                return; // not RON after all; the reader has said so
            }
        }
    }

    /// A field name or a map key in quotes, with its colon; the scanner stays where it was if there is none.
    fn key(&mut self) -> Option<String> {
        let start = self.at;
        if self.peek() == Some('"') {
            self.skip_string();
        } else {
            self.skip_while(|c| c.is_alphanumeric() || c == '_');
        }
        let key = self.text[start..self.at].trim_matches('"').to_string();
        self.skip_blank();
        if self.peek() == Some(':') && !key.is_empty() {
            self.at += 1;
            self.skip_blank();
            return Some(key);
        }
        self.at = start;
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(text: &str, path: &str) -> (usize, usize) {
        let document = Document::new("x.ron", text.to_string()).expect("a small text");
        let place = document.place_of(path);
        (place.line, place.column)
    }

    #[test]
    fn places_of_values_survive_comments_strings_and_nesting() {
        let text = "/* ( */ Machine(\n  name: \"a, (b\", // [\n  tool: [(frame: \"x\", joint: Revolute(axis: (0, 1,\n 2)))],\n map: {\"k\": 3},\n)";
        assert_eq!(place(text, "name"), (2, 9));
        assert_eq!(place(text, "tool[0].joint.axis[2]"), (4, 2));
        assert_eq!(place(text, "map.k"), (5, 13));
        assert_eq!(place(text, "tool[0].mass"), place(text, "tool[0]"));
        assert_eq!(place(text, ""), (1, 9));
    }

    #[test]
    fn deep_nesting_is_refused_before_it_is_read() {
        let error = Document::new("x.ron", "(".repeat(100_000)).err().expect("too deep");
        assert_eq!(error.to_string(), "x.ron:1:33: brackets are nested deeper than 32");
    }
}

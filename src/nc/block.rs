//! One block: a line as tokens, and what should be written in its place.

use std::io::Write;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use super::cut::Cutter;
use super::dialect::Dialect;
use super::fault::NcFault;
use super::number::Number;
use super::token::{Kind, Token};
use super::words::{Value, Word};
use crate::error::{Error, Place, Result};

/// One line of a program, its tokens, and the changes that should be written.
#[derive(Clone, Debug)]
pub struct Block {
    file: Arc<Path>,
    line: usize,
    bytes: Vec<u8>,
    tokens: Vec<Token>,
    words: Vec<Word>,
    /// Sorted by start; an insertion has an empty range. What stands in the place of each lies in `patches`.
    edits: Vec<(Range<usize>, Range<usize>)>,
    patches: Vec<u8>,
}

impl Block {
    /// Reads line `line` (from 1), with or without its line end. Any bytes make a block: what is not understood is
    /// [`Kind::Other`].
    pub fn new(line: usize, bytes: &[u8], dialect: Dialect) -> Block {
        Block::of_file(Arc::from(Path::new("")), line, bytes.to_vec(), dialect)
    }

    pub(crate) fn of_file(file: Arc<Path>, line: usize, bytes: Vec<u8>, dialect: Dialect) -> Block {
        let (tokens, words) = Cutter::cut(&bytes, dialect, (Vec::new(), Vec::new()));
        Block { file, line, bytes, tokens, words, edits: Vec::new(), patches: Vec::new() }
    }

    /// Another line of the same file in the memory of this block.
    pub(super) fn reread(&mut self, line: usize, bytes: Vec<u8>, dialect: Dialect) {
        self.restore();
        let pieces = (std::mem::take(&mut self.tokens), std::mem::take(&mut self.words));
        (self.tokens, self.words) = Cutter::cut(&bytes, dialect, pieces);
        (self.line, self.bytes) = (line, bytes);
    }

    /// The bytes of a block that is read anew next.
    pub(super) fn take_bytes(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.bytes)
    }

    /// Takes numbers without a point at these addresses as counts of a least increment of 0.001 mm or 0.001 deg.
    pub(crate) fn count_increments(&mut self, addresses: &[&str]) {
        for word in self.words.iter_mut().filter(|word| addresses.contains(&word.address.as_str())) {
            if let Value::Number(number) = &mut word.value {
                *number = number.in_increments(1e-3);
            }
        }
    }

    /// The file that the line is from, as the user named it.
    pub(crate) fn file(&self) -> Arc<Path> {
        self.file.clone()
    }

    /// Number of the line, from 1.
    pub fn line(&self) -> usize {
        self.line
    }

    /// The line as read, with its line end if it has one.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The pieces of the line.
    pub fn tokens(&self) -> &[Token] {
        &self.tokens
    }

    /// The words of the line as read; changes do not show here.
    pub fn words(&self) -> &[Word] {
        &self.words
    }

    /// Where the last token ends.
    pub(super) fn content_end(&self) -> usize {
        self.tokens.iter().rfind(|t| t.kind != Kind::Comment).map_or(0, |t| t.span.end)
    }

    /// Whether the line has nothing but block numbers, words of axes and feeds, and `G0` or `G1`: all that it can change are where axes are,
    /// the motion and the feed.
    pub(crate) fn is_plain_motion(&self) -> bool {
        let is_plain = |word: &Word| match (word.address.letter(), word.number()) {
            (Some(b'X'..=b'Z' | b'A'..=b'C' | b'U'..=b'W' | b'F'), Some(_)) => true,
            (Some(b'G'), Some(code)) => matches!(code, 0.0 | 1.0),
            _ => false,
        };
        self.tokens.iter().all(|token| match token.kind {
            Kind::Word(index) => is_plain(&self.words[index]),
            kind => kind == Kind::BlockNumber,
        })
    }

    /// Whether a word has this address.
    pub(super) fn has_word(&self, address: &str) -> bool {
        self.words.iter().any(|w| w.address == address)
    }

    /// The value of the first word of this address, as written.
    pub(super) fn word_text(&self, address: &str) -> Option<String> {
        self.words.iter().find(|w| w.address == address).map(|w| self.text(&w.value_span))
    }

    /// The bytes of a token or word as text, for messages.
    pub fn text(&self, span: &Range<usize>) -> String {
        String::from_utf8_lossy(self.bytes.get(span.clone()).unwrap_or_default()).into_owned()
    }

    /// The name of a [`Kind::Name`] or [`Kind::Call`] in upper case, without arguments; the whole text of another token.
    pub fn name(&self, token: &Token) -> String {
        let text = self.text(&token.span).to_ascii_uppercase();
        match token.kind {
            Kind::Call => text.split('(').next().unwrap_or_default().trim_end().to_string(),
            _ => text,
        }
    }

    /// Puts `text` in the place of the number of word `word`. A second call for the same word takes the place of the first.
    ///
    /// `text`: a plain number in programmed units, as [`Word::write_like`] makes it.
    ///
    /// # Errors
    /// [`NcFault::NoSuchWord`], [`NcFault::Expression`], [`NcFault::NotPlain`].
    pub fn replace(&mut self, word: usize, text: &str) -> Result<()> {
        let found = self.word(word)?;
        if found.value == Value::Expression {
            let fault = NcFault::Expression {
                address: found.address.to_string(),
                text: short(&self.text(&found.value_span)),
            };
            return Err(self.fault(found.value_span.start, fault));
        }
        let start = found.value_span.start;
        self.check_number(start, text)?;
        self.put(word, text.as_bytes());
        Ok(())
    }

    /// As [`Block::replace`], by what was read as a plain number already; of a word that has a plain number.
    pub(crate) fn replace_number(&mut self, word: usize, text: &[u8]) -> Result<()> {
        match self.word(word)?.value {
            Value::Number(_) => self.put(word, text),
            Value::Expression => self.replace(word, &String::from_utf8_lossy(text))?,
        }
        Ok(())
    }

    fn put(&mut self, word: usize, text: &[u8]) {
        let span = self.words[word].value_span.clone();
        self.edits.retain(|(range, _)| *range != span);
        self.edit(span, &[text]);
    }

    /// Puts a new word behind word `after`, for an axis that the block does not name: with `=` where the address needs it,
    /// with a blank unless the block writes its words without.
    ///
    /// `number`: a plain number in programmed units.
    ///
    /// # Errors
    /// [`NcFault::NoSuchWord`], [`NcFault::BadAddress`], [`NcFault::NotPlain`].
    pub fn insert(&mut self, after: usize, address: &str, number: &str) -> Result<()> {
        let end = self.word(after)?.span.end;
        let equals = self.check_word(end, address, number)?;
        let blank = self.separator(after);
        self.edit(end..end, &[blank, address, equals, number].map(str::as_bytes));
        Ok(())
    }

    /// Puts a new word before word `before`; otherwise as [`Block::insert`].
    ///
    /// # Errors
    /// As [`Block::insert`].
    pub fn insert_before(&mut self, before: usize, address: &str, number: &str) -> Result<()> {
        let start = self.word(before)?.span.start;
        let equals = self.check_word(start, address, number)?;
        let blank = self.separator(before);
        self.edit(start..start, &[address, equals, number, blank].map(str::as_bytes));
        Ok(())
    }

    /// Takes a word out, with the blanks before it.
    ///
    /// # Errors
    /// [`NcFault::NoSuchWord`].
    pub fn remove(&mut self, word: usize) -> Result<()> {
        let span = self.word(word)?.span.clone();
        let blanks = self.bytes[..span.start].iter().rev().take_while(|b| matches!(b, b' ' | b'\t')).count();
        let range = span.start - blanks..span.end;
        self.edits.retain(|(other, _)| other.start < range.start || other.end > range.end);
        self.edit(range, &[]);
        Ok(())
    }

    /// What stands between words: nothing where the block packs them.
    pub(crate) fn separator(&self, word: usize) -> &'static str {
        let packed = self.words.windows(2).any(|w| w[0].span.end == w[1].span.start)
            && self.words[word].value != Value::Expression;
        if packed { "" } else { " " }
    }

    /// Whether address and number make a word of this block; what stands between them.
    fn check_word(&self, end: usize, address: &str, number: &str) -> Result<&'static str> {
        let letters = address.bytes().take_while(u8::is_ascii_alphabetic).count();
        if letters == 0 || !address.bytes().all(|b| b.is_ascii_alphanumeric()) {
            return Err(self.fault(end, NcFault::BadAddress { address: short(address) }));
        }
        self.check_number(end, number)?;
        Ok(if address.len() > 1 { "=" } else { "" })
    }

    /// Takes every change back.
    pub(crate) fn restore(&mut self) {
        self.edits.clear();
        self.patches.clear();
    }

    /// Whether anything was replaced or inserted.
    pub fn is_changed(&self) -> bool {
        !self.edits.is_empty()
    }

    /// The line as it should be written, with its line end.
    pub fn output(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(self.bytes.len() + self.patches.len());
        self.write_to(&mut out).expect("memory takes all");
        out
    }

    /// Writes [`output`](Block::output).
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_to(&self, out: &mut (impl Write + ?Sized)) -> std::io::Result<()> {
        let mut at = 0;
        for (range, text) in &self.edits {
            out.write_all(&self.bytes[at..range.start])?;
            out.write_all(&self.patches[text.clone()])?;
            at = range.end;
        }
        out.write_all(&self.bytes[at..])
    }

    /// The place of a byte of this line.
    pub fn place(&self, byte: usize) -> Place {
        Place::at(&self.file, self.line, self.column(byte))
    }

    /// A fault at a byte of this line.
    pub(super) fn fault(&self, byte: usize, fault: NcFault) -> Error {
        Error::input(self.place(byte), fault)
    }

    /// Column in characters, from 1.
    pub(super) fn column(&self, byte: usize) -> usize {
        String::from_utf8_lossy(&self.bytes[..byte.min(self.bytes.len())]).chars().count() + 1
    }

    fn word(&self, index: usize) -> Result<&Word> {
        self.words
            .get(index)
            .ok_or_else(|| self.fault(0, NcFault::NoSuchWord { index, words: self.words.len() }))
    }

    fn check_number(&self, byte: usize, text: &str) -> Result<()> {
        match Number::parse(text.as_bytes(), Dialect::Heidenhain) {
            Some(_) => Ok(()),
            None => Err(self.fault(byte, NcFault::NotPlain { text: short(text) })),
        }
    }

    fn edit(&mut self, range: Range<usize>, pieces: &[&[u8]]) {
        if self.patches.is_empty() {
            self.patches.reserve(self.bytes.len() + 16);
        }
        let start = self.patches.len();
        pieces.iter().for_each(|piece| self.patches.extend_from_slice(piece));
        let text = start..self.patches.len();
        if self.edits.is_empty() {
            self.edits.reserve(self.words.len());
        }
        let comes_last =
            self.edits.last().is_none_or(|(last, _)| last.end <= range.start && last.start < range.start);
        let at = match comes_last {
            true => self.edits.len(),
            false => {
                self.edits.partition_point(|(other, _)| (other.start, other.end) <= (range.start, range.end))
            }
        };
        self.edits.insert(at, (range, text));
    }
}

/// For a message: without control characters, cut short.
fn short(text: &str) -> String {
    const LONGEST: usize = 40;
    let clean = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    let cut: String = text.chars().take(LONGEST).map(clean).collect();
    if text.chars().nth(LONGEST).is_some() { cut + "..." } else { cut }
}

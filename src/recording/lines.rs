//! Lines of a source in bounded memory, without an allocation per line.

use std::io::{ErrorKind, Read};
use std::ops::Range;

/// Longest line that is read, bytes.
pub(super) const LONGEST: usize = 1 << 20;

const FIRST_SIZE: usize = 1 << 17;

/// Why no further line comes.
#[derive(Debug)]
pub(super) enum Stop {
    Io(std::io::Error),
    TooLong,
}

/// A line: ranges of [`Lines::bytes`] that hold until the next one is read.
#[derive(Debug)]
pub(super) struct Line {
    /// With its line end.
    pub raw: Range<usize>,
    /// Without `\n` or `\r\n`.
    pub content: Range<usize>,
}

/// Cuts a source into lines.
pub(super) struct Lines {
    source: Box<dyn Read + Send>,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    ended: bool,
    /// Number of the line last returned, from 1; 0 before the first.
    pub number: u64,
    /// Bytes of the source up to the end of that line.
    pub offset: u64,
}

impl Lines {
    /// Starts behind line `number`, which ends at byte `offset`; the source stands there already.
    pub fn new(source: Box<dyn Read + Send>, number: u64, offset: u64) -> Self {
        Lines { source, buffer: vec![0; FIRST_SIZE], start: 0, end: 0, ended: false, number, offset }
    }

    /// The bytes that a [`Line`]'s ranges point into.
    pub fn bytes(&self, range: Range<usize>) -> &[u8] {
        &self.buffer[range]
    }

    /// The next line; the last one need not have a line end.
    pub fn next(&mut self) -> Result<Option<Line>, Stop> {
        let mut searched = self.start;
        loop {
            let end = match self.buffer[searched..self.end].iter().position(|b| *b == b'\n') {
                Some(i) => searched + i + 1,
                None if self.ended && self.start == self.end => return Ok(None),
                None if self.ended => self.end,
                None if self.end - self.start > LONGEST => {
                    self.number += 1;
                    return Err(Stop::TooLong);
                }
                None => {
                    searched = self.end - self.start;
                    self.fill().map_err(Stop::Io)?;
                    continue;
                }
            };
            let raw = self.start..end;
            self.start = end;
            self.number += 1;
            self.offset += raw.len() as u64;
            if raw.len() > LONGEST {
                return Err(Stop::TooLong);
            }
            let line = &self.buffer[raw.clone()];
            let line = line.strip_suffix(b"\n").unwrap_or(line);
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            let content = raw.start..raw.start + line.len();
            return Ok(Some(Line { raw, content }));
        }
    }

    /// Moves what is left to the front and reads on.
    fn fill(&mut self) -> std::io::Result<()> {
        self.buffer.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        if self.end == self.buffer.len() {
            self.buffer.resize(2 * self.end, 0);
        }
        loop {
            match self.source.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.ended = true,
                Ok(count) => self.end += count,
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(e) => return Err(e),
            }
            return Ok(());
        }
    }
}

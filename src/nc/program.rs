//! A program as a stream of blocks.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind};
use std::path::Path;
use std::sync::Arc;

use super::block::Block;
use super::dialect::Dialect;
use super::fault::NcFault;
use crate::error::{Error, Place, Result};

/// Longest line that is read, bytes.
pub const LONGEST_LINE: usize = 1 << 20;

/// Bytes of an ordinary line.
const ORDINARY_LINE: usize = 64;

/// Lines and bytes at the start of a program from which its dialect is taken.
const HEAD_LINES: usize = 200;
const HEAD_BYTES: usize = 1 << 16;

/// Reads a program block by block; holds a few lines at its start and then one line.
#[derive(Debug)]
pub struct Program<R> {
    file: Arc<Path>,
    source: R,
    dialect: Dialect,
    /// Lines read ahead.
    head: VecDeque<Vec<u8>>,
    /// What stopped the reading ahead.
    stop: Option<Error>,
    /// Number of the line that was read last from the source.
    read: usize,
    /// Number of the block that was returned last.
    line: usize,
    ended: bool,
    /// Addresses whose numbers without a point count least increments.
    increments: &'static [&'static str],
}

impl Program<BufReader<File>> {
    /// Opens a file; its dialect is taken from its first blocks.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let file = File::open(&path).map_err(|e| Error::file(&path, e))?;
        Program::new(path, BufReader::new(file))
    }
}

impl<R: BufRead> Program<R> {
    /// Reads from `source`, named `file` in messages; the dialect is taken from the first blocks, [`Dialect::Rs274`] where
    /// these tell nothing.
    ///
    /// # Errors
    /// None now; a source that cannot be read fails at the block that cannot be read.
    pub fn new(file: impl AsRef<Path>, source: R) -> Result<Self> {
        let mut program = Program::with_dialect(file, source, Dialect::default());
        let mut bytes = 0;
        while program.head.len() < HEAD_LINES && bytes < HEAD_BYTES {
            let mut line = Vec::new();
            match program.read_line(&mut line) {
                Ok(true) => {
                    bytes += line.len();
                    let told = Dialect::of_line(&line);
                    program.head.push_back(line);
                    if let Some(dialect) = told {
                        program.dialect = dialect;
                        break;
                    }
                }
                Ok(false) => break,
                Err(stop) => {
                    program.stop = Some(stop);
                    break;
                }
            }
        }
        Ok(program)
    }

    /// Reads from `source`, named `file` in messages, in a dialect that is known.
    pub fn with_dialect(file: impl AsRef<Path>, source: R, dialect: Dialect) -> Self {
        let file = Arc::from(file.as_ref());
        Program {
            file,
            source,
            dialect,
            head: VecDeque::new(),
            stop: None,
            read: 0,
            line: 0,
            ended: false,
            increments: &[],
        }
    }

    /// The dialect in which blocks are read.
    pub fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// Reads the blocks that follow in another dialect.
    pub fn set_dialect(&mut self, dialect: Dialect) {
        self.dialect = dialect;
    }

    /// Takes numbers without a point at these addresses as counts of a least increment, 0.001 mm or 0.001 deg.
    pub(crate) fn count_increments(&mut self, addresses: &'static [&'static str]) {
        self.increments = addresses;
    }

    /// Addresses whose numbers without a point count least increments.
    pub(crate) fn increments(&self) -> &'static [&'static str] {
        self.increments
    }

    /// The next block; `None` behind the last, and behind a fault.
    ///
    /// # Errors
    /// [`NcFault::LineTooLong`] with its line, [`Error::File`].
    pub fn next_block(&mut self) -> Result<Option<Block>> {
        let mut bytes = Vec::with_capacity(ORDINARY_LINE);
        Ok(self.next_line(&mut bytes)?.then(|| self.block_of(bytes)))
    }

    /// As [`Program::next_block`], in the memory of a block of this program that is done with.
    pub(crate) fn next_block_over(&mut self, mut block: Block) -> Result<Option<Block>> {
        let mut bytes = block.take_bytes();
        if !self.next_line(&mut bytes)? {
            return Ok(None);
        }
        block.reread(self.line, bytes, self.dialect);
        block.count_increments(self.increments);
        Ok(Some(block))
    }

    /// The line that was returned last as a block.
    pub(crate) fn block_of(&self, bytes: Vec<u8>) -> Block {
        let mut block = Block::of_file(self.file.clone(), self.line, bytes, self.dialect);
        block.count_increments(self.increments);
        block
    }

    /// Number of the line that was returned last.
    pub(crate) fn line(&self) -> usize {
        self.line
    }

    /// The bytes of the next block in the place of others; whether there is one. Otherwise as [`Program::next_block`].
    pub(crate) fn next_line(&mut self, line: &mut Vec<u8>) -> Result<bool> {
        if self.ended {
            return Ok(false);
        }
        let is_there = match (self.head.pop_front(), &self.stop) {
            (Some(first), _) => {
                *line = first;
                Ok(true)
            }
            (None, Some(_)) => self.stop.take().map_or(Ok(false), Err),
            (None, None) => self.read_line(line),
        };
        self.ended = !matches!(is_there, Ok(true));
        self.line += 1;
        is_there
    }

    /// The next line with its line end in the place of another; whether there is one.
    fn read_line(&mut self, line: &mut Vec<u8>) -> Result<bool> {
        line.clear();
        loop {
            let part = match self.source.fill_buf() {
                Ok(part) => part,
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(e) => return Err(Error::file(&self.file, e)),
            };
            if part.is_empty() {
                break;
            }
            let end = part.iter().position(|b| *b == b'\n').map_or(part.len(), |i| i + 1);
            if line.len() + end > LONGEST_LINE {
                let place = Place::at(&self.file, self.read + 1, 0);
                return Err(Error::input(place, NcFault::LineTooLong { limit: LONGEST_LINE }));
            }
            line.extend_from_slice(&part[..end]);
            self.source.consume(end);
            if line.ends_with(b"\n") {
                break;
            }
        }
        if line.is_empty() {
            return Ok(false);
        }
        self.read += 1;
        Ok(true)
    }
}

impl<R: BufRead> Iterator for Program<R> {
    type Item = Result<Block>;

    fn next(&mut self) -> Option<Result<Block>> {
        self.next_block().transpose()
    }
}

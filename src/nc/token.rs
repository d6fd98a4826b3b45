//! Tokens: the pieces of a line.

use std::ops::Range;

/// A piece of a line. Tokens stand in the order of the line, do not overlap, and only blanks are left between them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    /// What it is.
    pub kind: Kind,
    /// Its bytes in the line.
    pub span: Range<usize>,
}

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `N10`, `:10`, Heidenhain's bare `10`.
    BlockNumber,
    /// `/` or `/3` at the start: the block is left out when the operator wants so.
    Skip,
    /// `( ... )`, or `;` to the end of the line.
    Comment,
    /// A whole line that starts with `%`.
    Percent,
    /// An address with a value: index into [`Block::words`](super::Block::words).
    Word(usize),
    /// A name with its arguments: `CYCLE800(...)`, `MSG("...")`.
    Call,
    /// A name without value: `TRAORI`, Heidenhain's `L`.
    Name,
    /// Everything else, passed through: strings, assignments to parameters, what follows `IF` or `DEF`, unknown bytes.
    Other,
}

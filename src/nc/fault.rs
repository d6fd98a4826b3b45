//! What can be wrong with an NC program, and the mend for each.

use crate::error::Fault;
use crate::wording::count;

/// A fault in an NC program, or in what should be written into one.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NcFault {
    /// A line that no control would take.
    #[error("line is longer than {limit} bytes")]
    LineTooLong {
        /// Longest line that is read, bytes.
        limit: usize,
    },
    /// One axis twice in one block.
    #[error("`{address}` stands twice in this block, first in column {first}")]
    TwiceInBlock {
        /// The address.
        address: String,
        /// Column of the first, from 1.
        first: usize,
    },
    /// A word that the block does not have.
    #[error("block has {}, none with index {index}", count(*words as u64, "word", "words"))]
    NoSuchWord {
        /// The index asked for, from 0.
        index: usize,
        /// How many words the block has.
        words: usize,
    },
    /// A number should take the place of something that is none.
    #[error("value of `{address}` is the expression `{text}`, not a number")]
    Expression {
        /// The address.
        address: String,
        /// As written.
        text: String,
    },
    /// Something else than a plain number should be written.
    #[error("`{text}` is no plain number")]
    NotPlain {
        /// As it should have been written.
        text: String,
    },
    /// A new word with an address that is none.
    #[error("`{address}` is no address")]
    BadAddress {
        /// As it should have been written.
        address: String,
    },
}

impl Fault for NcFault {
    fn mend(&self) -> String {
        use NcFault::*;
        match self {
            LineTooLong { .. } => "write one block per line; is this an NC program at all?".into(),
            TwiceInBlock { address, .. } => format!("keep one `{address}`, or write two blocks"),
            NoSuchWord { .. } => "take an index from the block's own list of words".into(),
            Expression { address, .. } => {
                format!("write a number behind `{address}`; let the CAM system put variables in as numbers")
            }
            NotPlain { .. } => "write digits with at most one decimal point, no exponent".into(),
            BadAddress { .. } => {
                "write a letter, or letters with digits behind them, as in `X` or `C1`".into()
            }
        }
    }
}

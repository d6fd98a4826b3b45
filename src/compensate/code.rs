//! G and M codes of a block, as far as compensation asks for them.

use crate::nc::{Block, Dialect};

/// Whether the block has this G word.
pub(super) fn has_g(block: &Block, code: f64) -> bool {
    has(block, "G", code)
}

/// Whether the block has this M word.
pub(super) fn has_m(block: &Block, code: f64) -> bool {
    has(block, "M", code)
}

fn has(block: &Block, address: &str, code: f64) -> bool {
    block.words().iter().any(|w| w.address == address && w.number() == Some(code))
}

/// Whether the program ends with this block.
pub(super) fn ends(block: &Block) -> bool {
    has_m(block, 2.0) || has_m(block, 30.0)
}

/// Whether the block sends axes to a reference point.
pub(super) fn refers(block: &Block, dialect: Dialect) -> bool {
    let codes: &[f64] = match dialect {
        Dialect::Rs274 => &[28.0, 28.1, 30.0, 30.1, 27.0, 29.0],
        Dialect::Siemens => &[74.0, 75.0],
        Dialect::Heidenhain => &[],
    };
    codes.iter().any(|code| has_g(block, *code))
}

/// Whether an M word of the block acts when its motion is over.
pub(super) fn acts_behind(block: &Block) -> bool {
    [0.0, 1.0, 2.0, 5.0, 9.0, 30.0, 60.0].iter().any(|code| has_m(block, *code))
}

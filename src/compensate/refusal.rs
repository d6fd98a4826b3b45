//! The refusal of a block: the fault with its place.

use super::fault::CompensateFault;
use crate::error::{Error, Result};
use crate::nc::Block;

/// A refusal at a byte of a block.
pub(super) fn refuse<T>(block: &Block, byte: usize, fault: CompensateFault) -> Result<T> {
    Err(Error::input(block.place(byte), fault))
}

/// The block without its end and blanks around, cut short, for messages.
pub(super) fn line_text(block: &Block) -> String {
    String::from_utf8_lossy(block.bytes()).trim().chars().take(60).collect()
}

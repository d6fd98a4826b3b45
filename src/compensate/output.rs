//! What goes out. A failure to write is told by whoever owns the output.

use std::io::Write;

use crate::error::{Error, Result};
use crate::nc::Block;

/// A block as it should be written.
pub(super) fn put(block: &Block, out: &mut dyn Write) -> Result<()> {
    block.write_to(out).map_err(|e| Error::file("output", e))
}

/// Bytes as they are.
pub(super) fn put_bytes(bytes: &[u8], out: &mut dyn Write) -> Result<()> {
    out.write_all(bytes).map_err(|e| Error::file("output", e))
}

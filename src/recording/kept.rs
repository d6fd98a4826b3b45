//! What a recording keeps of its first full pass: the samples in memory, as long as all recordings together stay within a budget.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::reader::Chunk;
use super::summary::Summary;

/// Bytes that the samples of all recordings may take up in memory; those of larger ones are read again in every pass.
const BUDGET: usize = 128 << 20;

/// Bytes that they take up now.
static TAKEN: AtomicUsize = AtomicUsize::new(0);

/// The summary of a pass, and its samples where there was room for them.
#[derive(Debug)]
pub(super) struct Kept {
    pub summary: Summary,
    chunks: Option<Vec<Arc<Chunk>>>,
    /// Held as long as they are.
    _room: Room,
}

/// A part of the budget; given back when it is dropped.
#[derive(Debug, Default)]
struct Room(usize);

impl Drop for Room {
    fn drop(&mut self) {
        TAKEN.fetch_sub(self.0, Ordering::Relaxed);
    }
}

impl Kept {
    /// The samples, where they are in memory.
    pub fn chunks(&self) -> Option<&[Arc<Chunk>]> {
        self.chunks.as_deref()
    }
}

/// Collects samples chunk by chunk, until there is no room for more.
#[derive(Debug, Default)]
pub(super) struct Keeping {
    chunks: Vec<Arc<Chunk>>,
    room: Room,
    is_over: bool,
}

impl Keeping {
    /// Keeps a chunk, or nothing any more.
    pub fn take(&mut self, chunk: Chunk) {
        if self.is_over {
            return;
        }
        let size = chunk.bytes();
        self.room.0 += size;
        if TAKEN.fetch_add(size, Ordering::Relaxed) + size > BUDGET {
            *self = Keeping { is_over: true, ..Keeping::default() };
        } else {
            self.chunks.push(Arc::new(chunk));
        }
    }

    /// All that was kept, with the summary of the pass.
    pub fn with(self, summary: Summary) -> Kept {
        Kept { summary, chunks: (!self.is_over).then_some(self.chunks), _room: self.room }
    }
}

//! What a recording keeps of its first full pass: the samples in memory, as long as all recordings together stay within a budget, else in a
//! file of numbers.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use super::Recording;
use super::chunk::Chunk;
use super::spool::{Shape, Spool, SpoolWriter};
use super::summary::Summary;
use crate::error::Result;

/// Bytes that the samples of recordings may take up in memory unless told otherwise.
const BUDGET: usize = 128 << 20;

/// How much of recordings may be kept in memory; those that share it share the room. Samples of what is beyond it go to a file in the system's
/// folder for temporary files, as numbers.
///
/// ```
/// use kincal::Machine;
/// use kincal::recording::{Memory, Recording};
///
/// # let machine = Machine::parse("z.ron", r#"Machine(name: "z", units: (length: mm, angle: deg), workpiece: [(frame: "w")],
/// #     tool: [(frame: "z", joint: Prismatic(axis: "z")), (frame: "t")])"#)?;
/// let memory = Memory::of_megabytes(512);
/// let text = "# measurement: joint\nz[mm],z_meas[um]\n0,0\n10,10003\n";
/// let recording = Recording::from_bytes("scale.csv", text.as_bytes(), &machine)?.within(&memory);
/// assert_eq!(recording.scan()?.samples, 2);
/// # Ok::<(), kincal::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Memory(Arc<Budget>);

#[derive(Debug)]
struct Budget {
    bytes: usize,
    taken: AtomicUsize,
}

impl Memory {
    /// So many times 2^20 bytes; with none, all samples go to files.
    pub fn of_megabytes(megabytes: usize) -> Self {
        Memory(Arc::new(Budget { bytes: megabytes.saturating_mul(1 << 20), taken: AtomicUsize::new(0) }))
    }
}

impl Default for Memory {
    /// What all recordings share that have not been told otherwise: 128 MB.
    fn default() -> Self {
        static SHARED: OnceLock<Memory> = OnceLock::new();
        SHARED.get_or_init(|| Memory::of_megabytes(BUDGET >> 20)).clone()
    }
}

/// The summary of a pass, and its samples.
#[derive(Debug)]
pub(super) struct Kept {
    pub summary: Summary,
    pub stored: Stored,
}

/// The samples of a recording, chunk by chunk: the first in memory, as many as there was room for, the others in a file.
#[derive(Debug)]
pub(crate) struct Stored {
    first: Vec<Arc<Chunk>>,
    /// Held as long as they are.
    _room: Room,
    others: Option<Spool>,
}

impl Stored {
    /// How many chunks there are.
    pub fn len(&self) -> usize {
        self.first.len() + self.others.as_ref().map_or(0, Spool::len)
    }

    /// How many samples chunk `i` has.
    pub fn samples(&self, i: usize) -> usize {
        match (self.first.get(i), &self.others) {
            (Some(chunk), _) => chunk.len,
            (None, Some(spool)) => spool.samples(i - self.first.len()),
            (None, None) => 0,
        }
    }

    /// Chunk `i`; empty behind the last one.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn chunk(&self, i: usize) -> Result<Arc<Chunk>> {
        match (self.first.get(i), &self.others) {
            (Some(chunk), _) => Ok(chunk.clone()),
            (None, Some(spool)) => spool.chunk(i - self.first.len()).map(Arc::new),
            (None, None) => Ok(Arc::default()),
        }
    }

    /// These samples of chunk `i` alone, by their index in it.
    ///
    /// # Errors
    /// As [`Stored::chunk`].
    pub fn chosen(&self, i: usize, samples: &[usize]) -> Result<Chunk> {
        match (self.first.get(i), &self.others) {
            (Some(chunk), _) => Ok(chunk.chosen(samples)),
            (None, Some(spool)) => spool.chosen(i - self.first.len(), samples),
            (None, None) => Ok(Chunk::default()),
        }
    }

    /// Whether all of it is in memory.
    pub fn is_in_memory(&self) -> bool {
        self.others.is_none()
    }
}

/// A part of the budget; given back when it is dropped.
#[derive(Debug)]
pub(crate) struct Room(Memory, usize);

impl Room {
    /// Takes so many bytes more; whether they are within the budget.
    fn take(&mut self, bytes: usize) -> bool {
        self.1 += bytes;
        self.0.0.taken.fetch_add(bytes, Ordering::Relaxed) + bytes <= self.0.0.bytes
    }

    fn give_back(&mut self, bytes: usize) {
        self.1 -= bytes;
        self.0.0.taken.fetch_sub(bytes, Ordering::Relaxed);
    }
}

impl Drop for Room {
    fn drop(&mut self) {
        self.0.0.taken.fetch_sub(self.1, Ordering::Relaxed);
    }
}

/// Collects samples chunk by chunk.
pub(super) struct Keeping {
    chunks: Vec<Arc<Chunk>>,
    room: Room,
    shape: Shape,
    /// Where they go since there was no room for more.
    spool: Option<SpoolWriter>,
}

impl Keeping {
    pub fn new(recording: &Recording) -> Self {
        let room = Room(recording.memory.clone(), 0);
        Keeping { chunks: Vec::new(), room, shape: Shape::of(recording), spool: None }
    }

    /// Keeps a chunk.
    pub fn take(&mut self, chunk: Chunk) -> Result<()> {
        if let Some(spool) = &mut self.spool {
            return spool.push(&chunk);
        }
        if self.room.take(chunk.bytes()) {
            self.chunks.push(Arc::new(chunk));
            return Ok(());
        }
        self.room.give_back(chunk.bytes());
        self.spool.insert(SpoolWriter::begin(self.shape.clone())?).push(&chunk)
    }

    /// All that was kept, with the summary of the pass.
    pub fn with(self, summary: Summary) -> Result<Kept> {
        let others = self.spool.map(SpoolWriter::finish).transpose()?;
        Ok(Kept { summary, stored: Stored { first: self.chunks, _room: self.room, others } })
    }
}

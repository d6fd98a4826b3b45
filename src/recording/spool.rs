//! Samples that memory has no room for, in a file of numbers: chunk by chunk, column by column, eight bytes a number. It has no name where
//! the system allows that, so that nothing of it is left however the program ends.

use std::cell::RefCell;
use std::fs::{File, OpenOptions};
use std::io::{Error as IoError, ErrorKind, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use super::Recording;
use super::chunk::Chunk;
use crate::error::{Error, Place, Result};

/// Of a chunk fewer samples than one in so many are read one by one.
const WORTH: usize = 64;

/// Which columns chunks of a recording have.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    commands: usize,
    values: usize,
    time: bool,
    directions: Vec<bool>,
    channels: usize,
}

impl Shape {
    pub fn of(recording: &Recording) -> Self {
        let layout = &recording.layout;
        Shape {
            commands: recording.fixed.len(),
            values: recording.value_count(),
            time: layout.time.is_some(),
            directions: layout.directions.iter().map(Option::is_some).collect(),
            channels: layout.channels.len(),
        }
    }

    /// Numbers of a sample, its line aside.
    fn width(&self) -> usize {
        let directions = self.directions.iter().filter(|there| **there).count();
        self.commands + self.values + usize::from(self.time) + directions + self.channels
    }
}

/// Where a chunk stands.
#[derive(Debug)]
struct At {
    offset: u64,
    len: usize,
    dropped: u64,
    /// Where lines follow each other, only the first is kept, and here.
    first_line: Option<u64>,
}

/// A file of numbers that is read in any order.
#[derive(Debug)]
pub(crate) struct Spool {
    file: Own,
    shape: Shape,
    chunks: Vec<At>,
}

/// The same while it is written.
pub(super) struct SpoolWriter {
    spool: Spool,
    end: u64,
    bytes: Vec<u8>,
}

/// A file that is gone with its owner.
#[derive(Debug)]
struct Own {
    path: PathBuf,
    file: File,
    #[cfg(not(unix))]
    place: std::sync::Mutex<()>,
}

impl SpoolWriter {
    /// Begins a file in the system's folder for temporary files.
    pub fn begin(shape: Shape) -> Result<Self> {
        let file = Own::create()?;
        Ok(SpoolWriter { spool: Spool { file, shape, chunks: Vec::new() }, end: 0, bytes: Vec::new() })
    }

    /// Writes a chunk behind the others.
    pub fn push(&mut self, chunk: &Chunk) -> Result<()> {
        self.bytes.clear();
        let first_line =
            chunk.lines.first().copied().filter(|first| (*first..).zip(&chunk.lines).all(|(a, b)| a == *b));
        if first_line.is_none() {
            self.bytes.extend(chunk.lines.iter().flat_map(|line| line.to_le_bytes()));
        }
        let optional = chunk.time.iter().chain(chunk.directions.iter().flatten());
        for column in [&chunk.commands, &chunk.values].into_iter().chain(optional).chain(&chunk.channels) {
            self.bytes.extend(column.iter().flat_map(|number| number.to_le_bytes()));
        }
        self.spool.file.file.write_all(&self.bytes).map_err(|e| not_written(&self.spool.file.path, e))?;
        self.spool.chunks.push(At { offset: self.end, len: chunk.len, dropped: chunk.dropped, first_line });
        self.end += self.bytes.len() as u64;
        Ok(())
    }

    /// The whole of it.
    pub fn finish(mut self) -> Result<Spool> {
        self.spool.file.file.flush().map_err(|e| not_written(&self.spool.file.path, e))?;
        Ok(self.spool)
    }
}

impl Spool {
    /// How many chunks there are.
    pub fn len(&self) -> usize {
        self.chunks.len()
    }

    /// How many samples chunk `i` has.
    pub fn samples(&self, i: usize) -> usize {
        self.chunks.get(i).map_or(0, |at| at.len)
    }

    /// Chunk `i`, read anew; empty behind the last one.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn chunk(&self, i: usize) -> Result<Chunk> {
        let Some(at) = self.chunks.get(i) else { return Ok(Chunk::default()) };
        // A buffer for each thread: to have a new one of this size emptied takes as long as to read it.
        thread_local!(static BUFFER: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) });
        BUFFER.with_borrow_mut(|buffer| {
            let size = 8 * at.len * (self.shape.width() + usize::from(at.first_line.is_none()));
            buffer.resize(buffer.len().max(size), 0);
            let bytes = &mut buffer[..size];
            self.file.read(at.offset, bytes).map_err(|e| Error::file(&self.file.path, e))?;
            Ok(self.shape.chunk(at, bytes))
        })
    }
}

impl Spool {
    /// These samples of chunk `i` alone, by their index in it. Few of them are read one by one.
    ///
    /// # Errors
    /// As [`Spool::chunk`].
    pub fn chosen(&self, i: usize, samples: &[usize]) -> Result<Chunk> {
        let Some(at) = self.chunks.get(i) else { return Ok(Chunk::default()) };
        if samples.len() > at.len / WORTH {
            return Ok(self.chunk(i)?.chosen(samples));
        }
        let mut bytes = Vec::with_capacity(8 * samples.len() * (self.shape.width() + 1));
        let (mut offset, lines) = (at.offset, usize::from(at.first_line.is_none()));
        for width in (0..lines).map(|_| 1).chain(self.shape.columns()) {
            for k in samples {
                let from = bytes.len();
                bytes.resize(from + 8 * width, 0);
                let place = offset + 8 * (width * k) as u64;
                self.file.read(place, &mut bytes[from..]).map_err(|e| Error::file(&self.file.path, e))?;
            }
            offset += 8 * (width * at.len) as u64;
        }
        let few = At { offset: 0, len: samples.len(), dropped: 0, first_line: at.first_line };
        let mut chunk = self.shape.chunk(&few, &bytes);
        if let Some(first) = at.first_line {
            chunk.lines = samples.iter().map(|k| first + *k as u64).collect();
        }
        Ok(chunk)
    }
}

impl Shape {
    /// Width of each block of numbers of a chunk, in their order.
    fn columns(&self) -> impl Iterator<Item = usize> {
        let directions = self.directions.iter().filter(|there| **there).count();
        let single = usize::from(self.time) + directions + self.channels;
        [self.commands, self.values].into_iter().chain((0..single).map(|_| 1))
    }

    /// The chunk whose numbers these are.
    fn chunk(&self, at: &At, bytes: &[u8]) -> Chunk {
        let mut rest = bytes;
        let mut column = |width: usize| {
            let own;
            (own, rest) = rest.split_at(8 * at.len * width);
            own.as_chunks::<8>().0
        };
        let numbers =
            |own: &[[u8; 8]]| own.iter().map(|number| f64::from_le_bytes(*number)).collect::<Vec<_>>();
        let lines = match at.first_line {
            Some(first) => (first..).take(at.len).collect(),
            None => column(1).iter().map(|line| u64::from_le_bytes(*line)).collect(),
        };
        Chunk {
            len: at.len,
            lines,
            commands: numbers(column(self.commands)),
            values: numbers(column(self.values)),
            time: self.time.then(|| numbers(column(1))),
            directions: self.directions.iter().map(|there| there.then(|| numbers(column(1)))).collect(),
            channels: (0..self.channels).map(|_| numbers(column(1))).collect(),
            dropped: at.dropped,
        }
    }
}

impl Own {
    fn create() -> Result<Self> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("kincal-{}-{number}.spool", std::process::id()));
        let mut options = OpenOptions::new();
        options.read(true).write(true).create_new(true);
        // What was measured is for nobody else.
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let file = options.open(&path).map_err(|e| not_written(&path, e))?;
        // An open file needs no name here.
        #[cfg(unix)]
        std::fs::remove_file(&path).map_err(|e| not_written(&path, e))?;
        Ok(Own {
            path,
            file,
            #[cfg(not(unix))]
            place: std::sync::Mutex::default(),
        })
    }

    #[cfg(unix)]
    fn read(&self, offset: u64, bytes: &mut [u8]) -> std::io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(&self.file, bytes, offset)
    }

    #[cfg(not(unix))]
    fn read(&self, offset: u64, bytes: &mut [u8]) -> std::io::Result<()> {
        use std::io::{Read, Seek, SeekFrom};
        let _alone = self.place.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let mut file = &self.file;
        file.seek(SeekFrom::Start(offset))?;
        file.read_exact(bytes)
    }
}

#[cfg(not(unix))]
impl Drop for Own {
    fn drop(&mut self) {
        // Open files can be removed on some systems only; where not, the system's own tidying is left.
        let _ = std::fs::remove_file(&self.path);
    }
}

fn not_written(path: &std::path::Path, source: IoError) -> Error {
    let what = match source.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "no space is left".into(),
        _ => source.to_string(),
    };
    Error::mistake(
        Place::file(path),
        format!("samples that memory has no room for cannot be written here: {what}"),
        "keep more in memory (`--memory MB`), or let the variable TMPDIR name a folder with space",
    )
}

//! A recording: one CSV file with what was commanded and what was measured.
//!
//! ```text
//! # machine: ac_table_tilting
//! # measurement: distance
//! # nominal_length[mm]: 100
//! t[s],x[mm],y[mm],z[mm],a[deg],c[deg],d[mm]
//! 0.0000,0.0000,-44.0232,41.0652,75.0000,0.0000,-0.0159
//! ```
//!
//! [`Recording::open`] reads header and column names and settles what every column is for; no row is held. A pass
//! ([`Recording::chunks`], [`Recording::rows_with_text`], [`Recording::scan`]) reads the file in pieces that end where lines end, on all
//! cores, in memory that does not grow with the file; whatever the number of cores, the same samples come in the same chunks, and the same
//! fault is told. The first scan keeps the samples for later passes, in memory within [`Memory`] and beyond it in a file of numbers. Units
//! are converted at this border: everything that comes out is m, rad, s, K.
//!
//! A row is a *drop-out*, left out and counted, where a command, the time, a direction or a measured number is empty or NaN.
//! A *pause* is a time between two samples longer than five times the median one; derivatives start again after it.

mod arrays;
mod call;
mod chunk;
mod column;
mod columns;
mod entry;
mod fault;
mod header;
mod join;
mod kept;
mod lines;
mod pieces;
mod reader;
mod rows;
mod scan;
mod spool;
mod step;
mod summary;
mod text;

inner! {
    use column::{Column, Role};
    use chunk::Chunk;
    use reader::{Block, Chunks, Row, Rows};
    use summary::Summary;
}
pub use arrays::Arrays;
pub use call::open_all;
pub use column::Channel;
#[cfg(feature = "cli")]
pub(crate) use columns::Columns;
pub use columns::bytes_of;
pub use fault::RecordingFault;
pub use header::{Header, Measurement, NominalLength, Sigma, ToolPoint};
pub use join::{Joined, join};
pub use kept::Memory;
pub(crate) use step::step_of;

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use crate::columnar::{Form, Input, Text};
use crate::error::{Error, Place, Result};
use crate::foreign::{self, Foreign, START};
use crate::machine::Machine;
use crate::meter::Meter;
use column::Layout;
use header::Draft;
use kept::{Keeping, Kept, Stored};
use lines::{LONGEST, Lines, Stop};
use reader::Reading;
use text::Fail;

/// Most that may stand before the data, bytes.
const LONGEST_PREAMBLE: usize = 4 << 20;

/// A recording whose header and columns fit the machine; its rows stay in the file.
///
/// ```
/// use kincal::recording::{Measurement, Recording};
///
/// let machine = kincal::Machine::parse(
///     "column.ron",
///     r#"Machine(
///         name: "column", units: (length: mm, angle: deg),
///         workpiece: [(frame: "w")],
///         tool: [(frame: "z", joint: Prismatic(axis: "z")), (frame: "t", at: (0, 0, 120))],
///     )"#,
/// )?;
/// let text = "# measurement: joint\nz[mm],z_meas[um]\n0,0\n10,10003\n20,\n";
/// let recording = Recording::from_bytes("scale.csv", text.as_bytes(), &machine)?;
/// assert_eq!(recording.header().measurement, Measurement::Joint { dyad: 1 });
/// for chunk in recording.chunks()? {
///     let chunk = chunk?;
///     assert_eq!(chunk.commands, [0.0, 0.01]);
///     assert_eq!(chunk.values, [0.0, 0.010003]);
///     assert_eq!(chunk.dropped, 1);
/// }
/// # Ok::<(), kincal::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Recording {
    path: PathBuf,
    name: String,
    source: Source,
    machine: Machine,
    header: Header,
    fixed: Vec<Option<f64>>,
    layout: Layout,
    warnings: Vec<String>,
    preamble: String,
    /// Number of the header row and the byte behind it.
    data_from: (u64, u64),
    memory: Memory,
    /// What counts the bytes that passes read, and whether each pass is one of its own there.
    meter: (Meter, bool),
    /// What the first full pass has brought.
    kept: Arc<OnceLock<Kept>>,
}

#[derive(Clone, Debug)]
enum Source {
    File,
    Bytes(Arc<[u8]>),
}

impl Source {
    /// From byte `offset` on; of a table in columns, from this byte of its text on.
    fn read_from(&self, path: &Path, offset: u64) -> Result<Box<dyn Read + Send>> {
        let failed = |e: io::Error| Error::file(path, e);
        match self {
            Source::Bytes(bytes) => {
                if let Some(form) = Form::of(path, &bytes[..bytes.len().min(START)])? {
                    return in_columns(path, form, Input::Bytes(bytes.clone()), offset);
                }
                known(path, foreign::of(path, &bytes[..bytes.len().min(START)]))?;
                let mut cursor = Cursor::new(bytes.clone());
                cursor.set_position(offset);
                Ok(Box::new(cursor))
            }
            Source::File => {
                let mut file = File::open(path).map_err(failed)?;
                let mut start = Vec::with_capacity(START);
                if path.is_dir() {
                    known(path, Some(foreign::of_folder(path)))?;
                }
                file.by_ref().take(START as u64).read_to_end(&mut start).map_err(failed)?;
                if let Some(form) = Form::of_file(path, &start)? {
                    return in_columns(path, form, Input::File(file), offset);
                }
                known(path, foreign::of(path, &start))?;
                if offset > 0 {
                    file.seek(SeekFrom::Start(offset)).map_err(failed)?;
                    return Ok(Box::new(file));
                }
                // What has been looked at comes again, also from a pipe.
                Ok(Box::new(Cursor::new(start).chain(file)))
            }
        }
    }
}

impl Recording {
    /// Opens a file and reads header and column names; rows are not read, so that a fault in them shows only in a pass.
    ///
    /// # Errors
    /// [`Error::File`], or [`Error::Input`] with line and column: a missing joint, a column without unit, another machine.
    pub fn open(path: impl AsRef<Path>, machine: &Machine) -> Result<Recording> {
        Recording::read(path.as_ref().to_path_buf(), Source::File, machine)
    }

    /// The same from memory; `name` takes the place of the path in messages.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn from_bytes(name: &str, bytes: impl Into<Arc<[u8]>>, machine: &Machine) -> Result<Recording> {
        Recording::read(PathBuf::from(name), Source::Bytes(bytes.into()), machine)
    }

    fn read(path: PathBuf, source: Source, machine: &Machine) -> Result<Recording> {
        let mut lines = Lines::new(source.read_from(&path, 0)?, 0, 0);
        let (preamble, draft, layout) = match preamble(&mut lines, machine) {
            Ok(parts) => parts,
            Err(Halt::Stop(stop)) => return Err(stopped(&path, stop, lines.number)),
            Err(Halt::Fail(fail)) => return Err(error(&path, fail)),
        };
        let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let data_from = (lines.number, lines.offset);
        let Draft { header, fixed, warnings, .. } = draft;
        let machine = machine.clone();
        let kept = Arc::default();
        Ok(Recording {
            path,
            name,
            source,
            machine,
            header,
            fixed,
            layout,
            warnings,
            preamble,
            data_from,
            memory: Memory::default(),
            meter: (Meter::default(), false),
            kept,
        })
    }

    /// The same, what is kept of it being within `memory`; what has been kept already stays where it is.
    #[must_use]
    pub fn within(mut self, memory: &Memory) -> Recording {
        self.memory = memory.clone();
        self
    }

    /// The same, with the bytes counted that are read of its rows; `alone`: every pass over it begins one of the meter.
    #[cfg(feature = "import")]
    #[must_use]
    pub(crate) fn counted_by(mut self, meter: &Meter, alone: bool) -> Recording {
        self.meter = (meter.clone(), alone);
        self
    }

    /// How many bytes its rows take up, where the file says that: not of a pipe, nor of a table in columns, whose text has another length.
    pub(crate) fn bytes(&self) -> Option<u64> {
        let all = match &self.source {
            Source::Bytes(bytes)
                if matches!(Form::of(&self.path, &bytes[..bytes.len().min(START)]), Ok(None)) =>
            {
                bytes.len() as u64
            }
            Source::File => {
                // Before it is opened, which a pipe would not bear.
                let known = std::fs::metadata(&self.path).ok().filter(std::fs::Metadata::is_file)?;
                let mut file = File::open(&self.path).ok()?;
                let mut start = Vec::with_capacity(START);
                file.by_ref().take(START as u64).read_to_end(&mut start).ok()?;
                matches!(Form::of_file(&self.path, &start), Ok(None)).then_some(known.len())?
            }
            Source::Bytes(_) => return None,
        };
        Some(all.saturating_sub(self.data_from.1))
    }

    /// What the recording says of itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// File name without folders.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The file as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How many measured numbers a sample has: distance, displacement, joint 1; position 3; pose 6 (position, rotation vector).
    pub fn value_count(&self) -> usize {
        self.header.measurement.value_count()
    }

    /// Whether there is a column `t`.
    pub fn has_time(&self) -> bool {
        self.layout.time.is_some()
    }

    /// Columns that are neither time, joint, direction nor measured, in the order of the file.
    pub fn extra_channels(&self) -> &[Channel] {
        &self.layout.channels
    }

    /// Every column as written, in the order of the file.
    pub fn columns(&self) -> &[Column] {
        &self.layout.columns
    }

    /// Per command the displacement that `# fixed` gives, m or rad; `None` where there is a column.
    pub fn fixed(&self) -> &[Option<f64>] {
        &self.fixed
    }

    /// Comments and header row as written, line ends included, without a byte order mark.
    pub fn preamble(&self) -> &str {
        &self.preamble
    }

    /// What is odd in header and columns, but no fault; [`Recording::scan`] adds what is odd in the rows.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The samples in chunks of at most 4096, as [`Recording::scan`] has kept them, else read anew from the file; after an error nothing
    /// more comes.
    ///
    /// # Errors
    /// [`Error::File`] here; each chunk may bring [`Error::Input`] with line and column.
    pub fn chunks(&self) -> Result<Chunks<'_>> {
        match self.kept.get() {
            Some(kept) => Ok(Chunks::kept(kept)),
            None => Ok(Chunks::of(Reading::start(self, false)?)),
        }
    }

    /// As [`Recording::chunks`], without a copy of what is in memory.
    ///
    /// # Errors
    /// As [`Recording::chunks`].
    pub(crate) fn shared_chunks(&self) -> Result<impl Iterator<Item = Result<Arc<Chunk>>> + '_> {
        let mut chunks = self.chunks()?;
        Ok(std::iter::from_fn(move || chunks.shared()))
    }

    /// The chunks that hold samples of these numbers, from 0, each with the number of its first.
    ///
    /// # Errors
    /// As [`Recording::scan`].
    pub(crate) fn chunks_with<'a>(
        &'a self,
        numbers: &'a BTreeSet<u64>,
    ) -> Result<impl Iterator<Item = Result<(u64, Arc<Chunk>)>> + 'a> {
        self.scan()?;
        let mut first = 0;
        Ok(self
            .stored()
            .into_iter()
            .flat_map(|stored| (0..stored.len()).map(move |i| (stored, i)))
            .filter_map(move |(stored, i)| {
                let from = first;
                first += stored.samples(i) as u64;
                numbers.range(from..first).next()?;
                Some(stored.chunk(i).map(|chunk| (from, chunk)))
            }))
    }

    /// What [`Recording::scan`] has kept, to be had in any order.
    pub(crate) fn stored(&self) -> Option<&Stored> {
        self.kept.get().map(|kept| &kept.stored)
    }

    /// The rows as written together with their samples, in blocks of at most 4096 rows; drop-outs are among the rows.
    ///
    /// # Errors
    /// As [`Recording::chunks`].
    pub fn rows_with_text(&self) -> Result<Rows<'_>> {
        Ok(Rows::of(Reading::start(self, true)?))
    }

    /// Reads all rows once: checks them, counts, takes ranges. Later passes are over what this one keeps, as is a second scan.
    ///
    /// # Errors
    /// A file of numbers that cannot be written, where [`Memory`] has no room; the first fault in a row; [`RecordingFault::NoRows`] or [`RecordingFault::AllDropped`] where no sample is left.
    pub fn scan(&self) -> Result<Summary> {
        if let Some(kept) = self.kept.get() {
            return Ok(kept.summary.clone());
        }
        let mut keeping = Keeping::new(self);
        let summary = scan::scan(self, &mut keeping)?;
        let kept = keeping.with(summary)?;
        Ok(self.kept.get_or_init(|| kept).summary.clone())
    }

    fn error(&self, fail: Fail) -> Error {
        error(&self.path, fail)
    }
}

fn error(path: &Path, Fail { line, column, fault }: Fail) -> Error {
    let line = usize::try_from(line).unwrap_or(usize::MAX);
    Error::input(Place::at(path, line, column), *fault)
}

/// Refuses a file that is known to be no recording.
fn known(path: &Path, foreign: Option<Foreign>) -> Result<()> {
    foreign.map_or(Ok(()), |Foreign { what, mend }| {
        Err(Error::input(Place::file(path), RecordingFault::Foreign { what: what.into(), mend }))
    })
}

fn stopped(path: &Path, stop: Stop, line: u64) -> Error {
    match stop {
        Stop::Io(source) => Error::file(path, source),
        Stop::TooLong => error(path, Fail::at(line, 0, RecordingFault::LineTooLong { limit: LONGEST })),
    }
}

/// Why the preamble ends before its end.
enum Halt {
    Stop(Stop),
    Fail(Fail),
}

impl From<Fail> for Halt {
    fn from(fail: Fail) -> Self {
        Halt::Fail(fail)
    }
}

/// The text of a table in columns, from a byte of it on.
fn in_columns(path: &Path, form: Form, mut input: Input, offset: u64) -> Result<Box<dyn Read + Send>> {
    let failed = |e: io::Error| Error::file(path, e);
    if let Input::File(file) = &mut input {
        file.rewind().map_err(failed)?;
    }
    let mut text = Text::open(path, form, input)?;
    if !text.has_head {
        let what = format!("{} without the head of a recording", form.word());
        return Err(Error::input(Place::file(path), RecordingFault::Foreign { what, mend: None }));
    }
    io::copy(&mut text.by_ref().take(offset), &mut io::sink()).map_err(failed)?;
    Ok(Box::new(text))
}

/// Reads up to and including the header row.
fn preamble(lines: &mut Lines, machine: &Machine) -> std::result::Result<(String, Draft, Layout), Halt> {
    let (mut text, mut draft) = (String::new(), Draft::new(machine));
    while let Some(line) = lines.next().map_err(Halt::Stop)? {
        let fail = |fault| Fail::at(lines.number, 0, fault);
        let utf8 = |range| std::str::from_utf8(lines.bytes(range)).map_err(|_| fail(RecordingFault::NotUtf8));
        let (mut raw, mut content) = (utf8(line.raw)?, utf8(line.content)?);
        if lines.number == 1 {
            raw = raw.strip_prefix('\u{feff}').unwrap_or(raw);
            content = content.strip_prefix('\u{feff}').unwrap_or(content);
        }
        if text.len() + raw.len() > LONGEST_PREAMBLE {
            return Err(fail(RecordingFault::PreambleTooLong { limit: LONGEST_PREAMBLE }).into());
        }
        text.push_str(raw);
        let trimmed = content.trim();
        if trimmed.starts_with('#') {
            draft.take(machine, lines.number, content)?;
        } else if !trimmed.is_empty() {
            let layout = Layout::resolve(machine, &mut draft, lines.number, content.as_bytes())?;
            return Ok((text, draft, layout));
        }
    }
    let empty = text.trim().is_empty();
    Err(Fail::at(0, 0, if empty { RecordingFault::Empty } else { RecordingFault::NoHeaderRow }).into())
}

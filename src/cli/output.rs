//! What reaches people and files: messages, numbers with units, whole files.

use std::io::{IsTerminal, Read, Write};
use std::path::{Path, PathBuf};

use crate::columnar::Form;
use crate::error::{Error, Place};
use crate::machine::{Machine, shipped};
use crate::recording::{Columns, Recording, RecordingFault, open_all};

use super::Common;
use super::failure::not_written;
pub(crate) use super::failure::{Failure, Outcome};
use super::files::{Destination, is_standard};
use super::part::Part;
use super::streams::StandardOutput;
use super::width::for_reading;

/// The message, the line it is about, and the mend; `input` is the file that standard input is in.
pub(crate) fn complain(failure: &Failure, input: &Path) {
    let mut err = std::io::stderr().lock();
    let (what, excerpt, mend) = match failure {
        Failure::Answer(text) => (text.clone(), None, String::new()),
        Failure::Told { what, mend } => (what.clone(), None, mend.clone()),
        Failure::Input(error) => (error.to_string(), error.place().and_then(excerpt), error.mend()),
    };
    let [what, mend] = [what, mend].map(|text| text.replace(&*input.to_string_lossy(), "standard input"));
    // As the messages about the command line itself are.
    let (red, plain) = if is_coloured(&err) { ("\x1b[1;31m", "\x1b[0m") } else { ("", "") };
    let _ = writeln!(err, "{red}error:{plain} {what}");
    if let Some(excerpt) = excerpt {
        let _ = writeln!(err, "{excerpt}");
    }
    if !mend.is_empty() {
        let _ = writeln!(err, "  = {mend}");
    }
}

/// Whether it is a terminal of which nobody has said that it has no colours (<https://no-color.org>).
fn is_coloured(stream: &impl IsTerminal) -> bool {
    let is_plain = std::env::var_os("NO_COLOR").is_some_and(|it| !it.is_empty())
        || std::env::var_os("TERM").is_none_or(|it| it == "dumb");
    cfg!(unix) && stream.is_terminal() && !is_plain
}

/// What a file seems to be, where one was given in the other's place.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Looks {
    Machine,
    Recording,
}

/// By its first bytes: a recording begins with `#`, a machine file with a comment `//`, `Machine` or a bracket.
fn looks_like(path: &Path) -> Option<Looks> {
    let mut start = Vec::new();
    std::fs::File::open(path).ok()?.take(4096).read_to_end(&mut start).ok()?;
    let text = String::from_utf8_lossy(&start);
    let text = text.trim_start_matches('\u{feff}').trim_start();
    if ["//", "/*", "Machine", "("].iter().any(|word| text.starts_with(word)) {
        Some(Looks::Machine)
    } else {
        text.starts_with('#').then_some(Looks::Recording)
    }
}

fn misplaced(path: &Path, is: &str, expected: &str) -> Failure {
    Failure::Told {
        what: format!("{}: this is a {is}, where a {expected} is expected", path.display()),
        mend: "name the machine file first, then the recordings".into(),
    }
}

/// Opens a machine file by `open`; a recording in its place is told as such, and the name of a machine that comes with the program.
pub(crate) fn open_machine<T>(
    path: &Path,
    open: impl FnOnce(&Path) -> crate::error::Result<T>,
) -> Outcome<T> {
    open(path).map_err(|error| match (looks_like(path), path.file_stem().and_then(|stem| stem.to_str())) {
        (Some(Looks::Recording), _) => misplaced(path, "recording", "machine file"),
        (_, Some(name)) if !path.exists() && shipped(name).is_some() => Failure::Told {
            what: format!("{}: nothing is there", path.display()),
            mend: format!("`kincal machines {name} > {name}.ron` writes the machine of that name, which comes with the program"),
        },
        _ => error.into(),
    })
}

/// Opens the recordings of a call; a machine file among them is told as such, and a table of another program gets the command that makes
/// a recording of it.
pub(crate) fn open_recordings(
    paths: &[PathBuf],
    machine: &Machine,
    machine_file: &Path,
) -> Outcome<Vec<Recording>> {
    open_all(paths, machine).map_err(|error| {
        let at_fault = paths.iter().find(|path| looks_like(path) == Some(Looks::Machine));
        if let Some(path) = at_fault {
            return misplaced(path, "machine file", "recording");
        }
        // What is known by its first bytes has one way, or none.
        if let Some(RecordingFault::Foreign { mend, .. }) = error.fault() {
            return match (mend, error.place()) {
                (None, Some(place)) => Failure::Told {
                    what: error.to_string(),
                    mend: converting("it becomes a recording by", &place.file, machine_file),
                },
                _ => error.into(),
            };
        }
        match foreign(&error) {
            Some(table) => Failure::Told {
                what: error.to_string(),
                mend: format!(
                    "{}\n  = {}",
                    error.mend(),
                    converting("a table of another program becomes a recording by", table, machine_file)
                ),
            },
            None => error.into(),
        }
    })
}

/// The file that an error is about, where it is no recording at all: nothing in it says what was measured.
fn foreign(error: &Error) -> Option<&Path> {
    use RecordingFault::{BadColumn, NoHeaderRow, NoMeasurement, NoUnit, NotUtf8, Separator, UnknownUnit};
    let is_of_form = matches!(
        error.fault(),
        Some(
            BadColumn { .. }
                | NoHeaderRow
                | NoMeasurement
                | NoUnit { .. }
                | NotUtf8
                | Separator { .. }
                | UnknownUnit { .. }
        )
    );
    let file = &error.place().filter(|_| is_of_form)?.file;
    let mut start = Vec::new();
    std::fs::File::open(file).ok()?.take(1 << 16).read_to_end(&mut start).ok()?;
    let text = String::from_utf8_lossy(&start);
    let mut keys =
        text.lines().filter_map(|line| line.trim().trim_start_matches('\u{feff}').strip_prefix('#'));
    (!keys.any(|key| key.trim_start().starts_with("meas"))).then_some(file)
}

/// The command that makes a recording of a table, ready to be pasted.
fn converting(how: &str, table: &Path, machine: &Path) -> String {
    // A folder may have no name of its own.
    let output = match table.file_stem() {
        Some(name) => table.with_file_name(format!("{}_rec.csv", name.to_string_lossy())),
        None => table.join("rec.csv"),
    };
    let [table, machine, output] = [table, machine, &output].map(|path| {
        let text = path.display().to_string();
        let plain = |c: char| c.is_alphanumeric() || "/._-+,:\\".contains(c);
        if text.chars().all(plain) { text } else { format!("'{text}'") }
    });
    format!("{how}: kincal convert {table} --machine {machine} -o {output}")
}

/// The line of a text file that a message is about, with a mark below the column (machine files only: a recording's
/// column is a CSV column).
fn excerpt(place: &Place) -> Option<String> {
    let is_ron = place.file.extension().is_some_and(|e| e == "ron");
    if !is_ron || place.line == 0 {
        return None;
    }
    let text = std::fs::read_to_string(&place.file).ok()?;
    let line = text.lines().nth(place.line - 1)?;
    if line.chars().count() > 160 {
        return None;
    }
    let number = place.line.to_string();
    let gap = " ".repeat(number.len());
    let before: String = line
        .chars()
        .take(place.column.saturating_sub(1))
        .map(|c| if c == '\t' { '\t' } else { ' ' })
        .collect();
    Some(format!("{gap} |\n{number} | {line}\n{gap} | {before}^"))
}

/// A writer that keeps the error that it met, so that it is told of the output and not of the input.
struct Watched<W> {
    inner: W,
    failed: Option<std::io::Error>,
}

impl<W: Write> Watched<W> {
    fn watch<T>(&mut self, result: std::io::Result<T>) -> std::io::Result<T> {
        result.inspect_err(|e| {
            self.failed = Some(e.raw_os_error().map_or(e.kind().into(), std::io::Error::from_raw_os_error));
        })
    }
}

impl<W: Write> Write for Watched<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let result = self.inner.write(bytes);
        self.watch(result)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        let result = self.inner.flush();
        self.watch(result)
    }
}

/// Writes through `out`, and tells an error of the output as such, by `failed`.
fn write_into<T>(
    file: impl Write,
    failed: impl Fn(std::io::Error) -> Failure,
    write: impl FnOnce(&mut dyn Write) -> crate::error::Result<T>,
) -> Outcome<T> {
    let inner = std::io::BufWriter::with_capacity(1 << 18, file);
    let mut out = Watched { inner, failed: None };
    let written = write(&mut out);
    if let Some(source) = out.failed.take() {
        return Err(failed(source));
    }
    let told = written?;
    out.flush().map_err(failed)?;
    Ok(told)
}

/// Writes a file whole or not at all: into a neighbour first, then renamed. A link stays a link, and its file is
/// replaced; what is no file (a pipe, `/dev/null`) is written to as it is, since a file in its place would end it.
pub(crate) fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> crate::error::Result<()>,
) -> Outcome {
    write_checked(path, write, |_, ()| Ok(()))
}

/// As [`write_whole`], where the file takes its place only if `check` is content with it: that is given the path at which it can be read
/// until then, and what `write` has told of it. What is no file is not checked.
pub(crate) fn write_checked<T>(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> crate::error::Result<T>,
    check: impl FnOnce(&Path, &T) -> Outcome,
) -> Outcome<T> {
    let failed = |source: std::io::Error| not_written(path, &source);
    if is_standard(path) {
        return write_into(StandardOutput::new(), not_printed, write);
    }
    let known = std::fs::metadata(path).ok();
    if known.as_ref().is_some_and(|it| !it.is_file() && !it.is_dir()) {
        let file = std::fs::OpenOptions::new().write(true).open(path).map_err(failed)?;
        return write_into(file, failed, write);
    }
    let target = match &known {
        Some(_) => path.canonicalize().map_err(failed)?,
        None => path.to_path_buf(),
    };
    let (part, file) = Part::begin(&target).map_err(failed)?;
    if let Some(known) = &known {
        file.set_permissions(known.permissions()).map_err(failed)?;
    }
    let told = write_into(file, failed, write)?;
    check(part.path(), &told)?;
    part.finish(&target).map_err(failed)?;
    Ok(told)
}

/// As [`write_whole`], of a recording: `write` gives it as text, and the name of the file says what it becomes.
pub(crate) fn write_recording<T>(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> crate::error::Result<T>,
) -> Outcome<T> {
    let Some(form) = Form::named(path) else {
        return write_checked(path, write, |_, _| Ok(()));
    };
    // Before anything is reckoned that nothing would write.
    let mut columns = Columns::new(path, form)?;
    let in_columns = |out: &mut dyn Write| {
        let told = write(&mut columns)?;
        let bytes = columns.finish()?;
        // Watched: an error here is told of the output.
        let _ = out.write_all(&bytes);
        Ok(told)
    };
    write_checked(path, in_columns, |_, _| Ok(()))
}

impl Common {
    /// Writes the machine-readable result where it was asked for.
    pub(crate) fn write_json(&self, value: &impl serde::Serialize) -> Outcome {
        let Some(destination) = &self.json else { return Ok(()) };
        let text = serde_json::to_string_pretty(value).map_err(|e| Failure::Answer(e.to_string()))?;
        match destination {
            Destination::StandardOutput => print(&format!("{text}\n")),
            Destination::File(path) => write_whole(path, |out| {
                // Watched: an error here is told of the output.
                let _ = writeln!(out, "{text}");
                Ok(())
            }),
        }
    }

    /// Whether a machine-readable result is wanted.
    pub(crate) fn wants_json(&self) -> bool {
        self.json.is_some()
    }

    /// Prints for people, unless standard output belongs to JSON or nobody wants to read.
    pub(crate) fn say(&self, text: &str) -> Outcome {
        match self.json {
            Some(Destination::StandardOutput) => Ok(()),
            _ if self.quiet => Ok(()),
            _ => print(&for_reading(text)),
        }
    }
}

/// To standard output, all of it. A reader that has seen enough (`| head`) is no fault.
pub(crate) fn print(text: &str) -> Outcome {
    let mut out = std::io::stdout().lock();
    printed(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
}

/// What became of something that was sent to standard output.
pub(super) fn printed(result: std::io::Result<()>) -> Outcome {
    match result {
        Err(source) if source.kind() != std::io::ErrorKind::BrokenPipe => Err(not_printed(source)),
        _ => Ok(()),
    }
}

fn not_printed(source: std::io::Error) -> Failure {
    Failure::Told {
        what: format!("standard output cannot be written: {source}"),
        mend: "send it where there is space; files that options name are written whole or not at all".into(),
    }
}

/// `1 recording`, `2 recordings`.
pub(crate) fn count(n: u64, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// A display unit: its symbol and how many of it make 1 m or 1 rad.
#[derive(Clone, Copy)]
pub(crate) struct Shown {
    pub symbol: &'static str,
    pub per_si: f64,
}

/// What a number of a report measures.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Length,
    Angle,
}

impl Kind {
    /// The unit that suits a number of this size, m or rad.
    pub fn unit(self, size: f64) -> Shown {
        let shown = |symbol, per_si| Shown { symbol, per_si };
        match (self, size.abs()) {
            (Kind::Length, a) if a < 1e-4 => shown("um", 1e6),
            (Kind::Length, a) if a < 1.0 => shown("mm", 1e3),
            (Kind::Length, _) => shown("m", 1.0),
            (Kind::Angle, a) if a < 1e-3 => shown("urad", 1e6),
            (Kind::Angle, a) if a < 0.02 => shown("mrad", 1e3),
            (Kind::Angle, _) => shown("deg", 1f64.to_degrees()),
        }
    }

    /// A number with a unit that suits its size; what is below a millionth of the smallest unit is rounding.
    pub fn show(self, si: f64) -> String {
        let unit = self.unit(si);
        let value = si * unit.per_si;
        if value.abs() < 1e-6 {
            return format!("0 {}", unit.symbol);
        }
        format!("{value:.*} {}", decimals(value, 3), unit.symbol)
    }

    /// A value with its sign, its standard error to two digits, and the unit that both share.
    pub fn show_with_error(self, value: f64, error: f64) -> (String, String, &'static str) {
        let size = if error.is_finite() { value.abs().max(error) } else { value.abs() };
        let unit = self.unit(size);
        let (value, error) = (value * unit.per_si, error * unit.per_si);
        if !error.is_finite() {
            return (format!("{value:+.*}", decimals(value, 3)), "inf".into(), unit.symbol);
        }
        let places = decimals(error, 2);
        (format!("{value:+.places$}"), format!("{error:.places$}"), unit.symbol)
    }
}

/// A length with a unit that suits its size.
pub(crate) fn length(m: f64) -> String {
    Kind::Length.show(m)
}

/// An angle with a unit that suits its size.
pub(crate) fn angle(rad: f64) -> String {
    Kind::Angle.show(rad)
}

/// Decimals that show so many significant digits.
pub(crate) fn decimals(x: f64, digits: i32) -> usize {
    (digits - 1 - x.abs().max(1e-9).log10().floor() as i32).clamp(0, 6) as usize
}

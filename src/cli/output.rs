//! What reaches people and files: messages, numbers with units, whole files.

use std::io::{IsTerminal, Write};
use std::path::Path;
use std::time::Duration;

use indicatif::ProgressBar;
use kincal::{Error, Place};

use super::Common;

/// Why a command ended with status 1.
pub(crate) enum Failure {
    /// The library's error.
    Input(Error),
    /// The command did its work, and the answer is no.
    Answer(String),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Failure::Input(error)
    }
}

/// Result of a command.
pub(crate) type Outcome = Result<(), Failure>;

/// The message, the line it is about, and the mend.
pub(crate) fn complain(failure: &Failure) {
    let mut err = std::io::stderr().lock();
    let error = match failure {
        Failure::Answer(text) => {
            let _ = writeln!(err, "{text}");
            return;
        }
        Failure::Input(error) => error,
    };
    let _ = writeln!(err, "error: {error}");
    if let Some(excerpt) = error.place().and_then(excerpt) {
        let _ = writeln!(err, "{excerpt}");
    }
    let mend = error.mend();
    if !mend.is_empty() {
        let _ = writeln!(err, "  = {mend}");
    }
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

/// Writes a file whole or not at all: into a neighbour first, then renamed.
pub(crate) fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> kincal::Result<()>,
) -> kincal::Result<()> {
    let failed = |source| Error::File { path: path.to_path_buf(), source };
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".part{}", std::process::id()));
    let part = path.with_file_name(name);
    let result = (|| {
        let file = std::fs::File::create(&part).map_err(failed)?;
        let mut out = std::io::BufWriter::with_capacity(1 << 18, file);
        write(&mut out)?;
        out.flush().map_err(failed)?;
        std::fs::rename(&part, path).map_err(failed)
    })();
    if result.is_err() {
        let _ = std::fs::remove_file(&part);
    }
    result
}

impl Common {
    /// Writes the machine-readable result where it was asked for.
    pub(crate) fn write_json(&self, value: &impl serde::Serialize) -> Outcome {
        let Some(target) = &self.json else { return Ok(()) };
        let text = serde_json::to_string_pretty(value).map_err(|e| Failure::Answer(format!("error: {e}")))?;
        if target == "-" {
            print(&format!("{text}\n"));
            return Ok(());
        }
        let path = Path::new(target);
        let failed = |source| Error::File { path: path.to_path_buf(), source };
        write_whole(path, |out| writeln!(out, "{text}").map_err(failed))?;
        Ok(())
    }

    /// Prints for people, unless standard output belongs to JSON or nobody wants to read.
    pub(crate) fn say(&self, text: &str) {
        if !self.quiet && self.json.as_deref() != Some("-") {
            print(text);
        }
    }

    /// A spinner on standard error if that is a terminal.
    pub(crate) fn spinner(&self) -> Option<ProgressBar> {
        if self.quiet || !std::io::stderr().is_terminal() {
            return None;
        }
        let spinner = ProgressBar::new_spinner();
        spinner.enable_steady_tick(Duration::from_millis(120));
        Some(spinner)
    }
}

/// To standard output; a closed pipe is not our trouble.
pub(crate) fn print(text: &str) {
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}

/// A length with a unit that suits its size.
pub(crate) fn length(m: f64) -> String {
    match m.abs() {
        a if a == 0.0 => "0 um".into(),
        a if a < 1e-4 => format!("{} um", three(m * 1e6)),
        a if a < 1.0 => format!("{} mm", three(m * 1e3)),
        _ => format!("{} m", three(m)),
    }
}

/// An angle with a unit that suits its size.
pub(crate) fn angle(rad: f64) -> String {
    match rad.abs() {
        a if a == 0.0 => "0 urad".into(),
        a if a < 1e-3 => format!("{} urad", three(rad * 1e6)),
        a if a < 0.02 => format!("{} mrad", three(rad * 1e3)),
        _ => format!("{} deg", three(rad.to_degrees())),
    }
}

/// Three significant digits without exponent.
fn three(x: f64) -> String {
    let digits = 2 - x.abs().max(1e-9).log10().floor() as i32;
    format!("{x:.*}", digits.clamp(0, 6) as usize)
}

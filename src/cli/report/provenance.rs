//! From what a report was made: files with their fingerprints, instruments, the date, the program.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use maud::{Markup, html};

use super::table::{Cell, table, word};
use crate::compensate::Fingerprint;
use crate::recording::Recording;
use crate::units::Quantity;

/// A file that the call has read.
pub(crate) struct Source {
    what: String,
    name: String,
    fingerprint: String,
}

impl Source {
    /// Of a file; what cannot be read twice (a pipe) has no fingerprint.
    pub fn of(what: &str, path: &Path) -> Source {
        let name =
            path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned());
        let is_file = std::fs::metadata(path).is_ok_and(|it| it.is_file());
        let fingerprint = is_file.then(|| fingerprint(path).ok()).flatten().unwrap_or_else(|| "-".into());
        Source { what: what.into(), name, fingerprint }
    }

    /// Of a text that is in no file.
    pub fn of_text(what: &str, name: &str, text: &str) -> Source {
        Source { what: what.into(), name: name.into(), fingerprint: Fingerprint::of(text).to_string() }
    }
}

fn fingerprint(path: &Path) -> std::io::Result<String> {
    let mut file = std::fs::File::open(path)?;
    let (mut own, mut buffer) = (Fingerprint::default(), vec![0; 1 << 16]);
    loop {
        match std::io::Read::read(&mut file, &mut buffer)? {
            0 => return Ok(own.to_string()),
            n => own.take(&buffer[..n]),
        }
    }
}

/// The section.
pub(super) fn provenance(sources: &[Source], recordings: &[Recording], command: &str) -> Markup {
    let rows = sources.iter().map(|source| {
        let recording = recordings.iter().find(|recording| recording.name() == source.name);
        let of = recording.map_or_else(String::new, instrument);
        vec![word(&source.what), word(&source.name), word(of), word(&source.fingerprint)]
    });
    let rows: Vec<Vec<Cell>> = rows.collect();
    html! {
        h2 { "Files" }
        (table(&["file", "name", "instrument", "FNV-1a of 64 bits"], rows))
        p.note {
            "kincal " (env!("CARGO_PKG_VERSION")) ", " code { (command) } ", " (today()) " (UTC). The fingerprint tells files apart that were mixed up; it \
             does not guard against forgery."
        }
    }
}

/// What a recording says of its instrument.
fn instrument(recording: &Recording) -> String {
    let header = recording.header();
    let named = header.instrument.as_ref();
    let mut text = named.map_or_else(String::new, |name| format!("{name}: ")) + header.measurement.word();
    if let crate::recording::NominalLength::Known(length) = header.nominal_length {
        text += &format!(", {} mm", 1e3 * length);
    }
    if let Some(sigma) = &header.sigma {
        text += &match sigma.quantity {
            Quantity::Angle => format!(", stated sigma {:.3} arcsec", sigma.value.to_degrees() * 3600.0),
            _ => format!(", stated sigma {:.3} um", 1e6 * sigma.value),
        };
    }
    if !header.setup.is_empty() {
        text += &format!(", set-up {}", header.setup);
    }
    text
}

/// The date; `SOURCE_DATE_EPOCH` stands in for the clock where the same input is to give the same bytes.
fn today() -> String {
    let stated = std::env::var("SOURCE_DATE_EPOCH").ok().and_then(|text| text.parse::<u64>().ok());
    let now = || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    date(stated.unwrap_or_else(now) / 86_400)
}

/// Gregorian date of a day counted from 1970-01-01: eras of 400 years that begin in March.
fn date(days: u64) -> String {
    let shifted = days + 719_468;
    let (era, day) = (shifted / 146_097, shifted % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let (day, month) = (day - (153 * month + 2) / 5 + 1, if month < 10 { month + 3 } else { month - 9 });
    let year = year + 400 * era + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}")
}

#[cfg(test)]
mod tests {
    use super::date;

    #[test]
    fn days_are_those_of_the_calendar() {
        for (days, expected) in [
            (0, "1970-01-01"),
            (59, "1970-03-01"),
            (11_016, "2000-02-29"),
            (19_782, "2024-02-29"),
            (20_454, "2026-01-01"),
        ] {
            assert_eq!(date(days), expected);
        }
    }
}

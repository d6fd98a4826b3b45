//! Dynamic captures of laser interferometers by Renishaw: `.rtx`.
//!
//! Lines `Key: value`, then `Data:` and `Sample no` numbers of eight bytes, little-endian. Their unit stands nowhere, and the axis was not
//! recorded: the unit is asked, and `--path` says what ran.

use std::path::Path;

use super::table::{Table, Told};
use super::text::decoded;
use crate::error::{Error, Place, Result};
use crate::wording::shown;

const DATA: &[u8] = b"Data:";
/// Rates and intervals that agree to this part say the same.
const AGREE: f64 = 0.01;

/// Whether a file is one of these.
pub(super) fn is_one(file: &Path, bytes: &[u8]) -> bool {
    let ending = file.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let start = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]).into_owned();
    ending.eq_ignore_ascii_case("rtx") || (start.starts_with("HEADER::") && start.contains("CARTO-Dynamic"))
}

/// Time, where the file says how fast it was read, and the readings.
pub(super) fn read(file: &Path, bytes: &[u8], told: &Told) -> Result<Table> {
    let fault = |line: usize, what: String, mend: &str| Error::mistake(Place::at(file, line, 0), what, mend);
    const WHOLE: &str = "copy the file again, or export the capture as a table";
    let (begins, ends) =
        data(bytes).ok_or_else(|| fault(0, "no line `Data:` with readings behind it".into(), WHOLE))?;
    let head = decoded(&bytes[..begins]);
    let value = |key: &str| {
        (1..).zip(head.lines()).find_map(|(line, content)| {
            let (own, value) = content.split_once(':')?;
            own.trim().eq_ignore_ascii_case(key).then(|| (line, value.trim().to_string()))
        })
    };
    let Some((line, text)) = value("Sample no") else {
        return Err(fault(0, "no line `Sample no:` says how many readings there are".into(), WHOLE));
    };
    let count = text.parse::<usize>().ok().filter(|n| *n > 0);
    let count =
        count.ok_or_else(|| fault(line, format!("`{}` is no number of readings", shown(&text)), WHOLE))?;
    let there = bytes[ends..].len() / 8;
    if there < count {
        return Err(fault(line, format!("{count} readings are announced, the file holds {there}"), WHOLE));
    }
    let behind = &bytes[ends + 8 * count..];
    if !behind.is_empty() && !behind.trim_ascii_start().starts_with(b"EOF::") {
        let what = format!("behind {count} readings stands something else than `EOF::`");
        return Err(fault(line, what, WHOLE));
    }
    let readings =
        bytes[ends..].as_chunks::<8>().0.iter().take(count).map(|eight| f64::from_le_bytes(*eight));
    let readings: Vec<f64> = readings.collect();
    if let Some(k) = readings.iter().position(|x| !x.is_finite()) {
        return Err(fault(line, format!("reading {} of {count} is no finite number", k + 1), WHOLE));
    }
    let first = |key: &str| {
        let (_, text) = value(key)?;
        let number = text.split_whitespace().next()?.parse::<f64>().ok().filter(|x| *x > 0.0)?;
        Some((number, text))
    };
    let interval = first("Trigger interval").map(|(dt, _)| dt);
    let rate =
        ["Actual sample rate", "Sample rate"].into_iter().filter_map(first).find_map(|(rate, text)| {
            let agrees = |hertz: f64| interval.is_some_and(|dt| (hertz * dt - 1.0).abs() < AGREE);
            let kilo = text.to_lowercase().contains("khz");
            let named = kilo || text.to_lowercase().contains("hz");
            // A bare number may count Hz or kHz: the interval decides, or nobody.
            match named {
                true => Some(if kilo { 1e3 * rate } else { rate }),
                false => [rate, 1e3 * rate].into_iter().find(|hertz| agrees(*hertz)),
            }
        });
    match rate {
        Some(rate) => {
            let timed: Vec<f64> =
                readings.iter().enumerate().flat_map(|(k, x)| [k as f64 / rate, *x]).collect();
            Table::of_numbers(file, vec!["t [s]".into(), "reading".into()], 2, &timed, told)
        }
        None => Table::of_numbers(file, vec!["reading".into()], 1, &readings, told),
    }
}

/// Where the line `Data:` begins, and where the readings behind it do.
fn data(bytes: &[u8]) -> Option<(usize, usize)> {
    let begins =
        (0..bytes.len()).find(|i| bytes[*i..].starts_with(DATA) && (*i == 0 || bytes[*i - 1] == b'\n'))?;
    let line = bytes[begins..].iter().position(|b| *b == b'\n')?;
    Some((begins, begins + line + 1))
}

//! Two recordings of the same moments, beside each other: what a second arm, controller or instrument noted belongs to the first one's rows.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::RecordingFault as Fault;
use super::column::{Cell, cells, unit};
use super::text::{self, Fail};
use super::{Source, error};
use crate::error::{Error, Result};
use crate::machine::is_usable_name;
use crate::units::Unit;

/// Columns are the same if they differ by no more than this part of their range.
const SAME: f64 = 1e-6;

/// A recording with another one's columns beside its own.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Joined {
    /// The new recording, line for line as the first one was.
    #[serde(skip)]
    pub text: String,
    /// How many rows it has.
    pub rows: u64,
    /// Columns that both have, with the same numbers: they show that the rows belong together.
    pub shared: Vec<String>,
    /// Columns that were added, under their new names.
    pub added: Vec<String>,
}

/// Puts the columns of `other` behind those of `own`, row by row, as `NAME.column`; columns of one name that hold the same numbers in both
/// are there once. Both are taken as they are written, whatever machine they are of.
///
/// # Errors
/// [`Error::File`], or [`Error::Input`] with line and column: rows that are not as many, no column that changes and is the same in both,
/// what is no number.
pub fn join(own: &Path, other: &Path, name: &str) -> Result<Joined> {
    if !is_usable_name(name) {
        let fault = Fault::JoinName { name: text::shown(name.as_bytes()) };
        return Err(error(other, Fail::at(0, 0, fault)));
    }
    beside((own, &whole(own)?), (other, &whole(other)?), name)
}

/// The same of texts that have been read; paths are for messages.
pub(super) fn beside(
    (own, own_text): (&Path, &str),
    (other, other_text): (&Path, &str),
    name: &str,
) -> Result<Joined> {
    let first = Table::read(own_text).map_err(|fail| error(own, fail))?;
    let second = Table::read(other_text).map_err(|fail| error(other, fail))?;
    if first.rows.len() != second.rows.len() {
        let (rows, other_rows) = (second.rows.len() as u64, first.rows.len() as u64);
        let fault = Fault::JoinRows { rows, other: own.display().to_string(), other_rows };
        return Err(error(other, Fail::at(0, 0, fault)));
    }
    let twin = |k: usize| {
        let i = first.cells.iter().position(|cell| cell.name == second.cells[k].name)?;
        same(&first, i, &second, k).then_some(i)
    };
    let shared: Vec<usize> = (0..second.cells.len()).filter(|k| twin(*k).is_some()).collect();
    if !shared.iter().any(|k| second.range(*k) > 0.0) {
        let fault = Fault::NothingShared { other: own.display().to_string() };
        return Err(error(other, Fail::at(second.header, 0, fault)));
    }
    let kept: Vec<usize> = (0..second.cells.len()).filter(|k| !shared.contains(k)).collect();
    let called = |k: &usize| format!("{name}.{}", second.cells[*k].name);
    let added: Vec<String> = kept.iter().map(called).collect();
    if let Some(i) = first.cells.iter().position(|cell| added.contains(&cell.name)) {
        let fault = Fault::DuplicateColumn { name: first.cells[i].name.clone(), first: i + 1 };
        return Err(error(own, Fail::at(first.header, i + 1, fault)));
    }
    let titles: Vec<String> =
        kept.iter().map(|k| format!("{}[{}]", called(k), second.units[*k].symbol)).collect();
    let mut out = String::with_capacity(own_text.len() + other_text.len());
    let mut rows = second.rows.iter();
    for (number, line) in (1..).zip(own_text.split_inclusive('\n')) {
        let content = line.trim_end_matches(['\n', '\r']);
        let fields: Vec<&str> = match number {
            _ if number == first.header => titles.iter().map(String::as_str).collect(),
            _ if number > first.header && is_row(content) => {
                rows.next().map_or_else(Vec::new, |row| kept.iter().map(|k| row.fields[*k]).collect())
            }
            _ => Vec::new(),
        };
        out.push_str(content);
        fields.iter().for_each(|field| out.extend([",", field]));
        out.push_str(&line[content.len()..]);
    }
    let shared = shared.iter().map(|k| second.cells[*k].name.clone()).collect();
    Ok(Joined { text: out, rows: first.rows.len() as u64, shared, added })
}

/// All of a file.
pub(super) fn whole(path: &Path) -> Result<String> {
    let mut bytes = Vec::new();
    let mut source = Source::File.read_from(path, 0)?;
    source.read_to_end(&mut bytes).map_err(|e| Error::file(path, e))?;
    String::from_utf8(bytes).map_err(|_| error(path, Fail::at(0, 0, Fault::NotUtf8)))
}

fn is_row(line: &str) -> bool {
    let line = line.trim();
    !line.is_empty() && !line.starts_with('#')
}

/// A recording as a table, whatever its columns are for.
struct Table<'a> {
    /// Number of the header row.
    header: u64,
    cells: Vec<Cell>,
    units: Vec<Unit>,
    rows: Vec<Row<'a>>,
}

struct Row<'a> {
    fields: Vec<&'a str>,
    /// SI; NaN where the cell is empty.
    numbers: Vec<f64>,
}

impl<'a> Table<'a> {
    fn read(text: &'a str) -> std::result::Result<Table<'a>, Fail> {
        let lines = (1..).zip(text.strip_prefix('\u{feff}').unwrap_or(text).lines());
        let mut lines = lines.filter(|(_, line)| is_row(line));
        let (header, names) = lines.next().ok_or_else(|| Fail::at(0, 0, Fault::NoHeaderRow))?;
        let cells = cells(header, names.as_bytes())?;
        let units = (cells.iter().enumerate())
            .map(|(i, cell)| unit(cell, None).map_err(|fault| Fail::at(header, i + 1, fault)))
            .collect::<std::result::Result<Vec<Unit>, Fail>>()?;
        let row = |(number, line): (u64, &'a str)| {
            let mut fields = Vec::with_capacity(cells.len());
            text::split(line.as_bytes(), |field| fields.push(field));
            if fields.len() != cells.len() {
                return Err(Fail::at(
                    number,
                    0,
                    Fault::Ragged { expected: cells.len(), found: fields.len() },
                ));
            }
            let number_of = |(i, field): (usize, &&[u8])| {
                let what = format!("column `{}`", cells[i].name);
                let bad = || Fault::NotANumber { what, text: text::shown(field) };
                let number = text::number(field).ok_or_else(|| Fail::at(number, i + 1, bad()))?;
                Ok(units[i].to_si(number))
            };
            let numbers =
                fields.iter().enumerate().map(number_of).collect::<std::result::Result<_, Fail>>()?;
            // Cut from a text, and so text again.
            let fields = fields.into_iter().map(|f| std::str::from_utf8(f).unwrap_or("").trim()).collect();
            Ok(Row { fields, numbers })
        };
        let rows = lines.map(row).collect::<std::result::Result<Vec<_>, Fail>>()?;
        if rows.is_empty() {
            return Err(Fail::at(0, 0, Fault::NoRows));
        }
        Ok(Table { header, cells, units, rows })
    }

    /// Largest minus smallest number of a column.
    fn range(&self, k: usize) -> f64 {
        let numbers = || self.rows.iter().map(|row| row.numbers[k]);
        let (low, high) =
            (numbers().fold(f64::INFINITY, f64::min), numbers().fold(f64::NEG_INFINITY, f64::max));
        if high > low { high - low } else { 0.0 }
    }
}

/// Whether two columns hold the same numbers.
fn same(a: &Table, i: usize, b: &Table, k: usize) -> bool {
    let slack = SAME * a.range(i).max(b.range(k));
    let equal = |x: f64, y: f64| (x - y).abs() <= slack || x.is_nan() && y.is_nan();
    let alike = a.units[i].quantity == b.units[k].quantity;
    alike && a.rows.iter().zip(&b.rows).all(|(a, b)| equal(a.numbers[i], b.numbers[k]))
}

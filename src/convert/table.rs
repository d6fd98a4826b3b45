//! A foreign table: headings and rows of text, whatever file they come from.

use std::path::{Path, PathBuf};

use csv::StringRecord;

use super::cell;
use super::form::{self, Form, Separator, is_comment};
use super::heading::Heading;
use super::text::decoded;
use crate::error::{Error, Place, Result};
use crate::meter::Meter;
use crate::wording::{count, shown};

/// A row with the number of its line.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub line: usize,
    pub fields: StringRecord,
}

/// A table as it was found.
#[derive(Clone, Debug)]
pub(super) struct Table {
    pub file: PathBuf,
    /// One for each column; without words where the file has none.
    pub headings: Vec<Heading>,
    /// Line of the headings, 0 where there are none.
    pub line: usize,
    pub rows: Vec<Row>,
    /// How it is written, if it is a text.
    pub separator: Option<Separator>,
    pub decimal_comma: bool,
}

/// What is known of a table beforehand.
#[derive(Clone, Debug, Default)]
pub(super) struct Told {
    pub separator: Option<Separator>,
    pub decimal_comma: Option<bool>,
    /// Names of all columns, in the place of headings.
    pub names: Vec<String>,
}

impl Table {
    /// A table of text; `meter` counts it.
    pub fn read(file: &Path, bytes: &[u8], told: &Told, meter: &Meter) -> Result<Table> {
        let text = decoded(bytes);
        let lines: Vec<&str> = text.lines().collect();
        let fail =
            |line: usize, what: String, mend: &str| Err(Error::mistake(Place::at(file, line, 0), what, mend));
        if text.trim().is_empty() {
            return fail(0, "file is empty".into(), "give a table: one row of names, then rows of numbers");
        }
        let Some(form) = form::find(&lines, told.separator, told.decimal_comma) else {
            let mend =
                "give a table with one sample a line; `--separator` and `--decimal` say how it is written";
            return fail(0, "no rows of numbers are found".into(), mend);
        };
        let mut names = form.headings.map_or_else(Vec::new, |i| form.names(lines[i]));
        let line = form.headings.map_or(0, |i| i + 1);
        if names.len() + 1 == form.columns && line > 0 {
            names.push(String::new());
        }
        let mut headings: Vec<Heading> = names.iter().map(|name| Heading::read(name)).collect();
        if let Some(units) = form.units {
            let mut units = form.names(lines[units]);
            // The key of a line `Unit;mm;mm` is no unit of the first column.
            if let Some(key) = units.first_mut().filter(|u| u.to_lowercase().starts_with("unit")) {
                key.clear();
            }
            headings =
                headings.into_iter().zip(units).map(|(heading, unit)| heading.with_unit(&unit)).collect();
        }
        let rows = rows(file, &lines, &form, meter)?;
        let table = Table {
            file: file.to_path_buf(),
            headings,
            line,
            rows,
            separator: Some(form.separator),
            decimal_comma: form.decimal_comma,
        };
        table.named(&told.names, form.columns)
    }

    /// Numbers that have no text: rows of `columns` values.
    pub fn of_numbers(
        file: &Path,
        names: Vec<String>,
        columns: usize,
        values: &[f64],
        told: &Told,
    ) -> Result<Table> {
        let rows = values.chunks(columns.max(1)).zip(1..).map(|(row, line)| Row {
            line,
            fields: row.iter().map(|x| if x.is_nan() { String::new() } else { format!("{x:?}") }).collect(),
        });
        let table = Table {
            file: file.to_path_buf(),
            headings: names.iter().map(|name| Heading::read(name)).collect(),
            line: 0,
            rows: rows.collect(),
            separator: None,
            decimal_comma: false,
        };
        table.named(&told.names, columns)
    }

    /// With names that were told; a table must have some.
    pub fn named(mut self, names: &[String], columns: usize) -> Result<Table> {
        let place = Place::at(&self.file, self.line, 0);
        if !names.is_empty() {
            if names.len() != columns {
                let what = format!("{} names are given for {columns} columns", names.len());
                return Err(Error::mistake(
                    place,
                    what,
                    "name every column by `--names`, from left to right",
                ));
            }
            self.headings = names.iter().map(|name| Heading::read(name)).collect();
        }
        if self.headings.is_empty() {
            let columns = count(columns as u64, "column", "columns");
            let what = format!("these are the first numbers, and no row above names their {columns}");
            let mend = "name them from left to right, with their units: `--names 't [s],q1 [deg],...'`";
            let line = self.rows.first().filter(|_| self.separator.is_some()).map_or(0, |row| row.line);
            return Err(Error::mistake(Place::at(&self.file, line, 0), what, mend));
        }
        Ok(self)
    }

    /// The column that a text means: its heading, its heading without the unit, or `#3`, counted from 1.
    pub fn column(&self, text: &str) -> Found {
        let text = text.trim();
        if let Some(number) = text.strip_prefix('#').and_then(|n| n.parse::<usize>().ok()) {
            return if (1..=self.headings.len()).contains(&number) {
                Found::One(number - 1)
            } else {
                Found::None
            };
        }
        let by = |same: &dyn Fn(&Heading) -> bool| {
            let found: Vec<usize> = (0..self.headings.len()).filter(|i| same(&self.headings[*i])).collect();
            match found[..] {
                [] => Found::None,
                [one] => Found::One(one),
                _ => Found::Several(found),
            }
        };
        [
            by(&|h| h.raw == text),
            by(&|h| h.name == text),
            by(&|h| h.raw.eq_ignore_ascii_case(text) || h.name.eq_ignore_ascii_case(text)),
        ]
        .into_iter()
        .find(|found| *found != Found::None)
        .unwrap_or(Found::None)
    }

    /// How a map names a column: by its heading, where that is its alone.
    pub fn reference(&self, column: usize) -> String {
        let raw = &self.headings[column].raw;
        let alone = self.column(raw) == Found::One(column);
        if alone && !raw.is_empty() { raw.clone() } else { format!("#{}", column + 1) }
    }

    /// The number in a field; `None` for a drop-out.
    pub fn number(&self, row: &Row, column: usize) -> Result<Option<f64>> {
        Ok(self.plain(row, column)?.and_then(|text| text.parse().ok()))
    }

    /// The same with its digits as they are, and a decimal point.
    pub fn plain(&self, row: &Row, column: usize) -> Result<Option<String>> {
        let field = row.fields.get(column).unwrap_or_default();
        if cell::is_drop_out(field) {
            return Ok(None);
        }
        let plain = cell::plain(field, self.decimal_comma);
        plain.map(Some).ok_or_else(|| self.no_number(row, column, field))
    }

    fn no_number(&self, row: &Row, column: usize, field: &str) -> Error {
        let other = !self.decimal_comma;
        let mend = if cell::plain(field, other).is_some() {
            let word = if other { "comma" } else { "point" };
            format!("say `--decimal {word}` if all numbers of the table are written so")
        } else if field.contains('.') && field.contains(',') {
            "write numbers with one decimal sign, and nothing between thousands".into()
        } else {
            "write a number; a reading that is missing is an empty field, `-` or NaN".into()
        };
        self.fault(
            row,
            column,
            format!("`{}` in column `{}` is no number", shown(field), self.called(column)),
            mend,
        )
    }

    /// A fault in a field.
    pub fn fault(&self, row: &Row, column: usize, what: impl Into<String>, mend: impl Into<String>) -> Error {
        Error::mistake(Place::at(&self.file, row.line, column + 1), what, mend)
    }

    /// A column's heading for messages.
    pub fn called(&self, column: usize) -> String {
        let raw = shown(&self.headings[column].raw);
        if raw.is_empty() { format!("#{}", column + 1) } else { raw }
    }

    /// Smallest and largest number of a column, as far as they are numbers.
    pub fn range(&self, column: usize) -> Option<(f64, f64)> {
        let numbers =
            self.rows.iter().filter_map(|row| cell::number(row.fields.get(column)?, self.decimal_comma));
        numbers.fold(None, |range: Option<(f64, f64)>, x| {
            Some(range.map_or((x, x), |(low, high)| (low.min(x), high.max(x))))
        })
    }
}

/// What a name means in a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Found {
    None,
    One(usize),
    Several(Vec<usize>),
}

fn rows(file: &Path, lines: &[&str], form: &Form, meter: &Meter) -> Result<Vec<Row>> {
    let mut rows = Vec::with_capacity(lines.len() - form.first_row);
    let mut take = |line: usize, mut fields: StringRecord| -> Result<()> {
        if fields.iter().all(|field| field.trim().is_empty()) || fields.get(0).is_some_and(is_comment) {
            return Ok(());
        }
        if fields.len() > form.columns && fields.iter().skip(form.columns).all(str::is_empty) {
            fields.truncate(form.columns);
        }
        if fields.len() != form.columns {
            let own = count(fields.len() as u64, "field", "fields");
            let what = format!("row has {own}, the first row has {}", form.columns);
            let mend = "give every row as many fields; a field without a reading stays empty";
            return Err(Error::mistake(Place::at(file, line, 0), what, mend));
        }
        rows.push(Row { line, fields });
        Ok(())
    };
    match form.separator {
        Separator::Blanks => {
            for (i, line) in lines.iter().enumerate().skip(form.first_row) {
                take(i + 1, form.separator.fields(line).into_iter().collect())?;
            }
        }
        Separator::Byte(byte) => {
            let text = lines[form.first_row..].join("\n");
            meter.begin(Some(text.len() as u64));
            let mut reader = csv::ReaderBuilder::new()
                .delimiter(byte)
                .has_headers(false)
                .flexible(true)
                .trim(csv::Trim::All)
                .from_reader(meter.counting(text.as_bytes()));
            for record in reader.records() {
                let record = record.map_err(|e| {
                    Error::mistake(Place::file(file), e.to_string(), "save the table as text in UTF-8")
                })?;
                let line = record.position().map_or(0, |at| at.line() as usize) + form.first_row;
                take(line, record)?;
            }
        }
    }
    Ok(rows)
}

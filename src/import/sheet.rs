//! A small table of text with a row of headings: what separates its columns, what its comments say, where each field stands.

use std::path::{Path, PathBuf};

use crate::convert::{Heading, Separator, Stated, plain};
use crate::error::{Error, Place, Result};
use crate::units::{Quantity, Unit};
use crate::wording::shown;

/// A row of fields with the number of its line.
pub(super) struct Row {
    pub line: usize,
    fields: Vec<String>,
}

pub(super) struct Sheet {
    file: PathBuf,
    separator: Separator,
    pub headings: Vec<Heading>,
    /// Line of the headings.
    pub line: usize,
    pub rows: Vec<Row>,
    /// Comments without their mark, with the number of their line.
    pub comments: Vec<(usize, String)>,
}

impl Sheet {
    pub fn read(file: &Path, text: &str) -> Result<Sheet> {
        let mut comments = Vec::new();
        let mut content: Vec<(usize, &str)> = Vec::new();
        for (line, text) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            let bare = text.trim();
            match bare.strip_prefix(['#', '%']) {
                Some(comment) => comments.push((line, comment.trim().to_string())),
                None if bare.is_empty() => {}
                None => content.push((line, text)),
            }
        }
        let Some((line, headings)) = content.first().copied() else {
            let mend = "give a table: a row of headings, then a row for each joint";
            return Err(Error::mistake(Place::file(file), "the table has no rows", mend));
        };
        // Headings have units and names; what they are cut by cuts everything below.
        let parts = |s: &Separator| s.fields(headings).len();
        let bytes = [b'\t', b';', b','].map(Separator::Byte).into_iter().rev();
        let separator = bytes.max_by_key(parts).filter(|s| parts(s) > 1).unwrap_or(Separator::Blanks);
        let headings: Vec<Heading> = separator.fields(headings).iter().map(|h| Heading::read(h)).collect();
        let mut rows = Vec::new();
        for (line, text) in content.into_iter().skip(1) {
            let mut fields = separator.fields(text);
            while fields.len() > headings.len() && fields.last().is_some_and(String::is_empty) {
                fields.pop();
            }
            if fields.iter().all(String::is_empty) {
                continue;
            }
            if fields.len() != headings.len() {
                let what = format!("row has {} fields, there are {} headings", fields.len(), headings.len());
                let mend = match separator {
                    Separator::Byte(b',') => {
                        "give every row as many fields as there are headings, and write decimals with a point; between semicolons they may have a comma"
                    }
                    _ => "give every row as many fields as there are headings; a field may be empty",
                };
                return Err(Error::mistake(Place::at(file, line, 0), what, mend));
            }
            rows.push(Row { line, fields });
        }
        Ok(Sheet { file: file.to_path_buf(), separator, headings, line, rows, comments })
    }

    /// The columns whose name, in small letters and without its unit, is one of these.
    pub fn columns(&self, names: &[&str]) -> Vec<usize> {
        let named = |h: &Heading| names.contains(&h.name.to_lowercase().as_str());
        (0..self.headings.len()).filter(|i| named(&self.headings[*i])).collect()
    }

    /// The only such column.
    pub fn column(&self, names: &[&str]) -> Result<Option<usize>> {
        match self.columns(names)[..] {
            [] => Ok(None),
            [one] => Ok(Some(one)),
            [one, other, ..] => {
                let (one, other) = (&self.headings[one].raw, &self.headings[other].raw);
                let what = format!("columns `{}` and `{}` say the same", shown(one), shown(other));
                Err(self.fault_of_headings(what, "leave one of them out"))
            }
        }
    }

    /// The unit of a column; it must be one of this quantity.
    pub fn unit(&self, column: usize, quantity: Quantity) -> Result<Unit> {
        let heading = &self.headings[column];
        let symbols = Unit::symbols_of(quantity);
        let name = shown(&heading.name);
        let mend = format!("write it into the heading, such as `{name}[{}]`", first(&symbols));
        match &heading.unit {
            Stated::Unit(spelled) if spelled.is_native() && spelled.quantity() == quantity => {
                Ok(spelled.unit)
            }
            Stated::Nothing => {
                Err(self.fault_of_headings(format!("column `{name}` names no unit of {quantity}"), mend))
            }
            _ => {
                let what = format!("column `{}` is in no unit of {quantity}", shown(&heading.raw));
                Err(self.fault_of_headings(what, format!("write one of: {symbols}")))
            }
        }
    }

    /// Text of a field.
    pub fn text<'a>(&self, row: &'a Row, column: usize) -> &'a str {
        row.fields.get(column).map_or("", |field| field.trim())
    }

    /// A text as a number of this table, with its decimal sign.
    pub fn number_in(&self, text: &str) -> Option<f64> {
        let comma = self.separator != Separator::Byte(b',');
        plain(text, comma)?.parse().ok().filter(|x: &f64| x.is_finite())
    }

    pub fn no_number(&self, row: &Row, column: usize) -> Error {
        let what =
            format!("`{}` in column `{}` is no number", shown(self.text(row, column)), self.called(column));
        self.fault(row, column, what, "write a number with a decimal point")
    }

    pub fn called(&self, column: usize) -> String {
        shown(&self.headings[column].raw)
    }

    pub fn fault(&self, row: &Row, column: usize, what: impl Into<String>, mend: impl Into<String>) -> Error {
        Error::mistake(Place::at(&self.file, row.line, column + 1), what, mend)
    }

    pub fn fault_of_headings(&self, what: impl Into<String>, mend: impl Into<String>) -> Error {
        Error::mistake(Place::at(&self.file, self.line, 0), what, mend)
    }

    pub fn fault_at(&self, line: usize, what: impl Into<String>, mend: impl Into<String>) -> Error {
        Error::mistake(Place::at(&self.file, line, 0), what, mend)
    }
}

fn first(symbols: &str) -> &str {
    symbols.split(' ').next().unwrap_or_default()
}

//! A map: which column of a foreign table is what.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use serde::Deserialize;

use super::form::Separator;
use crate::document::Document;
use crate::error::{Error, Place, Result};

/// What columns of a foreign table mean, as a RON file says it; `docs/convert.md`.
#[non_exhaustive]
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Map {
    /// The machine's name for the head of the recording.
    #[serde(default)]
    pub machine: Option<String>,
    /// What was measured: the word behind `# measurement:`.
    pub measurement: String,
    /// Further lines of the head, `key: value`; `{marker}` stands for the marker's name.
    #[serde(default)]
    pub head: Vec<String>,
    /// What separates columns: `comma`, `semicolon`, `tab`, `blanks`; found where nothing is said.
    #[serde(default)]
    pub separator: Option<String>,
    /// `point` or `comma`; found where nothing is said.
    #[serde(default)]
    pub decimal: Option<String>,
    /// Names of all columns, in the place of headings.
    #[serde(default)]
    pub names: Vec<String>,
    /// Columns and the text that a row must have there to be taken.
    #[serde(default)]
    pub rows: BTreeMap<String, String>,
    /// Convention of `euler1 euler2 euler3`, such as `zyx-intrinsic`.
    #[serde(default)]
    pub euler: Option<String>,
    /// Time stamp at which `t` is 0, in the form of the table.
    #[serde(default)]
    pub time_zero: Option<String>,
    /// The columns that are taken.
    pub columns: Vec<MappedColumn>,
}

/// One column of the recording and where it comes from: number × `times` + `plus`, in `unit`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "Part", deny_unknown_fields)]
pub struct MappedColumn {
    /// Name in the recording, or `euler1`, `matrix23` (row 2, column 3).
    pub to: String,
    /// Heading in the table, or `#3` for the third column.
    pub from: String,
    /// Unit after `times` and `plus`; the heading's where nothing is said.
    #[serde(default)]
    pub unit: Option<String>,
    /// Sense and scale.
    #[serde(default = "one")]
    pub times: f64,
    /// Offset, in `unit`.
    #[serde(default)]
    pub plus: f64,
    /// The marker that it belongs to; each has a recording of its own.
    #[serde(default)]
    pub marker: Option<String>,
}

fn one() -> f64 {
    1.0
}

impl MappedColumn {
    pub(super) fn new(to: impl Into<String>, from: impl Into<String>) -> MappedColumn {
        MappedColumn { to: to.into(), from: from.into(), unit: None, times: 1.0, plus: 0.0, marker: None }
    }
}

/// A map and the file that it stands in, if it stands in one.
pub(super) struct Known {
    pub map: Map,
    document: Option<Document>,
    /// The table, for messages of a map that stands in no file.
    table: std::path::PathBuf,
}

const GUIDE: &str =
    "docs/convert.md shows the form of a map; `kincal convert ... --write-map MAP.ron` writes one";

impl Known {
    pub fn open(path: &Path) -> Result<Known> {
        let document = Document::open(path)?.guided(GUIDE);
        let map = document.read()?;
        Ok(Known { map, document: Some(document), table: path.to_path_buf() })
    }

    pub fn guessed(map: Map, table: &Path) -> Known {
        Known { map, document: None, table: table.to_path_buf() }
    }

    /// A fault of the map at a path such as `columns[2].unit`.
    pub fn fault(&self, path: &str, what: impl Into<String>, mend: impl Into<String>) -> Error {
        let place = self.document.as_ref().map_or_else(|| Place::file(&self.table), |d| d.place_of(path));
        Error::mistake(place, what, mend)
    }

    /// What separates columns, and whether decimals have a comma, as far as it is said.
    pub fn form(&self) -> Result<(Option<Separator>, Option<bool>)> {
        Ok((
            self.map
                .separator
                .as_deref()
                .map(|word| separator(word).map_err(|w| self.refused("separator", w)))
                .transpose()?,
            self.map
                .decimal
                .as_deref()
                .map(|word| decimal(word).map_err(|w| self.refused("decimal", w)))
                .transpose()?,
        ))
    }

    fn refused(&self, path: &str, (what, mend): (String, String)) -> Error {
        self.fault(path, what, mend)
    }
}

/// A word for a separator; else what is wrong, and the mend.
pub(super) fn separator(word: &str) -> std::result::Result<Separator, (String, String)> {
    Separator::named(word).ok_or_else(|| {
        (format!("separator `{word}` is not known"), "write comma, semicolon, tab or blanks".into())
    })
}

/// A word for the decimal sign; `true` for a comma.
pub(super) fn decimal(word: &str) -> std::result::Result<bool, (String, String)> {
    match word {
        "comma" | "," => Ok(true),
        "point" | "." => Ok(false),
        _ => Err((format!("decimal sign `{word}` is not known"), "write point or comma".into())),
    }
}

impl Map {
    /// The map as a file, with what was guessed as comments.
    pub(super) fn ron(&self, told: &[String]) -> String {
        let mut text = String::from("// Which column of a table is what, for `kincal convert --map`.\n");
        for line in told {
            let _ = writeln!(text, "// {}", line.replace(char::is_control, " "));
        }
        text.push_str("(\n");
        let mut field = |name: &str, value: Option<String>| {
            if let Some(value) = value {
                let _ = writeln!(text, "    {name}: {value},");
            }
        };
        let list = |all: &[String]| {
            (!all.is_empty()).then(|| format!("[{}]", all.iter().map(quoted).collect::<Vec<_>>().join(", ")))
        };
        field("machine", self.machine.as_ref().map(quoted));
        field("measurement", Some(quoted(&self.measurement)));
        field("head", list(&self.head));
        field("separator", self.separator.as_ref().map(quoted));
        field("decimal", self.decimal.as_ref().map(quoted));
        field("names", list(&self.names));
        let rows: Vec<String> = self
            .rows
            .iter()
            .map(|(column, value)| format!("{}: {}", quoted(column), quoted(value)))
            .collect();
        field("rows", (!rows.is_empty()).then(|| format!("{{{}}}", rows.join(", "))));
        field("euler", self.euler.as_ref().map(quoted));
        field("time_zero", self.time_zero.as_ref().map(quoted));
        text.push_str("    columns: [\n");
        for part in &self.columns {
            let _ = write!(text, "        (to: {}, from: {}", quoted(&part.to), quoted(&part.from));
            if let Some(unit) = &part.unit {
                let _ = write!(text, ", unit: {}", quoted(unit));
            }
            if part.times != 1.0 {
                let _ = write!(text, ", times: {:?}", part.times);
            }
            if part.plus != 0.0 {
                let _ = write!(text, ", plus: {:?}", part.plus);
            }
            if let Some(marker) = &part.marker {
                let _ = write!(text, ", marker: {}", quoted(marker));
            }
            text.push_str("),\n");
        }
        text.push_str("    ],\n)\n");
        text
    }
}

/// A text in the quotes of RON.
fn quoted(text: impl AsRef<str>) -> String {
    let mut out = String::from('"');
    for c in text.as_ref().chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => {
                let _ = write!(out, "\\u{{{:x}}}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

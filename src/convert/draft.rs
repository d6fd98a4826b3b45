//! A map in the making: what was guessed, what was told, and what is still open.

use super::Request;
use super::heading::{Heading, Stated};
use super::map::{Map, MappedColumn};
use super::plan::is_clock;
use super::table::{Found, Table};
use super::target::quantity;
use super::unit::{Spelled, spelled};
use crate::error::{Error, Place, Result};
use crate::machine::Machine;
use crate::units::{Quantity, Unit};

/// Something that a table does not say.
pub(super) struct Open {
    pub what: String,
    /// The flag that tells it.
    pub tell: String,
}

pub(super) struct Draft<'a> {
    pub table: &'a Table,
    pub machine: &'a Machine,
    pub request: &'a Request,
    pub map: Map,
    pub told: Vec<String>,
    pub open: Vec<Open>,
    /// Columns whose unit nothing says, with what they have to measure.
    without_unit: Vec<(Option<Quantity>, usize)>,
}

impl<'a> Draft<'a> {
    pub fn new(table: &'a Table, machine: &'a Machine, request: &'a Request) -> Self {
        let map = Map { machine: Some(machine.name().to_string()), ..Map::default() };
        Draft { table, machine, request, map, told: Vec::new(), open: Vec::new(), without_unit: Vec::new() }
    }

    pub fn ask(&mut self, what: impl Into<String>, tell: impl Into<String>) {
        self.open.push(Open { what: what.into(), tell: tell.into() });
    }

    /// Whether a column of the recording has been found.
    pub fn has(&self, to: &str) -> bool {
        self.map.columns.iter().any(|part| part.to == to)
    }

    /// Whether a column of the table has a part.
    pub fn is_used(&self, column: usize) -> bool {
        self.map.columns.iter().any(|part| self.table.column(&part.from) == Found::One(column))
    }

    /// Takes a column of the table as a column of the recording.
    pub fn take(&mut self, to: &str, column: usize, marker: Option<&str>) {
        let mut part = MappedColumn::new(to, self.table.reference(column));
        part.marker = marker.map(str::to_string);
        part.unit = self.unit(to, column);
        self.map.columns.push(part);
    }

    /// Columns of the table without a part whose unit may be of this quantity.
    pub fn free(&self, quantity: Option<Quantity>) -> Vec<usize> {
        let fits = |i: &usize| quantity.is_none_or(|q| fits(&self.table.headings[*i], q));
        (0..self.table.headings.len()).filter(|i| !self.is_used(*i)).filter(fits).collect()
    }

    /// Headings for a message.
    pub fn named(&self, columns: &[usize]) -> String {
        let some: Vec<String> =
            columns.iter().take(12).map(|i| format!("`{}`", self.table.called(*i))).collect();
        let more = if columns.len() > 12 { ", ..." } else { "" };
        if some.is_empty() { "none".into() } else { format!("{}{more}", some.join(", ")) }
    }

    /// Unit of a column for a part: what was told of it, what its heading says, what was told of all of its kind; asked where nothing says it.
    fn unit(&mut self, to: &str, column: usize) -> Option<String> {
        let heading = &self.table.headings[column];
        let expected = quantity(to, Some(self.machine));
        if expected == Some(Quantity::One) {
            return None;
        }
        if expected == Some(Quantity::Time) && is_clock(self.table, column) {
            return Some("s".into());
        }
        let told =
            |key: &str| self.request.units.iter().find(|(k, _)| k == key).map(|(_, unit)| unit.clone());
        let of_column = |key: &str| matches!(self.table.column(key), Found::One(c) if c == column);
        let own = self.request.units.iter().find(|(key, _)| of_column(key)).map(|(_, unit)| unit.clone());
        let general = || expected.and_then(|q| told(word(q)?));
        let stated = match &heading.unit {
            Stated::Unit(unit) => Some(symbol(*unit, heading)),
            Stated::Other(text) => Some(text.clone()),
            Stated::Nothing => None,
        };
        let Some(text) = own.or(stated).or_else(general) else {
            self.without_unit.push((expected, column));
            return None;
        };
        let found = spelled(&text).map(Spelled::quantity);
        if found.is_none() || expected.is_some_and(|q| found != Some(q)) {
            let called = self.table.called(column);
            let is = found.map_or("is none that recordings have".into(), |q| format!("is a unit of {q}"));
            let what = format!("unit of column `{called}`, taken as `{to}`: `{text}` {is}");
            let units = units(expected);
            let own = self.table.reference(column);
            self.ask(
                what,
                format!("--unit '{own}={units}' if it is, or in a map what one of it is, as `times`"),
            );
            return None;
        }
        Some(text)
    }

    /// Asks for the units that nothing says, those of one kind together. What the numbers look like is told, but decides nothing.
    fn ask_units(&mut self) {
        let all = std::mem::take(&mut self.without_unit);
        let mut kinds: Vec<Option<Quantity>> = all.iter().map(|(kind, _)| *kind).collect();
        kinds.sort_unstable();
        kinds.dedup();
        for kind in kinds {
            let columns: Vec<usize> =
                all.iter().filter(|(k, _)| *k == kind).map(|(_, column)| *column).collect();
            let one = if columns.len() == 1 { "unit of column" } else { "unit of columns" };
            let what = format!("{one} {}{}", self.named(&columns), self.hint(&columns, kind));
            let units = units(kind);
            let own = self.table.reference(columns[0]);
            let tell = match kind.and_then(word) {
                Some(word) => format!("--unit {word}={units} for all, or --unit '{own}={units}' for one"),
                None => format!("--unit '{own}={units}'"),
            };
            self.ask(what, tell);
        }
    }

    /// Asks about units that were told of columns that are not there.
    fn ask_columns(&mut self) {
        let words: Vec<&str> =
            [Quantity::Length, Quantity::Angle, Quantity::Time].into_iter().filter_map(word).collect();
        for (key, unit) in &self.request.units {
            if !words.contains(&key.as_str()) && self.table.column(key) == Found::None {
                let all: Vec<usize> = (0..self.table.headings.len()).collect();
                let tell = format!("--unit with {}, or one of: {}", words.join(", "), self.named(&all));
                self.ask(format!("unit `{unit}` of `{key}`: no column is called so"), tell);
            }
        }
    }

    fn hint(&self, columns: &[usize], expected: Option<Quantity>) -> String {
        let ranges = columns.iter().filter_map(|column| self.table.range(*column));
        let Some((low, high)) = ranges.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))) else {
            return String::new();
        };
        let most = low.abs().max(high.abs());
        let like = match expected {
            Some(Quantity::Angle) if most > 6.5 => ": degrees?",
            Some(Quantity::Angle) if most > 0.1 => ": rad?",
            Some(Quantity::Length) if most > 20.0 => ": mm?",
            Some(Quantity::Time) if most > 1e17 => ": ns since 1970?",
            Some(Quantity::Time) if most > 1e14 => ": us since 1970?",
            Some(Quantity::Time) if most > 1e11 => ": ms since 1970?",
            Some(Quantity::Time) if most > 9e8 => ": s since 1970?",
            _ => "",
        };
        format!(" (numbers from {low} to {high}{like})")
    }

    /// The map, or all that is open in one message.
    pub fn closed(mut self) -> Result<(Map, Vec<String>)> {
        self.ask_units();
        self.ask_columns();
        if self.open.is_empty() {
            return Ok((self.map, self.told));
        }
        let things = if self.open.len() == 1 {
            "one thing has".into()
        } else {
            format!("{} things have", self.open.len())
        };
        let lines: Vec<String> =
            self.open.iter().map(|open| format!("\n  - {}\n    tell: {}", open.what, open.tell)).collect();
        let what = format!("{things} to be told before this table is a recording{}", lines.concat());
        let mend = "say it by these flags, or in a map (`--map MAP.ron`, docs/convert.md)";
        Err(Error::mistake(Place::at(&self.table.file, self.table.line, 0), what, mend))
    }
}

/// Whether a heading may belong to something of this quantity.
pub(super) fn fits(heading: &Heading, quantity: Quantity) -> bool {
    match &heading.unit {
        Stated::Nothing => true,
        Stated::Unit(unit) => unit.quantity() == quantity,
        Stated::Other(_) => false,
    }
}

/// The unit as the heading spells it, where that is plain enough for a map; else the unit itself.
fn symbol(unit: Spelled, heading: &Heading) -> String {
    if unit.is_native() {
        return unit.unit.symbol.to_string();
    }
    let last = heading.raw.rsplit(|c: char| !c.is_alphanumeric() && c != '\u{b5}').find(|w| !w.is_empty());
    last.filter(|word| spelled(word) == Some(unit)).unwrap_or(unit.unit.symbol).to_string()
}

/// Units that fit, for a flag.
fn units(quantity: Option<Quantity>) -> String {
    match quantity {
        Some(Quantity::Time) => "s|ms|us|ns".into(),
        Some(quantity) => Unit::symbols_of(quantity).replace(' ', "|"),
        None => "UNIT".into(),
    }
}

/// How `--unit` calls a quantity.
fn word(quantity: Quantity) -> Option<&'static str> {
    match quantity {
        Quantity::Length => Some("length"),
        Quantity::Angle => Some("angle"),
        Quantity::Time => Some("time"),
        _ => None,
    }
}

//! Recordings of a table, as text.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::cell;
use super::map::Known;
use super::moment::{self, Moment};
use super::plan::{Column, Kind, Plan, Rotation, Source};
use super::rotation;
use super::table::{Row, Table};
use crate::error::{Error, Place, Result};
use crate::machine::Machine;
use crate::meter::Meter;
use crate::recording::Recording;
use crate::wording::shown;

/// One recording of a table.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Written {
    /// The marker that was measured, where a row of the table has several.
    pub marker: Option<String>,
    /// The recording.
    pub text: String,
    /// Its rows.
    pub rows: u64,
    /// Rows with a field that is missing.
    pub with_gaps: u64,
}

/// The recording of each marker. With a machine they are read back, and what is wrong with them is told of the table. `meter` counts both.
pub(super) fn all(
    known: &Known,
    table: &Table,
    machine: Option<&Machine>,
    told: &mut Vec<String>,
    meter: &Meter,
) -> Result<Vec<Written>> {
    let plan = Plan::new(known, table, machine)?;
    let taken: Vec<&Row> = table
        .rows
        .iter()
        .filter(|row| plan.rows.iter().all(|(column, text)| row.fields.get(*column) == Some(text.as_str())))
        .collect();
    if taken.is_empty() {
        let what = "no row of the table has what `rows` asks for";
        return Err(known.fault(
            "rows",
            what,
            "compare with the table; texts must be the same letter for letter",
        ));
    }
    let zero = zero(known, table, &plan, &taken, told)?;
    let one = |marker: &Option<String>| -> Result<Written> {
        let columns: Vec<&Column> =
            plan.columns.iter().filter(|c| c.marker.is_none() || c.marker == *marker).collect();
        let of = |wanted: &Option<String>| plan.rotations.iter().find(|(m, _)| m == wanted).map(|(_, r)| r);
        let turn = of(marker).or_else(|| of(&None));
        let sheet = Sheet { known, table, columns, turn, zero };
        let head = sheet.head(marker.as_deref());
        let mut written = Written { marker: marker.clone(), text: head, rows: 0, with_gaps: 0 };
        meter.begin(Some(taken.iter().map(|row| row.fields.as_slice().len() as u64).sum()));
        for row in &taken {
            let gaps = sheet.row(row, &mut written.text)?;
            meter.count(row.fields.as_slice().len());
            written.rows += 1;
            written.with_gaps += u64::from(gaps);
        }
        if let Some(machine) = machine {
            sheet.check(&written.text, machine, &taken, meter)?;
        }
        Ok(written)
    };
    plan.markers.iter().map(one).collect()
}

/// What is taken away from time stamps, and from what column it is.
fn zero(
    known: &Known,
    table: &Table,
    plan: &Plan,
    rows: &[&Row],
    told: &mut Vec<String>,
) -> Result<Option<Moment>> {
    let Some(time) = plan.columns.iter().find(|c| matches!(c.kind, Kind::Time)) else { return Ok(None) };
    if let Some(text) = &known.map.time_zero {
        return stamp(text, table.decimal_comma).map(Some).ok_or_else(|| {
            let what = format!("`{}` is no time stamp", shown(text));
            known.fault(
                "time_zero",
                what,
                "write it as in the table, such as 1709644368.6 or 2024-03-05T13:12:48Z",
            )
        });
    }
    let first = rows.iter().find_map(|row| {
        let field = row.fields.get(time.source.column)?;
        (!cell::is_drop_out(field)).then_some(field)
    });
    let Some(first) = first.filter(|field| moment::read(field).is_some()) else { return Ok(None) };
    told.push(format!("t is 0 at {first}; for files of one clock say `time_zero` of the first in all maps"));
    Ok(moment::read(first))
}

/// A time stamp: a number, or a date with a time of day in s.
pub(super) fn stamp(field: &str, comma: bool) -> Option<Moment> {
    cell::plain(field, comma).and_then(|plain| Moment::decimal(&plain)).or_else(|| moment::read(field))
}

struct Sheet<'a> {
    known: &'a Known,
    table: &'a Table,
    columns: Vec<&'a Column>,
    turn: Option<&'a Rotation>,
    zero: Option<Moment>,
}

impl Sheet<'_> {
    /// All lines above the rows.
    fn head(&self, marker: Option<&str>) -> String {
        let map = &self.known.map;
        let mut text = String::new();
        if let Some(machine) = &map.machine {
            let _ = writeln!(text, "# machine: {machine}");
        }
        let _ = writeln!(text, "# measurement: {}", map.measurement);
        for line in &map.head {
            let line = line.trim_start_matches(['#', ' ']).replace(['\n', '\r'], " ");
            let _ = writeln!(text, "# {}", line.replace("{marker}", marker.unwrap_or("")));
        }
        let names = self.columns.iter().map(|c| format!("{}[{}]", c.name, c.source.unit.unit));
        let turn = self.turn.iter().flat_map(|_| ["qw[1]", "qx[1]", "qy[1]", "qz[1]"]).map(String::from);
        let names: Vec<String> = names.chain(turn).collect();
        let _ = writeln!(text, "{}", names.join(","));
        text
    }

    /// Appends a row; whether a field is missing in it.
    fn row(&self, row: &Row, text: &mut String) -> Result<bool> {
        let mut gaps = false;
        for (k, column) in self.columns.iter().enumerate() {
            if k > 0 {
                text.push(',');
            }
            match self.field(row, column)? {
                Some(field) => text.push_str(&field),
                None => gaps = true,
            }
        }
        if let Some(turn) = self.turn {
            match self.quaternion(row, turn)? {
                Some(q) => q.iter().for_each(|x| {
                    let _ = write!(text, ",{x:?}");
                }),
                None => {
                    text.push_str(",,,,");
                    gaps = true;
                }
            }
        }
        text.push('\n');
        Ok(gaps)
    }

    fn field(&self, row: &Row, column: &Column) -> Result<Option<String>> {
        let (at, source) = (column.source.column, &column.source);
        let field = row.fields.get(at).unwrap_or_default();
        match column.kind {
            Kind::Direction => {
                // A dash is a sense here, and no drop-out.
                let sense = cell::direction(field).map(|sense| f64::from(sense) * source.times.signum());
                match sense {
                    Some(sense) => Ok(Some(format!("{:.0}", sense + 0.0))),
                    None if cell::is_drop_out(field) => Ok(None),
                    None => Err(self.table.fault(
                        row,
                        at,
                        format!("`{}` in column `{}` is no direction", shown(field), self.table.called(at)),
                        "write + - 0, 1 -1 0, or forward, backward",
                    )),
                }
            }
            Kind::Time
                if !cell::is_drop_out(field) && (self.zero.is_some() || moment::read(field).is_some()) =>
            {
                let Some(moment) = stamp(field, self.table.decimal_comma) else {
                    let what =
                        format!("`{}` in column `{}` is no time stamp", shown(field), self.table.called(at));
                    return Err(self.table.fault(row, at, what, "write it as the rows above have it"));
                };
                let number = self.zero.map_or(moment.value(), |zero| moment.since(zero));
                Ok(Some(format!("{:?}", source.value(number))))
            }
            _ if source.is_copied() => self.table.plain(row, at),
            _ => Ok(self.table.number(row, at)?.map(|number| format!("{:?}", source.value(number)))),
        }
    }

    /// Numbers of the sources in SI; `None` where one is missing.
    fn numbers<const N: usize>(&self, row: &Row, sources: &[Source; N]) -> Result<Option<[f64; N]>> {
        let mut out = [0.0; N];
        for (slot, source) in out.iter_mut().zip(sources) {
            match self.table.number(row, source.column)? {
                Some(number) => *slot = source.si(number),
                None => return Ok(None),
            }
        }
        Ok(Some(out))
    }

    fn quaternion(&self, row: &Row, turn: &Rotation) -> Result<Option<[f64; 4]>> {
        let fault = |what: String, mend: &str| self.table.fault(row, turn.first(), what, mend);
        match turn {
            Rotation::Quaternion(sources) => {
                let Some(q) = self.numbers(row, sources)? else { return Ok(None) };
                rotation::unit(q).map(Some).ok_or_else(|| {
                    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
                    let mend = "check which columns hold the quaternion, and in which order";
                    fault(format!("quaternion has length {length:.6}, expected 1"), mend)
                })
            }
            Rotation::Euler(euler, sources) => Ok(self.numbers(row, sources)?.map(|e| euler.quaternion(e))),
            Rotation::Matrix(rows) => {
                let [a, b, c] = &**rows;
                let (a, b, c) = (self.numbers(row, a)?, self.numbers(row, b)?, self.numbers(row, c)?);
                let (Some(a), Some(b), Some(c)) = (a, b, c) else { return Ok(None) };
                let mend =
                    "check which columns hold the matrix, and whether rows or columns of it come first";
                rotation::of_matrix([a, b, c]).map(Some).map_err(|what| fault(what, mend))
            }
        }
    }

    /// Reads a recording back; a fault in it is told of the row of the table that it comes from.
    fn check(&self, text: &str, machine: &Machine, rows: &[&Row], meter: &Meter) -> Result<()> {
        let file = &self.table.file;
        let read = Recording::from_bytes(&file.to_string_lossy(), text.as_bytes(), machine);
        let scanned = read.and_then(|recording| {
            meter.begin(recording.bytes());
            recording.counted_by(meter, false).scan()
        });
        let Err(error) = scanned else { return Ok(()) };
        let Error::Input { place, fault } = error else { return Err(error) };
        let head = text.lines().take_while(|line| line.starts_with('#')).count() + 1;
        let row = place.line.checked_sub(head + 1).and_then(|k| rows.get(k));
        if let Some(row) = row {
            let column = place.column.checked_sub(1).map(|k| {
                self.columns.get(k).map_or_else(|| self.turn.map_or(0, Rotation::first), |c| c.source.column)
            });
            let place = Place::at(file, row.line, column.map_or(0, |c| c + 1));
            return Err(Error::Input { place, fault });
        }
        let line = text.lines().nth(place.line.saturating_sub(1)).filter(|_| (1..head).contains(&place.line));
        let line = line.map_or(String::new(), |line| format!(" (line `{}`)", shown(line)));
        let what = format!("what was found makes no recording{line}: {fault}");
        Err(self.known.fault("", what, fault.mend()))
    }
}

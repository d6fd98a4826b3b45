//! A map laid over a table: for each column of the recording the field it comes from and its unit.

use std::collections::BTreeMap;

use super::map::{Known, MappedColumn};
use super::rotation::{CONVENTIONS, Euler};
use super::table::{Found, Table};
use super::target::{Target, quantity};
use super::unit::{PURE, SECONDS, Spelled, spelled};
use crate::error::Result;
use crate::machine::Machine;
use crate::units::{Quantity, Unit};
use crate::wording::shown;

/// One field of every row, and what becomes of its number.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub column: usize,
    pub unit: Spelled,
    pub times: f64,
    pub plus: f64,
}

impl Source {
    /// Whether digits stay as they are.
    pub fn is_copied(&self) -> bool {
        self.unit.is_native() && self.times == 1.0 && self.plus == 0.0
    }

    /// A number of the table in the unit of the recording.
    pub fn value(&self, number: f64) -> f64 {
        (number * self.times + self.plus) * self.unit.times / self.unit.over
    }

    /// The same in m, rad or a pure number.
    pub fn si(&self, number: f64) -> f64 {
        self.unit.unit.to_si(self.value(number))
    }
}

/// What a column of the recording is written as.
#[derive(Clone, Debug)]
pub(super) enum Kind {
    Time,
    Direction,
    Number,
}

/// A column of the recording.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub name: String,
    pub kind: Kind,
    pub source: Source,
    pub marker: Option<String>,
}

/// The rotation of a pose; it becomes a quaternion.
#[derive(Clone, Debug)]
pub(super) enum Rotation {
    Quaternion([Source; 4]),
    Euler(Euler, [Source; 3]),
    Matrix(Box<[[Source; 3]; 3]>),
}

impl Rotation {
    /// The column that messages are about.
    pub fn first(&self) -> usize {
        match self {
            Rotation::Quaternion(q) => q[0].column,
            Rotation::Euler(_, angles) => angles[0].column,
            Rotation::Matrix(m) => m[0][0].column,
        }
    }
}

/// All that is needed to write the recordings of a table.
pub(super) struct Plan {
    pub columns: Vec<Column>,
    /// By marker.
    pub rotations: Vec<(Option<String>, Rotation)>,
    /// Markers in their order; one without a name where there are none.
    pub markers: Vec<Option<String>>,
    /// Columns and what a row must have there.
    pub rows: Vec<(usize, String)>,
}

impl Plan {
    pub fn new(known: &Known, table: &Table, machine: Option<&Machine>) -> Result<Plan> {
        let map = &known.map;
        let mut plan =
            Plan { columns: Vec::new(), rotations: Vec::new(), markers: Vec::new(), rows: Vec::new() };
        let mut pieces: BTreeMap<Option<String>, BTreeMap<Piece, Source>> = BTreeMap::new();
        for (k, part) in map.columns.iter().enumerate() {
            let at = format!("columns[{k}]");
            check_name(known, &at, part)?;
            if map.columns[..k].iter().any(|p| p.to == part.to && p.marker == part.marker) {
                let what = format!("two columns become `{}`", part.to);
                return Err(known.fault(&at, what, "keep one of them, or give each its `marker`"));
            }
            let source = source(known, &at, part, table, machine)?;
            if part.marker.is_some() && !plan.markers.contains(&part.marker) {
                plan.markers.push(part.marker.clone());
            }
            let (name, marker) = (part.to.clone(), part.marker.clone());
            let piece = match Target::of(&part.to, machine) {
                Target::Quaternion(i) => Piece::Quaternion(i),
                Target::Euler(i) => Piece::Euler(i),
                Target::Matrix(i, j) if i < 3 && j < 3 => Piece::Matrix(i, j),
                Target::Matrix(3, _) => continue,
                Target::Matrix(i, _) => {
                    let name = ["px", "py", "pz"][i].to_string();
                    plan.columns.push(Column { name, kind: Kind::Number, source, marker });
                    continue;
                }
                target => {
                    let kind = match target {
                        Target::Time => Kind::Time,
                        Target::Direction => Kind::Direction,
                        _ => Kind::Number,
                    };
                    plan.columns.push(Column { name, kind, source, marker });
                    continue;
                }
            };
            pieces.entry(marker).or_default().insert(piece, source);
        }
        for (marker, pieces) in pieces {
            plan.rotations.push((marker, rotation(known, &pieces)?));
        }
        if plan.columns.is_empty() {
            return Err(known.fault(
                "columns",
                "map takes no columns",
                "name at least a joint and what was measured",
            ));
        }
        if plan.markers.is_empty() {
            plan.markers.push(None);
        }
        for (column, text) in &map.rows {
            let at = format!("rows.{column}");
            plan.rows.push((find(known, &at, column, table)?, text.trim().to_string()));
        }
        // Time first, as people look for it.
        plan.columns.sort_by_key(|column| !matches!(column.kind, Kind::Time));
        Ok(plan)
    }
}

/// A number of a rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Piece {
    Quaternion(usize),
    Euler(usize),
    Matrix(usize, usize),
}

fn check_name(known: &Known, at: &str, part: &MappedColumn) -> Result<()> {
    let bad = |c: char| c.is_control() || ",[]\"#".contains(c);
    let name = part.to.trim();
    if name.is_empty() || name != part.to || name.contains(bad) {
        let what = format!("`{}` can be no column of a recording", shown(&part.to));
        let mend =
            "write a joint's name, `t`, `px`, ... (docs/recordings.md) without brackets, commas and quotes";
        return Err(known.fault(&format!("{at}.to"), what, mend));
    }
    for (field, value) in [("times", part.times), ("plus", part.plus)] {
        if !(value.is_finite() && value.abs() <= 1e15) || (field == "times" && value == 0.0) {
            let what = format!("`{field}` of `{name}` is {value:?}");
            return Err(known.fault(
                &format!("{at}.{field}"),
                what,
                "write a finite number; `times` is not 0",
            ));
        }
    }
    if part.marker.as_ref().is_some_and(|m| m.trim().is_empty() || m.contains(['/', '\\', '\n', '\r'])) {
        return Err(known.fault(
            &format!("{at}.marker"),
            "marker has no usable name",
            "write letters and digits",
        ));
    }
    Ok(())
}

fn find(known: &Known, at: &str, text: &str, table: &Table) -> Result<usize> {
    match table.column(text) {
        Found::One(column) => Ok(column),
        Found::None => {
            let all: Vec<String> =
                (0..table.headings.len()).map(|i| format!("`{}`", table.called(i))).collect();
            let shown_some = all.iter().take(40).cloned().collect::<Vec<_>>().join(" ");
            let more = if all.len() > 40 { " ..." } else { "" };
            let what = format!("the table has no column `{}`", shown(text));
            Err(known.fault(at, what, format!("name one of: {shown_some}{more}")))
        }
        Found::Several(all) => {
            let numbers: Vec<String> = all.iter().map(|i| format!("#{}", i + 1)).collect();
            let what = format!("{} columns of the table are called `{}`", all.len(), shown(text));
            Err(known.fault(at, what, format!("say which by its number: {}", numbers.join(", "))))
        }
    }
}

fn source(
    known: &Known,
    at: &str,
    part: &MappedColumn,
    table: &Table,
    machine: Option<&Machine>,
) -> Result<Source> {
    let column = find(known, &format!("{at}.from"), &part.from, table)?;
    let expected = quantity(&part.to, machine);
    let fits = || expected.map_or("a unit of docs/recordings.md".to_string(), Unit::symbols_of);
    let unit = match &part.unit {
        Some(text) => spelled(text).ok_or_else(|| {
            let what = format!("unit `{}` is not known", shown(text));
            known.fault(&format!("{at}.unit"), what, format!("write one of: {}", fits()))
        })?,
        None => match (table.headings[column].stated(), expected) {
            (Some(unit), _) => unit,
            (None, Some(Quantity::One)) => PURE,
            // A date and a time of day say their unit themselves.
            (None, Some(Quantity::Time)) if is_clock(table, column) => SECONDS,
            (None, _) => {
                let what = format!("`{}` has no unit: column `{}` names none", part.to, table.called(column));
                return Err(known.fault(at, what, format!("add `unit: \"...\"` with one of: {}", fits())));
            }
        },
    };
    if expected.is_some_and(|q| q != unit.quantity()) {
        let what = format!("`{}` has unit `{}`, a unit of {}", part.to, unit.unit, unit.quantity());
        return Err(known.fault(&format!("{at}.unit"), what, format!("write one of: {}", fits())));
    }
    Ok(Source { column, unit, times: part.times, plus: part.plus })
}

/// Whether a column holds dates or times of day.
pub(super) fn is_clock(table: &Table, column: usize) -> bool {
    let first =
        table.rows.iter().filter_map(|row| row.fields.get(column)).find(|f| !super::cell::is_drop_out(f));
    first.is_some_and(|field| super::moment::read(field).is_some())
}

fn rotation(known: &Known, pieces: &BTreeMap<Piece, Source>) -> Result<Rotation> {
    let get = |piece: Piece, name: String| {
        pieces.get(&piece).cloned().ok_or_else(|| {
            let what = format!("the rotation has no `{name}`");
            known.fault(
                "columns",
                what,
                "give all of qw qx qy qz, of euler1 euler2 euler3, or of matrix11 to matrix34",
            )
        })
    };
    let kinds = [
        pieces.keys().any(|p| matches!(p, Piece::Quaternion(_))),
        pieces.keys().any(|p| matches!(p, Piece::Euler(_))),
        pieces.keys().any(|p| matches!(p, Piece::Matrix(..))),
    ];
    if kinds.iter().filter(|k| **k).count() > 1 {
        return Err(known.fault("columns", "the rotation is given in two forms", "keep one of them"));
    }
    if kinds[0] {
        let q = |i: usize| get(Piece::Quaternion(i), ["qw", "qx", "qy", "qz"][i].into());
        return Ok(Rotation::Quaternion([q(0)?, q(1)?, q(2)?, q(3)?]));
    }
    if kinds[2] {
        let row = |i: usize| {
            let m = |j: usize| get(Piece::Matrix(i, j), format!("matrix{}{}", i + 1, j + 1));
            Ok::<_, crate::error::Error>([m(0)?, m(1)?, m(2)?])
        };
        return Ok(Rotation::Matrix(Box::new([row(0)?, row(1)?, row(2)?])));
    }
    let e = |i: usize| get(Piece::Euler(i), format!("euler{}", i + 1));
    let Some(word) = &known.map.euler else {
        let what = "Euler angles without their convention";
        return Err(known.fault("columns", what, format!("add `euler: \"...\"`: {CONVENTIONS}")));
    };
    let Some(euler) = Euler::named(word) else {
        let what = format!("convention `{}` of Euler angles is not known", shown(word));
        return Err(known.fault("euler", what, format!("write {CONVENTIONS}")));
    };
    Ok(Rotation::Euler(euler, [e(0)?, e(1)?, e(2)?]))
}

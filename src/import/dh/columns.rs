//! The columns of a DH table.

use super::super::chain::one_line;
use super::super::sheet::{Row, Sheet};
use super::cell::{self, Term};
use crate::convert::Stated;
use crate::error::Result;
use crate::machine::{FileUnits, JointKind};
use crate::units::{Quantity, Unit};

/// Which column says what, by index.
pub(super) struct Columns {
    pub name: Option<usize>,
    pub kind: Option<usize>,
    pub theta: Option<usize>,
    pub d: Option<usize>,
    pub a: usize,
    pub alpha: usize,
    pub beta: Option<usize>,
    /// Positions: one column for lengths, one for angles, or one of them.
    pub offset: Vec<usize>,
    lower: Vec<usize>,
    upper: Vec<usize>,
    sign: Option<usize>,
    displacement: Option<usize>,
}

/// Every name that a column may have, for the message that one has another.
const KNOWN: &str = "joint, kind, theta, d, a, alpha, beta, offset, lower, upper, sign, displacement";

const NAMES: [(&[&str], usize); 12] = [
    (&["joint", "name", "joint name", "joint_name", "link", "i", "axis"], 0),
    (&["kind", "type", "joint type", "joint_type"], 1),
    (&["theta", "th", "\u{3b8}"], 2),
    (&["d"], 3),
    (&["a", "r"], 4),
    (&["alpha", "\u{3b1}"], 5),
    (&["beta", "\u{3b2}"], 6),
    (&["offset"], 7),
    (&["lower", "min", "from", "lower limit", "qmin", "q_min"], 8),
    (&["upper", "max", "to", "upper limit", "qmax", "q_max"], 9),
    (&["sign", "direction"], 10),
    (&["displacement"], 11),
];

impl Columns {
    pub fn of(sheet: &Sheet) -> Result<Columns> {
        let known: Vec<&str> = NAMES.iter().flat_map(|(names, _)| names.iter().copied()).collect();
        let all = sheet.columns(&known);
        if let Some(other) = (0..sheet.headings.len()).find(|i| !all.contains(i)) {
            let what = format!("column `{}` is not known", sheet.called(other));
            return Err(sheet.fault_of_headings(what, format!("leave it out, or name it one of: {KNOWN}")));
        }
        let one = |slot: usize| sheet.column(NAMES[slot].0);
        let several = |slot: usize| -> Result<Vec<usize>> {
            let columns = sheet.columns(NAMES[slot].0);
            for (i, column) in columns.iter().enumerate() {
                let unit = position_unit(sheet, *column)?;
                if columns[..i].iter().any(|other| {
                    position_unit(sheet, *other).is_ok_and(|other| other.quantity == unit.quantity)
                }) {
                    let what = format!("column `{}` stands twice", sheet.called(*column));
                    return Err(sheet.fault_of_headings(what, "leave one of them out"));
                }
            }
            Ok(columns)
        };
        let needed = |slot: usize, name: &str| -> Result<usize> {
            one(slot)?.ok_or_else(|| {
                let what = format!("the table has no column `{name}`");
                sheet.fault_of_headings(what, "give it the columns joint, kind, theta[deg], d[mm], a[mm], alpha[deg], in units of your own")
            })
        };
        Ok(Columns {
            name: one(0)?,
            kind: one(1)?,
            theta: one(2)?,
            d: one(3)?,
            a: needed(4, "a")?,
            alpha: needed(5, "alpha")?,
            beta: one(6)?,
            offset: several(7)?,
            lower: several(8)?,
            upper: several(9)?,
            sign: one(10)?,
            displacement: one(11)?,
        })
    }

    /// The units of the table, where all columns of a quantity agree; else m and rad.
    pub fn units(&self, sheet: &Sheet) -> FileUnits {
        let all = [self.theta, self.d, Some(self.a), Some(self.alpha), self.beta].into_iter().flatten();
        let units: Vec<Unit> = all.filter_map(|i| sheet.headings[i].stated()).map(|s| s.unit).collect();
        let of = |quantity: Quantity, si: Unit| {
            let mut own = units.iter().filter(|unit| unit.quantity == quantity);
            let first = own.next().copied().unwrap_or(si);
            if own.all(|unit| *unit == first) { first } else { si }
        };
        let si = FileUnits::si();
        FileUnits { length: of(Quantity::Length, si.length), angle: of(Quantity::Angle, si.angle) }
    }

    pub fn kind(&self, sheet: &Sheet, row: &Row) -> Result<JointKind> {
        let Some(column) = self.kind else { return Ok(JointKind::Revolute) };
        match sheet.text(row, column).to_lowercase().as_str() {
            "revolute" | "rotary" | "continuous" | "hinge" | "r" => Ok(JointKind::Revolute),
            "prismatic" | "linear" | "slide" | "p" => Ok(JointKind::Prismatic),
            _ => {
                let what =
                    format!("`{}` is no kind of joint", crate::wording::shown(sheet.text(row, column)));
                Err(sheet.fault(row, column, what, "write revolute or prismatic"))
            }
        }
    }

    /// Which way the joint goes when its command grows.
    pub fn sign(&self, sheet: &Sheet, row: &Row) -> Result<f64> {
        let Some(column) = self.sign else { return Ok(1.0) };
        match sheet.text(row, column) {
            "" | "+" | "1" | "+1" | "1.0" => Ok(1.0),
            "-" | "-1" | "-1.0" | "\u{2212}1" => Ok(-1.0),
            other => {
                let what = format!("`{}` is no sign", crate::wording::shown(other));
                Err(sheet.fault(row, column, what, "write 1 or -1"))
            }
        }
    }

    /// What one of these columns says of a joint of this kind, m or rad; nothing where its field is empty.
    pub fn position(
        &self,
        sheet: &Sheet,
        row: &Row,
        columns: &[usize],
        kind: JointKind,
    ) -> Result<Option<f64>> {
        let mut found = None;
        for column in columns {
            let unit = position_unit(sheet, *column)?;
            let own = if kind == JointKind::Revolute { Quantity::Angle } else { Quantity::Length };
            let text = sheet.text(row, *column);
            if text.is_empty() {
                continue;
            }
            let number = match cell::value(text, unit, |text| sheet.number_in(text)) {
                Some(cell::Value::Number(number)) if number.abs() < 1e9 => number,
                _ => return Err(sheet.no_number(row, *column)),
            };
            if unit.quantity == own {
                found = Some(number);
            } else if number != 0.0 {
                let (is, other) = match kind {
                    JointKind::Revolute => ("rotary", "an angle"),
                    JointKind::Prismatic => ("linear", "a length"),
                };
                let what = format!("`{}` is in {unit}, and the joint is {is}", one_line(text));
                let name = sheet.headings[*column].name.to_lowercase();
                let mend = format!(
                    "leave the field empty and give {other} in a column of its own, such as `{name}[{}]`",
                    if own == Quantity::Angle { "deg" } else { "mm" }
                );
                return Err(sheet.fault(row, *column, what, mend));
            }
        }
        Ok(found)
    }

    pub fn travel(&self, sheet: &Sheet, row: &Row, kind: JointKind) -> Result<Option<(f64, f64)>> {
        let lower = self.position(sheet, row, &self.lower, kind)?;
        let upper = self.position(sheet, row, &self.upper, kind)?;
        match (lower, upper) {
            (Some(lower), Some(upper)) if lower < upper => Ok(Some((lower, upper))),
            (None, None) => Ok(None),
            (Some(_), Some(_)) => {
                let column = self.lower.first().copied().unwrap_or(0);
                let mend = "write the lower limit first; leave both empty where there is none";
                Err(sheet.fault(row, column, "the lower limit is not below the upper one", mend))
            }
            _ => {
                let column = self.lower.first().or(self.upper.first()).copied().unwrap_or(0);
                Err(sheet.fault(row, column, "the joint has one limit", "give both limits, or none"))
            }
        }
    }

    /// The commands that a joint follows besides or instead of its own.
    pub fn follows(&self, sheet: &Sheet, row: &Row, name: &str, names: &[String]) -> Result<Vec<Term>> {
        let Some(column) = self.displacement else { return Ok(Vec::new()) };
        let text = sheet.text(row, column);
        if text.is_empty() || text == name {
            return Ok(Vec::new());
        }
        let terms = cell::terms(text).ok_or_else(|| {
            let what = format!("`{}` is no sum of commands", crate::wording::shown(text));
            sheet.fault(row, column, what, "write joints with their factors, such as `q2` or `-0.5 q1 + q2`")
        })?;
        if let Some(other) = terms.iter().find(|term| !names.contains(&term.name)) {
            let what =
                format!("joint \"{name}\" follows \"{}\", which the table lacks", one_line(&other.name));
            return Err(sheet.fault(row, column, what, format!("name one of: {}", names.join(", "))));
        }
        Ok(terms)
    }
}

/// The unit of a column of positions, which may be lengths or angles.
fn position_unit(sheet: &Sheet, column: usize) -> Result<Unit> {
    match &sheet.headings[column].unit {
        Stated::Unit(spelled) if spelled.quantity() == Quantity::Length => {
            sheet.unit(column, Quantity::Length)
        }
        _ => sheet.unit(column, Quantity::Angle),
    }
}

//! Columns of a table that hold positions of joints: one for lengths, one for angles, or one of them.

use super::cell;
use super::chain::one_line;
use super::sheet::{Row, Sheet};
use crate::convert::Stated;
use crate::error::Result;
use crate::machine::JointKind;
use crate::units::{Quantity, Unit};
use crate::wording::shown;

pub(super) struct Positions(Vec<usize>);

impl Positions {
    /// The columns of these names, at most one for each quantity.
    pub fn of(sheet: &Sheet, names: &[&str]) -> Result<Positions> {
        let columns = sheet.columns(names);
        let mut seen: Vec<Quantity> = Vec::new();
        for column in &columns {
            let quantity = unit(sheet, *column)?.quantity;
            if seen.contains(&quantity) {
                let what = format!("column `{}` stands twice", sheet.called(*column));
                return Err(sheet.fault_of_headings(what, "leave one of them out"));
            }
            seen.push(quantity);
        }
        Ok(Positions(columns))
    }

    /// What they say of a joint of this kind, m or rad; nothing where its field is empty.
    pub fn value(&self, sheet: &Sheet, row: &Row, kind: JointKind) -> Result<Option<f64>> {
        let mut found = None;
        for column in &self.0 {
            let unit = unit(sheet, *column)?;
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
                let (is, other, symbol) = match kind {
                    JointKind::Revolute => ("rotary", "an angle", "deg"),
                    JointKind::Prismatic => ("linear", "a length", "mm"),
                };
                let what = format!("`{}` is in {unit}, and the joint is {is}", one_line(text));
                let name = sheet.headings[*column].name.to_lowercase();
                let mend = format!(
                    "leave the field empty and give {other} in a column of its own, such as `{name}[{symbol}]`"
                );
                return Err(sheet.fault(row, *column, what, mend));
            }
        }
        Ok(found)
    }
}

/// Both limits of a joint, or none.
pub(super) fn travel(
    sheet: &Sheet,
    row: &Row,
    lower: &Positions,
    upper: &Positions,
    kind: JointKind,
) -> Result<Option<(f64, f64)>> {
    let column = lower.0.first().or(upper.0.first()).copied().unwrap_or(0);
    match (lower.value(sheet, row, kind)?, upper.value(sheet, row, kind)?) {
        (Some(lower), Some(upper)) if lower < upper => Ok(Some((lower, upper))),
        (None, None) => Ok(None),
        (Some(_), Some(_)) => {
            let mend = "write the lower limit first; leave both empty where there is none";
            Err(sheet.fault(row, column, "the lower limit is not below the upper one", mend))
        }
        _ => Err(sheet.fault(row, column, "the joint has one limit", "give both limits, or none")),
    }
}

/// The kind of joint that a word says.
pub(super) fn kind_named(text: &str) -> Option<JointKind> {
    match text.trim().to_lowercase().as_str() {
        "revolute" | "rotary" | "continuous" | "hinge" | "r" => Some(JointKind::Revolute),
        "prismatic" | "linear" | "slide" | "p" => Some(JointKind::Prismatic),
        _ => None,
    }
}

/// The same of a field.
pub(super) fn kind(sheet: &Sheet, row: &Row, column: usize) -> Result<JointKind> {
    let text = sheet.text(row, column);
    kind_named(text).ok_or_else(|| {
        let what = format!("`{}` is no kind of joint", shown(text));
        sheet.fault(row, column, what, "write revolute or prismatic")
    })
}

/// The unit of such a column.
fn unit(sheet: &Sheet, column: usize) -> Result<Unit> {
    match &sheet.headings[column].unit {
        Stated::Unit(spelled) if spelled.quantity() == Quantity::Length => {
            sheet.unit(column, Quantity::Length)
        }
        _ => sheet.unit(column, Quantity::Angle),
    }
}

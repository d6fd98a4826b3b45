//! The columns of a DH table.

use super::super::cell::{self, Term};
use super::super::chain::one_line;
use super::super::position::{Positions, kind, travel};
use super::super::sheet::{Row, Sheet};
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
    pub offset: Positions,
    lower: Positions,
    upper: Positions,
    sign: Option<usize>,
    displacement: Option<usize>,
}

/// Names that the modified convention alone has: of the link before the joint.
pub(super) const BEFORE: [&str; 10] = [
    "a_i-1",
    "a_{i-1}",
    "ai-1",
    "a(i-1)",
    "alpha_i-1",
    "alpha_{i-1}",
    "alphai-1",
    "alpha(i-1)",
    "\u{3b1}_i-1",
    "\u{3b1}_{i-1}",
];

/// Every name that a column may have, for the message that one has another.
const KNOWN: &str = "joint, kind, theta, d, a, alpha, beta, offset, lower, upper, sign, displacement";

const NAMES: [(&[&str], usize); 12] = [
    (&["joint", "name", "joint name", "joint_name", "link", "i", "axis"], 0),
    (&["kind", "type", "joint type", "joint_type"], 1),
    (&["theta", "th", "\u{3b8}", "theta_i", "thetai", "\u{3b8}_i", "\u{3b8}i"], 2),
    (&["d", "d_i", "di"], 3),
    (&["a", "r", "a_i", "ai", "r_i", "ri", BEFORE[0], BEFORE[1], BEFORE[2], BEFORE[3]], 4),
    (
        &[
            "alpha",
            "\u{3b1}",
            "alpha_i",
            "alphai",
            "\u{3b1}_i",
            "\u{3b1}i",
            BEFORE[4],
            BEFORE[5],
            BEFORE[6],
            BEFORE[7],
            BEFORE[8],
            BEFORE[9],
        ],
        5,
    ),
    (&["beta", "\u{3b2}", "beta_i", "betai"], 6),
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
        let several = |slot: usize| Positions::of(sheet, NAMES[slot].0);
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
        self.kind.map_or(Ok(JointKind::Revolute), |column| kind(sheet, row, column))
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

    pub fn travel(&self, sheet: &Sheet, row: &Row, kind: JointKind) -> Result<Option<(f64, f64)>> {
        travel(sheet, row, &self.lower, &self.upper, kind)
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

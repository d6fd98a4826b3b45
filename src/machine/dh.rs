//! Denavit-Hartenberg parameters in place of the tool's frames: what they stand for, and the block `dh` of a machine file.

use super::form::{
    AxisForm, ConventionForm, DhForm, DhRowForm, DyadForm, JointBody, JointForm, KindForm, MoveForm,
};
use super::number::{Checked, to_si};
use super::{FileUnits, JointKind, MachineFault};

/// Parameters of one joint, in whatever units.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DhParameters {
    pub theta: f64,
    pub d: f64,
    pub a: f64,
    pub alpha: f64,
    pub beta: f64,
}

impl DhParameters {
    /// With the joint moved on by this: about its axis or along it.
    pub fn moved(mut self, kind: JointKind, by: f64) -> Self {
        match kind {
            JointKind::Revolute => self.theta += by,
            JointKind::Prismatic => self.d += by,
        }
        self
    }

    /// About and along the joint's own axis.
    fn own(self) -> [MoveForm; 2] {
        [MoveForm::Rz(self.theta), MoveForm::Tz(self.d)]
    }

    /// From its axis to the next one, or from the one before in the modified convention.
    fn link(self) -> [MoveForm; 3] {
        [MoveForm::Tx(self.a), MoveForm::Rx(self.alpha), MoveForm::Ry(self.beta)]
    }
}

/// The moves before each joint, which then turns about or goes along z, and as one list more those behind the last joint.
/// `modified`: Craig's convention, in which a row has the link before its joint and not the one behind it.
pub(crate) fn moves(rows: &[DhParameters], modified: bool) -> Vec<Vec<MoveForm>> {
    let mut lists = vec![Vec::new(); rows.len() + 1];
    for (i, row) in rows.iter().enumerate() {
        if modified {
            lists[i].extend(row.link());
        }
        lists[i].extend(row.own());
        if !modified {
            lists[i + 1].extend(row.link());
        }
    }
    lists
}

/// The frames that a block stands for, those of the list `tool`.
pub(super) fn dyads(form: &DhForm, units: FileUnits) -> Checked<Vec<DyadForm>> {
    let parameters: Vec<DhParameters> =
        form.rows.iter().enumerate().map(|(i, row)| parameters(row, i, units)).collect::<Checked<_>>()?;
    let mut lists = moves(&parameters, matches!(form.convention, ConventionForm::modified)).into_iter();
    if form.rows.is_empty() {
        return Err(("dh.rows".into(), MachineFault::EmptyBranch { branch: "dh.rows".into() }));
    }
    check_moves(form.base.as_deref().unwrap_or_default(), "dh.base", units)?;
    check_moves(form.tool.as_deref().unwrap_or_default(), "dh.tool", units)?;
    let mut before = form.base.clone().unwrap_or_default();
    let mut dyads = Vec::new();
    for (i, row) in form.rows.iter().enumerate() {
        before.extend(lists.next().unwrap_or_default());
        let axis = match row.sign {
            1 => "z",
            -1 => "-z",
            sign => {
                let fault = MachineFault::Sign { joint: name(row, i), sign };
                return Err((format!("dh.rows[{i}].sign"), fault));
            }
        };
        let body = JointBody {
            axis: AxisForm::Word(axis.into()),
            name: None,
            travel: row.travel,
            follows: row.follows.clone(),
            nc: row.nc.clone(),
        };
        dyads.push(DyadForm {
            joint: Some(match row.kind {
                KindForm::revolute => JointForm::Revolute(body),
                KindForm::prismatic => JointForm::Prismatic(body),
            }),
            mass: row.mass,
            centre_of_mass: row.centre_of_mass,
            tolerance: row.tolerance,
            moves: Some(std::mem::take(&mut before)),
            ..DyadForm::fixed(name(row, i))
        });
    }
    before.extend(lists.next().unwrap_or_default());
    before.extend(form.tool.iter().flatten());
    dyads.push(DyadForm { moves: Some(before), ..DyadForm::fixed("t") });
    Ok(dyads)
}

fn check_moves(moves: &[MoveForm], list: &str, units: FileUnits) -> Checked<()> {
    for (k, step) in moves.iter().enumerate() {
        let (_, value, turns) = step.parts();
        let unit = if turns { units.angle } else { units.length };
        to_si(format!("{list}[{k}]"), value, unit, "a move")?;
    }
    Ok(())
}

/// The name of a joint: its own, or its number.
fn name(row: &DhRowForm, i: usize) -> String {
    row.joint.clone().unwrap_or_else(|| format!("q{}", i + 1))
}

/// In the file's units, checked.
fn parameters(row: &DhRowForm, i: usize, units: FileUnits) -> Checked<DhParameters> {
    let kind = match row.kind {
        KindForm::revolute => JointKind::Revolute,
        KindForm::prismatic => JointKind::Prismatic,
    };
    let check = |field: &str, value: f64, unit| {
        to_si(format!("dh.rows[{i}].{field}"), value, unit, &format!("`{field}`")).map(|_| value)
    };
    let parameters = DhParameters {
        theta: check("theta", row.theta, units.angle)?,
        d: check("d", row.d, units.length)?,
        a: check("a", row.a, units.length)?,
        alpha: check("alpha", row.alpha, units.angle)?,
        beta: check("beta", row.beta, units.angle)?,
    };
    Ok(parameters.moved(kind, check("offset", row.offset, units.of(kind))?))
}

/// Where in a block the value stands that the list `tool` has at this path.
pub(super) fn path_in(form: &DhForm, path: String) -> String {
    let Some(rest) = path.strip_prefix("tool") else { return path };
    let inner = rest.strip_prefix('[').and_then(|rest| rest.split_once(']'));
    let Some((Ok(i), field)) = inner.map(|(i, field)| (i.parse::<usize>(), field)) else {
        return "dh.rows".into();
    };
    if i >= form.rows.len() {
        return "dh.tool".into();
    }
    let field = match field {
        ".frame" | ".joint.name" => ".joint",
        field if field.starts_with(".moves") => "",
        field => field.strip_prefix(".joint").unwrap_or(field),
    };
    format!("dh.rows[{i}]{field}")
}

//! From a machine to text; reading it back gives the same machine.

use ron::ser::PrettyConfig;
use serde::Serialize;

use super::form::{
    AngleUnit, AxisForm, DyadForm, JointBody, JointForm, LengthUnit, MachineForm, NcForm, SideBranchForm,
    ToleranceForm, Triple, UnitsForm,
};
use super::{Dyad, FileUnits, Joint, JointKind, Machine, Tolerance};
use crate::document::EXTENSIONS;
use crate::lie::Vec3;
use crate::units::Unit;

impl Machine {
    /// The machine as a RON text in its own units.
    pub fn to_ron(&self) -> String {
        to_text(&self.to_form::<()>())
    }

    pub(crate) fn to_form<C>(&self) -> MachineForm<C> {
        let units = self.units;
        let forms = |dyads: &[Dyad]| dyads.iter().map(|d| dyad(d, units)).collect();
        let (workpiece, tool) = self.dyads.split_at(self.workpiece_count);
        let gravity = self.gravity_b;
        MachineForm {
            name: self.name.clone(),
            about: self.about.clone(),
            units: UnitsForm { length: length_word(units.length), angle: angle_word(units.angle) },
            gravity: (gravity.0 != [0.0, 0.0, -1.0]).then_some(triple(gravity)),
            tolerance: (self.tolerance != Tolerance::DEFAULT).then(|| tolerance(self.tolerance, units)),
            workpiece: Some(forms(workpiece)),
            tool: Some(forms(tool)),
            dh: None,
            side_branches: (self.side_branches.iter())
                .map(|side| SideBranchForm {
                    on: side.on.clone(),
                    recorded_as: side.recorded_as.clone(),
                    dyads: forms(&side.dyads),
                })
                .collect(),
            calibration: None,
        }
    }
}

/// A form as the text that is written to files: one dyad a line, numbers as short as they can be.
pub(crate) fn to_text<C: Serialize>(form: &MachineForm<C>) -> String {
    let config = PrettyConfig::new()
        .depth_limit(2)
        .struct_names(false)
        .indentor("    ")
        .extensions(ron::extensions::Extensions::empty())
        .compact_maps(true);
    let options = ron::Options::default().with_default_extension(EXTENSIONS);
    let text =
        options.to_string_pretty(form, config).expect("a machine form has nothing that RON cannot write");
    format!("Machine{}\n", one_entry_a_line(&text))
}

/// Lists below the second level (those of a calibration or a side branch) come out on one line; here each entry gets its own.
fn one_entry_a_line(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 256);
    for line in text.split_inclusive('\n') {
        if let Some(effects) = line.strip_prefix(EFFECTS) {
            out.push_str(&format!("{EFFECTS}{}", one_field_a_line(effects)));
            continue;
        }
        let side = line.strip_prefix(SIDE_BRANCH).and_then(|rest| rest.split_once(", dyads: [("));
        if let Some((on, dyads)) =
            side.and_then(|(on, rest)| Some((on, rest.trim_end().strip_suffix(")]),")?)))
        {
            let dyads = dyads.replace("), (frame: ", "),\n            (frame: ");
            out.push_str(&format!("{SIDE_BRANCH}{on}, dyads: [\n            ({dyads}),\n        ]),\n"));
            continue;
        }
        let list = line.starts_with("        ").then(|| line.split_once(": [(")).flatten();
        match list.and_then(|(field, rest)| Some((field, rest.trim_end().strip_suffix(")],")?))) {
            Some((field, entries))
                if field.trim_start().chars().all(|c| c.is_ascii_lowercase() || c == '_') =>
            {
                let entries = entries.replace("), (", "),\n            (");
                out.push_str(&format!("{field}: [\n            ({entries}),\n        ],\n"));
            }
            _ => out.push_str(line),
        }
    }
    out
}

/// How the line of a side branch begins.
const SIDE_BRANCH: &str = "        (on: ";

/// How the line of a calibration's effects begins.
const EFFECTS: &str = "        effects: [";

/// Effects on one line, laid out: each field on its own, and each entry of the lists among them.
fn one_field_a_line(effects: &str) -> String {
    let mut out = String::with_capacity(2 * effects.len());
    let (mut depth, mut quoted, mut escaped) = (1, false, false);
    let indent = |depth: usize| format!("\n{:width$}", "", width = 8 + 4 * depth);
    let mut letters = effects.chars().peekable();
    while let Some(letter) = letters.next() {
        if quoted {
            out.push(letter);
            (quoted, escaped) = (escaped || letter != '"', !escaped && letter == '\\');
            continue;
        }
        match letter {
            '(' | '[' => {
                if depth == 1 {
                    out.push_str(&indent(depth));
                }
                out.push(letter);
                if let Some(end) = letters.next_if(|next| matches!(next, ')' | ']')) {
                    out.push(end);
                    continue;
                }
                depth += 1;
                if depth <= 3 {
                    out.push_str(&indent(depth));
                }
            }
            ')' | ']' => {
                if (2..=3).contains(&depth) {
                    out.push(',');
                }
                if depth <= 3 {
                    out.push_str(&indent(depth - 1));
                }
                depth = depth.saturating_sub(1);
                out.push(letter);
            }
            ',' => {
                out.push(letter);
                if (2..=3).contains(&depth) && letters.next_if_eq(&' ').is_some() {
                    out.push_str(&indent(depth));
                } else if depth == 1 {
                    letters.next_if_eq(&' ');
                }
            }
            _ => {
                quoted = letter == '"';
                out.push(letter);
            }
        }
    }
    out
}

fn length_word(unit: Unit) -> LengthUnit {
    match unit.symbol {
        "mm" => LengthUnit::mm,
        "um" => LengthUnit::um,
        "nm" => LengthUnit::nm,
        "in" => LengthUnit::r#in,
        _ => LengthUnit::m,
    }
}

fn angle_word(unit: Unit) -> AngleUnit {
    match unit.symbol {
        "mrad" => AngleUnit::mrad,
        "urad" => AngleUnit::urad,
        "deg" => AngleUnit::deg,
        "arcsec" => AngleUnit::arcsec,
        _ => AngleUnit::rad,
    }
}

pub(crate) fn triple(Vec3([x, y, z]): Vec3<f64>) -> Triple {
    (x, y, z)
}

/// A vector in SI as the file's numbers.
pub(crate) fn in_unit(vector: Vec3<f64>, unit: Unit) -> Triple {
    triple(Vec3(vector.0.map(|c| unit.write_si(c))))
}

fn tolerance(tolerance: Tolerance, units: FileUnits) -> ToleranceForm {
    ToleranceForm {
        translation: units.length.write_si(tolerance.translation),
        rotation: units.angle.write_si(tolerance.rotation),
    }
}

fn dyad(dyad: &Dyad, units: FileUnits) -> DyadForm {
    let some = |vector: Vec3<f64>, unit| (vector.0 != [0.0; 3]).then(|| in_unit(vector, unit));
    DyadForm {
        frame: dyad.frame.clone(),
        at: some(dyad.placement.at, units.length),
        rotation: some(dyad.placement.rotation, units.angle),
        moves: None,
        joint: dyad.joint.as_ref().map(|j| joint(j, &dyad.frame, units)),
        mass: dyad.mass.map(|m| m.mass),
        centre_of_mass: dyad.mass.and_then(|m| some(m.centre, units.length)),
        tolerance: dyad.tolerance.map(|t| tolerance(t, units)),
    }
}

fn joint(joint: &Joint, frame: &str, units: FileUnits) -> JointForm {
    let unit = units.of(joint.kind);
    let body = JointBody {
        axis: axis(joint.axis),
        name: (joint.name != frame).then(|| joint.name.clone()),
        travel: joint.travel.map(|(from, to)| (unit.write_si(from), unit.write_si(to))),
        follows: joint.follows.clone(),
        nc: joint.nc.as_ref().map(|nc| NcForm { address: nc.address.clone(), sign: nc.sign }),
    };
    match joint.kind {
        JointKind::Prismatic => JointForm::Prismatic(body),
        JointKind::Revolute => JointForm::Revolute(body),
    }
}

fn axis(axis: Vec3<f64>) -> AxisForm {
    for (k, word) in ["x", "y", "z"].into_iter().enumerate() {
        for (sign, prefix) in [(1.0, ""), (-1.0, "-")] {
            let unit: [f64; 3] = std::array::from_fn(|i| if i == k { sign } else { 0.0 });
            if axis.0 == unit {
                return AxisForm::Word(format!("{prefix}{word}"));
            }
        }
    }
    AxisForm::Vector(triple(axis))
}

//! From text to a checked machine.

use std::collections::BTreeSet;
use std::path::Path;

use serde::de::IgnoredAny;

use super::form::{
    AxisForm, DyadForm, JointBody, JointForm, MachineForm, SideBranchForm, ToleranceForm, Triple, UnitsForm,
};
use super::number::{Checked, LARGEST, finite, number, to_si, vec_to_si};
use super::{
    Branch, Drive, Dyad, FileUnits, Joint, JointKind, Machine, MachineFault, MassPoint, NcWord, Placement,
    SideBranch, Tolerance,
};
use crate::document::Document;
use crate::error::{Error, Result};
use crate::lie::{Pose, Vec3};
use crate::units::Unit;

impl Machine {
    /// Reads a machine file.
    ///
    /// # Errors
    /// [`Error::File`], or [`Error::Input`] with line and column.
    pub fn open(path: impl AsRef<Path>) -> Result<Machine> {
        let document = Document::open(path)?;
        let form: MachineForm<IgnoredAny> = document.read()?;
        Machine::from_form(&form).map_err(|e| at_path(&document, e))
    }

    /// Reads a machine from a text; `file` is only the name that messages use.
    ///
    /// # Errors
    /// As [`Machine::open`].
    pub fn parse(file: impl AsRef<Path>, text: &str) -> Result<Machine> {
        let document = Document::new(file, text.to_string())?;
        let form: MachineForm<IgnoredAny> = document.read()?;
        Machine::from_form(&form).map_err(|e| at_path(&document, e))
    }

    pub(crate) fn from_form<C>(form: &MachineForm<C>) -> Checked<Machine> {
        let missing = |list: &str| (list.to_string(), MachineFault::MissingList { list: list.into() });
        let (workpiece, tool) = (form.workpiece.as_deref(), form.tool.as_deref());
        match (&form.dh, tool) {
            (None, tool) => {
                let workpiece = workpiece.ok_or_else(|| missing("workpiece"))?;
                Machine::from_lists(form, workpiece, tool.ok_or_else(|| missing("tool"))?)
            }
            (Some(_), Some(_)) => Err(("dh".into(), MachineFault::DhBesideTool)),
            (Some(dh), None) => {
                let tool = super::dh::dyads(dh, form.units.units())?;
                let w = [DyadForm::fixed("w")];
                let machine = Machine::from_lists(form, workpiece.unwrap_or(&w), &tool);
                machine.map_err(|(path, fault)| (super::dh::path_in(dh, path), fault))
            }
        }
    }

    fn from_lists<C>(form: &MachineForm<C>, workpiece: &[DyadForm], tool: &[DyadForm]) -> Checked<Machine> {
        let units = form.units.units();
        let branch = |branch: Branch, forms: &[DyadForm]| -> Checked<Vec<Dyad>> {
            let path = |i| format!("{}[{i}]", branch.field());
            forms.iter().enumerate().map(|(i, f)| dyad(f, units, &path(i))).collect()
        };
        let mut machine = Machine::of_dyads(
            form.name.clone(),
            units,
            branch(Branch::Workpiece, workpiece)?,
            branch(Branch::Tool, tool)?,
        )?
        .with_about(form.about.clone());
        if let Some(gravity) = form.gravity {
            finite("gravity", gravity, "direction of gravity")?;
            machine = machine.hanging(vec3(gravity))?;
        }
        if let Some(form) = form.tolerance {
            machine = machine.tolerant(tolerance(form, units, "tolerance")?)?;
        }
        let side = |(b, form): (usize, &SideBranchForm)| -> Checked<SideBranch> {
            let path = |i| format!("side_branches[{b}].dyads[{i}]");
            let dyads = form.dyads.iter().enumerate().map(|(i, f)| dyad(f, units, &path(i)));
            let (on, recorded_as) = (form.on.clone(), form.recorded_as.clone());
            Ok(SideBranch { on, recorded_as, dyads: dyads.collect::<Checked<_>>()? })
        };
        machine.with_sides(form.side_branches.iter().enumerate().map(side).collect::<Checked<_>>()?)
    }

    /// Checks everything that concerns more than one value, and works out commands and drives.
    pub(super) fn check(&mut self) -> Checked<()> {
        usable_name("name", "machine", &self.name)?;
        for branch in [Branch::Workpiece, Branch::Tool] {
            self.check_branch(branch)?;
        }
        let mut frames = BTreeSet::new();
        let mut joints = BTreeSet::new();
        for (j, dyad) in self.dyads.iter().enumerate() {
            let path = self.path_of(j);
            if !frames.insert(dyad.frame.as_str()) {
                let name = dyad.frame.clone();
                return Err((
                    format!("{path}.frame"),
                    MachineFault::NameTwice { what: "frame".into(), name },
                ));
            }
            usable_name(&format!("{path}.frame"), "frame", &dyad.frame)?;
            check_dyad(dyad, &path, self.units)?;
            let Some(joint) = &dyad.joint else { continue };
            if !joints.insert(joint.name.as_str()) {
                let name = joint.name.clone();
                return Err((
                    format!("{path}.joint.name"),
                    MachineFault::NameTwice { what: "joint".into(), name },
                ));
            }
            if joint.name == "t" || joint.name == "w" {
                let name = joint.name.clone();
                return Err((
                    format!("{path}.joint.name"),
                    MachineFault::BadName { what: "joint".into(), name },
                ));
            }
        }
        if joints.is_empty() {
            return Err(("tool".into(), MachineFault::NoJoint));
        }
        self.work_out_drives()
    }

    fn check_branch(&self, branch: Branch) -> Checked<()> {
        let (dyads, expected) = match branch {
            Branch::Workpiece => (&self.dyads[..self.workpiece_count], "w"),
            Branch::Tool => (&self.dyads[self.workpiece_count..], "t"),
        };
        let field = branch.field();
        let Some(last) = dyads.last() else {
            return Err((field.into(), MachineFault::EmptyBranch { branch: field.into() }));
        };
        let path = format!("{field}[{}]", dyads.len() - 1);
        if last.frame != expected {
            let fault = MachineFault::LastFrame {
                branch: field.into(),
                expected: expected.into(),
                found: last.frame.clone(),
            };
            return Err((format!("{path}.frame"), fault));
        }
        if last.joint.is_some() {
            let fault = MachineFault::JointOnLastFrame { frame: last.frame.clone() };
            return Err((format!("{path}.joint"), fault));
        }
        Ok(())
    }

    fn work_out_drives(&mut self) -> Checked<()> {
        let commanded = |joint: &Joint| joint.follows.as_ref().is_none_or(|f| f.contains_key(&joint.name));
        let (command_dyads, commands): (Vec<usize>, Vec<String>) =
            self.joints().filter(|(_, j)| commanded(j)).map(|(j, joint)| (j, joint.name.clone())).unzip();
        let mut drives = vec![None; self.dyads.len()];
        for (j, joint) in self.joints() {
            if joint.follows.as_ref().is_some_and(|leaders| leaders.is_empty()) {
                let fault = MachineFault::FollowsNothing { joint: joint.name.clone() };
                return Err((format!("{}.joint.follows", self.path_of(j)), fault));
            }
            let own = [(joint.name.clone(), 1.0)].into();
            let mut terms = Vec::new();
            for (leader, factor) in joint.follows.as_ref().unwrap_or(&own) {
                let path = format!("{}.joint.follows.{leader}", self.path_of(j));
                if !(factor.is_finite() && factor.abs() < LARGEST) {
                    return Err((
                        path,
                        MachineFault::NotFinite { what: "a factor of `follows`".into(), value: *factor },
                    ));
                }
                let Some(index) = commands.iter().position(|c| c == leader) else {
                    let fault = MachineFault::Leader {
                        joint: joint.name.clone(),
                        leader: leader.clone(),
                        known: commands.join(", "),
                    };
                    return Err((path, fault));
                };
                terms.push((index, *factor));
            }
            terms.sort_by_key(|(index, _)| *index);
            drives[j] = Some(Drive { terms });
        }
        if commands.is_empty() {
            return Err(("tool".into(), MachineFault::NoJoint));
        }
        (self.commands, self.command_dyads, self.drives) = (commands, command_dyads, drives);
        Ok(())
    }

    /// Path of dyad `j` in a machine file.
    pub(super) fn path_of(&self, j: usize) -> String {
        match self.branch(j) {
            Branch::Workpiece => format!("workpiece[{j}]"),
            Branch::Tool => format!("tool[{}]", j - self.workpiece_count),
        }
    }
}

/// A fault with its path becomes an error with its place.
pub(crate) fn at_path(document: &Document, (path, fault): (String, MachineFault)) -> Error {
    Error::input(document.place_of(&path), fault)
}

impl UnitsForm {
    /// The units that the words name.
    pub(crate) fn units(&self) -> FileUnits {
        FileUnits {
            length: Unit::named(&unit_word(&self.length)).expect("every length word is a unit"),
            angle: Unit::named(&unit_word(&self.angle)).expect("every angle word is a unit"),
        }
    }
}

fn unit_word(word: &impl serde::Serialize) -> String {
    ron::to_string(word).unwrap_or_default().trim_start_matches("r#").to_string()
}

fn vec3((x, y, z): Triple) -> Vec3<f64> {
    Vec3([x, y, z])
}

/// The nearest number that a file can say in `unit`, without the dust of rounding: 1e-15 m or rad at most.
fn sayable(si: f64, unit: Unit) -> f64 {
    let places = 1e15 / 10f64.powf(unit.from_si(1.0).log10().ceil());
    let written = (unit.from_si(si) * places).round() / places;
    // Adding zero turns -0 into 0.
    unit.to_si(written) + 0.0
}

pub(super) fn usable_name(path: &str, what: &str, name: &str) -> Checked<()> {
    if is_usable_name(name) {
        return Ok(());
    }
    Err((path.into(), MachineFault::BadName { what: what.into(), name: name.into() }))
}

/// Whether recordings can use a name: letters, digits, `_`, `-` and `.`, beginning with a letter, 64 at most.
pub(crate) fn is_usable_name(name: &str) -> bool {
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.len() <= 64 && name.chars().all(fits)
}

fn tolerance(form: ToleranceForm, units: FileUnits, path: &str) -> Checked<Tolerance> {
    let component = |what: &str, value: f64, unit: Unit| {
        let si = unit.to_si(value);
        if si.is_finite() && si > 0.0 {
            return Ok(si);
        }
        Err((format!("{path}.{what}"), MachineFault::Tolerance { what: what.into(), value }))
    };
    Ok(Tolerance {
        translation: component("translation", form.translation, units.length)?,
        rotation: component("rotation", form.rotation, units.angle)?,
    })
}

fn dyad(form: &DyadForm, units: FileUnits, path: &str) -> Checked<Dyad> {
    let mass = match (form.mass, form.centre_of_mass) {
        (None, None) => None,
        (None, Some(_)) => {
            let fault = MachineFault::CentreWithoutMass { frame: form.frame.clone() };
            return Err((format!("{path}.centre_of_mass"), fault));
        }
        (Some(mass), centre) => {
            let centre = centre.unwrap_or_default();
            let path = format!("{path}.centre_of_mass");
            let centre = vec_to_si(&path, centre, units.length, "a coordinate of `centre_of_mass`")?;
            Some(MassPoint { mass, centre })
        }
    };
    Ok(Dyad {
        frame: form.frame.clone(),
        placement: placement(form, units, path)?,
        joint: form.joint.as_ref().map(|j| joint(j, &form.frame, units, path)).transpose()?,
        mass,
        tolerance: (form.tolerance).map(|t| tolerance(t, units, &format!("{path}.tolerance"))).transpose()?,
    })
}

fn placement(form: &DyadForm, units: FileUnits, path: &str) -> Checked<Placement> {
    let Some(moves) = &form.moves else {
        let (at, rotation) = (form.at.unwrap_or_default(), form.rotation.unwrap_or_default());
        return Ok(Placement {
            at: vec_to_si(&format!("{path}.at"), at, units.length, "a coordinate of `at`")?,
            rotation: vec_to_si(
                &format!("{path}.rotation"),
                rotation,
                units.angle,
                "a component of `rotation`",
            )?,
        });
    };
    if form.at.is_some() || form.rotation.is_some() {
        return Err((format!("{path}.moves"), MachineFault::TwoPlacements { frame: form.frame.clone() }));
    }
    let mut pose = Pose::identity(0.0);
    for (i, step) in moves.iter().enumerate() {
        let (along, value, turns) = step.parts();
        let unit = if turns { units.angle } else { units.length };
        let value = to_si(format!("{path}.moves[{i}]"), value, unit, "a move")?;
        let axis = Vec3(std::array::from_fn(|k| if k == along { 1.0 } else { 0.0 }));
        pose = pose * if turns { Pose::turn(axis, value) } else { Pose::translation(axis.times(value)) };
    }
    let Placement { at, rotation } = pose.into();
    Ok(Placement {
        at: Vec3(at.0.map(|c| sayable(c, units.length))),
        rotation: Vec3(rotation.0.map(|c| sayable(c, units.angle))),
    })
}

fn joint(form: &JointForm, frame: &str, units: FileUnits, path: &str) -> Checked<Joint> {
    let (kind, body, unit) = match form {
        JointForm::Prismatic(body) => (JointKind::Prismatic, body, units.length),
        JointForm::Revolute(body) => (JointKind::Revolute, body, units.angle),
    };
    let name = body.name.clone().unwrap_or_else(|| frame.to_string());
    let axis = axis(body, &name, &format!("{path}.joint.axis"))?;
    if let Some((from, to)) = body.travel {
        to_si(format!("{path}.joint.travel[0]"), from, unit, "a limit of `travel`")?;
        to_si(format!("{path}.joint.travel[1]"), to, unit, "a limit of `travel`")?;
        if from >= to {
            return Err((
                format!("{path}.joint.travel"),
                MachineFault::TravelReversed { joint: name, from, to },
            ));
        }
    }
    let nc = body.nc.as_ref().map(|nc| NcWord { address: nc.address.clone(), sign: nc.sign });
    Ok(Joint {
        name,
        kind,
        axis,
        travel: body.travel.map(|(from, to)| (unit.to_si(from), unit.to_si(to))),
        follows: body.follows.clone(),
        nc,
    })
}

fn axis(body: &JointBody, name: &str, path: &str) -> Checked<Vec3<f64>> {
    let vector = match &body.axis {
        AxisForm::Word(word) => {
            let (sign, letter) = match word.strip_prefix('-') {
                Some(rest) => (-1.0, rest),
                None => (1.0, word.strip_prefix('+').unwrap_or(word)),
            };
            let along = match letter {
                "x" | "X" => 0,
                "y" | "Y" => 1,
                "z" | "Z" => 2,
                _ => return Err((path.into(), MachineFault::AxisWord { word: word.clone() })),
            };
            return Ok(Vec3(std::array::from_fn(|k| if k == along { sign } else { 0.0 })));
        }
        AxisForm::Vector(vector) => *vector,
    };
    finite(path, vector, "a component of `axis`")?;
    unit_axis(vec3(vector), name, path)
}

/// Rounding in the last digits is mended; anything else is a mistake.
fn unit_axis(axis: Vec3<f64>, name: &str, path: &str) -> Checked<Vec3<f64>> {
    let length = axis.norm();
    if length < 1e-12 {
        let what = format!("axis of joint \"{name}\"");
        return Err((path.into(), MachineFault::ZeroVector { what }));
    }
    let unit = axis.times(length.recip());
    if (length - 1.0).abs() > 1e-6 {
        let fault = MachineFault::AxisLength { joint: name.into(), length, unit: unit.0 };
        return Err((path.into(), fault));
    }
    // A unit vector to the last bit or two stays as it is, so that it is written back as it was.
    Ok(if (length - 1.0).abs() < 1e-15 { axis } else { unit })
}

pub(super) fn check_dyad(dyad: &Dyad, path: &str, units: FileUnits) -> Checked<()> {
    for (field, vector) in [("at", dyad.placement.at), ("rotation", dyad.placement.rotation)] {
        let [x, y, z] = vector.0;
        finite(&format!("{path}.{field}"), (x, y, z), &format!("a number of `{field}`"))?;
    }
    if let Some(tolerance) = dyad.tolerance {
        tolerance.check().map_err(|fault| (format!("{path}.tolerance"), fault))?;
    }
    if let Some(MassPoint { mass, .. }) = dyad.mass
        && !(mass.is_finite() && (0.0..LARGEST).contains(&mass))
    {
        return Err((format!("{path}.mass"), MachineFault::Mass { frame: dyad.frame.clone(), value: mass }));
    }
    if let Some(MassPoint { centre: Vec3([x, y, z]), .. }) = dyad.mass {
        finite(&format!("{path}.centre_of_mass"), (x, y, z), "a coordinate of `centre_of_mass`")?;
    }
    let Some(joint) = &dyad.joint else { return Ok(()) };
    usable_name(&format!("{path}.joint.name"), "joint", &joint.name)?;
    unit_axis(joint.axis, &joint.name, &format!("{path}.joint.axis"))?;
    if let Some((from, to)) = joint.travel {
        number(format!("{path}.joint.travel[0]"), from, "a limit of `travel`")?;
        number(format!("{path}.joint.travel[1]"), to, "a limit of `travel`")?;
    }
    if let Some((from, to)) = joint.travel.filter(|(from, to)| from >= to) {
        let unit = units.of(joint.kind);
        let fault = MachineFault::TravelReversed {
            joint: joint.name.clone(),
            from: unit.from_si(from),
            to: unit.from_si(to),
        };
        return Err((format!("{path}.joint.travel"), fault));
    }
    if let Some(NcWord { address, sign }) = &joint.nc {
        let fits = address.starts_with(|c: char| c.is_ascii_alphabetic())
            && address.chars().all(|c| c.is_ascii_alphanumeric());
        if !fits || sign.abs() != 1 {
            let fault =
                MachineFault::NcWord { joint: joint.name.clone(), address: address.clone(), sign: *sign };
            return Err((format!("{path}.joint.nc"), fault));
        }
    }
    Ok(())
}

//! A machine as a plain list of joints: how each moves, along or about which line, and whether it carries tool or workpiece.

use std::path::Path;

use super::chain::{Chain, Entry, JointEntry, one_line};
use super::names::usable;
#[cfg(feature = "cli")]
use super::position::kind_named;
use super::position::{Positions, kind, travel};
use super::sheet::{Row, Sheet};
use super::step::Move;
use super::{Imported, machine_as};
use crate::error::{Error, Place, Result};
use crate::lie::Vec3;
use crate::machine::{Branch, FileUnits, JointKind, explained, is_usable_name};
use crate::units::{Quantity, Unit};

/// A joint of a [`Sketch`].
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq)]
pub struct SketchJoint {
    /// Its name, and that of its frame.
    pub name: String,
    /// Whether it turns or slides.
    pub kind: JointKind,
    /// Whether it carries the tool or the workpiece.
    pub branch: Branch,
    /// Unit vector along which, or about which, it moves what it carries when its number grows.
    pub direction: Vec3<f64>,
    /// A point of its axis, m; that of the joint before it where nothing is said.
    pub point: Option<Vec3<f64>>,
    /// Limits, m or rad.
    pub travel: Option<(f64, f64)>,
}

impl SketchJoint {
    /// A joint without travel.
    pub fn new(name: impl Into<String>, kind: JointKind, branch: Branch, direction: Vec3<f64>) -> Self {
        SketchJoint { name: name.into(), kind, branch, direction, point: None, travel: None }
    }
}

/// A machine as a plain list of joints. All points and directions are in one frame, that of the base, with all joints at zero.
///
/// ```
/// use kincal::import::{Sketch, SketchJoint};
/// use kincal::machine::{Branch, JointKind};
///
/// let mut sketch = Sketch::new("turntable");
/// let mut c = SketchJoint::new("c", JointKind::Revolute, Branch::Workpiece, [0.0, 0.0, 1.0].into());
/// c.point = Some([0.1, 0.0, -0.05].into());
/// sketch.joints.push(c);
/// sketch.joints.push(SketchJoint::new("z", JointKind::Prismatic, Branch::Tool, [0.0, 0.0, 1.0].into()));
/// let machine = sketch.machine()?.machine;
/// assert_eq!(machine.commands(), ["c", "z"]);
/// assert_eq!(machine.dyads()[0].placement.at.0, [0.1, 0.0, -0.05]);
/// # Ok::<(), kincal::Error>(())
/// ```
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq)]
pub struct Sketch {
    /// Name of the machine.
    pub name: String,
    /// Units of its file.
    pub units: FileUnits,
    /// Joints; those that carry the tool, and those that carry the workpiece, each from the base outwards.
    pub joints: Vec<SketchJoint>,
    /// The tool tip `t`, m.
    pub tip: Vec3<f64>,
    /// Origin of the workpiece frame `w`, m.
    pub origin: Vec3<f64>,
}

/// Names of columns.
const NAME: [&str; 2] = ["name", "joint"];
const KIND: [&str; 2] = ["kind", "type"];
const DIRECTION: [&str; 2] = ["direction", "axis"];
const CARRIES: [&str; 2] = ["carries", "carrier"];
const LOWER: [&str; 2] = ["lower", "min"];
const UPPER: [&str; 2] = ["upper", "max"];

impl Sketch {
    /// A machine without joints, in mm and deg.
    pub fn new(name: impl Into<String>) -> Self {
        let unit = |symbol, other| Unit::named(symbol).unwrap_or(other);
        let si = FileUnits::si();
        let units = FileUnits { length: unit("mm", si.length), angle: unit("deg", si.angle) };
        let zero = Vec3([0.0; 3]);
        Sketch { name: name.into(), units, joints: Vec::new(), tip: zero, origin: zero }
    }

    /// Reads a table with the columns name, kind, carries, direction, point, lower and upper; rows `t` and `w` state the tool tip and the
    /// origin of the workpiece.
    ///
    /// # Errors
    /// [`Error::Input`] with the line and column at fault.
    pub fn read(name: &str, file: impl AsRef<Path>, text: &str) -> Result<Sketch> {
        let sheet = Sheet::read(file.as_ref(), text)?;
        let mut known = vec!["point"];
        known.extend([NAME, KIND, DIRECTION, CARRIES, LOWER, UPPER].iter().flatten());
        let all = sheet.columns(&known);
        if let Some(other) = (0..sheet.headings.len()).find(|i| !all.contains(i)) {
            let what = format!("column `{}` is not known", sheet.called(other));
            let mend = "leave it out, or name it one of: name, kind, carries, direction, point, lower, upper";
            return Err(sheet.fault_of_headings(what, mend));
        }
        let needed = |names: &[&str]| -> Result<usize> {
            sheet.column(names)?.ok_or_else(|| {
                let what = format!("the table has no column `{}`", names[0]);
                let mend =
                    "give it the columns name, kind, carries, direction, point[mm], in a unit of your own";
                sheet.fault_of_headings(what, mend)
            })
        };
        let [name_at, kind_at, carries_at, direction_at] =
            [needed(&NAME)?, needed(&KIND)?, needed(&CARRIES)?, needed(&DIRECTION)?];
        let point_at = sheet.column(&["point"])?;
        let (lower, upper) = (Positions::of(&sheet, &LOWER)?, Positions::of(&sheet, &UPPER)?);
        let mut sketch = Sketch::new(name);
        if let Some(column) = point_at {
            sketch.units.length = sheet.unit(column, Quantity::Length)?;
        }
        let said =
            |row: &Row, column: usize, (what, mend): (String, &str)| sheet.fault(row, column, what, mend);
        for row in &sheet.rows {
            let name = sheet.text(row, name_at);
            let point = match point_at {
                Some(column) => point(sheet.text(row, column), sketch.units.length)
                    .map_err(|fault| said(row, column, fault))?,
                None => None,
            };
            match name {
                "t" => sketch.tip = point.unwrap_or(sketch.tip),
                "w" => sketch.origin = point.unwrap_or(sketch.origin),
                _ => {
                    let name =
                        usable_name(name, &sketch.joints).map_err(|fault| said(row, name_at, fault))?;
                    let kind = kind(&sheet, row, kind_at)?;
                    let branch =
                        branch(sheet.text(row, carries_at)).map_err(|fault| said(row, carries_at, fault))?;
                    let direction = direction(sheet.text(row, direction_at))
                        .map_err(|fault| said(row, direction_at, fault))?;
                    let mut joint = SketchJoint::new(name, kind, branch, direction);
                    joint.point = point;
                    joint.travel = travel(&sheet, row, &lower, &upper, kind)?;
                    sketch.joints.push(joint);
                }
            }
        }
        if sketch.joints.is_empty() {
            let mend = "write a row for each joint below the headings";
            return Err(sheet.fault_of_headings("the table has no joints", mend));
        }
        Ok(sketch)
    }

    /// The machine, and its file with comments that explain each field.
    ///
    /// # Errors
    /// [`Error::Input`] where there are no joints, or names that a machine file does not take.
    pub fn machine(&self) -> Result<Imported> {
        let file = Path::new("machine");
        if self.joints.is_empty() {
            return Err(Error::mistake(
                Place::file(file),
                "the machine has no joints",
                "state at least one joint",
            ));
        }
        let chain = Chain {
            name: usable(&self.name, "machine_"),
            about: one_line(&self.name),
            units: self.units,
            workpiece: self.entries(Branch::Workpiece, "w", self.origin),
            tool: self.entries(Branch::Tool, "t", self.tip),
            told: Vec::new(),
        };
        let made = "// Made by `kincal new`. All frames are parallel to the base with all joints at zero.";
        let imported = machine_as(file, made, chain)?;
        Ok(Imported { text: explained(&imported.text), ..imported })
    }

    fn entries(&self, branch: Branch, end: &str, end_b: Vec3<f64>) -> Vec<Entry> {
        let mut here = Vec3([0.0; 3]);
        let mut place = |to: Vec3<f64>| -> Vec<Move> {
            let by = to - here;
            here = to;
            Move::shifts(by).into_iter().filter(|m| !m.is_none()).collect()
        };
        let entry = |frame: &str, moves: Vec<Move>, joint: Option<JointEntry>, note: String| Entry {
            frame: frame.into(),
            moves,
            offset: None,
            joint,
            mass: None,
            steps: Vec::new(),
            note,
        };
        let mut before = Vec3([0.0; 3]);
        let mut entries = Vec::new();
        for joint in self.joints.iter().filter(|joint| joint.branch == branch) {
            before = joint.point.unwrap_or(before);
            let what = if joint.kind == JointKind::Revolute { "turns" } else { "moves" };
            let own = JointEntry {
                kind: joint.kind,
                axis: joint.direction,
                travel: joint.travel,
                follows: Vec::new(),
                nc: None,
            };
            let note = format!("{} {what} what follows", joint.name);
            entries.push(entry(&joint.name, place(before), Some(own), note));
        }
        let note = if branch == Branch::Tool { "the tool tip" } else { "the workpiece" };
        entries.push(entry(end, place(end_b), None, note.into()));
        entries
    }
}

/// What is wrong, and the mend.
pub(crate) type Wrong = (String, &'static str);

/// A name for one more joint.
pub(crate) fn usable_name(text: &str, joints: &[SketchJoint]) -> std::result::Result<String, Wrong> {
    let text = text.trim();
    if !is_usable_name(text) || text == "t" || text == "w" {
        let mend = "begin with a letter; letters, digits, `_ - .`, 64 at most; not t nor w";
        return Err((format!("`{}` is no name of a joint", crate::wording::shown(text)), mend));
    }
    match joints.iter().any(|joint| joint.name == text) {
        true => Err((format!("joint \"{text}\" stands twice"), "give one of them another name")),
        false => Ok(text.to_string()),
    }
}

/// A kind of joint.
#[cfg(feature = "cli")]
pub(crate) fn named_kind(text: &str) -> std::result::Result<JointKind, Wrong> {
    let wrong =
        || (format!("`{}` is no kind of joint", crate::wording::shown(text)), "write revolute or prismatic");
    kind_named(text).ok_or_else(wrong)
}

/// What a joint carries.
pub(crate) fn branch(text: &str) -> std::result::Result<Branch, Wrong> {
    match text.trim().to_lowercase().as_str() {
        "tool" | "t" => Ok(Branch::Tool),
        "workpiece" | "part" | "table" | "w" => Ok(Branch::Workpiece),
        other => {
            let what = format!("`{}` is nothing that a joint carries", crate::wording::shown(other));
            Err((what, "write tool or workpiece"))
        }
    }
}

/// A letter with its sign, or three numbers, as a unit vector.
pub(crate) fn direction(text: &str) -> std::result::Result<Vec3<f64>, Wrong> {
    let mend = "write one of x -x y -y z -z, or three numbers with blanks between them, such as 0 0.6 0.8";
    let wrong = || (format!("`{}` is no direction", crate::wording::shown(text)), mend);
    let word = text.trim().to_lowercase();
    let (sign, letter) = match word.strip_prefix('-') {
        Some(letter) => (-1.0, letter),
        None => (1.0, word.strip_prefix('+').unwrap_or(&word)),
    };
    if let Some(k) = ["x", "y", "z"].iter().position(|own| *own == letter) {
        return Ok(Vec3(std::array::from_fn(|i| if i == k { sign } else { 0.0 })));
    }
    let vector = three(&word).ok_or_else(wrong)?;
    let largest = vector.0.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    if largest == 0.0 {
        return Err(wrong());
    }
    let scaled = vector.times(1.0 / largest);
    Ok(scaled.times(1.0 / scaled.norm()))
}

/// Three numbers in this unit, m; nothing where there are none.
pub(crate) fn point(text: &str, unit: Unit) -> std::result::Result<Option<Vec3<f64>>, Wrong> {
    if text.trim().is_empty() {
        return Ok(None);
    }
    let mend = "write three numbers with blanks between them, such as 120 0 -85.5";
    let wrong = || (format!("`{}` is no point", crate::wording::shown(text)), mend);
    let found = three(text).ok_or_else(wrong)?;
    Ok(Some(Vec3(found.0.map(|x| unit.to_si(x)))))
}

fn three(text: &str) -> Option<Vec3<f64>> {
    let bare = text.trim().trim_start_matches('(').trim_end_matches(')');
    let parts =
        bare.split(|c: char| c == ',' || c == ';' || c.is_whitespace()).filter(|part| !part.is_empty());
    let numbers: Option<Vec<f64>> =
        parts.map(|part| part.parse().ok().filter(|x: &f64| x.abs() < 1e9)).collect();
    match numbers?[..] {
        [x, y, z] => Some(Vec3([x, y, z])),
        _ => None,
    }
}

/// Two numbers in this unit, lower first; nothing where there are none.
#[cfg(feature = "cli")]
pub(crate) fn limits(text: &str, unit: Unit) -> std::result::Result<Option<(f64, f64)>, Wrong> {
    let parts: Vec<&str> =
        text.split(|c: char| c == ',' || c.is_whitespace()).filter(|part| !part.is_empty()).collect();
    let mend = "write the lower and the upper limit with a blank between them, such as -120 30";
    match parts[..] {
        [] => Ok(None),
        [lower, upper] => match (lower.parse::<f64>(), upper.parse::<f64>()) {
            (Ok(lower), Ok(upper)) if lower < upper && lower.abs() < 1e9 && upper.abs() < 1e9 => {
                Ok(Some((unit.to_si(lower), unit.to_si(upper))))
            }
            _ => Err((format!("`{}` is no travel", crate::wording::shown(text)), mend)),
        },
        _ => Err((format!("`{}` is no travel", crate::wording::shown(text)), mend)),
    }
}

//! A machine: two lists of dyads from the base outwards, `workpiece` and `tool`.
//!
//! A dyad is the initial pose of a frame in the one before it, followed by a joint. The last frame of the workpiece list is `w`,
//! that of the tool list `t`; neither has a joint. A serial robot's workpiece list holds `w` alone. Nothing else in this crate
//! knows what kind of machine it is. `docs/machines.md` teaches the RON form.

mod dh;
mod dyad;
mod explain;
mod fault;
mod form;
mod number;
mod read;
mod shipped;
mod side;
mod write;

#[cfg(feature = "import")]
pub(crate) use dh::{DhParameters, moves as dh_moves};
pub use dyad::{Dyad, Joint, JointKind, MassPoint, NcWord, Placement, Tolerance};
pub use explain::explained;
pub use fault::MachineFault;
#[cfg(feature = "import")]
pub(crate) use form::MoveForm;
pub(crate) use form::{AngleUnit, LengthUnit, MachineForm, Triple, UnitsForm};
pub(crate) use number::{Checked, OF_CALIBRATION, number, vec_to_si};
pub(crate) use read::{at_path, is_usable_name};
#[cfg(feature = "cli")]
pub(crate) use shipped::shipped;
pub use side::SideBranch;
pub(crate) use write::{in_unit, to_text};

inner! {
    use shipped::SHIPPED;
}

use crate::error::{Error, Place, Result};
use crate::lie::Vec3;
use crate::units::Unit;

/// A fault of a machine that was built and not read: its place is the path of the value.
fn at_value((path, fault): (String, MachineFault)) -> Error {
    Error::input(Place::file(path), fault)
}

/// The units in which a machine file states its lengths and angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FileUnits {
    /// Unit of every length in the file.
    pub length: Unit,
    /// Unit of every angle in the file.
    pub angle: Unit,
}

impl FileUnits {
    /// m and rad.
    pub fn si() -> Self {
        let named = |symbol| Unit::named(symbol).expect("m and rad are units");
        FileUnits { length: named("m"), angle: named("rad") }
    }

    /// The unit of what a joint of this kind is displaced by.
    pub(crate) fn of(self, kind: JointKind) -> Unit {
        if kind == JointKind::Revolute { self.angle } else { self.length }
    }
}

/// Which of the two lists a dyad stands in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// From the base to the workpiece frame `w`.
    Workpiece,
    /// From the base to the tool frame `t`.
    Tool,
}

impl Branch {
    /// `s_j` of `docs/model.md` (11): the sign with which a deviation of this branch enters the error of the tool seen from the workpiece.
    pub fn sign(self) -> f64 {
        match self {
            Branch::Workpiece => -1.0,
            Branch::Tool => 1.0,
        }
    }

    /// The field of the machine file.
    pub fn field(self) -> &'static str {
        match self {
            Branch::Workpiece => "workpiece",
            Branch::Tool => "tool",
        }
    }
}

/// A joint displacement as a sum over commands, `docs/model.md` (9).
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Pairs of command index and factor (m or rad of this joint per m or rad of that command).
    pub terms: Vec<(usize, f64)>,
}

/// A validated machine. Lengths in m, angles in rad.
///
/// ```
/// let machine = kincal::Machine::parse(
///     "column.ron",
///     r#"Machine(
///         name: "column", units: (length: mm, angle: deg),
///         workpiece: [(frame: "w")],
///         tool: [(frame: "z", joint: Prismatic(axis: "z")), (frame: "t", at: (0, 0, 120))],
///     )"#,
/// )?;
/// assert_eq!(machine.commands(), ["z"]);
/// assert_eq!(machine.dyads().len(), 3);
/// # Ok::<(), kincal::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    name: String,
    about: Option<String>,
    units: FileUnits,
    gravity_b: Vec3<f64>,
    tolerance: Tolerance,
    dyads: Vec<Dyad>,
    workpiece_count: usize,
    commands: Vec<String>,
    /// Index of the dyad of each command's joint.
    command_dyads: Vec<usize>,
    drives: Vec<Option<Drive>>,
    side_branches: Vec<SideBranch>,
}

impl Machine {
    /// Builds and checks a machine; `units` are those in which it is written to a file.
    ///
    /// ```
    /// use kincal::machine::{Dyad, FileUnits, Joint, Machine};
    ///
    /// let slide = Dyad::new("x").with_joint(Joint::prismatic("x", [1.0, 0.0, 0.0]));
    /// let tool = vec![slide, Dyad::new("t").at([0.0, 0.0, 0.08])];
    /// let machine = Machine::new("slide", FileUnits::si(), vec![Dyad::new("w")], tool)?;
    /// assert_eq!(machine.commands(), ["x"]);
    /// # Ok::<(), kincal::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Input`] with a [`MachineFault`]; its place is the path of the value at fault, such as
    /// `tool[2].joint.axis`.
    pub fn new(
        name: impl Into<String>,
        units: FileUnits,
        workpiece: Vec<Dyad>,
        tool: Vec<Dyad>,
    ) -> Result<Self> {
        Machine::of_dyads(name, units, workpiece, tool).map_err(at_value)
    }

    fn of_dyads(
        name: impl Into<String>,
        units: FileUnits,
        workpiece: Vec<Dyad>,
        tool: Vec<Dyad>,
    ) -> Checked<Self> {
        let workpiece_count = workpiece.len();
        let dyads = workpiece.into_iter().chain(tool).collect();
        let mut machine = Machine {
            name: name.into(),
            about: None,
            units,
            gravity_b: Vec3([0.0, 0.0, -1.0]),
            tolerance: Tolerance::DEFAULT,
            dyads,
            workpiece_count,
            commands: Vec::new(),
            command_dyads: Vec::new(),
            drives: Vec::new(),
            side_branches: Vec::new(),
        };
        machine.check()?;
        Ok(machine)
    }

    /// The same machine with another direction of gravity in the base frame (need not have unit length).
    ///
    /// # Errors
    /// If the vector is zero or not finite.
    pub fn with_gravity(self, gravity_b: Vec3<f64>) -> Result<Self> {
        self.hanging(gravity_b).map_err(at_value)
    }

    fn hanging(mut self, gravity_b: Vec3<f64>) -> Checked<Self> {
        let length = gravity_b.norm();
        if !(length.is_finite() && length > 1e-9) {
            return Err(("gravity".into(), MachineFault::ZeroVector { what: "direction of gravity".into() }));
        }
        // A vector that is a unit vector already keeps its bits.
        self.gravity_b =
            if (length - 1.0).abs() < 1e-15 { gravity_b } else { gravity_b.times(length.recip()) };
        Ok(self)
    }

    /// The same machine with file-wide tolerances for dyads that state none.
    ///
    /// # Errors
    /// If one of them is not positive and finite.
    pub fn with_tolerance(self, tolerance: Tolerance) -> Result<Self> {
        self.tolerant(tolerance).map_err(at_value)
    }

    fn tolerant(mut self, tolerance: Tolerance) -> Checked<Self> {
        tolerance.check().map_err(|fault| ("tolerance".to_string(), fault))?;
        self.tolerance = tolerance;
        Ok(self)
    }

    /// The same machine with a line that says what it is.
    #[must_use]
    pub fn with_about(mut self, about: Option<String>) -> Self {
        self.about = about;
        self
    }

    /// Name, as in `# machine:` of a recording.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// A line that says what the machine is.
    pub fn about(&self) -> Option<&str> {
        self.about.as_deref()
    }

    /// Units of the file.
    pub fn units(&self) -> FileUnits {
        self.units
    }

    /// Direction of gravity in the base frame, unit vector.
    pub fn gravity_b(&self) -> Vec3<f64> {
        self.gravity_b
    }

    /// All dyads in machine order: the workpiece list, then the tool list, each from the base outwards.
    pub fn dyads(&self) -> &[Dyad] {
        &self.dyads
    }

    /// The branch that dyad `j` of [`Machine::dyads`] stands in.
    pub fn branch(&self, j: usize) -> Branch {
        if j < self.workpiece_count { Branch::Workpiece } else { Branch::Tool }
    }

    /// How many dyads the workpiece list has.
    pub fn workpiece_count(&self) -> usize {
        self.workpiece_count
    }

    /// Index of frame `w` among [`Machine::dyads`].
    pub fn w_index(&self) -> usize {
        self.workpiece_count - 1
    }

    /// Index of frame `t` among [`Machine::dyads`].
    pub fn t_index(&self) -> usize {
        self.dyads.len() - 1
    }

    /// Index of the dyad of this frame.
    pub fn frame_index(&self, frame: &str) -> Option<usize> {
        self.dyads.iter().position(|d| d.frame == frame)
    }

    /// Names of the commands, in machine order: every joint but those that only follow others.
    pub fn commands(&self) -> &[String] {
        &self.commands
    }

    /// The joint that a command moves (itself; others may follow it), by index of [`Machine::commands`].
    pub fn command_joint(&self, command: usize) -> &Joint {
        self.dyads[self.command_dyads[command]].joint.as_ref().expect("every command is a joint's name")
    }

    /// How the displacement of dyad `j`'s joint follows from the commands; `None` for a frame without joint.
    pub fn drive(&self, j: usize) -> Option<&Drive> {
        self.drives[j].as_ref()
    }

    /// Joints with the index of their dyad, machine order; those that only follow others included.
    pub fn joints(&self) -> impl Iterator<Item = (usize, &Joint)> {
        self.dyads.iter().enumerate().filter_map(|(j, d)| d.joint.as_ref().map(|joint| (j, joint)))
    }

    /// Tolerance (prior standard deviation) of dyad `j`: its own or the file's.
    pub fn tolerance(&self, j: usize) -> Tolerance {
        self.dyads[j].tolerance.unwrap_or(self.tolerance)
    }

    /// The file-wide tolerance.
    pub fn default_tolerance(&self) -> Tolerance {
        self.tolerance
    }

    /// Displacements of all dyads (0 where there is no joint) for a vector of commands, m or rad.
    pub fn displacements(&self, commands: &[f64]) -> Vec<f64> {
        let sum = |d: &Drive| d.terms.iter().map(|(c, f)| f * commands[*c]).sum();
        self.drives.iter().map(|drive| drive.as_ref().map_or(0.0, sum)).collect()
    }

    /// Limits of command `c` in m or rad; infinite where the file states none.
    pub fn travel(&self, command: usize) -> (f64, f64) {
        self.command_joint(command).travel.unwrap_or((f64::NEG_INFINITY, f64::INFINITY))
    }
}

//! A recording from arrays: what a program has measured itself, without a file.

use std::fmt::Write;

use super::{Recording, RecordingFault};
use crate::error::{Error, Place, Result};
use crate::lie::{Pose, Vec3};
use crate::machine::{JointKind, Machine};

/// Readings with the commands that go with them, m, rad and s throughout. One sample is one entry of every array; NaN in a reading is a
/// drop-out.
///
/// ```
/// use kincal::Machine;
/// use kincal::recording::Arrays;
///
/// let machine = Machine::parse("slide.ron", r#"Machine(
///     name: "slide", units: (length: mm, angle: deg),
///     workpiece: [(frame: "w")],
///     tool: [(frame: "x", joint: Prismatic(axis: "x")), (frame: "t", at: (0, 0, 80))],
/// )"#)?;
/// let recording = Arrays::position(&[[0.0, 0.0, 0.08], [0.1, 0.0, 0.07999]])
///     .command("x", &[0.0, 0.1])
///     .sigma(2e-6)
///     .recording("tracker", &machine)?;
/// assert_eq!(recording.value_count(), 3);
/// # Ok::<(), kincal::Error>(())
/// ```
#[derive(Clone, Debug)]
#[must_use]
pub struct Arrays {
    /// Lines of the head.
    head: Vec<String>,
    /// Names of columns with their units, and their values.
    columns: Vec<(String, Vec<f64>)>,
    /// Joints, by name: their units depend on the machine.
    joints: Vec<(String, Vec<f64>)>,
    /// The joint that was measured, and its standard uncertainty.
    measured_joint: Option<(String, Vec<f64>)>,
    sigma: Option<f64>,
}

impl Arrays {
    fn new(measurement: &str) -> Self {
        Arrays {
            head: vec![format!("measurement: {measurement}")],
            columns: Vec::new(),
            joints: Vec::new(),
            measured_joint: None,
            sigma: None,
        }
    }

    fn with(mut self, name: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        self.columns.push((name.into(), values.into_iter().collect()));
        self
    }

    fn line(mut self, line: String) -> Self {
        self.head.push(line);
        self
    }

    /// Positions of the measured point in frame `w`, m.
    pub fn position(p_w: &[[f64; 3]]) -> Self {
        (0..3).fold(Arrays::new("position"), |arrays, k| {
            arrays.with(["px[m]", "py[m]", "pz[m]"][k], p_w.iter().map(|p| p[k]))
        })
    }

    /// Poses of frame `t` in frame `w`.
    pub fn pose(w_from_t: &[Pose<f64>]) -> Self {
        let positions: Vec<[f64; 3]> = w_from_t.iter().map(|pose| pose.translation.0).collect();
        let turns: Vec<[f64; 3]> = w_from_t.iter().map(|pose| pose.rotation_vector().0).collect();
        let mut arrays = Arrays::position(&positions);
        arrays.head = vec!["measurement: pose".into()];
        (0..3).fold(arrays, |arrays, k| {
            arrays.with(["rx[rad]", "ry[rad]", "rz[rad]"][k], turns.iter().map(|turn| turn[k]))
        })
    }

    /// Distances of the measured point from the workpiece point less a nominal length, both in m: a ballbar.
    pub fn distance(d: &[f64], nominal_length: f64) -> Self {
        Arrays::new("distance")
            .with("d[m]", d.iter().copied())
            .line(format!("nominal_length[m]: {nominal_length:?}"))
    }

    /// The same of a bar whose length is found with the rest.
    pub fn distance_of_unknown_length(d: &[f64]) -> Self {
        Arrays::new("distance").with("d[m]", d.iter().copied()).line("nominal_length: unknown".into())
    }

    /// Distances of the measured point from the workpiece point, m: a draw-wire, a laser tracer.
    pub fn absolute_distance(r: &[f64]) -> Self {
        Arrays::new("distance").with("r[m]", r.iter().copied())
    }

    /// Movements of the measured point along a direction of frame `w`, m.
    pub fn displacement(s: &[f64], direction_w: Vec3<f64>) -> Self {
        let [x, y, z] = direction_w.0;
        Arrays::new("displacement")
            .with("s[m]", s.iter().copied())
            .line(format!("direction: {x:?},{y:?},{z:?}"))
    }

    /// What a reference says of one joint, m or rad.
    pub fn joint(joint: &str, measured: &[f64]) -> Self {
        Arrays { measured_joint: Some((joint.into(), measured.to_vec())), ..Arrays::new("joint") }
    }

    /// Commanded displacements of a joint, m or rad.
    pub fn command(mut self, joint: &str, q: &[f64]) -> Self {
        self.joints.push((joint.into(), q.to_vec()));
        self
    }

    /// Times on the one clock of all recordings of a call, s.
    pub fn time(self, t: &[f64]) -> Self {
        self.with("t[s]", t.iter().copied())
    }

    /// From which side a joint came to settled positions: -1, 0 or 1.
    pub fn direction(self, joint: &str, directions: &[i8]) -> Self {
        self.with(format!("{joint}_direction[1]"), directions.iter().map(|d| f64::from(*d)))
    }

    /// A further channel that effects may use, in a unit that recordings know, such as `degC`.
    pub fn channel(self, name: &str, unit: &str, values: &[f64]) -> Self {
        self.with(format!("{name}[{unit}]"), values.iter().copied())
    }

    /// The set-up: recordings of one set-up share frame `w` and what is unknown of it.
    pub fn set_up(self, name: &str) -> Self {
        self.line(format!("setup: {name}"))
    }

    /// The name of the instrument, which reports tell.
    pub fn instrument(self, name: &str) -> Self {
        self.line(format!("instrument: {name}"))
    }

    /// The measured point in frame `t`, m; its origin unless told otherwise.
    pub fn tool_point(self, p_t: Vec3<f64>) -> Self {
        let [x, y, z] = p_t.0;
        self.line(format!("tool_point[m]: {x:?},{y:?},{z:?}"))
    }

    /// The measured point is found with the rest, and shared by recordings that give the same name.
    pub fn unknown_tool_point(self, name: &str) -> Self {
        self.line(format!("tool_point: unknown {name}"))
    }

    /// How the target of a pose is turned in frame `t` is found with the rest, and shared by recordings that give the same name.
    pub fn unknown_tool_rotation(self, name: &str) -> Self {
        self.line(format!("tool_rotation: unknown {name}"))
    }

    /// The fixed point in frame `w`, m; its origin unless told otherwise.
    pub fn workpiece_point(self, p_w: Vec3<f64>) -> Self {
        let [x, y, z] = p_w.0;
        self.line(format!("workpiece_point[m]: {x:?},{y:?},{z:?}"))
    }

    /// The direction of gravity in frame `w`, where it is not the machine file's.
    pub fn gravity(self, gravity_w: Vec3<f64>) -> Self {
        let [x, y, z] = gravity_w.0;
        self.line(format!("gravity[w]: {x:?},{y:?},{z:?}"))
    }

    /// Frame `w` is found from nothing.
    pub fn unknown_workpiece_frame(self) -> Self {
        self.line("workpiece_frame: unknown".into())
    }

    /// The zero of the reference is arbitrary.
    pub fn unknown_zero(self) -> Self {
        self.line("zero: unknown".into())
    }

    /// Standard uncertainty of one reading, in the unit of what was measured, m or rad; of a pose, of its position.
    pub fn sigma(mut self, sigma: f64) -> Self {
        self.sigma = Some(sigma);
        self
    }

    /// The recording; `name` stands for it in messages and results.
    ///
    /// # Errors
    /// As [`Recording::open`]; lines and columns are those of the same recording as a file. [`RecordingFault::UnequalArrays`] where one
    /// array is shorter than another.
    pub fn recording(&self, name: &str, machine: &Machine) -> Result<Recording> {
        let named = |joint: &str| machine.joints().map(|(_, own)| own).find(|own| own.name == joint);
        let kind = |joint: &str| named(joint).or_else(|| machine.side_joint(joint)).map(|own| own.kind);
        let unit = |joint: &str| if kind(joint) == Some(JointKind::Revolute) { "rad" } else { "m" };
        let joints = self.joints.iter().chain(&self.measured_joint).map(|(joint, _)| joint);
        if let Some(joint) = joints.into_iter().find(|joint| kind(joint).is_none()) {
            let what = format!("joint \"{joint}\" is none of machine \"{}\"", machine.name());
            let mend = format!("name one of: {}", machine.commands().join(", "));
            return Err(Error::mistake(Place::file(name), what, mend));
        }
        let mut columns: Vec<(String, &[f64])> = Vec::new();
        columns.extend(self.joints.iter().map(|(joint, q)| (format!("{joint}[{}]", unit(joint)), &q[..])));
        let measured = self.measured_joint.iter();
        columns.extend(measured.map(|(joint, q)| (format!("{joint}_meas[{}]", unit(joint)), &q[..])));
        columns.extend(self.columns.iter().map(|(name, values)| (name.clone(), &values[..])));
        let names = columns.iter().map(|(name, _)| (name, &[',', '"', '\n', '\r'][..]));
        let lines = self.head.iter().map(|line| (line, &['\n', '\r'][..]));
        if let Some((text, _)) = names.chain(lines).find(|(text, breaks)| text.contains(*breaks)) {
            let what = format!("{text:?} has a comma, a quotation mark or a line break in a name");
            return Err(Error::mistake(Place::file(name), what, "give it a name without"));
        }
        let samples = columns.first().map_or(0, |(_, values)| values.len());
        if let Some((column, values)) = columns.iter().find(|(_, values)| values.len() != samples) {
            let (column, first) = (column.clone(), columns[0].0.clone());
            let fault = RecordingFault::UnequalArrays { column, values: values.len(), first, samples };
            return Err(Error::input(Place::file(name), fault));
        }
        let mut text = String::new();
        for line in &self.head {
            let _ = writeln!(text, "# {line}");
        }
        if let Some(sigma) = self.sigma {
            let unit = self.measured_joint.as_ref().map_or("m", |(joint, _)| unit(joint));
            let _ = writeln!(text, "# sigma[{unit}]: {sigma:?}");
        }
        let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        let _ = writeln!(text, "{}", names.join(","));
        for k in 0..samples {
            // The shortest decimals that are read as the same number.
            let row: Vec<String> = columns.iter().map(|(_, values)| format!("{:?}", values[k])).collect();
            let _ = writeln!(text, "{}", row.join(","));
        }
        Recording::from_bytes(name, text.into_bytes(), machine)
    }
}

//! Commands that bring the tool to poses.

use kincal::inverse::{Goal, Inverse, InverseOptions, Mode, Outcome};
use kincal::lie::{Mat3, Pose, Vec3};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::told;
use crate::machine::{Machine, floats};

/// The largest joint position, m or rad, as of recordings.
const FARTHEST: f64 = 1e9;
/// How far a rotation matrix may be from one: rounding of seven digits.
const ROUNDING: f64 = 1e-6;

/// Poses of one 4x4 matrix or of many.
fn poses(values: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<Pose<f64>>> {
    let py = values.py();
    let array = floats(values)?;
    let array = array.as_array();
    if !matches!(array.shape(), [4, 4] | [_, 4, 4]) {
        let text = format!("{what} has the shape {:?}", array.shape());
        return Err(told(py, text, "give homogeneous matrices, an array of shape (samples, 4, 4)"));
    }
    let numbers: Vec<f64> = array.iter().copied().collect();
    let pose = |(k, m): (usize, &[f64])| {
        let row = |i: usize| [m[4 * i], m[4 * i + 1], m[4 * i + 2]];
        let rotation = Mat3([row(0), row(1), row(2)]);
        let [a, b, c] = [0, 1, 2].map(|j| rotation.column(j));
        let off = [
            a.dot(a) - 1.0,
            b.dot(b) - 1.0,
            c.dot(c) - 1.0,
            a.dot(b),
            b.dot(c),
            c.dot(a),
            a.cross(b).dot(c) - 1.0,
            m[12],
            m[13],
            m[14],
            m[15] - 1.0,
        ];
        let is_finite = m.iter().all(|value| value.is_finite());
        if !is_finite || off.iter().any(|size| size.abs() > ROUNDING) {
            let text = format!("{what} {k} is no homogeneous matrix");
            let mend = "its first three columns are a rotation, the last row is 0, 0, 0, 1, lengths are in m";
            return Err(told(py, text, mend));
        }
        Ok(Pose { rotation, translation: Vec3([m[3], m[7], m[11]]) })
    };
    numbers.chunks_exact(16).enumerate().map(pose).collect()
}

/// Commands that bring the tool to poses.
#[pyfunction]
#[pyo3(signature = (machine, poses, start = None, *, free = None, mode = None, tip = None, within_travel = true))]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
pub fn inverse<'py>(
    py: Python<'py>,
    machine: &Machine,
    poses: &Bound<'py, PyAny>,
    start: Option<&Bound<'py, PyAny>>,
    free: Option<Vec<String>>,
    mode: Option<&str>,
    tip: Option<&Bound<'py, PyAny>>,
    within_travel: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let names = machine.names();
    let goals = self::poses(poses, "pose")?;
    let t_from_tip = match tip.map(|tip| self::poses(tip, "tip")).transpose()?.as_deref() {
        None => Pose::identity(0.0),
        Some([tip]) => *tip,
        Some(tips) => {
            return Err(told(
                py,
                format!("{} tips are given", tips.len()),
                "give one, an array of shape (4, 4)",
            ));
        }
    };
    let starts = match start {
        Some(start) => machine.rows(start)?,
        None => vec![vec![0.0; names.len()]],
    };
    if starts.len() != 1 && starts.len() != goals.len() {
        let what = format!("starts: {}, poses: {}", starts.len(), goals.len());
        return Err(told(py, what, "give one start for each pose, or one for the first"));
    }
    if !starts.iter().flatten().all(|value| value.abs() <= FARTHEST) {
        return Err(told(py, "a start is no number below 1e9", "give joint positions in m and rad"));
    }
    if let Some(other) = free.iter().flatten().find(|name| !names.contains(name)) {
        let what = format!("\"{other}\" is no joint of machine \"{}\"", machine.calibrated.machine().name());
        return Err(told(py, what, format!("name some of: {}", names.join(", "))));
    }
    let is_free: Vec<bool> =
        names.iter().map(|name| free.as_ref().is_none_or(|free| free.contains(name))).collect();
    let options = InverseOptions::default().with_within_travel(within_travel);
    let mut inverse = Inverse::new(machine.calibrated.machine()).with_options(options);
    if let Some(mode) = mode {
        inverse = inverse.with_mode(match mode {
            "position" => Mode::Position,
            "axis" => Mode::Axis,
            "position and axis" => Mode::PositionAndAxis,
            "pose" => Mode::Pose,
            other => {
                let mend = "write one of: position, axis, position and axis, pose";
                return Err(told(py, format!("mode {other:?} is not known"), mend));
            }
        });
    }
    let solutions = py.detach(|| {
        let chain = machine.calibrated.chain();
        let mut last = starts[0].clone();
        let solve = |(k, w_from_tip): (usize, &Pose<f64>)| {
            let start = if starts.len() > 1 { &starts[k] } else { &last };
            let goal = Goal { t_from_tip, w_from_tip: *w_from_tip };
            let found = inverse.solve(&chain, &goal, start, &is_free);
            last.clone_from(&found.commands);
            found
        };
        goals.iter().enumerate().map(solve).collect::<Vec<_>>()
    });
    let result = PyDict::new(py);
    let flat = solutions.iter().flat_map(|found| found.commands.iter().copied()).collect();
    result.set_item("commands", PyArray1::from_vec(py, flat).reshape([solutions.len(), names.len()])?)?;
    let reached = solutions.iter().map(|found| found.outcome == Outcome::Reached).collect();
    result.set_item("reached", PyArray1::from_vec(py, reached))?;
    let outcomes: Vec<String> = solutions.iter().map(|found| in_words(&found.outcome, machine)).collect();
    result.set_item("outcome", outcomes)?;
    let position = solutions.iter().map(|found| found.position_left_m).collect();
    result.set_item("position_left_m", PyArray1::from_vec(py, position))?;
    let angle = solutions.iter().map(|found| found.angle_left_rad).collect();
    result.set_item("angle_left_rad", PyArray1::from_vec(py, angle))?;
    Ok(result)
}

/// How it ended.
fn in_words(outcome: &Outcome, machine: &Machine) -> String {
    match outcome {
        Outcome::Reached => "reached".into(),
        Outcome::OutOfTravel { command, by } => {
            let kind = machine.calibrated.machine().command_joint(*command).kind;
            let unit = if kind == kincal::machine::JointKind::Revolute { "rad" } else { "m" };
            format!("{} would have to go {by:.6} {unit} beyond its travel", machine.names()[*command])
        }
        Outcome::Singular { .. } => "singular: the joints have lost a direction here".into(),
        _ => "unreachable from this start".into(),
    }
}

//! The recording as it is written back: every row as it was, model and residual behind it.

use std::io::Write;

use crate::decimal;
use crate::lie::{Pose, Twist, Vec3};
use crate::recording::{Recording, Role};
use crate::sensor::Sensor;
use crate::units::Unit;

/// Digits behind the point of a model's number and of a residual.
const OF_MODEL: usize = 12;
const OF_RESIDUAL: usize = 6;

/// A measured column: its name and unit as written.
struct Measured {
    name: String,
    unit: Unit,
}

/// What is written behind the rows of a recording.
pub(super) struct Table<'a> {
    recording: &'a Recording,
    sensor: &'a Sensor,
    columns: Vec<Measured>,
    /// Of a sample left out.
    empty: String,
}

impl<'a> Table<'a> {
    pub fn new(recording: &'a Recording, sensor: &'a Sensor) -> Self {
        let columns = measured_columns(recording);
        let empty = ",".repeat(2 * columns.len());
        Table { recording, sensor, columns, empty }
    }

    /// Comments and column names.
    pub fn write_head(&self, out: &mut dyn Write) -> std::io::Result<()> {
        write!(out, "{}", self.recording.preamble().trim_end_matches(['\r', '\n']))?;
        for Measured { name, unit } in &self.columns {
            write!(out, ",{name}_model[{unit}],{name}_residual[{unit}]")?;
        }
        writeln!(out)
    }

    /// Bytes that a row takes up behind what it is written in, at most.
    pub fn width(&self) -> usize {
        // Comma, sign, digits, point and exponent.
        2 + self.columns.len() * (OF_MODEL + OF_RESIDUAL + 18)
    }

    /// Appends a drop-out.
    pub fn push_dropped(&self, row: &str, text: &mut Vec<u8>) {
        text.extend_from_slice(row.as_bytes());
        text.extend_from_slice(self.empty.as_bytes());
        text.push(b'\n');
    }

    /// Appends a row, with `,model,residual` of every measured column.
    pub fn push(&self, row: &str, measured: &[f64], residuals: &[f64], text: &mut Vec<u8>) {
        text.extend_from_slice(row.as_bytes());
        for (i, column) in self.columns.iter().enumerate().take(residuals.len().min(3)) {
            column.push(measured[i] - residuals[i], residuals[i], text);
        }
        if matches!(self.sensor, Sensor::Pose) {
            self.push_rotation(row, measured, residuals, text);
        }
        text.push(b'\n');
    }

    /// `R_model = exp(φ)⁻¹ R_measured`, in the form in which it was measured.
    fn push_rotation(&self, row: &str, measured: &[f64], residuals: &[f64], text: &mut Vec<u8>) {
        let turn = |x: &[f64]| Pose::exp(Twist::new(Vec3([0.0; 3]), Vec3([x[0], x[1], x[2]])));
        let seen = turn(&measured[3..6]);
        let model = turn(&residuals[3..6]).inverse() * seen;
        if self.columns.len() == 7 {
            // A rotation has two quaternions: the model's is the one next to what was written.
            let seen = self.as_written(row, quaternion(seen));
            let model = quaternion(model);
            let near = if (0..4).map(|i| model[i] * seen[i]).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
            for i in 0..4 {
                self.columns[3 + i].push(near * model[i], seen[i] - near * model[i], text);
            }
        } else {
            let vector = model.rotation_vector();
            for i in 0..3 {
                self.columns[3 + i].push(vector.0[i], residuals[3 + i], text);
            }
        }
    }

    /// A measured quaternion with the sign with which the row has it.
    fn as_written(&self, row: &str, seen: [f64; 4]) -> [f64; 4] {
        let of = |i: usize| self.recording.columns().iter().position(|c| c.role == Role::Value(i));
        let largest = (0..4).max_by(|a, b| seen[*a].abs().total_cmp(&seen[*b].abs())).unwrap_or(0);
        let written = of(3 + largest).and_then(|column| row.split(',').nth(column));
        let written = written.and_then(|cell| cell.trim().trim_matches('"').trim().parse::<f64>().ok());
        if written.is_some_and(|x| x * seen[largest] < 0.0) { seen.map(|c| -c) } else { seen }
    }
}

impl Measured {
    fn push(&self, model: f64, residual: f64, text: &mut Vec<u8>) {
        text.push(b',');
        decimal::push(text, self.unit.from_si(model), OF_MODEL);
        text.push(b',');
        decimal::push(text, self.unit.from_si(residual), OF_RESIDUAL);
    }
}

fn measured_columns(recording: &Recording) -> Vec<Measured> {
    let measured = recording.columns().iter().filter(|c| matches!(c.role, Role::Value(_)));
    let mut columns: Vec<_> = measured.collect();
    columns.sort_by_key(|c| match c.role {
        Role::Value(i) => i,
        _ => usize::MAX,
    });
    columns.into_iter().map(|c| Measured { name: c.name.clone(), unit: c.unit }).collect()
}

fn quaternion(pose: Pose<f64>) -> [f64; 4] {
    let q = nalgebra::Isometry3::from(pose).rotation;
    [q.w, q.i, q.j, q.k]
}

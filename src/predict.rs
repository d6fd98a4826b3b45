//! What a calibrated machine says an instrument would read, sample by sample.

use std::io::Write;

use serde::{Deserialize, Serialize};

use crate::calibration::{CalibratedMachine, LeftOut};
use crate::chain::Chain;
use crate::error::{Error, Result};
use crate::feature::gravity_of;
use crate::identify::{Beginning, Evaluator, Memories, Moment, Stretch, Values, channel, stretches};
use crate::lie::{Mat3, Pose, Twist, Vec3};
use crate::machine::{JointKind, Machine};
use crate::recording::{Header, NominalLength, Recording, Role, ToolPoint};
use crate::residual::Sizes;
use crate::sensor::{Sensor, SensorState};
use crate::units::{ByQuantity, Rms, Unit, field_by_quantity};

field_by_quantity!(rms, max, mean, mean_abs);

/// Residuals of a recording under a model, SI. Angles stand beside or instead of lengths.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Prediction {
    /// Samples predicted.
    pub samples: u64,
    /// Rows left out because a number was missing.
    pub dropped: u64,
    /// Root mean square of the residual's norm; of a pose, position and rotation apart.
    #[serde(flatten, with = "rms")]
    pub rms: Rms,
    /// Largest norm.
    #[serde(flatten, with = "max")]
    pub max: Rms,
    /// Mean: signed for scalars, of the norm for vectors.
    #[serde(flatten, with = "mean")]
    pub mean: Rms,
    /// Mean of the norm; of a `distance` the mean radial error.
    #[serde(flatten, with = "mean_abs")]
    pub mean_abs: Rms,
    /// Samples at which a joint leaves the range that the calibration has seen.
    pub extrapolated_samples: u64,
    /// By how much each joint leaves it at most.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub beyond: Vec<Beyond>,
    /// Samples with a pattern of directions of travel that the calibration has not seen; they are predicted from what single
    /// directions have shown.
    pub unseen_directions: u64,
    /// Effects of the calibrated file that this recording cannot use.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
    /// The names of those patterns, such as `AFCR`; `0` is an axis that never moves.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unseen_pieces: Vec<String>,
}

/// By how much a joint leaves the range that the calibration has seen.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Beyond {
    /// Its name.
    pub joint: String,
    /// The largest amount, m or rad.
    pub by: f64,
    /// Unit of the amount, `m` or `rad`.
    pub unit: String,
}

/// Model and residual of every sample of a recording; each row goes to `out` as CSV if one is given.
///
/// A row has the input's columns as they were, then for each measured column `NAME_model[unit]` and `NAME_residual[unit]`
/// (measured minus model; of a rotation the rotation vector that is missing). A drop-out keeps its row, those cells empty.
///
/// # Errors
/// If the recording cannot be read, or belongs to a set-up that the calibration does not know ([`crate::identify::fit_setup`]
/// finds it).
pub fn predict(
    calibrated: &CalibratedMachine,
    recording: &Recording,
    mut out: Option<&mut dyn Write>,
) -> Result<Prediction> {
    let machine = calibrated.machine();
    let header = recording.header();
    let sensor = Sensor::of(header);
    let state = sensor_state(calibrated, header, &sensor)?;
    let (previous_from_w, dh) = frame_of_w(calibrated, header, &sensor)?;
    let (variation, left_out) = calibrated.variation_in(std::slice::from_ref(recording));
    let values = Values {
        directions: variation.varying.directions.as_ref(),
        parts: &variation.parts,
        terms: &variation.varying.terms,
        coefficients: &variation.coefficients,
        motions: &variation.motions,
    };
    let evaluator = Evaluator::with(machine, &sensor, state, previous_from_w, &dh, values);
    let varying = &variation.varying;
    let dead_bands = &variation.dead_bands;
    let beginning = if varying.is_constant() {
        None
    } else {
        let mut beginning = Beginning::of(recording, machine, varying, dead_bands)?;
        let w = previous_from_w * Pose::exp(dh[machine.w_index()]);
        beginning.gravity_b = gravity_of(recording, machine, Some(w));
        Some(beginning)
    };
    let pause_after = if varying.is_constant() { None } else { recording.scan()?.pause_after };
    let mut memories = Memories::new(varying);
    let mut path = Path::new(stretches(
        recording,
        machine,
        varying,
        dead_bands,
        beginning.as_ref(),
        pause_after,
        &mut memories,
    )?);
    let columns = measured_columns(recording);
    let failed = |e| Error::file(recording.path(), e);
    if let Some(out) = &mut out {
        write_head(*out, recording, &columns).map_err(failed)?;
    }
    let mut work = evaluator.workspace();
    let mut sizes = ByQuantity::<Sizes>::default();
    let (mut dropped, mut extrapolated) = (0, 0);
    let mut unseen = vec![0u64; evaluator.piece_count()];
    let mut farthest = vec![0.0f64; machine.commands().len()];
    let (commands, values) = (machine.commands().len(), recording.value_count());
    for block in recording.rows_with_text()? {
        let block = block?;
        for row in block.rows() {
            let mut tail = ",".repeat(2 * columns.len());
            if let Some(k) = row.sample {
                let q = &block.chunk.commands[k * commands..(k + 1) * commands];
                let measured = &block.chunk.values[k * values..(k + 1) * values];
                let mut leaves = false;
                for (command, farthest) in farthest.iter_mut().enumerate() {
                    if let Some(by) = calibrated.beyond(command, q[command]) {
                        *farthest = by.max(*farthest);
                        leaves = true;
                    }
                }
                extrapolated += u64::from(leaves);
                let moment = if varying.is_constant() { Moment::Still } else { path.next()? };
                let piece = evaluator.piece(moment);
                unseen[piece] += u64::from(!variation.has_seen(piece));
                let residuals = evaluator.residuals(q, measured, moment, &mut work, None);
                let residuals = &residuals[..sensor.reading_count()];
                match &sensor {
                    Sensor::Pose => {
                        sizes.m.take(&residuals[..3]);
                        sizes.rad.take(&residuals[3..]);
                    }
                    Sensor::Joint { dyad } if is_revolute(machine, *dyad) => sizes.rad.take(residuals),
                    _ => sizes.m.take(residuals),
                }
                if out.is_some() {
                    let sign = quaternion_sign(recording, row.text, measured, &sensor);
                    tail = cells(&columns, measured, residuals, &sensor, sign);
                }
            }
            if let Some(out) = &mut out {
                writeln!(out, "{}{tail}", row.text).map_err(failed)?;
            }
        }
        dropped += block.chunk.dropped;
    }
    Ok(Prediction {
        samples: sizes.samples(),
        dropped,
        rms: sizes.rms(),
        max: sizes.largest(),
        mean: sizes.mean_signed(),
        mean_abs: sizes.mean(),
        extrapolated_samples: extrapolated,
        beyond: (machine.commands().iter().zip(&farthest).enumerate())
            .filter(|(_, (_, by))| **by > 0.0)
            .map(|(c, (joint, by))| Beyond {
                joint: joint.clone(),
                by: *by,
                unit: if machine.command_joint(c).kind == JointKind::Revolute { "rad" } else { "m" }.into(),
            })
            .collect(),
        unseen_directions: unseen.iter().sum(),
        left_out,
        unseen_pieces: match &variation.varying.directions {
            Some(directions) => {
                let pieces = unseen.iter().enumerate().filter(|(_, n)| **n > 0);
                pieces.map(|(piece, _)| directions.name(machine, piece)).collect()
            }
            None => Vec::new(),
        },
    })
}

fn is_revolute(machine: &Machine, dyad: usize) -> bool {
    machine.dyads()[dyad].joint.as_ref().is_some_and(|j| j.kind == JointKind::Revolute)
}

/// A second pass beside the rows, sample by sample, where the model depends on the path.
struct Path<'a> {
    stretches: Box<dyn Iterator<Item = Result<Stretch>> + 'a>,
    now: Option<Stretch>,
    at: usize,
}

impl<'a> Path<'a> {
    fn new(stretches: Box<dyn Iterator<Item = Result<Stretch>> + 'a>) -> Self {
        Path { stretches, now: None, at: 0 }
    }

    /// The next sample.
    fn next(&mut self) -> Result<Moment<'_>> {
        while self.now.as_ref().is_none_or(|stretch| self.at == stretch.chunk.len) {
            match self.stretches.next().transpose()? {
                Some(stretch) => (self.now, self.at) = (Some(stretch), 0),
                // The file has grown shorter since the rows were read.
                None => return Ok(Moment::Still),
            }
        }
        self.at += 1;
        Ok(self.now.as_ref().map_or(Moment::Still, |stretch| Moment::At(stretch, self.at - 1)))
    }
}

/// The chain of the recording's set-up, with constant deviations alone.
pub(crate) fn chain(calibrated: &CalibratedMachine, header: &Header, sensor: &Sensor) -> Result<Chain<f64>> {
    let (previous_from_w, dh) = frame_of_w(calibrated, header, sensor)?;
    let mut chain = Chain::new(calibrated.machine(), &dh);
    let w = calibrated.machine().w_index();
    chain.set_previous_from_frame(w, previous_from_w * Pose::exp(dh[w]));
    Ok(chain)
}

/// Frame `w` of the recording's set-up in the frame before it, and the deviations that go with it.
fn frame_of_w(
    calibrated: &CalibratedMachine,
    header: &Header,
    sensor: &Sensor,
) -> Result<(Pose<f64>, Vec<Twist<f64>>)> {
    let machine = calibrated.machine();
    let mut dh = calibrated.deviations().to_vec();
    match calibrated.setup(&header.setup) {
        Some(frame) => {
            dh[machine.w_index()] = Twist::zero(0.0);
            Ok((frame, dh))
        }
        None if header.workpiece_frame_unknown && !matches!(sensor, Sensor::Joint { .. }) => {
            let known: Vec<&str> = calibrated.setup_names().collect();
            let setup = match header.setup.as_str() {
                "" => "the set-up".to_string(),
                name => format!("set-up \"{name}\""),
            };
            Err(missing(
                format!("where {setup} of this recording stands is not in the calibrated file"),
                &known,
            ))
        }
        None => Ok((machine.dyads()[machine.w_index()].placement.pose(), dh)),
    }
}

fn missing(what: String, known: &[&str]) -> Error {
    let known: Vec<&str> = known.iter().copied().filter(|name| !name.is_empty()).collect();
    let known =
        if known.is_empty() { String::new() } else { format!("; the file knows: {}", known.join(", ")) };
    Error::Undetermined { what, mend: format!("add --fit-setup to find it from this recording{known}") }
}

pub(crate) fn sensor_state(
    calibrated: &CalibratedMachine,
    header: &Header,
    sensor: &Sensor,
) -> Result<SensorState<f64>> {
    let tool_point_t = match &header.tool_point {
        ToolPoint::Known(point) => *point,
        ToolPoint::Unknown(name) => {
            let found = calibrated.tool_points.iter().find(|(known, _)| known == name);
            let known: Vec<&str> = calibrated.tool_points.iter().map(|(n, _)| n.as_str()).collect();
            found
                .ok_or_else(|| {
                    missing(format!("tool point \"{name}\" is not in the calibrated file"), &known)
                })?
                .1
        }
    };
    let tool_rotation_t = match &header.tool_rotation_unknown {
        Some(name) if *sensor == Sensor::Pose => {
            let found = calibrated.tool_rotations.iter().find(|(known, _)| known == name);
            let known: Vec<&str> = calibrated.tool_rotations.iter().map(|(n, _)| n.as_str()).collect();
            found
                .ok_or_else(|| {
                    missing(
                        format!("the rotation of target \"{name}\" is not in the calibrated file"),
                        &known,
                    )
                })?
                .1
        }
        _ => Mat3::identity(0.0),
    };
    let length = match header.nominal_length {
        NominalLength::Known(length) => length,
        NominalLength::NotGiven => 0.0,
        NominalLength::Unknown => {
            let found = calibrated.lengths.iter().find(|(setup, _)| *setup == header.setup);
            found
                .ok_or_else(|| {
                    missing("the nominal length of this set-up is not in the calibrated file".into(), &[])
                })?
                .1
        }
    };
    let mut zero = 0.0;
    if header.zero_unknown && sensor.has_zero() {
        let channel = channel(sensor, calibrated.machine());
        let found = calibrated.zeros.iter().find(|(setup, of, _)| *setup == header.setup && *of == channel);
        zero = found
            .ok_or_else(|| {
                missing(format!("the zero of {channel} in this set-up is not in the calibrated file"), &[])
            })?
            .2;
    }
    let workpiece_point_w = header.workpiece_point;
    Ok(SensorState { tool_point_t, tool_rotation_t, workpiece_point_w, length, zero })
}

/// A measured column: its name and unit as written.
struct Measured {
    name: String,
    unit: Unit,
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

fn write_head(out: &mut dyn Write, recording: &Recording, columns: &[Measured]) -> std::io::Result<()> {
    write!(out, "{}", recording.preamble().trim_end_matches(['\r', '\n']))?;
    for Measured { name, unit } in columns {
        write!(out, ",{name}_model[{unit}],{name}_residual[{unit}]")?;
    }
    writeln!(out)
}

/// `,model,residual` of every measured column.
///
/// `sign`: of the quaternion as written against the one with `qw` not negative.
fn cells(columns: &[Measured], measured: &[f64], residuals: &[f64], sensor: &Sensor, sign: f64) -> String {
    let mut text = String::new();
    let mut put = |unit: Unit, model: f64, residual: f64| {
        text.push_str(&format!(",{:.12e},{:.6e}", unit.from_si(model), unit.from_si(residual)));
    };
    let position = residuals.len().min(3);
    for i in 0..position {
        put(columns[i].unit, measured[i] - residuals[i], residuals[i]);
    }
    if !matches!(sensor, Sensor::Pose) {
        return text;
    }
    // R_model = exp(φ)⁻¹ R_measured; the columns say it in the form in which it was measured.
    let turn = |x: &[f64]| Pose::exp(Twist::new(Vec3([0.0; 3]), Vec3([x[0], x[1], x[2]])));
    let model = turn(&residuals[3..6]).inverse() * turn(&measured[3..6]);
    if columns.len() == 7 {
        // A rotation has two quaternions: the model's is the one next to what was written.
        let seen = quaternion(turn(&measured[3..6])).map(|c| sign * c);
        let model = quaternion(model);
        let near = if (0..4).map(|i| model[i] * seen[i]).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
        for i in 0..4 {
            put(columns[3 + i].unit, near * model[i], seen[i] - near * model[i]);
        }
    } else {
        let vector = model.rotation_vector();
        for i in 0..3 {
            put(columns[3 + i].unit, vector.0[i], residuals[3 + i]);
        }
    }
    text
}

fn quaternion(pose: Pose<f64>) -> [f64; 4] {
    let q = nalgebra::Isometry3::from(pose).rotation;
    [q.w, q.i, q.j, q.k]
}

/// Whether a row's quaternion is written with the sign that [`quaternion`] gives (1) or with the other one (-1).
fn quaternion_sign(recording: &Recording, row: &str, measured: &[f64], sensor: &Sensor) -> f64 {
    let of = |i: usize| recording.columns().iter().position(|c| c.role == Role::Value(i));
    if !matches!(sensor, Sensor::Pose) || of(6).is_none() {
        return 1.0;
    }
    let turn = Twist::new(Vec3([0.0; 3]), Vec3([measured[3], measured[4], measured[5]]));
    let seen = quaternion(Pose::exp(turn));
    let largest = (0..4).max_by(|a, b| seen[*a].abs().total_cmp(&seen[*b].abs())).unwrap_or(0);
    let written = of(3 + largest).and_then(|column| row.split(',').nth(column));
    let written = written.and_then(|cell| cell.trim().trim_matches('"').trim().parse::<f64>().ok());
    if written.is_some_and(|x| x * seen[largest] < 0.0) { -1.0 } else { 1.0 }
}

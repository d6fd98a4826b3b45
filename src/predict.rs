//! What a calibrated machine says an instrument would read, sample by sample.

mod table;

use std::io::Write;
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::calibration::{CalibratedMachine, LeftOut};
use crate::chain::Chain;
use crate::error::{Error, Result};
use crate::feature::gravity_of;
use crate::identify::{Beginning, Evaluator, Memories, Moment, Stretch, Values, channel, stretches};
use crate::lie::{Mat3, Pose, Twist};
use crate::machine::{JointKind, Machine};
use crate::recording::{Block, Header, NominalLength, Recording, Row, Rows, ToolPoint};
use crate::residual::Sizes;
use crate::sensor::{Sensor, SensorState};
use crate::units::{ByQuantity, Rms, field_by_quantity};
use table::Table;

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
    out: Option<&mut dyn Write>,
) -> Result<Prediction> {
    predicted(calibrated, recording, out, None)
}

/// The residuals (measured minus model, m or rad) of every sample in its turn, one for each reading.
///
/// # Errors
/// As [`predict`].
pub fn residuals(
    calibrated: &CalibratedMachine,
    recording: &Recording,
    mut each: impl FnMut(&[f64]),
) -> Result<Prediction> {
    predicted(calibrated, recording, None, Some(&mut each))
}

/// Is given the residuals of a sample.
type Each<'a> = &'a mut dyn FnMut(&[f64]);

fn predicted(
    calibrated: &CalibratedMachine,
    recording: &Recording,
    mut out: Option<&mut dyn Write>,
    mut each: Option<Each>,
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
    let mut memories = Memories::new(varying);
    let mut path = None;
    if !varying.is_constant() {
        let mut beginning = Beginning::of(recording, machine, varying, dead_bands)?;
        let w = previous_from_w * Pose::exp(dh[machine.w_index()]);
        beginning.gravity_b = gravity_of(recording, machine, Some(w));
        let (pause, from) = (recording.scan()?.pause_after, Some(&beginning));
        let stretches = stretches(recording, machine, varying, dead_bands, from, pause, &mut memories)?;
        path = Some(Path::new(&evaluator, stretches, recording));
    }
    let failed = |e| Error::file(recording.path(), e);
    let table = out.is_some().then(|| Table::new(recording, &sensor));
    if let (Some(out), Some(table)) = (&mut out, &table) {
        table.write_head(*out).map_err(failed)?;
    }
    let judge = Judge { calibrated, evaluator: &evaluator, table };
    let mut sums = Sums::none(machine.commands().len(), evaluator.piece_count());
    let mut tell = |judged: Vec<Judged>| -> Result<()> {
        for Judged { sums: own, text, residuals } in judged {
            sums.add(&own);
            if let Some(each) = &mut each {
                residuals.chunks_exact(sensor.reading_count()).for_each(&mut **each);
            }
            if let Some(out) = &mut out {
                out.write_all(&text).map_err(failed)?;
            }
        }
        Ok(())
    };
    let judged = |group: Vec<Item>| group.into_par_iter().map(|item| judge.block(item)).collect::<Vec<_>>();
    let mut rows = recording.rows_with_text()?;
    if let Some(path) = &mut path {
        // A model that depends on the path goes along it on this thread.
        loop {
            let group = next_group(&mut rows, Some(path))?;
            if group.is_empty() {
                break;
            }
            tell(judged(group))?;
        }
    } else {
        // Rows are read beside those that are judged, and those before are written meanwhile.
        let (mut group, mut told) = (next_group(&mut rows, None)?, Vec::new());
        while !(group.is_empty() && told.is_empty()) {
            let (present, mut next) = (std::mem::take(&mut group), (Ok(Vec::new()), Vec::new()));
            let written = rayon::in_place_scope(|scope| {
                if !present.is_empty() {
                    scope.spawn(|_| next = rayon::join(|| next_group(&mut rows, None), || judged(present)));
                }
                tell(std::mem::take(&mut told))
            });
            written?;
            told = next.1;
            match next.0 {
                Ok(next) => group = next,
                Err(error) => {
                    tell(told)?;
                    return Err(error);
                }
            }
        }
    }
    let Sums { sizes, dropped, extrapolated, farthest, pieces } = sums;
    let unseen = || pieces.iter().enumerate().filter(|(piece, n)| **n > 0 && !variation.has_seen(*piece));
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
        unseen_directions: unseen().map(|(_, n)| n).sum(),
        left_out,
        unseen_pieces: match &variation.varying.directions {
            Some(directions) => unseen().map(|(piece, _)| directions.name(machine, piece)).collect(),
            None => Vec::new(),
        },
    })
}

/// Blocks of rows that are judged side by side.
const GROUP: usize = 8;

/// Rows to be judged: with their residuals and pieces already where the model depends on the path.
type Item = (Block, Option<OnPath>);

fn next_group(rows: &mut Rows, mut path: Option<&mut Path>) -> Result<Vec<Item>> {
    let with_residuals = |block: Result<Block>| {
        let block = block?;
        let on_path = path.as_mut().map(|path| path.next(block.chunk.len)).transpose()?;
        Ok((block, on_path))
    };
    rows.take(GROUP).map(with_residuals).collect()
}

/// What samples add up to.
struct Sums {
    sizes: ByQuantity<Sizes>,
    dropped: u64,
    extrapolated: u64,
    /// By command how far it leaves what has been seen, m or rad.
    farthest: Vec<f64>,
    /// Samples by piece.
    pieces: Vec<u64>,
}

impl Sums {
    fn none(commands: usize, pieces: usize) -> Self {
        let sizes = ByQuantity::default();
        Sums { sizes, dropped: 0, extrapolated: 0, farthest: vec![0.0; commands], pieces: vec![0; pieces] }
    }

    fn add(&mut self, other: &Sums) {
        self.sizes.add(&other.sizes);
        self.dropped += other.dropped;
        self.extrapolated += other.extrapolated;
        self.farthest.iter_mut().zip(&other.farthest).for_each(|(by, other)| *by = by.max(*other));
        self.pieces.iter_mut().zip(&other.pieces).for_each(|(n, other)| *n += other);
    }
}

/// What is told of a block of rows: its sums, its rows as they are to be written, its residuals.
struct Judged {
    sums: Sums,
    text: Vec<u8>,
    residuals: Vec<f64>,
}

/// Compares blocks of rows with the model.
struct Judge<'a> {
    calibrated: &'a CalibratedMachine,
    evaluator: &'a Evaluator<'a>,
    table: Option<Table<'a>>,
}

impl Judge<'_> {
    fn block(&self, (mut block, on_path): Item) -> Judged {
        let Judge { calibrated, evaluator, table } = self;
        let commands = evaluator.machine.commands().len();
        let mut sums = Sums::none(commands, evaluator.piece_count());
        let chunk = Arc::new(std::mem::take(&mut block.chunk));
        let OnPath { residuals, pieces } = on_path.unwrap_or_else(|| {
            let stretch = Stretch::plain(chunk.clone(), commands);
            OnPath { residuals: evaluator.all_residuals(&stretch), pieces: vec![0; chunk.len] }
        });
        sums.dropped = chunk.dropped;
        pieces.iter().for_each(|piece| sums.pieces[*piece] += 1);
        for q in chunk.commands.chunks_exact(commands) {
            let mut leaves = false;
            for (command, farthest) in sums.farthest.iter_mut().enumerate() {
                if let Some(by) = calibrated.beyond(command, q[command]) {
                    *farthest = by.max(*farthest);
                    leaves = true;
                }
            }
            sums.extrapolated += u64::from(leaves);
        }
        let (readings, values) = (evaluator.sensor.reading_count(), chunk.values.len() / chunk.len.max(1));
        for residual in residuals.chunks_exact(readings) {
            match evaluator.sensor {
                Sensor::Pose => {
                    sums.sizes.m.take(&residual[..3]);
                    sums.sizes.rad.take(&residual[3..]);
                }
                Sensor::Joint { dyad } if is_revolute(evaluator.machine, *dyad) => {
                    sums.sizes.rad.take(residual);
                }
                _ => sums.sizes.m.take(residual),
            }
        }
        let room = |table: &Table| block.rows().map(|row| row.text.len() + table.width()).sum();
        let mut text = Vec::with_capacity(table.as_ref().map_or(0, room));
        for row in table.iter().flat_map(|table| block.rows().map(move |row| (table, row))) {
            match row {
                (table, Row { text: row, sample: None, .. }) => table.push_dropped(row, &mut text),
                (table, Row { text: row, sample: Some(k), .. }) => {
                    let measured = &chunk.values[k * values..][..values];
                    table.push(row, measured, &residuals[k * readings..][..readings], &mut text);
                }
            }
        }
        Judged { sums, text, residuals }
    }
}

fn is_revolute(machine: &Machine, dyad: usize) -> bool {
    machine.dyads()[dyad].joint.as_ref().is_some_and(|j| j.kind == JointKind::Revolute)
}

/// Residuals of samples, those of a sample one after the other, and the piece that each lies in.
#[derive(Default)]
struct OnPath {
    residuals: Vec<f64>,
    pieces: Vec<usize>,
}

/// A second pass beside the rows, where the model depends on the path.
struct Path<'a> {
    evaluator: &'a Evaluator<'a>,
    stretches: Box<dyn Iterator<Item = Result<Stretch>> + 'a>,
    recording: &'a Recording,
    /// What the rows have not yet come to.
    ahead: OnPath,
}

impl<'a> Path<'a> {
    fn new(
        evaluator: &'a Evaluator<'a>,
        stretches: Box<dyn Iterator<Item = Result<Stretch>> + 'a>,
        recording: &'a Recording,
    ) -> Self {
        Path { evaluator, stretches, recording, ahead: OnPath::default() }
    }

    /// The next so many samples.
    fn next(&mut self, samples: usize) -> Result<OnPath> {
        while self.ahead.pieces.len() < samples {
            let Some(stretch) = self.stretches.next().transpose()? else {
                let changed = std::io::Error::other("the file has changed while it was read");
                return Err(Error::file(self.recording.path(), changed));
            };
            self.ahead.residuals.extend(self.evaluator.all_residuals(&stretch));
            let pieces = (0..stretch.chunk.len).map(|k| self.evaluator.piece(Moment::At(&stretch, k)));
            self.ahead.pieces.extend(pieces);
        }
        let readings = self.evaluator.sensor.reading_count();
        let residuals = self.ahead.residuals.drain(..samples * readings).collect();
        Ok(OnPath { residuals, pieces: self.ahead.pieces.drain(..samples).collect() })
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

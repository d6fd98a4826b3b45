//! Recordings as the identification sees them: passes over chunks of samples, from memory while they fit, else from disk.

use rayon::prelude::*;

use crate::error::Result;
use crate::lie::Vec3;
use crate::machine::{JointKind, Machine};
use crate::recording::{Chunk, Measurement, NominalLength, Recording, Summary, ToolPoint};
use crate::sensor::Sensor;
use crate::units::Quantity;

/// As many samples in all are kept in memory; larger sets are read again in every pass.
const CACHED_SAMPLES: u64 = 2_000_000;
/// Chunks that are worked on at a time when reading from disk.
const BATCH: usize = 16;

/// One recording with its instrument and the indices of the unknowns that belong to it.
#[derive(Debug)]
pub(crate) struct Source<'a> {
    pub recording: &'a Recording,
    pub summary: Summary,
    pub sensor: Sensor,
    /// Index of the set-up.
    pub setup: usize,
    /// Index of the unknown tool point, or the known one (m, frame `t`).
    pub tool_point: Result<usize, Vec3<f64>>,
    /// Index of the unknown zero.
    pub zero: Option<usize>,
    /// Index of the unknown length, or the known one, m.
    pub length: Result<usize, f64>,
    cached: Option<Vec<Chunk>>,
}

impl Source<'_> {
    /// The quantity of reading `i`.
    pub fn quantity(&self, machine: &Machine, i: usize) -> Quantity {
        let prismatic = match self.sensor {
            Sensor::Joint { dyad } => {
                machine.dyads()[dyad].joint.as_ref().is_some_and(|j| j.kind == JointKind::Prismatic)
            }
            _ => true,
        };
        self.sensor.quantity(i, prismatic)
    }

    /// Whether frame `w` enters the readings.
    pub fn sees_frames(&self) -> bool {
        !matches!(self.sensor, Sensor::Joint { .. })
    }
}

/// All recordings of a call with the names of what they share.
#[derive(Debug)]
pub(crate) struct Sources<'a> {
    pub all: Vec<Source<'a>>,
    pub setups: Vec<String>,
    /// Whether a set-up's frame `w` is to be found from nothing.
    pub frame_unknown: Vec<bool>,
    pub tool_points: Vec<String>,
    /// Set-up and channel of each unknown zero.
    pub zeros: Vec<(usize, String)>,
    /// Set-up of each unknown length.
    pub lengths: Vec<usize>,
}

/// Index of `item` in the list, added if it is new.
fn index_of<T: PartialEq>(list: &mut Vec<T>, item: T) -> usize {
    list.iter().position(|x| *x == item).unwrap_or_else(|| {
        list.push(item);
        list.len() - 1
    })
}

impl<'a> Sources<'a> {
    /// Scans every recording once (all its rows are checked here) and keeps the samples if they are few enough.
    pub fn new(recordings: &'a [Recording], machine: &Machine, progress: &dyn Fn(&str)) -> Result<Self> {
        let mut sources = Sources {
            all: Vec::new(),
            setups: Vec::new(),
            frame_unknown: Vec::new(),
            tool_points: Vec::new(),
            zeros: Vec::new(),
            lengths: Vec::new(),
        };
        let mut samples = 0;
        for recording in recordings {
            progress(&format!("reading {}", recording.name()));
            let summary = recording.scan()?;
            samples += summary.samples;
            sources.add(recording, summary, machine);
        }
        if samples <= CACHED_SAMPLES {
            for source in &mut sources.all {
                source.cached = Some(source.recording.chunks()?.collect::<Result<_>>()?);
            }
        }
        Ok(sources)
    }

    fn add(&mut self, recording: &'a Recording, summary: Summary, machine: &Machine) {
        let header = recording.header();
        let setup = index_of(&mut self.setups, header.setup.clone());
        self.frame_unknown.resize(self.setups.len(), false);
        let sensor = match header.measurement {
            Measurement::Distance { absolute } => Sensor::Distance { absolute },
            Measurement::Position => Sensor::Position,
            Measurement::Pose => Sensor::Pose,
            Measurement::Displacement => Sensor::Displacement {
                direction_w: header.direction_w.unwrap_or(Vec3([1.0, 0.0, 0.0])),
            },
            Measurement::Joint { dyad } => Sensor::Joint { dyad },
        };
        if !matches!(sensor, Sensor::Joint { .. }) {
            self.frame_unknown[setup] |= header.workpiece_frame_unknown;
        }
        let zero = (header.zero_unknown && sensor.has_zero()).then(|| {
            let channel = match &sensor {
                Sensor::Joint { dyad } => {
                    machine.dyads()[*dyad].joint.as_ref().map(|j| j.name.clone()).unwrap_or_default()
                }
                Sensor::Displacement { direction_w: Vec3([x, y, z]) } => {
                    format!("displacement along ({x:.4}, {y:.4}, {z:.4})")
                }
                _ => String::new(),
            };
            index_of(&mut self.zeros, (setup, channel))
        });
        let length = match (&sensor, &header.nominal_length) {
            (Sensor::Distance { absolute: false }, NominalLength::Unknown) => {
                Ok(index_of(&mut self.lengths, setup))
            }
            (_, NominalLength::Known(length)) => Err(*length),
            _ => Err(0.0),
        };
        let tool_point = match &header.tool_point {
            ToolPoint::Known(point) => Err(*point),
            ToolPoint::Unknown(name) => Ok(index_of(&mut self.tool_points, name.clone())),
        };
        // `Result<usize, _>` reads as: the index of an unknown, or else the value.
        let (tool_point, length) = (tool_point, length);
        self.all.push(Source {
            recording,
            summary,
            sensor,
            setup,
            tool_point: tool_point.map_err(Into::into).into_index(),
            zero,
            length: length.into_index(),
            cached: None,
        });
    }
}

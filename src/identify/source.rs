//! Recordings as the identification sees them: passes over chunks of samples, from memory while they fit, else from disk.

use std::collections::HashSet;

use rayon::prelude::*;

use crate::error::Result;
use crate::feature::Samples;
use crate::lie::Vec3;
use crate::machine::{JointKind, Machine};
use crate::motion::{FirstDirections, Motion, Tracker};
use crate::recording::{Chunk, Measurement, NominalLength, Recording, Summary, ToolPoint};
use crate::sensor::Sensor;
use crate::units::Quantity;

/// As many samples in all are kept in memory; larger sets are read again in every pass.
const CACHED_SAMPLES: u64 = 2_000_000;
/// Chunks that are worked on at a time when reading from disk.
const BATCH: usize = 16;

/// A value that is known, or the index of the unknown that stands for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Known<T> {
    Value(T),
    Unknown(usize),
}

impl<T> Known<T> {
    /// Index of the unknown.
    pub fn unknown(&self) -> Option<usize> {
        match self {
            Known::Value(_) => None,
            Known::Unknown(index) => Some(*index),
        }
    }
}

/// One recording with its instrument and the unknowns that belong to it.
#[derive(Debug)]
pub(crate) struct Source<'a> {
    pub recording: &'a Recording,
    /// File name; with its folder where another recording bears the same.
    pub label: String,
    pub summary: Summary,
    pub sensor: Sensor,
    /// Index of the set-up.
    pub setup: usize,
    /// Measured point in frame `t`, m.
    pub tool_point: Known<Vec3<f64>>,
    /// Reading at zero, m or rad.
    pub zero: Known<f64>,
    /// Length that a relative distance refers to, m.
    pub length: Known<f64>,
    cached: Option<Vec<Held>>,
    /// Directions of the first motions, where history matters.
    first: Option<Vec<i8>>,
    /// Lines of the samples that were picked for the fit; all of them if there was no choice.
    picked: Option<HashSet<u64>>,
}

/// Samples with their history.
#[derive(Debug)]
struct Held {
    chunk: Chunk,
    motion: Motion,
}

/// Which samples a pass is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Which {
    /// Those for the fit.
    Fit,
    /// Those that were held out.
    HeldOut,
}

impl Source<'_> {
    /// At the start of the recording, where history matters.
    fn tracker(&self, dead_bands: &[f64]) -> Option<Tracker> {
        self.first.as_ref().map(|first| Tracker::new(dead_bands.to_vec(), first.clone()))
    }

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

    /// Recordings that share their noise have the same one of these: kind of instrument and stated `sigma`.
    pub fn noise_group(&self) -> (std::mem::Discriminant<Sensor>, Option<u64>) {
        let stated = self.recording.header().sigma.map(|s| s.value.to_bits());
        (std::mem::discriminant(&self.sensor), stated)
    }

    /// Scalar readings in all samples.
    pub fn readings(&self) -> u64 {
        self.summary.samples * self.sensor.reading_count() as u64
    }

    /// Whether frames `w` and `t` enter the readings.
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
    /// Commands of a row.
    commands: usize,
    /// Motion against the direction of travel that counts as a reversal beyond this, by command, m or rad.
    pub dead_bands: Vec<f64>,
}

/// What of the path's history a model needs.
#[derive(Clone, Debug, Default)]
pub(crate) struct History {
    /// Whether any.
    pub needed: bool,
    /// Dead bands by command, m or rad, where they are given.
    pub dead_bands: Vec<Option<f64>>,
}

/// Dead band over the range of a command, where none is given.
const DEAD_BAND: f64 = 1e-5;

/// Index of `item` in the list, added if it is new.
fn index_of<T: PartialEq>(list: &mut Vec<T>, item: T) -> usize {
    list.iter().position(|x| *x == item).unwrap_or_else(|| {
        list.push(item);
        list.len() - 1
    })
}

impl<'a> Sources<'a> {
    /// Scans every recording once (all its rows are checked here) and keeps the samples if they are few enough.
    pub fn new(
        recordings: &'a [Recording],
        machine: &Machine,
        history: &History,
        progress: &dyn Fn(&str),
    ) -> Result<Self> {
        let commands = machine.commands().len();
        let mut sources = Sources {
            all: Vec::new(),
            setups: Vec::new(),
            frame_unknown: Vec::new(),
            tool_points: Vec::new(),
            zeros: Vec::new(),
            lengths: Vec::new(),
            commands,
            dead_bands: Vec::new(),
        };
        let mut samples = 0;
        for recording in recordings {
            progress(&format!("reading {}", recording.name()));
            let summary = recording.scan()?;
            samples += summary.samples;
            let namesakes = recordings.iter().filter(|r| r.name() == recording.name()).count();
            sources.add(recording, label(recording, namesakes > 1), summary, machine);
        }
        sources.dead_bands = (0..commands)
            .map(|c| {
                let ranges = sources.all.iter().map(|s| s.summary.commands[c]);
                let (low, high) =
                    ranges.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (a, b)| (l.min(a), h.max(b)));
                let given = history.dead_bands.get(c).copied().flatten();
                given.unwrap_or(DEAD_BAND * (high - low).max(0.0))
            })
            .collect();
        if history.needed {
            for source in &mut sources.all {
                let mut first = FirstDirections::new(sources.dead_bands.clone());
                for chunk in source.recording.chunks()? {
                    if first.look(&chunk?) {
                        break;
                    }
                }
                source.first = Some(first.found());
            }
        }
        if samples <= CACHED_SAMPLES {
            for source in &mut sources.all {
                let mut tracker = source.tracker(&sources.dead_bands);
                let held = source.recording.chunks()?.map(|chunk| chunk.map(|c| Held::new(c, &mut tracker)));
                source.cached = Some(held.collect::<Result<_>>()?);
            }
        }
        Ok(sources)
    }

    /// Keeps `count` samples of each piece for the fit, evenly spread over all recordings, and holds the others out. `piece` tells
    /// to which of `pieces` a sample belongs.
    pub fn pick(
        &mut self,
        count: u64,
        pieces: usize,
        piece: impl Fn(&Samples, usize) -> usize + Sync,
    ) -> Result<()> {
        let of_chunk = |samples: &Samples| -> Vec<(usize, u64)> {
            (0..samples.chunk.len).map(|k| (piece(samples, k), samples.chunk.lines[k])).collect()
        };
        let mut totals = vec![0u64; pieces];
        self.pass(
            |_, samples| of_chunk(samples),
            |_, of| of.iter().for_each(|(piece, _)| totals[*piece] += 1),
        )?;
        let mut seen = vec![0u64; pieces];
        let mut picked: Vec<HashSet<u64>> = vec![HashSet::new(); self.all.len()];
        self.pass(
            |_, samples| of_chunk(samples),
            |index, of| {
                for (piece, line) in of {
                    // The sample at which the running number of picks rises by one.
                    let rank =
                        |n: u64| (2 * n * count.min(totals[piece]) + totals[piece]) / (2 * totals[piece]);
                    if rank(seen[piece] + 1) > rank(seen[piece]) {
                        picked[index].insert(line);
                    }
                    seen[piece] += 1;
                }
            },
        )?;
        for (source, picked) in self.all.iter_mut().zip(picked) {
            source.summary.samples = picked.len() as u64;
            source.picked = Some(picked);
        }
        Ok(())
    }

    fn add(&mut self, recording: &'a Recording, label: String, summary: Summary, machine: &Machine) {
        let header = recording.header();
        let sensor = Sensor::of(header);
        let setup = index_of(&mut self.setups, header.setup.clone());
        self.frame_unknown.resize(self.setups.len(), false);
        if header.measurement.sees_frames() {
            self.frame_unknown[setup] |= header.workpiece_frame_unknown;
        }
        let zero = if header.zero_unknown && sensor.has_zero() {
            Known::Unknown(index_of(&mut self.zeros, (setup, channel(&sensor, machine))))
        } else {
            Known::Value(0.0)
        };
        let length = match header.nominal_length {
            NominalLength::Unknown if sensor == (Sensor::Distance { absolute: false }) => {
                Known::Unknown(index_of(&mut self.lengths, setup))
            }
            NominalLength::Known(length) => Known::Value(length),
            _ => Known::Value(0.0),
        };
        let tool_point = match &header.tool_point {
            ToolPoint::Known(point) => Known::Value(*point),
            ToolPoint::Unknown(name) => Known::Unknown(index_of(&mut self.tool_points, name.clone())),
        };
        self.all.push(Source {
            recording,
            label,
            summary,
            sensor,
            setup,
            tool_point,
            zero,
            length,
            cached: None,
            first: None,
            picked: None,
        });
    }

    /// Whether some samples were held out.
    pub fn is_picked(&self) -> bool {
        self.all.iter().any(|s| s.picked.is_some())
    }

    /// Samples in all recordings.
    pub fn samples(&self) -> u64 {
        self.all.iter().map(|s| s.summary.samples).sum()
    }

    /// Scalar readings in all recordings.
    pub fn readings(&self) -> u64 {
        self.all.iter().map(Source::readings).sum()
    }

    /// One pass over the samples for the fit: `work` on every chunk, on all cores; `merge` in the order of the files, so that the
    /// same input gives the same sums whatever the number of cores.
    pub fn pass<T: Send>(
        &self,
        work: impl Fn(usize, &Samples) -> T + Sync,
        merge: impl FnMut(usize, T),
    ) -> Result<()> {
        self.pass_over(Which::Fit, work, merge)
    }

    /// As [`Sources::pass`], over the samples for the fit or those held out.
    pub fn pass_over<T: Send>(
        &self,
        which: Which,
        work: impl Fn(usize, &Samples) -> T + Sync,
        mut merge: impl FnMut(usize, T),
    ) -> Result<()> {
        let commands = self.commands;
        for (index, source) in self.all.iter().enumerate() {
            let on = |held: &Held| match (&source.picked, which) {
                (None, Which::Fit) => Some(work(index, &held.samples(commands))),
                (None, Which::HeldOut) => None,
                (Some(picked), which) => {
                    let chosen =
                        held.chosen(commands, |line| picked.contains(&line) == (which == Which::Fit));
                    (chosen.chunk.len > 0).then(|| work(index, &chosen.samples(commands)))
                }
            };
            if let Some(chunks) = &source.cached {
                let parts: Vec<Option<T>> = chunks.par_iter().map(on).collect();
                parts.into_iter().flatten().for_each(|part| merge(index, part));
                continue;
            }
            let mut tracker = source.tracker(&self.dead_bands);
            let mut chunks =
                source.recording.chunks()?.map(|chunk| chunk.map(|c| Held::new(c, &mut tracker)));
            loop {
                let batch: Vec<Held> = chunks.by_ref().take(BATCH).collect::<Result<_>>()?;
                if batch.is_empty() {
                    break;
                }
                let parts: Vec<Option<T>> = batch.par_iter().map(on).collect();
                parts.into_iter().flatten().for_each(|part| merge(index, part));
            }
        }
        Ok(())
    }
}

impl Held {
    /// A chunk with its history, if one is followed.
    fn new(chunk: Chunk, tracker: &mut Option<Tracker>) -> Self {
        let motion = tracker.as_mut().map_or_else(Motion::default, |t| t.follow(&chunk));
        Held { chunk, motion }
    }

    fn samples(&self, commands: usize) -> Samples<'_> {
        Samples { chunk: &self.chunk, motion: &self.motion, commands }
    }

    /// Only the samples on these lines.
    fn chosen(&self, commands: usize, on: impl Fn(u64) -> bool) -> Held {
        let kept: Vec<usize> = (0..self.chunk.len).filter(|k| on(self.chunk.lines[*k])).collect();
        Held { chunk: self.chunk.chosen(&kept), motion: self.motion.chosen(commands, &kept) }
    }
}

/// A recording's file name, with its folder where the name alone does not tell.
fn label(recording: &Recording, with_folder: bool) -> String {
    let folder = recording.path().parent().and_then(|p| p.file_name()).filter(|_| with_folder);
    match folder {
        Some(folder) => format!("{}/{}", folder.to_string_lossy(), recording.name()),
        None => recording.name().to_string(),
    }
}

/// The name under which a zero is shared within its set-up.
pub(crate) fn channel(sensor: &Sensor, machine: &Machine) -> String {
    match sensor {
        Sensor::Joint { dyad } => {
            machine.dyads()[*dyad].joint.as_ref().map(|joint| joint.name.clone()).unwrap_or_default()
        }
        Sensor::Displacement { direction_w: Vec3([x, y, z]) } => {
            format!("displacement along ({x:.6}, {y:.6}, {z:.6})")
        }
        _ => String::new(),
    }
}

impl Measurement {
    /// Whether frames `w` and `t` enter the readings.
    pub(crate) fn sees_frames(&self) -> bool {
        !matches!(self, Measurement::Joint { .. })
    }
}

impl Sensor {
    /// The instrument of a recording.
    pub(crate) fn of(header: &crate::recording::Header) -> Self {
        match header.measurement {
            Measurement::Distance { absolute } => Sensor::Distance { absolute },
            Measurement::Position => Sensor::Position,
            Measurement::Pose => Sensor::Pose,
            Measurement::Displacement => {
                // A displacement without direction is refused when the recording is opened.
                Sensor::Displacement { direction_w: header.direction_w.unwrap_or(Vec3([1.0, 0.0, 0.0])) }
            }
            Measurement::Joint { dyad } => Sensor::Joint { dyad },
        }
    }
}

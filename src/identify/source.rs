//! Recordings as the identification sees them: passes over chunks of samples on all cores.

use std::collections::HashSet;
use std::sync::Arc;

use rayon::prelude::*;

use super::Approach;
use super::replay::Replay;
use super::stretch::{Beginning, Memories, Stretch, stretches};
use crate::error::Result;
use crate::feature::{Feature, gravity_of};
use crate::lie::{Mat3, Pose, Vec3};
use crate::machine::{JointKind, Machine};
use crate::recording::{Measurement, NominalLength, Recording, Summary, ToolPoint};
use crate::sensor::Sensor;
use crate::units::Quantity;
use crate::variation::Varying;

/// Features of as many samples in all are kept in memory; those of larger sets are taken anew in every pass.
const CACHED_SAMPLES: u64 = 2_000_000;
/// Chunks that are worked on at a time: what they add waits until all are done.
const BATCH: usize = 64;
/// The same where one thread goes along the path before.
const BATCH_ALONG: usize = 16;

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
    /// How the target of a pose is turned in frame `t`.
    pub tool_rotation: Known<Mat3<f64>>,
    /// Reading at zero, m or rad.
    pub zero: Known<f64>,
    /// Length that a relative distance refers to, m.
    pub length: Known<f64>,
    cached: Option<Vec<Stretch>>,
    /// How the path begins, where history matters.
    beginning: Option<Beginning>,
    /// Lines of the samples that were picked for the fit; all of them if there was no choice.
    picked: Option<HashSet<u64>>,
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
    /// All samples in their order, read anew.
    fn stretches<'b>(
        &'b self,
        machine: &'b Machine,
        varying: &'b Varying,
        dead_bands: &[f64],
        memories: &'b mut Memories,
    ) -> Result<Box<dyn Iterator<Item = Result<Stretch>> + 'b>> {
        let pause_after = self.summary.pause_after;
        stretches(
            self.recording,
            machine,
            varying,
            dead_bands,
            self.beginning.as_ref(),
            pause_after,
            memories,
        )
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
    /// Names of targets whose rotation is unknown.
    pub tool_rotations: Vec<String>,
    /// Set-up and channel of each unknown zero.
    pub zeros: Vec<(usize, String)>,
    /// Set-up of each unknown length.
    pub lengths: Vec<usize>,
    machine: &'a Machine,
    varying: &'a Varying,
    /// What passes have brought elsewhere, where the samples are not here.
    pub replay: Option<Arc<Replay>>,
    /// Motion against the direction of travel that counts as a reversal beyond this, by command, m or rad.
    pub dead_bands: Vec<f64>,
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
    /// Scans every recording once (all its rows are checked here), and keeps what varies with the path if the samples are few enough.
    pub fn new(
        recordings: &'a [Recording],
        machine: &'a Machine,
        varying: &'a Varying,
        dead_bands: &[Option<f64>],
        progress: &dyn Fn(&str),
    ) -> Result<Self> {
        let mut summaries = Vec::with_capacity(recordings.len());
        for recording in recordings {
            progress(&format!("reading {}", recording.name()));
            summaries.push(recording.scan()?);
        }
        let mut sources = Sources::of(recordings, summaries, machine, varying, dead_bands);
        if !varying.is_constant() {
            for source in &mut sources.all {
                let beginning = Beginning::of(source.recording, machine, varying, &sources.dead_bands)?;
                source.beginning = Some(beginning);
            }
        }
        let in_memory = |s: &Source| s.recording.stored().is_some_and(|stored| stored.is_in_memory());
        let is_small = sources.samples() <= CACHED_SAMPLES && sources.all.iter().all(in_memory);
        if !varying.is_constant() && is_small {
            sources.cache()?;
        }
        Ok(sources)
    }

    /// Recordings of which it is known what they hold; none is read.
    pub fn of(
        recordings: &'a [Recording],
        summaries: Vec<Summary>,
        machine: &'a Machine,
        varying: &'a Varying,
        dead_bands: &[Option<f64>],
    ) -> Self {
        let commands = machine.commands().len();
        let mut sources = Sources {
            all: Vec::new(),
            setups: Vec::new(),
            frame_unknown: Vec::new(),
            tool_points: Vec::new(),
            tool_rotations: Vec::new(),
            zeros: Vec::new(),
            lengths: Vec::new(),
            machine,
            varying,
            replay: None,
            dead_bands: Vec::new(),
        };
        for (recording, summary) in recordings.iter().zip(summaries) {
            let namesakes = recordings.iter().filter(|r| r.name() == recording.name()).count();
            sources.add(recording, label(recording, namesakes > 1), summary, machine);
        }
        sources.dead_bands = (0..commands)
            .map(|c| {
                let ranges = sources.all.iter().map(|s| s.summary.commands[c]);
                let (low, high) =
                    ranges.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (a, b)| (l.min(a), h.max(b)));
                let given = dead_bands.get(c).copied().flatten();
                given.unwrap_or(DEAD_BAND * (high - low).max(0.0))
            })
            .collect();
        sources
    }

    /// Keeps all samples with their features in memory.
    fn cache(&mut self) -> Result<()> {
        let mut memories = Memories::new(self.varying);
        for source in &mut self.all {
            let stretches = source.stretches(self.machine, self.varying, &self.dead_bands, &mut memories)?;
            source.cached = Some(stretches.collect::<Result<_>>()?);
        }
        Ok(())
    }

    /// Takes features anew where joints stand still, having come from these sides.
    pub fn approach(&mut self, approaches: &[Approach]) -> Result<()> {
        for approach in approaches {
            if let Some(beginning) = self.all.get_mut(approach.recording).and_then(|s| s.beginning.as_mut()) {
                beginning.approach(approach.dyad, approach.direction);
            }
        }
        let is_cached = self.all.iter().any(|s| s.cached.is_some());
        if is_cached && !approaches.is_empty() { self.cache() } else { Ok(()) }
    }

    /// Whether some feature depends on what weighs.
    pub fn has_weight(&self) -> bool {
        self.varying.features().any(Feature::needs_gravity)
    }

    /// Takes features anew, gravity being what recordings state in frame `w`, which stands there before it, by set-up.
    pub fn turn_gravity(&mut self, previous_from_w: impl Fn(usize) -> Pose<f64>) -> Result<()> {
        for source in &mut self.all {
            let Some(beginning) = &mut source.beginning else { continue };
            let pose = previous_from_w(source.setup);
            beginning.gravity_b = gravity_of(source.recording, self.machine, Some(pose));
        }
        if self.all.iter().any(|s| s.cached.is_some()) {
            self.cache()?;
        }
        Ok(())
    }

    /// Keeps `count` samples of each piece for the fit, evenly spread over all recordings, and holds the others out. `piece` tells
    /// to which of `pieces` a sample belongs.
    pub fn pick(
        &mut self,
        count: u64,
        pieces: usize,
        piece: impl Fn(&Stretch, usize) -> usize + Sync,
    ) -> Result<()> {
        let of_chunk = |stretch: &Stretch| -> Vec<(usize, u64)> {
            (0..stretch.chunk.len).map(|k| (piece(stretch, k), stretch.chunk.lines[k])).collect()
        };
        let mut totals = vec![0u64; pieces];
        self.pass(
            |_, stretch| of_chunk(stretch),
            |_, of| of.iter().for_each(|(piece, _)| totals[*piece] += 1),
        )?;
        let mut seen = vec![0u64; pieces];
        let mut picked: Vec<HashSet<u64>> = vec![HashSet::new(); self.all.len()];
        self.pass(
            |_, stretch| of_chunk(stretch),
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
        let tool_rotation = match &header.tool_rotation_unknown {
            Some(name) if sensor == Sensor::Pose => {
                Known::Unknown(index_of(&mut self.tool_rotations, name.clone()))
            }
            _ => Known::Value(Mat3::identity(0.0)),
        };
        self.all.push(Source {
            recording,
            label,
            summary,
            sensor,
            setup,
            tool_point,
            tool_rotation,
            zero,
            length,
            cached: None,
            beginning: None,
            picked: None,
        });
    }

    /// Whether some samples were held out.
    pub fn is_picked(&self) -> bool {
        self.all.iter().any(|s| s.picked.is_some())
    }

    /// Range of every command over all recordings, m or rad.
    pub fn ranges(&self) -> Vec<(f64, f64)> {
        let over = |c: usize| {
            let ranges = self.all.iter().map(|s| s.summary.commands[c]);
            ranges.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (from, to)| (l.min(from), h.max(to)))
        };
        (0..self.machine.commands().len()).map(over).collect()
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
        work: impl Fn(usize, &Stretch) -> T + Sync,
        merge: impl FnMut(usize, T),
    ) -> Result<()> {
        self.pass_over(Which::Fit, work, merge)
    }

    /// Whether any sample can be had apart from the others: nothing depends on the path, and all are for the fit.
    pub fn is_plain(&self) -> bool {
        let is_plain = |s: &Source| s.cached.is_none() && s.beginning.is_none() && s.picked.is_none();
        self.all.iter().all(|source| is_plain(source) && source.recording.stored().is_some())
    }

    /// As [`Sources::pass`] over plain samples, a few of each chunk: `few` says which, by their index in it, from the number of the source,
    /// how many of its samples come before the chunk, and how many it has. Of what lies in files the others are not read.
    pub fn pass_few<T: Send>(
        &self,
        few: impl Fn(usize, u64, usize) -> Vec<usize> + Sync,
        work: impl Fn(usize, &Stretch) -> T + Sync,
        mut merge: impl FnMut(usize, T),
    ) -> Result<()> {
        let commands = self.machine.commands().len();
        for (index, source) in self.all.iter().enumerate() {
            let Some(stored) = source.recording.stored() else { continue };
            let mut before = 0;
            let chunks = (0..stored.len()).map(|i| {
                let own = before;
                before += stored.samples(i) as u64;
                (i, few(index, own, stored.samples(i)))
            });
            let chunks: Vec<(usize, Vec<usize>)> = chunks.filter(|(_, few)| !few.is_empty()).collect();
            let part = |(i, few): &(usize, Vec<usize>)| {
                let chunk = Arc::new(stored.chosen(*i, few)?);
                Ok(work(index, &Stretch::plain(chunk, commands)))
            };
            let parts = chunks.par_iter().map(part).collect::<Result<Vec<_>>>()?;
            parts.into_iter().for_each(|part| merge(index, part));
        }
        Ok(())
    }

    /// As [`Sources::pass`], over the samples for the fit or those held out.
    pub fn pass_over<T: Send>(
        &self,
        which: Which,
        work: impl Fn(usize, &Stretch) -> T + Sync,
        mut merge: impl FnMut(usize, T),
    ) -> Result<()> {
        let mut memories = Memories::new(self.varying);
        for (index, source) in self.all.iter().enumerate() {
            let on = |stretch: &Stretch| match (&source.picked, which) {
                (None, Which::Fit) => Some(work(index, stretch)),
                (None, Which::HeldOut) => None,
                (Some(picked), which) => {
                    let chosen = stretch.chosen(|line| picked.contains(&line) == (which == Which::Fit));
                    (chosen.chunk.len > 0).then(|| work(index, &chosen))
                }
            };
            if let Some(stretches) = &source.cached {
                let parts: Vec<Option<T>> = stretches.par_iter().map(on).collect();
                parts.into_iter().flatten().for_each(|part| merge(index, part));
                continue;
            }
            if let (Some(stored), None) = (source.recording.stored(), &source.beginning) {
                let commands = self.machine.commands().len();
                for from in (0..stored.len()).step_by(BATCH) {
                    let part = |i| Ok(on(&Stretch::plain(stored.chunk(i)?, commands)));
                    let batch = from..stored.len().min(from + BATCH);
                    let parts = batch.into_par_iter().map(part).collect::<Result<Vec<_>>>()?;
                    parts.into_iter().flatten().for_each(|part| merge(index, part));
                }
                continue;
            }
            let mut stretches =
                source.stretches(self.machine, self.varying, &self.dead_bands, &mut memories)?;
            loop {
                let batch: Vec<Stretch> = stretches.by_ref().take(BATCH_ALONG).collect::<Result<_>>()?;
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

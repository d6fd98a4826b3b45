//! Residuals of every recording under each model, sample by sample, beside time and commands: what the pictures are drawn from.

use crate::calibration::CalibratedMachine;
use crate::circular::stride;
use crate::effects::RecordingFacts;
use crate::error::Result;
use crate::machine::{JointKind, Machine};
use crate::motion::{FirstDirections, Tracker};
use crate::predict::residuals;
use crate::recording::{Measurement, Recording};
use crate::units::Rms;

/// Motion against the direction of travel that is no reversal yet, as a part of the range.
const DEAD_BAND: f64 = 1e-5;
/// A recording of fewer samples has dots, not lines.
const FEW: u64 = 200;

/// A model under which residuals are looked at.
pub(super) struct Stage<'a> {
    /// As it is told: `as declared`.
    pub name: &'static str,
    pub calibrated: &'a CalibratedMachine,
}

/// One recording and quantity.
pub(super) struct Track {
    pub recording: String,
    /// Whether the residuals are angles, rad; else lengths, m.
    pub angle: bool,
    /// Whether they have a sign; else they are norms of several readings.
    pub signed: bool,
    /// Positions at which the machine stood, and no path.
    pub settled: bool,
    /// s
    pub time: Option<Vec<f64>>,
    /// By command, m or rad.
    pub commands: Vec<Vec<f64>>,
    /// By command, -1, 0, 1.
    pub directions: Vec<Vec<i8>>,
    /// Residuals by stage, m or rad.
    pub residuals: Vec<Vec<f64>>,
}

/// Root mean squares of one recording by stage.
pub(super) struct Figures {
    pub recording: String,
    pub measurement: &'static str,
    pub samples: u64,
    pub rms: Vec<Rms>,
}

/// Tracks and figures of all recordings.
///
/// # Errors
/// As [`residuals`].
pub(super) fn tracks(
    machine: &Machine,
    recordings: &[Recording],
    stages: &[Stage],
) -> Result<(Vec<Track>, Vec<Figures>)> {
    let (mut tracks, mut figures) = (Vec::new(), Vec::new());
    for recording in recordings {
        let mut all: Vec<Vec<f64>> = Vec::new();
        let (mut rms, mut samples) = (Vec::new(), 0);
        let every = stride(recording.scan()?.samples);
        for stage in stages {
            let (mut flat, mut count) = (Vec::new(), 0usize);
            let told = residuals(stage.calibrated, recording, |sample| {
                if count.is_multiple_of(every) {
                    flat.extend_from_slice(sample);
                }
                count += 1;
            })?;
            rms.push(told.rms);
            samples = told.samples;
            all.push(flat);
        }
        let measurement = recording.header().measurement;
        figures.push(Figures {
            recording: recording.name().into(),
            measurement: measurement.word(),
            samples,
            rms,
        });
        tracks.extend(of_recording(machine, recording, &all)?);
    }
    Ok((tracks, figures))
}

fn of_recording(machine: &Machine, recording: &Recording, stages: &[Vec<f64>]) -> Result<Vec<Track>> {
    let count = machine.commands().len();
    let summary = recording.scan()?;
    let (ranges, every, mut behind) = (summary.commands, stride(summary.samples), 0usize);
    let bands: Vec<f64> = ranges.iter().map(|(from, to)| DEAD_BAND * (to - from).abs()).collect();
    let mut first = FirstDirections::new(bands.clone());
    for chunk in recording.chunks()? {
        if first.look(&chunk?) {
            break;
        }
    }
    let mut tracker = Tracker::new(bands, first.found());
    let mut time = recording.has_time().then(Vec::new);
    let mut commands = vec![Vec::new(); count];
    let mut directions = vec![Vec::new(); count];
    for chunk in recording.chunks()? {
        let chunk = chunk?;
        let motion = tracker.follow(&chunk);
        for k in (0..chunk.len).filter(|k| (behind + k).is_multiple_of(every)) {
            if let (Some(all), Some(own)) = (&mut time, &chunk.time) {
                all.push(own[k]);
            }
            for c in 0..count {
                commands[c].push(chunk.commands[k * count + c]);
                directions[c].push(motion.directions[k * count + c]);
            }
        }
        behind += chunk.len;
    }
    // As the diagnosis sees it; without times nobody knows of a path.
    let facts = RecordingFacts::of(machine, std::slice::from_ref(recording))?;
    let settled = facts.settled || facts.time.is_none() || summary.samples <= FEW;
    let (width, parts): (usize, Vec<(bool, std::ops::Range<usize>)>) = match recording.header().measurement {
        Measurement::Pose => (6, vec![(false, 0..3), (true, 3..6)]),
        Measurement::Position => (3, vec![(false, 0..3)]),
        Measurement::Joint { dyad } => {
            let joint = machine.dyads()[dyad].joint.as_ref();
            (1, vec![(joint.is_some_and(|joint| joint.kind == JointKind::Revolute), 0..1)])
        }
        Measurement::Distance { .. } | Measurement::Displacement => (1, vec![(false, 0..1)]),
    };
    let of = |flat: &[f64], part: &std::ops::Range<usize>| -> Vec<f64> {
        let own = |sample: &[f64]| match &sample[part.clone()] {
            [one] => *one,
            several => several.iter().map(|x| x * x).sum::<f64>().sqrt(),
        };
        flat.chunks_exact(width).map(own).collect()
    };
    let track = |(angle, part): &(bool, std::ops::Range<usize>)| Track {
        recording: recording.name().into(),
        angle: *angle,
        signed: part.len() == 1,
        settled,
        time: time.clone(),
        commands: commands.clone(),
        directions: directions.clone(),
        residuals: stages.iter().map(|flat| of(flat, part)).collect(),
    };
    Ok(parts.iter().map(track).collect())
}

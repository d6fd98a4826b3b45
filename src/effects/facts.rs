//! What the recordings of a call have in them, as far as effects ask for it.

use super::window::finest;
use crate::error::Result;
use crate::machine::{JointKind, Machine};
use crate::recording::{Measurement, Recording};
use crate::units::Quantity;

/// Ranges, times and channels over all recordings of a call.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingFacts {
    /// Range of every dyad's displacement, m or rad; `None` for frames without joint.
    pub travel: Vec<Option<(f64, f64)>>,
    /// Motion against the direction of travel that counts as a reversal only beyond this, m or rad, for each dyad.
    pub dead_bands: Vec<f64>,
    /// Median gap between neighbouring distinct positions of every dyad's joint over all recordings, m or rad; the whole travel where
    /// they are few targets visited again and again; 0 where the joint stands still.
    pub spacing: Vec<f64>,
    /// Shortest period of every dyad's joint, m or rad, of which a wave can be told from coarser ones.
    pub finest: Vec<f64>,
    /// Median distance of every dyad's joint from one settled position to the next, m or rad; 0 where samples are taken in motion.
    pub stride: Vec<f64>,
    /// How many places every dyad's joint was seen at, where they are few targets visited again and again.
    pub places: Vec<Option<usize>>,
    /// First and last time, s, if all recordings have one.
    pub time: Option<(f64, f64)>,
    /// Whether the recordings have times and follow one another on one clock: times that overlap are of clocks of their own.
    pub one_clock: bool,
    /// Names of the recordings in their order, and how many samples come before each; empty where two have one name.
    pub begins: Vec<(String, f64)>,
    /// Set-ups in their order, with the names of their recordings.
    pub setups: Vec<(String, Vec<String>)>,
    /// How many samples there are.
    pub samples: f64,
    /// Duration of the longest recording, s.
    pub longest: f64,
    /// Median time from a sample to the next in the recording where it is smallest, s.
    pub step: Option<f64>,
    /// Whether samples are settled positions, so that there are no velocities.
    pub settled: bool,
    /// Whether every sample is an approach of its own to its position, from a side that is told.
    pub approached: bool,
    /// Extra channels that all recordings have.
    pub channels: Vec<(String, Quantity)>,
    /// Quantities of the readings of a sample, of the recording that has most.
    pub readings: Vec<Quantity>,
}

/// A joint that moves by less stands still, m or rad: what is left of rounded commands is no motion.
const STANDSTILL: f64 = 1e-6;
/// Least and greatest dead band as a share of the range of travel; between them it is one and a half of the smallest steps.
const JITTER: (f64, f64) = (1e-9, 1e-4);
/// Samples are settled positions where the median step of the joint that moves most is above this share of its range.
const SETTLED_STEP: f64 = 0.05;

/// Positions that are looked at for their gaps.
const POSITIONS: usize = 100_000;
/// Parts of the travel that are looked at for whether a position lies in them.
const PARTS: f64 = 1000.0;
/// So few parts of the travel with positions in them are targets.
const FEW: usize = 16;
/// Targets lie farther apart than this part of the travel.
const TARGET: f64 = 0.02;
/// A joint that stands still from one settled position to the next is seen to move by less than this part of its usual step.
const REST: f64 = 1e-3;
/// A tone is not followed over more than so many times the longest recording.
const MOST_FOLLOWED: f64 = 8.0;
/// Positions closer than this part of the travel are one.
const ALIKE: f64 = 1e-6;

impl RecordingFacts {
    /// Whether a path was followed continuously under a clock, so that neighbours see the same misfit.
    pub(crate) fn are_smooth(&self) -> bool {
        self.time.is_some() && !self.settled
    }

    /// Reads every recording once.
    ///
    /// # Errors
    /// As [`Recording::chunks`].
    pub fn of(machine: &Machine, recordings: &[Recording]) -> Result<Self> {
        let dyads = machine.dyads().len();
        let mut facts = RecordingFacts {
            travel: vec![None; dyads],
            // Smallest steps, until all recordings are read.
            dead_bands: vec![f64::INFINITY; dyads],
            spacing: vec![0.0; dyads],
            finest: vec![0.0; dyads],
            stride: vec![0.0; dyads],
            places: vec![None; dyads],
            time: None,
            one_clock: true,
            begins: Vec::new(),
            setups: by_setup(recordings),
            samples: 0.0,
            longest: 0.0,
            step: None,
            settled: false,
            approached: true,
            channels: Vec::new(),
            readings: Vec::new(),
        };
        let mut all_timed = true;
        let mut spans: Vec<(f64, f64)> = Vec::new();
        let mut seen: Vec<Vec<f64>> = vec![Vec::new(); dyads];
        let mut strides: Vec<Vec<f64>> = vec![Vec::new(); dyads];
        for (i, recording) in recordings.iter().enumerate() {
            all_timed &= recording.has_time();
            facts.begins.push((recording.name().to_string(), facts.samples));
            spans.extend(facts.take(machine, recording, &mut seen, &mut strides)?);
            let channels = recording.extra_channels().iter().map(|c| (c.name.clone(), c.unit.quantity));
            match i {
                0 => facts.channels = channels.collect(),
                _ => {
                    let here: Vec<_> = channels.collect();
                    facts.channels.retain(|c| here.contains(c));
                }
            }
            let readings = readings(machine, recording);
            if readings.len() > facts.readings.len() {
                facts.readings = readings;
            }
        }
        if facts.settled {
            facts.stride = strides.into_iter().map(|own| median(own.into_iter())).collect();
        }
        if !all_timed {
            (facts.time, facts.step, facts.longest) = (None, None, 0.0);
        }
        spans.sort_by(|a, b| a.0.total_cmp(&b.0));
        facts.one_clock = all_timed && spans.windows(2).all(|pair| pair[0].1 <= pair[1].0);
        let twice = |name: &String| facts.begins.iter().filter(|(other, _)| other == name).count() > 1;
        if facts.begins.iter().any(|(name, _)| twice(name)) {
            facts.begins.clear();
        }
        for (j, positions) in seen.into_iter().enumerate() {
            facts.places[j] = facts.travel[j].and_then(|travel| places(&positions, travel));
            let Some(travel) = facts.travel[j] else { continue };
            facts.spacing[j] = spacing(positions.clone(), travel);
            facts.finest[j] = match facts.places[j] {
                Some(_) => 2.0 * facts.spacing[j],
                None => finest(&positions, facts.spacing[j]),
            };
        }
        for ((band, travel), stride) in facts.dead_bands.iter_mut().zip(&facts.travel).zip(&facts.stride) {
            let range = travel.map_or(0.0, |(from, to)| to - from);
            *band = (1.5 * *band).max(JITTER.0 * range).min(JITTER.1 * range).max(REST * stride);
        }
        Ok(facts)
    }

    /// Takes a recording in; its first and last time, if it has any.
    fn take(
        &mut self,
        machine: &Machine,
        recording: &Recording,
        seen: &mut [Vec<f64>],
        strides: &mut [Vec<f64>],
    ) -> Result<Option<(f64, f64)>> {
        let commands = machine.commands().len();
        let mut own: Vec<Option<(f64, f64)>> = vec![None; machine.dyads().len()];
        let mut steps: Vec<(f64, Vec<f64>)> = Vec::new();
        let mut span: Option<(f64, f64)> = None;
        for chunk in recording.chunks()? {
            let chunk = chunk?;
            self.samples += chunk.len as f64;
            let mut last: Option<Vec<f64>> = None; // rows of a chunk; a step from one chunk to the next is left out
            for (k, q) in chunk.commands.chunks_exact(commands).enumerate() {
                let displacements = machine.displacements(q);
                for (j, _) in machine.joints() {
                    let q = displacements[j];
                    if seen[j].len() < POSITIONS {
                        seen[j].push(q);
                    }
                    let (from, to) = own[j].unwrap_or((q, q));
                    own[j] = Some((from.min(q), to.max(q)));
                }
                if let Some(last) = last.replace(displacements.clone()) {
                    let step: Vec<f64> =
                        displacements.iter().zip(&last).map(|(a, b)| (a - b).abs()).collect();
                    for (least, step) in
                        self.dead_bands.iter_mut().zip(&step).filter(|(_, step)| **step > 0.0)
                    {
                        *least = least.min(*step);
                    }
                    for (own, step) in strides.iter_mut().zip(&step) {
                        if *step > STANDSTILL && own.len() < POSITIONS {
                            own.push(*step);
                        }
                    }
                    // The first samples say what the usual steps are.
                    if steps.len() < 4096 {
                        steps.push((chunk.time.as_ref().map_or(0.0, |t| t[k] - t[k - 1]), step));
                    }
                }
            }
            if let (Some(first), Some(last)) =
                (chunk.time.as_ref().and_then(|t| t.first()), chunk.time.as_ref().and_then(|t| t.last()))
            {
                let (from, to) = span.unwrap_or((*first, *last));
                span = Some((from.min(*first), to.max(*last)));
            }
        }
        if let Some((from, to)) = span {
            self.longest = self.longest.max(to - from);
            let (first, last) = self.time.unwrap_or((from, to));
            self.time = Some((first.min(from), last.max(to)));
            let step = median(steps.iter().map(|(t, _)| *t));
            self.step = Some(self.step.map_or(step, |s| s.min(step)));
        }
        let tells_side =
            recording.columns().iter().any(|c| matches!(c.role, crate::recording::Role::Direction(_)));
        self.settled |= tells_side;
        self.approached &= tells_side;
        let moving = |j: usize| own[j].map(|(from, to)| to - from).filter(|range| *range > 10.0 * STANDSTILL);
        let largest = (machine.joints())
            .filter_map(|(j, _)| Some(median(steps.iter().map(|(_, s)| s[j])) / moving(j)?))
            .fold(0.0, f64::max);
        self.settled |= largest > SETTLED_STEP;
        for (all, own) in self.travel.iter_mut().zip(own) {
            *all = match (*all, own) {
                (Some((a, b)), Some((c, d))) => Some((a.min(c), b.max(d))),
                (all, own) => all.or(own),
            };
        }
        Ok(span)
    }

    /// How long a tone is followed, s: on one clock from the first recording to the last, over pauses that are not too long; its frequency
    /// is as sharp as that.
    pub fn followed(&self) -> f64 {
        match self.time.filter(|_| self.one_clock) {
            Some((first, last)) => (last - first).min(MOST_FOLLOWED * self.longest),
            None => self.longest,
        }
    }

    /// Whether the joint of dyad `j` moves.
    pub fn moves(&self, j: usize) -> bool {
        self.travel[j].is_some_and(|(from, to)| to - from > STANDSTILL)
    }
}

/// Set-ups in the order in which they are met, with the names of their recordings.
pub(crate) fn by_setup(recordings: &[Recording]) -> Vec<(String, Vec<String>)> {
    let mut setups: Vec<(String, Vec<String>)> = Vec::new();
    for recording in recordings {
        let (setup, name) = (&recording.header().setup, recording.name().to_string());
        match setups.iter_mut().find(|(known, _)| known == setup) {
            Some((_, names)) => names.push(name),
            None => setups.push((setup.clone(), vec![name])),
        }
    }
    setups
}

fn readings(machine: &Machine, recording: &Recording) -> Vec<Quantity> {
    match recording.header().measurement {
        Measurement::Position => vec![Quantity::Length; 3],
        Measurement::Pose => [[Quantity::Length; 3], [Quantity::Angle; 3]].concat(),
        Measurement::Joint { dyad } => {
            let kind = machine.dyads()[dyad].joint.as_ref().map(|joint| joint.kind);
            vec![if kind == Some(JointKind::Revolute) { Quantity::Angle } else { Quantity::Length }]
        }
        Measurement::Distance { .. } | Measurement::Displacement => vec![Quantity::Length],
    }
}

/// Number of targets, where positions are few: what lies closer together than this part of the travel is one.
fn places(positions: &[f64], (from, to): (f64, f64)) -> Option<usize> {
    if spacing(positions.to_vec(), (from, to)) < to - from {
        return None;
    }
    let mut sorted = positions.to_vec();
    sorted.sort_by(f64::total_cmp);
    Some(1 + sorted.windows(2).filter(|pair| pair[1] - pair[0] > TARGET * (to - from)).count())
}

/// Median gap between distinct positions; the whole travel where they are few targets again and again, at which any wave can be drawn.
fn spacing(mut positions: Vec<f64>, (from, to): (f64, f64)) -> f64 {
    positions.sort_by(f64::total_cmp);
    let places = positions
        .iter()
        .map(|q| ((q - from) / (to - from) * PARTS) as i64)
        .fold((i64::MIN, 0), |(last, n), at| (at, n + usize::from(at != last)));
    if places.1 < FEW {
        return to - from;
    }
    median(positions.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > ALIKE * (to - from)))
}

fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = numbers.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

//! What features see of a recording: columns of positions, history and rates, joint by joint.

use std::collections::BTreeMap;

use super::weights::{Weights, gravity_of};
use crate::error::Result;
use crate::lie::Vec3;
use crate::machine::{Drive, Machine};
use crate::motion::{Axis, LOOK_AHEAD, Rates, stated};
use crate::recording::{Chunk, Recording};

/// Distance from a reversal that has not been, m or rad: finite, so that derivatives of what decays with it are 0.
const FAR: f64 = 1e6;

/// Consecutive samples of one recording as features see them. All columns have `len` numbers, SI.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// How many samples there are.
    pub len: usize,
    /// Whether these are the first of their recording; play and take-up begin anew there.
    pub first: bool,
    /// Name of the recording; empty where there is none.
    pub recording: String,
    /// Number of samples before each in the recording.
    pub number: Vec<f64>,
    /// Time on the recordings' clock, s.
    pub time: Option<Vec<f64>>,
    /// Columns of each dyad's joint, machine order; `None` for a frame without joint.
    pub joints: Vec<Option<JointSamples>>,
    /// Extra channels by name.
    pub channels: BTreeMap<String, Vec<f64>>,
}

/// Columns of one joint's displacement, couplings included.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointSamples {
    /// Displacement, m or rad.
    pub position: Vec<f64>,
    /// Direction of travel or approach: -1, 1; 0 for a joint that never moves.
    pub direction: Vec<f64>,
    /// Distance from the last reversal, m or rad; 1e6 before the first one.
    pub since_reversal: Vec<f64>,
    /// Path since the first sample of the recording, m or rad.
    pub travelled: Vec<f64>,
    /// Velocity, m/s or rad/s; empty without time.
    pub velocity: Vec<f64>,
    /// Acceleration, m/s² or rad/s²; empty without time.
    pub acceleration: Vec<f64>,
    /// Torque (Nm) or force (N) by gravity of the masses beyond.
    pub gravity: Vec<f64>,
    /// The same of 1 kg at the end of the branch.
    pub load: Vec<f64>,
    /// Moments about and across the axis, how they change along it, and torques of first moments beyond: the columns behind
    /// [`Expression::Moment`](super::Expression::Moment), `Shear` and `Lever`.
    pub weights: Vec<Vec<f64>>,
}

impl Samples {
    /// These samples alone, by their index.
    pub(crate) fn chosen(&self, kept: &[usize]) -> Samples {
        self.mapped(kept.len(), |column| {
            if column.is_empty() { Vec::new() } else { kept.iter().map(|k| column[*k]).collect() }
        })
    }

    /// These samples as if every joint had turned round just before it first moves: until then it has come from the other side.
    pub(crate) fn turned_before(&self) -> Samples {
        let mut turned = self.clone();
        for joint in turned.joints.iter_mut().flatten() {
            let unseen =
                joint.since_reversal.iter_mut().zip(&joint.travelled).filter(|(since, _)| **since >= FAR);
            unseen.for_each(|(since, travelled)| *since = *travelled);
            let standing = joint.direction.iter_mut().zip(&joint.travelled).filter(|(_, way)| **way == 0.0);
            standing.for_each(|(direction, _)| *direction = -*direction);
        }
        turned
    }

    /// Puts the samples that follow behind these.
    pub(crate) fn append(&mut self, next: Samples) {
        self.len += next.len;
        self.number.extend(next.number);
        if let (Some(own), Some(next)) = (&mut self.time, next.time) {
            own.extend(next);
        }
        for (own, next) in self.joints.iter_mut().zip(next.joints) {
            let (Some(own), Some(next)) = (own, next) else { continue };
            own.position.extend(next.position);
            own.direction.extend(next.direction);
            own.since_reversal.extend(next.since_reversal);
            own.travelled.extend(next.travelled);
            own.velocity.extend(next.velocity);
            own.acceleration.extend(next.acceleration);
            own.gravity.extend(next.gravity);
            own.load.extend(next.load);
            own.weights.iter_mut().zip(next.weights).for_each(|(own, next)| own.extend(next));
        }
        for (name, column) in next.channels {
            self.channels.entry(name).or_default().extend(column);
        }
    }

    /// Every column changed alike.
    fn mapped(&self, len: usize, f: impl Fn(&Vec<f64>) -> Vec<f64>) -> Samples {
        let joint = |joint: &JointSamples| JointSamples {
            position: f(&joint.position),
            direction: f(&joint.direction),
            since_reversal: f(&joint.since_reversal),
            travelled: f(&joint.travelled),
            velocity: f(&joint.velocity),
            acceleration: f(&joint.acceleration),
            gravity: f(&joint.gravity),
            load: f(&joint.load),
            weights: joint.weights.iter().map(&f).collect(),
        };
        Samples {
            len,
            first: self.first,
            recording: self.recording.clone(),
            number: f(&self.number),
            time: self.time.as_ref().map(&f),
            joints: self.joints.iter().map(|j| j.as_ref().map(joint)).collect(),
            channels: self.channels.iter().map(|(name, column)| (name.clone(), f(column))).collect(),
        }
    }

    /// One of them alone.
    pub(super) fn only(&self, k: usize) -> Samples {
        let one = |column: &Vec<f64>| column.get(k).map_or_else(Vec::new, |x| vec![*x]);
        let joint = |joint: &JointSamples| JointSamples {
            position: one(&joint.position),
            direction: one(&joint.direction),
            since_reversal: one(&joint.since_reversal),
            travelled: one(&joint.travelled),
            velocity: one(&joint.velocity),
            acceleration: one(&joint.acceleration),
            gravity: one(&joint.gravity),
            load: one(&joint.load),
            weights: joint.weights.iter().map(one).collect(),
        };
        Samples {
            len: usize::from(k < self.len),
            first: self.first && k == 0,
            recording: self.recording.clone(),
            number: one(&self.number),
            time: self.time.as_ref().map(one),
            joints: self.joints.iter().map(|j| j.as_ref().map(joint)).collect(),
            channels: self.channels.iter().map(|(name, column)| (name.clone(), one(column))).collect(),
        }
    }
}

/// Turns the chunks of one recording, in their order, into [`Samples`]. Memory does not grow with the recording: one chunk is
/// held back, because rates look a few samples ahead.
pub struct Follow<'a, I> {
    machine: &'a Machine,
    chunks: I,
    history: History,
    weights: Option<Weights>,
    held: Option<Chunk>,
    /// Times and displacements of the last samples before the one held.
    before: Vec<(f64, Vec<f64>)>,
    /// Samples so far.
    count: usize,
    pause_after: f64,
    recording: String,
    channels: Vec<String>,
    ended: bool,
}

/// Histories of all joints, `docs/effects.md` (43).
#[derive(Clone)]
pub(super) struct History {
    /// Dyad, drive, dead band (m or rad), direction in which it came before it first moves.
    pub(super) joints: Vec<(usize, Drive, f64, i8)>,
    axes: Vec<Option<Axis>>,
    /// Whether the joint has turned round yet.
    turned: Vec<bool>,
    pub(super) travelled: Vec<f64>,
    pub(super) last: Vec<f64>,
}

impl History {
    /// Where joint `i` last turned round, m or rad; `None` before its first reversal.
    pub(super) fn turned_at(&self, i: usize) -> Option<f64> {
        self.axes[i].filter(|_| self.turned[i]).map(|axis| axis.turned_at)
    }

    pub(super) fn new(machine: &Machine, dead_bands: &[f64], first: &[i8]) -> Self {
        let joints: Vec<_> = (machine.joints())
            .map(|(j, _)| {
                (j, machine.drive(j).expect("every joint has a drive").clone(), dead_bands[j], first[j])
            })
            .collect();
        let count = joints.len();
        History {
            joints,
            axes: vec![None; count],
            turned: vec![false; count],
            travelled: vec![0.0; count],
            last: vec![f64::NAN; count],
        }
    }

    pub(super) fn advance(&mut self, stated: impl Fn(usize) -> Option<i8>, displacements: &[f64]) {
        for (i, (j, drive, band, came)) in self.joints.iter().enumerate() {
            let q = displacements[*j];
            // A column of directions speaks of one command; of a joint that follows several it says nothing.
            let stated = match drive.terms.as_slice() {
                [(c, factor)] => stated(*c).map(|d| if *factor < 0.0 { -d } else { d }),
                _ => None,
            };
            let axis = self.axes[i].get_or_insert_with(|| Axis::at(q));
            let before = if axis.direction == 0 { *came } else { axis.direction };
            axis.advance(q, stated, *band);
            self.turned[i] |= before != 0 && axis.direction != 0 && before != axis.direction;
            if self.last[i].is_finite() {
                self.travelled[i] += (q - self.last[i]).abs();
            }
            self.last[i] = q;
        }
    }

    pub(super) fn direction(&self, i: usize) -> i8 {
        match &self.axes[i] {
            Some(axis) if axis.direction != 0 => axis.direction,
            _ => self.joints[i].3,
        }
    }

    pub(super) fn since_reversal(&self, i: usize, q: f64) -> f64 {
        self.turned_at(i).map_or(FAR, |turned_at| (q - turned_at).abs())
    }
}

/// Directions of the first motion of every dyad's joint (0 where it never moves, and for frames without joint).
pub fn first_directions(
    machine: &Machine,
    dead_bands: &[f64],
    chunks: impl IntoIterator<Item = Result<Chunk>>,
) -> Result<Vec<i8>> {
    let mut first = vec![0; machine.dyads().len()];
    let mut history = History::new(machine, dead_bands, &first);
    let commands = machine.commands().len();
    for chunk in chunks {
        let chunk = chunk?;
        for (k, q) in chunk.commands.chunks_exact(commands).enumerate() {
            history.advance(|c| stated(&chunk, c, k), &machine.displacements(q));
            for (i, (j, ..)) in history.joints.iter().enumerate() {
                if first[*j] == 0 {
                    first[*j] = history.direction(i);
                }
            }
        }
        if history.joints.iter().all(|(j, ..)| first[*j] != 0) {
            break;
        }
    }
    Ok(first)
}

/// What is the same for every chunk of a recording.
#[derive(Clone, Debug)]
pub struct FollowOptions {
    /// Name of the recording.
    pub recording: String,
    /// Motion against the direction of travel that counts as a reversal only beyond this, m or rad, for each dyad.
    pub dead_bands: Vec<f64>,
    /// Directions of the first motion, from [`first_directions`].
    pub first_directions: Vec<i8>,
    /// A longer time between two samples is a pause, s.
    pub pause_after: f64,
    /// Direction of gravity in the base frame, [`gravity_of`]; where there is none, that of the machine file.
    pub gravity_b: Option<Vec3<f64>>,
    /// Names of the extra channels in the order of the chunks.
    pub channels: Vec<String>,
    /// Whether columns `gravity` and `load` are wanted.
    pub with_gravity: bool,
}

impl<'a, I: Iterator<Item = Result<Chunk>>> Follow<'a, I> {
    /// Follows the chunks of one recording from its first sample on.
    ///
    /// # Panics
    /// If the options do not have one entry per dyad.
    pub fn new(machine: &'a Machine, chunks: I, options: &FollowOptions) -> Self {
        let dyads = machine.dyads().len();
        assert_eq!(
            (options.dead_bands.len(), options.first_directions.len()),
            (dyads, dyads),
            "one entry per dyad"
        );
        Follow {
            machine,
            chunks,
            history: History::new(machine, &options.dead_bands, &options.first_directions),
            weights: options.with_gravity.then(|| Weights::new(machine, options.gravity_b)),
            held: None,
            before: Vec::new(),
            count: 0,
            pause_after: options.pause_after,
            recording: options.recording.clone(),
            channels: options.channels.clone(),
            ended: false,
        }
    }

    /// The columns beside `chunk`; `ahead` are the samples that follow it.
    fn columns(&mut self, chunk: &Chunk, ahead: Option<&Chunk>) -> Samples {
        let machine = self.machine;
        let commands = machine.commands().len();
        let mut joints: Vec<Option<JointSamples>> = vec![None; machine.dyads().len()];
        for (j, ..) in &self.history.joints {
            joints[*j] = Some(JointSamples::default());
        }
        let mut sweep = None;
        let mut moved = Vec::with_capacity(chunk.len);
        for (k, q) in chunk.commands.chunks_exact(commands).enumerate() {
            let displacements = machine.displacements(q);
            self.history.advance(|c| stated(chunk, c, k), &displacements);
            for (i, (j, ..)) in self.history.joints.iter().enumerate() {
                let Some(columns) = &mut joints[*j] else { continue };
                columns.position.push(displacements[*j]);
                columns.direction.push(f64::from(self.history.direction(i)));
                columns.since_reversal.push(self.history.since_reversal(i, displacements[*j]));
                columns.travelled.push(self.history.travelled[i]);
            }
            if let Some(weights) = &self.weights {
                let sweep = sweep.get_or_insert_with(|| weights.sweep(q));
                weights.sweep_into(q, sweep);
                let of = |column: &str| {
                    let channel = self.channels.iter().position(|name| name == column);
                    channel.map_or(f64::NAN, |i| chunk.channels[i][k])
                };
                let sides = weights.sides(machine, sweep, &displacements, of);
                for (j, columns) in joints.iter_mut().enumerate() {
                    let Some(columns) = columns else { continue };
                    weights.put(machine, (sweep, &sides), &displacements, j, columns);
                }
            }
            moved.push(displacements);
        }
        if let Some(times) = &chunk.time {
            self.rates(times, &moved, ahead, &mut joints);
        }
        let first = self.count == 0 && chunk.len > 0;
        let number = (self.count..self.count + chunk.len).map(|n| n as f64).collect();
        self.count += chunk.len;
        let channels = self.channels.iter().cloned().zip(chunk.channels.iter().cloned()).collect();
        let (recording, time) = (self.recording.clone(), chunk.time.clone());
        Samples { len: chunk.len, first, recording, number, time, joints, channels }
    }

    /// Velocities and accelerations, with what stands before and after the chunk.
    fn rates(
        &mut self,
        times: &[f64],
        moved: &[Vec<f64>],
        ahead: Option<&Chunk>,
        joints: &mut [Option<JointSamples>],
    ) {
        let commands = self.machine.commands().len();
        let lead = self.before.len();
        let mut all_times: Vec<f64> = self.before.iter().map(|(t, _)| *t).collect();
        let mut rows: Vec<&[f64]> = self.before.iter().map(|(_, row)| row.as_slice()).collect();
        all_times.extend(times);
        rows.extend(moved.iter().map(Vec::as_slice));
        let next: Vec<Vec<f64>> = ahead.map_or_else(Vec::new, |chunk| {
            let rows = chunk.commands.chunks_exact(commands).take(LOOK_AHEAD);
            rows.map(|q| self.machine.displacements(q)).collect()
        });
        if let Some(times) = ahead.and_then(|chunk| chunk.time.as_ref()) {
            all_times.extend(times.iter().take(LOOK_AHEAD));
            rows.extend(next.iter().map(Vec::as_slice));
        }
        let weights: Vec<Rates> =
            (lead..lead + times.len()).map(|k| Rates::at(&all_times, k, self.pause_after)).collect();
        for (j, columns) in joints.iter_mut().enumerate() {
            let Some(columns) = columns else { continue };
            let positions: Vec<f64> = rows.iter().map(|row| row[j]).collect();
            (columns.velocity, columns.acceleration) = weights.iter().map(|w| w.of(&positions)).unzip();
        }
        let keep = moved.len().saturating_sub(LOOK_AHEAD);
        let tail = times.iter().copied().zip(moved.iter().cloned()).skip(keep);
        self.before.extend(tail);
        let surplus = self.before.len().saturating_sub(LOOK_AHEAD);
        self.before.drain(..surplus);
    }
}

impl<I: Iterator<Item = Result<Chunk>>> Iterator for Follow<'_, I> {
    type Item = Result<(Chunk, Samples)>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.ended || self.held.is_some() {
            let next = match if self.ended { None } else { self.chunks.next() } {
                Some(Err(error)) => {
                    (self.ended, self.held) = (true, None);
                    return Some(Err(error));
                }
                Some(Ok(chunk)) => Some(chunk),
                None => {
                    self.ended = true;
                    None
                }
            };
            if let Some(chunk) = self.held.take() {
                let samples = self.columns(&chunk, next.as_ref());
                self.held = next;
                return Some(Ok((chunk, samples)));
            }
            self.held = next;
        }
        None
    }
}

/// All samples of a recording, for those that fit into memory.
///
/// # Errors
/// As [`Recording::chunks`].
pub fn samples_of(recording: &Recording, machine: &Machine, dead_bands: &[f64]) -> Result<Vec<Samples>> {
    let first = first_directions(machine, dead_bands, recording.chunks()?)?;
    let options = FollowOptions {
        recording: recording.name().to_string(),
        dead_bands: dead_bands.to_vec(),
        first_directions: first,
        pause_after: recording.scan()?.pause_after.unwrap_or(f64::INFINITY),
        gravity_b: gravity_of(recording, machine, None),
        channels: recording.extra_channels().iter().map(|c| c.name.clone()).collect(),
        with_gravity: true,
    };
    Follow::new(machine, recording.chunks()?, &options).map(|item| item.map(|(_, samples)| samples)).collect()
}

#[cfg(test)]
mod tests {
    use super::{FAR, JointSamples, Samples};

    #[test]
    fn a_joint_that_moves_at_once_may_have_turned_round_just_before_as_one_that_rests_may() {
        let one = |travelled: &[f64], since: &[f64]| JointSamples {
            direction: vec![1.0; travelled.len()],
            since_reversal: since.to_vec(),
            travelled: travelled.to_vec(),
            ..JointSamples::default()
        };
        let moves = one(&[0.0, 0.1, 0.2], &[FAR, FAR, FAR]);
        // It turns round before its last sample: what follows that is known.
        let rests = one(&[0.0, 0.0, 0.3], &[FAR, FAR, 0.1]);
        let turned =
            Samples { len: 3, joints: vec![Some(moves), Some(rests)], ..Samples::default() }.turned_before();
        let of =
            |j: usize| turned.joints[j].as_ref().map(|of| (of.direction.clone(), of.since_reversal.clone()));
        assert_eq!(of(0), Some((vec![-1.0, 1.0, 1.0], vec![0.0, 0.1, 0.2])));
        assert_eq!(of(1), Some((vec![-1.0, -1.0, 1.0], vec![0.0, 0.0, 0.1])));
    }
}

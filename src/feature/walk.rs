//! Features along positions that come one by one and are no recording: those of an NC program, or of a simulation.

use super::samples::History;
use super::weights::Weights;
use super::{Feature, JointSamples, Memory, Samples};
use crate::chain::Sweep;
use crate::machine::Machine;
use crate::motion::{LOOK_AHEAD, Rates};

/// Walks along positions with all that features remember.
#[derive(Clone)]
pub(crate) struct Walk {
    features: Vec<Feature>,
    history: History,
    memories: Vec<Memory<f64>>,
    /// Memories, paths and positions before the last step.
    before: Before,
    weights: Option<(Weights, Sweep<f64>)>,
    /// Times and displacements of the last steps, for rates.
    recent: Vec<(f64, Vec<f64>)>,
    started: bool,
}

#[derive(Clone)]
struct Before {
    memories: Vec<Memory<f64>>,
    travelled: Vec<f64>,
    last: Vec<f64>,
    started: bool,
    time: Option<f64>,
}

/// Where a joint is looked at: displacement, path travelled, velocity and acceleration.
type Look = (f64, f64, Option<(f64, f64)>);

impl std::fmt::Debug for Walk {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Walk").field("features", &self.features).finish_non_exhaustive()
    }
}

impl Walk {
    /// Nothing has moved yet. `dead_bands` and `first` (directions of the first motion, 0 where it is not known) by dyad.
    pub fn new(machine: &Machine, features: Vec<Feature>, dead_bands: &[f64], first: &[i8]) -> Self {
        let history = History::new(machine, dead_bands, first);
        let memories: Vec<Memory<f64>> = features.iter().map(Memory::new).collect();
        let weights = features.iter().any(Feature::needs_gravity).then(|| {
            let weights = Weights::new(machine, None);
            let sweep = weights.sweep(&vec![0.0; machine.commands().len()]);
            (weights, sweep)
        });
        let before = Before {
            memories: memories.clone(),
            travelled: history.travelled.clone(),
            last: history.last.clone(),
            started: false,
            time: None,
        };
        Walk { features, history, memories, before, weights, recent: Vec::new(), started: false }
    }

    /// Goes on to commands `q` (m or rad); the values of all features there. `time`: s, where there is a clock; with `rates`, it
    /// runs, and velocities follow from the last steps. `stated`: directions of approach by command.
    pub fn step(
        &mut self,
        machine: &Machine,
        q: &[f64],
        time: Option<f64>,
        rates: bool,
        stated: impl Fn(usize) -> Option<i8>,
    ) -> Vec<f64> {
        self.before = Before {
            memories: self.memories.clone(),
            travelled: self.history.travelled.clone(),
            last: self.history.last.clone(),
            started: self.started,
            time,
        };
        let displacements = machine.displacements(q);
        self.history.advance(stated, &displacements);
        let speeds = time.filter(|_| rates).map(|time| self.rates(time, &displacements));
        let look = |i: usize, j: usize| {
            (displacements[j], self.history.travelled[i], speeds.as_ref().map(|speeds| speeds[j]))
        };
        let samples = self.samples(machine, q, time, !self.started, look);
        self.started = true;
        let all = self.features.iter().zip(&mut self.memories);
        all.map(|(feature, memory)| value(feature, &samples, memory)).collect()
    }

    /// Values of all features where the last step passes `q`; the walk stays where it is.
    pub fn passing(&self, machine: &Machine, q: &[f64]) -> Vec<f64> {
        let displacements = machine.displacements(q);
        let look = |i: usize, j: usize| {
            let last = self.before.last[i];
            let gone = if last.is_finite() { (displacements[j] - last).abs() } else { 0.0 };
            (displacements[j], self.before.travelled[i] + gone, None)
        };
        let samples = self.samples(machine, q, self.before.time, !self.before.started, look);
        let mut memories = self.before.memories.clone();
        let all = self.features.iter().zip(&mut memories);
        all.map(|(feature, memory)| value(feature, &samples, memory)).collect()
    }

    /// Directions of travel of the joints that features with history depend on.
    pub fn directions(&self) -> Vec<i8> {
        let keyed: Vec<usize> =
            self.features.iter().filter(|f| f.needs_history()).flat_map(Feature::joints).collect();
        let joints = self.history.joints.iter().enumerate();
        joints.filter(|(_, (j, ..))| keyed.contains(j)).map(|(i, _)| self.history.direction(i)).collect()
    }

    fn samples(
        &self,
        machine: &Machine,
        q: &[f64],
        time: Option<f64>,
        first: bool,
        look: impl Fn(usize, usize) -> Look,
    ) -> Samples {
        let mut joints: Vec<Option<JointSamples>> = vec![None; machine.dyads().len()];
        let displacements = machine.displacements(q);
        let loads = self.weights.as_ref().map(|(weights, sweep)| {
            let mut sweep = sweep.clone();
            weights.sweep_into(q, &mut sweep);
            // Nobody says where a side branch stands: what depends on it was left out.
            let sides = weights.sides(machine, &sweep, &displacements, |_| f64::NAN);
            (weights, sweep, sides)
        });
        for (i, (j, ..)) in self.history.joints.iter().enumerate() {
            let (position, travelled, speeds) = look(i, *j);
            let mut columns = JointSamples {
                position: vec![position],
                direction: vec![f64::from(self.history.direction(i))],
                since_reversal: vec![self.history.since_reversal(i, position)],
                travelled: vec![travelled],
                velocity: speeds.iter().map(|s| s.0).collect(),
                acceleration: speeds.iter().map(|s| s.1).collect(),
                ..JointSamples::default()
            };
            if let Some((weights, sweep, sides)) = &loads {
                weights.put(machine, (sweep, sides), &displacements, *j, &mut columns);
            }
            joints[*j] = Some(columns);
        }
        let time = time.map(|t| vec![t]);
        Samples { len: 1, first, time, joints, ..Samples::default() }
    }

    /// Velocity and acceleration of every dyad's joint, from this step and those before it.
    fn rates(&mut self, time: f64, displacements: &[f64]) -> Vec<(f64, f64)> {
        let surplus = self.recent.len().saturating_sub(LOOK_AHEAD);
        self.recent.drain(..surplus);
        self.recent.push((time, displacements.to_vec()));
        let times: Vec<f64> = self.recent.iter().map(|(t, _)| *t).collect();
        let last = times.len() - 1;
        // Two steps that differ by far are a pause between them.
        let usual = last.checked_sub(1).map_or(f64::INFINITY, |one| 10.0 * (times[last] - times[one]));
        let rates = Rates::at(&times, last, usual);
        let of = |j: usize| rates.of(&self.recent.iter().map(|(_, row)| row[j]).collect::<Vec<_>>());
        (0..displacements.len()).map(of).collect()
    }
}

fn value(feature: &Feature, samples: &Samples, memory: &mut Memory<f64>) -> f64 {
    feature.column(samples, &[], 1.0, memory).first().copied().unwrap_or(f64::NAN)
}

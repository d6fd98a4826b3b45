//! The simulated machine: everything that is wrong with it, and the deviations that hold at a sample.

use std::fmt;
use std::sync::Arc;

use super::course::Sample;
use super::faults::{Faults, Width};
use super::random_deviations;
use crate::calibration::{CalibratedMachine, LeftOut, terms};
use crate::chain::Chain;
use crate::effects::StoredEffect;
use crate::error::Result;
use crate::feature::Walk;
use crate::identify::by_dyad;
use crate::lie::{Pose, Twist};
use crate::machine::Machine;
use crate::motion::{Play, Tracker};
use crate::variation::{Slot, Variation, Varying};

/// Movements below this do not count as the first motion of a joint, m or rad: rounding of solved axes.
const FIRST_MOTION: f64 = 1e-9;

/// A deviation that depends on where the machine stands: displacements of all dyads' joints (m or rad, machine order).
type ByPosition = Arc<dyn Fn(&[f64]) -> Twist<f64> + Send + Sync>;

/// A machine with everything that is wrong with it.
///
/// Constant deviations of initial poses, joint twists and displacements come down to one twist `dh` per dyad; what directions of
/// travel add to it, play, and what else depends on position comes sample by sample, in [`Plant::advance`] and nowhere else.
#[derive(Clone)]
pub struct Plant {
    machine: Machine,
    /// Constant deviations, one per dyad.
    constant: Vec<Twist<f64>>,
    backlash: Vec<(usize, Width)>,
    varying: Vec<(usize, ByPosition)>,
    /// What a calibrated file says of directions of travel, and the terms of its effects.
    by_direction: Variation,
    /// The named effects that the terms belong to.
    effects: Vec<StoredEffect>,
    /// Effects that cannot be simulated, and why.
    left_out: Vec<LeftOut>,
    /// Frame `w` of the instrument in the machine's frame `w`.
    w_from_instrument: Option<Pose<f64>>,
}

impl fmt::Debug for Plant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Plant")
            .field("machine", &self.machine.name())
            .field("constant", &self.constant)
            .field("backlash", &self.backlash)
            .field("by_direction", &self.by_direction.varying.directions)
            .field("varying", &self.varying.iter().map(|(j, _)| j).collect::<Vec<_>>())
            .finish()
    }
}

/// Where a plant stands: the chain at the last sample, and the history that play remembers.
#[derive(Clone, Debug)]
pub struct State {
    chain: Chain<f64>,
    deviations: Vec<Twist<f64>>,
    displacements: Vec<f64>,
    /// One per entry of the plant's backlash.
    plays: Vec<Option<Play>>,
    first: Vec<i8>,
    tracker: Tracker,
    /// The pattern of directions that holds, and what it adds to the constant deviations.
    piece: Option<usize>,
    parts: Vec<Twist<f64>>,
    /// What the features of effects remember.
    walk: Option<Walk>,
    /// What effects add behind the joints.
    behind: Vec<Twist<f64>>,
    /// What effects add to readings: reading, kind of instrument (any if `None`), m or rad.
    added: Vec<(usize, Option<Arc<str>>, f64)>,
    /// What the clock of the call is ahead of the course, s.
    pub(super) later: f64,
}

impl State {
    /// The chain that holds at the last sample.
    pub fn chain(&self) -> &Chain<f64> {
        &self.chain
    }

    /// Deviations of all dyads at the last sample, m and rad.
    pub fn deviations(&self) -> &[Twist<f64>] {
        &self.deviations
    }

    /// What effects add behind the joints of all dyads at the last sample, m and rad.
    pub fn behind(&self) -> &[Twist<f64>] {
        &self.behind
    }

    /// What effects add to reading `i` of an instrument of this kind at the last sample, m or rad.
    pub fn added(&self, i: usize, kind: &str) -> f64 {
        let own = |(reading, of, _): &&(usize, Option<Arc<str>>, f64)| {
            *reading == i && of.as_ref().is_none_or(|of| &**of == kind)
        };
        self.added.iter().filter(own).map(|(.., value)| value).sum()
    }

    /// Commanded displacements of all dyads' joints at the last sample, m or rad.
    pub fn displacements(&self) -> &[f64] {
        &self.displacements
    }
}

impl Plant {
    /// A machine file as it is, with its deviations if it is calibrated: the constant ones, those that change with directions of
    /// travel, and its named effects as far as they need no channel of a recording.
    pub fn new(machine: &CalibratedMachine) -> Self {
        let (by_direction, left_out) = machine.variation_without(|_, features| {
            let (name, unit) = features.iter().flat_map(|f| f.channels()).next()?;
            Some(format!("it depends on {name}[{unit}], which is not simulated"))
        });
        let used = |e: &&StoredEffect| !left_out.iter().any(|l| l.effect == e.effect && l.at == e.at);
        Plant {
            effects: machine.effects().iter().filter(used).cloned().collect(),
            machine: machine.machine().clone(),
            constant: machine.deviations().to_vec(),
            backlash: Vec::new(),
            varying: Vec::new(),
            by_direction,
            left_out,
            w_from_instrument: None,
        }
    }

    /// Deviations of every dyad drawn from the machine's tolerances times `size`, added to those that are there.
    #[must_use]
    pub fn with_random(mut self, size: f64, seed: u64) -> Self {
        let random = random_deviations(&self.machine, size, seed);
        self.constant.iter_mut().zip(random).for_each(|(dh, more)| *dh = *dh + more);
        self
    }

    /// Adds faults: deviations add up, then factors, displacements and twists change the initial poses exactly,
    ///
    /// ```math
    /// M_j exp(dh_j) exp(d_j) exp(xi_j (q_j + offset_j)) exp(-d_j)          d_j: displaced axis
    /// ```
    ///
    /// and what stands behind the joint goes into the next dyad.
    #[must_use]
    pub fn with_faults(mut self, faults: &Faults) -> Self {
        for (j, dh) in &faults.deviations {
            self.constant[*j] = self.constant[*j] + *dh;
        }
        let dyads = self.machine.dyads();
        let mut actual: Vec<Pose<f64>> = dyads
            .iter()
            .zip(&self.constant)
            .map(|(dyad, dh)| dyad.placement.pose() * Pose::exp(*dh))
            .collect();
        for (j, d) in &faults.factors {
            // The factor of the workpiece branch is the inverse of the pose.
            actual[*j] = match *j < self.machine.workpiece_count() {
                true => Pose::exp(-*d) * actual[*j],
                false => actual[*j] * Pose::exp(*d),
            };
        }
        for (j, d) in &faults.twists {
            // A joint is never the last dyad of its branch.
            actual[*j] = actual[*j] * Pose::exp(*d);
            actual[*j + 1] = Pose::exp(-*d) * actual[*j + 1];
        }
        for (j, offset) in &faults.displacements {
            if let Some(joint) = &dyads[*j].joint {
                actual[*j] = actual[*j] * Pose::exp(joint.twist().times(*offset));
            }
        }
        let touched =
            !(faults.factors.is_empty() && faults.displacements.is_empty() && faults.twists.is_empty());
        if touched {
            for (j, dh) in self.constant.iter_mut().enumerate() {
                *dh = (dyads[j].placement.pose().inverse() * actual[j]).log();
            }
        }
        self.backlash.extend(faults.backlash.iter().cloned());
        for effect in &faults.effects {
            // The reader of faults has bound it once.
            let Ok(own) = terms(&self.machine, effect) else { continue };
            for (value, term) in own {
                self.by_direction.varying.terms.push(term);
                self.by_direction.coefficients.push(value);
            }
            self.effects.push(effect.clone());
        }
        self
    }

    /// Adds a deviation of dyad `j` that depends on the displacements of all dyads' joints (m or rad, machine order).
    #[must_use]
    pub fn with_varying(
        mut self,
        j: usize,
        deviation: impl Fn(&[f64]) -> Twist<f64> + Send + Sync + 'static,
    ) -> Self {
        self.varying.push((j, Arc::new(deviation)));
        self
    }

    /// Stands the instrument's frame `w` elsewhere: its pose in the frame `w` of the machine.
    #[must_use]
    pub fn with_instrument_frame(mut self, w_from_instrument: Pose<f64>) -> Self {
        self.w_from_instrument = Some(w_from_instrument);
        self
    }

    /// The machine as declared.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Constant deviations of all dyads, m and rad.
    pub fn constant(&self) -> &[Twist<f64>] {
        &self.constant
    }

    /// Whether there is more than constant deviations.
    pub fn varies(&self) -> bool {
        !(self.backlash.is_empty()
            && self.varying.is_empty()
            && self.by_direction.varying.is_constant()
            && self.by_direction.motions.is_empty())
    }

    /// Whether deviations depend on position: play, or what [`Plant::with_varying`] added.
    pub fn varies_with_position(&self) -> bool {
        !(self.backlash.is_empty() && self.varying.is_empty())
    }

    /// Whether deviations change with directions of travel, as a calibrated file says.
    pub fn varies_with_direction(&self) -> bool {
        self.by_direction.varying.directions.is_some()
    }

    /// The calibrated machine that this plant was made from, with all that a file can hold of it: not the play of
    /// [`Faults::backlash`].
    pub fn truth(&self, machine: &CalibratedMachine) -> CalibratedMachine {
        let plain = machine.clone().with_deviations(self.constant.clone());
        let own = machine.effects().len() - self.left_out.len();
        let more = self.effects.get(own..).unwrap_or_default().to_vec();
        if more.is_empty() {
            return plain;
        }
        let mut bands = self.by_direction.dead_bands.clone();
        bands.resize(self.machine.commands().len(), 0.0);
        plain.clone().with_effects(more, bands).unwrap_or(plain)
    }

    /// Named effects that are simulated: those of the calibrated file, then those of faults.
    pub fn effects(&self) -> &[StoredEffect] {
        &self.effects
    }

    /// Those that are not, and why.
    pub fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }

    /// Directions of the first motion over the samples: of every joint with play, in the order of the backlash; then, where
    /// deviations change with directions of travel, of every command.
    ///
    /// # Errors
    /// The first one of the samples.
    pub fn first_directions(&self, samples: impl Iterator<Item = Result<Sample>>) -> Result<Vec<i8>> {
        let Varying { directions, terms } = &self.by_direction.varying;
        let plays = self.backlash.len();
        let mut first = vec![0i8; plays];
        let mut start: Option<Vec<f64>> = None;
        let mut tracker = self.tracker(&[]);
        let every: Vec<usize> = (0..self.machine.commands().len()).collect();
        let keyed: &[usize] = match directions {
            _ if !terms.is_empty() => &every,
            Some(directions) => directions.axes(),
            None => &[],
        };
        first.resize(plays + if keyed.is_empty() { 0 } else { self.machine.commands().len() }, 0);
        let found =
            |first: &[i8]| !first[..plays].contains(&0) && keyed.iter().all(|c| first[plays + c] != 0);
        if found(&first) {
            return Ok(first);
        }
        for sample in samples {
            let sample = sample?;
            let s = self.machine.displacements(&sample.q);
            let start = start.get_or_insert_with(|| s.clone());
            for (first, (j, _)) in first.iter_mut().zip(&self.backlash).filter(|(first, _)| **first == 0) {
                let stated = self.stated(&sample, *j);
                let gone = s[*j] - start[*j];
                if stated != 0 {
                    *first = stated;
                } else if gone.abs() > FIRST_MOTION {
                    *first = if gone > 0.0 { 1 } else { -1 };
                }
            }
            if !keyed.is_empty() {
                tracker.advance(&sample.q, |c| stated_of_command(&sample, c));
                let now = tracker.directions();
                first[plays..].iter_mut().zip(now).filter(|(f, _)| **f == 0).for_each(|(f, now)| *f = now);
            }
            if found(&first) {
                break;
            }
        }
        Ok(first)
    }

    /// Follows the directions of travel of all commands; `first` as in [`Tracker::new`], or empty.
    fn tracker(&self, first: &[i8]) -> Tracker {
        let commands = self.machine.commands().len();
        let mut bands = self.by_direction.dead_bands.clone();
        bands.resize(commands, 0.0);
        let mut first = first.to_vec();
        first.resize(commands, 0);
        Tracker::new(bands, first)
    }

    /// Nothing has moved yet. `first`: from [`Plant::first_directions`].
    pub fn start(&self, first: Vec<i8>) -> State {
        let mut chain = Chain::new(&self.machine, &self.constant);
        if let Some(shift) = self.w_from_instrument {
            let w = self.machine.w_index();
            chain.set_previous_from_frame(w, chain.previous_from_frame(w) * shift);
        }
        let by_command = first.get(self.backlash.len()..).unwrap_or_default();
        let walk = (!self.by_direction.varying.terms.is_empty()).then(|| self.walk(by_command));
        State {
            walk,
            behind: vec![Twist::zero(0.0); self.constant.len()],
            added: Vec::new(),
            later: 0.0,
            chain,
            deviations: self.constant.clone(),
            displacements: vec![0.0; self.constant.len()],
            plays: vec![None; self.backlash.len()],
            tracker: self.tracker(first.get(self.backlash.len()..).unwrap_or_default()),
            first,
            piece: None,
            parts: vec![Twist::zero(0.0); self.constant.len()],
        }
    }

    /// Features of effects from the start; `first`: directions of the first motion by command.
    fn walk(&self, first: &[i8]) -> Walk {
        let machine = &self.machine;
        let of = |j: usize| {
            let terms = machine.drive(j).map_or(&[][..], |drive| &drive.terms);
            let sum: f64 =
                terms.iter().map(|(c, factor)| factor * f64::from(first.get(*c).copied().unwrap_or(0))).sum();
            if sum == 0.0 { 0 } else { sum.signum() as i8 }
        };
        let first: Vec<i8> = (0..self.constant.len()).map(of).collect();
        let mut bands = self.by_direction.dead_bands.clone();
        bands.resize(machine.commands().len(), 0.0);
        let features = self.by_direction.varying.features().cloned().collect();
        Walk::new(machine, features, &by_dyad(machine, &bands), &first)
    }

    /// Direction of approach that a sample states for the joint of dyad `j`; 0 where it says nothing.
    fn stated(&self, sample: &Sample, j: usize) -> i8 {
        let (Some(directions), Some(drive)) = (&sample.directions, self.machine.drive(j)) else { return 0 };
        let sum: f64 = drive.terms.iter().map(|(c, factor)| factor * f64::from(directions[*c])).sum();
        if sum == 0.0 { 0 } else { sum.signum() as i8 }
    }

    /// The machine at the next sample: the deviations and the chain that hold there.
    pub fn advance(&self, state: &mut State, sample: &Sample) {
        state.displacements = self.machine.displacements(&sample.q);
        let s = &state.displacements;
        let mut touched = vec![false; self.constant.len()];
        if let Some(directions) = &self.by_direction.varying.directions {
            state.tracker.advance(&sample.q, |c| stated_of_command(sample, c));
            let piece = directions.piece(&state.tracker.directions());
            if state.piece.replace(piece) != Some(piece) {
                // (29)
                state.parts = self.by_direction.direction_part(piece, self.constant.len());
                for (j, part) in state.parts.iter().enumerate() {
                    state.deviations[j] = self.constant[j] + *part;
                }
                touched.fill(true);
            }
        }
        let mut varied = vec![false; self.constant.len()];
        let mut touch = |deviations: &mut [Twist<f64>], j: usize, more: Twist<f64>| {
            if !std::mem::replace(&mut varied[j], true) {
                deviations[j] = self.constant[j] + state.parts[j];
            }
            touched[j] = true;
            deviations[j] = deviations[j] + more;
        };
        for (i, (j, width)) in self.backlash.iter().enumerate() {
            let (q, width) = (s[*j], width.at(s[*j]));
            let stated = self.stated(sample, *j);
            let play = match &mut state.plays[i] {
                // A settled position: the drive came from that side, and further than the play is wide.
                play if stated != 0 => play.insert(Play::new(q, width.max(0.0), stated)),
                play => play.get_or_insert_with(|| {
                    Play::new(q, width.max(0.0), state.first.get(i).copied().unwrap_or(0))
                }),
            };
            let error = play.advance(q, width);
            if let Some(joint) = &self.machine.dyads()[*j].joint {
                touch(&mut state.deviations, *j, joint.twist().times(error));
            }
        }
        let motions = &self.by_direction.motions.joints;
        let keyed = !motions.is_empty() && self.by_direction.varying.directions.is_some();
        let directions = if keyed { state.tracker.directions() } else { Vec::new() };
        for motion in motions {
            let j = motion.dyad;
            touch(&mut state.deviations, j, motion.at(&self.machine, s[j], &directions));
        }
        for (j, deviation) in &self.varying {
            touch(&mut state.deviations, *j, deviation(s));
        }
        if let Some(walk) = &mut state.walk {
            let time = Some(sample.time + state.later);
            let values = walk.step(&self.machine, &sample.q, time, true, |c| stated_of_command(sample, c));
            let mut values = values.into_iter();
            state.behind.fill(Twist::zero(0.0));
            state.added.clear();
            let Variation { varying, coefficients, .. } = &self.by_direction;
            // Terms without a name stand before all others.
            let named: usize = self.effects.iter().map(|e| e.terms.len()).sum();
            let owners = std::iter::repeat_n(None, varying.terms.len() - named)
                .chain(self.effects.iter().flat_map(|e| e.terms.iter().map(move |_| Some(e))));
            for ((term, coefficient), effect) in varying.terms.iter().zip(coefficients).zip(owners) {
                for part in &term.parts {
                    let by = coefficient * values.next().unwrap_or(0.0);
                    match part.slot {
                        Slot::Before(j) => touch(&mut state.deviations, j, part.direction.times(by)),
                        Slot::After(j) => state.behind[j] = state.behind[j] + part.direction.times(by),
                        Slot::Reading => {
                            let kind = effect.and_then(|e| e.instrument.as_deref());
                            let weights = part.direction.to_array().into_iter().enumerate();
                            let added = weights.filter(|(_, weight)| *weight != 0.0);
                            state.added.extend(added.map(|(i, w)| (i, kind.map(Arc::from), w * by)));
                        }
                    }
                }
            }
            for part in varying.terms.iter().flat_map(|term| &term.parts) {
                if let Slot::After(j) = part.slot {
                    state.chain.set_carried(j, Pose::exp(state.behind[j]));
                }
            }
        }
        for j in (0..touched.len()).filter(|j| touched[*j]) {
            let mut pose = self.machine.dyads()[j].placement.pose() * Pose::exp(state.deviations[j]);
            if let Some(shift) = self.w_from_instrument.filter(|_| j == self.machine.w_index()) {
                pose = pose * shift;
            }
            state.chain.set_previous_from_frame(j, pose);
        }
    }
}

/// Direction of approach that a sample states for a command; `None` where it has no such columns.
fn stated_of_command(sample: &Sample, command: usize) -> Option<i8> {
    sample.directions.as_ref().and_then(|directions| directions.get(command).copied())
}

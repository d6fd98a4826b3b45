//! What a scheme moves: initial poses, and what the recordings declare unknown of their set-ups.

use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::error::Result;
use crate::identify::{Loss, SetUpValues, Sources, fit_setup};
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::Machine;
use crate::recording::Recording;
use crate::variation::CONSTANT;

/// Present values. A product of exponentials in the base frame is kept as a chain too: a unit twist is its joint's twist in a frame
/// that stands elsewhere, so that both kinds of model are evaluated by the same functions and have the same result.
#[derive(Clone, Debug)]
pub(super) struct State {
    /// Each frame in the one before it, machine order; that of `w` is not used.
    pub links: Vec<Pose<f64>>,
    /// Frame `w` in the frame before it, by set-up.
    pub frames_w: Vec<Pose<f64>>,
    /// What else is unknown of the set-ups.
    pub set_ups: SetUpValues,
}

/// The machine as declared, with the set-ups that the recordings declare unknown found.
pub(super) fn declared(machine: &Machine, recordings: &[Recording]) -> Result<CalibratedMachine> {
    let sources = Sources::new(recordings, machine, &CONSTANT, &[], &|_| {})?;
    let state = State::declared(machine, recordings, &sources)?;
    Ok(state.calibrated(machine, &sources))
}

impl State {
    /// Everything as declared; what the recordings declare unknown is found first, the machine held.
    pub fn declared(machine: &Machine, recordings: &[Recording], sources: &Sources) -> Result<Self> {
        let links: Vec<Pose<f64>> = machine.dyads().iter().map(|d| d.placement.pose()).collect();
        let mut state = State {
            frames_w: vec![links[machine.w_index()]; sources.setups.len()],
            links,
            set_ups: SetUpValues::zero(sources),
        };
        let given = sources.tool_points.is_empty()
            && sources.tool_rotations.is_empty()
            && sources.zeros.is_empty()
            && sources.lengths.is_empty();
        if given && !sources.frame_unknown.contains(&true) {
            return Ok(state);
        }
        let placed = fit_setup(&CalibratedMachine::nominal(machine.clone()), recordings, Loss::Squares)?;
        for (s, name) in sources.setups.iter().enumerate() {
            let found = placed.setups().find(|(known, _)| known == name);
            if let Some((_, frame)) = found.filter(|_| sources.frame_unknown[s]) {
                state.frames_w[s] = frame;
            }
        }
        for (i, name) in sources.tool_points.iter().enumerate() {
            state.set_ups.tool_points[i] =
                placed.tool_points().find(|(known, _)| known == name).map_or(Vec3([0.0; 3]), |p| p.1);
        }
        for (i, name) in sources.tool_rotations.iter().enumerate() {
            if let Some((_, rotation)) = placed.tool_rotations.iter().find(|(known, _)| known == name) {
                state.set_ups.tool_rotations[i] = *rotation;
            }
        }
        for (i, (s, of)) in sources.zeros.iter().enumerate() {
            let own = placed.zeros().find(|(setup, known, _)| *setup == sources.setups[*s] && known == of);
            state.set_ups.zeros[i] = own.map_or(0.0, |z| z.2);
        }
        for (i, s) in sources.lengths.iter().enumerate() {
            let own = placed.lengths().find(|(setup, _)| *setup == sources.setups[*s]);
            state.set_ups.lengths[i] = own.map_or(0.0, |l| l.1);
        }
        Ok(state)
    }

    /// The chain that a set-up sees.
    pub fn chain(&self, machine: &Machine, setup: usize) -> Chain<f64> {
        let mut chain = Chain::nominal(machine);
        for (j, link) in self.links.iter().enumerate() {
            chain.set_previous_from_frame(j, *link);
        }
        chain.set_previous_from_frame(machine.w_index(), self.frames_w[setup]);
        chain
    }

    /// The machine with what was found: each frame's `log(M⁻¹ E)`.
    pub fn calibrated(&self, machine: &Machine, sources: &Sources) -> CalibratedMachine {
        let deviation =
            |j: usize, link: &Pose<f64>| (machine.dyads()[j].placement.pose().inverse() * *link).log();
        let mut deviations: Vec<Twist<f64>> =
            self.links.iter().enumerate().map(|(j, link)| deviation(j, link)).collect();
        let w = machine.w_index();
        let known: Vec<_> = (0..sources.setups.len()).filter(|s| !sources.frame_unknown[*s]).collect();
        let sum = known.iter().fold(Twist::zero(0.0), |sum, s| sum + deviation(w, &self.frames_w[*s]));
        deviations[w] = sum.times(1.0 / known.len().max(1) as f64);
        let mut calibrated = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations);
        let setup = |s: usize| sources.setups[s].clone();
        calibrated.setups = (0..sources.setups.len()).map(|s| (setup(s), self.frames_w[s])).collect();
        calibrated.tool_points =
            sources.tool_points.iter().cloned().zip(self.set_ups.tool_points.iter().copied()).collect();
        calibrated.tool_rotations =
            sources.tool_rotations.iter().cloned().zip(self.set_ups.tool_rotations.iter().copied()).collect();
        calibrated.zeros = (sources.zeros.iter().zip(&self.set_ups.zeros))
            .map(|((s, of), z)| (setup(*s), of.clone(), *z))
            .collect();
        calibrated.lengths =
            sources.lengths.iter().zip(&self.set_ups.lengths).map(|(s, l)| (setup(*s), *l)).collect();
        calibrated
    }
}

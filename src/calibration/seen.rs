//! Where the recordings of a calibrated machine went, and how far beyond that it is sent.

use std::f64::consts::TAU;

use super::CalibratedMachine;
use crate::machine::{Joint, JointKind};

impl CalibratedMachine {
    /// Range of a command in the recordings it was calibrated on, m or rad.
    pub fn seen(&self, command: usize) -> Option<(f64, f64)> {
        self.seen[command]
    }

    /// Whether a vector of commands leaves what the calibration has seen by more than 1 % of the range of any joint.
    pub fn extrapolates(&self, commands: &[f64]) -> bool {
        (0..self.seen.len().min(commands.len())).any(|c| self.beyond(c, commands[c]).is_some())
    }

    /// By how much a command lies beyond the range that the calibration has seen, m or rad, if by more than 1 % of that range. Whole turns
    /// do not count where the machine is the same after them.
    ///
    /// `command`: index in [`Machine::commands`](crate::machine::Machine::commands); `q`: m or rad.
    pub fn beyond(&self, command: usize, q: f64) -> Option<f64> {
        let (from, to) = self.seen.get(command).copied().flatten()?;
        let slack = 0.01 * (to - from) + 1e-9;
        let outside = |q: f64| (from - q).max(q - to);
        let mut beyond = outside(q);
        if beyond > slack && self.repeats(command) {
            // The copy of the command next above the range, and the one below that.
            let above = from + (q - from).rem_euclid(TAU);
            beyond = outside(above).min(outside(above - TAU));
        }
        (beyond > slack).then_some(beyond)
    }

    /// Whether the model is the same after a whole turn of a command: it moves revolute joints alone, each by whole turns, and no
    /// deviation depends on where they stand.
    fn repeats(&self, command: usize) -> bool {
        let variation = &self.variation;
        let machine = &self.machine;
        let whole = |(j, joint): (usize, &Joint)| {
            let terms = machine.drive(j).map_or(&[][..], |drive| &drive.terms);
            let mut own = terms.iter().filter(|(c, factor)| *c == command && *factor != 0.0);
            own.all(|(_, factor)| joint.kind == JointKind::Revolute && factor.fract() == 0.0)
        };
        variation.varying.terms.is_empty() && variation.motions.is_empty() && machine.joints().all(whole)
    }

    /// The commands nearest to these that the calibration has seen, m or rad; those of turning joints may be whole turns away.
    pub fn nearest_seen(&self, commands: &[f64]) -> Vec<f64> {
        let nearest = |c: usize| {
            let q = commands[c];
            let Some((from, to)) = self.seen[c] else { return q };
            let turns = match self.machine.command_joint(c).kind {
                JointKind::Revolute if q < from => ((from - q) / TAU).ceil(),
                JointKind::Revolute if q > to => ((to - q) / TAU).floor(),
                _ => 0.0,
            };
            let turned = q + turns * TAU;
            if (from..=to).contains(&turned) { turned } else { q.clamp(from, to) }
        };
        (0..commands.len()).map(nearest).collect()
    }
}

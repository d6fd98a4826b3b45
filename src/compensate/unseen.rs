//! What combinations of deviations that no recording has shown would do to the moves of a program,
//! `docs/compensate.md` (C13).

use super::control::Control;
use super::report::{Unseen, UnseenPattern};
use crate::identify::COMPONENTS;
use crate::lie::{Twist, Vec3};
use crate::machine::Machine;

/// Sums of squares over the moves.
#[derive(Clone, Debug, Default)]
pub(super) struct UnseenSums {
    /// By pattern: of the tip, m^2, and of the tool axis, rad^2.
    sums: Vec<(f64, f64)>,
    moves: u64,
}

impl UnseenSums {
    /// One more move, which ends with the joints at `q`.
    pub fn add(&mut self, control: &Control, patterns: &[Vec<Twist<f64>>], q: &[f64]) {
        let sweep = control.nominal().sweep(q);
        let w_from_tip = sweep.w_from_t() * control.tip();
        let axis = w_from_tip.rotation.column(2);
        self.sums.resize(patterns.len(), (0.0, 0.0));
        self.moves += 1;
        for ((m2, rad2), pattern) in self.sums.iter_mut().zip(patterns) {
            // (1): the error twist of the tool, seen from the workpiece.
            let zero = Vec3([0.0; 3]);
            let mut twist = Twist::new(zero, zero);
            for (j, dh) in pattern.iter().enumerate() {
                let w_from_frame = sweep.b_from_w().inverse() * sweep.b_from_frame(j);
                let sign = control.machine().branch(j).sign();
                twist = twist + w_from_frame.carry_twist(*dh).times(sign);
            }
            let tip = twist.v + twist.w.cross(w_from_tip.translation);
            *m2 += tip.dot(tip);
            *rad2 += twist.w.cross(axis).norm().powi(2);
        }
    }

    /// Takes up the moves that follow.
    pub fn absorb(&mut self, next: &UnseenSums) {
        self.sums.resize(self.sums.len().max(next.sums.len()), (0.0, 0.0));
        self.moves += next.moves;
        for (sum, next) in self.sums.iter_mut().zip(&next.sums) {
            *sum = (sum.0 + next.0, sum.1 + next.1);
        }
    }

    /// What the patterns did over all moves, largest first.
    pub fn report(&self, machine: &Machine, patterns: &[Vec<Twist<f64>>]) -> Unseen {
        let mean = |sum: f64| (sum / self.moves.max(1) as f64).sqrt();
        let mut listed: Vec<UnseenPattern> = (self.sums.iter().zip(patterns))
            .map(|((m2, rad2), pattern)| UnseenPattern {
                mostly: mostly(machine, pattern),
                tip_m: mean(*m2),
                axis_rad: mean(*rad2),
            })
            .collect();
        // A turn counts with a lever of 0.1 m.
        let size = |p: &UnseenPattern| p.tip_m.hypot(0.1 * p.axis_rad);
        listed.sort_by(|a, b| size(b).total_cmp(&size(a)));
        Unseen {
            tip_m: mean(self.sums.iter().map(|s| s.0).sum()),
            axis_rad: mean(self.sums.iter().map(|s| s.1).sum()),
            patterns: listed,
        }
    }
}

/// The largest components of a pattern, in units of their tolerances.
fn mostly(machine: &Machine, pattern: &[Twist<f64>]) -> Vec<String> {
    let mut parts: Vec<(f64, String)> = Vec::new();
    for (j, twist) in pattern.iter().enumerate() {
        let sizes = twist.to_array().into_iter().zip(machine.tolerance(j).to_array());
        for (name, (value, tolerance)) in COMPONENTS.iter().zip(sizes) {
            parts.push(((value / tolerance).abs(), format!("{}.{name}", machine.dyads()[j].frame)));
        }
    }
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let least = 0.5 * parts.first().map_or(0.0, |p| p.0);
    parts.into_iter().take(3).filter(|p| p.0 > least).map(|p| p.1).collect()
}

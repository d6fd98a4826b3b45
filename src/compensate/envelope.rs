//! How far corrections may go before the model is taken for wrong, `docs/compensate.md` (C14).

use super::control::Control;
use crate::lie::{Twist, Vec3};
use crate::machine::Machine;

/// Corrections of so many times what deviations of one tolerance make are ordinary. Tolerances are the standard deviations of what is
/// expected of a machine; beyond ten of them, a wrong file is likelier than a machine so far off.
const TOLERANCES: f64 = 10.0;

/// The largest correction of the tip that is taken for one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Envelope {
    /// As the user wants it, m.
    wanted: Option<f64>,
    /// What tolerances of lengths alone make, wherever the machine stands, m.
    least: f64,
}

impl Envelope {
    /// `wanted`: the bound, m, where the tolerances of the machine are not to say it.
    pub fn new(machine: &Machine, wanted: Option<f64>) -> Self {
        let lengths = |j: usize| machine.tolerance(j).to_array()[..3].iter().map(|t| t * t).sum::<f64>();
        let least = TOLERANCES * (0..machine.dyads().len()).map(lengths).sum::<f64>().sqrt();
        Envelope { wanted, least }
    }

    /// The bound, m, where a correction of `tip_m` with the joints at `q` goes beyond it.
    pub fn exceeded(&self, control: &Control, q: &[f64], tip_m: f64) -> Option<f64> {
        let bound = match self.wanted {
            Some(wanted) => wanted,
            // Turns only add to it.
            None if tip_m <= self.least => return None,
            None => TOLERANCES * expected(control, q),
        };
        (tip_m > bound).then_some(bound)
    }
}

/// Root mean square of the tip's displacement where the joints are at `q`, each component of each deviation has its tolerance as standard deviation, m.
pub(super) fn expected(control: &Control, q: &[f64]) -> f64 {
    let (machine, sweep) = (control.machine(), control.nominal().sweep(q));
    let tip = (sweep.w_from_t() * control.tip()).translation;
    let square = |j: usize| -> f64 {
        let w_from_frame = sweep.b_from_w().inverse() * sweep.b_from_frame(j);
        let tolerances = machine.tolerance(j).to_array();
        let of = |k: usize| {
            let mut unit = [0.0; 6];
            unit[k] = tolerances[k];
            let [v1, v2, v3, w1, w2, w3] = unit;
            let twist = w_from_frame.carry_twist(Twist::new(Vec3([v1, v2, v3]), Vec3([w1, w2, w3])));
            let moved = twist.v + twist.w.cross(tip);
            moved.dot(moved)
        };
        (0..6).map(of).sum()
    };
    (0..machine.dyads().len()).map(square).sum::<f64>().sqrt()
}

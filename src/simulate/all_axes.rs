//! Commands that put ball and tool axis somewhere, for tests that need all axes.

use crate::chain::Chain;
use crate::inverse::{Goal, Inverse, InverseOptions, Mode, Outcome};
use crate::lie::{Mat3, Pose, Vec3};
use crate::machine::Machine;

/// The inverse of a machine by all its joints, travel left aside.
#[derive(Clone, Debug)]
pub(super) struct AllAxes(Inverse<'static>);

impl AllAxes {
    pub fn new(machine: &Machine) -> Self {
        let exact = InverseOptions::default().with_weak(1e-6).with_within_travel(false);
        AllAxes(Inverse::owning(machine.clone()).with_mode(Mode::PositionAndAxis).with_options(exact))
    }

    /// Commands that bring the origin of frame `t` to `p_w` (m) and its z axis along `axis_w` (unit vector), starting from `start`;
    /// `None` where the machine cannot reach it.
    pub fn at(
        &self,
        chain: &Chain<f64>,
        p_w: Vec3<f64>,
        axis_w: Vec3<f64>,
        start: &[f64],
    ) -> Option<Vec<f64>> {
        // A turn about the tool's own axis does not count.
        let first = axis_w.across()[0];
        let columns = [first, axis_w.cross(first), axis_w];
        let rotation = Mat3(std::array::from_fn(|i| std::array::from_fn(|j| columns[j].0[i])));
        let goal = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: Pose { rotation, translation: p_w } };
        let solution = self.0.solve(chain, &goal, start, &vec![true; start.len()]);
        (solution.outcome == Outcome::Reached).then_some(solution.commands)
    }
}

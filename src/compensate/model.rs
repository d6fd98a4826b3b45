//! What compensation asks of a calibrated machine: the kinematics that hold behind each commanded position.

use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::lie::Twist;

/// A machine that is told where it is sent, one commanded position after the other.
///
/// Errors may depend on how a position was reached. A model keeps what that takes (directions of travel with
/// a dead band, play); standing still changes nothing, and before the first motion the directions are those
/// of the first motion.
pub trait Model {
    /// Takes the next commanded position into account, m or rad, machine order.
    fn advance(&mut self, commands: &[f64]);

    /// The chain that holds at the position last told.
    fn chain(&self) -> &Chain<f64>;

    /// Which set of deviations [`Model::chain`] comes from; where it changes, the correction steps.
    fn piece(&self) -> usize;

    /// Whether no position has any error.
    fn is_nominal(&self) -> bool;

    /// Whether a commanded position lies beyond what the calibration has seen.
    fn extrapolates(&self, commands: &[f64]) -> bool;

    /// Forgets every position told, as at the start of a program.
    fn restart(&mut self);

    /// Deviations that may be there as well, as [`CalibratedMachine::unseen`].
    fn unseen(&self) -> Option<&[Vec<Twist<f64>>]> {
        None
    }
}

/// The model of a calibrated machine.
pub(super) fn of_machine(calibrated: &CalibratedMachine) -> Box<dyn Model + '_> {
    Box::new(Constant { calibrated, chain: calibrated.chain() })
}

/// One set of deviations everywhere.
struct Constant<'a> {
    calibrated: &'a CalibratedMachine,
    chain: Chain<f64>,
}

impl Model for Constant<'_> {
    fn advance(&mut self, _: &[f64]) {}

    fn chain(&self) -> &Chain<f64> {
        &self.chain
    }

    fn piece(&self) -> usize {
        0
    }

    fn is_nominal(&self) -> bool {
        self.calibrated.deviations().iter().all(|dh| dh.to_array().iter().all(|x| *x == 0.0))
    }

    fn extrapolates(&self, commands: &[f64]) -> bool {
        self.calibrated.extrapolates(commands)
    }

    fn restart(&mut self) {}

    fn unseen(&self) -> Option<&[Vec<Twist<f64>>]> {
        self.calibrated.unseen()
    }
}

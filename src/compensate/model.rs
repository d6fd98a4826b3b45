//! What compensation asks of a calibrated machine: the kinematics that hold behind each commanded position.

use std::borrow::Cow;

use crate::calibration::LeftOut;
use crate::chain::Chain;
use crate::lie::Twist;

/// A machine that is told where it is sent, one commanded position after the other.
///
/// Errors may depend on how a position was reached. A model keeps what that takes (directions of travel with
/// a dead band, play); standing still changes nothing.
pub trait Model {
    /// Takes the next commanded position into account, m or rad, machine order. `ways`: whether it is known from where each command
    /// comes there; where it is not, no direction of travel follows.
    fn advance(&mut self, commands: &[f64], ways: &[bool]);

    /// The chain that holds at the position last told.
    fn chain(&self) -> &Chain<f64>;

    /// The chain that holds where the machine passes `commands` in the move that ends at the position last told.
    fn chain_at(&self, commands: &[f64]) -> Cow<'_, Chain<f64>> {
        let _ = commands;
        Cow::Borrowed(self.chain())
    }

    /// Effects of the calibration that are not corrected, and why.
    fn left_out(&self) -> &[LeftOut] {
        &[]
    }

    /// Effects that change with time, and at which of their states they are corrected.
    fn held(&self) -> &[LeftOut] {
        &[]
    }

    /// Whether [`Model::chain`] holds at every position.
    fn is_constant(&self) -> bool {
        false
    }

    /// Which set of deviations [`Model::chain`] comes from; where it changes, the correction steps.
    fn piece(&self) -> usize;

    /// The name of that set where no recording has shown it, and it is put together from others.
    fn unseen_piece(&self) -> Option<String> {
        None
    }

    /// Whether no position has any error.
    fn is_nominal(&self) -> bool;

    /// Whether a commanded position lies beyond what the calibration has seen.
    fn extrapolates(&self, commands: &[f64]) -> bool;

    /// The commanded position nearest to this one that the calibration has seen; a turning joint may be whole turns away.
    fn nearest_seen(&self, commands: &[f64]) -> Vec<f64> {
        commands.to_vec()
    }

    /// Forgets every position told, as at the start of a program. `first`: direction of the first motion of each command, which holds
    /// before it; 0 where that is not known.
    fn restart(&mut self, first: &[i8]);

    /// A copy that stands where this one does, to be told what lies ahead.
    fn ahead(&self) -> Box<dyn Model + '_>;

    /// Commands whose direction of travel counts.
    fn keyed(&self) -> &[usize] {
        &[]
    }

    /// Directions of travel of all commands at the position last told, 0 where not known; empty where no direction counts.
    fn directions(&self) -> Vec<i8> {
        Vec::new()
    }

    /// Deviations that may be there as well, as [`CalibratedMachine::unseen`](crate::CalibratedMachine::unseen).
    fn unseen(&self) -> Option<&[Vec<Twist<f64>>]> {
        None
    }
}

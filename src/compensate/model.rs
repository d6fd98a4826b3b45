//! What compensation asks of a calibrated machine: the kinematics that hold behind each commanded position.

use std::borrow::Cow;

use super::effects::Effects;
use crate::calibration::{CalibratedMachine, LeftOut};
use crate::chain::Chain;
use crate::lie::Twist;
use crate::motion::Tracker;
use crate::variation::Directions;

/// A machine that is told where it is sent, one commanded position after the other.
///
/// Errors may depend on how a position was reached. A model keeps what that takes (directions of travel with
/// a dead band, play); standing still changes nothing.
pub trait Model {
    /// Takes the next commanded position into account, m or rad, machine order.
    fn advance(&mut self, commands: &[f64]);

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

    /// Forgets every position told, as at the start of a program.
    fn restart(&mut self);

    /// Deviations that may be there as well, as [`CalibratedMachine::unseen`].
    fn unseen(&self) -> Option<&[Vec<Twist<f64>>]> {
        None
    }
}

/// The model of a calibrated machine. Effects that a program says nothing of (time, speed, the instrument) are left out or
/// held, [`Model::left_out`].
pub(super) fn of_machine(calibrated: &CalibratedMachine) -> Box<dyn Model + '_> {
    let varying = &calibrated.variation().varying;
    if !varying.terms.is_empty() {
        return Box::new(Effects::new(calibrated));
    }
    match &varying.directions {
        Some(directions) => Box::new(Pieces::new(calibrated, directions)),
        None => Box::new(Constant { calibrated, chain: calibrated.chain() }),
    }
}

/// One set of deviations for each pattern of directions of travel.
///
/// An axis that has not moved yet has no direction: the mean of both holds for it.
struct Pieces<'a> {
    calibrated: &'a CalibratedMachine,
    directions: &'a Directions,
    chains: Vec<Chain<f64>>,
    tracker: Tracker,
    piece: usize,
}

impl<'a> Pieces<'a> {
    fn new(calibrated: &'a CalibratedMachine, directions: &'a Directions) -> Self {
        let machine = calibrated.machine();
        let chain = |piece: usize| {
            let parts = calibrated.variation().direction_part(piece, machine.dyads().len());
            let dh: Vec<Twist<f64>> =
                calibrated.deviations().iter().zip(&parts).map(|(dh, part)| *dh + *part).collect();
            Chain::new(machine, &dh)
        };
        Pieces {
            calibrated,
            directions,
            chains: (0..directions.piece_count()).map(chain).collect(),
            tracker: at_rest(calibrated),
            piece: directions.piece(&vec![0; machine.commands().len()]),
        }
    }
}

/// Nothing has moved yet.
pub(super) fn at_rest(calibrated: &CalibratedMachine) -> Tracker {
    let bands = calibrated.variation().dead_bands.clone();
    let first = vec![0; bands.len()];
    Tracker::new(bands, first)
}

impl Model for Pieces<'_> {
    fn advance(&mut self, commands: &[f64]) {
        self.tracker.advance(commands, |_| None);
        self.piece = self.directions.piece(&self.tracker.directions());
    }

    fn chain(&self) -> &Chain<f64> {
        &self.chains[self.piece]
    }

    fn piece(&self) -> usize {
        self.piece
    }

    fn unseen_piece(&self) -> Option<String> {
        let seen = self.calibrated.variation().has_seen_alike(self.piece);
        (!seen).then(|| self.directions.name(self.calibrated.machine(), self.piece))
    }

    fn is_nominal(&self) -> bool {
        is_zero(self.calibrated.deviations())
            && self.calibrated.variation().parts.iter().all(|part| is_zero(part))
    }

    fn extrapolates(&self, commands: &[f64]) -> bool {
        self.calibrated.extrapolates(commands)
    }

    fn restart(&mut self) {
        self.tracker = at_rest(self.calibrated);
        self.piece = self.directions.piece(&self.tracker.directions());
    }

    fn unseen(&self) -> Option<&[Vec<Twist<f64>>]> {
        self.calibrated.unseen()
    }
}

pub(super) fn is_zero(deviations: &[Twist<f64>]) -> bool {
    deviations.iter().all(|dh| dh.to_array().iter().all(|x| *x == 0.0))
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
        is_zero(self.calibrated.deviations())
    }

    fn extrapolates(&self, commands: &[f64]) -> bool {
        self.calibrated.extrapolates(commands)
    }

    fn restart(&mut self) {}

    fn unseen(&self) -> Option<&[Vec<Twist<f64>>]> {
        self.calibrated.unseen()
    }
}

//! What compensation asks of a calibrated machine: the kinematics that hold behind each commanded position.

use std::borrow::Cow;
use std::rc::Rc;

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
        None => Box::new(Constant { calibrated, chain: Rc::new(calibrated.chain()), bent: None }),
    }
}

/// The chain of these deviations with the error motions at the commands `q`; `None` where there are no error motions.
fn bent(
    calibrated: &CalibratedMachine,
    dh: impl FnOnce() -> Vec<Twist<f64>>,
    q: &[f64],
    directions: &[i8],
) -> Option<Chain<f64>> {
    let motions = &calibrated.variation().motions;
    if motions.is_empty() {
        return None;
    }
    let mut dh = dh();
    motions.add(calibrated.machine(), q, directions, &mut dh);
    Some(Chain::new(calibrated.machine(), &dh))
}

/// Constant and direction part of every dyad in a piece.
fn of_piece(calibrated: &CalibratedMachine, piece: usize) -> Vec<Twist<f64>> {
    let parts = calibrated.variation().direction_part(piece, calibrated.deviations().len());
    calibrated.deviations().iter().zip(&parts).map(|(dh, part)| *dh + *part).collect()
}

/// One set of deviations for each pattern of directions of travel, and error motions where they are known.
///
/// An axis without known direction has the mean of both.
#[derive(Clone)]
struct Pieces<'a> {
    calibrated: &'a CalibratedMachine,
    directions: &'a Directions,
    chains: Rc<[Chain<f64>]>,
    /// With the error motions at the position last told.
    bent: Option<Chain<f64>>,
    tracker: Tracker,
    piece: usize,
}

impl<'a> Pieces<'a> {
    fn new(calibrated: &'a CalibratedMachine, directions: &'a Directions) -> Self {
        let machine = calibrated.machine();
        let still = vec![0; machine.commands().len()];
        let chain = |piece: usize| Chain::new(machine, &of_piece(calibrated, piece));
        Pieces {
            calibrated,
            directions,
            chains: (0..directions.piece_count()).map(chain).collect(),
            bent: None,
            tracker: at_rest(calibrated, &still),
            piece: directions.piece(&still),
        }
    }
}

/// Nothing has moved yet.
pub(super) fn at_rest(calibrated: &CalibratedMachine, first: &[i8]) -> Tracker {
    Tracker::new(calibrated.variation().dead_bands.clone(), first.to_vec())
}

impl Model for Pieces<'_> {
    fn advance(&mut self, commands: &[f64], ways: &[bool]) {
        (0..commands.len()).filter(|c| !ways[*c]).for_each(|c| self.tracker.lose(c));
        self.tracker.advance(commands, |_| None);
        let directions = self.tracker.directions();
        self.piece = self.directions.piece(&directions);
        self.bent = bent(self.calibrated, || of_piece(self.calibrated, self.piece), commands, &directions);
    }

    fn chain(&self) -> &Chain<f64> {
        self.bent.as_ref().unwrap_or(&self.chains[self.piece])
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
            && self.calibrated.variation().motions.is_empty()
    }

    fn extrapolates(&self, commands: &[f64]) -> bool {
        self.calibrated.extrapolates(commands)
    }

    fn restart(&mut self, first: &[i8]) {
        self.tracker = at_rest(self.calibrated, first);
        self.piece = self.directions.piece(first);
        self.bent = None;
    }

    fn ahead(&self) -> Box<dyn Model + '_> {
        Box::new(self.clone())
    }

    fn keyed(&self) -> &[usize] {
        self.directions.axes()
    }

    fn directions(&self) -> Vec<i8> {
        self.tracker.directions()
    }

    fn unseen(&self) -> Option<&[Vec<Twist<f64>>]> {
        self.calibrated.unseen()
    }
}

pub(super) fn is_zero(deviations: &[Twist<f64>]) -> bool {
    deviations.iter().all(|dh| dh.to_array().iter().all(|x| *x == 0.0))
}

/// One set of deviations everywhere.
#[derive(Clone)]
struct Constant<'a> {
    calibrated: &'a CalibratedMachine,
    chain: Rc<Chain<f64>>,
    /// With the error motions at the position last told.
    bent: Option<Chain<f64>>,
}

impl Model for Constant<'_> {
    fn advance(&mut self, commands: &[f64], _: &[bool]) {
        self.bent = bent(self.calibrated, || self.calibrated.deviations().to_vec(), commands, &[]);
    }

    fn chain(&self) -> &Chain<f64> {
        self.bent.as_ref().unwrap_or(&self.chain)
    }

    fn piece(&self) -> usize {
        0
    }

    fn is_nominal(&self) -> bool {
        is_zero(self.calibrated.deviations()) && self.calibrated.variation().motions.is_empty()
    }

    fn extrapolates(&self, commands: &[f64]) -> bool {
        self.calibrated.extrapolates(commands)
    }

    fn restart(&mut self, _: &[i8]) {
        self.bent = None;
    }

    fn ahead(&self) -> Box<dyn Model + '_> {
        Box::new(self.clone())
    }

    fn unseen(&self) -> Option<&[Vec<Twist<f64>>]> {
        self.calibrated.unseen()
    }
}

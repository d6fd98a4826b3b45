//! A calibrated machine without effects: one set of deviations, or one for each pattern of directions of travel.

use std::borrow::Cow;
use std::rc::Rc;

use super::model::Model;
use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::lie::Twist;
use crate::motion::Tracker;
use crate::variation::Directions;

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
pub(super) struct Pieces<'a> {
    calibrated: &'a CalibratedMachine,
    directions: &'a Directions,
    chains: Rc<[Chain<f64>]>,
    /// With the error motions at the position last told.
    bent: Option<Chain<f64>>,
    tracker: Tracker,
    piece: usize,
}

impl<'a> Pieces<'a> {
    pub fn new(calibrated: &'a CalibratedMachine, directions: &'a Directions) -> Self {
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

/// A thousandth of the smallest step that programs write. What a joint differs by less is the rounding of frames that were called otherwise,
/// and no way.
const NO_WAY: f64 = 1e-10;

/// Nothing has moved yet.
pub(super) fn at_rest(calibrated: &CalibratedMachine, first: &[i8]) -> Tracker {
    let dead_bands = calibrated.variation().dead_bands.iter().map(|band| band.max(NO_WAY)).collect();
    Tracker::new(dead_bands, first.to_vec())
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

    fn chain_at(&self, commands: &[f64]) -> Cow<'_, Chain<f64>> {
        let dh = || of_piece(self.calibrated, self.piece);
        let bent = bent(self.calibrated, dh, commands, &self.tracker.directions());
        bent.map_or_else(|| Cow::Borrowed(self.chain()), Cow::Owned)
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

    fn nearest_seen(&self, commands: &[f64]) -> Vec<f64> {
        self.calibrated.nearest_seen(commands)
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

/// Whether no dyad deviates.
pub(super) fn is_zero(deviations: &[Twist<f64>]) -> bool {
    deviations.iter().all(|dh| dh.to_array().iter().all(|x| *x == 0.0))
}

/// One set of deviations everywhere.
#[derive(Clone)]
pub(super) struct Constant<'a> {
    calibrated: &'a CalibratedMachine,
    chain: Rc<Chain<f64>>,
    /// With the error motions at the position last told.
    bent: Option<Chain<f64>>,
}

impl<'a> Constant<'a> {
    pub fn new(calibrated: &'a CalibratedMachine) -> Self {
        Constant { calibrated, chain: Rc::new(calibrated.chain()), bent: None }
    }
}

impl Model for Constant<'_> {
    fn advance(&mut self, commands: &[f64], _: &[bool]) {
        self.bent = bent(self.calibrated, || self.calibrated.deviations().to_vec(), commands, &[]);
    }

    fn chain(&self) -> &Chain<f64> {
        self.bent.as_ref().unwrap_or(&self.chain)
    }

    fn chain_at(&self, commands: &[f64]) -> Cow<'_, Chain<f64>> {
        let bent = bent(self.calibrated, || self.calibrated.deviations().to_vec(), commands, &[]);
        bent.map_or_else(|| Cow::Borrowed(self.chain()), Cow::Owned)
    }

    fn is_constant(&self) -> bool {
        self.calibrated.variation().motions.is_empty()
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

    fn nearest_seen(&self, commands: &[f64]) -> Vec<f64> {
        self.calibrated.nearest_seen(commands)
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

//! Which model a calibrated machine asks for: the simplest that has all of its errors.

use super::effects::Effects;
use super::model::Model;
use super::pieces::{Constant, Pieces};
use crate::calibration::CalibratedMachine;

/// The model of a calibrated machine. Effects that a program says nothing of (time, speed, the instrument) are left out or
/// held, [`Model::left_out`].
pub(super) fn model_of(calibrated: &CalibratedMachine) -> Box<dyn Model + '_> {
    let varying = &calibrated.variation().varying;
    if !varying.terms.is_empty() {
        return Box::new(Effects::new(calibrated));
    }
    match &varying.directions {
        Some(directions) => Box::new(Pieces::new(calibrated, directions)),
        None => Box::new(Constant::new(calibrated)),
    }
}

/// Whether the errors of a machine have no history: they depend on where it stands alone.
pub(super) fn is_constant(calibrated: &CalibratedMachine) -> bool {
    let varying = &calibrated.variation().varying;
    varying.terms.is_empty() && varying.directions.is_none()
}

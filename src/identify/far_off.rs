//! Frames that lie far from where the machine file has them.

use serde::{Deserialize, Serialize};

use super::Fit;

/// Deviations beyond so many tolerances are told.
const CONTRADICTED: f64 = 5.0;

/// A frame that lies far from where the machine file has it.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FarOff {
    /// Its name.
    pub frame: String,
    /// Its largest deviation in tolerances.
    pub tolerances: f64,
}

impl Fit {
    /// Frames with a deviation of more than five tolerances: their declaration is wrong, or their tolerance too small.
    pub fn far_off(&self) -> Vec<FarOff> {
        let constant = self.parameters.iter().filter(|p| p.directions.is_empty());
        let mut all: Vec<FarOff> = Vec::new();
        for p in constant.filter(|p| p.value.abs() > CONTRADICTED * p.tolerance) {
            let tolerances = p.value.abs() / p.tolerance;
            match all.iter_mut().find(|own| own.frame == p.frame) {
                Some(own) => own.tolerances = own.tolerances.max(tolerances),
                None => all.push(FarOff { frame: p.frame.clone(), tolerances }),
            }
        }
        all
    }
}

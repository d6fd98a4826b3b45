//! What is said of recordings and a machine that do not belong together.

use serde::{Deserialize, Serialize};

use crate::identify::Plausibility;

/// What is wrong with a calibration that is nonsense.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Nonsense {
    /// The worst of what is left over.
    pub left: Plausibility,
    /// Where one set-up does not agree with the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub apart: Option<Apart>,
    /// The mistakes that would explain it, best first; several where the recordings do not tell them apart.
    pub mistakes: Vec<LikelyMistake>,
    /// How many were tried, and what.
    pub tried: usize,
    /// The kinds that were tried.
    pub kinds: String,
}

/// A mistake that would explain recordings.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LikelyMistake {
    /// Which, as the part of a sentence that follows "with".
    pub what: String,
    /// What to do about it.
    pub mend: String,
    /// What would be left without it, of the same recording and quantity as [`Nonsense::left`], m or rad.
    pub left: f64,
}

/// What is left of a set-up alone.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Apart {
    /// Its name; empty for the default one.
    pub setup: String,
    /// What is left of the same readings where only recordings of this set-up are calibrated on, without tolerances, m or rad.
    pub alone: f64,
}

//! A root mean square of what was measured: lengths, angles, or both.

use serde::Serialize;

/// Root mean square of the residuals' Euclidean norm over samples; `None` where nothing of the kind was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Rms {
    /// Of lengths, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub m: Option<f64>,
    /// Of angles, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rad: Option<f64>,
}

//! The RON form of faults, in the file's own units.

use serde::Deserialize;

use crate::effects::StoredEffect;
use crate::machine::{AngleUnit, LengthUnit, UnitsForm};

pub(super) type Triple = (f64, f64, f64);

#[derive(Deserialize)]
#[serde(rename = "Faults", deny_unknown_fields)]
pub(super) struct FaultsForm {
    #[serde(default)]
    pub machine: Option<String>,
    /// Of what is wrong.
    pub units: UnitsForm,
    /// Of where a joint stands.
    #[serde(default = "millimetres_and_degrees")]
    pub positions: UnitsForm,
    #[serde(default)]
    pub deviations: Vec<FrameForm>,
    #[serde(default)]
    pub factors: Vec<FrameForm>,
    #[serde(default)]
    pub twists: Vec<TwistForm>,
    #[serde(default)]
    pub displacements: Vec<DisplacementForm>,
    #[serde(default)]
    pub backlash: Vec<BacklashForm>,
    /// As in calibrated files, in SI.
    #[serde(default)]
    pub effects: Vec<StoredEffect>,
}

fn millimetres_and_degrees() -> UnitsForm {
    UnitsForm { length: LengthUnit::mm, angle: AngleUnit::deg }
}

fn zero() -> Triple {
    (0.0, 0.0, 0.0)
}

#[derive(Deserialize)]
#[serde(rename = "deviation", deny_unknown_fields)]
pub(super) struct FrameForm {
    pub frame: String,
    #[serde(default = "zero")]
    pub v: Triple,
    #[serde(default = "zero")]
    pub w: Triple,
}

#[derive(Deserialize)]
#[serde(rename = "twist", deny_unknown_fields)]
pub(super) struct TwistForm {
    pub joint: String,
    #[serde(default = "zero")]
    pub v: Triple,
    #[serde(default = "zero")]
    pub w: Triple,
}

#[derive(Deserialize)]
#[serde(rename = "displacement", deny_unknown_fields)]
pub(super) struct DisplacementForm {
    pub joint: String,
    pub offset: f64,
}

#[derive(Deserialize)]
#[serde(rename = "backlash", deny_unknown_fields)]
pub(super) struct BacklashForm {
    pub joint: String,
    #[serde(default)]
    pub width: Option<f64>,
    #[serde(default)]
    pub by_position: Option<WidthForm>,
}

#[derive(Deserialize)]
pub(super) enum WidthForm {
    Polynomial(Vec<f64>),
    Harmonics(HarmonicsForm),
    Points(Vec<(f64, f64)>),
}

#[derive(Deserialize)]
#[serde(rename = "Harmonics", deny_unknown_fields)]
pub(super) struct HarmonicsForm {
    pub mean: f64,
    #[serde(default)]
    pub cos: Vec<f64>,
    #[serde(default)]
    pub sin: Vec<f64>,
    #[serde(default)]
    pub period: Option<f64>,
}

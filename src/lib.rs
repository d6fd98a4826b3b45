//! Calibrates the geometry of any serial or bifurcated machine.
#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::unwrap_used)]

mod calibration;
pub mod chain;
pub mod check;
mod document;
pub mod error;
pub mod lie;
pub mod machine;
pub mod recording;
mod scalar;
pub mod sensor;
pub mod units;

pub use chain::{Chain, Sweep};
pub use error::{Error, Place, Result};
pub use machine::Machine;
pub use scalar::Scalar;

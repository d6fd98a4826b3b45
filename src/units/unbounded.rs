//! Numbers that may be infinite, in formats that have no infinity: JSON writes `null`.

use serde::{Deserialize, Deserializer};

/// For `#[serde(deserialize_with)]`: what is `null` is infinite again.
pub(crate) fn unbounded<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

//! The noise that readings are weighted with.

use super::source::Sources;
use crate::units::ByQuantity;

/// Standard deviations of a source's readings.
pub(crate) type Noise = ByQuantity<f64>;

/// A stated `sigma` counts unless the residuals are larger: what no model explains is no better known for being stated.
pub(super) fn with_stated(sources: &Sources, seen: &[Noise]) -> Vec<Noise> {
    sources
        .all
        .iter()
        .zip(seen)
        .map(|(source, seen)| match source.recording.header().sigma {
            None => *seen,
            Some(sigma) => {
                let mut noise = *seen;
                noise[sigma.quantity] = sigma.value.max(seen[sigma.quantity]);
                noise
            }
        })
        .collect()
}

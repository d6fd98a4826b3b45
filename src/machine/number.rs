//! Numbers of a machine file on their way into SI; what is no usable number is refused with the path of its place.

use super::MachineFault;
use super::form::Triple;
use crate::lie::Vec3;
use crate::units::Unit;

/// A value, or what is wrong with the one at a path such as `tool[2].joint.axis`.
pub(crate) type Checked<T> = std::result::Result<T, (String, MachineFault)>;

/// Nothing on a machine is larger than this, in m or rad.
pub(super) const LARGEST: f64 = 1e9;

/// What messages call the numbers that a calibrated file adds.
pub(crate) const OF_CALIBRATION: &str = "a number of `calibration`";

/// A pure number, or one in SI.
pub(crate) fn number(path: String, value: f64, what: &str) -> Checked<f64> {
    if value.is_finite() && value.abs() < LARGEST {
        return Ok(value);
    }
    Err((path, MachineFault::NotFinite { what: what.into(), value }))
}

pub(crate) fn finite(path: &str, (x, y, z): Triple, what: &str) -> Checked<()> {
    for (i, value) in [x, y, z].into_iter().enumerate() {
        number(format!("{path}[{i}]"), value, what)?;
    }
    Ok(())
}

/// A number of the file in SI; what is too large is told as it was written.
pub(crate) fn to_si(path: String, value: f64, unit: Unit, what: &str) -> Checked<f64> {
    let si = unit.to_si(value);
    if si.is_finite() && si.abs() < LARGEST {
        return Ok(si);
    }
    Err((path, MachineFault::NotFinite { what: what.into(), value }))
}

pub(crate) fn vec_to_si(path: &str, (x, y, z): Triple, unit: Unit, what: &str) -> Checked<Vec3<f64>> {
    let component = |i: usize, value| to_si(format!("{path}[{i}]"), value, unit, what);
    Ok(Vec3([component(0, x)?, component(1, y)?, component(2, z)?]))
}

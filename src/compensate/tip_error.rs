//! The error of tip and tool axis.

use crate::lie::Pose;

/// Errors of tip and tool axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct TipError {
    w_from_a: Pose<f64>,
    w_from_b: Pose<f64>,
}

impl TipError {
    /// Of two poses of a tip, whose z axes are tool axes.
    pub fn between(w_from_a: Pose<f64>, w_from_b: Pose<f64>) -> TipError {
        TipError { w_from_a, w_from_b }
    }

    /// Distance of the tips, m.
    pub fn m(self) -> f64 {
        (self.w_from_a.translation - self.w_from_b.translation).norm()
    }

    /// Angle between the axes, rad.
    pub fn rad(self) -> f64 {
        let (a, b) = (self.w_from_a.rotation.column(2), self.w_from_b.rotation.column(2));
        a.cross(b).norm().atan2(a.dot(b))
    }
}

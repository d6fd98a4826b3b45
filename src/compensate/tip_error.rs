//! The error of tip and tool axis.

use crate::lie::Pose;

/// Errors of tip and tool axis.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TipError {
    /// Distance of the tips, m.
    m: f64,
    /// Angle between the axes, rad.
    rad: f64,
}

impl TipError {
    /// Of two poses of a tip, whose z axes are tool axes.
    pub fn between(w_from_a: Pose<f64>, w_from_b: Pose<f64>) -> TipError {
        let (a, b) = (w_from_a.rotation.column(2), w_from_b.rotation.column(2));
        let rad = a.cross(b).norm().atan2(a.dot(b));
        TipError { m: (w_from_a.translation - w_from_b.translation).norm(), rad }
    }

    /// Distance of the tips, m.
    pub fn m(self) -> f64 {
        self.m
    }

    /// Angle between the axes, rad.
    pub fn rad(self) -> f64 {
        self.rad
    }
}

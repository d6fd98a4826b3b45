//! What of a goal counts, and how hard to try.

use serde::{Deserialize, Serialize};

/// What of the goal counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mode {
    /// The tip: three equations.
    Position,
    /// The tip and the direction of the tool: five equations.
    PositionAndAxis,
    /// The direction of the tool: two equations.
    Axis,
    /// The whole pose: six equations.
    Pose,
}

/// How hard to try.
#[non_exhaustive]
#[derive(Clone, Copy, Debug)]
pub struct InverseOptions {
    /// Singular value (rad of tool direction per rad of joint, or as a part of the largest where lengths take
    /// part) below which a direction fades out.
    pub weak: f64,
    /// Most Newton steps.
    pub steps: usize,
    /// Largest distance from the goal that counts as reached, m.
    pub position_m: f64,
    /// Largest angle from the goal that counts as reached, rad.
    pub angle_rad: f64,
    /// Whether travel is respected.
    pub within_travel: bool,
}

impl Default for InverseOptions {
    fn default() -> Self {
        InverseOptions { weak: 0.02, steps: 60, position_m: 1e-10, angle_rad: 1e-10, within_travel: true }
    }
}

impl InverseOptions {
    /// The same with another singular value below which a direction fades out.
    #[must_use]
    pub fn with_weak(mut self, weak: f64) -> Self {
        self.weak = weak;
        self
    }

    /// The same with as many Newton steps at most.
    #[must_use]
    pub fn with_steps(mut self, steps: usize) -> Self {
        self.steps = steps;
        self
    }

    /// The same with another distance that counts as reached, m.
    #[must_use]
    pub fn with_position_m(mut self, position_m: f64) -> Self {
        self.position_m = position_m;
        self
    }

    /// The same with another angle that counts as reached, rad.
    #[must_use]
    pub fn with_angle_rad(mut self, angle_rad: f64) -> Self {
        self.angle_rad = angle_rad;
        self
    }

    /// The same with travel respected, or not.
    #[must_use]
    pub fn with_within_travel(mut self, within_travel: bool) -> Self {
        self.within_travel = within_travel;
        self
    }
}

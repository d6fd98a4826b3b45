//! What a machine is made of: dyads, joints, initial poses.

use std::collections::BTreeMap;

use super::MachineFault;
use crate::lie::{Pose, Twist, Vec3};
use crate::units::Quantity;

/// Initial pose of a frame in the one before it, and the joint that follows.
///
/// ```
/// use kincal::machine::{Dyad, Joint};
///
/// let a = Dyad::new("a").at([0.0, 0.0, -0.12]).with_joint(Joint::revolute("a", [1.0, 0.0, 0.0]).with_travel(-2.0, 0.5));
/// assert_eq!(a.placement.at.0[2], -0.12);
/// ```
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq)]
pub struct Dyad {
    /// Name of the frame.
    pub frame: String,
    /// Initial pose `M_j` of the frame in the one before it.
    pub placement: Placement,
    /// The joint that moves whatever comes next; none on the last frames `w` and `t`, nor on a fixed frame between.
    pub joint: Option<Joint>,
    /// Mass carried by the frame behind its joint.
    pub mass: Option<MassPoint>,
    /// Prior standard deviation of this dyad's deviation, if it differs from the file's.
    pub tolerance: Option<Tolerance>,
}

impl Dyad {
    /// A frame at the one before it, without joint.
    pub fn new(frame: impl Into<String>) -> Self {
        Dyad {
            frame: frame.into(),
            placement: Placement::default(),
            joint: None,
            mass: None,
            tolerance: None,
        }
    }

    /// The same with its origin here in the frame before it, m.
    #[must_use]
    pub fn at(mut self, at: impl Into<Vec3<f64>>) -> Self {
        self.placement.at = at.into();
        self
    }

    /// The same with this initial pose `M_j` in the frame before it.
    #[must_use]
    pub fn placed(mut self, previous_from_frame: impl Into<Placement>) -> Self {
        self.placement = previous_from_frame.into();
        self
    }

    /// The same with a joint.
    #[must_use]
    pub fn with_joint(mut self, joint: Joint) -> Self {
        self.joint = Some(joint);
        self
    }

    /// The same with a mass behind its joint.
    #[must_use]
    pub fn with_mass(mut self, mass: MassPoint) -> Self {
        self.mass = Some(mass);
        self
    }

    /// The same with a tolerance of its own.
    #[must_use]
    pub fn with_tolerance(mut self, tolerance: Tolerance) -> Self {
        self.tolerance = Some(tolerance);
        self
    }
}

/// An initial pose as translation and rotation vector, `M = [exp(rotation), at]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Origin of the frame in the one before it, m.
    pub at: Vec3<f64>,
    /// Rotation vector of the frame in the one before it, rad.
    pub rotation: Vec3<f64>,
}

impl Default for Placement {
    fn default() -> Self {
        Placement { at: Vec3([0.0; 3]), rotation: Vec3([0.0; 3]) }
    }
}

impl Placement {
    /// As a pose `previous_from_frame`.
    pub fn pose(self) -> Pose<f64> {
        let turn = Pose::exp(Twist::new(Vec3([0.0; 3]), self.rotation));
        Pose { rotation: turn.rotation, translation: self.at }
    }
}

impl From<Pose<f64>> for Placement {
    fn from(previous_from_frame: Pose<f64>) -> Self {
        Placement { at: previous_from_frame.translation, rotation: previous_from_frame.rotation_vector() }
    }
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Along its axis; displacement in m.
    Prismatic,
    /// About its axis; displacement in rad.
    Revolute,
}

impl JointKind {
    /// What its displacement measures.
    pub fn quantity(self) -> Quantity {
        match self {
            JointKind::Prismatic => Quantity::Length,
            JointKind::Revolute => Quantity::Angle,
        }
    }
}

/// A joint with one degree of freedom.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name in recordings; the frame's unless the file says otherwise.
    pub name: String,
    /// Prismatic or revolute.
    pub kind: JointKind,
    /// Unit vector of the axis, in the dyad's own frame.
    pub axis: Vec3<f64>,
    /// Limits of the displacement, m or rad.
    pub travel: Option<(f64, f64)>,
    /// The joint's displacement as factors on joints' commands, where it is not simply its own; its own name may be among them.
    pub follows: Option<BTreeMap<String, f64>>,
    /// NC word, where it differs from the joint's upper-case name.
    pub nc: Option<NcWord>,
}

impl Joint {
    /// A joint named `name` about or along the unit vector `axis`.
    pub fn new(name: impl Into<String>, kind: JointKind, axis: Vec3<f64>) -> Self {
        Joint { name: name.into(), kind, axis, travel: None, follows: None, nc: None }
    }

    /// A joint named `name` along a unit vector of the dyad's own frame.
    pub fn prismatic(name: impl Into<String>, axis: impl Into<Vec3<f64>>) -> Self {
        Joint::new(name, JointKind::Prismatic, axis.into())
    }

    /// A joint named `name` about a unit vector of the dyad's own frame.
    pub fn revolute(name: impl Into<String>, axis: impl Into<Vec3<f64>>) -> Self {
        Joint::new(name, JointKind::Revolute, axis.into())
    }

    /// The same with limits of its displacement, m or rad.
    #[must_use]
    pub fn with_travel(mut self, from: f64, to: f64) -> Self {
        self.travel = Some((from, to));
        self
    }

    /// The same, its displacement the sum of these joints' commands times factors; its own name may be among them.
    #[must_use]
    pub fn with_follows(mut self, factors: impl IntoIterator<Item = (String, f64)>) -> Self {
        self.follows = Some(factors.into_iter().collect());
        self
    }

    /// The same with an NC word of its own.
    #[must_use]
    pub fn with_nc(mut self, nc: NcWord) -> Self {
        self.nc = Some(nc);
        self
    }

    /// `xi`: the joint's twist in its own frame, per m or rad of displacement, `docs/model.md` (8).
    pub fn twist(&self) -> Twist<f64> {
        let zero = Vec3([0.0; 3]);
        match self.kind {
            JointKind::Prismatic => Twist::new(self.axis, zero),
            JointKind::Revolute => Twist::new(zero, self.axis),
        }
    }

    /// Address of the joint in an NC program and the sign of the program's number against the displacement.
    pub fn nc_word(&self) -> NcWord {
        self.nc.clone().unwrap_or_else(|| NcWord { address: self.name.to_uppercase(), sign: 1 })
    }
}

/// Address and sign of a joint in NC programs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NcWord {
    /// The address, `A`, `X`, `C1`.
    pub address: String,
    /// +1 or -1: displacement = sign × programmed value.
    pub sign: i8,
}

/// A lumped mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassPoint {
    /// kg.
    pub mass: f64,
    /// Centre of mass in the dyad's frame behind its joint, m.
    pub centre: Vec3<f64>,
}

/// Prior standard deviations of a deviation twist's components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Of each translation, m.
    pub translation: f64,
    /// Of each rotation, rad.
    pub rotation: f64,
}

impl Tolerance {
    /// What a file that states nothing gets: 0.1 mm and 0.5 mrad.
    pub const DEFAULT: Tolerance = Tolerance { translation: 1e-4, rotation: 5e-4 };

    /// The six standard deviations in the order (v; w).
    pub fn to_array(self) -> [f64; 6] {
        let (t, r) = (self.translation, self.rotation);
        [t, t, t, r, r, r]
    }

    pub(super) fn check(self) -> Result<(), MachineFault> {
        for (what, value) in [("translation", self.translation), ("rotation", self.rotation)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(MachineFault::Tolerance { what: what.into(), value });
            }
        }
        Ok(())
    }
}

//! SE(3) and its algebra se(3): the one home of exp and log in this crate.
//!
//! Twists are ordered **(v; w)**, linear part first (`docs/notation.md`). Everything is generic over [`Scalar`], branch-free,
//! and right in value and first derivative exactly at zero, across the switch from series to closed form, and near a half turn.
//! nalgebra's own rotation constructors lose the derivative of a dual at exactly zero, the nominal value of every deviation;
//! that is why none of them is used here.
//!
//! [`Scalar`]: crate::Scalar

mod convert;
mod mat3;
mod pose;
mod series;
mod twist;
mod vec3;

pub use mat3::Mat3;
pub use pose::Pose;
pub(crate) use twist::inverse_left_jacobian_so3;
pub use twist::{Adjoint, Twist, Wrench};
pub use vec3::Vec3;

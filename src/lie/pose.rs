//! Poses: elements of SE(3).

use serde::{Deserialize, Serialize};

use std::ops::Mul;

use super::series::{Coefficients, half_angle_per_sine};
use super::twist::inverse_left_jacobian_so3;
use super::{Adjoint, Mat3, Twist, Vec3, Wrench};
use crate::scalar::Scalar;

/// A rigid displacement, or the pose of one frame in another: `a_from_b` maps coordinates in b to coordinates in a.
///
/// The product cancels neighbours: `a_from_c = a_from_b * b_from_c`.
///
/// ```
/// use kincal::lie::{Pose, Twist, Vec3};
/// // A quarter turn about z: a pure `w.z` turns x into y.
/// let quarter = Pose::exp(Twist::from_array([0.0, 0.0, 0.0, 0.0, 0.0, std::f64::consts::FRAC_PI_2]));
/// let p = quarter.transform(Vec3::new(1.0, 0.0, 0.0));
/// assert!((p.0[1] - 1.0).abs() < 1e-15 && p.0[0].abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose<S> {
    /// Rotation matrix.
    pub rotation: Mat3<S>,
    /// Origin of the inner frame in the outer one, m.
    pub translation: Vec3<S>,
}

impl<S: Scalar> Pose<S> {
    /// The identity, of the same kind of scalar as `like`.
    #[inline(always)]
    pub fn identity(like: S) -> Self {
        Pose { rotation: Mat3::identity(like), translation: Vec3::zero(like) }
    }

    /// exp of a twist, `docs/model.md` (3): `R = I + a W + b W²`, `p = (I + b W + c W²) v`.
    #[inline(always)]
    pub fn exp(x: Twist<S>) -> Self {
        let k = Coefficients::at(x.w.dot(x.w));
        let hat = Mat3::hat(x.w);
        let hat2 = hat * hat;
        Pose {
            rotation: Mat3::identity(k.a) + hat.times(k.a) + hat2.times(k.b),
            translation: x.v + (hat * x.v).times(k.b) + (hat2 * x.v).times(k.c),
        }
    }

    /// Pure translation by `p`, m.
    #[inline(always)]
    pub fn translation(p: Vec3<S>) -> Self {
        Pose { rotation: Mat3::identity(p.0[0]), translation: p }
    }

    /// Turn by `angle` rad about the unit vector `axis` through the origin (Rodrigues); right at every angle, zero included.
    #[inline(always)]
    pub fn turn(axis: Vec3<f64>, angle: S) -> Self {
        let (sin, cos) = angle.sin_cos();
        let versine = (-cos).offset(1.0);
        let n = axis.lift(angle);
        let hat = Mat3::hat(n);
        Pose {
            rotation: Mat3::identity(angle) + hat.times(sin) + (hat * hat).times(versine),
            translation: Vec3::zero(angle),
        }
    }

    /// log: the twist whose exp is this pose, rotation angle in [0, pi], `docs/model.md` (5) and (6).
    ///
    /// Goes through the unit quaternion, which is well conditioned at every angle; only exactly at a half turn is the
    /// sign of the rotation vector a matter of choice.
    pub fn log(self) -> Twist<S> {
        let w = self.rotation_vector();
        Twist { v: inverse_left_jacobian_so3(w) * self.translation, w }
    }

    /// Rotation vector of the rotation part, rad.
    pub fn rotation_vector(self) -> Vec3<S> {
        let (s, u) = self.quaternion();
        u.times(half_angle_per_sine(u.dot(u), s).scale(2.0))
    }

    /// Unit quaternion of the rotation part, scalar part first and not negative.
    pub(super) fn quaternion(self) -> (S, Vec3<S>) {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.rotation.0;
        // Shepperd's four cases: 4 times the square of each component, and the products with it.
        let cases = [
            ((a + e + i).offset(1.0), [None, Some(h - f), Some(c - g), Some(d - b)]),
            ((a - e - i).offset(1.0), [Some(h - f), None, Some(d + b), Some(c + g)]),
            ((e - a - i).offset(1.0), [Some(c - g), Some(d + b), None, Some(h + f)]),
            ((i - a - e).offset(1.0), [Some(d - b), Some(c + g), Some(h + f), None]),
        ];
        let mut best = cases[0].0;
        let mut q = [best.lift(1.0), best.lift(0.0), best.lift(0.0), best.lift(0.0)];
        for (n, (square, products)) in cases.into_iter().enumerate() {
            let safe = square.select_below(0.5, square.lift(1.0), square);
            let root = safe.sqrt();
            let r = root.recip().scale(0.5);
            // One of the four squares is at least 1, so the first case is only a start.
            let lead = if n == 0 { square.lift(-1.0) } else { best - square };
            for (target, product) in q.iter_mut().zip(products) {
                let candidate = product.map_or(root.scale(0.5), |p| p * r);
                *target = lead.select_below(0.0, candidate, *target);
            }
            best = lead.select_below(0.0, square, best);
        }
        let sign = q[0].select_below(0.0, q[0].lift(-1.0), q[0].lift(1.0));
        (q[0] * sign, Vec3([q[1], q[2], q[3]]).times(sign))
    }

    /// The inverse: `b_from_a` of `a_from_b`.
    #[inline(always)]
    #[must_use]
    pub fn inverse(self) -> Self {
        let rotation = self.rotation.transpose();
        Pose { rotation, translation: -(rotation * self.translation) }
    }

    /// Coordinates of a point in the outer frame, given those in the inner one, m.
    #[inline(always)]
    pub fn transform(self, p: Vec3<S>) -> Vec3<S> {
        self.rotation * p + self.translation
    }

    /// `Ad`: twists of the inner frame seen from the outer one, `docs/model.md` (4).
    #[inline(always)]
    pub fn adjoint(self) -> Adjoint<S> {
        Adjoint { diagonal: self.rotation, coupling: Mat3::hat(self.translation) * self.rotation }
    }

    /// `Ad(self) x` without forming the matrix.
    #[inline(always)]
    pub fn carry_twist(self, x: Twist<S>) -> Twist<S> {
        let w = self.rotation * x.w;
        Twist { v: self.rotation * x.v + self.translation.cross(w), w }
    }

    /// `Ad(self)ᵀ y`: a wrench given in the outer frame, seen from the inner one, `docs/model.md` (14).
    #[inline(always)]
    pub fn carry_wrench(self, y: Wrench<S>) -> Wrench<S> {
        let back = self.rotation.transpose();
        Wrench { f: back * y.f, m: back * (y.m - self.translation.cross(y.f)) }
    }
}

impl Pose<f64> {
    /// The same pose as constants of the kind of `like`.
    #[inline(always)]
    pub fn lift<S: Scalar>(self, like: S) -> Pose<S> {
        Pose { rotation: self.rotation.lift(like), translation: self.translation.lift(like) }
    }
}

impl<S: Scalar> Mul for Pose<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, inner: Self) -> Self {
        Pose { rotation: self.rotation * inner.rotation, translation: self.transform(inner.translation) }
    }
}

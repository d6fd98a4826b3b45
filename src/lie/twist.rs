//! Twists (v; w), wrenches (f; m) and the matrices of the adjoint representation.

use serde::{Deserialize, Serialize};

use std::ops::{Add, Neg, Sub};

use super::series::{Coefficients, inverse_jacobian_coefficient};
use super::{Mat3, Vec3};
use crate::scalar::Scalar;

/// An element of se(3), linear part first: `v` in m, `w` in rad, in the frame that its name or documentation says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Twist<S> {
    /// Linear part, m.
    pub v: Vec3<S>,
    /// Angular part, rad.
    pub w: Vec3<S>,
}

/// A linear form on twists, `f·v + m·w`: the row of a scalar measurement, carried along the chain like a force and its moment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wrench<S> {
    /// What multiplies `v`.
    pub f: Vec3<S>,
    /// What multiplies `w`; the moment about the origin of the frame.
    pub m: Vec3<S>,
}

/// A 6 × 6 matrix on twists in blocks `[[linear, coupling], [0, angular]]`; every adjoint matrix has this form.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Adjoint<S> {
    /// Upper left and lower right block.
    pub diagonal: Mat3<S>,
    /// Upper right block: how `w` enters the linear part.
    pub coupling: Mat3<S>,
}

impl<S: Scalar> Twist<S> {
    /// From linear and angular part.
    #[inline(always)]
    pub fn new(v: Vec3<S>, w: Vec3<S>) -> Self {
        Twist { v, w }
    }

    /// The zero twist.
    #[inline(always)]
    pub fn zero(like: S) -> Self {
        Twist { v: Vec3::zero(like), w: Vec3::zero(like) }
    }

    /// From `[vx, vy, vz, wx, wy, wz]`.
    #[inline(always)]
    pub fn from_array([vx, vy, vz, wx, wy, wz]: [S; 6]) -> Self {
        Twist { v: Vec3([vx, vy, vz]), w: Vec3([wx, wy, wz]) }
    }

    /// `[vx, vy, vz, wx, wy, wz]`.
    #[inline(always)]
    pub fn to_array(self) -> [S; 6] {
        let ([vx, vy, vz], [wx, wy, wz]) = (self.v.0, self.w.0);
        [vx, vy, vz, wx, wy, wz]
    }

    /// Every component times `factor`.
    #[inline(always)]
    #[must_use]
    pub fn times(self, factor: S) -> Self {
        Twist { v: self.v.times(factor), w: self.w.times(factor) }
    }

    /// `hat`: the 4 × 4 matrix of this twist, rows first, `docs/model.md` (2).
    pub fn hat(self) -> [[S; 4]; 4] {
        let (m, o) = (Mat3::hat(self.w).0, self.v.0[0].lift(0.0));
        let row = |i: usize| [m[i][0], m[i][1], m[i][2], self.v.0[i]];
        [row(0), row(1), row(2), [o; 4]]
    }

    /// `vee`: the twist of a 4 × 4 matrix, the inverse of [`Twist::hat`]. Of the antisymmetric block the mean is taken.
    pub fn vee(m: [[S; 4]; 4]) -> Self {
        let half = |a: S, b: S| (a - b).scale(0.5);
        Twist {
            v: Vec3([m[0][3], m[1][3], m[2][3]]),
            w: Vec3([half(m[2][1], m[1][2]), half(m[0][2], m[2][0]), half(m[1][0], m[0][1])]),
        }
    }

    /// `ad`: the matrix of the Lie bracket, `ad(a) b = [a, b]`, `docs/model.md` (4).
    pub fn ad(self) -> Adjoint<S> {
        Adjoint { diagonal: Mat3::hat(self.w), coupling: Mat3::hat(self.v) }
    }

    /// Left Jacobian of exp, `exp((x + δ)^) = exp((J δ)^) exp(x^)` to first order, `docs/model.md` (7).
    pub fn left_jacobian(self) -> Adjoint<S> {
        let k = Coefficients::at(self.w.dot(self.w));
        let (w, v) = (Mat3::hat(self.w), Mat3::hat(self.v));
        let (ww, wv, vw) = (w * w, w * v, v * w);
        let wvw = wv * w;
        // (7a): J = I + b W + c W²
        let diagonal = Mat3::identity(k.a) + w.times(k.b) + ww.times(k.c);
        // (7b): Q = V/2 + c (WV + VW + WVW) + d (W²V + VW² - 3 WVW) + e (WVW² + W²VW)
        let coupling = v.times(k.a.lift(0.5))
            + (wv + vw + wvw).times(k.c)
            + (ww * v + v * ww + wvw.times(k.a.lift(-3.0))).times(k.d)
            + (wvw * w + w * wvw).times(k.e);
        Adjoint { diagonal, coupling }
    }

    /// Right Jacobian of exp, `exp((x + δ)^) = exp(x^) exp((J δ)^)` to first order: the left one at `-x`.
    pub fn right_jacobian(self) -> Adjoint<S> {
        (-self).left_jacobian()
    }
}

/// `J⁻¹(w)` of SO(3) alone: the change of a rotation vector for a small rotation applied from the left, `docs/model.md` (6).
pub(crate) fn inverse_left_jacobian_so3<S: Scalar>(w: Vec3<S>) -> Mat3<S> {
    let hat = Mat3::hat(w);
    let k = inverse_jacobian_coefficient(w.dot(w));
    Mat3::identity(k) + hat.times(k.lift(-0.5)) + (hat * hat).times(k)
}

impl Twist<f64> {
    /// The same twist as constants of the kind of `like`.
    #[inline(always)]
    pub fn lift<S: Scalar>(self, like: S) -> Twist<S> {
        Twist { v: self.v.lift(like), w: self.w.lift(like) }
    }
}

impl<S: Scalar> Wrench<S> {
    /// A force `f` that attacks at the point `p`: moment `p × f` about the origin of the frame.
    #[inline(always)]
    pub fn at_point(f: Vec3<S>, p: Vec3<S>) -> Self {
        Wrench { f, m: p.cross(f) }
    }

    /// A pure moment.
    #[inline(always)]
    pub fn couple(m: Vec3<S>) -> Self {
        Wrench { f: Vec3::zero(m.0[0]), m }
    }

    /// The form applied to a twist, `f·v + m·w`.
    #[inline(always)]
    pub fn dot(self, twist: Twist<S>) -> S {
        self.f.dot(twist.v) + self.m.dot(twist.w)
    }

    /// `[fx, fy, fz, mx, my, mz]`: a row over (v; w).
    #[inline(always)]
    pub fn to_array(self) -> [S; 6] {
        let ([a, b, c], [d, e, f]) = (self.f.0, self.m.0);
        [a, b, c, d, e, f]
    }
}

impl<S: Scalar> Adjoint<S> {
    /// The matrix applied to a twist.
    #[inline(always)]
    pub fn apply(self, x: Twist<S>) -> Twist<S> {
        Twist { v: self.diagonal * x.v + self.coupling * x.w, w: self.diagonal * x.w }
    }

    /// Product of two matrices of this form.
    #[must_use]
    pub fn then_after(self, first: Self) -> Self {
        Adjoint {
            diagonal: self.diagonal * first.diagonal,
            coupling: self.diagonal * first.coupling + self.coupling * first.diagonal,
        }
    }

    /// All 36 elements, rows first, order (v; w).
    pub fn to_array(self) -> [[S; 6]; 6] {
        let (d, c) = (self.diagonal.0, self.coupling.0);
        let o = d[0][0].lift(0.0);
        std::array::from_fn(|i| {
            if i < 3 {
                [d[i][0], d[i][1], d[i][2], c[i][0], c[i][1], c[i][2]]
            } else {
                [o, o, o, d[i - 3][0], d[i - 3][1], d[i - 3][2]]
            }
        })
    }
}

impl Adjoint<f64> {
    /// As a dense nalgebra matrix.
    pub fn to_matrix(self) -> nalgebra::Matrix6<f64> {
        let a = self.to_array();
        nalgebra::Matrix6::from_fn(|i, j| a[i][j])
    }
}

impl<S: Scalar> Add for Twist<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Twist { v: self.v + o.v, w: self.w + o.w }
    }
}

impl<S: Scalar> Sub for Twist<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Twist { v: self.v - o.v, w: self.w - o.w }
    }
}

impl<S: Scalar> Neg for Twist<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Twist { v: -self.v, w: -self.w }
    }
}

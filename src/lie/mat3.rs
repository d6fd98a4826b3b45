//! A 3 × 3 matrix, rows first, for rotations and the small matrices around them.
//!
//! Everything is written out: what takes closures is not inlined dependably, and would tear lanes out of their kernel.

use serde::{Deserialize, Serialize};

use std::ops::{Add, Mul};

use super::Vec3;
use crate::scalar::Scalar;

/// Three rows of three components.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mat3<S>(pub [[S; 3]; 3]);

impl<S: Scalar> Mat3<S> {
    /// The unit matrix, of the same kind of scalar as `like`.
    #[inline(always)]
    pub fn identity(like: S) -> Self {
        let (o, l) = (like.lift(0.0), like.lift(1.0));
        Mat3([[l, o, o], [o, l, o], [o, o, l]])
    }

    /// `hat(w)`: the matrix with `hat(w) x = w × x`, `docs/model.md` (2).
    #[inline(always)]
    pub fn hat(w: Vec3<S>) -> Self {
        let ([x, y, z], o) = (w.0, w.0[0].lift(0.0));
        Mat3([[o, -z, y], [z, o, -x], [-y, x, o]])
    }

    /// The transposed matrix; for a rotation its inverse.
    #[inline(always)]
    #[must_use]
    pub fn transpose(self) -> Self {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.0;
        Mat3([[a, d, g], [b, e, h], [c, f, i]])
    }

    /// Every element times `factor`.
    #[inline(always)]
    #[must_use]
    pub fn times(self, factor: S) -> Self {
        let [x, y, z] = self.0;
        Mat3([Vec3(x).times(factor).0, Vec3(y).times(factor).0, Vec3(z).times(factor).0])
    }

    /// Column `j`.
    #[inline(always)]
    pub fn column(self, j: usize) -> Vec3<S> {
        Vec3([self.0[0][j], self.0[1][j], self.0[2][j]])
    }
}

impl Mat3<f64> {
    /// The same matrix as constants of the kind of `like`.
    #[inline(always)]
    pub fn lift<S: Scalar>(self, like: S) -> Mat3<S> {
        let [x, y, z] = self.0;
        Mat3([Vec3(x).lift(like).0, Vec3(y).lift(like).0, Vec3(z).lift(like).0])
    }
}

impl<S: Scalar> Mul for Mat3<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        let (x, y, z) = (self * o.column(0), self * o.column(1), self * o.column(2));
        Mat3([x.0, y.0, z.0]).transpose()
    }
}

impl<S: Scalar> Mul<Vec3<S>> for Mat3<S> {
    type Output = Vec3<S>;
    #[inline(always)]
    fn mul(self, x: Vec3<S>) -> Vec3<S> {
        let [a, b, c] = self.0;
        Vec3([Vec3(a).dot(x), Vec3(b).dot(x), Vec3(c).dot(x)])
    }
}

impl<S: Scalar> Add for Mat3<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, o.0);
        Mat3([(Vec3(a) + Vec3(x)).0, (Vec3(b) + Vec3(y)).0, (Vec3(c) + Vec3(z)).0])
    }
}

//! A small vector of three scalars, written by hand so that duals and lanes run it.

use serde::{Deserialize, Serialize};

use std::ops::{Add, Neg, Sub};

use crate::scalar::Scalar;

/// Three components; what they mean (m, rad, 1) is said where it is used.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Vec3<S>(pub [S; 3]);

impl<S: Scalar> Vec3<S> {
    /// From three components.
    #[inline(always)]
    pub fn new(x: S, y: S, z: S) -> Self {
        Vec3([x, y, z])
    }

    /// The zero vector, of the same kind of scalar as `like`.
    #[inline(always)]
    pub fn zero(like: S) -> Self {
        Vec3([like.lift(0.0); 3])
    }

    /// Inner product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> S {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        c.mul_add(z, b.mul_add(y, a * x))
    }

    /// Vector product `self × other`.
    #[inline(always)]
    #[must_use]
    pub fn cross(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Vec3([b.mul_add(z, -(c * y)), c.mul_add(x, -(a * z)), a.mul_add(y, -(b * x))])
    }

    /// Every component times `factor`.
    #[inline(always)]
    #[must_use]
    pub fn times(self, factor: S) -> Self {
        let [x, y, z] = self.0;
        Vec3([x * factor, y * factor, z * factor])
    }

    /// Euclidean length; its derivative exists only away from zero.
    #[inline(always)]
    pub fn norm(self) -> S {
        self.dot(self).sqrt()
    }
}

impl Vec3<f64> {
    /// The same vector as constants of the kind of `like`.
    #[inline(always)]
    pub fn lift<S: Scalar>(self, like: S) -> Vec3<S> {
        let [x, y, z] = self.0;
        Vec3([like.lift(x), like.lift(y), like.lift(z)])
    }
}

impl<S: Scalar> Add for Vec3<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Vec3([self.0[0] + o.0[0], self.0[1] + o.0[1], self.0[2] + o.0[2]])
    }
}

impl<S: Scalar> Sub for Vec3<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Vec3([self.0[0] - o.0[0], self.0[1] - o.0[1], self.0[2] - o.0[2]])
    }
}

impl<S: Scalar> Neg for Vec3<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let [x, y, z] = self.0;
        Vec3([-x, -y, -z])
    }
}

impl Vec3<f64> {
    /// Two unit vectors that stand square to this one and to each other; those of the frame where they do.
    pub fn across(self) -> [Self; 2] {
        let basis = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3);
        let largest = (0..3).max_by(|a, b| self.0[*a].abs().total_cmp(&self.0[*b].abs())).unwrap_or(2);
        let first = basis[if largest == 0 { 1 } else { 0 }];
        let first = first - self.times(self.dot(first));
        let first = first.times(first.norm().recip());
        let mut second = self.cross(first);
        // With the sign of the frame's own vector.
        if second.0.iter().fold(0.0f64, |m, x| if x.abs() > m.abs() { *x } else { m }) < 0.0 {
            second = -second;
        }
        [first, second]
    }
}

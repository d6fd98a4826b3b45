//! A plain number whose products and sums are rounded once.

use std::ops::{Add, Mul, Neg, Sub};

use super::Scalar;

/// For what runs under a kernel, where there is an instruction for [`f64::mul_add`]; elsewhere that is a call that costs tens of times as much.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fused(pub f64);

impl Add for Fused {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Fused(self.0 + o.0)
    }
}

impl Sub for Fused {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Fused(self.0 - o.0)
    }
}

impl Mul for Fused {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Fused(self.0 * o.0)
    }
}

impl Neg for Fused {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Fused(-self.0)
    }
}

impl Scalar for Fused {
    #[inline(always)]
    fn lift(self, value: f64) -> Self {
        Fused(value)
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Fused(self.0.mul_add(factor.0, addend.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Fused(self.0.sqrt())
    }
    #[inline(always)]
    fn recip(self) -> Self {
        Fused(1.0 / self.0)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = self.0.sin_cos();
        (Fused(sine), Fused(cosine))
    }
    #[inline(always)]
    fn exp(self) -> Self {
        Fused(self.0.exp())
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        Fused(self.0.atan2(x.0))
    }
    #[inline(always)]
    fn select_below(self, limit: f64, below: Self, otherwise: Self) -> Self {
        if self.0 < limit { below } else { otherwise }
    }
}

//! The one small trait that lets the same kinematics run on `f64`, on dual numbers and on SIMD lanes.
//!
//! About a dozen operations, none of which branches: code that needs a case distinction says [`Scalar::select_below`].
//! Constants are made from a value at hand with [`Scalar::lift`], because lanes need the token that a value carries.

use std::fmt::Debug;
use std::ops::{Add, Mul, Neg, Sub};

use num_dual::{Dual64, DualNum, DualSVec64};

mod elementary;
mod fused;
mod lanes;

pub(crate) use elementary::exponentials;
pub(crate) use fused::Fused;
pub(crate) use lanes::{Lanes, MOST_LANES, sines_cosines};

/// A number that the kinematic kernels can work with: `f64`, [`Dual64`], [`DualSVec64`].
///
/// Dimensionless by itself; the functions that take it say whether it stands for m, rad or 1.
pub trait Scalar:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// The constant `value`, of the same kind as `self`; a dual's derivative part is zero.
    #[must_use]
    fn lift(self, value: f64) -> Self;

    /// `self * factor + addend`; rounded once where an instruction for that is at hand.
    #[inline(always)]
    #[must_use]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }

    /// Square root. The argument must be positive where a derivative is wanted.
    #[must_use]
    fn sqrt(self) -> Self;

    /// `1 / self`.
    #[must_use]
    fn recip(self) -> Self;

    /// Sine and cosine of an angle in rad.
    fn sin_cos(self) -> (Self, Self);

    /// `e` to the power of `self`.
    #[must_use]
    fn exp(self) -> Self;

    /// Sines and cosines of a whole column of angles in rad.
    fn sin_cos_all(angles: &[Self]) -> (Vec<Self>, Vec<Self>) {
        angles.iter().map(|x| x.sin_cos()).unzip()
    }

    /// `e` to the power of each of a column.
    fn exp_all(column: &mut [Self]) {
        column.iter_mut().for_each(|x| *x = x.exp());
    }

    /// Angle in rad of the point (`x`, `self`), as [`f64::atan2`].
    #[must_use]
    fn atan2(self, x: Self) -> Self;

    /// `below` where `self < limit`, `otherwise` elsewhere; for duals the real part decides.
    #[must_use]
    fn select_below(self, limit: f64, below: Self, otherwise: Self) -> Self;

    /// `self * factor`.
    #[inline(always)]
    #[must_use]
    fn scale(self, factor: f64) -> Self {
        self * self.lift(factor)
    }

    /// `self + value`.
    #[inline(always)]
    #[must_use]
    fn offset(self, value: f64) -> Self {
        self + self.lift(value)
    }
}

impl Scalar for f64 {
    #[inline(always)]
    fn lift(self, value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn recip(self) -> Self {
        f64::recip(self)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        f64::sin_cos(self)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        f64::exp(self)
    }
    fn sin_cos_all(angles: &[Self]) -> (Vec<Self>, Vec<Self>) {
        sines_cosines(angles)
    }
    fn exp_all(column: &mut [Self]) {
        exponentials(column);
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }
    #[inline(always)]
    fn select_below(self, limit: f64, below: Self, otherwise: Self) -> Self {
        if self < limit { below } else { otherwise }
    }
}

/// The operations of a dual number, which num-dual has under the same names.
macro_rules! dual_scalar {
    ($dual:ty $(, const $n:ident)?) => {
        impl$(<const $n: usize>)? Scalar for $dual {
            #[inline(always)]
            fn lift(self, value: f64) -> Self {
                <$dual>::from(value)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                DualNum::sqrt(&self)
            }
            #[inline(always)]
            fn recip(self) -> Self {
                DualNum::recip(&self)
            }
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                DualNum::sin_cos(&self)
            }
            #[inline(always)]
            fn exp(self) -> Self {
                DualNum::exp(&self)
            }
            #[inline(always)]
            fn atan2(self, x: Self) -> Self {
                DualNum::atan2(&self, x)
            }
            #[inline(always)]
            fn select_below(self, limit: f64, below: Self, otherwise: Self) -> Self {
                if self.re < limit { below } else { otherwise }
            }
        }
    };
}

dual_scalar!(Dual64);
dual_scalar!(DualSVec64<N>, const N);

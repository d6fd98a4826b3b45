//! The scalar functions of the squared angle `t2 = θ²` that exp, log and the left Jacobian are made of.
//!
//! Each is a power series below one radian and a closed form above. At the switch the closed forms have lost nothing to
//! cancellation yet and the series have ten terms (the first omitted one is below 1e-18), so value and derivative agree to rounding.

use crate::scalar::Scalar;

/// Below this squared angle the series is used, rad².
const SERIES_BELOW: f64 = 1.0;
const TERMS: usize = 10;

/// `Σ coefficient(k) (-t2)^k` by Horner's rule.
#[inline(always)]
fn alternating<S: Scalar>(t2: S, coefficient: impl Fn(usize) -> f64) -> S {
    let mut sum = t2.lift(coefficient(TERMS - 1));
    for k in (0..TERMS - 1).rev() {
        sum = -(t2 * sum).offset(-coefficient(k));
    }
    sum
}

/// `1 / n!` of all `n` that the series need.
const INVERSE_FACTORIALS: [f64; 2 * TERMS + 4] = {
    let mut all = [0.0; 2 * TERMS + 4];
    let mut n = 0;
    while n < all.len() {
        all[n] = inverse_factorial(n);
        n += 1;
    }
    all
};

/// `1 / n!`
const fn inverse_factorial(n: usize) -> f64 {
    let (mut product, mut i) = (1.0, 2);
    while i <= n {
        product *= i as f64;
        i += 1;
    }
    1.0 / product
}

/// The functions of one angle that the group needs, `docs/model.md` (3).
pub(super) struct Coefficients<S> {
    /// `sin θ / θ`
    pub a: S,
    /// `(1 - cos θ) / θ²`
    pub b: S,
    /// `(θ - sin θ) / θ³`
    pub c: S,
    /// `(θ² + 2 cos θ - 2) / (2 θ⁴)`
    pub d: S,
    /// `(2 θ - 3 sin θ + θ cos θ) / (2 θ⁵)`
    pub e: S,
}

impl<S: Scalar> Coefficients<S> {
    /// At the squared angle `t2`, rad².
    pub fn at(t2: S) -> Self {
        // The closed forms must stay finite where they are not chosen.
        let t2_safe = t2.select_below(SERIES_BELOW, t2.lift(1.0), t2);
        let t = t2_safe.sqrt();
        let (sin, cos) = t.sin_cos();
        let (half_sin, _) = t.scale(0.5).sin_cos();
        let (r, r2) = (t.recip(), t2_safe.recip());
        let b = (half_sin * half_sin).scale(2.0) * r2; // 1 - cos θ = 2 sin²(θ/2): no cancellation
        let c = (t - sin) * r * r2;
        let d = (t2_safe.scale(0.5) + cos).offset(-1.0) * r2 * r2;
        let e = (t.scale(2.0) - sin.scale(3.0) + t * cos).scale(0.5) * r * r2 * r2;
        let choose = |series: S, closed: S| t2.select_below(SERIES_BELOW, series, closed);
        Coefficients {
            a: choose(alternating(t2, |k| INVERSE_FACTORIALS[2 * k + 1]), sin * r),
            b: choose(alternating(t2, |k| INVERSE_FACTORIALS[2 * k + 2]), b),
            c: choose(alternating(t2, |k| INVERSE_FACTORIALS[2 * k + 3]), c),
            d: choose(alternating(t2, |k| INVERSE_FACTORIALS[2 * k + 4]), d),
            e: choose(alternating(t2, |k| (k + 1) as f64 * INVERSE_FACTORIALS[2 * k + 5]), e),
        }
    }
}

/// `atan2(n, s) / n` for the vector part `n >= 0` (given squared) and scalar part `s` of a unit quaternion:
/// half the rotation angle per length of the vector part, `docs/model.md` (5).
pub(super) fn half_angle_per_sine<S: Scalar>(n2: S, s: S) -> S {
    // atan(x)/x = Σ (-x²)^k / (2k + 1), x = n/s; ten terms are exact to rounding below x² = 0.01.
    const BELOW: f64 = 0.01;
    let n2_safe = n2.select_below(BELOW, n2.lift(0.25), n2);
    let n = n2_safe.sqrt();
    let closed = n.atan2(s) * n.recip();
    // s is near ±1 where the series is used; elsewhere the guard keeps the quotient finite.
    let s_safe = n2.select_below(BELOW, s, s.lift(1.0));
    let r = s_safe.recip();
    let series = alternating(n2 * r * r, |k| 1.0 / (2 * k + 1) as f64) * r;
    n2.select_below(BELOW, series, closed)
}

/// `(1 - h cot h) / (4 h²)`, `h = θ/2`: the quadratic coefficient of the inverse left Jacobian, `docs/model.md` (6).
pub(super) fn inverse_jacobian_coefficient<S: Scalar>(t2: S) -> S {
    // Series in θ²: |B(2k+2)| / (2k+2)! (Bernoulli numbers); it converges within a full turn, so the switch lies lower.
    const BELOW: f64 = 0.25;
    const SERIES: [f64; 9] = [
        1.0 / 12.0,
        1.0 / 720.0,
        1.0 / 30_240.0,
        1.0 / 1_209_600.0,
        1.0 / 47_900_160.0,
        691.0 / 1_307_674_368_000.0,
        1.0 / 74_724_249_600.0,
        3_617.0 / 10_670_622_842_880_000.0,
        43_867.0 / 5_109_094_217_170_944_000.0,
    ];
    let mut series = t2.lift(SERIES[8]);
    for &coefficient in SERIES[..8].iter().rev() {
        series = (series * t2).offset(coefficient);
    }
    let t2_safe = t2.select_below(BELOW, t2.lift(1.0), t2);
    let h = t2_safe.sqrt().scale(0.5);
    let (sin, cos) = h.sin_cos();
    let closed = (h * cos * sin.recip()).scale(-1.0).offset(1.0) * t2_safe.recip();
    t2.select_below(BELOW, series, closed)
}

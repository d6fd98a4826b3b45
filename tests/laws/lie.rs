//! The laws of SE(3) and se(3) that everything else rests on, each in the name of its test.
//!
//! A law that holds for numbers holds for their derivatives too, so that every law is checked on `f64`, on `Dual64` (one
//! direction) and on `DualSVec64<6>` (all six): real part and derivative parts of both sides must agree. Twists are ordered
//! (v; w), lengths in m, angles in rad. Equation numbers are those of `docs/model.md`. All seeds are fixed.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Debug;

use kincal::Scalar;
use kincal::lie::{Adjoint, Mat3, Pose, Twist, Vec3, Wrench};
use nalgebra::{Isometry3, Matrix4, Matrix6, SVector, Translation3, UnitQuaternion, Vector3, Vector6};
use num_dual::{Derivative, Dual64, DualSVec64};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};

mod algebra;
mod definitions;
mod switches;

type Dual6 = DualSVec64<6>;

// ---------------------------------------------------------------------------------------------------------------------
// Scalars and comparison

/// A scalar that a law is checked on: made with a derivative by six coordinates, taken apart into value and derivatives.
trait Sample: Scalar {
    /// The six coordinates of a point, each a variable.
    fn variables(x: [f64; 6]) -> [Self; 6];
    /// Real part, then derivative parts.
    fn parts(self) -> Vec<f64>;
}

impl Sample for f64 {
    fn variables(x: [f64; 6]) -> [Self; 6] {
        x
    }
    fn parts(self) -> Vec<f64> {
        vec![self]
    }
}

impl Sample for Dual64 {
    fn variables(x: [f64; 6]) -> [Self; 6] {
        const DIRECTION: [f64; 6] = [0.3, -0.7, 0.5, -0.4, 0.9, 0.6];
        std::array::from_fn(|k| Dual64::new(x[k], DIRECTION[k]))
    }
    fn parts(self) -> Vec<f64> {
        vec![self.re, self.eps]
    }
}

impl Sample for Dual6 {
    fn variables(x: [f64; 6]) -> [Self; 6] {
        std::array::from_fn(|k| DualSVec64::from_re(x[k]).derivative(k))
    }
    fn parts(self) -> Vec<f64> {
        let eps = self.eps.unwrap_generic(nalgebra::Const::<6>, nalgebra::U1);
        std::iter::once(self.re).chain(eps.iter().copied()).collect()
    }
}

/// Anything with scalars in it, in a fixed order.
trait Flat<S> {
    fn flat(&self) -> Vec<S>;
}

impl<S: Scalar> Flat<S> for S {
    fn flat(&self) -> Vec<S> {
        vec![*self]
    }
}

impl<S: Scalar> Flat<S> for Vec3<S> {
    fn flat(&self) -> Vec<S> {
        self.0.to_vec()
    }
}

impl<S: Scalar> Flat<S> for Mat3<S> {
    fn flat(&self) -> Vec<S> {
        self.0.concat()
    }
}

impl<S: Scalar> Flat<S> for Twist<S> {
    fn flat(&self) -> Vec<S> {
        self.to_array().to_vec()
    }
}

impl<S: Scalar> Flat<S> for Wrench<S> {
    fn flat(&self) -> Vec<S> {
        self.to_array().to_vec()
    }
}

impl<S: Scalar> Flat<S> for Pose<S> {
    fn flat(&self) -> Vec<S> {
        [self.rotation.flat(), self.translation.flat()].concat()
    }
}

impl<S: Scalar> Flat<S> for Adjoint<S> {
    fn flat(&self) -> Vec<S> {
        self.to_array().concat()
    }
}

fn reals<S: Sample>(of: &impl Flat<S>) -> Vec<f64> {
    of.flat().into_iter().flat_map(|s| s.parts()).collect()
}

/// Both sides of a law, value and derivatives, within `tolerance` (absolute; everything here is of order one to ten).
#[track_caller]
fn assert_law<S: Sample>(left: &(impl Flat<S> + Debug), right: &(impl Flat<S> + Debug), tolerance: f64) {
    assert_near(&reals(left), &reals(right), tolerance);
}

#[track_caller]
fn assert_near(left: &[f64], right: &[f64], tolerance: f64) {
    assert_eq!(left.len(), right.len());
    for (k, (a, b)) in left.iter().zip(right).enumerate() {
        // Written so that NaN fails.
        let near = (a - b).abs() <= tolerance;
        assert!(near, "number {k}: {a:e} against {b:e}, apart by {:e} > {tolerance:e}", (a - b).abs());
    }
}

// ---------------------------------------------------------------------------------------------------------------------
// Cases

/// A fixed seed: the same cases in every run.
fn config() -> Config {
    Config { cases: 256, rng_seed: RngSeed::Fixed(0x5e3), failure_persistence: None, ..Config::default() }
}

fn vector(bound: f64) -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-bound..bound)
}

fn direction() -> impl Strategy<Value = [f64; 3]> {
    let axes = prop::sample::select(vec![[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]);
    let any = vector(1.0)
        .prop_filter("long enough to have a direction", |v| v.iter().map(|c| c * c).sum::<f64>() > 0.01)
        .prop_map(|v| {
            let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
            v.map(|c| c / length)
        });
    prop_oneof![1 => axes, 4 => any]
}

/// A twist with translation within 2 m and angle in [0, `limit`): zero, tiny and large ones.
fn twist(limit: f64) -> impl Strategy<Value = [f64; 6]> {
    let angle = prop_oneof![
        1 => Just(0.0),
        3 => (-17.0..0.0).prop_map(|power: f64| 10_f64.powf(power)),
        6 => 0.0..limit,
    ];
    (vector(2.0), direction(), angle).prop_map(|(v, n, t)| [v[0], v[1], v[2], n[0] * t, n[1] * t, n[2] * t])
}

fn variable<S: Sample>(x: [f64; 6]) -> Twist<S> {
    Twist::from_array(S::variables(x))
}

fn pose<S: Sample>(x: [f64; 6]) -> Pose<S> {
    Pose::exp(variable(x))
}

/// Just below a half turn: there the sign of the rotation vector is still determined.
const HALF_TURN: f64 = PI - 1e-9;

/// Derivatives of a twist, one column per variable.
fn twist_slopes(x: Twist<Dual6>) -> Matrix6<f64> {
    let rows = x.to_array();
    Matrix6::from_fn(|i, k| rows[i].parts()[1 + k])
}

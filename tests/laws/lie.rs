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

/// One proptest per law and kind of scalar; the law itself is a generic function of the same name.
macro_rules! laws {
    ($($(#[$doc:meta])* $law:ident ( $($name:ident in $strategy:expr),+ ) )+) => {$(
        mod $law {
            use super::*;
            proptest! {
                #![proptest_config(config())]
                $(#[$doc])*
                #[test]
                fn on_f64($($name in $strategy),+) { super::law::$law::<f64>($($name),+); }
                $(#[$doc])*
                #[test]
                fn on_dual64($($name in $strategy),+) { super::law::$law::<Dual64>($($name),+); }
                $(#[$doc])*
                #[test]
                fn on_dual_vec_6($($name in $strategy),+) { super::law::$law::<Dual6>($($name),+); }
            }
        }
    )+};
}

laws! {
    exp_of_log_is_identity(x in twist(HALF_TURN))
    log_of_exp_is_identity(x in twist(HALF_TURN))
    inverse_undoes(x in twist(6.0))
    rotation_is_orthonormal(x in twist(6.0))
    exp_of_minus_x_is_inverse(x in twist(6.0))
    product_is_associative(x in twist(6.0), y in twist(6.0), z in twist(6.0))
    transform_respects_product(x in twist(6.0), y in twist(6.0), p in vector(2.0))
    adjoint_of_product_is_product_of_adjoints(x in twist(6.0), y in twist(6.0))
    adjoint_of_inverse_undoes_adjoint(x in twist(6.0), y in twist(6.0))
    carry_twist_is_adjoint_applied(x in twist(6.0), y in twist(6.0))
    conjugation_of_exp_is_exp_of_adjoint(x in twist(6.0), y in twist(3.0))
    carry_wrench_is_transpose_of_carry_twist(x in twist(6.0), y in twist(6.0), z in twist(6.0))
    carry_wrench_respects_product(x in twist(6.0), y in twist(6.0), z in twist(6.0))
    bracket_is_antisymmetric(x in twist(6.0), y in twist(6.0))
    jacobi_identity(x in twist(3.0), y in twist(3.0), z in twist(3.0))
    ad_of_bracket_is_commutator_of_ads(x in twist(3.0), y in twist(3.0))
    adjoint_maps_brackets_to_brackets(x in twist(3.0), y in twist(3.0), z in twist(3.0))
    vee_of_hat_is_identity(x in twist(6.0))
    bracket_is_commutator_of_hats(x in twist(3.0), y in twist(3.0))
    left_jacobian_is_adjoint_times_right_jacobian(x in twist(6.0))
    left_jacobian_keeps_its_own_twist(x in twist(6.0))
    turn_is_exp_of_scaled_axis(n in direction(), x in twist(6.0))
    turn_about_own_axis_adds_angles(n in direction(), x in twist(3.0))
}

/// The laws, generic over the scalar. Tolerances are absolute, for values and derivatives alike.
mod law {
    use super::*;

    /// `exp(log T) = T`.
    pub fn exp_of_log_is_identity<S: Sample>(x: [f64; 6]) {
        let t = pose::<S>(x);
        assert_law(&Pose::exp(t.log()), &t, 1e-13);
    }

    /// `log(exp x) = x` below a half turn.
    pub fn log_of_exp_is_identity<S: Sample>(x: [f64; 6]) {
        let x = variable::<S>(x);
        assert_law(&Pose::exp(x).log(), &x, 1e-13);
    }

    pub fn inverse_undoes<S: Sample>(x: [f64; 6]) {
        let t = pose::<S>(x);
        let identity = Pose::identity(t.translation.0[0]);
        assert_law(&(t * t.inverse()), &identity, 1e-13);
        assert_law(&(t.inverse() * t), &identity, 1e-13);
    }

    pub fn rotation_is_orthonormal<S: Sample>(x: [f64; 6]) {
        let r = pose::<S>(x).rotation;
        assert_law(&(r.transpose() * r), &Mat3::identity(r.0[0][0]), 1e-13);
        let determinant = r.column(0).cross(r.column(1)).dot(r.column(2));
        assert_law(&determinant, &determinant.lift(1.0), 1e-13);
    }

    pub fn exp_of_minus_x_is_inverse<S: Sample>(x: [f64; 6]) {
        let x = variable::<S>(x);
        assert_law(&Pose::exp(-x), &Pose::exp(x).inverse(), 1e-13);
    }

    pub fn product_is_associative<S: Sample>(x: [f64; 6], y: [f64; 6], z: [f64; 6]) {
        let (a, b, c) = (pose::<S>(x), pose::<S>(y), pose::<S>(z));
        assert_law(&((a * b) * c), &(a * (b * c)), 1e-13);
    }

    pub fn transform_respects_product<S: Sample>(x: [f64; 6], y: [f64; 6], p: [f64; 3]) {
        let (a, b) = (pose::<S>(x), pose::<S>(y));
        let p = Vec3(p).lift(a.translation.0[0]);
        assert_law(&(a * b).transform(p), &a.transform(b.transform(p)), 1e-13);
    }

    /// (4): `Ad(AB) = Ad(A) Ad(B)`.
    pub fn adjoint_of_product_is_product_of_adjoints<S: Sample>(x: [f64; 6], y: [f64; 6]) {
        let (a, b) = (pose::<S>(x), pose::<S>(y));
        assert_law(&(a * b).adjoint(), &a.adjoint().then_after(b.adjoint()), 1e-13);
    }

    pub fn adjoint_of_inverse_undoes_adjoint<S: Sample>(x: [f64; 6], y: [f64; 6]) {
        let (a, y) = (pose::<S>(x), variable::<S>(y));
        assert_law(&a.inverse().carry_twist(a.carry_twist(y)), &y, 1e-12);
    }

    pub fn carry_twist_is_adjoint_applied<S: Sample>(x: [f64; 6], y: [f64; 6]) {
        let (a, y) = (pose::<S>(x), variable::<S>(y));
        assert_law(&a.carry_twist(y), &a.adjoint().apply(y), 1e-13);
    }

    /// (4): `A exp(x) A⁻¹ = exp(Ad(A) x)`.
    pub fn conjugation_of_exp_is_exp_of_adjoint<S: Sample>(x: [f64; 6], y: [f64; 6]) {
        let (a, y) = (pose::<S>(x), variable::<S>(y));
        assert_law(&(a * Pose::exp(y) * a.inverse()), &Pose::exp(a.carry_twist(y)), 1e-12);
    }

    /// (14): `(Ad(A)ᵀ y) · x = y · (Ad(A) x)`.
    pub fn carry_wrench_is_transpose_of_carry_twist<S: Sample>(x: [f64; 6], y: [f64; 6], z: [f64; 6]) {
        let (a, x) = (pose::<S>(x), variable::<S>(z));
        let form = variable::<S>(y);
        let y = Wrench { f: form.v, m: form.w };
        assert_law(&a.carry_wrench(y).dot(x), &y.dot(a.carry_twist(x)), 1e-12);
        // Element by element: the row times the matrix.
        let (row, matrix) = (y.to_array(), a.adjoint().to_array());
        let product: [S; 6] =
            std::array::from_fn(|j| (0..6).fold(row[0].lift(0.0), |sum, i| sum + row[i] * matrix[i][j]));
        assert_law(&a.carry_wrench(y), &Twist::from_array(product), 1e-12);
    }

    pub fn carry_wrench_respects_product<S: Sample>(x: [f64; 6], y: [f64; 6], z: [f64; 6]) {
        let (a, b, form) = (pose::<S>(x), pose::<S>(y), variable::<S>(z));
        let y = Wrench { f: form.v, m: form.w };
        assert_law(&(a * b).carry_wrench(y), &b.carry_wrench(a.carry_wrench(y)), 1e-12);
    }

    pub fn bracket_is_antisymmetric<S: Sample>(x: [f64; 6], y: [f64; 6]) {
        let (x, y) = (variable::<S>(x), variable::<S>(y));
        let zero = Twist::zero(x.v.0[0]);
        assert_law(&(x.ad().apply(y) + y.ad().apply(x)), &zero, 1e-13);
        assert_law(&x.ad().apply(x), &zero, 1e-13);
    }

    /// `[x, [y, z]] + [y, [z, x]] + [z, [x, y]] = 0`. `z` is seeded in other directions than `x` and `y`.
    pub fn jacobi_identity<S: Sample>(x: [f64; 6], y: [f64; 6], z: [f64; 6]) {
        let (x, y) = (variable::<S>(x), variable::<S>(y));
        let z = pose::<S>([0.1; 6]).carry_twist(variable::<S>(z));
        let double = |a: Twist<S>, b: Twist<S>, c: Twist<S>| a.ad().apply(b.ad().apply(c));
        let sum = double(x, y, z) + double(y, z, x) + double(z, x, y);
        assert_law(&sum, &Twist::zero(x.v.0[0]), 1e-12);
    }

    /// `ad([x, y]) = ad(x) ad(y) - ad(y) ad(x)`.
    pub fn ad_of_bracket_is_commutator_of_ads<S: Sample>(x: [f64; 6], y: [f64; 6]) {
        let (x, y) = (variable::<S>(x), variable::<S>(y));
        let (xy, yx) = (x.ad().then_after(y.ad()), y.ad().then_after(x.ad()));
        let difference: Vec<S> = xy.flat().into_iter().zip(yx.flat()).map(|(a, b)| a - b).collect();
        let difference: Vec<f64> = difference.into_iter().flat_map(|s| s.parts()).collect();
        assert_near(&reals(&x.ad().apply(y).ad()), &difference, 1e-12);
    }

    /// `Ad(A) [y, z] = [Ad(A) y, Ad(A) z]`.
    pub fn adjoint_maps_brackets_to_brackets<S: Sample>(x: [f64; 6], y: [f64; 6], z: [f64; 6]) {
        let (a, y, z) = (pose::<S>(x), variable::<S>(y), variable::<S>(z));
        let carried = a.carry_twist(y).ad().apply(a.carry_twist(z));
        assert_law(&a.carry_twist(y.ad().apply(z)), &carried, 1e-11);
    }

    /// (2): exact, because it only moves numbers.
    pub fn vee_of_hat_is_identity<S: Sample>(x: [f64; 6]) {
        let x = variable::<S>(x);
        assert_law(&Twist::vee(x.hat()), &x, 0.0);
        let w = x.w.0;
        let hat = Mat3::hat(x.w).0;
        assert_law(&Vec3([hat[2][1], hat[0][2], hat[1][0]]), &Vec3(w), 0.0);
        assert_law(&(Mat3::hat(x.w) * x.v), &x.w.cross(x.v), 1e-14);
    }

    /// (4): `hat([x, y]) = hat(x) hat(y) - hat(y) hat(x)`.
    pub fn bracket_is_commutator_of_hats<S: Sample>(x: [f64; 6], y: [f64; 6]) {
        let (x, y) = (variable::<S>(x), variable::<S>(y));
        let product = |a: [[S; 4]; 4], b: [[S; 4]; 4]| -> [[S; 4]; 4] {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| (0..4).fold(a[0][0].lift(0.0), |sum, k| sum + a[i][k] * b[k][j]))
            })
        };
        let (xy, yx) = (product(x.hat(), y.hat()), product(y.hat(), x.hat()));
        let commutator = std::array::from_fn(|i| std::array::from_fn(|j| xy[i][j] - yx[i][j]));
        assert_law(&Twist::vee(commutator), &x.ad().apply(y), 1e-13);
    }

    /// (7): `J_l(x) = Ad(exp x) J_r(x)`.
    pub fn left_jacobian_is_adjoint_times_right_jacobian<S: Sample>(x: [f64; 6]) {
        let x = variable::<S>(x);
        let right = Pose::exp(x).adjoint().then_after(x.right_jacobian());
        assert_law(&x.left_jacobian(), &right, 1e-12);
    }

    /// `J_l(x) x = x`: a twist commutes with itself.
    pub fn left_jacobian_keeps_its_own_twist<S: Sample>(x: [f64; 6]) {
        let x = variable::<S>(x);
        assert_law(&x.left_jacobian().apply(x), &x, 1e-12);
        assert_law(&x.right_jacobian().apply(x), &x, 1e-12);
    }

    pub fn turn_is_exp_of_scaled_axis<S: Sample>(n: [f64; 3], x: [f64; 6]) {
        let angle = S::variables(x)[4];
        let w = Vec3(n).lift(angle).times(angle);
        assert_law(&Pose::turn(Vec3(n), angle), &Pose::exp(Twist::new(Vec3::zero(angle), w)), 1e-14);
    }

    pub fn turn_about_own_axis_adds_angles<S: Sample>(n: [f64; 3], x: [f64; 6]) {
        let [a, b, ..] = S::variables(x);
        let n = Vec3(n);
        assert_law(&(Pose::turn(n, a) * Pose::turn(n, b)), &Pose::turn(n, a + b), 1e-14);
    }
}

// ---------------------------------------------------------------------------------------------------------------------
// Matrices against their definitions

fn matrix4(rows: [[f64; 4]; 4]) -> Matrix4<f64> {
    Matrix4::from_fn(|i, j| rows[i][j])
}

fn homogeneous(t: Pose<f64>) -> Matrix4<f64> {
    let (r, p) = (t.rotation.0, t.translation.0);
    Matrix4::from_fn(|i, j| match (i, j) {
        (3, 3) => 1.0,
        (3, _) => 0.0,
        (_, 3) => p[i],
        _ => r[i][j],
    })
}

/// `Σ x^k / (k + first)!`: exp for `first` = 0, the left Jacobian for `first` = 1.
fn series<const N: usize>(x: nalgebra::SMatrix<f64, N, N>, first: usize) -> nalgebra::SMatrix<f64, N, N> {
    let mut term = nalgebra::SMatrix::identity();
    let mut sum = term;
    for k in 1..60 {
        term = term * x / (k + first) as f64;
        sum += term;
    }
    sum
}

proptest! {
    #![proptest_config(config())]

    /// (3)
    #[test]
    fn exp_is_matrix_exponential_of_hat(x in twist(3.0)) {
        let x = Twist::from_array(x);
        let sum = series(matrix4(x.hat()), 0);
        assert_near(homogeneous(Pose::exp(x)).as_slice(), sum.as_slice(), 1e-13);
    }

    /// (4)
    #[test]
    fn adjoint_of_exp_is_matrix_exponential_of_ad(x in twist(3.0)) {
        let x = Twist::from_array(x);
        let sum = series(x.ad().to_matrix(), 0);
        assert_near(Pose::exp(x).adjoint().to_matrix().as_slice(), sum.as_slice(), 1e-13);
    }

    /// (7): `J_l(x) = Σ ad(x)^k / (k + 1)!`.
    #[test]
    fn left_jacobian_is_series_of_ad(x in twist(3.0)) {
        let x = Twist::from_array(x);
        let sum: Matrix6<f64> = series(x.ad().to_matrix(), 1);
        assert_near(x.left_jacobian().to_matrix().as_slice(), sum.as_slice(), 1e-13);
        let sum: Matrix6<f64> = series(-x.ad().to_matrix(), 1);
        assert_near(x.right_jacobian().to_matrix().as_slice(), sum.as_slice(), 1e-13);
    }

    /// (7): column k of `J_l` is `vee(∂exp(x)/∂x_k exp(x)⁻¹)`, of `J_r` `vee(exp(x)⁻¹ ∂exp(x)/∂x_k)`.
    #[test]
    fn jacobians_are_derivatives_of_exp(x in twist(6.0)) {
        let at = Twist::from_array(x);
        let inverse = homogeneous(Pose::exp(at).inverse());
        let dual = pose::<Dual6>(x);
        let (left, right) = (at.left_jacobian().to_matrix(), at.right_jacobian().to_matrix());
        for k in 0..6 {
            let slope = pose_slope(dual, k);
            let vee = |m: Matrix4<f64>| {
                Twist::vee(std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)]))).to_array()
            };
            assert_near(&vee(slope * inverse), left.column(k).as_slice(), 1e-12);
            assert_near(&vee(inverse * slope), right.column(k).as_slice(), 1e-12);
        }
    }

    /// `d/ds Ad(exp(s x) A) = ad(x) Ad(A)` at `s = 0`, exactly where nalgebra's constructors lose the derivative.
    #[test]
    fn ad_is_derivative_of_adjoint(x in twist(6.0), y in twist(6.0)) {
        let (x, a) = (Twist::from_array(x), Pose::exp(Twist::from_array(y)));
        let s = Dual64::new(0.0, 1.0);
        let moving = (Pose::exp(x.lift(s).times(s)) * a.lift(s)).adjoint().to_array();
        let expected = x.ad().then_after(a.adjoint()).to_array();
        let slopes: Vec<f64> = moving.concat().into_iter().map(|d| d.eps).collect();
        assert_near(&slopes, &expected.concat(), 1e-13);
    }

    /// (6) against (7): a small displacement from the left moves the logarithm by `J_l⁻¹`.
    #[test]
    fn derivative_of_log_is_inverse_left_jacobian(x in twist(HALF_TURN)) {
        let at = Twist::from_array(x);
        let zero = Dual6::from_re(0.0);
        let small = variable::<Dual6>([0.0; 6]);
        let log = (Pose::exp(small) * Pose::exp(at).lift(zero)).log();
        let slopes = twist_slopes(log);
        assert_near((at.left_jacobian().to_matrix() * slopes).as_slice(), Matrix6::identity().as_slice(), 1e-12);
    }

    #[test]
    fn isometry_there_and_back(x in twist(6.0)) {
        let t = Pose::exp(Twist::from_array(x));
        let isometry: Isometry3<f64> = t.to_isometry();
        assert_near(isometry.to_homogeneous().as_slice(), homogeneous(t).as_slice(), 1e-14);
        assert_law::<f64>(&Pose::from(isometry), &t, 1e-14);
        let again = Pose::from(isometry).to_isometry();
        assert_near(again.to_homogeneous().as_slice(), isometry.to_homogeneous().as_slice(), 1e-14);
    }

    #[test]
    fn isometry_product_is_pose_product(x in twist(6.0), y in twist(6.0)) {
        let (a, b) = (Pose::exp(Twist::from_array(x)), Pose::exp(Twist::from_array(y)));
        assert_law::<f64>(&Pose::from(a.to_isometry() * b.to_isometry()), &(a * b), 1e-13);
        assert_law::<f64>(&Pose::from(a.to_isometry().inverse()), &a.inverse(), 1e-13);
    }

    #[test]
    fn isometry_of_nalgebra_keeps_its_meaning(x in twist(HALF_TURN)) {
        let [vx, vy, vz, wx, wy, wz] = x;
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(wx, wy, wz));
        let pose = Pose::from(Isometry3::from_parts(Translation3::new(vx, vy, vz), turn));
        let w = pose.rotation_vector();
        assert_near(&w.0, &[wx, wy, wz], 1e-13);
        let p: nalgebra::Vector3<f64> = pose.translation.into();
        assert_eq!(Vec3::from(p), Vec3([vx, vy, vz]));
    }

    /// The kernels that run on duals are the ones that run on `f64`: same numbers, not merely close ones.
    #[test]
    fn real_part_of_dual_is_the_f64_value(x in twist(6.0), y in twist(6.0), n in direction()) {
        fn everything<S: Sample>(x: [f64; 6], y: [f64; 6], n: [f64; 3]) -> Vec<f64> {
            let (tx, ty) = (variable::<S>(x), variable::<S>(y));
            let (a, b) = (Pose::exp(tx), Pose::exp(ty));
            let wrench = Wrench { f: ty.v, m: ty.w };
            let numbers = [
                a.flat(), a.log().flat(), (a * b).log().flat(), a.inverse().flat(), a.adjoint().flat(),
                a.carry_twist(ty).flat(), a.carry_wrench(wrench).flat(), tx.ad().apply(ty).flat(),
                tx.left_jacobian().flat(), tx.right_jacobian().flat(), Pose::turn(Vec3(n), tx.w.0[0]).flat(),
            ];
            numbers.concat().into_iter().map(|s| s.parts()[0]).collect()
        }
        let plain = everything::<f64>(x, y, n);
        for real in [everything::<Dual64>(x, y, n), everything::<Dual6>(x, y, n)] {
            for (a, b) in plain.iter().zip(real) {
                let near = a.next_down() <= b && b <= a.next_up();
                assert!(near, "{a:e} against {b:e}");
            }
        }
    }

    /// Duals against central differences of plain numbers.
    #[test]
    fn dual_derivative_matches_central_difference(x in twist(3.0), y in twist(3.0)) {
        fn everything<S: Sample>(x: Twist<S>, b: Pose<S>) -> Vec<S> {
            let a = Pose::exp(x);
            let turn = Pose::turn(Vec3([0.6, 0.0, 0.8]), x.w.0[0]);
            [
                a.flat(), a.inverse().flat(), (a * b).adjoint().flat(), x.left_jacobian().flat(),
                x.right_jacobian().flat(), turn.flat(), a.carry_twist(x).flat(), a.log().flat(),
            ].concat()
        }
        const STEP: f64 = 1e-4;
        let b = Pose::exp(Twist::from_array(y));
        let dual = everything(variable::<Dual6>(x), b.lift(Dual6::from_re(0.0)));
        for k in 0..6 {
            let at = |step: f64| {
                let mut moved = x;
                moved[k] += step;
                everything(Twist::from_array(moved), b)
            };
            // Fourth order: the truncation error is of the order of STEP⁴.
            let (p, m, pp, mm) = (at(STEP), at(-STEP), at(2.0 * STEP), at(-2.0 * STEP));
            let slopes: Vec<f64> = (0..p.len())
                .map(|i| (8.0 * (p[i] - m[i]) - (pp[i] - mm[i])) / (12.0 * STEP))
                .collect();
            let duals: Vec<f64> = dual.iter().map(|d| d.parts()[1 + k]).collect();
            assert_near(&duals, &slopes, 1e-9);
        }
    }
}

/// Derivative of a pose by variable `k`, as a homogeneous matrix.
fn pose_slope(t: Pose<Dual6>, k: usize) -> Matrix4<f64> {
    Matrix4::from_fn(|i, j| match (i, j) {
        (3, _) => 0.0,
        (_, 3) => t.translation.0[i].parts()[1 + k],
        _ => t.rotation.0[i][j].parts()[1 + k],
    })
}

/// Derivatives of a twist, one column per variable.
fn twist_slopes(x: Twist<Dual6>) -> Matrix6<f64> {
    let rows = x.to_array();
    Matrix6::from_fn(|i, k| rows[i].parts()[1 + k])
}

// ---------------------------------------------------------------------------------------------------------------------
// Conventions

#[test]
fn angular_part_comes_last_and_pure_wz_turns_x_into_y() {
    let quarter = Pose::exp(Twist::from_array([0.0, 0.0, 0.0, 0.0, 0.0, FRAC_PI_2]));
    assert_near(&quarter.transform(Vec3([1.0, 0.0, 0.0])).0, &[0.0, 1.0, 0.0], 1e-15);
    assert_near(&quarter.transform(Vec3([0.0, 1.0, 0.0])).0, &[-1.0, 0.0, 0.0], 1e-15);
}

#[test]
fn linear_part_comes_first_and_pure_v_moves() {
    let step = Pose::exp(Twist::from_array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0]));
    assert_eq!(step, Pose::translation(Vec3([1.0, 2.0, 3.0])));
}

/// A body that turns about a line through `p` moves its origin by `p × w`, the linear part of the twist.
#[test]
fn adjoint_couples_position_and_turn() {
    let p = Vec3([0.0, 2.0, 0.0]);
    let seen = Pose::translation(p).carry_twist(Twist::from_array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
    assert_eq!(seen.to_array(), [2.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn force_at_a_point_has_its_moment_about_the_origin() {
    let (f, p) = (Vec3([0.0, 0.0, 3.0]), Vec3([2.0, 0.0, 0.0]));
    assert_eq!(Wrench::at_point(f, p).to_array(), [0.0, 0.0, 3.0, 0.0, -6.0, 0.0]);
    // In a frame whose origin is the point of attack the moment is gone.
    assert_eq!(Pose::translation(p).carry_wrench(Wrench::at_point(f, p)).m, Vec3([0.0; 3]));
    // It does the work of the point's velocity, f · (v + w × p).
    let x = Twist::from_array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
    let velocity = x.v + x.w.cross(p);
    assert_near(&[Wrench::at_point(f, p).dot(x)], &[f.dot(velocity)], 1e-15);
    assert_eq!(Wrench::couple(p).dot(x), p.dot(x.w));
}

// ---------------------------------------------------------------------------------------------------------------------
// Exactly at zero

#[test]
fn derivative_of_exp_at_zero_is_the_basis_of_se3() {
    let t = pose::<Dual6>([0.0; 6]);
    for k in 0..6 {
        let basis: [f64; 6] = std::array::from_fn(|i| f64::from(u8::from(i == k)));
        let expected = matrix4(Twist::from_array(basis).hat());
        assert_eq!(pose_slope(t, k), expected);
    }
}

#[test]
fn derivative_of_log_at_identity_is_identity() {
    let log = pose::<Dual6>([0.0; 6]).log();
    assert_eq!(log.to_array().map(|c| c.re), [0.0; 6]);
    assert_eq!(twist_slopes(log), Matrix6::identity());
    assert_eq!(
        twist_slopes(Pose { translation: Vec3::zero(Dual6::from_re(0.0)), ..pose([0.0; 6]) }.log()),
        {
            let mut rotation_only = Matrix6::identity();
            rotation_only.fill_diagonal(0.0);
            (3..6).for_each(|k| rotation_only[(k, k)] = 1.0);
            rotation_only
        }
    );
}

/// At zero rotation and translation `p`: `J_l⁻¹ = I - ½ ad((p; 0))`, the series ends there.
#[test]
fn derivative_of_log_at_pure_translation_is_analytic() {
    let p = Twist::from_array([0.3, -1.2, 0.7, 0.0, 0.0, 0.0]);
    let log = (pose::<Dual6>([0.0; 6]) * Pose::exp(p).lift(Dual6::from_re(0.0))).log();
    let expected = Matrix6::identity() - p.ad().to_matrix() * 0.5;
    assert_near(twist_slopes(log).as_slice(), expected.as_slice(), 1e-15);
}

/// At zero rotation: `∂p/∂w_k = ½ e_k × v`.
#[test]
fn derivative_of_exp_at_pure_translation_is_analytic() {
    let x = [0.3, -1.2, 0.7, 0.0, 0.0, 0.0];
    let t = pose::<Dual6>(x);
    let v = Vector3::new(x[0], x[1], x[2]);
    for k in 0..3 {
        let slope = pose_slope(t, 3 + k);
        let mut axis = Vector3::zeros();
        axis[k] = 1.0;
        let expected = axis.cross(&v) * 0.5;
        assert_near(slope.fixed_view::<3, 1>(0, 3).into_owned().as_slice(), expected.as_slice(), 1e-16);
        assert_near(
            slope.fixed_view::<3, 3>(0, 0).into_owned().as_slice(),
            axis.cross_matrix().as_slice(),
            1e-16,
        );
    }
}

#[test]
fn derivative_of_turn_at_zero_is_hat_of_axis() {
    let axis = Vec3([0.6, -0.48, 0.64]);
    let turn = Pose::turn(axis, Dual64::new(0.0, 1.0));
    assert_eq!(turn.rotation.0.map(|row| row.map(|c| c.eps)), Mat3::hat(axis).0);
    assert_eq!(turn.rotation.0.map(|row| row.map(|c| c.re)), Mat3::identity(0.0).0);
    assert_eq!(turn.translation.0.map(|c| (c.re, c.eps)), [(0.0, 0.0); 3]);
}

/// `J_l(x) = I + ½ ad(x) + ...`: its derivative at zero is `½ ad` of the direction.
#[test]
fn derivative_of_left_jacobian_at_zero_is_half_ad() {
    let direction = [0.3, -0.7, 0.5, -0.4, 0.9, 0.6];
    let x = Twist::from_array(direction.map(|d| Dual64::new(0.0, d)));
    let slopes: Vec<f64> = x.left_jacobian().flat().into_iter().map(|c| c.eps).collect();
    let half: Vec<f64> = Twist::from_array(direction).ad().flat().into_iter().map(|c| c * 0.5).collect();
    assert_near(&slopes, &half, 1e-16);
}

// ---------------------------------------------------------------------------------------------------------------------
// Across the switches between series and closed form

/// `f` and its derivative on both sides of `at`: neighbouring values differ by what the derivative says, neighbouring
/// derivatives by what a smooth function of order one lets them.
#[track_caller]
fn assert_smooth_across(at: f64, f: impl Fn(Dual64) -> Vec<Dual64>) {
    let eval = |x: f64| f(Dual64::new(x, 1.0));
    let neighbours = (at.next_down().next_down().next_down(), at.next_up().next_up().next_up());
    let pairs = [1e-12, 1e-9, 1e-7, 1e-6, 3e-6].map(|h| (at - h, at + h));
    for (below, above) in std::iter::once(neighbours).chain(pairs) {
        let (low, high) = (eval(below), eval(above));
        for (k, (a, b)) in low.iter().zip(&high).enumerate() {
            let step = above - below;
            let jump = b.re - a.re - 0.5 * step * (a.eps + b.eps); // trapezoid: the rest is step³ f‴/12
            assert!(jump.abs() <= 1e-14, "value {k} jumps by {jump:e} across {at} ± {:e}", 0.5 * step);
            let bend = b.eps - a.eps;
            let allowed = 1e-14 + 100.0 * step;
            assert!(bend.abs() <= allowed, "slope {k} jumps by {bend:e} across {at} ± {:e}", 0.5 * step);
        }
    }
}

/// A few unit vectors; exact ones place the squared angle exactly.
const AXES: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.0, -0.8], [0.48, 0.6, 0.64]];

/// The switch of (3) and (7): one radian.
#[test]
fn exp_and_jacobians_are_smooth_across_one_radian() {
    for n in AXES {
        assert_smooth_across(1.0, |angle| {
            let n = Vec3(n).lift(angle);
            let x = Twist::new(Vec3([0.8, -0.5, 1.0]).lift(angle), n.times(angle));
            [Pose::exp(x).flat(), x.left_jacobian().flat(), x.right_jacobian().flat()].concat()
        });
    }
}

/// The switch of (5): the sine of half the angle is 0.1.
#[test]
fn rotation_vector_is_smooth_across_the_switch_of_the_half_angle() {
    let at = 2.0 * 0.1_f64.asin();
    for n in AXES {
        assert_smooth_across(at, |angle| {
            let w = Pose::turn(Vec3(n), angle).rotation_vector();
            // The rotation vector is angle times axis, its derivative the axis, on both sides.
            assert_near(&w.0.map(|c| c.re), &n.map(|c| c * angle.re), 2e-15);
            assert_near(&w.0.map(|c| c.eps), &n, 1e-14);
            w.flat()
        });
    }
}

/// The switch of (6): half a radian.
#[test]
fn log_is_smooth_across_half_a_radian() {
    for n in AXES {
        assert_smooth_across(0.5, |angle| {
            let turn = Pose::turn(Vec3(n), angle);
            Pose { translation: Vec3([0.8, -0.5, 1.0]).lift(angle), ..turn }.log().flat()
        });
    }
}

/// Second derivatives, as differences of first ones, do not see the switches either.
#[test]
fn second_differences_are_smooth_across_switches() {
    for (at, step) in [(1.0, 1e-4), (2.0 * 0.1_f64.asin(), 1e-4), (0.5, 1e-4)] {
        let slopes = |angle: f64| -> Vec<f64> {
            let angle = Dual64::new(angle, 1.0);
            let n = Vec3([0.48, 0.6, 0.64]);
            let x = Twist::new(Vec3([0.8, -0.5, 1.0]).lift(angle), n.lift(angle).times(angle));
            let log = Pose { translation: x.v, ..Pose::turn(n, angle) }.log();
            let all = [Pose::exp(x).flat(), x.left_jacobian().flat(), log.flat()].concat();
            all.into_iter().map(|c| c.eps).collect()
        };
        let bend = |from: f64, to: f64| -> Vec<f64> {
            slopes(to).iter().zip(slopes(from)).map(|(b, a)| (b - a) / (to - from)).collect()
        };
        // Across the switch and beside it: equal up to the third derivative times the distance.
        assert_near(&bend(at - step, at + step), &bend(at + step, at + 3.0 * step), 1e-3);
        assert_near(&bend(at - step, at + step), &bend(at - 3.0 * step, at - step), 1e-3);
    }
}

// ---------------------------------------------------------------------------------------------------------------------
// Near a half turn, and where the cases of the quaternion meet

const GAPS: [f64; 10] = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12];

/// Axes at which each of the four components of the quaternion leads, ties included.
fn axes_of_half_turns() -> Vec<Vec3<f64>> {
    let raw = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [-1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, -1.0],
        [1.0, 1.0, 1.0],
        [-1.0, 1.0, -1.0],
        [1.0, 1.0, 0.0],
        [0.0, -1.0, 1.0],
        [1.0, 0.0, -1.0],
        [0.2, -0.9, 0.4],
        [0.9, 0.3, -0.1],
        [-0.3, 0.2, -0.8],
        [1e-9, 1.0, 1e-9],
        [1.0, -1e-6, 1e-12],
    ];
    raw.map(|v| Vec3(v).times(Vec3(v).norm().recip())).to_vec()
}

#[test]
fn exp_of_log_is_identity_near_a_half_turn() {
    let p = Vec3([0.8, -0.5, 1.0]);
    for n in axes_of_half_turns() {
        for gap in GAPS {
            let t = Pose { translation: p, ..Pose::turn(n, PI - gap) };
            let x = t.log();
            assert_law::<f64>(&Pose::exp(x), &t, 1e-14);
            assert_near(&x.w.0, &n.times(PI - gap).0, 1e-14);
        }
    }
}

/// At the half turn itself the sign of the axis is a matter of choice, the displacement is not.
#[test]
fn exp_of_log_is_identity_at_a_half_turn_and_beyond() {
    let p = Vec3([0.8, -0.5, 1.0]);
    for n in axes_of_half_turns() {
        for angle in [PI, PI.next_up(), PI + 1e-12, PI + 1e-9, PI + 1e-3, 4.0, 6.0, 2.0 * PI - 1e-9] {
            let t = Pose { translation: p, ..Pose::turn(n, angle) };
            let x = t.log();
            assert!(x.w.norm() <= PI + 1e-14, "angle {}", x.w.norm());
            assert_law::<f64>(&Pose::exp(x), &t, 1e-14);
        }
    }
}

#[test]
fn derivative_of_log_is_finite_and_right_near_a_half_turn() {
    for n in axes_of_half_turns() {
        for gap in GAPS {
            let w = n.times(PI - gap).0;
            let x = [0.8, -0.5, 1.0, w[0], w[1], w[2]];
            // The chain rule through exp: the derivative of log(exp(x)) is the identity.
            let slopes = twist_slopes(pose::<Dual6>(x).log());
            assert_near(slopes.as_slice(), Matrix6::identity().as_slice(), 1e-13);
            // Alone: J_l⁻¹ for an increment from the left.
            let left = pose::<Dual6>([0.0; 6]) * Pose::exp(Twist::from_array(x)).lift(Dual6::from_re(0.0));
            let product = Twist::from_array(x).left_jacobian().to_matrix() * twist_slopes(left.log());
            assert_near(product.as_slice(), Matrix6::identity().as_slice(), 1e-13);
        }
    }
}

/// A third of a turn about the diagonals: all four components of the quaternion are equal; nearby each of them leads.
#[test]
fn log_is_right_where_the_cases_of_the_quaternion_meet() {
    for signs in [[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [-1.0, -1.0, -1.0]] {
        for tilt in [0.0, 1e-15, 1e-9, -1e-9, 1e-3, -1e-3] {
            for k in 0..3 {
                let mut w = signs.map(|s: f64| s * 2.0 * PI / 3.0 / 3_f64.sqrt());
                w[k] += tilt;
                let x = [0.8, -0.5, 1.0, w[0], w[1], w[2]];
                let log = pose::<Dual6>(x).log();
                assert_near(&log.to_array().map(|c| c.re), &x, 2e-15);
                assert_near(twist_slopes(log).as_slice(), Matrix6::identity().as_slice(), 1e-14);
            }
        }
    }
}

/// Tiny twists, the size of machine errors, come back with relative precision, not merely absolute.
#[test]
fn log_of_exp_keeps_relative_precision_of_tiny_twists() {
    for size in [1e-3, 1e-6, 1e-9, 1e-12, 1e-100] {
        let x = [0.3, -1.2, 0.7, 0.4, -0.9, 0.6].map(|c| c * size);
        let back = Pose::exp(Twist::from_array(x)).log().to_array();
        assert_near(&back.map(|c| c / size), &x.map(|c| c / size), 1e-15);
    }
}

/// A dual whose derivative part is absent (a constant) is the same as one with zeros.
#[test]
fn constants_have_no_derivative() {
    let like = Dual6::variables([1.0; 6])[0];
    let constant = like.lift(2.0);
    assert_eq!(constant.parts(), [2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let zeros = Dual6::new(2.0, Derivative::some(SVector::zeros()));
    assert_eq!((constant * like).parts(), (zeros * like).parts());
    let x = Twist::from_array([0.3, -1.2, 0.7, 0.4, -0.9, 0.6]);
    let lifted = Pose::exp(x).lift(like).log();
    assert!(lifted.to_array().iter().all(|c| c.parts()[1..].iter().all(|d| *d == 0.0)));
    assert_near(&lifted.to_array().map(|c| c.re), Vector6::from(x.to_array()).as_slice(), 1e-15);
}

//! Laws of the group and its algebra, on numbers and on two kinds of dual numbers.

use super::*;

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

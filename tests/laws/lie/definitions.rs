//! Matrices, derivatives and conventions against their definitions.

use super::*;

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
        let isometry: Isometry3<f64> = t.into();
        assert_near(isometry.to_homogeneous().as_slice(), homogeneous(t).as_slice(), 1e-14);
        assert_law::<f64>(&Pose::from(isometry), &t, 1e-14);
        let again = Isometry3::from(Pose::from(isometry));
        assert_near(again.to_homogeneous().as_slice(), isometry.to_homogeneous().as_slice(), 1e-14);
    }

    #[test]
    fn isometry_product_is_pose_product(x in twist(6.0), y in twist(6.0)) {
        let (a, b) = (Pose::exp(Twist::from_array(x)), Pose::exp(Twist::from_array(y)));
        assert_law::<f64>(&Pose::from(Isometry3::from(a) * Isometry3::from(b)), &(a * b), 1e-13);
        assert_law::<f64>(&Pose::from(Isometry3::from(a).inverse()), &a.inverse(), 1e-13);
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

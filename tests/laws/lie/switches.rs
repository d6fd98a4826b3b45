//! Across the switches between series and closed forms, near a half turn, and the smallest twists.

use super::*;

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

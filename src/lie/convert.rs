//! To and from nalgebra's types, for callers who have theirs.

use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3, Vector6};

use super::{Mat3, Pose, Twist, Vec3, Wrench};

impl From<Vector3<f64>> for Vec3<f64> {
    fn from(v: Vector3<f64>) -> Self {
        Vec3([v.x, v.y, v.z])
    }
}

impl From<Vec3<f64>> for Vector3<f64> {
    fn from(Vec3([x, y, z]): Vec3<f64>) -> Self {
        Vector3::new(x, y, z)
    }
}

impl From<Point3<f64>> for Vec3<f64> {
    fn from(p: Point3<f64>) -> Self {
        p.coords.into()
    }
}

impl From<Vec3<f64>> for Point3<f64> {
    fn from(p: Vec3<f64>) -> Self {
        Point3::from(Vector3::from(p))
    }
}

impl From<[f64; 3]> for Vec3<f64> {
    fn from(v: [f64; 3]) -> Self {
        Vec3(v)
    }
}

impl From<Matrix3<f64>> for Mat3<f64> {
    fn from(m: Matrix3<f64>) -> Self {
        Mat3(std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)])))
    }
}

impl From<Mat3<f64>> for Matrix3<f64> {
    fn from(Mat3(rows): Mat3<f64>) -> Self {
        Matrix3::from_fn(|i, j| rows[i][j])
    }
}

impl From<Isometry3<f64>> for Pose<f64> {
    fn from(a_from_b: Isometry3<f64>) -> Self {
        let rotation = a_from_b.rotation.to_rotation_matrix().into_inner();
        Pose { rotation: rotation.into(), translation: a_from_b.translation.vector.into() }
    }
}

impl From<Pose<f64>> for Isometry3<f64> {
    fn from(a_from_b: Pose<f64>) -> Self {
        let (s, Vec3([x, y, z])) = a_from_b.quaternion();
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(s, x, y, z));
        Isometry3::from_parts(Translation3::from(Vector3::from(a_from_b.translation)), rotation)
    }
}

/// `[vx, vy, vz, wx, wy, wz]`, linear part first.
impl From<Vector6<f64>> for Twist<f64> {
    fn from(x: Vector6<f64>) -> Self {
        Twist::from_array(x.into())
    }
}

/// `[vx, vy, vz, wx, wy, wz]`, linear part first.
impl From<Twist<f64>> for Vector6<f64> {
    fn from(x: Twist<f64>) -> Self {
        Vector6::from(x.to_array())
    }
}

/// `[fx, fy, fz, mx, my, mz]`, force first.
impl From<Vector6<f64>> for Wrench<f64> {
    fn from(y: Vector6<f64>) -> Self {
        let [fx, fy, fz, mx, my, mz] = y.into();
        Wrench { f: Vec3([fx, fy, fz]), m: Vec3([mx, my, mz]) }
    }
}

/// `[fx, fy, fz, mx, my, mz]`, force first.
impl From<Wrench<f64>> for Vector6<f64> {
    fn from(y: Wrench<f64>) -> Self {
        let (f, m) = (y.f.0, y.m.0);
        Vector6::new(f[0], f[1], f[2], m[0], m[1], m[2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: Pose<f64>, b: Pose<f64>) -> bool {
        (a.inverse() * b).log().to_array().iter().all(|x| x.abs() < 1e-14)
    }

    #[test]
    fn poses_twists_and_points_go_there_and_back_and_mean_the_same() {
        let x = Twist::from_array([0.1, -0.2, 0.3, 0.4, -0.5, 0.6]);
        let a_from_b = Pose::exp(x);
        let isometry = Isometry3::from(a_from_b);
        assert!(near(isometry.into(), a_from_b));
        let p_b = Vec3([1.0, 2.0, 3.0]);
        let p_a = Vec3::from(isometry * Point3::from(p_b));
        assert!((p_a - a_from_b.transform(p_b)).norm() < 1e-14);
        assert_eq!(Twist::from(Vector6::from(x)), x);
        let y = Wrench { f: Vec3([1.0, 2.0, 3.0]), m: Vec3([4.0, 5.0, 6.0]) };
        assert!((Vector6::from(y).dot(&Vector6::from(x)) - y.dot(x)).abs() < 1e-15);
        assert_eq!(Wrench::from(Vector6::from(y)), y);
        assert_eq!(Mat3::from(Matrix3::from(a_from_b.rotation)), a_from_b.rotation);
        assert_eq!(Vec3::from(Vector3::from(p_b)), p_b);
    }
}

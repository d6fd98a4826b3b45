//! Rotations as tables have them: quaternions, rotation vectors, Euler angles in a stated convention, matrices.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

/// A convention of Euler angles: three axes in the order in which the angles are written, turned about axes that move along or stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Euler {
    pub axes: [usize; 3],
    intrinsic: bool,
}

/// Names that makers have for a convention.
const NAMED: [(&str, &str); 3] = [("rpy", "xyz-fixed"), ("kuka", "zyx-intrinsic"), ("fanuc", "xyz-fixed")];

/// What may stand behind `--euler`.
pub(super) const CONVENTIONS: &str = "three axes and `-intrinsic` or `-fixed`, such as `zyx-intrinsic`, `xyz-fixed`, or `rpy` (URDF, ROS: \
     fixed x, y, z), `kuka` (A, B, C: about z, then the new y, then the new x), `fanuc` (W, P, R: fixed x, y, z)";

impl Euler {
    pub fn named(text: &str) -> Option<Euler> {
        let text = text.trim().to_ascii_lowercase();
        let text = NAMED.iter().find(|(name, _)| *name == text).map_or(text.as_str(), |(_, long)| long);
        let (letters, kind) = text.split_once('-')?;
        let intrinsic = match kind {
            "intrinsic" | "moving" => true,
            "fixed" | "extrinsic" => false,
            _ => return None,
        };
        let axes: Vec<usize> = letters.chars().map(|c| "xyz".find(c)).collect::<Option<_>>()?;
        let axes: [usize; 3] = axes.try_into().ok()?;
        (axes[0] != axes[1] && axes[1] != axes[2]).then_some(Euler { axes, intrinsic })
    }

    /// Unit quaternion, scalar part first, of three angles in rad, in the order of the axes.
    pub fn quaternion(self, angles: [f64; 3]) -> [f64; 4] {
        let about = |k: usize| {
            let mut half = [0.0; 3];
            half[self.axes[k]] = (angles[k] / 2.0).sin();
            nalgebra::Quaternion::new((angles[k] / 2.0).cos(), half[0], half[1], half[2])
        };
        let q = if self.intrinsic { about(0) * about(1) * about(2) } else { about(2) * about(1) * about(0) };
        [q.w, q.i, q.j, q.k]
    }
}

/// Columns of a matrix may be off length 1 and right angles by so much: six decimals, and rounding of a float.
const OFF: f64 = 1e-3;

/// Unit quaternion, scalar part first, of a rotation matrix; what is wrong where it is none.
pub(super) fn of_matrix(rows: [[f64; 3]; 3]) -> Result<[f64; 4], String> {
    let m = Matrix3::from_fn(|i, j| rows[i][j]);
    let off = (m.transpose() * m - Matrix3::identity()).abs().max();
    if off.is_nan() || off > OFF {
        return Err(format!(
            "matrix is no rotation: its columns are off length 1 or right angles by {off:.1e}"
        ));
    }
    if m.determinant() < 0.0 {
        return Err("matrix mirrors: its axes are left-handed".into());
    }
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m));
    Ok([q.w, q.i, q.j, q.k])
}

/// A quaternion of length 1, scalar part first, if it nearly is; readers of recordings ask for that.
pub(super) fn unit(q: [f64; 4]) -> Option<[f64; 4]> {
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    ((length - 1.0).abs() < OFF).then(|| q.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lie::{Mat3, Pose, Vec3};

    fn turned(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
        let q = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[0], q[1], q[2], q[3]));
        (q * nalgebra::Vector3::from(v)).into()
    }

    #[test]
    fn conventions_turn_as_they_say() {
        let close = |a: [f64; 3], b: Vec3<f64>| (0..3).all(|i| (a[i] - b.0[i]).abs() < 1e-15);
        let angles = [0.3, -0.7, 1.9];
        let turn = |axis: usize, angle: f64| {
            let mut e = [0.0; 3];
            e[axis] = 1.0;
            Pose::turn(Vec3(e), angle)
        };
        let v = [0.2, -0.4, 0.6];
        for (word, product) in [
            ("zyx-intrinsic", turn(2, 0.3) * turn(1, -0.7) * turn(0, 1.9)),
            ("kuka", turn(2, 0.3) * turn(1, -0.7) * turn(0, 1.9)),
            ("xyz-fixed", turn(2, 1.9) * turn(1, -0.7) * turn(0, 0.3)),
            ("rpy", turn(2, 1.9) * turn(1, -0.7) * turn(0, 0.3)),
            ("zxz-intrinsic", turn(2, 0.3) * turn(0, -0.7) * turn(2, 1.9)),
        ] {
            let q = Euler::named(word).expect("a convention").quaternion(angles);
            assert!(close(turned(q, v), product.transform(Vec3(v))), "{word}");
            let Mat3(rows) = product.rotation;
            let back = of_matrix(rows).expect("a rotation");
            assert!(close(turned(back, v), product.transform(Vec3(v))), "{word}");
        }
        for word in ["xyz", "xxy-fixed", "abc-fixed", "xyz-", "xy-fixed", ""] {
            assert_eq!(Euler::named(word), None, "{word}");
        }
        assert!(of_matrix([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]).is_err());
        assert!(of_matrix([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).is_err());
    }
}

//! One sample at a time, with the instructions of the machine at hand: sines of all turns on lanes, the walk with plain numbers.

use pulp::{Arch, Simd, WithSimd};

use super::{Moved, Path, Row};
use crate::few::Few;
use crate::lie::{Mat3, Pose, Vec3, Wrench};
use crate::scalar::{Fused, Lanes, MOST_LANES, Scalar};

impl Path {
    /// Pose of the tool in the workpiece frame at the commands `q`, m or rad.
    pub fn pose_of_one(&self, q: &[f64]) -> Pose<f64> {
        Arch::new().dispatch(OnePose { path: self, q })
    }

    /// Length of a bar between two points, m, and its row over all deviations, six numbers for each dyad.
    pub fn distance_of_one(
        &self,
        q: &[f64],
        workpiece_point_w: Vec3<f64>,
        tool_point_t: Vec3<f64>,
        row: &mut [f64],
    ) -> f64 {
        Arch::new().dispatch(OneDistance { path: self, q, workpiece_point_w, tool_point_t, row })
    }

    /// [`Path::go_to`] with the sines of as many turns at a time as there are lanes.
    #[inline(always)]
    fn go_to_one<S: Simd>(&self, simd: S, q: &[f64], moved: &mut [Moved<Fused>]) {
        let mut first = [0.0; MOST_LANES];
        let mut second = [0.0; MOST_LANES];
        let count = S::F64_LANES;
        for (joints, moved) in self.joints.chunks(count).zip(moved.chunks_mut(count)) {
            for (joint, displacement) in joints.iter().zip(&mut first) {
                *displacement = 0.0;
                for (command, factor) in &joint.terms {
                    *displacement = q[*command].mul_add(*factor, *displacement);
                }
            }
            let slid = first;
            if joints.iter().any(|joint| joint.is_turn) {
                let (sines, cosines) = Lanes::load(simd, &first[..count]).sin_cos();
                sines.store(&mut first[..count]);
                cosines.store(&mut second[..count]);
            }
            for (k, (joint, moved)) in joints.iter().zip(moved).enumerate() {
                *moved = match joint.is_turn {
                    true => Moved { first: Fused(first[k]), second: Fused(second[k]) },
                    false => Moved { first: Fused(slid[k]), second: Fused(slid[k]) },
                };
            }
        }
    }

    #[inline(always)]
    fn distance_row<T: Scalar>(
        &self,
        moved: &[Moved<T>],
        [workpiece_point_w, tool_point_t]: [Vec3<T>; 2],
        row: &mut impl Row<T>,
    ) -> T {
        let p_w = self.point_w(tool_point_t, moved);
        let bar = p_w - workpiece_point_w;
        let distance = bar.norm();
        self.row(Wrench::at_point(bar.times(distance.recip()), p_w), moved, row);
        distance
    }
}

struct OnePose<'a> {
    path: &'a Path,
    q: &'a [f64],
}

impl WithSimd for OnePose<'_> {
    type Output = Pose<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Pose<f64> {
        if S::IS_SCALAR {
            return self.path.pose_at(self.q);
        }
        let none = Fused(0.0);
        let mut moved: Few<Moved<Fused>> = Few::from_elem(Moved::none(none), self.path.joint_count().max(1));
        let moved = &mut moved[..];
        self.path.go_to_one(simd, self.q, moved);
        let Pose { rotation: Mat3([[a, b, c], [d, e, f], [g, h, i]]), translation: Vec3([x, y, z]) } =
            self.path.w_from_t(moved, none);
        Pose {
            rotation: Mat3([[a.0, b.0, c.0], [d.0, e.0, f.0], [g.0, h.0, i.0]]),
            translation: Vec3([x.0, y.0, z.0]),
        }
    }
}

struct OneDistance<'a> {
    path: &'a Path,
    q: &'a [f64],
    workpiece_point_w: Vec3<f64>,
    tool_point_t: Vec3<f64>,
    row: &'a mut [f64],
}

/// Numbers of a row, of either kind.
struct Numbers<'a>(&'a mut [f64]);

impl Row<f64> for Numbers<'_> {
    #[inline(always)]
    fn take<const N: usize>(&mut self, first: usize, numbers: [f64; N]) {
        self.0[first..first + N].copy_from_slice(&numbers);
    }
}

impl Row<Fused> for Numbers<'_> {
    #[inline(always)]
    fn take<const N: usize>(&mut self, first: usize, numbers: [Fused; N]) {
        for (to, number) in self.0[first..first + N].iter_mut().zip(&numbers) {
            *to = number.0;
        }
    }
}

impl WithSimd for OneDistance<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let (path, mut row) = (self.path, Numbers(self.row));
        let (joints, points) = (path.joint_count().max(1), [self.workpiece_point_w, self.tool_point_t]);
        if S::IS_SCALAR {
            let mut moved = Few::from_elem(Moved::none(0.0), joints);
            path.go_to(self.q, &mut moved);
            return path.distance_row(&moved, points, &mut row);
        }
        let none = Fused(0.0);
        let mut moved: Few<Moved<Fused>> = Few::from_elem(Moved::none(none), joints);
        let moved = &mut moved[..];
        path.go_to_one(simd, self.q, moved);
        let [workpiece_point_w, tool_point_t] = points;
        path.distance_row(moved, [workpiece_point_w.lift(none), tool_point_t.lift(none)], &mut row).0
    }
}

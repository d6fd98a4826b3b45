//! The inverse at many goals at a time: as many as there are SIMD lanes, where it is as simple as it nearly always is for corrections.
//!
//! The steps are those of [`Inverse::solve`], (C2) to (C4): orientation by the joints that turn, then position by the slides. They are
//! taken only where every direction is strong and the goal is near. Whatever else may be is left to the one that looks at one goal at a time.

use pulp::{Arch, Simd, WithSimd};

use super::{CLOSE, Goal, Inverse, LONGEST, Mode, Outcome, SPANS, Solution};
use crate::chain::{Chain, Moved, Path};
use crate::few::Few;
use crate::lie::{Mat3, Pose, Twist, Vec3};
use crate::machine::JointKind;
use crate::scalar::{Lanes, MOST_LANES, Scalar};

/// Looks at a goal that is near: three are usual.
const LOOKS: usize = 4;
/// The longest step of one that is near, m and rad, and the sine of the largest turn.
const NEAR: f64 = 1e-2;

/// A goal that was looked at beforehand, and what came of it.
#[derive(Clone, Debug)]
pub struct Foreseen {
    /// The commands, m or rad, that have the tip of the nominal machine at the goal.
    pub meant: Few<f64>,
    /// Where the tip should be.
    pub goal: Goal,
    /// What [`Inverse::solve`] would have found.
    pub solution: Solution,
}

/// [`Inverse::solve`] for every goal that the nominal machine reaches with its commands at `meant`, begun there with all commands free, in
/// this order; without those that take a closer look.
pub fn foresee(
    inverse: &Inverse,
    (nominal, actual): (&Chain<f64>, &Chain<f64>),
    t_from_tip: Pose<f64>,
    meant: &[Few<f64>],
) -> Vec<Foreseen> {
    let commands = inverse.machine.commands().len();
    let slides: Few<usize> = (0..commands).filter(|c| inverse.is_slide(*c)).collect();
    let (Mode::PositionAndAxis, true, [x, y, z]) = (inverse.mode, inverse.by_slides, &slides[..]) else {
        return Vec::new();
    };
    let mut found = Vec::with_capacity(meant.len());
    let slides = [*x, *y, *z];
    let (nominal, actual) = (nominal.path(), actual.path());
    Arch::new().dispatch(Many { inverse, nominal, actual, t_from_tip, slides, meant, found: &mut found });
    found
}

/// The linear commands [`Inverse::slides`] in the place of those in `q` that bring the point `p_t` of the tool to `goal_w`, m, one step
/// from where the joints are `moved` to; travel does not count. 0 where that is all, more where it takes a closer look.
#[inline(always)]
pub(crate) fn slide_many<T: Scalar>(
    path: &Path,
    (p_t, moved): (Vec3<T>, &[Moved<T>]),
    goal_w: Vec3<T>,
    slides: [usize; 3],
    q: &mut [T],
    speeds: &mut [Vec3<T>],
) -> T {
    let none = goal_w.0[0].lift(0.0);
    let one = none.offset(1.0);
    let gap = goal_w - path.slides(p_t, moved, speeds);
    let [cx, cy, cz] = slides;
    let (x, y, z) = (speeds[cx], speeds[cy], speeds[cz]);
    let (yz, volume) = (y.cross(z), x.dot(y.cross(z)));
    let over = volume.recip();
    let by = [yz.dot(gap) * over, z.cross(x).dot(gap) * over, x.cross(y).dot(gap) * over];
    // Negative where the directions are weak or the way is far.
    let spans = volume * volume - (x.dot(x) * y.dot(y) * z.dot(z)).scale(SPANS * SPANS);
    let mut far = spans.select_below(0.0, one, none);
    for (c, by) in slides.into_iter().zip(by) {
        q[c] = q[c] + by;
        far = (by * by).scale(-1.0).offset(LONGEST * LONGEST).select_below(0.0, one, far);
    }
    far
}

impl Inverse<'_> {
    fn is_slide(&self, command: usize) -> bool {
        self.machine.command_joint(command).kind == JointKind::Prismatic
    }

    /// Whether every command may stand there.
    fn is_within(&self, q: &[f64]) -> bool {
        let stands = |(c, q): (usize, &f64)| {
            let (low, high) = self.machine.travel(c);
            (low..=high).contains(q)
        };
        !self.options.within_travel || q.iter().enumerate().all(stands)
    }
}

struct Many<'a> {
    inverse: &'a Inverse<'a>,
    nominal: &'a Path,
    actual: &'a Path,
    t_from_tip: Pose<f64>,
    slides: [usize; 3],
    meant: &'a [Few<f64>],
    found: &'a mut Vec<Foreseen>,
}

/// What is left of the goals: m, and a turn with its length, rad.
struct Left<T> {
    gap_w: Vec3<T>,
    gap: T,
    turn_w: Vec3<T>,
    turn: T,
    axis: Vec3<T>,
}

impl<T: Scalar> Left<T> {
    #[inline(always)]
    fn between(tip: Pose<T>, goal: Pose<T>) -> Self {
        let (axis, wanted) = (tip.rotation.column(2), goal.rotation.column(2));
        let (cross, gap_w) = (axis.cross(wanted), goal.translation - tip.translation);
        // The angle of a small sine: `asin s / s`.
        let s2 = cross.dot(cross);
        let factor = s2.scale(105.0 / 3456.0).offset(15.0 / 336.0).mul_add(s2, s2.lift(3.0 / 40.0));
        let factor = factor.mul_add(s2, s2.lift(1.0 / 6.0)).mul_add(s2, s2.lift(1.0));
        let turn_w = cross.times(factor);
        Left { gap_w, gap: gap_w.dot(gap_w).sqrt(), turn_w, turn: turn_w.dot(turn_w).sqrt(), axis }
    }
}

impl WithSimd for Many<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (count, commands) = (S::F64_LANES, self.inverse.machine.commands().len());
        let none = Lanes::splat(simd, 0.0);
        let weak2 = self.inverse.options.weak * self.inverse.options.weak;
        let t_from_tip = self.t_from_tip.lift(none);
        let mut q = vec![none; commands];
        let mut step = vec![none; commands];
        let joints = self.actual.joint_count().max(self.nominal.joint_count());
        let mut moved = vec![Moved::none(none); joints.max(1)];
        let mut velocities = vec![Twist::zero(none); joints];
        let mut speeds = vec![Twist::zero(none); commands];
        let mut column = [0.0; MOST_LANES];
        for meant in self.meant.chunks(count) {
            for (c, q) in q.iter_mut().enumerate() {
                // Lanes behind the last goal have that one once more.
                for (k, x) in column[..count].iter_mut().enumerate() {
                    *x = meant[k.min(meant.len() - 1)][c];
                }
                *q = Lanes::load(simd, &column[..count]);
            }
            self.nominal.go_to(&q, &mut moved);
            let goal = self.nominal.w_from_t(&moved, none) * t_from_tip;
            // Whether every step so far was that of a goal that is near, below 1, and how many steps there were.
            let (mut far, mut steps) = (none, none);
            let mut looks = 0;
            let left = loop {
                self.actual.go_to(&q, &mut moved);
                let tip = self.actual.velocities(t_from_tip.translation, &moved, &mut velocities);
                let tip = Pose { rotation: tip.rotation * t_from_tip.rotation, translation: tip.translation };
                let left = Left::between(tip, goal);
                let open = left.gap.select_below(
                    CLOSE,
                    left.turn.select_below(CLOSE, none, none.offset(1.0)),
                    none.offset(1.0),
                );
                looks += 1;
                if open.all_below(0.5) || looks == LOOKS {
                    break left;
                }
                self.actual.by_command(&velocities, &mut speeds, none);
                // (C2): the turns by the joints that turn.
                let (axis, one) = (left.axis, none.offset(1.0));
                let x2 = axis.0[0] * axis.0[0];
                let across = Vec3([x2.select_below(0.5, one, none), x2.select_below(0.5, none, one), none]);
                let first = axis.cross(across);
                let first = first.times(first.dot(first).sqrt().recip());
                let second = axis.cross(first);
                let (mut aa, mut ab, mut bb) = (none, none, none);
                for speed in &speeds {
                    let (a, b) = (first.dot(speed.w), second.dot(speed.w));
                    (aa, ab, bb) = (a.mul_add(a, aa), a.mul_add(b, ab), b.mul_add(b, bb));
                }
                let det = aa * bb - ab * ab;
                let (ea, eb) = (first.dot(left.turn_w), second.dot(left.turn_w));
                let over = det.recip();
                let (ya, yb) = ((bb * ea - ab * eb) * over, (aa * eb - ab * ea) * over);
                let mut gap = left.gap_w;
                for (step, speed) in step.iter_mut().zip(&speeds) {
                    *step = first.dot(speed.w) * ya + second.dot(speed.w) * yb;
                    gap = gap - speed.v.times(*step);
                }
                // (C4): the rest by the slides.
                let [x, y, z] = self.slides.map(|c| speeds[c].v);
                let (yz, volume) = (y.cross(z), x.dot(y.cross(z)));
                let over = volume.recip();
                let by = [yz.dot(gap) * over, z.cross(x).dot(gap) * over, x.cross(y).dot(gap) * over];
                for (c, by) in self.slides.into_iter().zip(by) {
                    step[c] = step[c] + by;
                }
                // Negative where the directions are weak or the way is far.
                let strong = det - (aa + bb).scale(weak2);
                let spans = (volume * volume).offset(-SPANS * SPANS);
                let near = |x: Lanes<S>| (x * x - none.offset(NEAR * NEAR)).scale(-1.0);
                far = strong.select_below(0.0, one, far);
                far = spans.select_below(0.0, one, far);
                far = near(left.turn).select_below(0.0, one, far);
                for (q, step) in q.iter_mut().zip(&step) {
                    far = near(*step).select_below(0.0, one, far);
                    *q = q.mul_add(one, *step * open);
                }
                steps = steps + open;
            };
            let far = left.gap.select_below(
                CLOSE,
                left.turn.select_below(CLOSE, far, none.offset(1.0)),
                none.offset(1.0),
            );
            let mut all = [[0.0; MOST_LANES]; 4];
            for (value, to) in [far, steps, left.gap, left.turn].into_iter().zip(&mut all) {
                value.store(&mut to[..count]);
            }
            let [far, steps, gap, turn] = all;
            let mut poses = [[0.0; MOST_LANES]; 12];
            let ([x, y, z], p) = (goal.rotation.0, goal.translation.0);
            for (value, to) in x.into_iter().chain(y).chain(z).chain(p).zip(&mut poses) {
                value.store(&mut to[..count]);
            }
            let mut to = vec![[0.0; MOST_LANES]; commands];
            for (q, to) in q.iter().zip(&mut to) {
                q.store(&mut to[..count]);
            }
            for (k, meant) in meant.iter().enumerate() {
                let commands: Vec<f64> = to.iter().map(|column| column[k]).collect();
                // What is no number is far as well.
                let is_there = far[k] < 0.5 && gap[k] < CLOSE;
                if !(is_there && self.inverse.is_within(&commands)) {
                    continue;
                }
                let row = |r: usize| [poses[3 * r][k], poses[3 * r + 1][k], poses[3 * r + 2][k]];
                let w_from_tip = Pose { rotation: Mat3([row(0), row(1), row(2)]), translation: Vec3(row(3)) };
                self.found.push(Foreseen {
                    meant: Few::from_slice(meant),
                    goal: Goal { t_from_tip: self.t_from_tip, w_from_tip },
                    solution: Solution {
                        commands,
                        outcome: Outcome::Reached,
                        position_left_m: gap[k],
                        angle_left_rad: turn[k],
                        steps: steps[k] as usize,
                    },
                });
            }
        }
    }
}

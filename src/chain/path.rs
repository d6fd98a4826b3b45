//! A chain as the one way from the workpiece over the base to the tool, laid out for many samples.
//!
//! [`Chain::sweep`](super::Chain::sweep) gives the pose of every frame; most samples need only where the tool point is, and the rows
//! of what is measured there. Both are walks along this way, from the tool inwards and from the workpiece outwards, with one vector or one
//! wrench at hand instead of poses: `docs/model.md` (10), (14). What is constant between two turns is multiplied out before.

use pulp::{Arch, Simd, WithSimd};

use crate::few::Few;
use crate::lie::{Mat3, Pose, Twist, Vec3, Wrench};
use crate::machine::JointKind;
use crate::scalar::{Lanes, MOST_LANES, Scalar};

use super::Chain;

mod features;
mod one;

/// What has to be known of a machine's constants to walk along it, many times.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    joints: Vec<Joint>,
    /// By command the joints that it moves, and by what factor.
    driven: Vec<Vec<(usize, f64)>>,
    spans: Vec<Span>,
    steps: Vec<Step>,
}

/// How one joint follows the commands.
#[derive(Clone, Debug)]
struct Joint {
    is_turn: bool,
    /// `s = Σ factor × command`, m or rad, `docs/model.md` (9).
    terms: Vec<(usize, f64)>,
}

/// A constant rotation, a shift that is constant but for slides, and then a turn about the z axis: what lies between two turns.
#[derive(Clone, Debug)]
struct Span {
    rotation: Mat3<f64>,
    shift: Vec3<f64>,
    slides: Vec<Slide>,
    turn: Option<Turn>,
}

#[derive(Clone, Copy, Debug)]
struct Slide {
    joint: usize,
    /// Where one metre of it leads.
    way: Vec3<f64>,
    /// Two unit vectors square to that and to each other.
    across: [Vec3<f64>; 2],
}

#[derive(Clone, Copy, Debug)]
struct Turn {
    joint: usize,
    /// Whether it is passed against its sense: those of the workpiece are.
    back: bool,
}

/// One dyad.
#[derive(Clone, Debug)]
struct Step {
    dyad: usize,
    on_tool: bool,
    /// Pose of what comes next on the way outwards to the tool: of the frame in the one before it on the tool's side, of the frame before
    /// it in this frame on the workpiece's.
    here_from_next: Pose<f64>,
    joint: Option<(usize, Axis)>,
    /// What comes behind the joint on the same way, where something is carried there.
    carried: Option<Pose<f64>>,
}

/// The axis of a joint; along a coordinate axis it takes a third of the work.
#[derive(Clone, Copy, Debug)]
enum Axis {
    X,
    Y,
    Z,
    Any(Vec3<f64>),
}

/// Displacement of a slide, m, or sine and cosine of a turn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moved<T> {
    first: T,
    second: T,
}

/// Where the numbers of a row go, six for each dyad, or its features.
pub(crate) trait Row<T> {
    /// Neighbouring numbers, `first` the place of the first.
    fn take<const N: usize>(&mut self, first: usize, numbers: [T; N]);

    /// The wrench that goes on behind a turn; another one where it is asked what that would do.
    #[inline(always)]
    fn behind_turn(&mut self, y: Wrench<T>) -> Wrench<T> {
        y
    }
}

impl<T: Copy> Row<T> for [T] {
    #[inline(always)]
    fn take<const N: usize>(&mut self, first: usize, numbers: [T; N]) {
        self[first..first + N].copy_from_slice(&numbers);
    }
}

impl Path {
    /// The way through a chain.
    pub fn new(chain: &Chain<f64>) -> Self {
        let workpiece = chain.workpiece_count;
        let mut path = Path { joints: Vec::new(), driven: Vec::new(), spans: Vec::new(), steps: Vec::new() };
        let mut open = Span::new(Pose::identity(0.0));
        for j in (0..workpiece).rev().chain(workpiece..chain.links.len()) {
            let (link, on_tool) = (&chain.links[j], j >= workpiece);
            let joint = link.joint.as_ref().map(|(kind, axis, drive)| {
                let (axis, sign) = Axis::of(*axis);
                let terms = drive.terms.iter().map(|(command, factor)| (*command, sign * factor)).collect();
                path.joints.push(Joint { is_turn: *kind == JointKind::Revolute, terms });
                (path.joints.len() - 1, axis)
            });
            let passed = |pose: Pose<f64>| if on_tool { pose } else { pose.inverse() };
            let (here_from_next, carried) = (passed(link.previous_from_frame), link.carried.map(passed));
            if on_tool {
                open.go_on(here_from_next);
            } else if let Some(carried) = carried {
                open.go_on(carried);
            }
            if let Some((number, axis)) = joint {
                let back = !on_tool;
                if path.joints[number].is_turn {
                    let aligned = Pose { rotation: axis.turned_z(), translation: Vec3::zero(0.0) };
                    open.go_on(aligned);
                    open.turn = Some(Turn { joint: number, back });
                    path.spans.push(std::mem::replace(&mut open, Span::new(aligned.inverse())));
                } else {
                    let way = open.rotation * axis.vector();
                    let way = if back { -way } else { way };
                    open.slides.push(Slide { joint: number, way, across: way.across() });
                }
            }
            if !on_tool {
                open.go_on(here_from_next);
            } else if let Some(carried) = carried {
                open.go_on(carried);
            }
            path.steps.push(Step { dyad: j, on_tool, here_from_next, joint, carried });
        }
        path.spans.push(open);
        for (number, joint) in path.joints.iter().enumerate() {
            for (command, factor) in &joint.terms {
                path.driven.resize_with(path.driven.len().max(command + 1), Vec::new);
                path.driven[*command].push((number, *factor));
            }
        }
        path
    }

    /// How many joints there are.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// How many dyads there are.
    pub fn dyad_count(&self) -> usize {
        self.steps.len()
    }

    /// How every joint is displaced at the commands `q`, m or rad; `moved` has one place for each joint.
    #[inline(always)]
    pub fn go_to<T: Scalar>(&self, q: &[T], moved: &mut [Moved<T>]) {
        for (joint, moved) in self.joints.iter().zip(moved) {
            let mut displacement = q[0].lift(0.0);
            for (command, factor) in &joint.terms {
                displacement = q[*command].mul_add(displacement.lift(*factor), displacement);
            }
            *moved = if joint.is_turn {
                let (first, second) = displacement.sin_cos();
                Moved { first, second }
            } else {
                Moved { first: displacement, second: displacement }
            };
        }
    }

    /// Where a point of frame `t` is in frame `w`, m.
    #[inline(always)]
    pub fn point_w<T: Scalar>(&self, p_t: Vec3<T>, moved: &[Moved<T>]) -> Vec3<T> {
        let mut p = p_t;
        for span in self.spans.iter().rev() {
            if let Some(turn) = span.turn {
                p = turn.apply(p, moved);
            }
            p = span.rotation.lift(p.0[0]) * p + span.shifted(moved);
        }
        p
    }

    /// Pose of the tool in the workpiece frame. The third column of its rotation is the product of the other two.
    #[inline(always)]
    pub fn w_from_t<T: Scalar>(&self, moved: &[Moved<T>], like: T) -> Pose<T> {
        let mut spans = self.spans.iter().rev();
        let (mut x, mut y, mut p) = match spans.next() {
            Some(last) => {
                let rotation = last.rotation.lift(like);
                (rotation.column(0), rotation.column(1), last.shifted(moved))
            }
            None => unreachable!("a path ends with a span"),
        };
        for span in spans {
            if let Some(turn) = span.turn {
                (x, y, p) = (turn.apply(x, moved), turn.apply(y, moved), turn.apply(p, moved));
            }
            let rotation = span.rotation.lift(like);
            (x, y, p) = (rotation * x, rotation * y, rotation * p + span.shifted(moved));
        }
        Pose { rotation: Mat3([x.0, y.0, x.cross(y).0]).transpose(), translation: p }
    }

    /// [`Path::w_from_t`] at the commands `q`, m or rad.
    pub fn pose_at(&self, q: &[f64]) -> Pose<f64> {
        let mut moved = Few::from_elem(Moved::none(0.0), self.joints.len());
        self.go_to(q, &mut moved);
        self.w_from_t(&moved, 0.0)
    }

    /// [`Path::point_w`] at the commands `q`, m or rad.
    pub fn point_at(&self, q: &[f64], p_t: Vec3<f64>) -> Vec3<f64> {
        let mut moved = Few::from_elem(Moved::none(0.0), self.joints.len());
        self.go_to(q, &mut moved);
        self.point_w(p_t, &moved)
    }

    /// [`Path::point_w`] at several rows of commands, m or rad, on SIMD lanes.
    pub fn points_at<const N: usize>(&self, q: &[Few<f64>; N], p_t: Vec3<f64>) -> [Vec3<f64>; N] {
        Arch::new().dispatch(Points { path: self, q, p_t })
    }

    /// Velocity of the point `p_t` of the tool and angular velocity of the tool, both seen from `w`, by the speed of each joint; joints in the
    /// order of the way, `docs/model.md` (13). Returns the pose in `w` of frame `t` shifted to that point.
    #[inline(always)]
    pub fn velocities<T: Scalar>(
        &self,
        p_t: Vec3<T>,
        moved: &[Moved<T>],
        velocities: &mut [Twist<T>],
    ) -> Pose<T> {
        let like = p_t.0[0];
        let [x, y, z] = Mat3::identity(like).0;
        let (mut here, mut p_w) = ([Vec3(x), Vec3(y), Vec3(z)], Vec3::zero(like));
        for span in &self.spans {
            for Slide { joint, way, .. } in &span.slides {
                velocities[*joint] = Twist::new(along(here, way.lift(like)), Vec3::zero(like));
            }
            p_w = p_w + along(here, span.shifted(moved));
            let rotation = span.rotation.lift(like);
            let [x, y, z] = [rotation.column(0), rotation.column(1), rotation.column(2)];
            here = [along(here, x), along(here, y), along(here, z)];
            if let Some(turn) = span.turn {
                let [x, y, z] = here;
                // The place of the axis for now: the velocity waits for the end of the way.
                velocities[turn.joint] = Twist::new(p_w, if turn.back { -z } else { z });
                let Moved { first: sine, second: cosine } = moved[turn.joint];
                let sine = if turn.back { -sine } else { sine };
                here = [x.times(cosine) + y.times(sine), y.times(cosine) - x.times(sine), z];
            }
        }
        let end_w = p_w + along(here, p_t);
        for (joint, velocity) in self.joints.iter().zip(velocities) {
            if joint.is_turn {
                velocity.v = velocity.w.cross(end_w - velocity.v);
            }
        }
        let [x, y, z] = here;
        Pose { rotation: Mat3([x.0, y.0, z.0]).transpose(), translation: end_w }
    }

    /// Where the point `p_t` of the tool is in `w`, m, and in `speeds` its velocity by the speed of each command as far as that drives
    /// slides, `docs/model.md` (13).
    #[inline(always)]
    pub fn slides<T: Scalar>(&self, p_t: Vec3<T>, moved: &[Moved<T>], speeds: &mut [Vec3<T>]) -> Vec3<T> {
        let like = p_t.0[0];
        speeds.fill(Vec3::zero(like));
        let [x, y, z] = Mat3::identity(like).0;
        let (mut here, mut p_w) = ([Vec3(x), Vec3(y), Vec3(z)], Vec3::zero(like));
        for span in &self.spans {
            for Slide { joint, way, .. } in &span.slides {
                let way_w = along(here, way.lift(like));
                for (command, factor) in &self.joints[*joint].terms {
                    speeds[*command] = speeds[*command] + way_w.times(like.lift(*factor));
                }
            }
            p_w = p_w + along(here, span.shifted(moved));
            let rotation = span.rotation.lift(like);
            let [x, y, z] = [rotation.column(0), rotation.column(1), rotation.column(2)];
            here = [along(here, x), along(here, y), along(here, z)];
            if let Some(turn) = span.turn {
                let ([x, y, z], Moved { first: sine, second: cosine }) = (here, moved[turn.joint]);
                let sine = if turn.back { -sine } else { sine };
                here = [x.times(cosine) + y.times(sine), y.times(cosine) - x.times(sine), z];
            }
        }
        p_w + along(here, p_t)
    }

    /// What belongs to one command: the sum of what belongs to the joints that it moves.
    #[inline(always)]
    pub fn of_command<T: Scalar>(&self, command: usize, velocities: &[Twist<T>], like: T) -> Twist<T> {
        let Some([(joint, factor), others @ ..]) = self.driven.get(command).map(Vec::as_slice) else {
            return Twist::zero(like);
        };
        let mut sum = velocities[*joint].times(like.lift(*factor));
        for (joint, factor) in others {
            sum = sum + velocities[*joint].times(like.lift(*factor));
        }
        sum
    }

    /// [`Path::of_command`] of all commands.
    #[inline(always)]
    pub fn by_command<T: Scalar>(&self, velocities: &[Twist<T>], commands: &mut [Twist<T>], like: T) {
        for (number, command) in commands.iter_mut().enumerate() {
            *command = self.of_command(number, velocities, like);
        }
    }

    /// Six numbers for each dyad, as [`super::Sweep::error_row`] gives them; returns the wrench as frame `t` sees it.
    #[inline(always)]
    pub fn row<T: Scalar>(
        &self,
        y_w: Wrench<T>,
        moved: &[Moved<T>],
        row: &mut (impl Row<T> + ?Sized),
    ) -> Wrench<T> {
        let mut y = y_w;
        for step in &self.steps {
            if step.on_tool {
                y = step.here_from_next.lift(y.f.0[0]).carry_wrench(y);
                row.take(6 * step.dyad, y.to_array());
                y = self.through(step, y, moved, row);
                y = step.behind(y);
            } else {
                y = step.behind(y);
                y = self.through(step, y, moved, row);
                let against = Wrench { f: -y.f, m: -y.m };
                row.take(6 * step.dyad, against.to_array());
                y = step.here_from_next.lift(y.f.0[0]).carry_wrench(y);
            }
        }
        y
    }
}

impl Path {
    /// A wrench in front of a dyad's joint on the way, as it is seen behind it.
    #[inline(always)]
    fn through<T: Scalar>(
        &self,
        step: &Step,
        y: Wrench<T>,
        moved: &[Moved<T>],
        row: &mut (impl Row<T> + ?Sized),
    ) -> Wrench<T> {
        let Some((joint, axis)) = step.joint else { return y };
        let (is_turn, moved) = (self.joints[joint].is_turn, moved[joint]);
        let y = axis.carry(y, if step.on_tool { moved } else { moved.back(is_turn) }, is_turn);
        if is_turn { row.behind_turn(y) } else { y }
    }
}

/// A point at several rows of commands.
struct Points<'a, const N: usize> {
    path: &'a Path,
    q: &'a [Few<f64>; N],
    p_t: Vec3<f64>,
}

impl<const N: usize> WithSimd for Points<'_, N> {
    type Output = [Vec3<f64>; N];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let (none, count) = (Lanes::splat(simd, 0.0), S::F64_LANES);
        let mut q: Few<Lanes<S>> = Few::from_elem(none, self.q[0].len());
        let mut moved: Few<Moved<Lanes<S>>> =
            Few::from_elem(Moved::none(none), self.path.joint_count().max(1));
        let p_t = self.p_t.lift(none);
        let mut points = [Vec3([0.0; 3]); N];
        let mut column = [0.0; MOST_LANES];
        for (rows, points) in self.q.chunks(count).zip(points.chunks_mut(count)) {
            for (c, q) in q.iter_mut().enumerate() {
                rows.iter().zip(&mut column).for_each(|(row, x)| *x = row[c]);
                *q = Lanes::load(simd, &column[..count]);
            }
            self.path.go_to(&q, &mut moved);
            let p_w = self.path.point_w(p_t, &moved);
            for (i, x) in p_w.0.into_iter().enumerate() {
                x.store(&mut column[..count]);
                points.iter_mut().zip(&column).for_each(|(point, x)| point.0[i] = *x);
            }
        }
        points
    }
}

impl Step {
    /// A wrench in front of what the joint carries on the way, as it is seen behind that.
    #[inline(always)]
    fn behind<T: Scalar>(&self, y: Wrench<T>) -> Wrench<T> {
        match self.carried {
            Some(carried) => carried.lift(y.f.0[0]).carry_wrench(y),
            None => y,
        }
    }
}

impl Span {
    fn new(start: Pose<f64>) -> Self {
        Span { rotation: start.rotation, shift: start.translation, slides: Vec::new(), turn: None }
    }

    /// Goes on by a constant pose.
    fn go_on(&mut self, pose: Pose<f64>) {
        let here = Pose { rotation: self.rotation, translation: self.shift } * pose;
        (self.rotation, self.shift) = (here.rotation, here.translation);
    }

    #[inline(always)]
    fn shifted<T: Scalar>(&self, moved: &[Moved<T>]) -> Vec3<T> {
        let mut shift = self.shift.lift(moved[0].first);
        for Slide { joint, way, .. } in &self.slides {
            let (s, Vec3([x, y, z])) = (moved[*joint].first, shift);
            let way = way.lift(s).0;
            shift = Vec3([s.mul_add(way[0], x), s.mul_add(way[1], y), s.mul_add(way[2], z)]);
        }
        shift
    }
}

impl Turn {
    #[inline(always)]
    fn apply<T: Scalar>(self, v: Vec3<T>, moved: &[Moved<T>]) -> Vec3<T> {
        let Moved { first: sine, second: cosine } = moved[self.joint];
        let sine = if self.back { -sine } else { sine };
        let [x, y, z] = v.0;
        Vec3([cosine.mul_add(x, -(sine * y)), sine.mul_add(x, cosine * y), z])
    }

    /// What [`Turn::apply`] has done, undone.
    #[inline(always)]
    fn undo<T: Scalar>(self, v: Vec3<T>, moved: &[Moved<T>]) -> Vec3<T> {
        Turn { back: !self.back, ..self }.apply(v, moved)
    }
}

impl<T: Scalar> Moved<T> {
    /// Not moved yet.
    #[inline(always)]
    pub fn none(like: T) -> Self {
        Moved { first: like.lift(0.0), second: like.lift(1.0) }
    }

    /// The same displacement the other way.
    #[inline(always)]
    fn back(self, is_turn: bool) -> Self {
        Moved { first: -self.first, second: if is_turn { self.second } else { -self.second } }
    }
}

impl Axis {
    /// The axis along a unit vector, and the sign of displacements along it.
    fn of(vector: Vec3<f64>) -> (Axis, f64) {
        let along = [Axis::X, Axis::Y, Axis::Z].into_iter().zip(vector.0);
        along.clone().find(|(_, x)| x.abs() == 1.0).unwrap_or((Axis::Any(vector), 1.0))
    }

    fn vector(self) -> Vec3<f64> {
        match self {
            Axis::X => Vec3([1.0, 0.0, 0.0]),
            Axis::Y => Vec3([0.0, 1.0, 0.0]),
            Axis::Z => Vec3([0.0, 0.0, 1.0]),
            Axis::Any(vector) => vector,
        }
    }

    /// A rotation that takes z to this axis.
    fn turned_z(self) -> Mat3<f64> {
        let z = self.vector();
        let [x, _] = z.across();
        Mat3([x.0, z.cross(x).0, z.0]).transpose()
    }

    /// A wrench in front of the joint, as what the joint carries sees it.
    #[inline(always)]
    fn carry<T: Scalar>(self, y: Wrench<T>, moved: Moved<T>, is_turn: bool) -> Wrench<T> {
        if is_turn {
            return Wrench { f: self.turn_back(y.f, moved), m: self.turn_back(y.m, moved) };
        }
        let m = match self {
            Axis::X => slide::<1, 2, T>(y, moved),
            Axis::Y => slide::<2, 0, T>(y, moved),
            Axis::Z => slide::<0, 1, T>(y, moved),
            Axis::Any(vector) => y.m - vector.lift(moved.first).cross(y.f).times(moved.first),
        };
        Wrench { f: y.f, m }
    }

    /// `exp(-n θ) v`.
    #[inline(always)]
    fn turn_back<T: Scalar>(self, v: Vec3<T>, moved: Moved<T>) -> Vec3<T> {
        match self {
            Axis::X => turn_back::<1, 2, T>(v, moved),
            Axis::Y => turn_back::<2, 0, T>(v, moved),
            Axis::Z => turn_back::<0, 1, T>(v, moved),
            Axis::Any(vector) => {
                let n = vector.lift(moved.first);
                let stays = n.times(n.dot(v));
                stays + (v - stays).times(moved.second) - n.cross(v).times(moved.first)
            }
        }
    }
}

/// `x a + y b + z c`: a vector by its components along three others.
#[inline(always)]
fn along<T: Scalar>([x, y, z]: [Vec3<T>; 3], v: Vec3<T>) -> Vec3<T> {
    let [a, b, c] = v.0;
    let ([x0, x1, x2], [y0, y1, y2], [z0, z1, z2]) = (x.0, y.0, z.0);
    Vec3([
        z0.mul_add(c, y0.mul_add(b, x0 * a)),
        z1.mul_add(c, y1.mul_add(b, x1 * a)),
        z2.mul_add(c, y2.mul_add(b, x2 * a)),
    ])
}

/// The moment behind a slide along the axis that comes before axes `A` and `B`.
#[inline(always)]
fn slide<const A: usize, const B: usize, T: Scalar>(y: Wrench<T>, moved: Moved<T>) -> Vec3<T> {
    let mut m = y.m;
    m.0[A] = moved.first.mul_add(y.f.0[B], m.0[A]);
    m.0[B] = (-moved.first).mul_add(y.f.0[A], m.0[B]);
    m
}

/// A vector turned back about the axis that comes before axes `A` and `B`.
#[inline(always)]
fn turn_back<const A: usize, const B: usize, T: Scalar>(v: Vec3<T>, moved: Moved<T>) -> Vec3<T> {
    let Moved { first: sine, second: cosine } = moved;
    let (a, b) = (v.0[A], v.0[B]);
    let mut turned = v;
    turned.0[A] = cosine.mul_add(a, sine * b);
    turned.0[B] = cosine.mul_add(b, -(sine * a));
    turned
}

//! What is left of straight moves once they are corrected: at their ends, and between them.
//!
//! It decides nothing of what is written, but where a correction is too large to be one. So moves wait until there are as many as a
//! register may hold, and are looked at together, a move on each SIMD lane.

use pulp::{Arch, Simd, WithSimd};

use super::control::Control;
use super::corrector::Corrector;
use super::position::Position;
use crate::chain::{Moved, Path};
use crate::few::Few;
use crate::inverse::{Goal, slide_many};
use crate::lie::{Pose, Vec3};
use crate::scalar::{Lanes, MOST_LANES, Scalar};

/// Parts of a straight move at which it is looked at.
const PARTS: [f64; 3] = [0.25, 0.5, 0.75];

/// A move that is to be looked at.
pub(super) struct Move<'a> {
    pub line: usize,
    pub goal: &'a Goal,
    /// Where it ends, as meant and as written.
    pub ends: [&'a Position; 2],
    /// Where it starts, as meant and as written, where what lies between counts.
    pub starts: Option<[&'a Position; 2]>,
    /// Whether the tip is anywhere that matters at its end.
    pub is_placed: bool,
}

/// What there is to see of a move.
pub(super) struct Seen {
    pub line: usize,
    /// Joints at its end, as meant, m or rad.
    pub meant: Few<f64>,
    /// What the model says is wrong with tip, m, and axis, rad, at the end; where the tip is anywhere that matters.
    pub left: Option<(f64, f64)>,
    /// By how much they were corrected there.
    pub correction: (f64, f64),
    /// Largest error of the tip between the ends, m.
    pub mid_line_m: Option<f64>,
}

/// Moves that wait, all under one control and one set of errors.
#[derive(Default)]
pub(super) struct Looks {
    moves: Vec<Waiting>,
    goals: [[f64; MOST_LANES]; 6],
    /// Joints of four positions, by command, m or rad: the ends as meant and as written, the starts as meant and as written; behind those
    /// of each its program coordinates, by axis, m or rad.
    positions: Vec<[f64; MOST_LANES]>,
}

#[derive(Clone, Copy)]
struct Waiting {
    line: usize,
    is_placed: bool,
    has_way: bool,
}

impl Looks {
    /// Whether no move waits.
    pub fn is_empty(&self) -> bool {
        self.moves.is_empty()
    }

    /// Has a move wait; whether there are as many now as are looked at together.
    pub fn wait(&mut self, of: Move) -> bool {
        let at = self.moves.len();
        let [meant, written] = of.ends;
        let [from_meant, from_written] = of.starts.unwrap_or(of.ends);
        let (commands, axes) = (meant.q().len(), meant.program().len());
        self.positions.resize(4 * (commands + axes), [0.0; MOST_LANES]);
        let columns = self.positions.chunks_exact_mut(commands + axes);
        for (position, columns) in [meant, written, from_meant, from_written].into_iter().zip(columns) {
            let (q, program) = columns.split_at_mut(commands);
            q.iter_mut().zip(position.q()).for_each(|(column, x)| column[at] = *x);
            program.iter_mut().zip(position.program()).for_each(|(column, x)| column[at] = *x);
        }
        let Pose { rotation, translation } = of.goal.w_from_tip;
        let goal = translation.0.into_iter().chain(rotation.column(2).0);
        self.goals.iter_mut().zip(goal).for_each(|(column, x)| column[at] = x);
        self.moves.push(Waiting { line: of.line, is_placed: of.is_placed, has_way: of.starts.is_some() });
        self.moves.len() == MOST_LANES
    }

    /// Looks at those that wait, which are as many as `tell` is called for, in their order.
    pub fn look(&mut self, control: &Control, corrector: &Corrector, mut tell: impl FnMut(Seen)) {
        let count = self.moves.len();
        if count == 0 {
            return;
        }
        let commands = control.machine().commands().len();
        let width = self.positions.len() / 4;
        let slides = control.slides().filter(|_| control.tcp());
        let triple = control.triple_axes().map(|axis| commands + axis);
        let mut found = Found::default();
        Arch::new().dispatch(Look {
            nominal: control.nominal().path(),
            actual: corrector.model().chain().path(),
            t_from_tip: control.tip(),
            place: slides.map(|slides| (control.w_from_coordinates(), slides, triple)),
            commands,
            goals: &self.goals,
            positions: &self.positions,
            width,
            count,
            has_ways: self.moves.iter().any(|of| of.has_way),
            found: &mut found,
        });
        for (k, of) in self.moves.iter().enumerate() {
            let rest = |[m, sine, cosine]: &[[f64; MOST_LANES]; 3]| (m[k], sine[k].atan2(cosine[k]));
            let between = || {
                // What is no number is a closer look as well.
                let is_simple = if control.tcp() { slides.is_some() && found.far[k] < 0.5 } else { true };
                if is_simple { found.mid_line[k] } else { self.mid_line(k, control, corrector) }
            };
            tell(Seen {
                line: of.line,
                meant: self.positions[..commands].iter().map(|column| column[k]).collect(),
                left: of.is_placed.then(|| rest(&found.left)),
                correction: rest(&found.correction),
                mid_line_m: of.has_way.then(between),
            });
        }
        self.moves.clear();
    }

    /// [`mid_line`] of one that waits.
    fn mid_line(&self, k: usize, control: &Control, corrector: &Corrector) -> f64 {
        let commands = control.machine().commands().len();
        let width = self.positions.len() / 4;
        let position = |p: usize| {
            let columns = &self.positions[p * width..][..width];
            let of = |columns: &[[f64; MOST_LANES]]| columns.iter().map(|column| column[k]).collect();
            Position::new(of(&columns[..commands]), of(&columns[commands..]))
        };
        let [end, written_end, start, written_start] = [0, 1, 2, 3].map(position);
        mid_line(control, corrector, (&start, &end), (&written_start, &written_end))
    }
}

/// Largest error of the tip between the ends of a straight move, m.
pub(super) fn mid_line(
    control: &Control,
    corrector: &Corrector,
    meant: (&Position, &Position),
    written: (&Position, &Position),
) -> f64 {
    let goals_w = control.tips_between(meant.0, meant.1, PARTS);
    let sent = PARTS.map(|s| control.between(written.0, written.1, s));
    let [Some(a), Some(b), Some(c)] = sent else { return 0.0 };
    let tips_w = corrector.tips_w(control, &[a, b, c]);
    goals_w.into_iter().zip(tips_w).map(|(goal, tip)| (tip - goal).norm()).fold(0.0, f64::max)
}

/// What was found of each move.
#[derive(Default)]
struct Found {
    /// Distance of the tips, m, and sine and cosine of the angle between the axes.
    left: [[f64; MOST_LANES]; 3],
    correction: [[f64; MOST_LANES]; 3],
    mid_line: [f64; MOST_LANES],
    /// Not 0 where what lies between takes a closer look.
    far: [f64; MOST_LANES],
}

struct Look<'a> {
    nominal: &'a Path,
    actual: &'a Path,
    t_from_tip: Pose<f64>,
    /// Where coordinates of the tool centre point lie in `w`, the linear commands that follow them, and their columns.
    place: Option<(Pose<f64>, [usize; 3], [usize; 3])>,
    commands: usize,
    goals: &'a [[f64; MOST_LANES]; 6],
    positions: &'a [[f64; MOST_LANES]],
    /// Columns of a position.
    width: usize,
    count: usize,
    has_ways: bool,
    found: &'a mut Found,
}

impl WithSimd for Look<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let none = Lanes::splat(simd, 0.0);
        let t_from_tip = self.t_from_tip.lift(none);
        // The joints of a machine are laid out alike, whatever its errors are.
        let joints = self.nominal.joint_count();
        let mut moved: Few<Moved<Lanes<S>>> = Few::from_elem(Moved::none(none), joints.max(1));
        let mut q: Few<Lanes<S>> = Few::from_elem(none, self.commands);
        let mut speeds: Few<Vec3<Lanes<S>>> = Few::from_elem(Vec3::zero(none), self.commands);
        for from in (0..self.count).step_by(S::F64_LANES) {
            let lanes = from..from + S::F64_LANES;
            let tip = triple(simd, self.goals, [0, 1, 2], from);
            let axis = triple(simd, self.goals, [3, 4, 5], from);
            let (meant, others) = self.positions.split_at(self.width);
            let (written, others) = others.split_at(self.width);
            let (meant_start, written_start) = others.split_at(self.width);
            let (meant, written) = ([meant_start, meant], [written_start, written]);
            for (q, column) in q.iter_mut().zip(written[1]) {
                *q = Lanes::load(simd, &column[lanes.clone()]);
            }
            self.nominal.go_to(&q, &mut moved);
            for (path, found) in
                [(self.actual, &mut self.found.left), (self.nominal, &mut self.found.correction)]
            {
                let there = path.w_from_t(&moved, none) * t_from_tip;
                let (gap, its_axis) = (there.translation - tip, there.rotation.column(2));
                let cross = its_axis.cross(axis);
                gap.dot(gap).sqrt().store(&mut found[0][lanes.clone()]);
                cross.dot(cross).sqrt().store(&mut found[1][lanes.clone()]);
                its_axis.dot(axis).store(&mut found[2][lanes.clone()]);
            }
            if !self.has_ways {
                continue;
            }
            let (mut worst, mut far) = (none, none);
            for s in PARTS {
                let wanted = if let Some((place, slides, axes)) = self.place {
                    let place = place.lift(none);
                    go_between(simd, written, s, from, &mut q);
                    self.nominal.go_to(&q, &mut moved);
                    let at = (t_from_tip.translation, &moved[..]);
                    let sent = place.transform(triple_between(simd, written, axes, s, from));
                    far = far + slide_many(self.nominal, at, sent, slides, &mut q, &mut speeds);
                    place.transform(triple_between(simd, meant, axes, s, from))
                } else {
                    go_between(simd, meant, s, from, &mut q);
                    self.nominal.go_to(&q, &mut moved);
                    go_between(simd, written, s, from, &mut q);
                    self.nominal.point_w(t_from_tip.translation, &moved)
                };
                self.nominal.go_to(&q, &mut moved);
                let gap = self.actual.point_w(t_from_tip.translation, &moved) - wanted;
                let off = gap.dot(gap).sqrt();
                worst = (off - worst).select_below(0.0, worst, off);
            }
            worst.store(&mut self.found.mid_line[lanes.clone()]);
            far.store(&mut self.found.far[lanes.clone()]);
        }
    }
}

/// Columns of some moves.
type Columns = [[f64; MOST_LANES]];

/// Three columns, of the moves from `from` on.
#[inline(always)]
fn triple<S: Simd>(simd: S, columns: &Columns, [x, y, z]: [usize; 3], from: usize) -> Vec3<Lanes<S>> {
    let lanes = from..from + S::F64_LANES;
    Vec3([
        Lanes::load(simd, &columns[x][lanes.clone()]),
        Lanes::load(simd, &columns[y][lanes.clone()]),
        Lanes::load(simd, &columns[z][lanes]),
    ])
}

/// As [`triple`], a part `s` of the way from the first to the second.
#[inline(always)]
fn triple_between<S: Simd>(
    simd: S,
    [start, end]: [&Columns; 2],
    axes: [usize; 3],
    s: f64,
    from: usize,
) -> Vec3<Lanes<S>> {
    let (start, end) = (triple(simd, start, axes, from), triple(simd, end, axes, from));
    start + (end - start).times(start.0[0].lift(s))
}

/// Joints a part `s` of the way from the first to the second.
#[inline(always)]
fn go_between<S: Simd>(simd: S, [start, end]: [&Columns; 2], s: f64, from: usize, q: &mut [Lanes<S>]) {
    let lanes = from..from + S::F64_LANES;
    for ((q, start), end) in q.iter_mut().zip(start).zip(end) {
        let start = Lanes::load(simd, &start[lanes.clone()]);
        let end = Lanes::load(simd, &end[lanes.clone()]);
        *q = start + (end - start).scale(s);
    }
}

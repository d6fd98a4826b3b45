//! Inverse kinematics of any chain: position only, position and tool axis, or the full pose.
//!
//! Newton steps from a warm start, `docs/compensate.md` (C1) to (C4). Orientation comes first, by the
//! directions that the joints still have; position follows with what that leaves free. A direction in which
//! the joints hardly move the tool is held near the start instead of being chased, so that a correction stays
//! small at a singular pose, and is told.

mod directions;
mod many;
mod options;

use std::borrow::Cow;

use rand::SeedableRng;
use rand::rngs::StdRng;
use serde::{Deserialize, Serialize};

use crate::chain::{Chain, Moved};
use crate::check::random_command;
use crate::few::Few;
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::{JointKind, Machine};
use directions::{Direction, Equations, MOST, norm};
pub(crate) use many::slide_many;
pub use options::{InverseOptions, Mode};

inner! {
    use many::{Foreseen, foresee};
}

/// Equations whose weakest direction is stronger than this part of the strongest are solved as they stand, to eleven digits; a Newton step
/// needs fewer.
const SURE: f64 = 1e-2;
/// What is left of a goal that is reached, m and rad.
const CLOSE: f64 = 1e-12;
/// The volume that the unit steps of three slides span, at least.
const SPANS: f64 = 0.3;
/// A step that is none, and the longest that is taken at once, m and rad.
const NO_STEP: f64 = 1e-11;
const LONGEST: f64 = 0.5;

/// Where the tool should be.
#[derive(Clone, Copy, Debug)]
pub struct Goal {
    /// The tip in frame `t`; its z axis is the tool axis.
    pub t_from_tip: Pose<f64>,
    /// The tip in frame `w`, as it should be; what the mode leaves out does not count.
    pub w_from_tip: Pose<f64>,
}

/// How it ended.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Outcome {
    /// Every equation of the mode holds.
    Reached,
    /// A joint would leave its travel. It stands at its limit, and the others do what they can; where the
    /// start lies outside already, nothing is held back.
    OutOfTravel {
        /// Index of the command.
        command: usize,
        /// How far beyond the limit the solution lies, m or rad.
        by: f64,
    },
    /// At this pose the joints have lost a direction that they have elsewhere.
    Singular {
        /// The direction in frame `w`, unit length over all: `v` a displacement of the tip, `w` a turn about
        /// it.
        lost_w: Twist<f64>,
    },
    /// What is left cannot be reached, by this machine or from this start.
    Unreachable,
}

/// What was found.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Solution {
    /// Commands, m or rad, machine order.
    pub commands: Vec<f64>,
    /// How it ended.
    pub outcome: Outcome,
    /// Distance of the tip from the goal, m.
    pub position_left_m: f64,
    /// Angle of the tool axis (in [`Mode::Pose`]: of the whole orientation) from the goal, rad.
    pub angle_left_rad: f64,
    /// Newton steps taken.
    pub steps: usize,
}

/// The inverse of the chains of one machine.
#[derive(Clone, Debug)]
pub struct Inverse<'a> {
    machine: Cow<'a, Machine>,
    mode: Mode,
    options: InverseOptions,
    /// Equations of orientation that the machine has joints for on general poses.
    turns: usize,
    /// The same of position.
    shifts: usize,
    /// Whether the linear joints alone bring the tip anywhere.
    by_slides: bool,
    /// Whether linear commands turn nothing, so that the tip follows them along straight lines.
    straight: bool,
}

/// What one Newton step sees.
struct Look {
    tip: Pose<f64>,
    /// m.
    gap_w: Vec3<f64>,
    /// The turn that is missing, as a rotation vector in `w`, rad.
    turn_w: Vec3<f64>,
    /// What each command does to the tip by its speed: the point of the tip, and the tool's turning, in `w`.
    speeds: Few<Twist<f64>>,
}

/// One equation for each of `count`: what it makes of the speeds of the free commands.
fn rows(look: &Look, count: usize, free: &[bool], of: impl Fn(usize, &Twist<f64>) -> f64) -> Equations {
    let mut equations = Equations::new(count, free.len());
    for k in 0..count {
        let speeds = look.speeds.iter().zip(free);
        let row = speeds.map(|(speed, free)| if *free { of(k, speed) } else { 0.0 });
        equations.row_mut(k).iter_mut().zip(row).for_each(|(x, by)| *x = by);
    }
    equations
}

fn unit(k: usize) -> Vec3<f64> {
    Vec3(std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }))
}

/// Two unit vectors square to the unit vector `n` and to each other.
fn square_to(n: Vec3<f64>) -> [Vec3<f64>; 2] {
    let least = (0..3).min_by(|a, b| n.0[*a].abs().total_cmp(&n.0[*b].abs())).unwrap_or(0);
    let first = n.cross(unit(least));
    let first = first.times(first.norm().recip());
    [first, n.cross(first)]
}

impl<'a> Inverse<'a> {
    /// In the mode that the machine has joints for: the full pose with six independent freedoms, else
    /// position and tool axis where joints turn the tool axis, else position.
    pub fn new(machine: &'a Machine) -> Self {
        Inverse::of(Cow::Borrowed(machine))
    }

    /// The same with a machine of its own.
    pub fn owning(machine: Machine) -> Inverse<'static> {
        Inverse::of(Cow::Owned(machine))
    }

    fn of(machine: Cow<'a, Machine>) -> Self {
        let mut inverse = Inverse {
            machine,
            mode: Mode::Pose,
            options: InverseOptions::default(),
            turns: 0,
            shifts: 0,
            by_slides: false,
            straight: false,
        };
        inverse.straight = inverse.slides_turn_nothing();
        let (all, turns, _, _) = inverse.ranks();
        let axis = { Inverse { mode: Mode::PositionAndAxis, ..inverse.clone() } }.ranks().1;
        inverse.mode = match (all, turns, axis) {
            (6.., 3.., _) => Mode::Pose,
            (_, _, 0) => Mode::Position,
            _ => Mode::PositionAndAxis,
        };
        inverse.with_mode(inverse.mode)
    }

    /// In this mode, whatever the machine has.
    #[must_use]
    pub fn with_mode(&self, mode: Mode) -> Self {
        let mut inverse = Inverse { mode, ..self.clone() };
        (_, inverse.turns, inverse.shifts, inverse.by_slides) = inverse.ranks();
        inverse
    }

    /// With other limits.
    #[must_use]
    pub fn with_options(&self, options: InverseOptions) -> Self {
        Inverse { options, ..self.clone() }
    }

    /// The mode in use.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Equations of the mode that this machine has joints for on general poses, of orientation and of
    /// position.
    pub fn freedoms(&self) -> (usize, usize) {
        (self.turns, self.shifts)
    }

    /// Ranks over general poses: of everything, of orientation, of position, and whether linear joints alone
    /// give position.
    fn ranks(&self) -> (usize, usize, usize, bool) {
        let chain = Chain::nominal(&self.machine);
        let mut rng = StdRng::seed_from_u64(5);
        let count = self.machine.commands().len();
        let free = vec![true; count];
        let goal = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: Pose::identity(0.0) };
        let rank = |equations: Equations| {
            let directions = equations.directions();
            let largest = directions.largest();
            directions.parts.iter().filter(|part| part.size > 1e-6 * largest && part.size > 1e-9).count()
        };
        let mut best = (0, 0, 0, false);
        for _ in 0..8 {
            let q: Vec<f64> = (0..count).map(|c| random_command(&self.machine, c, &mut rng)).collect();
            let look = self.look(&chain, &goal, &q);
            let (turns, shifts) = (self.turn_rows(&look, &free), self.shift_rows(&look, &free));
            best.3 |= rank(self.by_slides(shifts.clone())) == 3;
            best.0 = best.0.max(rank(shifts.clone().and(&turns)));
            best.1 = best.1.max(rank(turns));
            best.2 = best.2.max(rank(shifts));
        }
        best
    }

    fn look(&self, chain: &Chain<f64>, goal: &Goal, q: &[f64]) -> Look {
        let (path, count) = (chain.path(), self.machine.commands().len());
        let mut moved = Few::from_elem(Moved::none(0.0), path.joint_count());
        path.go_to(q, &mut moved);
        let still = Twist::zero(0.0);
        let mut velocities = Few::from_elem(still, path.joint_count());
        let tip = path.velocities(goal.t_from_tip.translation, &moved, &mut velocities);
        let tip = Pose { rotation: tip.rotation * goal.t_from_tip.rotation, ..tip };
        let mut speeds = Few::from_elem(still, count);
        path.by_command(&velocities, &mut speeds, 0.0);
        let gap_w = goal.w_from_tip.translation - tip.translation;
        let turn_w = match self.mode {
            Mode::Position => Vec3([0.0; 3]),
            Mode::Pose => {
                let missing = goal.w_from_tip.rotation * tip.rotation.transpose();
                Pose { rotation: missing, translation: gap_w }.rotation_vector()
            }
            Mode::PositionAndAxis | Mode::Axis => {
                let (axis, wanted) = (tip.rotation.column(2), goal.w_from_tip.rotation.column(2));
                let cross = axis.cross(wanted);
                let (sine, cosine) = (cross.norm(), axis.dot(wanted));
                if sine > 1e-9 {
                    cross.times(sine.atan2(cosine) / sine)
                } else if cosine < 0.0 {
                    // Opposite: any direction will do, and the smallest turn shows the way.
                    square_to(axis)[0].times(std::f64::consts::PI)
                } else {
                    cross
                }
            }
        };
        Look { tip, gap_w, turn_w, speeds }
    }

    fn shift_rows(&self, look: &Look, free: &[bool]) -> Equations {
        rows(look, 3, free, |k, speed| speed.v.0[k])
    }

    fn turn_rows(&self, look: &Look, free: &[bool]) -> Equations {
        let (directions, count) = self.turn_directions(look);
        rows(look, count, free, |k, speed| directions[k].dot(speed.w))
    }

    /// The turns that count, in `w`, and how many.
    fn turn_directions(&self, look: &Look) -> ([Vec3<f64>; 3], usize) {
        let axes = [0, 1, 2].map(unit);
        match self.mode {
            Mode::Position => (axes, 0),
            Mode::PositionAndAxis | Mode::Axis => {
                let [first, second] = square_to(look.tip.rotation.column(2));
                ([first, second, axes[2]], 2)
            }
            Mode::Pose => (axes, 3),
        }
    }

    /// The turn that is missing, along the turns that count.
    fn turn_left(&self, look: &Look) -> [f64; MOST] {
        let (directions, count) = self.turn_directions(look);
        let mut left = [0.0; MOST];
        left.iter_mut().zip(&directions[..count]).for_each(|(left, n)| *left = n.dot(look.turn_w));
        left
    }

    /// Whether no joint that turns is driven by a linear command.
    fn slides_turn_nothing(&self) -> bool {
        let is_slide = |c: &usize| self.machine.command_joint(*c).kind == JointKind::Prismatic;
        self.machine.joints().all(|(j, joint)| {
            joint.kind == JointKind::Prismatic
                || self.machine.drive(j).is_none_or(|drive| drive.terms.iter().all(|(c, _)| !is_slide(c)))
        })
    }

    /// The three free commands where the tip alone counts and follows them along straight lines.
    pub(crate) fn slides(&self, free: &[bool]) -> Option<[usize; 3]> {
        let is_slide = |c: usize| self.machine.command_joint(c).kind == JointKind::Prismatic;
        let mut free = (0..free.len()).filter(|c| free[*c]);
        let (Some(x), Some(y), Some(z), None) = (free.next(), free.next(), free.next(), free.next()) else {
            return None;
        };
        let is_one_step = self.mode == Mode::Position && self.straight && [x, y, z].into_iter().all(is_slide);
        is_one_step.then_some([x, y, z])
    }

    /// The commands of [`Inverse::solve`] where the tip alone counts and linear commands alone are free: one step, since the tip follows
    /// them along straight lines. `None` where it takes more than that, and where travel counts.
    pub(crate) fn slide(
        &self,
        chain: &Chain<f64>,
        goal: &Goal,
        start: &[f64],
        free: &[bool],
    ) -> Option<Few<f64>> {
        let [x, y, z] = self.slides(free)?;
        let (path, mut q) = (chain.path(), Few::from_slice(start));
        let mut moved = Few::from_elem(Moved::none(0.0), path.joint_count().max(1));
        path.go_to(start, &mut moved);
        let mut speeds = Few::from_elem(Vec3::zero(0.0), start.len());
        let gap_w =
            goal.w_from_tip.translation - path.slides(goal.t_from_tip.translation, &moved, &mut speeds);
        if gap_w.norm() < CLOSE {
            return Some(q);
        }
        let (x_w, y_w, z_w) = (speeds[x], speeds[y], speeds[z]);
        let volume = x_w.dot(y_w.cross(z_w));
        if volume.abs() < SPANS * x_w.norm() * y_w.norm() * z_w.norm() {
            return None;
        }
        let by = [y_w.cross(z_w), z_w.cross(x_w), x_w.cross(y_w)].map(|across| across.dot(gap_w) / volume);
        let left = gap_w - x_w.times(by[0]) - y_w.times(by[1]) - z_w.times(by[2]);
        let longest = by.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        // Steps beyond that are shortened, and ones that are no numbers go nowhere.
        if !(left.norm() < CLOSE && longest < LONGEST) {
            return None;
        }
        if longest >= NO_STEP {
            [x, y, z].into_iter().zip(by).for_each(|(c, by)| q[c] += by);
        }
        let stands = |c: &usize| {
            let (low, high) = self.machine.travel(*c);
            (low..=high).contains(&q[*c])
        };
        let is_within = !self.options.within_travel || [x, y, z].iter().all(stands);
        is_within.then_some(q)
    }

    /// What linear joints do.
    fn by_slides(&self, equations: Equations) -> Equations {
        equations.only(|c| self.machine.command_joint(c).kind == JointKind::Prismatic)
    }

    /// Commands that bring the tip to the goal, or as near as the joints can.
    ///
    /// `start`: commands to start from, m or rad, near the solution if possible; weak directions stay near
    /// them. `free`: which commands may change (one per command).
    ///
    /// # Panics
    /// If `start` or `free` has not one entry per command.
    pub fn solve(&self, chain: &Chain<f64>, goal: &Goal, start: &[f64], free: &[bool]) -> Solution {
        let count = self.machine.commands().len();
        assert!(start.len() == count && free.len() == count, "one start and one flag per command");
        let mut free = Few::from_slice(free);
        let mut from = Few::from_slice(start);
        let mut worst: Option<(usize, f64)> = None;
        loop {
            let mut solution = self.newton(chain, goal, &from, start, &free);
            let beyond = |q: f64, c: usize| {
                let (low, high) = self.machine.travel(c);
                (low - q).max(q - high)
            };
            let out = (0..count)
                .filter(|c| free[*c] && self.options.within_travel)
                .map(|c| (c, beyond(solution.commands[c], c)))
                .filter(|(_, by)| *by > 1e-12)
                .max_by(|a, b| a.1.total_cmp(&b.1));
            match out {
                Some((c, by)) if beyond(start[c], c) > 0.0 => {
                    solution.outcome = Outcome::OutOfTravel { command: c, by };
                    return solution;
                }
                Some((c, by)) => {
                    worst = worst.or(Some((c, by)));
                    let (low, high) = self.machine.travel(c);
                    from[c] = solution.commands[c].clamp(low, high);
                    free[c] = false;
                }
                None => {
                    if let Some((command, by)) = worst {
                        solution.outcome = Outcome::OutOfTravel { command, by };
                    }
                    return solution;
                }
            }
        }
    }

    fn newton(
        &self,
        chain: &Chain<f64>,
        goal: &Goal,
        from: &[f64],
        start: &[f64],
        free: &[bool],
    ) -> Solution {
        let mut q = Few::from_slice(from);
        let mut look = self.look(chain, goal, &q);
        let mut steps = 0;
        while steps < self.options.steps {
            let close = self.left(&look);
            // Nothing weak can be at work once both vanish.
            if close.0 < CLOSE && close.1 < CLOSE {
                break;
            }
            let step = self.step(&look, &q, start, free);
            let longest = step.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            if longest < NO_STEP {
                break;
            }
            steps += 1;
            let mut part = if longest > LONGEST { LONGEST / longest } else { 1.0 };
            let merit = |look: &Look| {
                let (position, angle) = self.left(look);
                position.hypot(angle)
            };
            let mut shortened = 0;
            loop {
                let next: Few<f64> = q.iter().zip(&step).map(|(q, s)| q + part * s).collect();
                let there = self.look(chain, goal, &next);
                // Far from the goal a full step may overshoot; near it, and where a weak direction is drawn
                // back, it counts.
                if longest < 1e-2 || shortened == 6 || merit(&there) < merit(&look) {
                    (q, look) = (next, there);
                    break;
                }
                part *= 0.5;
                shortened += 1;
            }
        }
        let (position_left_m, angle_left_rad) = self.left(&look);
        let reached = position_left_m <= self.options.position_m && angle_left_rad <= self.options.angle_rad;
        let outcome = if reached { Outcome::Reached } else { self.missed(&look, free) };
        Solution { commands: q.to_vec(), outcome, position_left_m, angle_left_rad, steps }
    }

    /// What is left of the mode's equations: m, rad.
    fn left(&self, look: &Look) -> (f64, f64) {
        let gap = if self.mode == Mode::Axis { 0.0 } else { look.gap_w.norm() };
        (gap, look.turn_w.norm())
    }

    /// (C2) to (C4).
    fn step(&self, look: &Look, q: &[f64], start: &[f64], free: &[bool]) -> Few<f64> {
        let from_start: Few<f64> = q.iter().zip(start).map(|(q, s)| q - s).collect();
        let weak = self.options.weak;
        let shifts = self.shift_rows(look, free);
        let turns = self.turn_rows(look, free);
        let mut step = Few::from_elem(0.0, q.len());
        if self.mode == Mode::Pose && !self.by_slides {
            let (all, left) = (shifts.and(&turns), self.all_left(look));
            if !all.step_if_strong(&left, (0.05 * weak, 0.0), &mut step) {
                let directions = all.directions();
                let weak = 0.05 * weak * directions.largest();
                directions.step(&left, &from_start, weak, &mut step);
            }
            return step;
        }
        let mut strong: Vec<Direction> = Vec::new();
        if turns.count() > 0 {
            let left = self.turn_left(look);
            let is_enough = self.by_slides || self.mode == Mode::Axis;
            if !(is_enough && turns.step_if_strong(&left, (0.0, weak), &mut step)) {
                let directions = turns.directions();
                directions.step(&left, &from_start, weak, &mut step);
                strong = directions.parts;
                strong.retain(|part| part.size >= weak);
            }
        }
        if self.mode == Mode::Axis {
            return step;
        }
        let moved = shifts.times(&step);
        let mut gap = shift_left(look);
        gap.iter_mut().zip(moved).for_each(|(gap, moved)| *gap -= moved);
        if self.by_slides {
            let slides = self.by_slides(shifts);
            if !slides.step_if_strong(&gap, (SURE, 0.0), &mut step) {
                let none = vec![0.0; q.len()];
                slides.directions().step(&gap, &none, 0.0, &mut step);
            }
            return step;
        }
        // What the orientation does not need.
        let mut left_free = shifts;
        strong.iter().for_each(|part| left_free.forget(&part.by));
        let directions = left_free.directions();
        directions.step(&gap, &from_start, 0.05 * weak * directions.largest(), &mut step);
        step
    }

    /// What is left of position and orientation together. Arms: all six at once, lengths against a lever of 1 m.
    fn all_left(&self, look: &Look) -> [f64; MOST] {
        let mut left = shift_left(look);
        left[3..].copy_from_slice(&self.turn_left(look)[..3]);
        left
    }

    /// Why the goal was missed: a direction lost at this pose, or one that the free joints never have.
    fn missed(&self, look: &Look, free: &[bool]) -> Outcome {
        let InverseOptions { weak, .. } = self.options;
        let mut lost: Option<(f64, Twist<f64>)> = None;
        let mut consider = |equations: Equations,
                            rank: usize,
                            weak: &dyn Fn(f64) -> f64,
                            twist: &dyn Fn(&[f64; MOST]) -> Twist<f64>,
                            error: [f64; MOST]| {
            let directions = equations.directions();
            let weak = weak(directions.largest());
            for Direction { moves, size, .. } in directions.parts.iter().take(rank) {
                let left = directions::dot(moves, &error).abs();
                if *size < weak && left > 1e-3 * norm(&error) && lost.is_none_or(|(most, _)| left > most) {
                    lost = Some((left, twist(moves)));
                }
            }
        };
        let relative = |largest: f64| 0.05 * weak * largest;
        let zero = Vec3([0.0; 3]);
        if free.iter().all(|f| *f) {
            let (turns, shifts) = (self.turn_rows(look, free), self.shift_rows(look, free));
            if self.mode == Mode::Pose && !self.by_slides {
                let all = shifts.and(&turns);
                consider(all, 6, &relative, &|u| Twist::from_array(*u), self.all_left(look));
            } else {
                let (directions, _) = self.turn_directions(look);
                let turned = |u: &[f64; MOST]| {
                    let sum = directions.iter().zip(u).fold(zero, |sum, (n, x)| sum + n.times(*x));
                    Twist::new(zero, sum)
                };
                consider(turns, self.turns, &|_| weak, &turned, self.turn_left(look));
                if self.mode != Mode::Axis {
                    let moved = |u: &[f64; MOST]| Twist::new(Vec3([u[0], u[1], u[2]]), zero);
                    consider(shifts, self.shifts, &relative, &moved, shift_left(look));
                }
            }
        }
        lost.map_or(Outcome::Unreachable, |(_, lost_w)| Outcome::Singular { lost_w })
    }
}

/// The displacement that is missing.
fn shift_left(look: &Look) -> [f64; MOST] {
    let [x, y, z] = look.gap_w.0;
    [x, y, z, 0.0, 0.0, 0.0]
}

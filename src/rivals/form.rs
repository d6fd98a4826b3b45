//! The parameterisations: which small change each parameter makes, the row of a reading over all of them, and the step that
//! belongs to it.

use nalgebra::{DVector, Vector6};
use serde::{Deserialize, Serialize};

use super::state::State;
use crate::chain::Sweep;
use crate::identify::Places;
use crate::lie::{Pose, Twist, Vec3, Wrench};
use crate::machine::{Branch, Joint, JointKind, Machine};

/// What a scheme takes as its unknowns. Six numbers for each frame in all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// Local: each frame's own deviation, `E_j <- E_j exp(d_j)`, as `docs/model.md` (11) has it.
    Local,
    /// Local: increments of the factors of `T_wt`, `F_j <- F_j exp(d_j)` with `F_j = E_j⁻¹` on the workpiece branch; the paper's tables.
    Factors,
    /// Global: twists and end poses in the base frame; a twist changes through the adjoint, `xi_j <- Ad(exp d_j) xi_j`, and so stays a
    /// unit twist.
    Tangent,
    /// Global: all six numbers of each twist are free, and after every step the twist is put back onto the nearest unit twist.
    Free,
}

impl Form {
    /// Whether twists in the base frame are the unknowns.
    pub fn is_global(self) -> bool {
        matches!(self, Form::Tangent | Form::Free)
    }
}

/// A form at one state and set-up: what its rows need beside the sweep.
pub(super) struct Rows<'a> {
    form: Form,
    machine: &'a Machine,
    places: Places,
    setup: usize,
    /// Each frame in the one before it.
    links: Vec<Pose<f64>>,
    /// Each frame in the base while every joint is at zero.
    homes: Vec<Pose<f64>>,
}

impl<'a> Rows<'a> {
    pub fn new(form: Form, machine: &'a Machine, places: Places, state: &State, setup: usize) -> Self {
        let mut links = state.links.clone();
        links[machine.w_index()] = state.frames_w[setup];
        let homes = homes(machine, &links);
        Rows { form, machine, places, setup, links, homes }
    }

    /// The row of a reading that answers to a small twist of the tool, seen from `w`, by `y_w`.
    ///
    /// `displacements`: of every dyad's joint, m or rad.
    pub fn fill(&self, sweep: &Sweep<f64>, displacements: &[f64], y_w: Wrench<f64>, row: &mut [f64]) {
        let y_b = sweep.b_from_w().inverse().carry_wrench(y_w);
        for (j, displacement) in displacements.iter().enumerate() {
            let b_from_frame = sweep.b_from_frame(j);
            let sign = self.machine.branch(j).sign();
            let block = match self.form {
                // (14)
                Form::Local => signed(b_from_frame.carry_wrench(y_b), sign),
                // E <- exp(-d) E on the workpiece branch: one frame further out, and two signs cancel.
                Form::Factors if self.machine.branch(j) == Branch::Workpiece => {
                    let b_from_previous = b_from_frame * self.links[j].inverse();
                    b_from_previous.carry_wrench(y_b).to_array()
                }
                Form::Factors => b_from_frame.carry_wrench(y_b).to_array(),
                Form::Tangent | Form::Free => {
                    // The product of the exponentials before this one.
                    let before = b_from_frame * self.homes[j].inverse();
                    self.global(j, *displacement, sign, before.carry_wrench(y_b))
                }
            };
            let at = if j == self.machine.w_index() { self.places.frame_w(self.setup) } else { 6 * j };
            row[at..at + 6].copy_from_slice(&block);
        }
    }

    /// `y`: the wrench in base coordinates, behind the exponentials before this one.
    fn global(&self, j: usize, displacement: f64, sign: f64, y: Wrench<f64>) -> [f64; 6] {
        let Some(joint) = &self.machine.dyads()[j].joint else {
            // End poses move by exp(d) from the left; a fixed frame in between is no factor of a global product.
            return if self.is_end(j) { signed(y, sign) } else { [0.0; 6] };
        };
        let moved = self.homes[j].carry_twist(joint.twist()).times(displacement);
        if self.form == Form::Tangent {
            // exp(Ad(e^d) xi q) = e^d exp(xi q) e^-d
            let behind = Pose::exp(moved).carry_wrench(y);
            return signed(Wrench { f: y.f - behind.f, m: y.m - behind.m }, sign);
        }
        let jacobian = moved.left_jacobian().to_matrix();
        let row = jacobian.transpose() * Vector6::from(y.to_array()) * (sign * displacement);
        std::array::from_fn(|k| row[k])
    }

    fn is_end(&self, j: usize) -> bool {
        j == self.machine.w_index() || j == self.machine.t_index()
    }
}

fn signed(y: Wrench<f64>, sign: f64) -> [f64; 6] {
    y.to_array().map(|c| c * sign)
}

/// Each frame in the base while every joint is at zero.
fn homes(machine: &Machine, links: &[Pose<f64>]) -> Vec<Pose<f64>> {
    let mut behind = Pose::identity(0.0);
    let home = |(j, link): (usize, &Pose<f64>)| {
        if j == machine.workpiece_count() {
            behind = Pose::identity(0.0);
        }
        behind = behind * *link;
        behind
    };
    links.iter().enumerate().map(home).collect()
}

/// The state after a step of the form's own parameters.
pub(super) fn stepped(
    form: Form,
    machine: &Machine,
    places: Places,
    state: &State,
    step: &DVector<f64>,
) -> State {
    let part = |at: usize| Twist::from_array(std::array::from_fn(|k| step[at + k]));
    let mut next = state.clone();
    for (i, point) in next.set_ups.tool_points.iter_mut().enumerate() {
        let at = places.tool_point(i);
        *point = *point + Vec3([step[at], step[at + 1], step[at + 2]]);
    }
    next.set_ups.zeros.iter_mut().enumerate().for_each(|(i, z)| *z += step[places.zero(i)]);
    next.set_ups.lengths.iter_mut().enumerate().for_each(|(i, l)| *l += step[places.length(i)]);
    for (i, rotation) in next.set_ups.tool_rotations.iter_mut().enumerate() {
        let at = places.tool_rotation(i);
        let turn = Vec3([step[at], step[at + 1], step[at + 2]]);
        *rotation = *rotation * Pose::exp(Twist::new(Vec3([0.0; 3]), turn)).rotation;
    }
    let (w, t) = (machine.w_index(), machine.t_index());
    if !form.is_global() {
        let moved = |branch: Branch, link: Pose<f64>, d: Twist<f64>| match (form, branch) {
            (Form::Factors, Branch::Workpiece) => Pose::exp(-d) * link,
            _ => link * Pose::exp(d),
        };
        for (j, link) in next.links.iter_mut().enumerate().filter(|(j, _)| *j != w) {
            *link = moved(machine.branch(j), *link, part(6 * j));
        }
        for (s, frame) in next.frames_w.iter_mut().enumerate() {
            *frame = moved(Branch::Workpiece, *frame, part(places.frame_w(s)));
        }
        return next;
    }
    let old = homes(machine, &state.links);
    let mut new = old.clone();
    for (j, home) in new.iter_mut().enumerate().filter(|(j, _)| *j != w) {
        let d = part(6 * j);
        *home = match &machine.dyads()[j].joint {
            Some(joint) if form == Form::Free => put_back(joint, *home, d),
            Some(_) => Pose::exp(d) * *home,
            None if j == t => Pose::exp(d) * *home,
            None => *home,
        };
    }
    let base = Pose::identity(0.0);
    let before = |homes: &[Pose<f64>], j: usize| {
        if j == 0 || j == machine.workpiece_count() { base } else { homes[j - 1] }
    };
    for j in (0..new.len()).filter(|j| *j != w) {
        next.links[j] = before(&new, j).inverse() * new[j];
    }
    for (s, frame) in next.frames_w.iter_mut().enumerate() {
        let home = Pose::exp(part(places.frame_w(s))) * before(&old, w) * *frame;
        *frame = before(&new, w).inverse() * home;
    }
    next
}

/// The frame at `home` moved so that its joint's twist, seen from the base, is the unit twist next to the present one plus `d`.
fn put_back(joint: &Joint, home: Pose<f64>, d: Twist<f64>) -> Pose<f64> {
    let present = home.carry_twist(joint.twist());
    let wanted = present + d;
    match joint.kind {
        JointKind::Prismatic => {
            let direction = wanted.v.times(wanted.v.norm().recip());
            Pose { rotation: (shortest_turn(present.v, direction) * home).rotation, ..home }
        }
        JointKind::Revolute => {
            let scale = wanted.w.norm().recip();
            let (axis, v) = (wanted.w.times(scale), wanted.v.times(scale));
            // Without pitch: the point of the axis next to the origin is w × v, whatever v has along w.
            let foot = axis.cross(v);
            let rotation = (shortest_turn(present.w, axis) * home).rotation;
            Pose { rotation, translation: foot + axis.times(axis.dot(home.translation)) }
        }
    }
}

/// The turn from one unit vector to another about what is square to both.
fn shortest_turn(from: Vec3<f64>, to: Vec3<f64>) -> Pose<f64> {
    let (axis, cos) = (from.cross(to), from.dot(to));
    let sin = axis.norm();
    if sin == 0.0 {
        return Pose::identity(0.0);
    }
    Pose::exp(Twist::new(Vec3([0.0; 3]), axis.times(sin.atan2(cos) / sin)))
}

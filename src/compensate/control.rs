//! The control: how program coordinates become joint commands under the nominal kinematics, and back.
//!
//! `docs/compensate.md` (C5) to (C8). Everything here is in m and rad; programmed units end at
//! [`Control::si`].

use super::axis::{self, Axis};
use super::frame::{Change, Frame};
use super::position::Position;
use super::setup::{Setup, ToolAxis};
use crate::chain::Chain;
use crate::few::{Few, pairwise};
use crate::inverse::{Goal, Inverse, InverseOptions, Mode};
use crate::lie::{Mat3, Pose, Vec3};
use crate::machine::{Branch, Machine};
use crate::nc::{Block, Dialect, Plane, Units};

/// What the control has in force.
#[derive(Clone)]
pub(super) struct Control<'a> {
    machine: &'a Machine,
    setup: &'a Setup,
    nominal: Chain<f64>,
    inverse: Inverse<'a>,
    axes: Vec<Axis>,
    units: Units,
    tcp: bool,
    frame: Frame,
    /// Work offset less the machine's zero, by axis, m or rad.
    offset: Few<f64>,
    /// Tool length that the control counts with, m.
    length: f64,
    /// Length of the tool that is in the spindle, m.
    tip_length: f64,
    /// Normal of the plane: component of the tip.
    normal: usize,
    /// Direction in which the control counts the tool length: component of the tip.
    length_axis: usize,
    /// The program's own frame, before [`Frame`], in `w`; tool centre point function on.
    w_from_program: Pose<f64>,
}

impl<'a> Control<'a> {
    pub fn new(machine: &'a Machine, setup: &'a Setup) -> Self {
        let axes = Axis::all(machine);
        let count = axes.len();
        // What the program means is asked here, not whether the machine can.
        let exact = InverseOptions { within_travel: false, ..InverseOptions::default() };
        let mut control = Control {
            machine,
            setup,
            nominal: Chain::nominal(machine),
            inverse: Inverse::new(machine).with_mode(Mode::Position).with_options(exact),
            axes,
            units: Units::Millimetre,
            tcp: setup.tcp_at_start(),
            frame: Frame::new(count),
            offset: Few::from_elem(0.0, count),
            length: 0.0,
            tip_length: setup.reference_length(),
            normal: 2,
            length_axis: 2,
            w_from_program: Pose::identity(0.0),
        };
        control.set_offset(None);
        control
    }

    /// Whether both have the same in force, of one machine and set-up.
    pub fn is_as(&self, other: &Control) -> bool {
        self.units == other.units
            && self.tcp == other.tcp
            && self.frame == other.frame
            && self.offset == other.offset
            && (self.length, self.tip_length) == (other.length, other.tip_length)
            && (self.normal, self.length_axis) == (other.normal, other.length_axis)
            && self.w_from_program == other.w_from_program
    }

    /// What the program and its control have agreed on beforehand.
    pub fn setup(&self) -> &'a Setup {
        self.setup
    }

    pub fn machine(&self) -> &'a Machine {
        self.machine
    }

    /// The machine as it is meant.
    pub fn nominal(&self) -> &Chain<f64> {
        &self.nominal
    }

    /// The addresses that are followed: X, Y, Z first.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Unit of lengths in force.
    pub fn units(&self) -> Units {
        self.units
    }

    pub fn set_units(&mut self, units: Units) {
        self.units = units;
    }

    /// Whether coordinates are those of the tool centre point.
    pub fn tcp(&self) -> bool {
        self.tcp
    }

    pub fn set_tcp(&mut self, on: bool) {
        self.tcp = on;
    }

    /// Normal of the plane: component of the tip.
    pub fn normal(&self) -> usize {
        self.normal
    }

    /// Direction in which the tool length counts: component of the tip.
    pub fn length_axis(&self) -> usize {
        self.length_axis
    }

    /// By axis: whether it is one of the two linear axes of the plane.
    pub fn in_plane(&self) -> Few<bool> {
        self.axes.iter().map(|a| a.tip().is_some_and(|k| k != self.normal)).collect()
    }

    /// Tool lengths, m: `counted` is the one that the control counts with, `tip` that of the tool in the spindle.
    pub fn set_lengths(&mut self, counted: f64, tip: f64) {
        (self.length, self.tip_length) = (counted, tip);
    }

    /// A programmed number of an axis, m or rad.
    pub fn si(&self, axis: usize, value: f64) -> f64 {
        self.axes[axis].si(value, self.units)
    }

    /// A programmed length, m.
    pub fn length_si(&self, value: f64) -> f64 {
        axis::length_si(value, self.units)
    }

    /// m or rad as the program writes it.
    pub fn programmed(&self, axis: usize, si: f64) -> f64 {
        self.axes[axis].programmed(si, self.units)
    }

    /// Takes a block that changes the frame into account, as [`Frame::change`].
    pub fn change_frame(
        &mut self,
        block: &Block,
        dialect: Dialect,
        plane: Option<Plane>,
        place: &[Option<f64>],
    ) -> Change {
        self.frame.change(block, dialect, (&self.axes, self.units), plane, place)
    }

    /// By how much written numbers are smaller than program coordinates, as [`Frame::slip`].
    pub fn slip(&self) -> Few<f64> {
        self.frame.slip(&self.axes)
    }

    pub fn set_slip(&mut self, axis: usize, slip: f64) {
        self.frame.set_slip(axis, slip);
    }

    /// Whether a frame tilts the direction of the tool length, which then lies along no axis; tool centre point function off.
    pub fn tilts_length(&self) -> bool {
        let tilted = !self.frame.is_straight() && !self.frame.keeps(self.length_axis);
        !self.tcp && tilted && self.length != 0.0
    }

    /// `length_follows`: whether the tool length goes with the plane (Siemens) or stays with Z.
    pub fn set_plane(&mut self, plane: Option<Plane>, length_follows: bool) {
        self.normal = match plane {
            None | Some(Plane::Xy) => 2,
            Some(Plane::Zx) => 1,
            Some(Plane::Yz) => 0,
        };
        self.length_axis = if length_follows { self.normal } else { 2 };
    }

    /// Takes a work offset into force, by name; false where the set-up does not have it.
    pub fn set_offset(&mut self, name: Option<&str>) -> bool {
        let mut known = true;
        for i in 0..self.axes.len() {
            let (address, rotary) = (self.axes[i].address(), self.axes[i].is_rotary());
            let value = match name {
                None => Some(0.0),
                Some(name) => self.setup.offset(name, address, rotary),
            };
            known &= value.is_some();
            self.offset[i] = value.unwrap_or(0.0) - self.setup.zero(address, rotary);
        }
        self.w_from_program = self.program_frame();
        known
    }

    /// `T_wP` of (C6): where the program's zero stands in `w`, and how its axes lie there. Its origin is
    /// where the offset puts the tip of a tool of no length; where the offset turns the table, its axes are
    /// those of `w` at joints zero.
    fn program_frame(&self) -> Pose<f64> {
        let mut q = Few::from_elem(0.0, self.machine.commands().len());
        for (i, axis) in self.axes.iter().enumerate() {
            if let Some((c, sign)) = axis.command() {
                let on_table = self.machine.joints().any(|(j, joint)| {
                    joint.name == self.machine.commands()[c] && self.machine.branch(j) == Branch::Workpiece
                });
                if !axis.is_rotary() || on_table {
                    q[c] = sign * self.offset[i];
                }
            }
        }
        let (there, home) = (self.nominal.sweep(&q), self.nominal.sweep(&Few::from_elem(0.0, q.len())));
        let tip = (there.w_from_t() * self.t_from_tip(0.0)).translation;
        let rotation = there.b_from_w().rotation.transpose() * home.b_from_w().rotation;
        Pose { rotation, translation: tip }
    }

    /// The tip of a tool of this length (m, from the gauge line) in frame `t`; its z axis is the tool axis.
    pub fn t_from_tip(&self, length: f64) -> Pose<f64> {
        let beyond = Pose::translation(Vec3([0.0, 0.0, self.setup.reference_length() - length]));
        match self.setup.tool_axis() {
            ToolAxis::Plus => beyond,
            ToolAxis::Minus => {
                let over = Mat3([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]);
                Pose { rotation: over, translation: Vec3([0.0; 3]) } * beyond
            }
        }
    }

    /// The tip of the tool that is in the spindle, in frame `t`.
    pub fn tip(&self) -> Pose<f64> {
        self.t_from_tip(if self.tcp { self.length } else { self.tip_length })
    }

    /// The tip in frame `w` with the joints at `q`, by the nominal kinematics.
    pub fn tip_pose(&self, q: &[f64]) -> Pose<f64> {
        self.nominal.tool_pose(q) * self.tip()
    }

    /// Where tip and tool axis should be with the joints at `q`.
    pub fn goal(&self, q: &[f64]) -> Goal {
        Goal { t_from_tip: self.tip(), w_from_tip: self.tip_pose(q) }
    }

    /// The linear commands that tip coordinates alone decide on, where these follow them along straight lines.
    pub fn slides(&self) -> Option<[usize; 3]> {
        let mut free = Few::from_elem(false, self.machine.commands().len());
        let tips = self.axes.iter().filter(|axis| axis.tip().is_some());
        tips.filter_map(Axis::command).for_each(|(c, _)| free[c] = true);
        self.inverse.slides(&free)
    }

    /// Where coordinates of the tip lie in `w`; tool centre point function on.
    pub fn w_from_coordinates(&self) -> Pose<f64> {
        self.w_from_program * self.frame.pose()
    }

    /// The axes X, Y, Z.
    pub fn triple_axes(&self) -> [usize; 3] {
        let mut triple = [0; 3];
        for (i, axis) in self.axes.iter().enumerate() {
            if let Some(k) = axis.tip() {
                triple[k] = i;
            }
        }
        triple
    }

    /// The three coordinates of the tip among `program`.
    fn triple(&self, program: &[f64]) -> Vec3<f64> {
        let mut p = [0.0; 3];
        for (axis, value) in self.axes.iter().zip(program) {
            if let Some(k) = axis.tip() {
                p[k] = *value;
            }
        }
        Vec3(p)
    }

    /// (C5), (C6): joint commands for program coordinates; `None` where the linear axes cannot bring the tip
    /// there.
    ///
    /// `program`: one per axis, m or rad. `near`: commands of joints without address, and a start for the
    /// rest.
    pub fn joints(&self, program: &[f64], near: &[f64]) -> Option<Few<f64>> {
        let p = self.frame.pose().transform(self.triple(program));
        let mut q = Few::from_slice(near);
        let mut free = Few::from_elem(false, q.len());
        for (i, axis) in self.axes.iter().enumerate() {
            let Some((c, sign)) = axis.command() else { continue };
            match axis.tip() {
                Some(_) if self.tcp => free[c] = true,
                Some(k) => {
                    let length = if k == self.length_axis { self.length } else { 0.0 };
                    q[c] = sign * (p.0[k] + self.offset[i] + length);
                }
                None => q[c] = sign * (program[i] + self.offset[i] + self.frame.shift(i)),
            }
        }
        if !self.tcp {
            return Some(q);
        }
        let t_from_tip = self.t_from_tip(self.length);
        let w_from_tip = Pose::translation(self.w_from_program.transform(p));
        let goal = Goal { t_from_tip, w_from_tip };
        if let Some(q) = self.inverse.slide(&self.nominal, &goal, &q, &free) {
            return Some(q);
        }
        let solution = self.inverse.solve(&self.nominal, &goal, &q, &free);
        (solution.position_left_m < 1e-9).then(|| solution.commands.into())
    }

    /// Program coordinates of joint commands, one per axis; `other`: of addresses without joint.
    pub fn program(&self, q: &[f64], other: &[f64]) -> Few<f64> {
        let mut p = [0.0; 3];
        let back = self.frame.pose().inverse();
        if self.tcp {
            let tip = (self.nominal.tool_pose(q) * self.t_from_tip(self.length)).translation;
            p = back.transform(self.w_from_program.inverse().transform(tip)).0;
        } else {
            // An axis that the machine lacks stands where the program says.
            let lacking = self.frame.pose().transform(self.triple(other));
            for (i, axis) in self.axes.iter().enumerate() {
                if let Some(k) = axis.tip() {
                    let length = if k == self.length_axis { self.length } else { 0.0 };
                    p[k] = match axis.command() {
                        Some((c, sign)) => sign * q[c] - self.offset[i] - length,
                        None => lacking.0[k],
                    };
                }
            }
            p = back.transform(Vec3(p)).0;
        }
        let mut program = Few::from_slice(other);
        for (i, axis) in self.axes.iter().enumerate() {
            match (axis.tip(), axis.command()) {
                (Some(k), _) => program[i] = p[k],
                (None, Some((c, sign))) => program[i] = sign * q[c] - self.offset[i] - self.frame.shift(i),
                (None, None) => {}
            }
        }
        program
    }

    /// As [`Control::program`], of rotary axes alone; the others are `other`.
    pub fn angles(&self, q: &[f64], other: &[f64]) -> Few<f64> {
        if self.axes.iter().any(|axis| axis.is_rotary() && axis.tip().is_some()) {
            return self.program(q, other);
        }
        let mut program = Few::from_slice(other);
        for (i, axis) in self.axes.iter().enumerate().filter(|(_, axis)| axis.is_rotary()) {
            if let Some((c, sign)) = axis.command() {
                program[i] = sign * q[c] - self.offset[i] - self.frame.shift(i);
            }
        }
        program
    }

    /// Joint commands `q` with those of rotary axes as these program coordinates have them.
    pub fn turned(&self, q: &[f64], program: &[f64]) -> Few<f64> {
        let mut q = Few::from_slice(q);
        for (i, axis) in
            self.axes.iter().enumerate().filter(|(_, axis)| axis.is_rotary() && axis.tip().is_none())
        {
            if let Some((c, sign)) = axis.command() {
                q[c] = sign * (program[i] + self.offset[i] + self.frame.shift(i));
            }
        }
        q
    }

    /// The joints at a part `s` of a straight move, as the control moves them.
    pub fn between(&self, a: &Position, b: &Position, s: f64) -> Option<Few<f64>> {
        let q = mixed(a.q(), b.q(), s);
        if !self.tcp {
            return Some(q);
        }
        self.joints(&mixed(a.program(), b.program(), s), &q)
    }

    /// Where the tip is meant to be in frame `w` at some parts of a straight move, m.
    pub fn tips_between<const N: usize>(
        &self,
        a: &Position,
        b: &Position,
        parts: [f64; N],
    ) -> [Vec3<f64>; N] {
        if self.tcp {
            let place = self.w_from_coordinates();
            return parts.map(|s| place.transform(self.triple(&mixed(a.program(), b.program(), s))));
        }
        self.nominal.tool_points(&parts.map(|s| mixed(a.q(), b.q(), s)), self.tip().translation)
    }

    /// Calls a position by the coordinates in force; the machine has not moved.
    pub fn rename(&self, position: &mut Position) {
        position.rename(self.program(position.q(), position.program()));
    }

    /// Joint command for a number in the machine's own frame.
    pub fn machine_joint(&self, axis: usize, value: f64) -> Option<(usize, f64)> {
        let axis = &self.axes[axis];
        let zero = self.setup.zero(axis.address(), axis.is_rotary());
        axis.command().map(|(c, sign)| (c, sign * (value - zero)))
    }

    /// Whether the words X, Y, Z are this machine's linear joints, so that the tip can be programmed.
    pub fn can_tcp(&self) -> bool {
        let linear =
            self.axes.iter().filter(|a| a.tip().is_some()).all(|a| a.command().is_some() && !a.is_rotary());
        linear && self.inverse.freedoms().1 == 3
    }
}

/// What lies a part `s` of the way from `a` to `b`.
fn mixed(a: &[f64], b: &[f64], s: f64) -> Few<f64> {
    pairwise(a, b, |a, b| a + (b - a) * s)
}

//! The control: how program coordinates become joint commands under the nominal kinematics, and back.
//!
//! `docs/compensate.md` (C5) to (C8). Everything here is in m and rad; programmed units end at
//! [`Control::si`].

use super::frame::Frame;
use super::setup::{Setup, ToolAxis};
use crate::chain::Chain;
use crate::inverse::{Goal, Inverse, InverseOptions, Mode};
use crate::lie::{Mat3, Pose, Vec3};
use crate::machine::{Branch, JointKind, Machine};
use crate::nc::{Plane, Units};

/// An address that is followed.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub address: String,
    /// The joint that it commands, and the sign of the program's number against the displacement.
    pub command: Option<(usize, f64)>,
    /// 0, 1, 2 for X, Y, Z: component of the tip where the tool centre point function is on.
    pub tip: Option<usize>,
    pub rotary: bool,
}

/// What the control has in force.
pub(super) struct Control<'a> {
    machine: &'a Machine,
    pub setup: &'a Setup,
    pub nominal: Chain<f64>,
    inverse: Inverse<'a>,
    pub axes: Vec<Axis>,
    pub units: Units,
    pub tcp: bool,
    pub frame: Frame,
    /// Work offset less the machine's zero, by axis, m or rad.
    offset: Vec<f64>,
    /// Tool length that the control counts with, m.
    pub length: f64,
    /// Length of the tool that is in the spindle, m.
    pub tip_length: f64,
    /// Normal of the plane: component of the tip.
    pub normal: usize,
    /// Direction in which the control counts the tool length: component of the tip.
    pub length_axis: usize,
    /// The program's own frame, before [`Frame`], in `w`; tool centre point function on.
    w_from_program: Pose<f64>,
}

/// X, Y, Z.
const TIP: [&str; 3] = ["X", "Y", "Z"];

impl<'a> Control<'a> {
    pub fn new(machine: &'a Machine, setup: &'a Setup) -> Self {
        let tip = |address: &str| TIP.iter().position(|t| *t == address);
        let mut axes: Vec<Axis> = (0..machine.commands().len())
            .map(|c| {
                let joint = machine.command_joint(c);
                let word = joint.nc_word();
                let address = word.address.to_ascii_uppercase();
                let rotary = joint.kind == JointKind::Revolute;
                Axis { tip: tip(&address), address, command: Some((c, f64::from(word.sign))), rotary }
            })
            .collect();
        for (k, address) in TIP.into_iter().enumerate() {
            if !axes.iter().any(|a| a.address == address) {
                axes.push(Axis { address: address.into(), command: None, tip: Some(k), rotary: false });
            }
        }
        // The order in which people write them: X Y Z first.
        axes.sort_by_key(|a| (a.tip.map_or(3, |k| k), a.address.clone()));
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
            offset: vec![0.0; count],
            length: 0.0,
            tip_length: setup.reference_length(),
            normal: 2,
            length_axis: 2,
            w_from_program: Pose::identity(0.0),
        };
        control.set_offset(None);
        control
    }

    /// A programmed number of an axis, m or rad.
    pub fn si(&self, axis: usize, value: f64) -> f64 {
        if self.axes[axis].rotary { value.to_radians() } else { self.length_si(value) }
    }

    /// A programmed length, m.
    pub fn length_si(&self, value: f64) -> f64 {
        match self.units {
            Units::Millimetre => value / 1e3,
            Units::Inch => value * 25.4 / 1e3,
        }
    }

    /// m or rad as the program writes it.
    pub fn programmed(&self, axis: usize, si: f64) -> f64 {
        match (self.axes[axis].rotary, self.units) {
            (true, _) => si.to_degrees(),
            (false, Units::Millimetre) => si * 1e3,
            (false, Units::Inch) => si * 1e3 / 25.4,
        }
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
            let Axis { address, rotary, .. } = &self.axes[i];
            let value = match name {
                None => Some(0.0),
                Some(name) => self.setup.offset(name, address, *rotary),
            };
            known &= value.is_some();
            self.offset[i] = value.unwrap_or(0.0) - self.setup.zero(address, *rotary);
        }
        self.w_from_program = self.program_frame();
        known
    }

    /// `T_wP` of (C6): where the program's zero stands in `w`, and how its axes lie there. Its origin is
    /// where the offset puts the tip of a tool of no length; where the offset turns the table, its axes are
    /// those of `w` at joints zero.
    fn program_frame(&self) -> Pose<f64> {
        let mut q = vec![0.0; self.machine.commands().len()];
        for (i, axis) in self.axes.iter().enumerate() {
            if let Some((c, sign)) = axis.command {
                let on_table = self.machine.joints().any(|(j, joint)| {
                    joint.name == self.machine.commands()[c] && self.machine.branch(j) == Branch::Workpiece
                });
                if !axis.rotary || on_table {
                    q[c] = sign * self.offset[i];
                }
            }
        }
        let (there, home) = (self.nominal.sweep(&q), self.nominal.sweep(&vec![0.0; q.len()]));
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

    /// The tool that is in the spindle.
    pub fn tip(&self) -> Pose<f64> {
        self.t_from_tip(if self.tcp { self.length } else { self.tip_length })
    }

    /// The three coordinates of the tip among `program`.
    fn triple(&self, program: &[f64]) -> Vec3<f64> {
        let mut p = [0.0; 3];
        for (axis, value) in self.axes.iter().zip(program) {
            if let Some(k) = axis.tip {
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
    pub fn joints(&self, program: &[f64], near: &[f64]) -> Option<Vec<f64>> {
        let p = self.frame.pose.transform(self.triple(program));
        let mut q = near.to_vec();
        let mut free = vec![false; q.len()];
        for (i, axis) in self.axes.iter().enumerate() {
            let Some((c, sign)) = axis.command else { continue };
            match axis.tip {
                Some(_) if self.tcp => free[c] = true,
                Some(k) => {
                    let length = if k == self.length_axis { self.length } else { 0.0 };
                    q[c] = sign * (p.0[k] + self.offset[i] + length);
                }
                None => q[c] = sign * (program[i] + self.offset[i] + self.frame.shift[i]),
            }
        }
        if !self.tcp {
            return Some(q);
        }
        let t_from_tip = self.t_from_tip(self.length);
        let w_from_tip = Pose::translation(self.w_from_program.transform(p));
        let solution = self.inverse.solve(&self.nominal, &Goal { t_from_tip, w_from_tip }, &q, &free);
        (solution.position_left_m < 1e-9).then_some(solution.commands)
    }

    /// Program coordinates of joint commands, one per axis; `other`: of addresses without joint.
    pub fn program(&self, q: &[f64], other: &[f64]) -> Vec<f64> {
        let mut p = [0.0; 3];
        let back = self.frame.pose.inverse();
        if self.tcp {
            let tip = (self.nominal.w_from_t(q) * self.t_from_tip(self.length)).translation;
            p = back.transform(self.w_from_program.inverse().transform(tip)).0;
        } else {
            // An axis that the machine lacks stands where the program says.
            let lacking = self.frame.pose.transform(self.triple(other));
            for (i, axis) in self.axes.iter().enumerate() {
                if let Some(k) = axis.tip {
                    let length = if k == self.length_axis { self.length } else { 0.0 };
                    p[k] = match axis.command {
                        Some((c, sign)) => sign * q[c] - self.offset[i] - length,
                        None => lacking.0[k],
                    };
                }
            }
            p = back.transform(Vec3(p)).0;
        }
        let of = |(i, axis): (usize, &Axis)| match (axis.tip, axis.command) {
            (Some(k), _) => p[k],
            (None, Some((c, sign))) => sign * q[c] - self.offset[i] - self.frame.shift[i],
            (None, None) => other[i],
        };
        self.axes.iter().enumerate().map(of).collect()
    }

    /// Joint command for a number in the machine's own frame.
    pub fn machine_joint(&self, axis: usize, value: f64) -> Option<(usize, f64)> {
        let Axis { address, command, rotary, .. } = &self.axes[axis];
        command.map(|(c, sign)| (c, sign * (value - self.setup.zero(address, *rotary))))
    }

    /// Whether the words X, Y, Z are this machine's linear joints, so that the tip can be programmed.
    pub fn can_tcp(&self) -> bool {
        let linear = self.axes.iter().filter(|a| a.tip.is_some()).all(|a| a.command.is_some() && !a.rotary);
        linear && self.inverse.freedoms().1 == 3
    }
}

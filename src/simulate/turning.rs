//! Tests that turn about something: a cone frustum with five axes, one rotary axis with linear axes that follow, a circle.
//!
//! All of them are one path over an angle `u`; linear axes are solved from the rotary motion so that the nominal machine keeps
//! the distance of the two balls. `docs/simulate.md` has the equations.

use super::all_axes::AllAxes;
use super::course::{At, Course, Sample, Samples, within_travel};
use super::follow::{aim, commands_of, every_aim, follow};
use super::profile::{Leg, ticks};
use super::random_commands;
use crate::chain::Chain;
use crate::error::{Error, Result};
use crate::lie::{Mat3, Vec3};
use crate::machine::{Branch, JointKind, Machine};

/// What the linear axes may leave of the gap, m.
const CLOSED: f64 = 1e-9;
/// Largest step of the turn from one solution to the next, rad.
const STRIDE: f64 = 0.035;

/// What the tests have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Balls {
    /// The ball on the workpiece side, in frame `w`, m.
    pub workpiece_point_w: Vec3<f64>,
    /// The ball on the tool side, in frame `t`, m.
    pub tool_point_t: Vec3<f64>,
    /// Distance of the two, m.
    pub length: f64,
}

/// Where a rotary axis's bar points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pointing {
    /// Away from the axis.
    Radial,
    /// Along the motion.
    Tangential,
    /// Along the axis.
    Axial,
}

/// A test over an angle `u`.
#[derive(Clone, Debug, PartialEq)]
pub enum Figure {
    /// A cone frustum (ISO 10791-6 AK4, BK4, CK4). The bar turns about the cone's axis, the tool's axis on the same cone opposite
    /// to it:
    ///
    /// ```math
    /// e = (0, -sin i, cos i)   n = (0, cos i, sin i)   m(u) = n cos u + (1, 0, 0) sin u
    /// bar = length (e sin β + m(u) cos β)     tool = e cos β - m(u + lead) sin β
    /// ```
    Cone {
        /// Half the apex angle β, rad.
        half_apex: f64,
        /// Inclination i of the cone's axis, rad.
        inclination: f64,
        /// By how much the tool leads the bar, rad.
        lead: f64,
        /// Whether the control keeps the bar's direction in frame `w` (on), or in the base (off).
        tool_centre_point: bool,
        /// Rotary commands with the opposite sign of those that aim the tool, as in the paper's printed programs.
        reversed: bool,
    },
    /// Rotary axes move as told, linear axes follow so that the bar stands as on the cone.
    Waves {
        /// The rotary axes that move.
        waves: Vec<Wave>,
        /// Half the apex angle of the bar's cone, rad.
        half_apex: f64,
        /// Inclination of its axis, rad.
        inclination: f64,
        /// As in [`Figure::Cone`].
        tool_centre_point: bool,
    },
    /// One rotary axis turns, `u` being its displacement; linear axes follow (ISO 10791-6 AK1, AK2, BK1 ...).
    Rotary {
        /// Its command.
        command: usize,
        /// Where the bar points at the start.
        pointing: Pointing,
        /// Whether the bar turns with the axis (it stands still in the body that the axis turns), or stands in the other body.
        turns: bool,
    },
    /// A circle of the bar's length about the workpiece ball (ISO 230-4), `u` counting from the first direction to the second.
    Circle {
        /// Orthonormal directions of the plane in frame `w`.
        plane_w: [Vec3<f64>; 2],
        /// Direction of the tool's axis in frame `w`, where the machine has no linear axes to follow with.
        tool_axis_w: Vec3<f64>,
    },
}

/// A rotary command over the turn: `offset + turns u + amplitude cos(cycles u + phase)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// Index of the command.
    pub command: usize,
    /// rad.
    pub offset: f64,
    /// Turns for each turn of `u`.
    pub turns: f64,
    /// rad.
    pub amplitude: f64,
    /// Cycles for each turn of `u`.
    pub cycles: f64,
    /// rad.
    pub phase: f64,
}

impl Wave {
    fn at(&self, u: f64) -> f64 {
        self.offset + self.turns * u + self.amplitude * (self.cycles * u + self.phase).cos()
    }
}

impl Figure {
    /// The cone of ISO 10791-6 with tool centre point function: half apex angle 45°, inclined by 30°.
    pub fn cone() -> Figure {
        use std::f64::consts::{FRAC_PI_4, FRAC_PI_6};
        let (half_apex, inclination) = (FRAC_PI_4, FRAC_PI_6);
        Figure::Cone { half_apex, inclination, lead: 0.0, tool_centre_point: true, reversed: false }
    }
}

/// Numbers that published tables have rounded before they were used.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rounding {
    /// Decimals of the bar's direction (its components over its length).
    pub direction_decimals: Option<u32>,
    /// Step of rotary commands, rad.
    pub rotary_step: Option<f64>,
}

/// A test on a machine, ready to run.
#[derive(Clone, Debug)]
pub struct Turning {
    machine: Machine,
    chain: Chain<f64>,
    figure: Figure,
    balls: Balls,
    rounding: Rounding,
    legs: Vec<Leg>,
    rate: f64,
    linear: Vec<usize>,
    rotary: Vec<usize>,
    /// Commands at the start of the first leg.
    start: Vec<f64>,
    /// The bar's direction in the body that [`Figure::Rotary`] names.
    bar: Vec3<f64>,
    /// The circle's solution by all axes, where linear ones do not suffice.
    by_all: Option<AllAxes>,
}

impl Turning {
    /// Solves the start and tries the whole turn on the nominal machine. `held`: commands of the axes that the test does not
    /// move. `rate`: samples a second.
    ///
    /// # Errors
    /// [`Error::Motion`] where the machine has not the axes, or does not reach the path within its travel.
    pub fn new(
        machine: &Machine,
        figure: Figure,
        balls: Balls,
        held: &[f64],
        legs: Vec<Leg>,
        rate: f64,
        rounding: Rounding,
    ) -> Result<Turning> {
        let mut turning = Turning {
            machine: machine.clone(),
            chain: Chain::nominal(machine),
            figure,
            balls,
            rounding,
            legs,
            rate,
            linear: commands_of(machine, JointKind::Prismatic),
            rotary: commands_of(machine, JointKind::Revolute),
            start: held.to_vec(),
            bar: Vec3([0.0; 3]),
            by_all: None,
        };
        let Some(first) = turning.legs.first().map(|leg| leg.from) else {
            return Err(motion("the test has no leg", "ask for at least one turn"));
        };
        let starts = turning.starts(first)?;
        // Of several ways to start, the first that stays within travel all the way.
        let mut fault = None;
        for start in starts {
            turning.start = start;
            match turning.rehearse() {
                Ok(()) => return Ok(turning),
                Err(error) => fault = fault.or(Some(error)),
            }
        }
        Err(fault.unwrap_or_else(|| {
            motion(
                format!("no commands reach the start of the test, {}", At::Turn(first)),
                "choose another ball, length or inclination, or hold other axes elsewhere",
            )
        }))
    }

    /// Commands at the start of the first leg.
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// The balls.
    pub fn balls(&self) -> &Balls {
        &self.balls
    }

    fn starts(&mut self, first: f64) -> Result<Vec<Vec<f64>>> {
        if !matches!(self.figure, Figure::Circle { .. }) && self.linear.is_empty() {
            return Err(motion(
                "the machine has no linear axis that could follow the rotary motion",
                "run a circle (`circle`) or random poses (`poses`) instead",
            ));
        }
        match self.figure.clone() {
            Figure::Cone { reversed, .. } => {
                let Ok(rotary) = <[usize; 2]>::try_from(self.rotary.clone()) else {
                    let count = self.rotary.len();
                    return Err(motion(
                        format!("a cone frustum needs two rotary axes, this machine has {count}"),
                        "run a test of one rotary axis (`rotary`), a circle or random poses instead",
                    ));
                };
                let Bar { tool, .. } = self.cone(first);
                let mut starts = every_aim(&self.chain, &self.machine, rotary, tool, &self.start);
                if reversed {
                    starts.iter_mut().for_each(|q| rotary.iter().for_each(|c| q[*c] = -q[*c]));
                }
                Ok(starts)
            }
            Figure::Waves { waves, .. } => {
                let mut start = self.start.clone();
                waves.iter().for_each(|wave| start[wave.command] = wave.at(first));
                Ok(vec![start])
            }
            Figure::Rotary { command, pointing, turns } => {
                let mut start = self.start.clone();
                start[command] = first;
                // Where the axes stand still first: the bar's direction belongs to the start.
                self.bar = self.bar_at_start(&start, command, pointing, turns)?;
                Ok(vec![start])
            }
            Figure::Circle { plane_w, tool_axis_w } => {
                let mut start = self.start.clone();
                let far = [0.0, 1.0, 2.0, 3.0].map(|quarter| {
                    let u = first + quarter * std::f64::consts::FRAC_PI_2;
                    follow(
                        &self.chain,
                        &self.machine,
                        &self.linear,
                        self.balls.tool_point_t,
                        self.circle(plane_w, u),
                        &mut start,
                    )
                });
                if far.into_iter().all(|left| left < CLOSED) {
                    return Ok(vec![self.start.clone()]);
                }
                if self.rotary.is_empty() {
                    self.go(first, first + std::f64::consts::FRAC_PI_2, &mut start)?;
                }
                let axes = AllAxes::new(&self.machine);
                self.by_all = Some(axes.clone());
                if self.balls.tool_point_t.0[..2] != [0.0, 0.0] {
                    return Err(motion(
                        "with all joints, a circle is solved for a tool ball on the z axis of frame t only",
                        "give the tool ball as 0,0,Z",
                    ));
                }
                let (p_w, chain) =
                    (self.tool_frame_target(self.circle(plane_w, first), tool_axis_w), &self.chain);
                let tries = std::iter::once(self.start.clone()).chain(random_commands(&self.machine, 60, 1));
                let reached = tries.filter_map(|from| axes.at(chain, p_w?, tool_axis_w, &from));
                let inside = |q: &Vec<f64>| within_travel(&self.machine, q, At::Turn(first)).is_ok();
                Ok(reached.filter(inside).take(8).collect())
            }
        }
    }

    /// Where frame `t` must stand so that its ball stands at `target_w`, for balls on the tool's own axis.
    fn tool_frame_target(&self, target_w: Vec3<f64>, axis_w: Vec3<f64>) -> Option<Vec3<f64>> {
        let [x, y, z] = self.balls.tool_point_t.0;
        (x == 0.0 && y == 0.0).then(|| target_w - axis_w.times(z))
    }

    fn circle(&self, [first, second]: [Vec3<f64>; 2], u: f64) -> Vec3<f64> {
        let direction = self.rounded(first.times(u.cos()) + second.times(u.sin()));
        self.balls.workpiece_point_w + direction.times(self.balls.length)
    }

    /// Directions on the cone at `u`.
    fn cone(&self, u: f64) -> Bar {
        let (half_apex, inclination, lead) = match self.figure {
            Figure::Cone { half_apex, inclination, lead, .. } => (half_apex, inclination, lead),
            Figure::Waves { half_apex, inclination, .. } => (half_apex, inclination, 0.0),
            _ => (0.0, 0.0, 0.0),
        };
        let (sin, cos) = inclination.sin_cos();
        let (e, n) = (Vec3([0.0, -sin, cos]), Vec3([0.0, cos, sin]));
        let m = |u: f64| n.times(u.cos()) + Vec3([u.sin(), 0.0, 0.0]);
        let (sin, cos) = half_apex.sin_cos();
        Bar { bar: self.rounded(e.times(sin) + m(u).times(cos)), tool: e.times(cos) - m(u + lead).times(sin) }
    }

    /// Where the tool ball stands at the end of a bar along `direction`.
    fn end_of_bar(&self, direction: Vec3<f64>, tool_centre_point: bool, q: &[f64]) -> Vec3<f64> {
        let direction = match tool_centre_point {
            true => direction,
            // The bar keeps its direction in the base: what it was with all axes at zero.
            false => {
                let b_from_w = |q: &[f64]| self.chain.sweep(q).b_from_w().rotation;
                b_from_w(q).transpose() * (b_from_w(&vec![0.0; q.len()]) * direction)
            }
        };
        self.balls.workpiece_point_w + direction.times(self.balls.length)
    }

    fn rounded(&self, direction: Vec3<f64>) -> Vec3<f64> {
        match self.rounding.direction_decimals {
            None => direction,
            Some(decimals) => {
                let scale = 10f64.powi(decimals as i32);
                Vec3(direction.0.map(|x| (x * scale).round() / scale))
            }
        }
    }

    /// Rotation of the body that carries the bar of [`Figure::Rotary`], in frame `w`.
    fn body_in_w(&self, command: usize, turns: bool, q: &[f64]) -> Mat3<f64> {
        let on_tool = self.branch(command) == Branch::Tool;
        if on_tool == turns { self.chain.w_from_t(q).rotation } else { Mat3::identity(0.0) }
    }

    fn dyad(&self, command: usize) -> usize {
        let name = &self.machine.commands()[command];
        let own = self.machine.joints().find(|(_, joint)| joint.name == *name);
        own.map_or(0, |(j, _)| j)
    }

    fn branch(&self, command: usize) -> Branch {
        self.machine.branch(self.dyad(command))
    }

    fn bar_at_start(&self, q: &[f64], command: usize, pointing: Pointing, turns: bool) -> Result<Vec3<f64>> {
        let sweep = self.chain.sweep(q);
        let j = self.dyad(command);
        let Some(joint) = &self.machine.dyads()[j].joint else {
            return Err(motion("this axis has no joint of its own", "name another axis"));
        };
        let w_from_b = sweep.b_from_w().inverse();
        let w_from_frame = w_from_b * sweep.b_from_frame(j);
        let (axis, origin) = (w_from_frame.rotation * joint.axis, w_from_frame.translation);
        // The ball on the body that the axis turns.
        let (ball, body) = match self.branch(command) {
            Branch::Workpiece => (self.balls.workpiece_point_w, Mat3::identity(0.0)),
            Branch::Tool => (sweep.w_from_t().transform(self.balls.tool_point_t), sweep.w_from_t().rotation),
        };
        let square = |p: Vec3<f64>| p - axis.times(axis.dot(p));
        let mut radial = square(ball - origin);
        if radial.norm() < 1e-6 {
            // The ball is on the axis: any direction will do, that of the body's own axes is one to remember.
            let columns = [0, 1, 2].map(|k| square(body.column(k)));
            radial = columns.into_iter().find(|c| c.norm() > 0.5).unwrap_or(columns[0]);
        }
        let radial = radial.times(radial.norm().recip());
        let direction_w = match pointing {
            Pointing::Radial => radial,
            Pointing::Tangential => axis.cross(radial),
            Pointing::Axial => axis,
        };
        Ok(self.body_in_w(command, turns, q).transpose() * direction_w)
    }

    /// Commands at `u`, from those nearby in `q`; what is left of the gap, m.
    fn solve(&self, u: f64, q: &mut Vec<f64>) -> Result<f64> {
        let (machine, chain, balls) = (&self.machine, &self.chain, &self.balls);
        let target = match &self.figure {
            Figure::Circle { plane_w, tool_axis_w } => {
                let target = self.circle(*plane_w, u);
                if let Some(axes) = &self.by_all {
                    let p_w = self.tool_frame_target(target, *tool_axis_w);
                    let reached = p_w.and_then(|p_w| axes.at(chain, p_w, *tool_axis_w, q));
                    *q = reached.ok_or_else(|| unreached(u))?;
                    return Ok(0.0);
                }
                target
            }
            Figure::Rotary { command, turns, .. } => {
                q[*command] = self.to_step(u);
                let bar_w = self.body_in_w(*command, *turns, q) * self.bar;
                balls.workpiece_point_w + self.rounded(bar_w).times(balls.length)
            }
            Figure::Cone { tool_centre_point, reversed, .. } => {
                let Bar { bar, tool } = self.cone(u);
                let rotary = [self.rotary[0], self.rotary[1]];
                let turn =
                    |q: &mut Vec<f64>| rotary.iter().filter(|_| *reversed).for_each(|c| q[*c] = -q[*c]);
                turn(q);
                if !aim(chain, machine, rotary, tool, q) {
                    return Err(unreached(u));
                }
                turn(q);
                rotary.iter().for_each(|c| q[*c] = self.to_step(q[*c]));
                self.end_of_bar(bar, *tool_centre_point, q)
            }
            Figure::Waves { waves, tool_centre_point, .. } => {
                waves.iter().for_each(|wave| q[wave.command] = self.to_step(wave.at(u)));
                self.end_of_bar(self.cone(u).bar, *tool_centre_point, q)
            }
        };
        Ok(follow(chain, machine, &self.linear, balls.tool_point_t, target, q))
    }

    fn to_step(&self, angle: f64) -> f64 {
        match self.rounding.rotary_step {
            Some(step) => (angle / step).round() * step,
            None => angle,
        }
    }

    /// Goes from one angle to the next in short strides, so that the solution stays on its branch.
    fn go(&self, from: f64, to: f64, q: &mut Vec<f64>) -> Result<()> {
        let strides = ((to - from).abs() / STRIDE).ceil().max(1.0) as usize;
        for k in 1..=strides {
            let u = if k == strides { to } else { from + (to - from) * k as f64 / strides as f64 };
            let before = q.clone();
            let left = self.solve(u, q)?;
            if left > CLOSED {
                let names: Vec<&str> =
                    self.linear.iter().map(|c| self.machine.commands()[*c].as_str()).collect();
                return Err(motion(
                    format!(
                        "the linear axes ({}) cannot follow: {:.3} mm of the way are left {}",
                        names.join(", "),
                        left * 1e3,
                        At::Turn(u)
                    ),
                    "choose a plane, an axis or a ball for which these axes suffice",
                ));
            }
            let turned = self.rotary.iter().map(|c| (q[*c] - before[*c]).abs()).fold(0.0, f64::max);
            if turned > 0.6 && to != from {
                return Err(motion(
                    format!(
                        "the rotary axes would have to jump by {:.0} deg {}",
                        turned.to_degrees(),
                        At::Turn(u)
                    ),
                    "the path passes a pose in which the tool is along a rotary axis; choose another inclination or apex angle",
                ));
            }
            within_travel(&self.machine, q, At::Turn(u))?;
        }
        Ok(())
    }

    /// Tries the whole turn coarsely; the start is completed on the way.
    fn rehearse(&mut self) -> Result<()> {
        let first = self.legs[0].from;
        let mut q = self.start.clone();
        self.go(first, first, &mut q)?;
        self.start = q.clone();
        let legs = self.legs.iter().map(|leg| (leg.from, leg.to));
        let (lowest, highest) =
            legs.fold((first, first), |(l, h), (a, b)| (l.min(a).min(b), h.max(a).max(b)));
        for end in [lowest, highest] {
            let mut q = self.start.clone();
            self.go(first, end, &mut q)?;
        }
        Ok(())
    }
}

/// Directions in frame `w`.
struct Bar {
    bar: Vec3<f64>,
    tool: Vec3<f64>,
}

impl Course for Turning {
    fn samples(&self) -> Result<Samples<'_>> {
        let mut q = self.start.clone();
        let mut last = self.legs[0].from;
        let mut failed = false;
        Ok(Box::new(ticks(&self.legs, self.rate).map_while(move |(time, u, recorded)| {
            if failed {
                return None;
            }
            let gone = self.go(last, u, &mut q);
            last = u;
            failed = gone.is_err();
            Some(gone.map(|()| Sample { time, q: q.clone(), directions: None, recorded, at: At::Turn(u) }))
        })))
    }
}

fn motion(what: impl Into<String>, mend: impl Into<String>) -> Error {
    Error::Motion { what: what.into(), mend: mend.into() }
}

fn unreached(u: f64) -> Error {
    motion(
        format!("no commands reach the path {}", At::Turn(u)),
        "choose another ball, length or inclination, or hold other axes elsewhere",
    )
}

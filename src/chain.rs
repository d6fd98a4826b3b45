//! Kinematics of a machine with given deviations: poses, and the rows of every Jacobian in one sweep.
//!
//! A [`Chain`] is a machine whose constant part, `M_j exp(dh_j)`, has been multiplied out once. A [`Sweep`] is that chain at one
//! vector of commands; from it come poses and, by carrying one wrench along the chain, the row of any scalar measurement.

use std::sync::OnceLock;

use crate::few::Few;
use crate::lie::{Pose, Twist, Vec3, Wrench};
use crate::machine::{Branch, Drive, JointKind, Machine};
use crate::scalar::Scalar;

mod batch;
mod path;

pub use batch::Batch;
pub(crate) use path::{Moved, Path, Row};

/// A machine with constant deviations, ready to be evaluated. Generic over the scalar: the production code and the autodiff
/// check run the same functions.
#[derive(Clone, Debug)]
pub struct Chain<S> {
    links: Vec<Link<S>>,
    workpiece_count: usize,
    /// Laid out when it is first asked for; of a chain of numbers alone.
    path: OnceLock<Path>,
}

#[derive(Clone, Debug)]
struct Link<S> {
    /// `M_j exp(dh_j)`.
    previous_from_frame: Pose<S>,
    joint: Option<(JointKind, Vec3<f64>, Drive)>,
    /// `exp(e_j)`, the error motion of what the joint carries.
    carried: Option<Pose<S>>,
}

/// A chain at one vector of commands.
#[derive(Clone, Debug)]
pub struct Sweep<S> {
    /// Pose of each dyad's frame in the base, before its joint has moved, machine order.
    b_from_frame: Vec<Pose<S>>,
    /// The same behind the joint and its carried deviation.
    b_from_carried: Vec<Pose<S>>,
    b_from_w: Pose<S>,
    b_from_t: Pose<S>,
    workpiece_count: usize,
}

impl Chain<f64> {
    /// The machine as it is declared.
    pub fn nominal(machine: &Machine) -> Self {
        Self::new(machine, &vec![Twist::zero(0.0); machine.dyads().len()])
    }

    /// [`Chain::w_from_t`], for a chain that is asked many times.
    pub(crate) fn tool_pose(&self, q: &[f64]) -> Pose<f64> {
        self.path().pose_at(q)
    }

    /// Where a point of frame `t` is in frame `w`, m, for a chain that is asked many times.
    pub(crate) fn tool_point(&self, q: &[f64], p_t: Vec3<f64>) -> Vec3<f64> {
        self.path().point_at(q, p_t)
    }

    /// [`Chain::tool_point`] at several rows of commands.
    pub(crate) fn tool_points<const N: usize>(&self, q: &[Few<f64>; N], p_t: Vec3<f64>) -> [Vec3<f64>; N] {
        self.path().points_at(q, p_t)
    }

    /// The way from the workpiece to the tool, laid out once.
    pub(crate) fn path(&self) -> &Path {
        self.path.get_or_init(|| Path::new(self))
    }
}

impl<S: Scalar> Chain<S> {
    /// The machine with deviations `dh`, one per dyad in machine order, each in its own frame: `M_j exp(dh_j)`, `docs/model.md` (10).
    ///
    /// # Panics
    /// If `deviations` has not one twist per dyad.
    pub fn new(machine: &Machine, deviations: &[Twist<S>]) -> Self {
        assert_eq!(deviations.len(), machine.dyads().len(), "one deviation per dyad");
        let link = |(j, dh): (usize, &Twist<S>)| {
            let dyad = &machine.dyads()[j];
            let nominal = dyad.placement.pose().lift(dh.v.0[0]);
            let joint = dyad.joint.as_ref().map(|joint| {
                let drive = machine.drive(j).expect("every joint has a drive").clone();
                (joint.kind, joint.axis, drive)
            });
            Link { previous_from_frame: nominal * Pose::exp(*dh), joint, carried: None }
        };
        Chain {
            links: deviations.iter().enumerate().map(link).collect(),
            workpiece_count: machine.workpiece_count(),
            path: OnceLock::new(),
        }
    }

    /// Replaces the whole initial pose of one frame, deviation included.
    pub fn set_previous_from_frame(&mut self, j: usize, previous_from_frame: Pose<S>) {
        self.links[j].previous_from_frame = previous_from_frame;
        self.path.take();
    }

    /// Takes every initial pose, deviations included, from a chain of the same machine; nothing is carried behind the joints.
    pub fn copy_frames(&mut self, from: &Chain<S>) {
        for (link, other) in self.links.iter_mut().zip(&from.links) {
            link.previous_from_frame = other.previous_from_frame;
            link.carried = None;
        }
        self.path.take();
    }

    /// Puts a deviation behind the joint of dyad `j`: `T = M_j exp(dh_j) exp(xi_j q_j) exp(e_j)`, `docs/model.md` (30).
    pub fn set_carried(&mut self, j: usize, carried: Pose<S>) {
        self.links[j].carried = Some(carried);
        self.path.take();
    }

    /// `M_j exp(dh_j)` of dyad `j`.
    pub fn previous_from_frame(&self, j: usize) -> Pose<S> {
        self.links[j].previous_from_frame
    }

    /// The chain at the commands `q` (m or rad, machine order), `docs/model.md` (9), (10).
    pub fn sweep(&self, q: &[S]) -> Sweep<S> {
        let mut sweep = Sweep {
            b_from_frame: Vec::with_capacity(self.links.len()),
            b_from_carried: Vec::with_capacity(self.links.len()),
            b_from_w: self.links[0].previous_from_frame,
            b_from_t: self.links[0].previous_from_frame,
            workpiece_count: self.workpiece_count,
        };
        self.sweep_into(q, &mut sweep);
        sweep
    }

    /// As [`Chain::sweep`], into memory that is used again.
    pub fn sweep_into(&self, q: &[S], sweep: &mut Sweep<S>) {
        sweep.b_from_frame.clear();
        sweep.b_from_carried.clear();
        let like = q[0];
        let mut behind = Pose::identity(like);
        for (j, link) in self.links.iter().enumerate() {
            if j == self.workpiece_count {
                sweep.b_from_w = behind;
            }
            let b_from_frame = match j == 0 || j == self.workpiece_count {
                true => link.previous_from_frame,
                false => behind * link.previous_from_frame,
            };
            sweep.b_from_frame.push(b_from_frame);
            behind = link.behind(b_from_frame, q);
            sweep.b_from_carried.push(behind);
        }
        sweep.b_from_t = behind;
    }

    /// `w_from_t` at the commands `q`, `docs/model.md` (10).
    pub fn w_from_t(&self, q: &[S]) -> Pose<S> {
        let (workpiece, tool) = self.links.split_at(self.workpiece_count);
        let end = |links: &[Link<S>]| match links {
            [first, others @ ..] => {
                others.iter().fold(first.behind(first.previous_from_frame, q), |behind, link| {
                    link.behind(behind * link.previous_from_frame, q)
                })
            }
            [] => Pose::identity(q[0]),
        };
        end(workpiece).inverse() * end(tool)
    }
}

impl<S: Scalar> Link<S> {
    /// The pose behind the joint and what it carries, from that of the frame.
    #[inline(always)]
    fn behind(&self, b_from_frame: Pose<S>, q: &[S]) -> Pose<S> {
        let behind = match &self.joint {
            None => b_from_frame,
            Some((kind, axis, drive)) => moved(b_from_frame, *kind, *axis, displacement(drive, q)),
        };
        match &self.carried {
            Some(carried) => behind * *carried,
            None => behind,
        }
    }
}

/// A frame and behind it `exp(xi q)` of one joint, `docs/model.md` (8). Along a coordinate axis that takes two columns.
#[inline(always)]
fn moved<S: Scalar>(frame: Pose<S>, kind: JointKind, axis: Vec3<f64>, displacement: S) -> Pose<S> {
    match (kind, axis.0.map(f64::abs)) {
        (JointKind::Prismatic, _) => {
            let way = frame.rotation * axis.lift(displacement).times(displacement);
            Pose { rotation: frame.rotation, translation: frame.translation + way }
        }
        (_, [1.0, _, _]) => turned::<1, 2, S>(frame, displacement.scale(axis.0[0])),
        (_, [_, 1.0, _]) => turned::<2, 0, S>(frame, displacement.scale(axis.0[1])),
        (_, [_, _, 1.0]) => turned::<0, 1, S>(frame, displacement.scale(axis.0[2])),
        _ => frame * Pose::turn(axis, displacement),
    }
}

/// A frame turned about its axis that comes before its axes `A` and `B`.
#[inline(always)]
fn turned<const A: usize, const B: usize, S: Scalar>(frame: Pose<S>, angle: S) -> Pose<S> {
    let (sine, cosine) = angle.sin_cos();
    let mut rotation = frame.rotation;
    for row in &mut rotation.0 {
        let (a, b) = (row[A], row[B]);
        row[A] = a * cosine + b * sine;
        row[B] = b * cosine - a * sine;
    }
    Pose { rotation, translation: frame.translation }
}

/// `s = Σ factor × command`, `docs/model.md` (9).
#[inline(always)]
fn displacement<S: Scalar>(drive: &Drive, q: &[S]) -> S {
    let mut sum = q[0].lift(0.0);
    for (command, factor) in &drive.terms {
        sum = sum + q[*command].scale(*factor);
    }
    sum
}

impl<S: Scalar> Sweep<S> {
    /// Pose of the tool frame in the workpiece frame.
    #[inline(always)]
    pub fn w_from_t(&self) -> Pose<S> {
        self.b_from_w.inverse() * self.b_from_t
    }

    /// Pose of the workpiece frame in the base.
    pub fn b_from_w(&self) -> Pose<S> {
        self.b_from_w
    }

    /// Pose of the tool frame in the base.
    pub fn b_from_t(&self) -> Pose<S> {
        self.b_from_t
    }

    /// Pose of dyad `j`'s frame in the base, before its joint has moved.
    pub fn b_from_frame(&self, j: usize) -> Pose<S> {
        self.b_from_frame[j]
    }

    /// `s_j` of dyad `j`.
    #[inline(always)]
    fn sign(&self, j: usize) -> f64 {
        if j < self.workpiece_count { Branch::Workpiece.sign() } else { Branch::Tool.sign() }
    }

    /// The row of a scalar measurement over all deviations, six numbers per dyad in machine order, `docs/model.md` (14).
    ///
    /// `y_w`: what the measurement does with a small twist of the tool seen from the workpiece, in frame `w` about its origin.
    /// Each block is that wrench seen from the dyad's own frame, with the sign of its branch; it is the derivative by an
    /// increment `exp(δ)` behind `exp(dh)`. See [`deviation_jacobian`] for the derivative by `dh` itself.
    #[inline]
    pub fn error_row(&self, y_w: Wrench<S>, row: &mut [S]) {
        let y_b = self.b_from_w.inverse().carry_wrench(y_w);
        for (j, b_from_frame) in self.b_from_frame.iter().enumerate() {
            let block = b_from_frame.carry_wrench(y_b).to_array();
            let sign = self.sign(j);
            for (k, value) in block.into_iter().enumerate() {
                row[6 * j + k] = value.scale(sign);
            }
        }
    }

    /// The block of a deviation behind the joint of dyad `j`, as [`Sweep::error_row`] gives those before the joint.
    #[inline]
    pub fn carried_block(&self, j: usize, y_w: Wrench<S>) -> [S; 6] {
        let y_b = self.b_from_w.inverse().carry_wrench(y_w);
        self.b_from_carried[j].carry_wrench(y_b).to_array().map(|x| x.scale(self.sign(j)))
    }

    /// The row of a scalar measurement over the commands, `docs/model.md` (13).
    pub fn command_row(&self, machine: &Machine, y_w: Wrench<S>, row: &mut [S]) {
        let y_b = self.b_from_w.inverse().carry_wrench(y_w);
        row.iter_mut().for_each(|value| *value = value.lift(0.0));
        for (j, joint) in machine.joints() {
            let xi = joint.twist().lift(y_w.f.0[0]);
            let by_displacement = self.b_from_frame[j].carry_wrench(y_b).dot(xi).scale(self.sign(j));
            for (command, factor) in &machine.drive(j).expect("every joint has a drive").terms {
                row[*command] = row[*command] + by_displacement.scale(*factor);
            }
        }
    }
}

/// Derivative of an increment behind `exp(dh)` by `dh`: the right Jacobian, `docs/model.md` (12).
///
/// Six numbers of an error row times this matrix are the derivative by the deviation's own coordinates. It is constant over a
/// recording, so that rows stay rows of increments and only sums over them are turned.
pub fn deviation_jacobian<S: Scalar>(dh: Twist<S>) -> [[S; 6]; 6] {
    dh.right_jacobian().to_array()
}

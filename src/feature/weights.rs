//! What weighs on the joints: torques, moments and forces by gravity, from masses that are known and from those that are not.

use super::{Expression, JointSamples};
use crate::chain::{Chain, Sweep};
use crate::lie::{Pose, Vec3};
use crate::machine::{Branch, JointKind, Machine};
use crate::recording::Recording;

/// Standard acceleration of gravity, m/s².
const GRAVITY: f64 = 9.806_65;
/// What an upright axis bears about itself is rounding and counts as nothing, Nm or N.
const ROUNDING: f64 = 1e-9;
/// Columns of [`JointSamples::weights`] before the levers: three moments and how they change along the axis.
const MOMENTS: usize = 6;

/// Column of the moment about a direction.
pub(super) fn moment(n: u8) -> usize {
    usize::from(n.min(2))
}

/// Column of its change along the axis.
pub(super) fn shear(n: u8) -> usize {
    3 + usize::from(n.min(2))
}

/// Column of a lever; `None` where no joint is that far beyond, or a linear joint has no second direction.
pub(super) fn lever(machine: &Machine, own: usize, k: u8, n: u8) -> Option<usize> {
    let wanted = (usize::from(k), usize::from(n));
    levers(machine, own).position(|(place, _, direction)| (place, direction) == wanted).map(|i| MOMENTS + i)
}

/// The expression that binds to a column.
pub(super) fn expression(machine: &Machine, own: usize, column: usize) -> Expression {
    match column {
        0..3 => Expression::Moment(column as u8),
        3..MOMENTS => Expression::Shear((column - 3) as u8),
        _ => {
            let found = levers(machine, own).nth(column - MOMENTS);
            found.map_or(Expression::Number(0.0), |(k, _, n)| Expression::Lever(k as u8, n as u8))
        }
    }
}

/// Joints from the own one on: how far beyond, dyad, direction. First moments along the axis of a joint belong to what carries it, and
/// say nothing about a joint that slides.
fn levers(machine: &Machine, own: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    let kind = move |j: usize| machine.dyads()[j].joint.as_ref().map(|joint| joint.kind);
    let end = match machine.branch(own) {
        Branch::Workpiece => machine.workpiece_count(),
        Branch::Tool => machine.dyads().len(),
    };
    let end = if kind(own) == Some(JointKind::Revolute) { end } else { own };
    let joints = (own..end).filter(move |j| kind(*j).is_some()).enumerate();
    joints.flat_map(move |(k, j)| {
        let directions = if kind(j) == Some(JointKind::Revolute) { 2 } else { 1 };
        (0..directions).map(move |n| (k, j, n))
    })
}

/// Direction of gravity in the base frame, where the recording states it in frame `w`: that frame, all joints at zero, stands where
/// `previous_from_w` says, or else where the machine file has it.
pub fn gravity_of(
    recording: &Recording,
    machine: &Machine,
    previous_from_w: Option<Pose<f64>>,
) -> Option<Vec3<f64>> {
    let gravity_w = recording.header().gravity_w?;
    let mut chain = Chain::nominal(machine);
    if let Some(previous_from_w) = previous_from_w {
        chain.set_previous_from_frame(machine.w_index(), previous_from_w);
    }
    let home = chain.sweep(&vec![0.0; machine.commands().len()]);
    Some(home.b_from_w().rotation * gravity_w)
}

/// A machine with its masses, under gravity.
#[derive(Clone)]
pub(super) struct Weights {
    chain: Chain<f64>,
    g_b: Vec3<f64>,
    /// Mass and its place behind the joint, by dyad; stated and substitute.
    masses: Vec<Vec<(usize, f64, Vec3<f64>)>>,
    /// Levers of every joint: dyad and direction in its frame.
    levers: Vec<Vec<(usize, Vec3<f64>)>>,
}

impl Weights {
    pub fn new(machine: &Machine, gravity_b: Option<Vec3<f64>>) -> Self {
        let chain = Chain::nominal(machine);
        let g_b = gravity_b.unwrap_or(machine.gravity_b());
        let dyads = machine.dyads();
        let beyond = |j: usize| {
            let end =
                if machine.branch(j) == Branch::Workpiece { machine.workpiece_count() } else { dyads.len() };
            let stated: Vec<_> = (j..end)
                .filter_map(|k| dyads[k].mass.map(|m| (k, m.mass, m.centre)))
                .filter(|m| m.1 > 0.0)
                .collect();
            match stated.is_empty() {
                true => (j + 1..end).map(|k| (k, 1.0, Vec3([0.0; 3]))).collect(),
                false => stated,
            }
        };
        let direction = |j: usize, n: usize| match &dyads[j].joint {
            Some(joint) if joint.kind == JointKind::Prismatic => (j, joint.axis),
            Some(joint) => (j, joint.axis.across()[n]),
            None => (j, Vec3([0.0; 3])),
        };
        let of = |own: usize| match dyads[own].joint {
            Some(_) => levers(machine, own).map(|(_, j, n)| direction(j, n)).collect(),
            None => Vec::new(),
        };
        Weights {
            chain,
            g_b: g_b.times(GRAVITY),
            masses: (0..dyads.len()).map(beyond).collect(),
            levers: (0..dyads.len()).map(of).collect(),
        }
    }

    /// Poses of all frames, to be filled by [`Weights::sweep_into`].
    pub fn sweep(&self, q: &[f64]) -> Sweep<f64> {
        self.chain.sweep(q)
    }

    /// Poses of all frames at these commands.
    pub fn sweep_into(&self, q: &[f64], sweep: &mut Sweep<f64>) {
        self.chain.sweep_into(q, sweep);
    }

    /// Puts what weighs on the joint of dyad `j` behind its columns.
    pub fn put(
        &self,
        machine: &Machine,
        sweep: &Sweep<f64>,
        displacements: &[f64],
        j: usize,
        columns: &mut JointSamples,
    ) {
        let Some(joint) = &machine.dyads()[j].joint else { return };
        let b_from_j = sweep.b_from_frame(j);
        let n_b = b_from_j.rotation * joint.axis;
        let behind = |k: usize| match &machine.dyads()[k].joint {
            Some(joint) => sweep.b_from_frame(k) * Pose::exp(joint.twist().times(displacements[k])),
            None => sweep.b_from_frame(k),
        };
        let (mut mass, mut moment_b) = (0.0, Vec3([0.0; 3]));
        for (k, m, centre) in &self.masses[j] {
            let arm_b = behind(*k).transform(*centre) - b_from_j.translation;
            mass += m;
            moment_b = moment_b + arm_b.cross(self.g_b).times(*m);
        }
        let end = match machine.branch(j) {
            Branch::Workpiece => sweep.b_from_w(),
            Branch::Tool => sweep.b_from_t(),
        };
        let (gravity, load) = match joint.kind {
            JointKind::Prismatic => (mass * n_b.dot(self.g_b), n_b.dot(self.g_b)),
            JointKind::Revolute => {
                let load = n_b.dot((end.translation - b_from_j.translation).cross(self.g_b));
                (n_b.dot(moment_b), load)
            }
        };
        columns.gravity.push(gravity);
        columns.load.push(load);
        let [first, second] = joint.axis.across();
        let directions = [first, second, joint.axis].map(|d| b_from_j.rotation * d);
        // A point further along the axis has arms that are shorter by as much.
        let shear_b = n_b.cross(self.g_b).times(-mass);
        let moments = directions.iter().map(|d| d.dot(moment_b));
        let shears = directions.iter().map(|d| d.dot(shear_b));
        let levers = self.levers[j].iter().map(|(k, direction)| {
            let slides =
                matches!(&machine.dyads()[*k].joint, Some(joint) if joint.kind == JointKind::Prismatic);
            let arm = if slides { direction.times(displacements[*k]) } else { *direction };
            n_b.dot((behind(*k).rotation * arm).cross(self.g_b))
        });
        columns.weights.resize(MOMENTS + self.levers[j].len(), Vec::new());
        let all = moments.chain(shears).chain(levers);
        columns
            .weights
            .iter_mut()
            .zip(all)
            .for_each(|(c, x)| c.push(if x.abs() < ROUNDING { 0.0 } else { x }));
    }
}

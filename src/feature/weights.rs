//! What weighs on the joints: torques, moments and forces by gravity, from masses that are known and from those that are not.

use super::{Expression, JointSamples};
use crate::chain::{Chain, Sweep};
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::{Branch, Dyad, JointKind, Machine, SideBranch};
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

/// A body that weighs on a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Body {
    /// What a dyad of the chain moves, by index.
    Chain(usize),
    /// What a dyad of a side branch moves, by index among those of all side branches.
    Side(usize),
}

/// Joints from the own one on, then those of the side branches that it carries: how far beyond, body, direction. First moments along
/// the axis of a joint belong to what carries it, and say nothing about a joint that slides.
fn levers(machine: &Machine, own: usize) -> impl Iterator<Item = (usize, Body, usize)> {
    let kind = move |body: Body| dyad_of(machine, body).joint.as_ref().map(|joint| joint.kind);
    let bodies =
        if kind(Body::Chain(own)) == Some(JointKind::Revolute) { carried(machine, own) } else { Vec::new() };
    let joints = bodies.into_iter().filter(move |body| kind(*body).is_some()).enumerate();
    joints.flat_map(move |(k, body)| {
        let directions = if kind(body) == Some(JointKind::Revolute) { 2 } else { 1 };
        (0..directions).map(move |n| (k, body, n))
    })
}

/// What a joint carries: dyads from its own on, then those of side branches.
fn carried(machine: &Machine, own: usize) -> Vec<Body> {
    let end = match machine.branch(own) {
        Branch::Workpiece => machine.workpiece_count(),
        Branch::Tool => machine.dyads().len(),
    };
    let mut bodies: Vec<Body> = (own..end).map(Body::Chain).collect();
    let mut first = 0;
    for side in machine.side_branches() {
        if machine.carries(own, side) {
            bodies.extend((first..first + side.dyads.len()).map(Body::Side));
        }
        first += side.dyads.len();
    }
    bodies
}

fn dyad_of(machine: &Machine, body: Body) -> &Dyad {
    match body {
        Body::Chain(j) => &machine.dyads()[j],
        Body::Side(i) => machine
            .side_branches()
            .iter()
            .flat_map(|side| &side.dyads)
            .nth(i)
            .expect("a dyad of a side branch"),
    }
}

/// Columns that a recording needs to say how the side branches stand that a joint carries: name and unit.
pub(super) fn columns(machine: &Machine, own: usize) -> Vec<(String, String)> {
    let sides = machine.side_branches().iter().filter(|side| machine.carries(own, side));
    sides.flat_map(SideBranch::columns).map(|(name, unit)| (name.into(), unit.into())).collect()
}

/// The machine as far as these recordings show it: without the side branches whose joints one of them has no column for. How those stood
/// is not known then, and their weight is not told from that of what carries them.
pub fn as_seen_in(machine: &Machine, recordings: &[Recording]) -> Machine {
    let has = |name: &str| recordings.iter().all(|r| r.extra_channels().iter().any(|c| c.name == name));
    let is_seen = |side: &&SideBranch| side.columns().all(|(name, _)| has(name));
    let sides = machine.side_branches().iter().filter(is_seen).cloned().collect();
    machine.clone().with_side_branches(sides).expect("side branches that the machine had")
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
    /// Dyads of the side branches.
    sides: Vec<SideDyad>,
    /// Mass and its place behind the joint, by dyad; stated and substitute.
    masses: Vec<Vec<(Body, f64, Vec3<f64>)>>,
    /// Levers of every joint: body and direction in its frame, and whether it slides that way.
    levers: Vec<Vec<(Body, Vec3<f64>, bool)>>,
}

#[derive(Clone)]
struct SideDyad {
    /// Dyad of the chain that carries it, where it is the first of its branch.
    on: Option<usize>,
    previous_from_frame: Pose<f64>,
    /// Twist of its joint, and the column that says where that stands.
    joint: Option<(Twist<f64>, String)>,
}

impl Weights {
    pub fn new(machine: &Machine, gravity_b: Option<Vec3<f64>>) -> Self {
        let chain = Chain::nominal(machine);
        let g_b = gravity_b.unwrap_or(machine.gravity_b());
        let dyads = machine.dyads();
        let beyond = |j: usize| {
            let bodies = carried(machine, j);
            let stated: Vec<_> = (bodies.iter())
                .filter_map(|body| dyad_of(machine, *body).mass.map(|m| (*body, m.mass, m.centre)))
                .filter(|m| m.1 > 0.0)
                .collect();
            match stated.is_empty() {
                true => bodies[1..].iter().map(|body| (*body, 1.0, Vec3([0.0; 3]))).collect(),
                false => stated,
            }
        };
        let direction = |body: Body, n: usize| match &dyad_of(machine, body).joint {
            Some(joint) if joint.kind == JointKind::Prismatic => (body, joint.axis, true),
            Some(joint) => (body, joint.axis.across()[n], false),
            None => (body, Vec3([0.0; 3]), false),
        };
        let of = |own: usize| match dyads[own].joint {
            Some(_) => levers(machine, own).map(|(_, body, n)| direction(body, n)).collect(),
            None => Vec::new(),
        };
        let side = |(i, on, dyad): (usize, Option<usize>, &Dyad)| SideDyad {
            on: on.filter(|_| i == 0),
            previous_from_frame: dyad.placement.pose(),
            joint: dyad.joint.as_ref().map(|joint| (joint.twist(), joint.name.clone())),
        };
        let sides = machine.side_branches().iter().flat_map(|branch| {
            let on = machine.frame_index(&branch.on);
            branch.dyads.iter().enumerate().map(move |(i, dyad)| side((i, on, dyad)))
        });
        Weights {
            chain,
            g_b: g_b.times(GRAVITY),
            sides: sides.collect(),
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

    /// Poses of what the dyads of side branches move, and how far their joints have; `of`: displacement by the name of its column, m or rad.
    pub fn sides(
        &self,
        machine: &Machine,
        sweep: &Sweep<f64>,
        displacements: &[f64],
        of: impl Fn(&str) -> f64,
    ) -> Vec<(Pose<f64>, f64)> {
        let mut b_from_previous = Pose::identity(0.0);
        let next = |side: &SideDyad| {
            if let Some(on) = side.on {
                b_from_previous = behind(machine, sweep, displacements, on);
            }
            b_from_previous = b_from_previous * side.previous_from_frame;
            let displacement = side.joint.as_ref().map_or(0.0, |(_, column)| of(column));
            if let Some((twist, _)) = &side.joint {
                b_from_previous = b_from_previous * Pose::exp(twist.times(displacement));
            }
            (b_from_previous, displacement)
        };
        self.sides.iter().map(next).collect()
    }

    /// Puts what weighs on the joint of dyad `j` behind its columns; `sides` from [`Weights::sides`].
    pub fn put(
        &self,
        machine: &Machine,
        (sweep, sides): (&Sweep<f64>, &[(Pose<f64>, f64)]),
        displacements: &[f64],
        j: usize,
        columns: &mut JointSamples,
    ) {
        let Some(joint) = &machine.dyads()[j].joint else { return };
        let b_from_j = sweep.b_from_frame(j);
        let n_b = b_from_j.rotation * joint.axis;
        let behind = |body: Body| match body {
            Body::Chain(k) => behind(machine, sweep, displacements, k),
            Body::Side(i) => sides[i].0,
        };
        let (mut mass, mut moment_b) = (0.0, Vec3([0.0; 3]));
        for (body, m, centre) in &self.masses[j] {
            let arm_b = behind(*body).transform(*centre) - b_from_j.translation;
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
        let levers = self.levers[j].iter().map(|(body, direction, slides)| {
            let by = match body {
                _ if !slides => 1.0,
                Body::Chain(k) => displacements[*k],
                Body::Side(i) => sides[*i].1,
            };
            n_b.dot((behind(*body).rotation * direction.times(by)).cross(self.g_b))
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

/// Pose of what the joint of dyad `k` moves.
fn behind(machine: &Machine, sweep: &Sweep<f64>, displacements: &[f64], k: usize) -> Pose<f64> {
    match &machine.dyads()[k].joint {
        Some(joint) => sweep.b_from_frame(k) * Pose::exp(joint.twist().times(displacements[k])),
        None => sweep.b_from_frame(k),
    }
}

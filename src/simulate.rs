//! Recordings of a machine whose deviations are known: for the demonstration and for recovery tests.

use std::fmt::Write;

use nalgebra::{DMatrix, DVector, SVD};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::check::random_command;
use crate::lie::{Mat3, Twist, Vec3, Wrench};
use crate::machine::{JointKind, Machine};
use crate::sensor::{Sensor, SensorState};

/// An instrument with its noise.
#[derive(Clone, Debug)]
pub struct Instrument {
    /// Kind.
    pub sensor: Sensor,
    /// Measured points, zero and length.
    pub state: SensorState<f64>,
    /// Standard deviation of a length reading, m.
    pub noise_m: f64,
    /// Standard deviation of an angle reading, rad.
    pub noise_rad: f64,
}

impl Instrument {
    /// Both measured points at their frames' origins, length and zero 0.
    pub fn new(sensor: Sensor, noise_m: f64, noise_rad: f64) -> Self {
        let origin = Vec3([0.0; 3]);
        let state = SensorState { tool_point_t: origin, workpiece_point_w: origin, length: 0.0, zero: 0.0 };
        Instrument { sensor, state, noise_m, noise_rad }
    }
}

/// Deviations of every dyad drawn from the machine's tolerances (normal), times `size`.
pub fn random_deviations(machine: &Machine, size: f64, seed: u64) -> Vec<Twist<f64>> {
    let mut rng = StdRng::seed_from_u64(seed);
    (0..machine.dyads().len())
        .map(|j| Twist::from_array(machine.tolerance(j).to_array().map(|t| size * t * normal(&mut rng))))
        .collect()
}

/// Random commands within the limits of every joint.
pub fn random_commands(machine: &Machine, count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = StdRng::seed_from_u64(seed);
    let one =
        |rng: &mut StdRng| (0..machine.commands().len()).map(|c| random_command(machine, c, rng)).collect();
    (0..count).map(|_| one(&mut rng)).collect()
}

/// A standard normal number (Box and Muller).
fn normal(rng: &mut StdRng) -> f64 {
    let u: f64 = rng.random_range(f64::MIN_POSITIVE..1.0);
    let v: f64 = rng.random_range(0.0..std::f64::consts::TAU);
    (-2.0 * u.ln()).sqrt() * v.cos()
}

/// A recording of `machine` in the form that kincal reads, in m and rad; `extra_header` goes in as it is, one line each.
pub fn recording(
    machine: &CalibratedMachine,
    instrument: &Instrument,
    commands: &[Vec<f64>],
    extra_header: &[String],
    seed: u64,
) -> String {
    let (chain, nominal) = (machine.chain(), machine.machine());
    let mut rng = StdRng::seed_from_u64(seed);
    let mut text = head(nominal, &instrument.sensor, extra_header);
    for (k, q) in commands.iter().enumerate() {
        let _ = write!(text, "{:.3}", k as f64 * 0.01);
        for x in q {
            let _ = write!(text, ",{x:.17}");
        }
        for value in read(machine, &chain, instrument, q, &mut rng) {
            let _ = write!(text, ",{value:.17}");
        }
        text.push('\n');
    }
    text
}

fn head(machine: &Machine, sensor: &Sensor, extra: &[String]) -> String {
    let unit = |kind: JointKind| if kind == JointKind::Prismatic { "m" } else { "rad" };
    let (kind, columns) = match sensor {
        Sensor::Distance { absolute: true } => ("distance", "r[m]".to_string()),
        Sensor::Distance { absolute: false } => ("distance", "d[m]".into()),
        Sensor::Position => ("position", "px[m],py[m],pz[m]".into()),
        Sensor::Pose => ("pose", "px[m],py[m],pz[m],rx[rad],ry[rad],rz[rad]".into()),
        Sensor::Displacement { .. } => ("displacement", "s[m]".into()),
        Sensor::Joint { dyad } => {
            let joint = machine.dyads()[*dyad].joint.as_ref().expect("a measured joint is a joint");
            ("joint", format!("{}_meas[{}]", joint.name, unit(joint.kind)))
        }
    };
    let mut text = format!("# machine: {}\n# measurement: {kind}\n", machine.name());
    if let Sensor::Displacement { direction_w: Vec3([x, y, z]) } = sensor {
        let _ = writeln!(text, "# direction: {x}, {y}, {z}");
    }
    extra.iter().for_each(|line| {
        let _ = writeln!(text, "# {line}");
    });
    text.push_str("t[s]");
    for (c, name) in machine.commands().iter().enumerate() {
        let _ = write!(text, ",{name}[{}]", unit(machine.command_joint(c).kind));
    }
    let _ = writeln!(text, ",{columns}");
    text
}

/// What the instrument reads, noise included.
fn read(
    machine: &CalibratedMachine,
    chain: &Chain<f64>,
    instrument: &Instrument,
    q: &[f64],
    rng: &mut StdRng,
) -> Vec<f64> {
    let nominal = machine.machine();
    if let Sensor::Joint { dyad } = instrument.sensor {
        let joint = nominal.dyads()[dyad].joint.as_ref().expect("a measured joint is a joint");
        let own = joint.twist();
        let dh = machine.deviations()[dyad];
        let noise =
            if joint.kind == JointKind::Prismatic { instrument.noise_m } else { instrument.noise_rad };
        let value =
            nominal.displacements(q)[dyad] + own.v.dot(dh.v) + own.w.dot(dh.w) + instrument.state.zero;
        return vec![value + noise * normal(rng)];
    }
    let sweep = chain.sweep(q);
    let (readings, count) = instrument.sensor.readings(&sweep, &instrument.state, Mat3::identity(0.0));
    let mut values: Vec<f64> =
        readings.iter().take(count.min(3)).map(|r| r.value + instrument.noise_m * normal(rng)).collect();
    if let Sensor::Pose = instrument.sensor {
        let shake = Twist::new(Vec3([0.0; 3]), Vec3([0, 1, 2].map(|_| instrument.noise_rad * normal(rng))));
        let noisy = crate::lie::Pose::exp(shake) * sweep.w_from_t();
        values.extend(noisy.rotation_vector().0);
    }
    values
}

/// Commands that bring the tool point to `p_w` and the tool's z axis along `axis_w` (unit vector), starting from `start`;
/// `None` where the machine cannot reach it.
pub fn inverse(
    chain: &Chain<f64>,
    machine: &Machine,
    p_w: Vec3<f64>,
    axis_w: Vec3<f64>,
    start: &[f64],
) -> Option<Vec<f64>> {
    let mut q = start.to_vec();
    let unit = |k: usize| Vec3(std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }));
    for _ in 0..60 {
        let sweep = chain.sweep(&q);
        let w_from_t = sweep.w_from_t();
        let (p, axis) = (w_from_t.translation, w_from_t.rotation.column(2));
        let (gap, turn) = (p_w - p, axis.cross(axis_w));
        // Opposite directions have no cross product either.
        let turned_round = axis.dot(axis_w) < 0.0;
        if gap.norm() < 1e-12 && turn.norm() < 1e-13 && !turned_round {
            return Some(q);
        }
        let mut matrix = DMatrix::zeros(6, q.len());
        let mut row = vec![0.0; q.len()];
        for k in 0..6 {
            // Position rows in m; axis rows are the turn that is missing, square to the axis.
            let wrench = if k < 3 {
                Wrench::at_point(unit(k), p)
            } else {
                let n = unit(k - 3);
                Wrench::couple(n - axis.times(axis.dot(n)))
            };
            sweep.command_row(machine, wrench, &mut row);
            row.iter().enumerate().for_each(|(c, x)| matrix[(k, c)] = *x);
        }
        let push = if turned_round { axis.cross(Vec3([0.36, 0.48, 0.8])) } else { turn };
        let wanted = DVector::from_iterator(6, gap.0.into_iter().chain(push.0));
        let step = SVD::new(matrix, true, true).solve(&wanted, 1e-9).ok()?;
        let longest = step.amax();
        let shorten = if longest > 0.5 { 0.5 / longest } else { 1.0 };
        q.iter_mut().zip(step.iter()).for_each(|(x, s)| *x += s * shorten);
    }
    None
}

/// A cone in the workpiece, ISO 10791-6 BK4 with a bar of `length` (m) from the workpiece origin to the tool point: half apex angle
/// 45°, axis inclined by `inclination` (rad); the tool's axis runs on the opposite side of the same cone, 60° ahead. `count` poses
/// in each sense of travel; `None` where the machine does not reach them.
pub fn cone(machine: &Machine, length: f64, inclination: f64, count: usize) -> Option<Vec<Vec<f64>>> {
    let chain = Chain::nominal(machine);
    let half = 0.5f64;
    let (sin, cos) = inclination.sin_cos();
    let (e, n) = (Vec3([0.0, -sin, cos]), Vec3([0.0, cos, sin]));
    // Where bar and tool turn in step, the bar stands still as the tool sees it and a good part of the errors with it: the tool
    // leads by 60°.
    let lead = std::f64::consts::FRAC_PI_3;
    let generator = |phi: f64| n.times(phi.cos()) + Vec3([phi.sin(), 0.0, 0.0]);
    let target = |phi: f64| {
        let (bar, tool) = (e + generator(phi), e - generator(phi + lead));
        (bar.times(length * half.sqrt()), tool.times(half.sqrt()))
    };
    let (p_w, axis_w) = target(0.0);
    let inside = |q: &[f64]| {
        (0..q.len()).all(|c| {
            let (from, to) = machine.travel(c);
            (from..=to).contains(&q[c])
        })
    };
    let starts = random_commands(machine, 200, 1);
    let first =
        starts.iter().filter_map(|start| inverse(&chain, machine, p_w, axis_w, start)).find(|q| inside(q))?;
    let mut path = vec![first];
    for k in 1..2 * count {
        let turn = if k < count { k as f64 } else { (2 * count - 1 - k) as f64 } / (count - 1) as f64;
        let (p_w, axis_w) = target(turn * std::f64::consts::TAU);
        let next = inverse(&chain, machine, p_w, axis_w, path.last()?)?;
        path.push(next);
    }
    Some(path)
}

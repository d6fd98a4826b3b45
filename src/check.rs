//! Every Jacobian of a machine against forward-mode autodiff: the referee of the kinematics.
//!
//! The production functions run once on `f64` for the analytic Jacobian and once on dual numbers for the derivative of the
//! readings themselves. Both must agree to rounding, at random poses with random deviations and exactly at zero.

use nalgebra::DMatrix;
use num_dual::{Dual64, DualSVec64};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};

use crate::chain::{Chain, deviation_jacobian};
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::{JointKind, Machine};
use crate::sensor::{MOST_READINGS, Sensor, SensorState};

/// Worst difference that passes, relative to the size of the block it stands in.
pub const PASS: f64 = 1e-12;

/// Result of one kind of Jacobian on one machine.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Check {
    /// What was measured: `pose`, `position`, `distance`, `displacement`, `joint`.
    pub measurement: String,
    /// `deviations` (error Jacobian), `commands` (joint Jacobian) or `tool point`.
    pub by: String,
    /// `nominal` (every deviation exactly zero), `small` (machine-tool sized) or `large` deviations.
    pub deviations: String,
    /// How many poses were compared.
    pub poses: usize,
    /// Largest difference, relative to the largest element of its block (one reading by one dyad).
    pub worst: f64,
}

impl Check {
    /// Whether the difference is rounding only.
    pub fn passes(&self) -> bool {
        self.worst <= PASS
    }
}

/// Compares every Jacobian of the machine with num-dual at `poses` random poses each; the same seed gives the same figures.
pub fn check(machine: &Machine, poses: usize, seed: u64) -> Vec<Check> {
    let mut rng = StdRng::seed_from_u64(seed);
    let mut checks = Vec::new();
    for (label, size) in [("nominal", 0.0), ("small", 1.0), ("large", 3e3)] {
        for sensor in sensors(machine) {
            let mut worst = [0.0f64; 3];
            for _ in 0..poses {
                let case = Case::random(machine, &sensor, size, &mut rng);
                for (worst, difference) in worst.iter_mut().zip(case.differences()) {
                    *worst = worst.max(difference);
                }
            }
            let is_joint = matches!(sensor, Sensor::Joint { .. });
            for (by, worst) in ["deviations", "commands", "tool point"].into_iter().zip(worst) {
                if is_joint && by == "tool point" {
                    continue;
                }
                checks.push(Check {
                    measurement: sensor.name().into(),
                    by: by.into(),
                    deviations: label.into(),
                    poses,
                    worst,
                });
            }
        }
    }
    checks
}

fn sensors(machine: &Machine) -> Vec<Sensor> {
    let (dyad, _) = machine.joints().last().expect("a machine has a joint");
    let slope = 0.5f64.sqrt();
    vec![
        Sensor::Pose,
        Sensor::Position,
        Sensor::Distance { absolute: false },
        Sensor::Displacement { direction_w: Vec3([0.6, -0.8 * slope, 0.8 * slope]) },
        Sensor::Joint { dyad },
    ]
}

/// One machine at one pose with one instrument.
struct Case<'a> {
    machine: &'a Machine,
    sensor: &'a Sensor,
    deviations: Vec<Twist<f64>>,
    q: Vec<f64>,
    state: SensorState<f64>,
    measured: Pose<f64>,
}

/// A command within its limits; ±0.3 m or half a turn where there are none.
pub(crate) fn random_command(machine: &Machine, command: usize, rng: &mut StdRng) -> f64 {
    let kind = machine.command_joint(command).kind;
    let reach = if kind == JointKind::Prismatic { 0.3 } else { std::f64::consts::PI };
    let (from, to) = machine.travel(command);
    let (from, to) = match (from.is_finite(), to.is_finite()) {
        (true, true) => (from, to),
        (true, false) => (from, from + 2.0 * reach),
        (false, true) => (to - 2.0 * reach, to),
        (false, false) => (-reach, reach),
    };
    rng.random_range(from..to)
}

fn random_twist(tolerance: [f64; 6], size: f64, rng: &mut StdRng) -> Twist<f64> {
    Twist::from_array(tolerance.map(|t| size * t * rng.random_range(-1.0..1.0)))
}

impl<'a> Case<'a> {
    fn random(machine: &'a Machine, sensor: &'a Sensor, size: f64, rng: &mut StdRng) -> Self {
        let mut point = |reach: f64| Vec3(std::array::from_fn(|_| rng.random_range(-reach..reach)));
        let turn = |rotation: Vec3<f64>| Pose::exp(Twist::new(Vec3([0.0; 3]), rotation)).rotation;
        let state = SensorState {
            tool_point_t: point(0.1),
            workpiece_point_w: point(0.1),
            tool_rotation_t: turn(point(2.0)),
            length: 0.1,
            zero: 0.01,
        };
        let q: Vec<f64> = (0..machine.commands().len()).map(|c| random_command(machine, c, rng)).collect();
        let tolerance = [2e-5, 2e-5, 2e-5, 5e-5, 5e-5, 5e-5];
        let deviations: Vec<_> = machine.dyads().iter().map(|_| random_twist(tolerance, size, rng)).collect();
        // The measured pose lies near the modelled one, exactly on it where every deviation is zero.
        let near = Pose::exp(random_twist(tolerance, size, rng));
        let target = Pose { rotation: state.tool_rotation_t, translation: Vec3([0.0; 3]) };
        let measured = near * Chain::new(machine, &deviations).w_from_t(&q) * target;
        Case { machine, sensor, deviations, q, state, measured }
    }

    /// The readings as functions of anything: the production code on any scalar.
    fn readings<S: crate::scalar::Scalar>(
        &self,
        deviations: &[Twist<S>],
        q: &[S],
        state: &SensorState<S>,
    ) -> [S; MOST_READINGS] {
        if let Sensor::Joint { dyad } = *self.sensor {
            let joint = self.machine.dyads()[dyad].joint.as_ref().expect("a joint");
            let drive = self.machine.drive(dyad).expect("a drive");
            let displacement =
                drive.terms.iter().fold(state.zero, |sum, (c, factor)| sum + q[*c].scale(*factor));
            let dh = deviations[dyad];
            let own = joint.twist().lift(state.zero);
            return [displacement + own.v.dot(dh.v) + own.w.dot(dh.w); MOST_READINGS];
        }
        let sweep = Chain::new(self.machine, deviations).sweep(q);
        let (readings, _) = self.sensor.readings(&sweep, state, self.measured.rotation);
        readings.map(|reading| reading.value)
    }

    /// Worst relative difference by deviations, commands, and place and turn of the tool.
    fn differences(&self) -> [f64; 3] {
        let rows = self.sensor.reading_count();
        let dyads = self.machine.dyads().len();
        let (by_deviations, by_commands, by_point) = self.analytic(rows);
        let mut dual_deviations = DMatrix::zeros(rows, 6 * dyads);
        for j in 0..dyads {
            type Six = DualSVec64<6>;
            let lifted: Vec<Twist<Six>> = self
                .deviations
                .iter()
                .enumerate()
                .map(|(i, dh)| {
                    let mut k = 0;
                    Twist::from_array(dh.to_array().map(|x| {
                        let dual = if i == j { Six::from(x).derivative(k) } else { Six::from(x) };
                        k += 1;
                        dual
                    }))
                })
                .collect();
            let q: Vec<Six> = self.q.iter().map(|x| Six::from(*x)).collect();
            let values = self.readings(&lifted, &q, &lift(&self.state, q[0]));
            for (i, value) in values.iter().take(rows).enumerate() {
                let gradient = value.eps.unwrap_generic(nalgebra::Const::<6>, nalgebra::U1);
                for k in 0..6 {
                    dual_deviations[(i, 6 * j + k)] = gradient[k];
                }
            }
        }
        let mut dual_commands = DMatrix::zeros(rows, self.q.len());
        let constant = Dual64::from(0.0);
        let deviations: Vec<_> = self.deviations.iter().map(|dh| dh.lift(constant)).collect();
        for c in 0..self.q.len() {
            let q: Vec<Dual64> = (self.q.iter().enumerate())
                .map(|(i, x)| if i == c { Dual64::from(*x).derivative() } else { Dual64::from(*x) })
                .collect();
            let values = self.readings(&deviations, &q, &lift(&self.state, constant));
            for (i, value) in values.iter().take(rows).enumerate() {
                dual_commands[(i, c)] = value.eps;
            }
        }
        let mut dual_point = DMatrix::zeros(rows, 6);
        for k in 0..3 {
            let q: Vec<Dual64> = self.q.iter().map(|x| Dual64::from(*x)).collect();
            let mut state = lift(&self.state, constant);
            state.tool_point_t.0[k] = state.tool_point_t.0[k].derivative();
            let values = self.readings(&deviations, &q, &state);
            let mut turn = Vec3([constant; 3]);
            turn.0[k] = turn.0[k].derivative();
            let mut turned = lift(&self.state, constant);
            let turn = Pose::exp(Twist::new(Vec3([constant; 3]), turn));
            turned.tool_rotation_t = turned.tool_rotation_t * turn.rotation;
            let values_turned = self.readings(&deviations, &q, &turned);
            for i in 0..rows {
                dual_point[(i, k)] = values[i].eps;
                dual_point[(i, 3 + k)] = values_turned[i].eps;
            }
        }
        [
            worst(&by_deviations, &dual_deviations, 6),
            worst(&by_commands, &dual_commands, self.q.len()),
            worst(&by_point, &dual_point, 3),
        ]
    }

    fn analytic(&self, rows: usize) -> (DMatrix<f64>, DMatrix<f64>, DMatrix<f64>) {
        let dyads = self.machine.dyads().len();
        let mut by_deviations = DMatrix::zeros(rows, 6 * dyads);
        let mut by_commands = DMatrix::zeros(rows, self.q.len());
        let mut by_point = DMatrix::zeros(rows, 6);
        if let Sensor::Joint { dyad } = *self.sensor {
            let joint = self.machine.dyads()[dyad].joint.as_ref().expect("a joint");
            for (k, x) in joint.twist().to_array().into_iter().enumerate() {
                by_deviations[(0, 6 * dyad + k)] = x;
            }
            for (command, factor) in &self.machine.drive(dyad).expect("a drive").terms {
                by_commands[(0, *command)] += factor;
            }
            return (by_deviations, by_commands, by_point);
        }
        let sweep = Chain::new(self.machine, &self.deviations).sweep(&self.q);
        let (readings, _) = self.sensor.readings(&sweep, &self.state, self.measured.rotation);
        let mut row = vec![0.0; 6 * dyads];
        let mut commands = vec![0.0; self.q.len()];
        for (i, reading) in readings.iter().take(rows).enumerate() {
            sweep.error_row(reading.by_twist_w, &mut row);
            for (j, dh) in self.deviations.iter().enumerate() {
                let jacobian = deviation_jacobian(*dh);
                for k in 0..6 {
                    by_deviations[(i, 6 * j + k)] = (0..6).map(|l| row[6 * j + l] * jacobian[l][k]).sum();
                }
            }
            sweep.command_row(self.machine, reading.by_twist_w, &mut commands);
            for (c, x) in commands.iter().enumerate() {
                by_commands[(i, c)] = *x;
            }
            for (k, x) in reading.by_tool_point_t.0.into_iter().enumerate() {
                by_point[(i, k)] = x;
            }
            for (k, x) in reading.by_tool_rotation.0.into_iter().enumerate() {
                by_point[(i, 3 + k)] = x;
            }
        }
        (by_deviations, by_commands, by_point)
    }
}

fn lift<S: crate::scalar::Scalar>(state: &SensorState<f64>, like: S) -> SensorState<S> {
    SensorState {
        tool_point_t: state.tool_point_t.lift(like),
        tool_rotation_t: state.tool_rotation_t.lift(like),
        workpiece_point_w: state.workpiece_point_w.lift(like),
        length: like.lift(state.length),
        zero: like.lift(state.zero),
    }
}

/// Largest difference, each relative to the largest element of its block of `width` columns over all rows.
fn worst(analytic: &DMatrix<f64>, dual: &DMatrix<f64>, width: usize) -> f64 {
    let mut worst = 0.0f64;
    for block in 0..analytic.ncols() / width {
        let columns = block * width..(block + 1) * width;
        let of = |m: &DMatrix<f64>| m.columns_range(columns.clone()).amax();
        let difference =
            (analytic.columns_range(columns.clone()) - dual.columns_range(columns.clone())).amax();
        let size = of(analytic).max(of(dual));
        // A block that is zero in both is right; NaN anywhere must not pass.
        let relative = if difference == 0.0 { 0.0 } else { difference / size };
        worst = if relative.is_nan() { f64::INFINITY } else { worst.max(relative) };
    }
    worst
}

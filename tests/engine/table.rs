//! A tilting table that does wrong what real ones do, and what any estimator could make of its ballbar readings.
#![allow(dead_code)]

use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::fmt::Write;

use crate::common::random::Random;
use kincal::lie::{Pose, Twist, Vec3, Wrench};
use kincal::motion::Play;
use kincal::recording::Recording;
use kincal::{Chain, Machine};
use nalgebra::{DMatrix, DVector};

/// Standard deviation of the ballbar's readings, m.
pub const SIGMA: f64 = 1e-6;
/// Standard deviations of the location errors, m and rad.
const LOCATION: [f64; 6] = [50e-6, 50e-6, 50e-6, 100e-6, 100e-6, 100e-6];
/// Play of A and of C, rad in all; a machine's own differ from these by a fifth.
const PLAY: [f64; 2] = [60e-6, 40e-6];
const PLAY_SPREAD: f64 = 0.2;
/// Turn of the tilted table by its weight, standard deviation, rad.
const WEIGHT: f64 = 20e-6;
/// Error motions of every axis, which no model here has: each of its six components, two harmonics, cosine and sine; m and rad.
const MOTION: [f64; 6] = [0.7e-6, 0.7e-6, 0.7e-6, 4e-6, 4e-6, 4e-6];
const HARMONICS: usize = 2;
/// Period of a linear axis, m.
const PERIOD: f64 = 0.6;

/// The axes as the machine names them.
pub struct Axes {
    pub x: usize,
    pub y: usize,
    pub z: usize,
    pub a: usize,
    pub c: usize,
}

impl Axes {
    pub fn of(machine: &Machine) -> Self {
        let at = |name: &str| machine.commands().iter().position(|c| c == name).expect("an axis");
        Axes { x: at("x"), y: at("y"), z: at("z"), a: at("a"), c: at("c") }
    }
}

/// The numbers that make a table: location errors of every dyad, play of A and C (over [`PLAY`]), its weight, and error motions,
/// each but the play over its standard deviation.
#[derive(Clone)]
pub struct Table {
    pub numbers: Vec<f64>,
}

impl Table {
    fn count(machine: &Machine) -> usize {
        6 * machine.dyads().len() + 3 + 5 * 6 * 2 * HARMONICS
    }

    /// What the numbers are before anything is drawn, and their standard deviations.
    pub fn prior(machine: &Machine) -> (DVector<f64>, DVector<f64>) {
        let play = 6 * machine.dyads().len();
        let is_play = |i: usize| i == play || i == play + 1;
        let n = Self::count(machine);
        (
            DVector::from_fn(n, |i, _| if is_play(i) { 1.0 } else { 0.0 }),
            DVector::from_fn(n, |i, _| if is_play(i) { PLAY_SPREAD } else { 1.0 }),
        )
    }

    pub fn random(machine: &Machine, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let (mean, deviation) = Self::prior(machine);
        Table { numbers: mean.iter().zip(&deviation).map(|(m, s)| m + s * random.normal()).collect() }
    }

    /// The deviations at the commands `q`; `behind`: what play leaves of the drives' positions of A and C, rad.
    fn deviations(&self, machine: &Machine, axes: &Axes, q: &[f64], behind: [f64; 2]) -> Vec<Twist<f64>> {
        let dyads = machine.dyads().len();
        let mut dh: Vec<Twist<f64>> = (0..dyads)
            .map(|j| Twist::from_array(std::array::from_fn(|k| LOCATION[k] * self.numbers[6 * j + k])))
            .collect();
        let frame = |name: &str| machine.frame_index(name).expect("a frame");
        let mut add = |name: &str, v: [f64; 3], w: [f64; 3]| {
            let j = frame(name);
            dh[j] = dh[j] + Twist::new(Vec3(v), Vec3(w));
        };
        let rest = &self.numbers[6 * dyads + 2..];
        add("a", [0.0; 3], [behind[0] + WEIGHT * rest[0] * q[axes.a].sin(), 0.0, 0.0]);
        // C turns about -z.
        add("c", [0.0; 3], [0.0, 0.0, -behind[1]]);
        let mut coefficients = rest[1..].iter();
        for (name, at) in [("x", axes.x), ("y", axes.y), ("z", axes.z), ("a", axes.a), ("c", axes.c)] {
            let linear = machine.command_joint(at).kind == kincal::machine::JointKind::Prismatic;
            let mut motion = [0.0; 6];
            for harmonic in 1..=HARMONICS {
                // Once a revolution is a matter of where the axis lies.
                let angle =
                    if linear { harmonic as f64 * TAU / PERIOD } else { harmonic as f64 + 1.0 } * q[at];
                let (sin, cos) = angle.sin_cos();
                for (k, motion) in motion.iter_mut().enumerate() {
                    let [of_cos, of_sin] = [(); 2].map(|()| coefficients.next().expect("a coefficient"));
                    *motion += MOTION[k] / harmonic as f64 * (of_cos * cos + of_sin * sin);
                }
            }
            let [vx, vy, vz, wx, wy, wz] = motion;
            add(name, [vx, vy, vz], [wx, wy, wz]);
        }
        dh
    }

    /// What play leaves of the drives' positions of A and C all along a path, rad.
    fn plays(&self, machine: &Machine, path: &[Vec<f64>]) -> Vec<[f64; 2]> {
        let axes = Axes::of(machine);
        let play = 6 * machine.dyads().len();
        let first = |c: usize| {
            let gone = path.iter().map(|q| q[c] - path[0][c]).find(|d| d.abs() > 1e-9);
            gone.map_or(0, |d| if d > 0.0 { 1 } else { -1 })
        };
        let width = |i: usize, q: &[f64]| {
            let grows = if i == 0 { 1.0 + 0.4 * q[axes.a].cos() } else { 1.0 };
            (PLAY[i] * self.numbers[play + i] * grows).max(0.0)
        };
        let both = [(0, axes.a), (1, axes.c)];
        let mut plays = both.map(|(i, c)| Play::new(path[0][c], width(i, &path[0]), first(c)));
        path.iter().map(|q| both.map(|(i, c)| plays[i].advance(q[c], width(i, q)))).collect()
    }

    /// The tool as the workpiece sees it all along a path.
    pub fn run(&self, machine: &Machine, path: &[Vec<f64>]) -> Vec<Pose<f64>> {
        let axes = Axes::of(machine);
        (path.iter().zip(self.plays(machine, path)))
            .map(|(q, behind)| Chain::new(machine, &self.deviations(machine, &axes, q, behind)).w_from_t(q))
            .collect()
    }

    /// Lengths of the bar along a path, m, without noise.
    pub fn lengths(&self, machine: &Machine, path: &[Vec<f64>]) -> Vec<f64> {
        self.run(machine, path).iter().map(|w_from_t| w_from_t.translation.norm()).collect()
    }
}

/// Where the bar points on a cone of half apex 45° about an axis 30° off the vertical, and the angles of table and turn.
#[derive(Clone, Copy)]
pub enum Bar {
    /// As the NC data of the paper: the bar's direction is that of the machine's axes.
    Machine,
    /// The cone stands on the table.
    Table,
}

/// A path to and fro: bar of `length` (m), A and C (rad) by the angle on the cone; `None`: as the paper's tool runs.
pub fn path(
    machine: &Machine,
    length: f64,
    bar: Bar,
    angles: Option<fn(f64) -> (f64, f64)>,
    count: usize,
) -> Vec<Vec<f64>> {
    let axes = Axes::of(machine);
    let chain = Chain::nominal(machine);
    let (sin, cos) = (0.5, 0.75f64.sqrt());
    let (e, n) = (Vec3([0.0, -sin, cos]), Vec3([0.0, cos, sin]));
    let mut turned = 0.0;
    let mut at = |phi: f64| {
        let m = n.times(phi.cos()) + Vec3([phi.sin(), 0.0, 0.0]);
        let d = (e + m).times(length * FRAC_1_SQRT_2);
        let u = (e - m).times(FRAC_1_SQRT_2);
        let (a, c) = match angles {
            Some(angles) => angles(phi),
            None => {
                let c = (-u.0[0]).atan2(-u.0[1]);
                turned = c + TAU * ((turned - c) / TAU).round();
                (u.0[2].acos(), turned)
            }
        };
        let mut q = vec![0.0; machine.commands().len()];
        (q[axes.a], q[axes.c]) = (a, c);
        let b_from_w = chain.sweep(&q).b_from_w();
        let end = match bar {
            Bar::Machine => b_from_w.translation + d,
            Bar::Table => b_from_w.transform(d),
        };
        (q[axes.x], q[axes.y], q[axes.z]) = (end.0[0], end.0[1], end.0[2]);
        q
    };
    let there: Vec<Vec<f64>> = (0..=count).map(|k| at(TAU * k as f64 / count as f64)).collect();
    let back = there[..count].iter().rev().cloned();
    there.iter().cloned().chain(back).collect()
}

/// A recording of the bar with noise.
pub fn record(machine: &Machine, table: &Table, path: &[Vec<f64>], name: &str, seed: u64) -> Recording {
    let mut random = Random::new(seed);
    let mut text = String::from("# measurement: distance\n");
    let unit = |c: usize| {
        if machine.command_joint(c).kind == kincal::machine::JointKind::Prismatic { "m" } else { "rad" }
    };
    let names: Vec<String> =
        machine.commands().iter().enumerate().map(|(c, name)| format!("{name}[{}]", unit(c))).collect();
    let _ = writeln!(text, "{},r[m]", names.join(","));
    for (q, length) in path.iter().zip(table.lengths(machine, path)) {
        let cells: Vec<String> = q.iter().map(|x| format!("{x:.12}")).collect();
        let _ = writeln!(text, "{},{:.12}", cells.join(","), length + SIGMA * random.normal());
    }
    Recording::from_bytes(name, text.as_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

/// The best linear estimator of a table's numbers from readings of the bar, under the law that tables are drawn by.
pub struct Best {
    mean: DVector<f64>,
    /// Numbers from the readings' differences to the mean table's.
    gain: DMatrix<f64>,
    covariance: DMatrix<f64>,
    expected: DVector<f64>,
}

/// Derivatives of the bar's lengths by the numbers of a table over their standard deviations, at the table as declared, m.
pub fn sensitivity(machine: &Machine, paths: &[&[Vec<f64>]]) -> DMatrix<f64> {
    let axes = Axes::of(machine);
    let (mean, deviation) = Table::prior(machine);
    let mean = Table { numbers: mean.iter().copied().collect() };
    let chain = Chain::nominal(machine);
    let changed: Vec<Table> = (0..mean.numbers.len())
        .map(|i| {
            let mut changed = mean.clone();
            changed.numbers[i] += deviation[i];
            changed
        })
        .collect();
    let play = 6 * machine.dyads().len();
    let mut rows = Vec::new();
    for path in paths {
        let behind = mean.plays(machine, path);
        let wider = [0, 1].map(|i| changed[play + i].plays(machine, path));
        for (k, q) in path.iter().enumerate() {
            let sweep = chain.sweep(q);
            let p_w = sweep.w_from_t().translation;
            let mut row = vec![0.0; play];
            sweep.error_row(Wrench::at_point(p_w.times(1.0 / p_w.norm()), p_w), &mut row);
            let length = |dh: Vec<Twist<f64>>| -> f64 {
                dh.iter().flat_map(|dh| dh.to_array()).zip(&row).map(|(x, y)| x * y).sum()
            };
            let before = length(mean.deviations(machine, &axes, q, behind[k]));
            rows.push(nalgebra::RowDVector::from_iterator(
                changed.len(),
                changed.iter().enumerate().map(|(i, table)| {
                    let behind = if i == play || i == play + 1 { wider[i - play][k] } else { behind[k] };
                    length(table.deviations(machine, &axes, q, behind)) - before
                }),
            ));
        }
    }
    DMatrix::from_rows(&rows)
}

impl Best {
    pub fn new(machine: &Machine, paths: &[&[Vec<f64>]]) -> Self {
        let (mean, _) = Table::prior(machine);
        // By numbers over their standard deviations the prior is the unit matrix.
        let j = sensitivity(machine, paths) / SIGMA;
        let information = j.tr_mul(&j) + DMatrix::identity(j.ncols(), j.ncols());
        let covariance = information.try_inverse().expect("positive definite");
        let gain = &covariance * j.transpose() / SIGMA;
        let table = Table { numbers: mean.iter().copied().collect() };
        let expected = paths.iter().flat_map(|path| table.lengths(machine, path)).collect::<Vec<_>>();
        Best { mean, gain, covariance, expected: DVector::from_vec(expected) }
    }

    /// What it takes a table to be from readings along the paths it was made for.
    pub fn table(&self, machine: &Machine, readings: &[f64]) -> Table {
        let (_, deviation) = Table::prior(machine);
        let seen = DVector::from_column_slice(readings) - &self.expected;
        let numbers = &self.mean + (&self.gain * seen).component_mul(&deviation);
        Table { numbers: numbers.iter().copied().collect() }
    }

    /// Mean size of the error of its lengths along a path, expected over all tables, m.
    pub fn expected_error(&self, machine: &Machine, path: &[Vec<f64>]) -> f64 {
        let j = sensitivity(machine, &[path]);
        let sizes = (&j * &self.covariance).component_mul(&j).column_sum().map(f64::sqrt);
        sizes.mean() * (2.0 / std::f64::consts::PI).sqrt()
    }
}

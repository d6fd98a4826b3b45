//! A tilting table that does wrong what real ones do, and what any estimator could make of its ballbar readings.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::fmt::Write;

use kincal::lie::{Pose, Twist, Vec3, Wrench};
use kincal::machine::JointKind;
use kincal::motion::Play;
use kincal::recording::Recording;
use kincal::{Chain, Machine};
use nalgebra::{DMatrix, DVector, RowDVector};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use crate::outcome::{Failure, Outcome};

/// Standard deviation of the ballbar's readings, m.
pub const SIGMA: f64 = 1e-6;
/// Standard deviations of the location errors, m and rad.
const LOCATION: [f64; 6] = [50e-6, 50e-6, 50e-6, 100e-6, 100e-6, 100e-6];
/// Play of A and of C, rad in all; a table's own differ from these by a fifth.
const PLAY: [f64; 2] = [60e-6, 40e-6];
const PLAY_SPREAD: f64 = 0.2;
/// Turn of the tilted table by its weight, standard deviation, rad.
const WEIGHT: f64 = 20e-6;
/// Error motions of every axis: each of six components, two harmonics, cosine and sine; m and rad.
const MOTION: [f64; 6] = [0.7e-6, 0.7e-6, 0.7e-6, 4e-6, 4e-6, 4e-6];
const HARMONICS: usize = 2;
/// Period of a linear axis, m.
const PERIOD: f64 = 0.6;

/// The machine with its five axes by index of command.
pub struct Body {
    pub machine: Machine,
    x: usize,
    y: usize,
    z: usize,
    pub a: usize,
    pub c: usize,
}

impl Body {
    pub fn new(machine: Machine) -> Outcome<Self> {
        let at = |name: &str| {
            let found = machine.commands().iter().position(|command| command == name);
            found.ok_or_else(|| Failure::Broken(format!("no axis `{name}`")))
        };
        let (x, y, z, a, c) = (at("x")?, at("y")?, at("z")?, at("a")?, at("c")?);
        Ok(Body { machine, x, y, z, a, c })
    }

    fn is_linear(&self, command: usize) -> bool {
        self.machine.command_joint(command).kind == JointKind::Prismatic
    }

    /// Where play stands among the numbers of a table.
    fn play_at(&self) -> usize {
        6 * self.machine.dyads().len()
    }
}

/// A normal number.
pub fn normal(rng: &mut StdRng) -> f64 {
    let (u, v) = (rng.random_range(f64::MIN_POSITIVE..1.0), rng.random_range(0.0..TAU));
    (-2.0 * f64::ln(u)).sqrt() * f64::cos(v)
}

/// The numbers that make a table: location errors of every dyad, play of A and C (over [`PLAY`]), its weight, and error motions,
/// each but the play over its standard deviation.
#[derive(Clone)]
pub struct Table {
    numbers: Vec<f64>,
}

impl Table {
    /// What the numbers are before anything is drawn, and their standard deviations.
    fn prior(body: &Body) -> (DVector<f64>, DVector<f64>) {
        let play = body.play_at();
        let count = play + 3 + 5 * 6 * 2 * HARMONICS;
        let is_play = |i: usize| i == play || i == play + 1;
        (
            DVector::from_fn(count, |i, _| if is_play(i) { 1.0 } else { 0.0 }),
            DVector::from_fn(count, |i, _| if is_play(i) { PLAY_SPREAD } else { 1.0 }),
        )
    }

    pub fn random(body: &Body, seed: u64) -> Self {
        let mut rng = StdRng::seed_from_u64(seed);
        let (mean, deviation) = Self::prior(body);
        Table { numbers: mean.iter().zip(&deviation).map(|(m, s)| m + s * normal(&mut rng)).collect() }
    }

    /// The deviations at the commands `q`; `behind`: what play leaves of the drives' positions of A and C, rad.
    fn deviations(&self, body: &Body, q: &[f64], behind: [f64; 2]) -> Vec<Twist<f64>> {
        let machine = &body.machine;
        let mut dh: Vec<Twist<f64>> = (0..machine.dyads().len())
            .map(|j| Twist::from_array(std::array::from_fn(|k| LOCATION[k] * self.numbers[6 * j + k])))
            .collect();
        let mut add = |name: &str, twist: [f64; 6]| {
            if let Some(j) = machine.frame_index(name) {
                dh[j] = dh[j] + Twist::from_array(twist);
            }
        };
        let rest = &self.numbers[body.play_at() + 2..];
        add("a", [0.0, 0.0, 0.0, behind[0] + WEIGHT * rest[0] * q[body.a].sin(), 0.0, 0.0]);
        // C turns about -z.
        add("c", [0.0, 0.0, 0.0, 0.0, 0.0, -behind[1]]);
        let axes = [("x", body.x), ("y", body.y), ("z", body.z), ("a", body.a), ("c", body.c)];
        for ((name, at), of_axis) in axes.into_iter().zip(rest[1..].chunks_exact(12 * HARMONICS)) {
            let mut motion = [0.0; 6];
            for (harmonic, coefficients) in (1..=HARMONICS).zip(of_axis.chunks_exact(12)) {
                // Once a revolution is a matter of where the axis lies.
                let waves =
                    if body.is_linear(at) { harmonic as f64 * TAU / PERIOD } else { harmonic as f64 + 1.0 };
                let (sin, cos) = (waves * q[at]).sin_cos();
                for (k, motion) in motion.iter_mut().enumerate() {
                    let of_both = coefficients[2 * k] * cos + coefficients[2 * k + 1] * sin;
                    *motion += MOTION[k] / harmonic as f64 * of_both;
                }
            }
            add(name, motion);
        }
        dh
    }

    /// What play leaves of the drives' positions of A and C all along a path, rad.
    fn plays(&self, body: &Body, path: &[Vec<f64>]) -> Vec<[f64; 2]> {
        let play = body.play_at();
        let first = |c: usize| {
            let gone = path.iter().map(|q| q[c] - path[0][c]).find(|d| d.abs() > 1e-9);
            gone.map_or(0, |d| if d > 0.0 { 1 } else { -1 })
        };
        let width = |i: usize, q: &[f64]| {
            let grows = if i == 0 { 1.0 + 0.4 * q[body.a].cos() } else { 1.0 };
            (PLAY[i] * self.numbers[play + i] * grows).max(0.0)
        };
        let both = [(0, body.a), (1, body.c)];
        let mut plays = both.map(|(i, c)| Play::new(path[0][c], width(i, &path[0]), first(c)));
        path.iter().map(|q| both.map(|(i, c)| plays[i].advance(q[c], width(i, q)))).collect()
    }

    /// Lengths of the bar along a path, m, without noise.
    pub fn lengths(&self, body: &Body, path: &[Vec<f64>]) -> Vec<f64> {
        let pose = |(q, behind): (&Vec<f64>, [f64; 2])| -> Pose<f64> {
            Chain::new(&body.machine, &self.deviations(body, q, behind)).w_from_t(q)
        };
        path.iter().zip(self.plays(body, path)).map(pose).map(|pose| pose.translation.norm()).collect()
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
    body: &Body,
    length: f64,
    bar: Bar,
    angles: Option<fn(f64) -> (f64, f64)>,
    count: usize,
) -> Vec<Vec<f64>> {
    let chain = Chain::nominal(&body.machine);
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
        let mut q = vec![0.0; body.machine.commands().len()];
        (q[body.a], q[body.c]) = (a, c);
        let b_from_w = chain.sweep(&q).b_from_w();
        let end = match bar {
            Bar::Machine => b_from_w.translation + d,
            Bar::Table => b_from_w.transform(d),
        };
        (q[body.x], q[body.y], q[body.z]) = (end.0[0], end.0[1], end.0[2]);
        q
    };
    let there: Vec<Vec<f64>> = (0..=count).map(|k| at(TAU * k as f64 / count as f64)).collect();
    let back = there[..count].iter().rev().cloned();
    there.iter().cloned().chain(back).collect()
}

/// Lengths as a recording of the bar.
pub fn recording(body: &Body, path: &[Vec<f64>], lengths: &[f64], name: &str) -> Outcome<Recording> {
    let unit = |c: usize| if body.is_linear(c) { "m" } else { "rad" };
    let columns: Vec<String> =
        body.machine.commands().iter().enumerate().map(|(c, name)| format!("{name}[{}]", unit(c))).collect();
    let mut text = format!("# measurement: distance\n{},r[m]\n", columns.join(","));
    for (q, length) in path.iter().zip(lengths) {
        let cells: Vec<String> = q.iter().chain([length]).map(|x| format!("{x:.12}")).collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    Ok(Recording::from_bytes(name, text.into_bytes(), &body.machine)?)
}

/// Lengths with the noise of the bar.
pub fn noisy(lengths: Vec<f64>, rng: &mut StdRng) -> Vec<f64> {
    lengths.into_iter().map(|length| length + SIGMA * normal(rng)).collect()
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
fn sensitivity(body: &Body, paths: &[&[Vec<f64>]]) -> DMatrix<f64> {
    let (mean, deviation) = Table::prior(body);
    let mean = Table { numbers: mean.iter().copied().collect() };
    let chain = Chain::nominal(&body.machine);
    let changed: Vec<Table> = (0..mean.numbers.len())
        .map(|i| {
            let mut changed = mean.clone();
            changed.numbers[i] += deviation[i];
            changed
        })
        .collect();
    let play = body.play_at();
    let mut rows = Vec::new();
    for path in paths {
        let behind = mean.plays(body, path);
        let wider = [0, 1].map(|i| changed[play + i].plays(body, path));
        for (k, q) in path.iter().enumerate() {
            let sweep = chain.sweep(q);
            let p_w = sweep.w_from_t().translation;
            let mut row = vec![0.0; play];
            sweep.error_row(Wrench::at_point(p_w.times(1.0 / p_w.norm()), p_w), &mut row);
            let length = |dh: Vec<Twist<f64>>| -> f64 {
                dh.iter().flat_map(|dh| dh.to_array()).zip(&row).map(|(x, y)| x * y).sum()
            };
            let before = length(mean.deviations(body, q, behind[k]));
            let by = changed.iter().enumerate().map(|(i, table)| {
                let behind = if i == play || i == play + 1 { wider[i - play][k] } else { behind[k] };
                length(table.deviations(body, q, behind)) - before
            });
            rows.push(RowDVector::from_iterator(changed.len(), by));
        }
    }
    DMatrix::from_rows(&rows)
}

impl Best {
    pub fn new(body: &Body, paths: &[&[Vec<f64>]]) -> Outcome<Self> {
        let (mean, _) = Table::prior(body);
        // By numbers over their standard deviations the prior is the unit matrix.
        let j = sensitivity(body, paths) / SIGMA;
        let information = j.tr_mul(&j) + DMatrix::identity(j.ncols(), j.ncols());
        let covariance = information.try_inverse();
        let covariance = covariance.ok_or_else(|| Failure::Broken("information is singular".into()))?;
        let gain = &covariance * j.transpose() / SIGMA;
        let table = Table { numbers: mean.iter().copied().collect() };
        let expected = paths.iter().flat_map(|path| table.lengths(body, path)).collect::<Vec<_>>();
        Ok(Best { mean, gain, covariance, expected: DVector::from_vec(expected) })
    }

    /// What it takes a table to be from readings along the paths it was made for.
    pub fn table(&self, body: &Body, readings: &[f64]) -> Table {
        let (_, deviation) = Table::prior(body);
        let seen = DVector::from_column_slice(readings) - &self.expected;
        let numbers = &self.mean + (&self.gain * seen).component_mul(&deviation);
        Table { numbers: numbers.iter().copied().collect() }
    }

    /// Mean size of the error of its lengths along a path, expected over all tables, m.
    pub fn expected_error(&self, body: &Body, path: &[Vec<f64>]) -> f64 {
        let j = sensitivity(body, &[path]);
        let sizes = (&j * &self.covariance).component_mul(&j).column_sum().map(f64::sqrt);
        sizes.mean() * (2.0 / std::f64::consts::PI).sqrt()
    }
}

//! What errors of a machine look like in readings along a path: the nominal reading, and one shape for each that they can take.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::nominal::Nominal;
use crate::chain::Chain;
use crate::lie::{Mat3, Twist};
use crate::machine::Machine;
use crate::recording::{Header, Measurement, NominalLength, ToolPoint};
use crate::sensor::{Sensor, SensorState};
use crate::units::ByQuantity;

/// Most moments of a path that are looked at.
const MOMENTS: usize = 40_000;
/// Most shapes that are told apart.
const SHAPES: usize = 48;
/// Shapes below this part of the noise are left out.
const NEGLIGIBLE: f64 = 0.02;
/// Errors are looked for up to this many tolerances of the machine file.
const TOLERANCES: f64 = 3.0;
/// Play, m or rad, and lag of one axis against the others, s, that are looked for besides.
const PLAY: ByQuantity<f64> = ByQuantity { m: 20e-6, rad: 100e-6 };
const LAG: f64 = 1e-3;
/// Length and zero of an instrument, m: as good as free.
const LENGTH: f64 = 10e-3;
/// Movement from one moment to the next that is a motion, m or rad.
const MOTION: f64 = 1e-9;

/// Nominal readings and shapes of errors along a path, each shape in units of what it is expected to be at most.
pub(super) struct Shapes {
    /// Readings of a moment.
    pub readings: usize,
    /// Shapes of a reading.
    pub count: usize,
    /// Nominal reading, moment by moment, m.
    pub nominal: Vec<f64>,
    /// Shapes of every reading, moment by moment, m.
    pub rows: Vec<f64>,
    /// Deviations of all dyads that each shape consists of, m and rad.
    deviations: DMatrix<f64>,
    /// Half the play of every command that each shape consists of, m or rad.
    play: DMatrix<f64>,
    /// The deviations about which these shapes are.
    about: Vec<Twist<f64>>,
}

/// The instrument of a recording, if what it reads can be followed along a path.
pub(super) fn instrument(header: &Header) -> Option<(Sensor, SensorState<f64>)> {
    let sensor = match header.measurement {
        Measurement::Distance { absolute } => Sensor::Distance { absolute },
        Measurement::Position => Sensor::Position,
        Measurement::Displacement => Sensor::Displacement { direction_w: header.direction_w? },
        _ => return None,
    };
    let ToolPoint::Known(tool_point_t) = header.tool_point else { return None };
    let length = if let NominalLength::Known(length) = header.nominal_length { length } else { 0.0 };
    let state = SensorState {
        tool_point_t,
        tool_rotation_t: Mat3::identity(0.0),
        workpiece_point_w: header.workpiece_point,
        length,
        zero: 0.0,
    };
    Some((sensor, state))
}

impl Shapes {
    /// Shapes about a machine with deviations. `gaps`: the travel in which each command crosses its play, m or rad, 0 where it is crossed at
    /// once; `noise`: of a reading, m.
    pub fn new(
        machine: &Machine,
        (deviations, gaps): (&[Twist<f64>], &[f64]),
        path: &Nominal,
        (sensor, state): &(Sensor, SensorState<f64>),
        free: bool,
        noise: f64,
    ) -> Shapes {
        let stride = path.commands.len().div_ceil(MOMENTS);
        let last = path.commands.len() - 1;
        // Evenly from end to end.
        let count = last.div_ceil(stride);
        let moments: Vec<usize> =
            (0..=count).map(|k| ((k * last) as f64 / count as f64).round() as usize).collect();
        let (dyads, commands) = (machine.dyads().len(), machine.commands().len());
        let readings = sensor.reading_count();
        let all = 6 * dyads + 2 * commands + readings;
        let chain = Chain::new(machine, deviations);
        let sigma: Vec<f64> =
            (0..dyads).flat_map(|j| machine.tolerance(j).to_array().map(|t| TOLERANCES * t)).collect();
        let play: Vec<f64> = (0..commands).map(|c| PLAY[machine.command_joint(c).kind.quantity()]).collect();
        let sides = sides(path, &moments, gaps);
        let length = if free { 1.0 } else { LENGTH };
        let (mut nominal, mut full) = (Vec::new(), Vec::new());
        let mut row = vec![0.0; all];
        for (m, k) in moments.iter().enumerate() {
            let sweep = chain.sweep(&path.commands[*k]);
            let (read, _) = sensor.readings(&sweep, state, Mat3::identity(0.0));
            let (before, behind) = (k.saturating_sub(1), (k + 1).min(last));
            let speed = |c: usize| {
                (path.commands[behind][c] - path.commands[before][c]) / ((behind - before) as f64 * path.step)
            };
            for (i, reading) in read.iter().enumerate().take(readings) {
                row.fill(0.0);
                sweep.error_row(reading.by_twist_w, &mut row[..6 * dyads]);
                row.iter_mut().zip(&sigma).for_each(|(x, sigma)| *x *= sigma);
                let mut by = vec![0.0; commands];
                sweep.command_row(machine, reading.by_twist_w, &mut by);
                for c in 0..commands {
                    row[6 * dyads + c] = by[c] * play[c] * sides[m][c];
                    row[6 * dyads + commands + c] = by[c] * speed(c) * LAG;
                }
                row[6 * dyads + 2 * commands + i] = length;
                nominal.push(reading.value);
                full.extend_from_slice(&row);
            }
        }
        let (basis, rows) = reduced(&full, all, noise);
        let (count, about) = (basis.ncols(), deviations.to_vec());
        let deviations = DMatrix::from_fn(6 * dyads, count, |k, c| sigma[k] * basis[(k, c)]);
        let play = DMatrix::from_fn(commands, count, |k, c| play[k] * basis[(6 * dyads + k, c)]);
        Shapes { readings, count, nominal, rows, deviations, play, about }
    }

    /// The deviations that amounts of the shapes are, one for each dyad.
    pub fn deviations(&self, amounts: &DVector<f64>) -> Vec<Twist<f64>> {
        let all = &self.deviations * amounts;
        let twists = all.as_slice().chunks_exact(6);
        (self.about.iter())
            .zip(twists.map(|dh| Twist::from_array([dh[0], dh[1], dh[2], dh[3], dh[4], dh[5]])))
            .map(|(about, dh)| *about + dh)
            .collect()
    }

    /// The travel in which each command crosses the play that amounts of the shapes are, m or rad: a drive stands until it is through.
    pub fn gaps(&self, amounts: &DVector<f64>) -> Vec<f64> {
        (&self.play * amounts).iter().map(|half| 2.0 * half.abs()).collect()
    }
}

/// The side of its play on which every command lies, from -1 to 1; before the first motion that of the first one.
fn sides(path: &Nominal, moments: &[usize], gaps: &[f64]) -> Vec<Vec<f64>> {
    let commands = path.commands[0].len();
    let first = |c: usize| {
        let mut steps = path.commands.windows(2).map(|p| p[1][c] - p[0][c]);
        steps.find(|d| d.abs() > MOTION).map_or(0.0, f64::signum)
    };
    let mut now: Vec<f64> = (0..commands).map(first).collect();
    let (mut at, mut all) = (0, Vec::with_capacity(moments.len()));
    for k in moments {
        while at < *k {
            at += 1;
            for (c, side) in now.iter_mut().enumerate() {
                let d = path.commands[at][c] - path.commands[at - 1][c];
                if d.abs() > MOTION {
                    // A gap of 0 is crossed at once.
                    *side = (*side + 2.0 * d / gaps[c].max(MOTION)).clamp(-1.0, 1.0);
                }
            }
        }
        all.push(now.clone());
    }
    all
}

/// The few combinations of shapes that readings can show, largest first.
fn reduced(full: &[f64], all: usize, noise: f64) -> (DMatrix<f64>, Vec<f64>) {
    let rows = DMatrix::from_row_slice(full.len() / all, all, full);
    let eigen = SymmetricEigen::new(rows.tr_mul(&rows));
    let mut order: Vec<usize> = (0..all).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let seen =
        |k: &&usize| (eigen.eigenvalues[**k].max(0.0) / rows.nrows() as f64).sqrt() > NEGLIGIBLE * noise;
    let kept: Vec<usize> = order.iter().filter(seen).take(SHAPES).copied().collect();
    let basis = eigen.eigenvectors.select_columns(&kept);
    let small = rows * &basis;
    let mut flat = Vec::with_capacity(small.len());
    for row in small.row_iter() {
        flat.extend(row.iter());
    }
    (basis, flat)
}

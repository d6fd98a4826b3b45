//! Normal equations, accumulated sample by sample in fixed memory, `docs/model.md` (20).

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand::rngs::StdRng;

use super::loss::Loss;
use super::source::{Source, Sources};
use super::thin::Thin;
use super::unknowns::{Layout, Role, Unknowns};
use crate::chain::{Chain, Sweep, deviation_jacobian};
use crate::check::random_command;
use crate::error::Result;
use crate::lie::{Mat3, Pose, Twist, Vec3, Wrench};
use crate::machine::Machine;
use crate::recording::Chunk;
use crate::rms::Rms;
use crate::sensor::{MOST_READINGS, Sensor, SensorState};
use crate::units::Quantity;

/// Noise of a source's readings: standard deviation of lengths (m) and of angles (rad).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Noise {
    pub length: f64,
    pub angle: f64,
}

impl Noise {
    pub fn of(self, quantity: Quantity) -> f64 {
        if quantity == Quantity::Angle { self.angle } else { self.length }
    }
}

/// Sums over residuals of one quantity.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    /// Scalar rows, and the sum of their squares, m² or rad², unweighted.
    pub rows: u64,
    pub squares: f64,
    /// The same over the samples that count.
    pub inliers: u64,
    pub inlier_squares: f64,
}

impl Sums {
    fn add(&mut self, o: &Sums) {
        self.rows += o.rows;
        self.squares += o.squares;
        self.inliers += o.inliers;
        self.inlier_squares += o.inlier_squares;
    }
}

/// Sums over one source's samples that people read.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    pub samples: u64,
    pub length: Sums,
    pub angle: Sums,
    /// Samples whose weight is below one half.
    pub down_weighted: u64,
}

impl Tally {
    pub fn add(&mut self, o: &Tally) {
        self.samples += o.samples;
        self.length.add(&o.length);
        self.angle.add(&o.angle);
        self.down_weighted += o.down_weighted;
    }
}

/// Root mean square over the samples of some sources.
pub(crate) fn rms_over(tallies: &[Tally]) -> Rms {
    let over = |pick: fn(&Tally) -> &Sums| {
        let own: Vec<&Tally> = tallies.iter().filter(|t| pick(t).rows > 0).collect();
        let samples: u64 = own.iter().map(|t| t.samples).sum();
        let squares: f64 = own.iter().map(|t| pick(t).squares).sum();
        (samples > 0).then(|| (squares / samples as f64).sqrt())
    };
    Rms { m: over(|t| &t.length), rad: over(|t| &t.angle) }
}

/// Gauss-Newton matrix, gradient and loss of all data at one state, in m and rad; no prior in it.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    pub matrix: DMatrix<f64>,
    /// `Hᵀ W r`: points downhill.
    pub gradient: DVector<f64>,
    pub loss: f64,
    pub tallies: Vec<Tally>,
}

/// Samples with a smaller weight say nothing about the noise.
const COUNTS: f64 = 0.25;
impl Normal {
    fn zero(layout: &Layout, sources: usize) -> Self {
        Normal {
            matrix: DMatrix::zeros(layout.len, layout.len),
            gradient: DVector::zeros(layout.len),
            loss: 0.0,
            tallies: vec![Tally::default(); sources],
        }
    }
}

/// Extra columns of a source behind the six of each dyad: tool point, zero, length.
const EXTRAS: usize = 5;

/// Residuals and, if wanted, Jacobian rows of a sample.
pub(crate) struct Evaluator<'a> {
    pub machine: &'a Machine,
    pub chain: Chain<f64>,
    pub state: SensorState<f64>,
    pub sensor: &'a Sensor,
    pub dh: &'a [Twist<f64>],
}

impl<'a> Evaluator<'a> {
    pub fn new(machine: &'a Machine, unknowns: &'a Unknowns, source: &'a Source) -> Self {
        Evaluator {
            machine,
            chain: unknowns.chain(machine, source.setup),
            state: unknowns.sensor_state(source),
            sensor: &source.sensor,
            dh: &unknowns.dh,
        }
    }

    /// The residuals, measured minus model, m and rad. With `rows`, the columns of the transposed Jacobian as well.
    pub fn residuals(
        &self,
        q: &[f64],
        measured: &[f64],
        sweep: &mut Sweep<f64>,
        mut rows: Option<&mut [f64]>,
    ) -> [f64; MOST_READINGS] {
        let mut residuals = [0.0; MOST_READINGS];
        let dyads = self.machine.dyads().len();
        let width = 6 * dyads + EXTRAS;
        if let Some(rows) = &mut rows {
            rows[..self.sensor.reading_count() * width].fill(0.0);
        }
        if let Sensor::Joint { dyad } = *self.sensor {
            residuals[0] = measured[0] - self.joint_reading(dyad, q);
            if let Some(rows) = &mut rows {
                let xi = self.joint_twist(dyad).to_array();
                rows[6 * dyad..6 * dyad + 6].copy_from_slice(&xi);
                rows[6 * dyads + 3] = 1.0;
            }
            return residuals;
        }
        self.chain.sweep_into(q, sweep);
        let rotation = match self.sensor {
            Sensor::Pose => {
                Pose::exp(Twist::from_array([0.0, 0.0, 0.0, measured[3], measured[4], measured[5]])).rotation
            }
            _ => Mat3::identity(0.0),
        };
        let (readings, count) = self.sensor.readings(sweep, &self.state, rotation);
        let relative = matches!(self.sensor, Sensor::Distance { absolute: false });
        for (i, reading) in readings.iter().take(count).enumerate() {
            let reference = if i < 3 { measured[i] } else { 0.0 };
            residuals[i] = reference - reading.value;
            if let Some(rows) = &mut rows {
                let row = &mut rows[i * width..(i + 1) * width];
                sweep.error_row(reading.by_twist_w, &mut row[..6 * dyads]);
                row[6 * dyads..6 * dyads + 3].copy_from_slice(&reading.by_tool_point_t.0);
                row[6 * dyads + 3] = if self.sensor.has_zero() { 1.0 } else { 0.0 };
                row[6 * dyads + 4] = if relative { -1.0 } else { 0.0 };
            }
        }
        residuals
    }

    /// `q + xi·dh + zero`, `docs/model.md` (19).
    pub fn joint_reading(&self, dyad: usize, q: &[f64]) -> f64 {
        let drive = self.machine.drive(dyad).expect("a measured joint has a drive");
        let displacement: f64 = drive.terms.iter().map(|(c, factor)| factor * q[*c]).sum();
        let (xi, dh) = (self.joint_twist(dyad), self.dh[dyad]);
        displacement + xi.v.dot(dh.v) + xi.w.dot(dh.w) + self.state.zero
    }

    fn joint_twist(&self, dyad: usize) -> Twist<f64> {
        self.machine.dyads()[dyad].joint.as_ref().expect("a measured joint is a joint").twist()
    }

    /// A sweep to work in.
    pub fn workspace(&self) -> Sweep<f64> {
        self.chain.sweep(&vec![0.0; self.machine.commands().len()])
    }
}

/// Squared standardised residual per reading of a sample.
pub(crate) fn standardised(residuals: &[f64], sigmas: &[f64]) -> f64 {
    let sum: f64 = residuals.iter().zip(sigmas).map(|(r, s)| (r / s) * (r / s)).sum();
    sum / residuals.len() as f64
}

/// Standard deviations of a source's readings, in order.
pub(crate) fn sigmas(source: &Source, machine: &Machine, noise: Noise) -> Vec<f64> {
    (0..source.sensor.reading_count()).map(|i| noise.of(source.quantity(machine, i))).collect()
}

/// What one chunk adds; local columns: six of each dyad, then the extras.
struct Part {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    loss: f64,
    tally: Tally,
}

/// One pass over all data.
pub(crate) fn accumulate(
    machine: &Machine,
    sources: &Sources,
    layout: &Layout,
    unknowns: &Unknowns,
    noise: &[Noise],
    loss: Loss,
) -> Result<Normal> {
    let width = 6 * machine.dyads().len() + EXTRAS;
    let evaluators: Vec<_> = sources.all.iter().map(|s| Evaluator::new(machine, unknowns, s)).collect();
    let mut sums: Vec<Option<Part>> = sources.all.iter().map(|_| None).collect();
    sources.pass(
        |index, chunk| {
            let sigmas = sigmas(&sources.all[index], machine, noise[index]);
            part(&evaluators[index], &sources.all[index], chunk, &sigmas, loss, width)
        },
        |index, part| match &mut sums[index] {
            None => sums[index] = Some(part),
            Some(sum) => {
                sum.matrix += part.matrix;
                sum.gradient += part.gradient;
                sum.loss += part.loss;
                sum.tally.add(&part.tally);
            }
        },
    )?;
    let mut normal = Normal::zero(layout, sources.all.len());
    for (index, sum) in sums.into_iter().enumerate() {
        let Some(mut sum) = sum else { continue };
        let source = &sources.all[index];
        if source.sees_frames() {
            turn_into_coordinates(&mut sum, machine, unknowns, source.setup);
        }
        scatter(&mut normal, &sum, machine, layout, source);
        normal.loss += sum.loss;
        normal.tallies[index] = sum.tally;
    }
    Ok(normal)
}

fn part(
    evaluator: &Evaluator,
    source: &Source,
    chunk: &Chunk,
    sigmas: &[f64],
    loss: Loss,
    width: usize,
) -> Part {
    let (count, commands) = (source.sensor.reading_count(), evaluator.machine.commands().len());
    let values = source.recording.value_count();
    let mut rows = DMatrix::<f64>::zeros(width, chunk.len * count);
    let mut whitened = DVector::<f64>::zeros(chunk.len * count);
    let mut sweep = evaluator.workspace();
    let mut total = 0.0;
    let mut tally = Tally { samples: chunk.len as u64, ..Tally::default() };
    for k in 0..chunk.len {
        let q = &chunk.commands[k * commands..(k + 1) * commands];
        let measured = &chunk.values[k * values..(k + 1) * values];
        let slot = &mut rows.as_mut_slice()[k * count * width..(k + 1) * count * width];
        let residuals = evaluator.residuals(q, measured, &mut sweep, Some(slot));
        let residuals = &residuals[..count];
        let (rho, weight) = loss.at(standardised(residuals, sigmas));
        total += count as f64 * rho;
        tally.down_weighted += u64::from(weight < 0.5);
        for (i, (residual, sigma)) in residuals.iter().zip(sigmas).enumerate() {
            let factor = weight.sqrt() / sigma;
            whitened[k * count + i] = residual * factor;
            slot[i * width..(i + 1) * width].iter_mut().for_each(|x| *x *= factor);
            let angle = count == 6 && i >= 3 || count == 1 && source_is_angle(source, evaluator.machine);
            let sums = if angle { &mut tally.angle } else { &mut tally.length };
            sums.rows += 1;
            sums.squares += residual * residual;
            // The noise is that of the samples that the model claims to describe.
            if weight > COUNTS {
                sums.inliers += 1;
                sums.inlier_squares += residual * residual;
            }
        }
    }
    let matrix = &rows * rows.transpose();
    Part { matrix, gradient: &rows * whitened, loss: total, tally }
}

fn source_is_angle(source: &Source, machine: &Machine) -> bool {
    source.quantity(machine, 0) == Quantity::Angle
}

/// From increments behind `exp(dh)` to the deviations' own coordinates, `docs/model.md` (12).
fn turn_into_coordinates(sum: &mut Part, machine: &Machine, unknowns: &Unknowns, setup: usize) {
    let width = sum.gradient.len();
    let mut turn = DMatrix::identity(width, width);
    for j in 0..machine.dyads().len() {
        let dh = if j == machine.w_index() { unknowns.setups[setup].dh } else { unknowns.dh[j] };
        let block = deviation_jacobian(dh);
        for (a, row) in block.iter().enumerate() {
            for (b, x) in row.iter().enumerate() {
                turn[(6 * j + a, 6 * j + b)] = *x;
            }
        }
    }
    sum.matrix = turn.transpose() * &sum.matrix * &turn;
    sum.gradient = turn.transpose() * &sum.gradient;
}

/// Adds a source's local sums where its unknowns stand in the parameter vector.
fn scatter(normal: &mut Normal, sum: &Part, machine: &Machine, layout: &Layout, source: &Source) {
    let dyads = machine.dyads().len();
    let mut place = vec![None; sum.gradient.len()];
    let mut put = |local: usize, len: usize, role: Role| {
        if let Some(block) = layout.block(role) {
            (0..len).for_each(|k| place[local + k] = Some(block.offset + k));
        }
    };
    for j in 0..dyads {
        let role = if j == machine.w_index() { Role::Setup(source.setup) } else { Role::Dyad(j) };
        put(6 * j, 6, role);
    }
    if let Some(i) = source.tool_point.unknown() {
        put(6 * dyads, 3, Role::ToolPoint(i));
    }
    if let Some(i) = source.zero.unknown() {
        put(6 * dyads + 3, 1, Role::Zero(i));
    }
    if let Some(i) = source.length.unknown() {
        put(6 * dyads + 4, 1, Role::Length(i));
    }
    for (a, to_a) in place.iter().enumerate() {
        let Some(to_a) = *to_a else { continue };
        normal.gradient[to_a] += sum.gradient[a];
        for (b, to_b) in place.iter().enumerate() {
            if let Some(to_b) = *to_b {
                normal.matrix[(to_a, to_b)] += sum.matrix[(a, b)];
            }
        }
    }
}

/// A point in space from a slice.
pub(crate) fn point(values: &[f64]) -> Vec3<f64> {
    Vec3([values[0], values[1], values[2]])
}

/// What thin samples tell of the set-ups: as the data's matrix, but with frame `w` seen through the measured points. Seen through
/// the modelled ones, which lie off by every error of the machine, two socket points would seem to show the turn about their line.
pub(crate) fn set_up_geometry(
    machine: &Machine,
    sources: &Sources,
    layout: &Layout,
    unknowns: &Unknowns,
    noise: &[Noise],
    thin: &[Thin],
) -> DMatrix<f64> {
    let width = 6 * machine.dyads().len() + EXTRAS;
    let w = 6 * machine.w_index();
    let mut normal = Normal::zero(layout, sources.all.len());
    let mut rows = vec![0.0; MOST_READINGS * width];
    for (index, source) in sources.all.iter().enumerate() {
        let evaluator = Evaluator::new(machine, unknowns, source);
        let mut sweep = evaluator.workspace();
        let sigmas = sigmas(source, machine, noise[index]);
        let own: Vec<&Thin> = thin.iter().filter(|t| t.source == index).collect();
        let each_stands_for = source.summary.samples as f64 / own.len().max(1) as f64;
        let mut matrix = DMatrix::zeros(width, width);
        for sample in own {
            evaluator.residuals(&sample.q, &sample.values, &mut sweep, Some(&mut rows));
            for (i, sigma) in sigmas.iter().enumerate() {
                let row = &mut rows[i * width..(i + 1) * width];
                if i < 3 && matches!(source.sensor, Sensor::Position | Sensor::Pose) {
                    let unit = Vec3(std::array::from_fn(|k| if k == i { 1.0 } else { 0.0 }));
                    let seen = Wrench::at_point(unit, point(&sample.values)).to_array();
                    row[w..w + 6].iter_mut().zip(seen).for_each(|(x, y)| *x = -y);
                }
                let row = nalgebra::DVectorView::from_slice(row, width);
                matrix.ger(each_stands_for / (sigma * sigma), &row, &row, 1.0);
            }
        }
        let sum = Part { matrix, gradient: DVector::zeros(width), loss: 0.0, tally: Tally::default() };
        scatter(&mut normal, &sum, machine, layout, source);
    }
    normal.matrix
}

/// The data's matrix on general poses of the same instruments: random commands within limits, everything moving.
pub(crate) fn matrix_in_general(
    machine: &Machine,
    sources: &Sources,
    layout: &Layout,
    unknowns: &Unknowns,
) -> DMatrix<f64> {
    let width = 6 * machine.dyads().len() + EXTRAS;
    let mut rng = StdRng::seed_from_u64(20_260_104);
    let samples = 2 * layout.len;
    let mut normal = Normal::zero(layout, sources.all.len());
    for source in &sources.all {
        let evaluator = Evaluator::new(machine, unknowns, source);
        let commands = (0..samples * machine.commands().len())
            .map(|i| random_command(machine, i % machine.commands().len(), &mut rng));
        let chunk = Chunk {
            len: samples,
            lines: Vec::new(),
            time: None,
            commands: commands.collect(),
            values: vec![0.0; samples * source.recording.value_count()],
            directions: Vec::new(),
            channels: Vec::new(),
            dropped: 0,
        };
        let sigmas = vec![1.0; source.sensor.reading_count()];
        let mut sum = part(&evaluator, source, &chunk, &sigmas, Loss::Squares, width);
        if source.sees_frames() {
            turn_into_coordinates(&mut sum, machine, unknowns, source.setup);
        }
        scatter(&mut normal, &sum, machine, layout, source);
    }
    normal.matrix
}

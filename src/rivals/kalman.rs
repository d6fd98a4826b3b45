//! Calibration that goes on while samples arrive: an iterated extended Kalman filter of the local model.
//!
//! State: every deviation, and what the streams declare unknown of their set-ups. It starts at zero with the tolerances as standard
//! deviations, which is the prior of `docs/model.md` (20), so that after the last sample of a recording it stands where least squares with
//! that prior stands. `docs/rivals.md` has the equations.

mod stream;
mod unknowns;

use nalgebra::{Cholesky, DMatrix, DVector, DVectorView};

use super::Fitted;
use super::state;
use crate::calibration::CalibratedMachine;
use crate::chain::deviation_jacobian;
use crate::error::{Error, Result};
use crate::identify::{COMPONENTS, CalibrateOptions, Loss, Stop, calibrate};
use crate::lie::{Pose, Twist};
use crate::machine::{Machine, Tolerance};
use crate::recording::Recording;
use crate::units::{ByQuantity, Rms};
use unknowns::{Block, FrameW, Opened, Role, Values};

/// How a filter works.
#[derive(Clone, Copy, Debug)]
pub struct KalmanOptions {
    /// Noise of streams whose header states no `sigma`.
    pub noise: Option<ByQuantity<f64>>,
    /// How a sample counts that lies far from what the filter expects; [`Loss::Squares`] takes every sample as it comes.
    pub loss: Loss,
    /// How often a sample is linearised anew at most.
    pub iterations: usize,
    /// Standard deviation by which each deviation may wander from one sample to the next, as a part of its tolerance. 0: the machine
    /// does not change.
    pub walk: f64,
    /// Standard deviations with which unknown frames, tool points, zeros and lengths start.
    pub setup: Tolerance,
}

impl Default for KalmanOptions {
    /// No noise of its own, every sample as it comes, a machine that does not change; set-ups known to 10 mm and 10 mrad.
    fn default() -> Self {
        KalmanOptions {
            noise: None,
            loss: Loss::Squares,
            iterations: 5,
            walk: 0.0,
            setup: Tolerance { translation: 1e-2, rotation: 1e-2 },
        }
    }
}

/// A stream of samples that [`Kalman::open`] has taken up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream(usize);

/// What a sample did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// Mean square, over the readings of the sample, of measured minus expected in standard deviations of both; near 1 while the model
    /// holds.
    pub surprise: f64,
    /// Weight with which it counted, 0 to 1; 0 for a sample with a number missing, or at which the model has no reading.
    pub weight: f64,
}

/// The filter.
///
/// ```
/// use kincal::Machine;
/// use kincal::recording::Recording;
/// use kincal::rivals::{Kalman, KalmanOptions};
///
/// let machine = Machine::parse("slide.ron", r#"Machine(
///     name: "slide", units: (length: mm, angle: deg),
///     workpiece: [(frame: "w")],
///     tool: [(frame: "x", joint: Prismatic(axis: "x", travel: (0, 500))), (frame: "t", at: (0, 0, 80))],
/// )"#)?;
/// // The head of a recording says what the stream is; its samples may come one by one.
/// let head = "# measurement: position\n# sigma[um]: 1\nx[mm],px[mm],py[mm],pz[mm]\n0,0,0,80\n";
/// let head = Recording::from_bytes("live", head.as_bytes(), &machine)?;
/// let mut filter = Kalman::new(&machine, KalmanOptions::default());
/// let stream = filter.open(head.header())?;
/// let j = machine.frame_index("x").expect("a frame");
/// for k in 0..50 {
///     let x = 0.01 * f64::from(k);
///     filter.update(stream, &[x], &[x, 0.0, 0.08 - 1e-4 * x])?; // it runs down by 0.1 mm per m
/// }
/// let pitch = filter.calibrated().deviations()[j].w.0[1] - filter.calibrated().deviations()[0].w.0[1];
/// assert!((pitch - 1e-4).abs() < 1e-5);
/// # Ok::<(), kincal::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Kalman {
    machine: Machine,
    options: KalmanOptions,
    known: Option<CalibratedMachine>,
    values: Values,
    blocks: Vec<Block>,
    streams: Vec<Opened>,
    /// Covariance of the state in units of its scales.
    covariance: DMatrix<f64>,
    samples: u64,
    seen: Vec<Option<(f64, f64)>>,
}

impl Kalman {
    /// A filter that knows the tolerances of the machine file and nothing else.
    pub fn new(machine: &Machine, options: KalmanOptions) -> Self {
        let mut filter = Kalman {
            values: Values {
                dh: vec![Twist::zero(0.0); machine.dyads().len()],
                frames: Vec::new(),
                tool_points: Vec::new(),
                tool_rotations: Vec::new(),
                zeros: Vec::new(),
                lengths: Vec::new(),
            },
            machine: machine.clone(),
            options,
            known: None,
            blocks: Vec::new(),
            streams: Vec::new(),
            covariance: DMatrix::zeros(0, 0),
            samples: 0,
            seen: vec![None; machine.commands().len()],
        };
        for j in (0..machine.dyads().len()).filter(|j| *j != machine.w_index()) {
            filter.grow(Role::Dyad(j), machine.tolerance(j).to_array().to_vec());
        }
        filter
    }

    /// Starting values for unknown frames and tool points, from a file whose calibration knows them.
    pub fn with_setups(mut self, known: &CalibratedMachine) -> Self {
        self.known = Some(known.clone());
        self
    }

    /// Takes in one sample: commands (m or rad, machine order) and measured numbers as in a chunk of a recording.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where the number of commands or readings is not that of machine and stream.
    pub fn update(&mut self, stream: Stream, commands: &[f64], measured: &[f64]) -> Result<Update> {
        let opened = self.streams.get(stream.0).cloned();
        let opened = opened.ok_or_else(|| Error::Undetermined {
            what: "this filter has not taken up that stream".into(),
            mend: "open the stream with the filter that its samples go to".into(),
        })?;
        let count = opened.sensor.reading_count();
        if commands.len() != self.machine.commands().len() {
            return Err(miscounted("commands", commands.len(), self.machine.commands().len()));
        }
        if measured.len() != count {
            return Err(miscounted("readings", measured.len(), count));
        }
        if !commands.iter().chain(measured).all(|x| x.is_finite()) {
            return Ok(Update { surprise: 0.0, weight: 0.0 });
        }
        self.start_levels(&opened, commands, measured);
        let wander = self.options.walk * self.options.walk;
        for block in self.blocks.iter().filter(|b| matches!(b.role, Role::Dyad(_) | Role::Frame(_))) {
            (block.offset..block.offset + 6).for_each(|k| self.covariance[(k, k)] += wander);
        }
        let mut noise =
            DMatrix::from_diagonal(&DVector::from_iterator(count, opened.sigmas.iter().map(|s| s * s)));
        let mut offset = DVector::zeros(self.covariance.nrows());
        let (mut surprise, mut weight) = (0.0, 1.0);
        let (mut rows, mut gain) = (DMatrix::zeros(count, 0), DMatrix::zeros(0, count));
        for i in 0..self.options.iterations.max(1) {
            let (residual, h) = self.linearised(&opened, commands, measured, &offset);
            // What the sample would have shown at the state before it.
            let innovation = residual + &h * &offset;
            let ph = &self.covariance * h.transpose();
            let spread = &h * &ph;
            if i == 0 {
                // A distance of zero has no direction: such a sample says nothing.
                let Some(factor) = Cholesky::new(&spread + &noise) else {
                    return Ok(Update { surprise: f64::INFINITY, weight: 0.0 });
                };
                surprise = innovation.dot(&factor.solve(&innovation)) / count as f64;
                weight = self.options.loss.at(surprise).1;
                if weight <= 0.0 {
                    return Ok(Update { surprise, weight });
                }
                noise /= weight;
            }
            let Some(factor) = Cholesky::new(spread + &noise) else { break };
            gain = factor.solve(&ph.transpose()).transpose();
            rows = h;
            let next = &gain * innovation;
            let change = (&next - &offset).amax();
            offset = next;
            if change < 1e-9 {
                break;
            }
        }
        if gain.nrows() == offset.len() {
            // Joseph: (I - K H) P (I - K H)ᵀ + K R Kᵀ, in products of low rank.
            let left = &self.covariance - &gain * (&rows * &self.covariance);
            self.covariance =
                &left - (&left * rows.transpose()) * gain.transpose() + &gain * &noise * gain.transpose();
            let transposed = self.covariance.transpose();
            self.covariance = (&self.covariance + transposed) * 0.5;
            self.values = self.moved(&offset);
            self.settle_free_frames(&offset);
        }
        self.samples += 1;
        for (seen, q) in self.seen.iter_mut().zip(commands) {
            let (low, high) = seen.unwrap_or((*q, *q));
            *seen = Some((low.min(*q), high.max(*q)));
        }
        Ok(Update { surprise, weight })
    }

    /// All samples of a recording, in order.
    ///
    /// # Errors
    /// If it cannot be read; as [`Kalman::open`].
    pub fn follow(&mut self, recording: &Recording) -> Result<()> {
        let stream = self.open(recording.header())?;
        let (commands, values) = (self.machine.commands().len(), recording.value_count());
        for chunk in recording.chunks()? {
            let chunk = chunk?;
            for k in 0..chunk.len {
                let q = &chunk.commands[k * commands..(k + 1) * commands];
                self.update(stream, q, &chunk.values[k * values..(k + 1) * values])?;
            }
        }
        Ok(())
    }

    /// Zeros and lengths enter a reading linearly: the first one says where they start.
    fn start_levels(&mut self, opened: &Opened, commands: &[f64], measured: &[f64]) {
        let zero = opened.zero.unknown().filter(|i| self.values.zeros[*i].2.is_none());
        let length = opened.length.unknown().filter(|i| self.values.lengths[*i].1.is_none());
        if zero.is_none() && length.is_none() {
            return;
        }
        let still = DVector::zeros(self.covariance.nrows());
        let residual = self.linearised(opened, commands, measured, &still).0[0];
        if !residual.is_finite() {
            return;
        }
        if let Some(i) = zero {
            self.values.zeros[i].2 = Some(residual);
        }
        if let Some(i) = length {
            self.values.lengths[i].1 = Some(-residual);
        }
    }

    /// A frame that is found from nothing keeps no deviation: its pose moves, and its covariance goes with it.
    fn settle_free_frames(&mut self, offset: &DVector<f64>) {
        for (i, frame) in self.values.frames.iter_mut().enumerate().filter(|(_, f)| f.free) {
            let Some(block) = self.blocks.iter().find(|b| b.role == Role::Frame(i)) else { continue };
            let step = DVectorView::from_slice(&offset.as_slice()[block.offset..block.offset + 6], 6);
            frame.previous_from_w = frame.previous_from_w * Pose::exp(frame.dh);
            let turn = deviation_jacobian(frame.dh);
            frame.dh = Twist::zero(0.0);
            if step.amax() == 0.0 {
                continue;
            }
            let own = DMatrix::from_fn(6, 6, |a, b| turn[a][b] * block.scale[b] / block.scale[a]);
            let rows = &own * self.covariance.rows(block.offset, 6);
            self.covariance.rows_mut(block.offset, 6).copy_from(&rows);
            let columns = self.covariance.columns(block.offset, 6) * own.transpose();
            self.covariance.columns_mut(block.offset, 6).copy_from(&columns);
        }
    }

    /// Samples taken in.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Names of the unknowns, in the order of [`Kalman::covariance`]: `frame.component`, with the set-up in brackets where frame `w`
    /// belongs to one; tool points, zeros and lengths by their own names.
    pub fn names(&self) -> Vec<String> {
        let dyads = self.machine.dyads();
        let name = |block: &Block, k: usize| match block.role {
            Role::Dyad(j) => format!("{}.{}", dyads[j].frame, COMPONENTS[k]),
            Role::Frame(i) => {
                let setup = &self.values.frames[i].setup;
                let setup = if setup.is_empty() { String::new() } else { format!("[{setup}]") };
                format!("{}{setup}.{}", dyads[self.machine.w_index()].frame, COMPONENTS[k])
            }
            Role::ToolPoint(i) => format!("{}.{}", self.values.tool_points[i].0, ["x", "y", "z"][k]),
            Role::ToolRotation(i) => {
                format!("{}.{}", self.values.tool_rotations[i].0, COMPONENTS[3 + k])
            }
            Role::Zero(i) => format!("zero of {}", self.values.zeros[i].1),
            Role::Length(_) => "length".to_string(),
        };
        self.blocks.iter().flat_map(|b| (0..b.scale.len()).map(|k| name(b, k)).collect::<Vec<_>>()).collect()
    }

    /// Covariance of all unknowns at this moment, m and rad.
    pub fn covariance(&self) -> DMatrix<f64> {
        let scales: Vec<f64> = self.blocks.iter().flat_map(|b| b.scale.iter().copied()).collect();
        DMatrix::from_fn(scales.len(), scales.len(), |a, b| self.covariance[(a, b)] * scales[a] * scales[b])
    }

    /// The machine as the filter knows it at this moment.
    pub fn calibrated(&self) -> CalibratedMachine {
        let mut deviations = self.values.dh.clone();
        let known: Vec<_> = self.values.frames.iter().filter(|f| !f.free).collect();
        if !known.is_empty() {
            let sum = known.iter().fold(Twist::zero(0.0), |sum, f| sum + f.dh);
            deviations[self.machine.w_index()] = sum.times(1.0 / known.len() as f64);
        }
        let mut found = CalibratedMachine::found(
            &self.machine,
            deviations,
            self.seen.clone(),
            self.samples,
            Rms::default(),
        );
        let frame = |f: &FrameW| (f.setup.clone(), f.previous_from_w * Pose::exp(f.dh));
        found.setups = self.values.frames.iter().map(frame).collect();
        found.tool_points = self.values.tool_points.clone();
        found.tool_rotations = self.values.tool_rotations.clone();
        let zero = |(s, c, z): &(String, String, Option<f64>)| Some((s.clone(), c.clone(), (*z)?));
        found.zeros = self.values.zeros.iter().filter_map(zero).collect();
        found.lengths = self.values.lengths.iter().filter_map(|(s, l)| Some((s.clone(), (*l)?))).collect();
        found
    }
}

fn miscounted(what: &str, got: usize, expected: usize) -> Error {
    Error::Undetermined {
        what: format!("a sample with {got} {what} where there are {expected}"),
        mend: "give one number for each command of the machine and each reading of the stream".into(),
    }
}

/// The filter over whole recordings. Where a recording states no `sigma` and none is given, the noise is that of least squares on the
/// same samples; unknown set-ups start where they fit the machine as declared.
pub(super) fn fit(machine: &Machine, recordings: &[Recording], options: KalmanOptions) -> Result<Fitted> {
    let silent = |r: &Recording| r.header().sigma.is_none() || r.value_count() == 6;
    let fallback = if options.noise.is_none() && recordings.iter().any(silent) {
        let batch = CalibrateOptions { loss: options.loss, ..CalibrateOptions::default() };
        Some(calibrate(machine, recordings, batch)?.1.recordings)
    } else {
        None
    };
    let start = state::declared(machine, recordings)?;
    let mut filter = Kalman::new(machine, options).with_setups(&start);
    for (i, recording) in recordings.iter().enumerate() {
        if let Some(of) = fallback.as_ref().map(|all| &all[i]) {
            // A pose has two kinds of reading and one sigma: its angles by their own residuals.
            let rad = of
                .geometric
                .rad
                .map_or(of.sigma, |rad| if of.geometric.m.is_some() { rad / 3f64.sqrt() } else { of.sigma });
            filter.options.noise = Some(ByQuantity { m: of.sigma, rad });
        }
        filter.follow(recording)?;
    }
    Ok(Fitted { calibrated: filter.calibrated(), steps: filter.samples() as usize, stop: Stop::Converged })
}

//! The calibrated machine as a linear model around its optimum: residuals, and how each reading answers to a small twist of every
//! frame, before and behind its joint. What a diagnosis works on.

use nalgebra::DMatrix;

use super::evaluator::Moment;
use super::source::{Known, Sources};
use super::unknowns::{Layout, Unknowns};
use super::{
    Evaluator, Fit, Found, Info, Model, Options, Placed, Problem, enough_for_setups, enough_to_start, fit,
    information, is_of_setup, place, settle,
};
use crate::error::Result;
use crate::feature::{Follow, FollowOptions, Samples, first_directions, gravity_of};
use crate::machine::Machine;
use crate::recording::Recording;
use crate::units::Quantity;
use crate::variation::Varying;

/// More samples than these in all are thinned out evenly.
const MOST_SAMPLES: u64 = 40_000;

/// Readings of one recording among the rows.
#[derive(Clone, Debug)]
pub(crate) struct Span {
    /// File name.
    pub label: String,
    /// First row and one behind the last.
    pub rows: (usize, usize),
    /// First sample and one behind the last.
    pub samples: (usize, usize),
    /// Scalar readings of a sample.
    pub readings: usize,
    /// A longer time between two samples is a pause, s.
    pub pause_after: f64,
}

/// Rows of all recordings, one per scalar reading, sample by sample.
pub(crate) struct Linear {
    pub fit: Fit,
    pub spans: Vec<Span>,
    /// Measured less modelled, m or rad.
    pub residual: Vec<f64>,
    /// Whether the reading is an angle.
    pub angle: Vec<bool>,
    /// Which reading of its sample a row is.
    pub reading: Vec<usize>,
    /// Sample of each row, counted over all recordings.
    pub sample: Vec<usize>,
    /// Line of each sample in its file.
    pub lines: Vec<u64>,
    /// Columns by six of each dyad: change with an increment behind `exp(dh)`.
    pub before: DMatrix<f64>,
    /// The same behind the joint.
    pub carried: DMatrix<f64>,
    /// Columns of everything constant: deviations and set-ups, each times what is possible at most of it.
    pub constant: DMatrix<f64>,
    /// What features see, one stretch a recording.
    pub samples: Vec<Samples>,
}

/// Deviations may be this many tolerances large before the prior on geometry holds them: geometry is to take all that it can.
const GENEROUS: f64 = 3.0;
/// Set-ups that nothing is known of: m and rad.
const FREE: f64 = 10.0;

/// Calibrates with constant deviations and takes the rows there; `dead_bands` by dyad, m or rad.
pub(crate) fn linear(
    machine: &Machine,
    recordings: &[Recording],
    options: Options,
    dead_bands: &[f64],
    progress: &dyn Fn(&str),
) -> Result<Linear> {
    let (varying, model) = (Varying::default(), Model::default());
    let sources = Sources::new(recordings, machine, &varying, &model.dead_bands, progress)?;
    enough_to_start(machine, &sources)?;
    enough_for_setups(&sources)?;
    let layout = Layout::new(machine, &sources, &varying, 1.0);
    let mut problem = Problem::new(machine, &sources, &layout, &varying, is_of_setup);
    problem.progress = progress;
    let start = Unknowns::nominal(machine, &sources, &varying);
    let Placed { solution: placed, noise, thin } = place(&mut problem, start)?;
    let (nominal, declared) = (placed.normal.tallies.clone(), placed.unknowns.clone());
    problem.loss = options.loss;
    problem.prior = options.prior;
    problem.free = vec![true; layout.len];
    let found = settle(&problem, options.solver, placed.unknowns, noise)?;
    let open = problem.open(&found.solution.unknowns, &found.noise, &thin, information::OPEN);
    let information = Info::new(&found.solution.normal.matrix, &layout, problem.prior, open);
    let fit = fit::report(&problem, &nominal, &declared, &found, information, options)?;
    progress("taking rows");
    rows(machine, &sources, &found, fit, dead_bands)
}

fn rows(machine: &Machine, sources: &Sources, found: &Found, fit: Fit, bands: &[f64]) -> Result<Linear> {
    let unknowns = &found.solution.unknowns;
    let dyads = machine.dyads().len();
    let stride = sources.samples().div_ceil(MOST_SAMPLES).max(1);
    let kept = |source: &super::source::Source| source.summary.samples.div_ceil(stride) as usize;
    let count: usize = sources.all.iter().map(|s| kept(s) * s.sensor.reading_count()).sum();
    let mut linear = Linear {
        fit,
        spans: Vec::new(),
        residual: Vec::with_capacity(count),
        angle: Vec::with_capacity(count),
        reading: Vec::with_capacity(count),
        sample: Vec::with_capacity(count),
        lines: Vec::new(),
        before: DMatrix::zeros(count, 6 * dyads),
        carried: DMatrix::zeros(count, 6 * dyads),
        constant: DMatrix::zeros(0, 0),
        samples: Vec::new(),
    };
    let scales: Vec<f64> = (0..dyads).flat_map(|j| machine.tolerance(j).to_array()).collect();
    let several = sources.setups.len();
    let extras = 3 * sources.tool_points.len() + sources.zeros.len() + sources.lengths.len();
    let width = 6 * dyads + 6 * (several - 1) + extras;
    linear.constant = DMatrix::zeros(count, width);
    let w = machine.w_index();
    for source in &sources.all {
        let evaluator = Evaluator::new(machine, unknowns, source);
        let mut work = evaluator.workspace();
        let (readings, values) = (source.sensor.reading_count(), source.recording.value_count());
        let mut buffer = vec![0.0; readings * evaluator.width()];
        let first = linear.residual.len();
        let first_sample = linear.lines.len();
        let mut number = 0u64;
        let options = FollowOptions {
            recording: source.recording.name().to_string(),
            dead_bands: bands.to_vec(),
            first_directions: first_directions(machine, bands, source.recording.chunks()?)?,
            pause_after: source.summary.pause_after.unwrap_or(f64::INFINITY),
            gravity_b: gravity_of(source.recording, machine, Some(unknowns.setups[source.setup].pose())),
            channels: source.recording.extra_channels().iter().map(|c| c.name.clone()).collect(),
            with_gravity: true,
        };
        let mut all: Option<Samples> = None;
        for item in Follow::new(machine, source.recording.chunks()?, &options) {
            let (chunk, samples) = item?;
            let mut kept = Vec::new();
            for k in 0..chunk.len {
                number += 1;
                if !(number - 1).is_multiple_of(stride) {
                    continue;
                }
                kept.push(k);
                let commands = machine.commands().len();
                let q = &chunk.commands[k * commands..(k + 1) * commands];
                let measured = &chunk.values[k * values..(k + 1) * values];
                let residuals = evaluator.residuals(q, measured, Moment::Still, &mut work, Some(&mut buffer));
                let carried = evaluator.carried_rows(measured, &work);
                for i in 0..readings {
                    let at = linear.residual.len();
                    let row = &buffer[i * evaluator.width()..(i + 1) * evaluator.width()];
                    linear.residual.push(residuals[i]);
                    linear.angle.push(source.quantity(machine, i) == Quantity::Angle);
                    linear.reading.push(i);
                    linear.sample.push(linear.lines.len());
                    for c in 0..6 * dyads {
                        linear.before[(at, c)] = row[c];
                        linear.carried[(at, c)] = carried[i][c];
                        let unknown = c / 6 == w && sources.frame_unknown[source.setup];
                        let scale = if unknown { FREE } else { GENEROUS * scales[c] };
                        let to = match c / 6 == w && source.setup > 0 {
                            true => 6 * dyads + 6 * (source.setup - 1) + c % 6,
                            false => c,
                        };
                        linear.constant[(at, to)] = row[c] * scale;
                    }
                    let mut put = |at_column: usize, x: f64| linear.constant[(at, at_column)] = FREE * x;
                    let behind = 6 * dyads + 6 * (several - 1);
                    if let Known::Unknown(p) = source.tool_point {
                        (0..3).for_each(|k| put(behind + 3 * p + k, row[6 * dyads + k]));
                    }
                    let behind = behind + 3 * sources.tool_points.len();
                    if let Known::Unknown(z) = source.zero {
                        put(behind + z, row[6 * dyads + 3]);
                    }
                    if let Known::Unknown(l) = source.length {
                        put(behind + sources.zeros.len() + l, row[6 * dyads + 4]);
                    }
                }
                linear.lines.push(chunk.lines[k]);
            }
            let samples = if kept.len() == samples.len { samples } else { samples.chosen(&kept) };
            match &mut all {
                None => all = Some(samples),
                Some(all) => all.append(samples),
            }
        }
        linear.samples.push(all.unwrap_or_default());
        linear.spans.push(Span {
            label: source.label.clone(),
            rows: (first, linear.residual.len()),
            samples: (first_sample, linear.lines.len()),
            readings,
            pause_after: source.summary.pause_after.unwrap_or(f64::INFINITY),
        });
    }
    Ok(linear)
}

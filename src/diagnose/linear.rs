//! The calibrated machine as a linear model around its optimum: residuals, and how each reading answers to a small twist of every
//! frame, before and behind its joint. What a diagnosis works on.

use std::collections::HashMap;
use std::sync::{Mutex, OnceLock};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::equations::Column;
use crate::error::Result;
use crate::feature::{Follow, FollowOptions, Samples, first_directions, gravity_of};
use crate::identify::{
    CalibrateOptions, EXTRAS, Evaluator, Fit, Known, Layout, Moment, Places, Role, Source, Sources, Stretch,
    Unknowns, optimum, sources,
};
use crate::machine::Machine;
use crate::motion::Motion;
use crate::recording::{Chunk, Recording, step_of};
use crate::units::Quantity;
use crate::variation::{CONSTANT, Term};

/// More rows than these in all are thinned out evenly: along a path, where neighbours are put together, and among settled positions, each of
/// which has to be looked at by itself.
const MOST_ROWS: u64 = 40_000;
const MOST_SETTLED: u64 = 6_000;

/// Readings of one recording among the rows.
#[derive(Clone, Debug)]
pub(super) struct Span {
    /// File name.
    pub label: String,
    /// Name of its set-up.
    pub setup: String,
    /// First row and one behind the last.
    pub rows: (usize, usize),
    /// First sample and one behind the last.
    pub samples: (usize, usize),
    /// Scalar readings of a sample.
    pub readings: usize,
    /// A longer time between two samples is a pause, s.
    pub pause_after: f64,
    /// Step to which readings of lengths and of angles are rounded, m and rad; 0 where none is seen.
    pub steps: [f64; 2],
}

/// Rows of all recordings, one per scalar reading, sample by sample.
pub(super) struct Linear {
    pub fit: Fit,
    pub spans: Vec<Span>,
    /// Measured less modelled, m or rad; with what is in `acting`.
    pub residual: Vec<f64>,
    /// What effects do that it is linearised around, m or rad.
    pub acting: Vec<f64>,
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
    /// The same as if every joint had turned round just before, once it has been asked for.
    turned: OnceLock<Vec<Samples>>,
    /// Curves of what was there before each joint first turned round, by whether it lasts, and of its sides, once they have been asked for.
    pub(super) pasts: Mutex<PastCurves>,
    /// Every so manieth sample of the recordings was taken, of so many.
    pub every: u64,
    pub all_samples: u64,
    /// What is known of each constant column beforehand.
    tolerated: Vec<(Option<f64>, f64)>,
    /// Where the machine is linearised.
    unknowns: Unknowns,
}

/// Two sets of curves by joint and by whether its past lasts.
pub(super) type PastCurves = HashMap<(usize, bool), [Vec<Column>; 2]>;

/// Where a machine is to be linearised anew.
pub(super) struct Displaced {
    /// What is to be added to everything constant, in units of [`Linear::constant`].
    pub constants: Vec<f64>,
    /// What deviations depend on besides, on the machine and not on the readings.
    pub terms: Vec<Term>,
    /// Its coefficients.
    pub coefficients: Vec<f64>,
    /// Features of all parts of all terms, by sample over all recordings.
    pub features: Vec<Vec<f64>>,
}

/// Deviations may be this many tolerances large before the prior on geometry holds them: geometry is to take all that it can.
const GENEROUS: f64 = 3.0;
/// Set-ups that nothing is known of: m and rad.
const FREE: f64 = 10.0;
/// About so many readings show the step that they are rounded to.
const ENOUGH: usize = 4096;
/// Samples that a core takes at a time.
const SIDE_BY_SIDE: usize = 128;

/// Calibrates with constant deviations and takes the rows there; `dead_bands` by dyad, m or rad.
pub(super) fn linear(
    machine: &Machine,
    recordings: &[Recording],
    options: CalibrateOptions,
    dead_bands: &[f64],
    in_motion: bool,
    progress: &dyn Fn(&str),
) -> Result<Linear> {
    let found = optimum(machine, recordings, options, progress)?;
    progress("taking rows");
    let most = if in_motion { MOST_ROWS } else { MOST_SETTLED };
    let every = found.sources.readings().div_ceil(most).max(1);
    rows(machine, &found.sources, (found.unknowns, found.fit), dead_bands, &[], every)
}

impl Linear {
    /// What features see of joints that have turned round just before each stretch.
    pub fn turned_before(&self) -> &[Samples] {
        self.turned.get_or_init(|| self.samples.iter().map(Samples::turned_before).collect())
    }

    /// Step to which readings of lengths, or of angles, are rounded, as its root mean square over rows, m or rad.
    pub fn step(&self, angle: bool) -> f64 {
        let rows = |span: &Span| (span.rows.1 - span.rows.0) as f64;
        let all: f64 = self.spans.iter().map(rows).sum();
        let squares = self.spans.iter().map(|span| rows(span) * span.steps[usize::from(angle)].powi(2));
        (squares.sum::<f64>() / all.max(1.0)).sqrt()
    }

    /// Of every constant column that tolerances hold the information of its prior, and where zero lies, seen from the optimum; `None` of
    /// what nothing is known of. In the units of the columns.
    pub fn tolerated(&self) -> Vec<(Option<f64>, f64)> {
        self.tolerated.clone()
    }

    /// The same readings where geometry and effects have been displaced.
    pub fn displaced(
        &self,
        machine: &Machine,
        recordings: &[Recording],
        dead_bands: &[f64],
        to: &Displaced,
    ) -> Result<Linear> {
        let sources = sources(machine, recordings, &|_| {})?;
        let layout = Layout::new(machine, &sources, &CONSTANT, 1.0);
        let columns = Columns::new(machine, &sources);
        let mut step = DVector::zeros(layout.len);
        for block in &layout.blocks {
            let first = columns.first(block.role);
            for k in 0..block.len {
                step[block.offset + k] = columns.scale(block.role, k) * to.constants[first + k];
            }
        }
        let mut unknowns = self.unknowns.stepped(&layout, &step);
        unknowns.varying.terms.clone_from(&to.terms);
        unknowns.coefficients.clone_from(&to.coefficients);
        let mut displaced =
            rows(machine, &sources, (unknowns, self.fit.clone()), dead_bands, &to.features, self.every)?;
        displaced.unknowns.varying = CONSTANT.clone();
        displaced.unknowns.coefficients.clear();
        Ok(displaced)
    }
}

/// Columns of everything constant, in their places, and how much of each is possible.
struct Columns {
    places: Places,
    w: usize,
    /// By set-up.
    frame_unknown: Vec<bool>,
    /// By dyad, six each.
    tolerances: Vec<f64>,
}

impl Columns {
    fn new(machine: &Machine, sources: &Sources) -> Self {
        Columns {
            places: Places::new(machine, sources),
            w: machine.w_index(),
            frame_unknown: sources.frame_unknown.clone(),
            tolerances: (0..machine.dyads().len()).flat_map(|j| machine.tolerance(j).to_array()).collect(),
        }
    }

    fn count(&self) -> usize {
        self.places.len()
    }

    /// First column of a block; what varies has none and stands behind the last.
    fn first(&self, role: Role) -> usize {
        match role {
            Role::Dyad(j) => 6 * j,
            Role::Setup(s) => self.places.frame_w(s),
            Role::ToolPoint(i) => self.places.tool_point(i),
            Role::Zero(i) => self.places.zero(i),
            Role::Length(i) => self.places.length(i),
            Role::ToolRotation(i) => self.places.tool_rotation(i),
            Role::Part { .. } | Role::Term(_) => self.count(),
        }
    }

    /// What is possible at most of number `k` of a block, m or rad.
    fn scale(&self, role: Role, k: usize) -> f64 {
        match role {
            Role::Dyad(j) => GENEROUS * self.tolerances[6 * j + k],
            Role::Setup(s) if !self.frame_unknown[s] => GENEROUS * self.tolerances[6 * self.w + k],
            _ => FREE,
        }
    }
}

/// `features`: of all parts of the terms of `unknowns`, by sample; of the samples, every so manieth is taken.
fn rows(
    machine: &Machine,
    sources: &Sources,
    (unknowns, fit): (Unknowns, Fit),
    bands: &[f64],
    features: &[Vec<f64>],
    every: u64,
) -> Result<Linear> {
    let (dyads, columns) = (machine.dyads().len(), Columns::new(machine, sources));
    let kept = |source: &Source| source.summary.samples.div_ceil(every) as usize;
    let count: usize = sources.all.iter().map(|s| kept(s) * s.sensor.reading_count()).sum();
    let mut linear = Linear {
        fit,
        spans: Vec::new(),
        residual: Vec::with_capacity(count),
        acting: Vec::with_capacity(count),
        angle: Vec::with_capacity(count),
        reading: Vec::with_capacity(count),
        sample: Vec::with_capacity(count),
        lines: Vec::new(),
        before: DMatrix::zeros(count, 6 * dyads),
        carried: DMatrix::zeros(count, 6 * dyads),
        constant: DMatrix::zeros(count, columns.count()),
        samples: Vec::new(),
        turned: OnceLock::new(),
        pasts: Mutex::default(),
        every,
        all_samples: sources.samples(),
        tolerated: vec![(None, 0.0); columns.count()],
        unknowns,
    };
    let unknowns = linear.unknowns.clone();
    for block in &Layout::new(machine, sources, &CONSTANT, 1.0).blocks {
        let (first, total) = (columns.first(block.role), unknowns.total(block));
        for k in (0..block.len).filter(|_| block.prior) {
            let scale = columns.scale(block.role, k);
            linear.tolerated[first + k] = (Some((scale / block.scale[k]).powi(2)), -total[k] / scale);
        }
    }
    for source in &sources.all {
        let evaluator = Evaluator::new(machine, &unknowns, source);
        let (readings, values) = (source.sensor.reading_count(), source.recording.value_count());
        let commands = machine.commands().len();
        let first = linear.residual.len();
        let first_sample = linear.lines.len();
        let mut number = 0u64;
        let displaced = (!features.is_empty()).then(|| {
            let of = |column: &Vec<f64>| column[first_sample..first_sample + kept(source)].to_vec();
            let features = features.iter().map(of).collect();
            let (chunk, motion) = (Chunk::default(), Motion::default());
            Stretch { chunk: chunk.into(), motion, features, commands: machine.commands().len() }
        });
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
        let mut seen: Vec<Vec<f64>> = vec![Vec::new(); values];
        for item in Follow::new(machine, source.recording.chunks()?, &options) {
            let (chunk, samples) = item?;
            for (i, seen) in seen.iter_mut().enumerate().filter(|(_, seen)| seen.len() < ENOUGH) {
                seen.extend(chunk.values.iter().skip(i).step_by(values));
            }
            let kept: Vec<usize> =
                (0..chunk.len).filter(|k| (number + *k as u64).is_multiple_of(every)).collect();
            number += chunk.len as u64;
            let begins = linear.lines.len() - first_sample;
            let numbered: Vec<(usize, usize)> = kept.iter().copied().zip(begins..).collect();
            let some = |some: &[(usize, usize)]| {
                let mut work = evaluator.workspace();
                let one = |(k, number): &(usize, usize)| {
                    let mut rows = vec![0.0; readings * evaluator.width()];
                    let q = &chunk.commands[k * commands..(k + 1) * commands];
                    let measured = &chunk.values[k * values..(k + 1) * values];
                    let moment =
                        displaced.as_ref().map_or(Moment::Still, |stretch| Moment::At(stretch, *number));
                    let residuals = evaluator.residuals(q, measured, moment, &mut work, Some(&mut rows));
                    (residuals, rows, evaluator.carried_rows(measured, &work))
                };
                some.iter().map(one).collect::<Vec<_>>()
            };
            let computed: Vec<_> = numbered.par_chunks(SIDE_BY_SIDE).map(some).collect();
            for (k, (residuals, buffer, carried)) in kept.iter().zip(computed.into_iter().flatten()) {
                for i in 0..readings {
                    let at = linear.residual.len();
                    let row = &buffer[i * evaluator.width()..(i + 1) * evaluator.width()];
                    let by_terms = &row[6 * dyads + EXTRAS..];
                    let acting = (by_terms.iter().zip(&unknowns.coefficients)).map(|(x, c)| x * c).sum();
                    linear.residual.push(residuals[i] + acting);
                    linear.acting.push(acting);
                    linear.angle.push(source.quantity(machine, i) == Quantity::Angle);
                    linear.reading.push(i);
                    linear.sample.push(linear.lines.len());
                    for c in 0..6 * dyads {
                        linear.before[(at, c)] = row[c];
                        linear.carried[(at, c)] = carried[i][c];
                        let role = match c / 6 {
                            j if j == columns.w => Role::Setup(source.setup),
                            j => Role::Dyad(j),
                        };
                        linear.constant[(at, columns.first(role) + c % 6)] =
                            row[c] * columns.scale(role, c % 6);
                    }
                    let mut put = |role: Role, from: usize, count: usize| {
                        for k in 0..count {
                            linear.constant[(at, columns.first(role) + k)] =
                                columns.scale(role, k) * row[6 * dyads + from + k];
                        }
                    };
                    if let Known::Unknown(p) = source.tool_point {
                        put(Role::ToolPoint(p), 0, 3);
                    }
                    if let Known::Unknown(z) = source.zero {
                        put(Role::Zero(z), 3, 1);
                    }
                    if let Known::Unknown(l) = source.length {
                        put(Role::Length(l), 4, 1);
                    }
                    if let Known::Unknown(r) = source.tool_rotation {
                        put(Role::ToolRotation(r), 5, 3);
                    }
                }
                linear.lines.push(chunk.lines[*k]);
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
            setup: sources.setups[source.setup].clone(),
            rows: (first, linear.residual.len()),
            samples: (first_sample, linear.lines.len()),
            readings,
            pause_after: source.summary.pause_after.unwrap_or(f64::INFINITY),
            steps: [false, true].map(|angle| {
                let own =
                    (0..readings).filter(|i| (source.quantity(machine, *i) == Quantity::Angle) == angle);
                own.map(|i| seen.get(i).map_or(0.0, |seen| step_of(seen))).fold(0.0, f64::max)
            }),
        });
    }
    Ok(linear)
}

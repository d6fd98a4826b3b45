//! The result of an identification as data.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::evaluator::{Evaluator, Moment};
use super::judge::{Figures, PieceFit, judge};
use super::normal::{matrix_in_general, rms_over, sigmas, standardised};
use super::plausible::{Plausibility, plausibility};
use super::solve::Problem;
use super::source::{Known, Which};
use super::stretch::Stretch;
use super::tally::Tally;
use super::unknowns::{Block, Role, Unknowns};
use super::warnings::warnings;
use super::{CalibrateOptions, Found, Information, Loss, Solver, Stop};

use crate::error::Result;
use crate::error_motion::Motions;
use crate::lie::Vec3;
use crate::location::{LocationErrors, location_errors};
use crate::residual::Sizes;
use crate::units::{ByQuantity, Rms, field_by_quantity, unbounded};

/// Names of a twist's components in the order (v; w).
pub const COMPONENTS: [&str; 6] = ["vx", "vy", "vz", "wx", "wy", "wz"];
/// Down-weighted samples that are listed one by one; all are counted.
const LISTED: usize = 50;

field_by_quantity!(rms);

/// Everything that an identification has to say. Numbers in SI.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Fit {
    /// Name of the machine.
    pub machine: String,
    /// Samples used.
    pub samples: u64,
    /// Rows left out because a number was missing.
    pub dropped: u64,
    /// Scalar readings used.
    pub readings: u64,
    /// RMS over samples: with the machine as declared (only what nobody has stated is fitted), and with the identified deviations.
    #[serde(flatten, with = "rms")]
    pub rms: ByQuantity<Option<BeforeAfter>>,
    /// One entry a recording.
    pub recordings: Vec<RecordingFit>,
    /// The scheme.
    pub solver: Solver,
    /// The loss.
    pub loss: Loss,
    /// Whether the tolerances acted as a prior.
    pub prior: bool,
    /// Why it stopped.
    pub stop: Stop,
    /// Steps taken, all rounds of noise estimation together.
    pub steps: usize,
    /// Half the sum of squared (robust) standardised residuals at the end.
    pub loss_value: f64,
    /// How many unknowns there are, set-ups included.
    pub unknowns: usize,
    /// How many independent combinations of them these recordings see.
    pub rank: usize,
    /// How many would be seen on general poses with all joints moving.
    pub rank_in_general: usize,
    /// Every component of every deviation.
    pub parameters: Vec<ParameterFit>,
    /// Combinations of deviations, best seen first; `share` 0 means that the data say nothing about it.
    pub combinations: Vec<Combination>,
    /// The same geometry as ISO 230-1 location errors, `docs/location.md`.
    pub location_errors: LocationErrors,
    /// What the recordings leave open of the set-ups themselves, in words.
    pub open: Vec<String>,
    /// Set-ups as found.
    pub setups: Vec<SetupFit>,
    /// Samples with a weight below one half.
    pub down_weighted: u64,
    /// Samples further off than the noise would bring one in a hundred recordings like these, whatever their weight.
    pub outliers: u64,
    /// The worst of both, one by one.
    pub suspects: Vec<Suspect>,
    /// The pieces of a model that is keyed on directions of travel; empty for others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pieces: Vec<PieceFit>,
    /// Samples that were not used but judged, all pieces together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOut>,
    /// Coefficients of the terms.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub coefficients: Vec<CoefficientFit>,
    /// By recording and quantity, whether what is left can be true.
    #[serde(default)]
    pub plausibility: Vec<Plausibility>,
    /// What to be careful about, in sentences.
    pub warnings: Vec<String>,
    /// Samples of the fit by piece.
    #[serde(skip)]
    pub piece_samples: Vec<u64>,
    /// The information behind it.
    #[serde(skip)]
    pub information: Information,
}

/// A figure before and after identification.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BeforeAfter {
    /// Machine as declared, only what nobody has stated is fitted.
    pub nominal: f64,
    /// With constant deviations.
    pub geometric: f64,
}

/// Residuals of samples that were held out.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct HeldOut {
    /// Machine as declared, only what nobody has stated is fitted.
    pub nominal: Figures,
    /// With the model found.
    pub model: Figures,
}

/// Coefficient of a term.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct CoefficientFit {
    /// Its value, in its own SI unit.
    pub value: f64,
    /// Standard error, all other unknowns free.
    #[serde(deserialize_with = "unbounded")]
    pub std_error: f64,
}

/// How well one recording is described.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RecordingFit {
    /// File name.
    pub name: String,
    /// Set-up; empty for the default one.
    pub setup: String,
    /// Kind of measurement.
    pub measurement: String,
    /// Samples used.
    pub samples: u64,
    /// Rows left out because a number was missing.
    pub dropped: u64,
    /// RMS with the machine as declared.
    pub nominal: Rms,
    /// RMS with the identified deviations.
    pub geometric: Rms,
    /// Standard deviation of one reading that the fit was weighted with, m (rad for an angle).
    pub sigma: f64,
    /// Noise seen in the residuals over the stated `sigma`; well above 1 means that something is not modelled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub birge: Option<f64>,
}

/// One component of a deviation.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ParameterFit {
    /// Frame of the dyad.
    pub frame: String,
    /// Set-up, where the component belongs to a frame `w` of its own; empty otherwise.
    pub setup: String,
    /// Axes with whose direction of travel the component changes sign; empty for a constant one.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub directions: String,
    /// `vx` ... `wz`.
    pub component: String,
    /// Identified value, m or rad.
    pub value: f64,
    /// Standard error, prior and data together, m or rad.
    #[serde(deserialize_with = "unbounded")]
    pub std_error: f64,
    /// Tolerance: standard deviation of the prior, m or rad.
    pub tolerance: f64,
    /// What share of it comes from the data, 0 to 1.
    pub share: f64,
}

/// A combination of deviations that the data see as one number.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Combination {
    /// What share of it comes from the data, 0 to 1.
    pub share: f64,
    /// Its parts, `frame.component`, largest first, in units of their tolerances; small ones left out.
    pub parts: Vec<(String, f64)>,
}

/// A set-up as found.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SetupFit {
    /// Name; empty for the default one.
    pub name: String,
    /// Whether its frame was found from nothing.
    pub frame_unknown: bool,
    /// Origin of frame `w` in the frame before it, m.
    pub at_m: [f64; 3],
    /// Rotation vector of frame `w` in the frame before it, rad.
    pub rotation_rad: [f64; 3],
}

/// A sample that counted little.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Suspect {
    /// File name.
    pub recording: String,
    /// Line in the file.
    pub line: u64,
    /// Norm of its residual, m (rad for an angle).
    pub residual: f64,
    /// The same in standard deviations of the noise.
    pub deviations: f64,
    /// Weight with which it counted, 0 to 1.
    pub weight: f64,
}

pub(super) fn report(
    problem: &Problem,
    nominal: &[Tally],
    declared: &Unknowns,
    found: &Found,
    information: Information,
    options: CalibrateOptions,
) -> Result<Fit> {
    let (machine, sources, layout) = (problem.machine, problem.sources, problem.layout);
    let tallies = &found.solution.normal.tallies;
    let (before, after) = (rms_over(nominal), rms_over(tallies));
    let recordings = (sources.all.iter().enumerate())
        .map(|(i, source)| {
            let quantity = source.quantity(machine, 0);
            RecordingFit {
                name: source.label.clone(),
                setup: sources.setups[source.setup].clone(),
                measurement: source.sensor.name().into(),
                samples: source.summary.samples,
                dropped: source.summary.dropped,
                nominal: rms_over(&nominal[i..=i]),
                geometric: rms_over(&tallies[i..=i]),
                sigma: found.noise[i][quantity],
                birge: source.recording.header().sigma.map(|s| found.seen[i][quantity] / s.value),
            }
        })
        .collect();
    let readings = sources.readings();
    let general = matrix_in_general(machine, sources, layout, &found.solution.unknowns);
    let rank_in_general = Information::new(&general, layout, problem.prior, Vec::new()).rank;
    let (outliers, suspects) = suspects(problem, found)?;
    let coefficients = coefficients(problem, found, &information);
    let Pieces { pieces, samples: piece_samples, held_out } = pieces(problem, declared, found)?;
    let fit = Fit {
        machine: machine.name().into(),
        samples: sources.samples(),
        dropped: sources.all.iter().map(|s| s.summary.dropped).sum(),
        readings,
        rms: before
            .zip(after)
            .map(|(before, after)| Some(BeforeAfter { nominal: before?, geometric: after? })),
        recordings,
        solver: options.solver,
        loss: options.loss,
        prior: problem.prior,
        stop: found.solution.stop,
        steps: found.solution.steps,
        loss_value: found.solution.normal.loss,
        unknowns: layout.len,
        rank: information.rank,
        rank_in_general,
        parameters: parameters(problem, found, &information),
        combinations: combinations(problem, &information),
        location_errors: location_errors(
            machine,
            &found.solution.unknowns.dh,
            reference(problem),
            Some(&information),
        ),
        open: information.open.iter().map(|v| in_words(problem, v)).collect(),
        setups: setups(problem, found),
        down_weighted: tallies.iter().map(|t| t.down_weighted).sum(),
        outliers,
        suspects,
        pieces,
        held_out,
        coefficients,
        piece_samples,
        plausibility: plausibility(problem, &found.solution.unknowns)?,
        warnings: Vec::new(),
        information,
    };
    Ok(Fit { warnings: warnings(problem, &fit), ..fit })
}

/// The datum for offsets of rotary axes: the tool point, if all recordings have the same known one, else the origin of `t`.
fn reference(problem: &Problem) -> Vec3<f64> {
    let mut points = problem.sources.all.iter().filter(|s| s.sees_frames()).map(|s| s.tool_point);
    match points.next() {
        Some(Known::Value(point)) if points.all(|other| other == Known::Value(point)) => point,
        _ => Vec3([0.0; 3]),
    }
}

fn setups(problem: &Problem, found: &Found) -> Vec<SetupFit> {
    let frames = &found.solution.unknowns.setups;
    (problem.sources.setups.iter().zip(frames))
        .map(|(name, frame)| {
            let pose = frame.pose();
            SetupFit {
                name: name.clone(),
                frame_unknown: frame.unknown,
                at_m: pose.translation.0,
                rotation_rad: pose.rotation_vector().0,
            }
        })
        .collect()
}

/// Frame, set-up and directions of a block that has components.
fn owner(problem: &Problem, block: &Block) -> Option<[String; 3]> {
    let frame = |j: usize| problem.machine.dyads()[j].frame.clone();
    let none = String::new;
    match block.role {
        Role::Dyad(j) => Some([frame(j), none(), none()]),
        Role::Setup(s) => Some([frame(problem.machine.w_index()), problem.sources.setups[s].clone(), none()]),
        Role::Part { set, dyad } => {
            let directions = problem.varying.directions.as_ref()?;
            Some([frame(dyad), none(), directions.set_name(problem.machine, set)])
        }
        _ => None,
    }
}

fn coefficients(problem: &Problem, found: &Found, information: &Information) -> Vec<CoefficientFit> {
    let terms = problem.layout.blocks.iter().filter(|b| matches!(b.role, Role::Term(_)));
    terms
        .map(|block| CoefficientFit {
            value: found.solution.unknowns.total(block)[0],
            std_error: information.variance[block.offset].sqrt() * block.scale[0],
        })
        .collect()
}

/// What is told of the pieces.
struct Pieces {
    pieces: Vec<PieceFit>,
    /// By piece, those without any sample included.
    samples: Vec<u64>,
    held_out: Option<HeldOut>,
}

/// Residuals by piece, of the samples used and of those held out.
fn pieces(problem: &Problem, declared: &Unknowns, found: &Found) -> Result<Pieces> {
    let unknowns = &found.solution.unknowns;
    let picked = problem.sources.is_picked();
    let mut told = Pieces { pieces: Vec::new(), samples: Vec::new(), held_out: None };
    if problem.varying.directions.is_none() && !picked {
        return Ok(told);
    }
    let fit = judge(problem, unknowns, Which::Fit)?;
    let out = if picked { Some(judge(problem, unknowns, Which::HeldOut)?) } else { None };
    let all = |sizes: &[ByQuantity<Sizes>]| {
        let mut sum = ByQuantity::<Sizes>::default();
        sizes.iter().for_each(|s| sum.add(s));
        Figures::from(&sum)
    };
    if let Some(out) = &out {
        let nominal = all(&judge(problem, declared, Which::HeldOut)?);
        told.held_out = Some(HeldOut { nominal, model: all(out) });
    }
    told.samples = fit.iter().map(|sizes| sizes.samples()).collect();
    if let Some(directions) = &problem.varying.directions {
        for (piece, sizes) in fit.iter().enumerate().filter(|(piece, _)| told.samples[*piece] > 0) {
            let name = directions.name(problem.machine, piece);
            let held_out = out.as_ref().map(|out| Figures::from(&out[piece]));
            told.pieces.push(PieceFit { name, fit: Figures::from(sizes), held_out });
        }
    }
    Ok(told)
}

fn parameters(problem: &Problem, found: &Found, information: &Information) -> Vec<ParameterFit> {
    let mut all = Vec::new();
    for block in problem.layout.blocks.iter().filter(|b| b.prior) {
        let Some([frame, setup, directions]) = owner(problem, block) else { continue };
        let total = found.solution.unknowns.total(block);
        for k in 0..block.len {
            let variance = information.variance[block.offset + k];
            all.push(ParameterFit {
                frame: frame.clone(),
                setup: setup.clone(),
                directions: directions.clone(),
                component: COMPONENTS[k].into(),
                value: total[k],
                std_error: variance.sqrt() * block.scale[k],
                tolerance: block.scale[k],
                share: (1.0 - variance).clamp(0.0, 1.0),
            });
        }
    }
    all
}

/// Name of every parameter, `frame.component`.
fn labels(problem: &Problem) -> Vec<String> {
    let (sources, machine) = (problem.sources, problem.machine);
    let several = sources.setups.len() > 1;
    let of = |setup: usize| if several { format!("[{}]", sources.setups[setup]) } else { String::new() };
    let label = |block: &Block, k: usize| match block.role {
        Role::Dyad(j) => format!("{}.{}", problem.machine.dyads()[j].frame, COMPONENTS[k]),
        Role::Setup(s) => format!("w{}.{}", of(s), COMPONENTS[k]),
        Role::ToolPoint(i) => format!("tool point {}.{}", sources.tool_points[i], ["x", "y", "z"][k]),
        Role::Zero(i) => format!("zero of {}{}", sources.zeros[i].1, of(sources.zeros[i].0)),
        Role::Length(i) => format!("nominal length{}", of(sources.lengths[i])),
        Role::ToolRotation(i) => format!("target {}.{}", sources.tool_rotations[i], COMPONENTS[3 + k]),
        Role::Part { set, dyad } => {
            let axes =
                problem.varying.directions.as_ref().map_or(String::new(), |d| d.set_name(machine, set));
            format!("{}.{} with the direction of {axes}", machine.dyads()[dyad].frame, COMPONENTS[k])
        }
        Role::Term(i) => format!("term {}", i + 1),
    };
    problem.layout.blocks.iter().flat_map(|b| (0..b.len).map(move |k| label(b, k))).collect()
}

fn combinations(problem: &Problem, information: &Information) -> Vec<Combination> {
    let labels = labels(problem);
    (0..information.strength.len())
        .map(|i| {
            let column = information.directions.column(i);
            let mut parts: Vec<(String, f64)> = (information.positions.iter().zip(column.iter()))
                .filter(|(_, x)| x.abs() > 0.1)
                .map(|(at, x)| (labels[*at].clone(), *x))
                .collect();
            parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
            Combination { share: information.share(i), parts }
        })
        .collect()
}

/// A direction that nothing determines, in words.
fn in_words(problem: &Problem, vector: &DVector<f64>) -> String {
    let labels = labels(problem);
    let mut parts: Vec<(f64, &str)> =
        vector.iter().zip(&labels).filter(|(x, _)| x.abs() > 0.1).map(|(x, l)| (*x, l.as_str())).collect();
    parts.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    if let [(_, label)] = parts[..]
        && let Some((owner, component)) = label.rsplit_once('.')
    {
        let axis = &component[component.len() - 1..];
        return match component.as_bytes()[0] {
            b'w' => format!("the turn of {owner} about its {axis} axis"),
            _ => format!("the place of {owner} along its {axis} axis"),
        };
    }
    let named: Vec<String> = parts.iter().take(4).map(|(x, l)| format!("{x:+.2} {l}")).collect();
    named.join(" ")
}

/// One more pass: how many samples lie further off than noise explains, and which samples are the worst.
fn suspects(problem: &Problem, found: &Found) -> Result<(u64, Vec<Suspect>)> {
    let (machine, sources) = (problem.machine, problem.sources);
    if sources.replay.is_some() {
        // Single samples are not among what is merged.
        return Ok((0, Vec::new()));
    }
    let unknowns = &found.solution.unknowns;
    let evaluators: Vec<_> = sources.all.iter().map(|s| Evaluator::new(machine, unknowns, s)).collect();
    let limits: Vec<f64> =
        sources.all.iter().map(|s| chance_limit(s.sensor.reading_count(), sources.samples())).collect();
    let (loss, motions) = (problem.loss, &problem.motions);
    let (mut outliers, mut all) = (0, Vec::new());
    sources.pass(
        |index, stretch| {
            let (source, evaluator) = (&sources.all[index], &evaluators[index]);
            let sigmas = sigmas(source, machine, found.noise[index]);
            let count = source.sensor.reading_count();
            let (mut beyond, mut own) = (0, Vec::new());
            let mut residuals = evaluator.all_residuals(stretch);
            if motions.len() > 0 {
                take_motions(motions, &unknowns.motions, evaluator, stretch, &mut residuals);
            }
            for (k, residuals) in residuals.chunks_exact(count).enumerate() {
                let e2 = standardised(residuals, &sigmas);
                let (_, weight) = loss.at(e2);
                beyond += u64::from(e2 > limits[index]);
                if weight < 0.5 || e2 > limits[index] {
                    own.push(Suspect {
                        recording: source.label.clone(),
                        line: stretch.chunk.lines[k],
                        residual: residuals[..count.min(3)].iter().map(|r| r * r).sum::<f64>().sqrt(),
                        deviations: e2.sqrt(),
                        weight,
                    });
                }
            }
            worst_first(&mut own);
            (beyond, own)
        },
        |_, (beyond, own)| {
            outliers += beyond;
            all.extend(own);
            worst_first(&mut all);
        },
    )?;
    Ok((outliers, all))
}

/// Takes what the error motions add from the residuals of a stretch.
fn take_motions(
    motions: &Motions,
    values: &[f64],
    evaluator: &Evaluator,
    stretch: &Stretch,
    residuals: &mut [f64],
) {
    let count = evaluator.sensor.reading_count();
    let mut work = evaluator.workspace();
    let mut rows = vec![0.0; count * evaluator.width()];
    let mut columns = vec![0.0; motions.len()];
    for (k, residuals) in residuals.chunks_exact_mut(count).enumerate() {
        let (q, measured) = (stretch.q(k), &stretch.chunk.values[k * count..(k + 1) * count]);
        evaluator.residuals(q, measured, Moment::At(stretch, k), &mut work, Some(&mut rows));
        for (residual, row) in residuals.iter_mut().zip(rows.chunks_exact(evaluator.width())) {
            motions.columns(evaluator.machine, q, stretch.directions(k), row, &mut columns);
            *residual -= columns.iter().zip(values).map(|(x, y)| x * y).sum::<f64>();
        }
    }
}

fn worst_first(suspects: &mut Vec<Suspect>) {
    suspects.sort_by(|a, b| b.deviations.total_cmp(&a.deviations));
    suspects.truncate(LISTED);
}

/// The mean of squared standardised readings of a sample that noise alone exceeds in one of a hundred sets of so many samples:
/// the chi-square quantile at `1 - 0.01 / samples`, per reading.
fn chance_limit(readings: usize, samples: u64) -> f64 {
    let Ok(distribution) = ChiSquared::new(readings as f64) else { return f64::INFINITY };
    distribution.inverse_cdf(1.0 - 0.01 / samples.max(1) as f64) / readings as f64
}

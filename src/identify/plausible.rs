//! Whether what a fit leaves over can be true: its size beside what tolerances and instrument foretell, and beside the motion itself.

use serde::{Deserialize, Serialize};

use super::evaluator::{Evaluator, Moment};
use super::solve::Problem;
use super::stretch::Stretch;
use super::unknowns::Unknowns;
use super::{Layout, Placed, Sources, enough_to_start, is_of_setup, place};
use crate::error::Result;
use crate::machine::{JointKind, Machine};
use crate::recording::Recording;
use crate::sensor::MOST_READINGS;
use crate::units::{ByQuantity, Quantity};
use crate::variation::CONSTANT;

/// Of the sizes of all samples the one that three quarters stay below stands for them: a quarter may be outliers, as where set-ups are
/// looked for.
const QUANTILE: f64 = 0.75;
/// So many samples of a recording say how large its residuals are.
const ENOUGH: u64 = 2000;
/// Residuals beyond so many times what tolerances and instrument foretell contradict the machine file: were it all due to one deviation,
/// that one would lie twenty tolerances off. `docs/reliability.md` shows how far sound recordings and mistakes are from it.
const BEYOND_TOLERANCES: f64 = 20.0;
/// Residuals beyond this part of what the joints move the readings by are no error of a machine, but of what is said of its motion: play,
/// load and heat stay below it, even in arms that are driven by cables.
const BEYOND_MOTION: f64 = 0.3;
/// A point that a joint carries round is off by no more than its distance from the axis, rad.
const ROUND: f64 = 1.0;

/// How large what is left of one kind of reading in one recording is, and how large it could be, m or rad. Each is the size that three
/// quarters of the samples stay below.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plausibility {
    /// File name.
    pub recording: String,
    /// Whether it is about angles.
    pub of_angles: bool,
    /// Residuals of the model found.
    pub left: f64,
    /// What deviations of the size of the tolerances, and the stated sigma, make of the readings.
    pub foretold: f64,
    /// What the joints move the readings by.
    pub moved: f64,
}

impl Plausibility {
    /// Whether recording and machine can belong together. Not so where residuals are far beyond both what tolerances and instrument
    /// foretell and what could be wrong with a motion.
    pub fn holds(&self) -> bool {
        self.excess() <= 1.0
    }

    /// Residuals over the largest that could be true; beyond 1 they are nonsense.
    pub fn excess(&self) -> f64 {
        if self.most() > 0.0 { self.left / self.most() } else { 0.0 }
    }

    /// The largest residuals that could be true, m or rad.
    pub fn most(&self) -> f64 {
        (BEYOND_TOLERANCES * self.foretold).max(BEYOND_MOTION * self.moved)
    }

    /// What its figures measure.
    pub fn quantity(&self) -> Quantity {
        if self.of_angles { Quantity::Angle } else { Quantity::Length }
    }
}

/// Residuals below this part of what the tolerances make are no geometry that a fit has missed: it would be one of the smallest
/// deviations, and those do not hold a fit back.
const GEOMETRY: f64 = 0.1;

/// Whether what is left is large enough to be geometry.
pub(super) fn may_be_geometry(problem: &Problem, unknowns: &Unknowns) -> Result<bool> {
    let all = plausibility(problem, unknowns)?;
    Ok(all.iter().any(|p| p.left > GEOMETRY * p.foretold))
}

/// Whether a fit from afar may take the place of one that tolerances hold back: where that one is nonsense, only if it leaves no more than
/// deviations of the size of the tolerances would, since a wrong model far from its file explains half of anything.
pub(super) fn explains(problem: &Problem, held_back: &Unknowns, from_afar: &Unknowns) -> Result<bool> {
    if plausibility(problem, held_back)?.iter().all(Plausibility::holds) {
        return Ok(true);
    }
    Ok(plausibility(problem, from_afar)?.iter().all(|p| p.left <= p.foretold))
}

/// The worst of several.
pub fn worst(all: &[Plausibility]) -> Option<&Plausibility> {
    all.iter().max_by(|a, b| a.excess().total_cmp(&b.excess()))
}

/// Sizes of the samples of a recording.
#[derive(Clone, Default)]
struct Sizes {
    left: Vec<f64>,
    foretold: Vec<f64>,
    moved: Vec<f64>,
}

/// Every recording of a problem under these unknowns.
pub(super) fn plausibility(problem: &Problem, unknowns: &Unknowns) -> Result<Vec<Plausibility>> {
    match &problem.sources.replay {
        Some(replay) => {
            let sizes = replay.plausibility(unknowns.state())?.into_iter();
            Ok(sizes
                .map(|(recording, of_angles, [left, foretold, moved])| Plausibility {
                    recording,
                    of_angles,
                    left,
                    foretold,
                    moved,
                })
                .collect())
        }
        None => Ok(plausibility_of(problem.machine, problem.sources, unknowns)?
            .into_iter()
            .map(|(_, p)| p)
            .collect()),
    }
}

/// The same, of recordings whose samples are here, with their numbers.
pub(super) fn plausibility_of(
    machine: &Machine,
    sources: &Sources,
    unknowns: &Unknowns,
) -> Result<Vec<(usize, Plausibility)>> {
    let evaluators: Vec<_> = sources.all.iter().map(|s| Evaluator::new(machine, unknowns, s)).collect();
    // Standard deviation of an even spread.
    let spread = |c: usize, (from, to): &(f64, f64)| {
        let most = if machine.command_joint(c).kind == JointKind::Revolute { ROUND } else { f64::INFINITY };
        ((to - from) / 12f64.sqrt()).min(most)
    };
    let spread: Vec<f64> = sources.ranges().iter().enumerate().map(|(c, range)| spread(c, range)).collect();
    let mut sizes: Vec<ByQuantity<Sizes>> = vec![ByQuantity::default(); sources.all.len()];
    let of = |index: usize, len: usize| {
        let stride = sources.all[index].summary.samples.div_ceil(ENOUGH).max(1) as usize;
        (0..len).step_by(stride.min(len.max(1)))
    };
    let look = |index: usize, stretch: &Stretch, samples: &mut dyn Iterator<Item = usize>| {
        let (source, evaluator) = (&sources.all[index], &evaluators[index]);
        let known = !sources.frame_unknown[source.setup];
        let (count, values) = (source.sensor.reading_count(), source.recording.value_count());
        let sigma = source.recording.header().sigma;
        let mut work = evaluator.workspace();
        let width = evaluator.width();
        let mut rows = vec![0.0; MOST_READINGS * width];
        let mut own = ByQuantity::<Sizes>::default();
        for k in samples {
            let q = stretch.q(k);
            let measured = &stretch.chunk.values[k * values..(k + 1) * values];
            let residuals =
                evaluator.residuals(q, measured, Moment::At(stretch, k), &mut work, Some(&mut rows));
            let mut squares = ByQuantity { m: [0.0; 3], rad: [0.0; 3] };
            let mut seen = ByQuantity { m: false, rad: false };
            for (i, residual) in residuals.iter().take(count).enumerate() {
                let quantity = source.quantity(machine, i);
                let row = &rows[i * width..(i + 1) * width];
                let noise = sigma.filter(|s| s.quantity == quantity).map_or(0.0, |s| s.value);
                let added = [
                    residual * residual,
                    foretold(machine, row, known) + noise * noise,
                    moved(machine, row, &spread),
                ];
                squares[quantity].iter_mut().zip(added).for_each(|(sum, added)| *sum += added);
                seen[quantity] = true;
            }
            for quantity in [Quantity::Length, Quantity::Angle] {
                if seen[quantity] {
                    let [left, foretold, moved] = squares[quantity].map(f64::sqrt);
                    let own = &mut own[quantity];
                    own.left.push(left);
                    own.foretold.push(foretold);
                    own.moved.push(moved);
                }
            }
        }
        own
    };
    let take = |index: usize, own: ByQuantity<Sizes>| {
        for quantity in [Quantity::Length, Quantity::Angle] {
            let (sum, own) = (&mut sizes[index][quantity], &own[quantity]);
            sum.left.extend(&own.left);
            sum.foretold.extend(&own.foretold);
            sum.moved.extend(&own.moved);
        }
    };
    if sources.is_plain() {
        sources.pass_few(
            |index, _, len| of(index, len).collect(),
            |index, stretch| look(index, stretch, &mut (0..stretch.chunk.len)),
            take,
        )?;
    } else {
        sources.pass(|index, stretch| look(index, stretch, &mut of(index, stretch.chunk.len)), take)?;
    }
    let mut all = Vec::new();
    for (number, (source, mut sizes)) in sources.all.iter().zip(sizes).enumerate() {
        for quantity in [Quantity::Length, Quantity::Angle] {
            let sizes = &mut sizes[quantity];
            if sizes.left.is_empty() {
                continue;
            }
            let plausibility = Plausibility {
                recording: source.label.clone(),
                of_angles: quantity == Quantity::Angle,
                left: quantile(&mut sizes.left),
                foretold: quantile(&mut sizes.foretold),
                moved: quantile(&mut sizes.moved),
            };
            all.push((number, plausibility));
        }
    }
    Ok(all)
}

/// Variance of a reading by deviations of the size of their tolerances; frame `w` is none of them where it is found from nothing.
fn foretold(machine: &Machine, row: &[f64], with_w: bool) -> f64 {
    let dyads = (0..machine.dyads().len()).filter(|j| with_w || *j != machine.w_index());
    let of = |j: usize| {
        let tolerance = machine.tolerance(j).to_array();
        row[6 * j..6 * j + 6].iter().zip(tolerance).map(|(x, t)| (x * t).powi(2)).sum::<f64>()
    };
    dyads.map(of).sum()
}

/// Variance of a reading by commands that are spread so.
fn moved(machine: &Machine, row: &[f64], spread: &[f64]) -> f64 {
    by_commands(machine, row).iter().zip(spread).map(|(slope, spread)| (slope * spread).powi(2)).sum()
}

/// How a reading answers to each command, per m or rad, from its row over the deviations.
pub(crate) fn by_commands(machine: &Machine, row: &[f64]) -> Vec<f64> {
    let mut by_command = vec![0.0; machine.commands().len()];
    for (j, joint) in machine.joints() {
        let Some(drive) = machine.drive(j) else { continue };
        let along: f64 = row[6 * j..6 * j + 6].iter().zip(joint.twist().to_array()).map(|(x, y)| x * y).sum();
        drive.terms.iter().for_each(|(c, factor)| by_command[*c] += factor * along);
    }
    by_command
}

fn quantile(sizes: &mut [f64]) -> f64 {
    // What is no number is as far off as can be.
    sizes.iter_mut().filter(|size| size.is_nan()).for_each(|size| *size = f64::INFINITY);
    sizes.sort_by(f64::total_cmp);
    sizes[((sizes.len() - 1) as f64 * QUANTILE).round() as usize]
}

/// How well the machine as declared agrees with recordings; only what nobody has stated of the set-ups is fitted.
///
/// # Errors
/// As [`super::calibrate`].
pub fn as_declared(machine: &Machine, recordings: &[Recording]) -> Result<Vec<Plausibility>> {
    let sources = Sources::new(recordings, machine, &CONSTANT, &[], &|_| {})?;
    enough_to_start(machine, &sources)?;
    let layout = Layout::new(machine, &sources, &CONSTANT, 1.0);
    let mut problem = Problem::new(machine, &sources, &layout, &CONSTANT, is_of_setup);
    let Placed { solution, .. } = place(&mut problem, Unknowns::nominal(machine, &sources, &CONSTANT))?;
    plausibility(&problem, &solution.unknowns)
}

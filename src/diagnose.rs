//! Diagnosis: where a calibrated model and real recordings differ, what physics was left out, and the model with it, `docs/diagnosis.md`.
//!
//! Constant geometry is fitted first and marginalised out of everything that follows, so that nothing is blamed on physics that
//! geometry explains. Every family of the library at every place competes by the evidence for it; what is found is put into the
//! model and judged on stretches that were left out. Where structure is left that no family explains, it says so.

mod along;
mod approaches;
mod bent;
mod blocks;
mod coarse;
mod companions;
mod contained;
mod curves;
mod diagnosis;
mod enter;
mod evidence;
mod finding;
mod folds;
mod held_out;
mod leftover;
mod model;
mod noise;
mod not_tried;
mod odds;
mod outliers;
mod panel;
mod passing;
mod placebo;
mod polish;
mod reach;
mod refine;
mod report;
mod score;
mod search;
mod set_ups;
mod shape;
mod shares;
mod side_branches;
mod space;
mod spectrum;
mod speeds;
mod stretch;
mod traces;
mod unexplained;
mod waves;
mod whereabouts;
mod whitener;

pub use approaches::{SaidBy, StandsStill};
pub use companions::Companion;
pub use diagnosis::{Diagnosis, HeldOutRms, RmsByModel};
pub use finding::{Confusable, Finding, HeldOutPair, Meaningless, Size};
pub use not_tried::NotTried;
pub use outliers::{Outliers, WithoutOutliers};
pub use set_ups::{LeftOutRms, SetUpLeftOut};
pub use side_branches::UnseenSideBranch;
pub use stretch::Where;
pub use traces::{Along, Curve, CurvePoint, Trace, Traces};
pub use unexplained::{Gathering, Unexplained};

use std::cell::RefCell;
use std::collections::HashMap;

use crate::effects::{Candidate, Library, RecordingFacts};
use crate::error::Result;
use crate::feature::as_seen_in;
use crate::identify::{Linear, Options, linear};
use crate::machine::Machine;
use crate::recording::Recording;
use coarse::Coarse;
use noise::Noise;
use not_tried::not_tried;
use score::Rows;
use search::{Active, Search};
use side_branches::unseen;
use whitener::Whitener;

/// What a diagnosis is asked.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// How the constant geometry is identified.
    pub options: Options,
}

/// Rounds of judging the noise from what is left.
const NOISE_ROUNDS: usize = 3;
/// So many times the machine is linearised anew, where effects are so large that it has to be.
const MOVES: usize = 3;
/// Where chance is that much larger than the noise, the effects are chosen once more against it.
const HOT: f64 = 3.0;
/// What is left counts as more than noise beyond this many standard deviations of chance.
const BEYOND_NOISE: f64 = 5.0;
/// An effect without which the mean square of stretches left out falls by this factor runs wild there, whatever else speaks for it.
const WILD: f64 = 2.0;

/// Diagnoses what constant geometry leaves over in these recordings.
///
/// # Errors
/// As [`crate::identify::calibrate`].
pub fn diagnose(
    machine: &Machine,
    recordings: &[Recording],
    library: &Library,
    request: &Request,
    progress: &dyn Fn(&str),
) -> Result<Diagnosis> {
    progress("fitting constant geometry");
    let (whole, machine) = (machine, &as_seen_in(machine, recordings));
    let facts = RecordingFacts::of(machine, recordings)?;
    let mut linear = linear(machine, recordings, request.options, &facts.dead_bands, progress)?;
    let candidates = library.candidates(machine, &facts);
    let runs = noise::runs(&linear);
    let coarse = Coarse::new(&linear, candidates.all.len());
    let mut out = noise::outliers(&linear.residual, &runs, facts_are_smooth(&facts));
    if facts_are_smooth(&facts) {
        out.iter_mut().zip(noise::waiting(&linear)).for_each(|(out, waiting)| *out |= waiting);
    }
    let total: f64 = candidates.all.iter().map(|c| c.often).sum();
    let priors: Vec<f64> = candidates.all.iter().map(|c| (c.often / total).ln()).collect();
    let commonness = commonness(&candidates.all);
    // Settled positions are few, and where none is repeated nothing tells their noise: every effect has to prove itself.
    let most_wild = if facts_are_smooth(&facts) { WILD } else { 1.0 };
    // What is left is noise, once everything else is modelled: the noise is judged anew from it.
    let mut noise = noise_of(&linear, &linear.residual, &runs, &out, &facts);
    let mut active = Vec::new();
    let (mut round, mut moves, mut forgot) = (1, 0, false);
    loop {
        let rows =
            Rows::new(&linear, &coarse, Whitener::new(linear.residual.len(), &runs, &noise, out.clone()));
        let search = Search {
            rows: &rows,
            runs: &runs,
            base: rows.constant(),
            candidates: &candidates.all,
            priors: priors.clone(),
            commonness: commonness.clone(),
            progress,
            heat: 1.0,
            in_motion: facts_are_smooth(&facts),
            known: RefCell::default(),
            grounds: RefCell::default(),
        };
        let judge =
            |active: &[Active]| noise_of(&linear, &report::residual_of(&search, active), &runs, &out, &facts);
        let is_settled = |judged: &[Noise]| noise.iter().zip(judged).all(|(a, b)| a.is_close(b));
        active = search.run(&active, |active| round == NOISE_ROUNDS || is_settled(&judge(active)));
        let judged = judge(&active);
        let report = |search: &Search, active: &[Active]| -> Diagnosis {
            let mut diagnosis = report::report(search, active, machine, library, &noise);
            diagnosis.not_tried = not_tried(&candidates);
            diagnosis.unseen_side_branches = unseen(whole, machine);
            diagnosis
        };
        if moves < MOVES && !active.is_empty() {
            let moved = bent::straightened(&search, &active, machine, recordings, &facts.dead_bands)?;
            if let Some(moved) = moved {
                (linear, noise, moves) = (moved, judged, moves + 1);
                continue;
            }
        }
        if active.is_empty() && !forgot && noise.iter().any(Noise::is_long) {
            // So long a memory may be a misfit that was taken for noise.
            let left = search.leftover(&search.base);
            if left.beyond > BEYOND_NOISE {
                (noise, forgot) = (noise.iter().map(Noise::shortened).collect(), true);
                continue;
            }
        }
        if round == NOISE_ROUNDS || is_settled(&judged) {
            let heat = search.leftover(&search.beside(&active, None)).heat;
            if heat < HOT {
                let active = search.polished(&folds::useful(&search, &active, most_wild));
                return Ok(report(&search, &active));
            }
            // Much is left, as it always is on real machines: the simplest names that stand out from it count.
            let search = Search { heat, known: RefCell::default(), grounds: RefCell::default(), ..search };
            active = search.polished(&folds::useful(&search, &search.run(&active, |_| true), most_wild));
            return Ok(report(&search, &active));
        }
        (noise, round) = (judged, round + 1);
    }
}

/// Families that are met more often than this part of the most frequent one are common.
const COMMON: f64 = 0.2;

/// How rare the family of each candidate is: the logarithm of how often it is met, 0 for all common ones.
fn commonness(candidates: &[Candidate]) -> Vec<f64> {
    let mut met: HashMap<&str, f64> = HashMap::new();
    for candidate in candidates {
        *met.entry(&candidate.effect).or_default() += candidate.often;
    }
    let most = met.values().copied().fold(f64::MIN_POSITIVE, f64::max);
    candidates.iter().map(|c| (met[c.effect.as_str()] / (COMMON * most)).min(1.0).ln()).collect()
}

fn facts_are_smooth(facts: &RecordingFacts) -> bool {
    facts.time.is_some() && !facts.settled
}

/// Noise of every run; runs of the same quantity share theirs.
fn noise_of(
    linear: &Linear,
    left: &[f64],
    runs: &[Vec<usize>],
    out: &[bool],
    facts: &RecordingFacts,
) -> Vec<Noise> {
    let smooth = facts_are_smooth(facts);
    let estimate = |angle: bool| {
        let own: Vec<&Vec<usize>> =
            runs.iter().filter(|run| run.first().is_some_and(|r| linear.angle[*r] == angle)).collect();
        if facts.approached
            && let Some(noise) = noise::repeated(linear, left, &own, out)
        {
            return noise;
        }
        match !smooth && facts.time.is_some() && noise::without_order(linear) {
            true => noise::remembered(left, &own, out, linear.step(angle)),
            false => noise::estimate(left, &own, out, smooth, linear.step(angle)),
        }
    };
    let (length, angle) = (estimate(false), estimate(true));
    runs.iter()
        .map(|run| if run.first().is_some_and(|r| linear.angle[*r]) { angle } else { length })
        .collect()
}

//! Diagnosis: where a calibrated model and real recordings differ, what physics was left out, and the model with it, `docs/diagnosis.md`.
//!
//! Constant geometry is fitted first and marginalised out of everything that follows, so that nothing is blamed on physics that
//! geometry explains. Every family of the library at every place competes by the evidence for it; what is found is put into the
//! model and judged on stretches that were left out. Where structure is left that no family explains, it says so.

mod finding;
mod folds;
mod held_out;
mod leftover;
mod model;
mod noise;
mod score;
mod search;
mod space;
mod spectrum;

pub use finding::{
    Confusable, Diagnosis, Finding, HeldOutPair, HeldOutRms, RmsByModel, Size, Unexplained, Where,
};

use crate::effects::{Library, RecordingFacts};
use crate::error::Result;
use crate::identify::{Linear, Options, linear};
use crate::machine::Machine;
use crate::recording::Recording;
use noise::{Noise, Whitener};
use score::Rows;
use search::{Active, Search};

/// What a diagnosis is asked.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// How the constant geometry is identified.
    pub options: Options,
}

/// Rounds of judging the noise from what is left.
const NOISE_ROUNDS: usize = 3;

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
    let facts = RecordingFacts::of(machine, recordings)?;
    let linear = linear(machine, recordings, request.options, &facts.dead_bands, progress)?;
    let candidates = library.candidates(machine, &facts);
    let runs = noise::runs(&linear);
    let out = noise::outliers(&linear.residual, &runs);
    let total: f64 = candidates.all.iter().map(|c| c.often).sum();
    let priors: Vec<f64> = candidates.all.iter().map(|c| (c.often / total).ln()).collect();

    // What is left is noise, once everything else is modelled: the noise is judged anew from it.
    let mut left = linear.residual.clone();
    let mut active: Vec<Active> = Vec::new();
    let mut result = None;
    for round in 0..NOISE_ROUNDS {
        let noise = noise_of(&linear, &left, &runs, &out, &facts);
        let rows = Rows::new(&linear, Whitener::new(linear.residual.len(), &runs, &noise, out.clone()));
        let search = Search {
            rows: &rows,
            runs: &runs,
            base: rows.constant(),
            candidates: &candidates.all,
            priors: priors.clone(),
            progress,
        };
        let before: Vec<usize> = active.iter().map(|a| a.candidate).collect();
        active = search.run();
        let same = active.iter().map(|a| a.candidate).eq(before.iter().copied());
        let settled = round > 0 && same || active.is_empty() || facts_are_smooth(&facts) && round > 0;
        if settled || round + 1 == NOISE_ROUNDS {
            result = Some(finding::report(&search, &active, machine, library, &noise));
            break;
        }
        left = finding::residual_of(&search, &active);
    }
    Ok(result.expect("the last round reports"))
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
        noise::estimate(left, &own, out, smooth)
    };
    let (length, angle) = (estimate(false), estimate(true));
    runs.iter()
        .map(|run| if run.first().is_some_and(|r| linear.angle[*r]) { angle } else { length })
        .collect()
}

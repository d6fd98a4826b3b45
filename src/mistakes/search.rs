//! Which mistake explains that a machine and recordings do not belong together.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::Change;
use super::list::{TRIED, changes};
use super::thinned::Thinned;
use crate::error::Result;
use crate::identify::{CalibrateOptions, Fit, Plausibility, as_declared, calibrate, worst};
use crate::machine::Machine;
use crate::recording::Recording;

/// Mistakes that leave no more than this many times the least are not told apart: deviations of the size of the tolerances, which the
/// trials do not fit, make a factor of two or so.
const ALIKE: f64 = 5.0;
/// More that cannot be told apart are no name.
const MOST: usize = 4;

/// What is wrong with a calibration that is nonsense.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Nonsense {
    /// The worst of what is left over.
    pub left: Plausibility,
    /// The mistakes that would explain it, best first; several where the recordings do not tell them apart.
    pub mistakes: Vec<Mistake>,
    /// How many were tried, and what.
    pub tried: usize,
    /// The kinds that were tried.
    pub kinds: String,
}

/// A mistake that would explain recordings.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mistake {
    /// Which, as the part of a sentence that follows "with".
    pub what: String,
    /// What to do about it.
    pub mend: String,
    /// What would be left without it, of the same recording and quantity as [`Nonsense::left`], m or rad.
    pub left: f64,
}

/// Calibrates thinned recordings; if the result is nonsense, looks for the mistake.
///
/// # Errors
/// If a recording cannot be read.
pub fn nonsense(
    machine: &Machine,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<Option<Nonsense>> {
    progress("looking whether recordings and machine belong together");
    let thinned = recordings.iter().map(Thinned::of).collect::<Result<Vec<_>>>()?;
    let read = thinned.iter().map(|t| t.recording(machine)).collect::<Result<Vec<_>>>()?;
    // What cannot be calibrated is refused for its own reason.
    let Ok((_, fit)) = calibrate(machine, &read, CalibrateOptions::default()) else { return Ok(None) };
    search(machine, recordings, &fit, progress)
}

/// Looks for the mistake, if the result is nonsense.
///
/// # Errors
/// If a recording cannot be read.
pub fn search(
    machine: &Machine,
    recordings: &[Recording],
    fit: &Fit,
    progress: &dyn Fn(&str),
) -> Result<Option<Nonsense>> {
    let Some(left) = worst(&fit.plausibility).filter(|worst| !worst.holds()).cloned() else {
        return Ok(None);
    };
    progress("looking for a mistake that explains it");
    let thinned = recordings.iter().map(Thinned::of).collect::<Result<Vec<_>>>()?;
    let all = changes(machine, &thinned);
    let changed = |change: &Change| -> Result<Vec<Recording>> {
        let with = |thinned: &Thinned| {
            let mut other = thinned.clone();
            other.samples = change.applied(thinned);
            other.recording(machine)
        };
        thinned.iter().map(with).collect()
    };
    // Beside what could be true of the recordings as they are: a change of units changes what joints seem to move.
    let excess = |all: &[Plausibility]| {
        let of = |(changed, own): (&Plausibility, &Plausibility)| changed.left / own.most();
        all.iter().zip(&fit.plausibility).map(of).fold(0.0, f64::max)
    };
    // A change that makes a recording unreadable is not the mistake.
    let tried = |change: &Change| {
        let recordings = changed(change).ok()?;
        Some(excess(&as_declared(machine, &recordings).ok()?))
    };
    let mut scored: Vec<(f64, &Change)> =
        all.par_iter().filter_map(|change| Some((tried(change)?, change))).collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    let least = scored.first().map_or(f64::INFINITY, |(excess, _)| *excess);
    let alike: Vec<&(f64, &Change)> =
        scored.iter().take_while(|(excess, _)| *excess <= ALIKE * least).collect();
    let mut mistakes = Vec::new();
    if least <= 1.0 && alike.len() <= MOST {
        for (_, change) in alike {
            let Ok((_, mended)) = calibrate(machine, &changed(change)?, CalibrateOptions::default()) else {
                continue;
            };
            let own = mended
                .plausibility
                .iter()
                .find(|p| (&p.recording, p.of_angles) == (&left.recording, left.of_angles));
            let (Some(own), true) = (own, excess(&mended.plausibility) <= 1.0) else { continue };
            mistakes.push(Mistake {
                what: change.in_words(machine),
                mend: change.mend(machine),
                left: own.left,
            });
        }
    }
    Ok(Some(Nonsense { left, mistakes, tried: all.len(), kinds: TRIED.into() }))
}

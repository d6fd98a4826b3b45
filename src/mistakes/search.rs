//! Which mistake explains that a machine and recordings do not belong together.

use rayon::prelude::*;

use super::apart;
use super::change::Change;
use super::list::{TRIED, changes};
use super::nonsense::{LikelyMistake, Nonsense};
use super::others::{Other, others};
use super::thinned::Thinned;
use super::undone::without;
use crate::error::Result;
use crate::identify::{CalibrateOptions, Fit, Plausibility, as_declared, calibrate, worst};
use crate::machine::Machine;
use crate::recording::Recording;

/// Mistakes that leave no more than this many times the least are not told apart: deviations of the size of the tolerances, which the
/// trials do not fit, make a factor of two or so.
const ALIKE: f64 = 5.0;
/// So many mistakes, those that leave least, are tried together with every other one.
const BEGUN: usize = 12;
/// More that cannot be told apart are no name.
const MOST: usize = 4;

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
        return apart::search(machine, recordings, fit, progress);
    };
    let thinned = recordings.iter().map(Thinned::of).collect::<Result<Vec<_>>>()?;
    let all = changes(machine, &thinned);
    let trial = Trial { machine, thinned: &thinned, fit, left: &left };
    progress("looking for a mistake that explains it");
    let ones: Vec<Vec<&Change>> = all.iter().map(|change| vec![change]).collect();
    let scored = trial.scored(ones);
    let mut mistakes = trial.named(&scored)?;
    let mut tried = scored.len() + trial.in_place_of_it(&scored, &mut mistakes)?;
    if mistakes.is_empty() {
        progress("looking for two mistakes that explain it");
        let begun = scored.iter().take(BEGUN).enumerate();
        let two = begun.flat_map(|(i, (_, one))| {
            let known = &scored[..=i];
            let new = all.iter().filter(move |change| !known.iter().any(|(_, own)| own[0] == *change));
            new.map(|other| in_order(one[0], other))
        });
        let scored = trial.scored(two.collect());
        mistakes = trial.named(&scored)?;
        tried += scored.len();
    }
    Ok(Some(Nonsense { left, apart: None, mistakes, tried, kinds: TRIED.into() }))
}

/// What moves rows takes them from the recording as it is, so it comes first.
fn in_order<'a>(one: &'a Change, other: &'a Change) -> Vec<&'a Change> {
    let moves =
        |change: &Change| matches!(change, Change::Backwards | Change::Rows(_) | Change::CommandRows(..));
    if moves(other) { vec![other, one] } else { vec![one, other] }
}

/// Mistakes by what is left without them, over what could be true.
type Scored<'a> = Vec<(f64, Vec<&'a Change>)>;

/// What mistakes are tried on.
struct Trial<'a> {
    machine: &'a Machine,
    thinned: &'a [Thinned],
    /// Of the recordings as they are, and the worst of it.
    fit: &'a Fit,
    left: &'a Plausibility,
}

impl Trial<'_> {
    fn without(&self, mistakes: &[&Change]) -> Result<Vec<Recording>> {
        without(self.machine, self.thinned, mistakes)
    }

    /// The largest residual over what could be true of the recordings as they are: a change of units changes what joints seem to move.
    fn excess(&self, all: &[Plausibility]) -> f64 {
        let of = |(changed, own): (&Plausibility, &Plausibility)| changed.left / own.most();
        all.iter().zip(&self.fit.plausibility).map(of).fold(0.0, f64::max)
    }

    /// What each leaves of the machine as declared, best first. A change that makes a recording unreadable is not the mistake.
    fn scored<'b>(&self, all: Vec<Vec<&'b Change>>) -> Scored<'b> {
        let score = |mistakes: &[&Change]| {
            let recordings = self.without(mistakes).ok()?;
            Some(self.excess(&as_declared(self.machine, &recordings).ok()?))
        };
        let mut scored: Scored =
            all.into_par_iter().filter_map(|mistakes| Some((score(&mistakes)?, mistakes))).collect();
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        scored
    }

    /// Adds machines in place of the given one that explain the recordings as well as the best mistakes; such as explain them far better
    /// stand alone. How many there are.
    fn in_place_of_it(&self, scored: &Scored, mistakes: &mut Vec<LikelyMistake>) -> Result<usize> {
        let least = scored.first().map_or(f64::INFINITY, |(excess, _)| *excess);
        let others = others(self.machine);
        let excess = |other: &Other| {
            let recordings = other.recordings(self.machine, self.thinned).ok()?;
            Some(self.excess(&as_declared(&other.machine, &recordings).ok()?))
        };
        let best =
            |other: &Other| excess(other).filter(|own| *own <= 1.0 && ALIKE * own <= self.left.excess());
        let mut found: Vec<(f64, &Other)> = others
            .iter()
            .filter_map(|o| Some((best(o)?, o)))
            .filter(|(own, _)| *own <= ALIKE * least)
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        if found.first().is_some_and(|(own, _)| ALIKE * own < least) {
            mistakes.clear();
        }
        for (_, other) in found.iter().take(MOST.saturating_sub(mistakes.len())) {
            let recordings = other.recordings(self.machine, self.thinned)?;
            let Ok((_, fit)) = calibrate(&other.machine, &recordings, CalibrateOptions::default()) else {
                continue;
            };
            let same = |p: &&Plausibility| {
                (&p.recording, p.of_angles) == (&self.left.recording, self.left.of_angles)
            };
            if let Some(own) = fit.plausibility.iter().find(same) {
                mistakes.push(LikelyMistake {
                    what: other.what.clone(),
                    mend: other.mend.clone(),
                    left: own.left,
                });
            }
        }
        Ok(others.len())
    }

    /// Those that explain the recordings and cannot be told apart, calibrated without them.
    fn named(&self, scored: &Scored) -> Result<Vec<LikelyMistake>> {
        let least = scored.first().map_or(f64::INFINITY, |(excess, _)| *excess);
        let mut alike: Vec<_> = scored.iter().take_while(|(excess, _)| *excess <= ALIKE * least).collect();
        // What leaves more of the target open explains no less.
        let one_is_enough = alike
            .iter()
            .any(|(_, own)| matches!(own[..], [Change::Target { place, rotation }] if place != rotation));
        let open = |change: &&Change| matches!(change, Change::Target { place: true, rotation: true });
        alike.retain(|(_, own)| !(one_is_enough && own.iter().any(open)));
        let better = least <= 1.0 && ALIKE * least <= self.left.excess();
        let mut named = Vec::new();
        for (_, mistakes) in alike.iter().filter(|_| better && alike.len() <= MOST) {
            let recordings = self.without(mistakes)?;
            let Ok((_, mended)) = calibrate(self.machine, &recordings, CalibrateOptions::default()) else {
                continue;
            };
            let key = |p: &Plausibility| (p.recording.clone(), p.of_angles);
            let own = mended.plausibility.iter().find(|p| key(p) == key(self.left));
            if let Some(own) = own.filter(|_| self.excess(&mended.plausibility) <= 1.0) {
                let words = |word: fn(&Change, &Machine) -> String| -> Vec<String> {
                    mistakes.iter().map(|change| word(change, self.machine)).collect()
                };
                named.push(LikelyMistake {
                    what: words(Change::in_words).join(" and "),
                    mend: words(Change::mend).join(", and "),
                    left: own.left,
                });
            }
        }
        Ok(named)
    }
}

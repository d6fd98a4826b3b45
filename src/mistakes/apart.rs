//! A set-up that agrees with the machine, but not with the other set-ups.

use super::change::Change;
use super::list::targets;
use super::nonsense::{Apart, LikelyMistake, Nonsense};
use super::thinned::Thinned;
use super::undone::without;
use crate::error::Result;
use crate::identify::{CalibrateOptions, Fit, Plausibility, calibrate};
use crate::machine::Machine;
use crate::recording::Recording;

/// A set-up that leaves so many times less alone than beside the others contradicts them, if what is left is more than the tolerances
/// make. Heat, load and play that differ between set-ups stay below the tolerances; so does what a fit alone takes up by chance.
const CONTRADICTS: f64 = 100.0;
/// What explains a set-up leaves no more than this many times what the set-up leaves alone.
const ALIKE: f64 = 5.0;

/// Looks for a set-up that contradicts the others, and for what of it is not what its recordings say.
pub(super) fn search(
    machine: &Machine,
    recordings: &[Recording],
    fit: &Fit,
    progress: &dyn Fn(&str),
) -> Result<Option<Nonsense>> {
    let mut beyond: Vec<&Plausibility> = fit.plausibility.iter().filter(|p| p.left > p.foretold).collect();
    beyond.sort_by(|a, b| (b.left / b.foretold).total_cmp(&(a.left / a.foretold)));
    if fit.setups.len() < 2 || beyond.is_empty() {
        return Ok(None);
    }
    progress("looking whether the set-ups agree");
    let thinned = recordings.iter().map(Thinned::of).collect::<Result<Vec<_>>>()?;
    let left = |recordings: &[Recording], of: &Plausibility, prior: bool| {
        let found = calibrate(machine, recordings, CalibrateOptions::default().with_prior(prior)).ok()?;
        let same = |p: &&Plausibility| p.recording == of.recording && p.of_angles == of.of_angles;
        found.1.plausibility.iter().find(same).map(|p| p.left)
    };
    for worst in beyond {
        let Some(of) = fit.recordings.iter().find(|r| r.name == worst.recording) else { continue };
        let own: Vec<Thinned> = thinned.iter().filter(|t| t.header.setup == of.setup).cloned().collect();
        let Some(alone) = left(&without(machine, &own, &[])?, worst, false) else { continue };
        if worst.left < CONTRADICTS * alone {
            continue;
        }
        let mut changes = targets(&thinned);
        changes.push(Change::Frame);
        let mut mistakes = Vec::new();
        for change in &changes {
            let Some(then) = left(&without(machine, &thinned, &[change])?, worst, true) else { continue };
            if then <= ALIKE * alone {
                let (what, mend) = (change.in_words(machine), change.mend(machine));
                mistakes.push(LikelyMistake { what, mend, left: then });
                break;
            }
        }
        return Ok(Some(Nonsense {
            left: worst.clone(),
            apart: Some(Apart { setup: of.setup.clone(), alone }),
            mistakes,
            tried: changes.len(),
            kinds: "place and rotation of the target, frame w".into(),
        }));
    }
    Ok(None)
}

//! Refusal of results that are nonsense.

use std::fmt::Write;

use super::output::{Failure, Kind, Outcome};
use crate::identify::Fit;
use crate::machine::Machine;
use crate::mistakes::{Nonsense, nonsense, search};
use crate::recording::Recording;

/// Refuses a fit that is nonsense, unless `force` says that it is wanted all the same; then what there is to say is a note.
pub(crate) fn of_fit(
    machine: &Machine,
    recordings: &[Recording],
    fit: &Fit,
    force: bool,
    progress: &dyn Fn(&str),
) -> Outcome<Option<String>> {
    told(search(machine, recordings, fit, progress)?, force)
}

/// The same before anything that takes its time, from a thinned calibration.
pub(crate) fn beforehand(
    machine: &Machine,
    recordings: &[Recording],
    force: bool,
    progress: &dyn Fn(&str),
) -> Outcome<Option<String>> {
    told(nonsense(machine, recordings, progress)?, force)
}

fn told(nonsense: Option<Nonsense>, force: bool) -> Outcome<Option<String>> {
    let Some(nonsense) = nonsense else { return Ok(None) };
    let what = in_words(&nonsense);
    if force {
        return Ok(Some(what));
    }
    let mend = match &nonsense.mistakes[..] {
        [] => "compare `kincal describe MACHINE.ron --at ...` with a pose that was measured".to_string(),
        [only] => only.mend.clone(),
        several => several.iter().map(|m| m.mend.clone()).collect::<Vec<_>>().join("; or "),
    };
    Err(Failure::Told { what, mend: format!("{mend}; --force goes on all the same") })
}

fn in_words(nonsense: &Nonsense) -> String {
    let left = &nonsense.left;
    let kind = if left.of_angles { Kind::Angle } else { Kind::Length };
    let show = |si: f64| if si.is_finite() { kind.show(si) } else { "no number".into() };
    let mut text = format!(
        "{}: recording and machine do not belong together: {} are left, where tolerances and instrument make {} and the joints move the \
         readings by {}",
        left.recording,
        show(left.left),
        show(left.foretold),
        show(left.moved)
    );
    for (i, mistake) in nonsense.mistakes.iter().enumerate() {
        let or = if i > 0 { "or " } else { "" };
        let with = if i > 0 { "with" } else { "With" };
        let _ = write!(
            text,
            "\n  {or}{with} {} {} would be left instead of {}",
            mistake.what,
            show(mistake.left),
            show(left.left)
        );
    }
    if nonsense.mistakes.is_empty() {
        let _ = write!(
            text,
            "\n  none of {} mistakes explains it, alone or in pairs; tried: {}",
            nonsense.tried, nonsense.kinds
        );
    }
    text
}

//! Refusal of results that are nonsense.

use std::fmt::Write;

use super::output::{Failure, Kind, Outcome};
use crate::identify::Fit;
use crate::machine::Machine;
use crate::mistakes::{Nonsense, Odd, nonsense, odd, search};
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

/// A step beyond what tolerances and instrument make that hides so many times less is no note but a refusal.
const HIDES: f64 = 100.0;

/// What happened while the recordings were made, as notes; refused where it hides all else.
pub(crate) fn of_recordings(
    machine: &Machine,
    recordings: &[Recording],
    force: bool,
    progress: &dyn Fn(&str),
) -> Outcome<Vec<String>> {
    let Odd { moved, unsettled, .. } = odd(machine, recordings, progress)?;
    let mut notes = Vec::new();
    if let Some(moved) = moved {
        let kind = if moved.left.of_angles { Kind::Angle } else { Kind::Length };
        let of =
            if moved.setup.is_empty() { String::new() } else { format!(" of set-up \"{}\"", moved.setup) };
        let time = moved.time.map_or_else(String::new, |t| format!(", t = {t} s"));
        let what = format!(
            "{}:{}{time}: the instrument{of} was moved before this line, by {} and {}: {} are left with one place, {} with two",
            moved.recording,
            moved.line,
            Kind::Length.show(moved.by_m),
            Kind::Angle.show(moved.by_rad),
            kind.show(moved.left.left),
            kind.show(moved.then)
        );
        let mend = "put what was read before and behind into recordings of two set-ups, `# setup: NAME`";
        let hides = moved.left.left > moved.left.foretold && moved.left.left > HIDES * moved.then;
        if hides && !force {
            return Err(Failure::Told { what, mend: format!("{mend}; --force goes on all the same") });
        }
        notes.push(format!("{what}; {mend}"));
    }
    if let Some(early) = unsettled {
        let kind = if early.left.of_angles { Kind::Angle } else { Kind::Length };
        notes.push(format!(
            "{}: the joints look read before the machine had settled: with {} {} would be left instead of {}; {}",
            early.left.recording,
            early.what,
            kind.show(early.then),
            kind.show(early.left.left),
            early.mend
        ));
    }
    Ok(notes)
}

fn told(nonsense: Option<Nonsense>, force: bool) -> Outcome<Option<String>> {
    let Some(nonsense) = nonsense else { return Ok(None) };
    let what = in_words(&nonsense);
    if force {
        return Ok(Some(what));
    }
    let mend = match &nonsense.mistakes[..] {
        [] if nonsense.apart.is_some() => {
            "leave out recordings of this set-up, or declare what is new in it: `workpiece_frame`, `tool_point`, `tool_rotation`".to_string()
        }
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
    if let Some(apart) = &nonsense.apart {
        let name = if apart.setup.is_empty() {
            "the set-up without a name".into()
        } else {
            format!("set-up \"{}\"", apart.setup)
        };
        let mut text = format!(
            "{}: {name} contradicts the other set-ups: {} are left, where it leaves {} alone and tolerances and instrument make {}",
            left.recording,
            show(left.left),
            show(apart.alone),
            show(left.foretold)
        );
        for mistake in &nonsense.mistakes {
            let _ = write!(text, "\n  With {} {} would be left", mistake.what, show(mistake.left));
        }
        return text;
    }
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

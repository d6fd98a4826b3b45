//! What a diagnosis says on the terminal.

use std::fmt::Write;

use super::actions::{Action, actions, of_finding};
use super::headline::of_diagnosis;
use super::text::{about, about_unexplained, beside, calm, figures};
use crate::cli::output::count;
use crate::diagnose::Diagnosis;
use crate::location::LocationErrors;

/// Everything.
pub(crate) fn render(diagnosis: &Diagnosis) -> String {
    let mut text = format!("{}\n\n{}", of_diagnosis(diagnosis), head(diagnosis));
    for (i, finding) in diagnosis.findings.iter().enumerate() {
        let _ = writeln!(text, "\n{}. {}", i + 1, finding.explanation);
        for line in about(diagnosis, finding) {
            let _ = writeln!(text, "   {line}");
        }
        let _ = writeln!(text, "   do: {}", of_finding(finding));
    }
    for line in beside(diagnosis) {
        let _ = writeln!(text, "\n{line}");
    }
    if let Some(unexplained) = &diagnosis.unexplained {
        let _ = writeln!(text, "\nunexplained: {}", unexplained.explanation);
        for line in about_unexplained(unexplained) {
            let _ = writeln!(text, "   {line}");
        }
    } else if diagnosis.findings.is_empty() {
        let _ = writeln!(text, "\n{}", calm(diagnosis));
    }
    text.push_str(&geometry_to_do(&diagnosis.location_errors));
    for timeless in diagnosis.not_tried.iter().filter(|n| n.for_want_of_time) {
        let names = timeless.effects.join(", ");
        let _ = writeln!(text, "\nnot tried, since a recording has no column t: {names}");
    }
    for far_off in &diagnosis.far_off {
        let _ = writeln!(
            text,
            "\nnote: frame {} lies {:.0} tolerances from where the machine file has it: check its declaration, or state a larger tolerance there",
            far_off.frame, far_off.tolerances
        );
    }
    text
}

/// Machine, recordings, noise, root mean squares.
fn head(diagnosis: &Diagnosis) -> String {
    let names = &diagnosis.recordings;
    let shown = match names.len() {
        0..=6 => names.join(", "),
        n => format!("{} ... {}", names[0], names[n - 1]),
    };
    let mut text = format!(
        "{}: {} in {} ({shown})\n",
        diagnosis.machine,
        count(diagnosis.samples, "sample", "samples"),
        count(names.len() as u64, "recording", "recordings"),
    );
    for line in figures(diagnosis) {
        let _ = writeln!(text, "{line}");
    }
    text
}

/// What is clearly out of place, and what to do about it.
pub(crate) fn geometry_to_do(location: &LocationErrors) -> String {
    let mut text = String::new();
    for Action { what, remedy } in actions(None, location) {
        text.push_str(if text.is_empty() { "\nwhat to do about the geometry\n" } else { "" });
        for what in what {
            let _ = writeln!(text, "  {what}");
        }
        let _ = writeln!(text, "    do: {remedy}");
    }
    text
}

//! How sure the numbers of geometry are, what could not be seen, and what to measure next.

use maud::{Markup, html};

use super::table::{Cell, largest, number, percent, prose, residual_unit, table, word};
use super::text::{not_tried, tests};
use crate::cli::output::Kind;
use crate::diagnose::Diagnosis;
use crate::identify::{Fit, ParameterFit};
use crate::wording::count;

/// Share of the data from which a component is listed, and below which a combination counts as not seen.
const MOSTLY: f64 = 0.7;
const HARDLY: f64 = 0.1;
/// Combinations that are listed.
const LISTED: usize = 6;

/// Deviations that come mostly from the data.
pub(super) fn uncertainty(fit: &Fit) -> Markup {
    let of = |lengths: bool| -> Vec<&ParameterFit> {
        let own = fit.parameters.iter().filter(|p| p.share > MOSTLY);
        own.filter(|p| p.component.starts_with('v') == lengths).collect()
    };
    let table_of = |lengths: bool| {
        let own = of(lengths);
        let size = largest(own.iter().flat_map(|p| [p.value, p.std_error]));
        let unit = if lengths { residual_unit(false, size) } else { Kind::Angle.unit(size) };
        let row = |p: &&ParameterFit| -> Vec<Cell> {
            let frame =
                if p.setup.is_empty() { p.frame.clone() } else { format!("{}[{}]", p.frame, p.setup) };
            let turns = if p.directions.is_empty() {
                String::new()
            } else {
                format!("direction of {}", p.directions)
            };
            vec![
                word(frame),
                word(&p.component),
                word(turns),
                number(p.value, unit),
                number(p.std_error, unit),
                number(p.tolerance, unit),
                percent(p.share),
            ]
        };
        let heads = ["value", "standard error", "tolerance"].map(|name| format!("{name}, {}", unit.symbol));
        let heads =
            ["frame", "component", "changes with", &heads[0], &heads[1], &heads[2], "share of the data"];
        table(&heads, own.iter().map(row).collect())
    };
    html! {
        h2 { "Uncertainty" }
        p.note {
            "Deviations of single frames that come mostly from the data, with their standard errors (data and tolerances together). Other \
             deviations are known in combinations only: the numbers above that can be entered do not depend on how they are shared out."
        }
        (table_of(true))
        (table_of(false))
    }
}

/// What the recordings do not say.
pub(super) fn unseen(fit: &Fit, diagnosis: Option<&Diagnosis>) -> Markup {
    let hidden: Vec<String> = (fit.combinations.iter())
        .filter(|c| c.share < HARDLY)
        .map(|c| c.parts.iter().take(4).map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(" with "))
        .collect();
    html! {
        h2 { "What could not be seen" }
        p {
            "These recordings see " (fit.rank) " of " (fit.unknowns) " combinations of the unknowns; the same instruments on poses all over the \
             travel would see " (fit.rank_in_general) "."
        }
        @if !hidden.is_empty() {
            p { "Of combinations of deviations they say next to nothing about " (hidden.len()) " (frame.component, the largest of each):" }
            ul {
                @for combination in hidden.iter().take(LISTED) { li { (combination) } }
                @if hidden.len() > LISTED { li { "and " (hidden.len() - LISTED) " more" } }
            }
        }
        @for open in &fit.open { p { (open) } }
        @if let Some(found) = diagnosis.filter(|found| !found.not_tried.is_empty()) {
            p { "Effects that could not be looked for:" }
            ul { @for line in not_tried(found) { li { (line) } } }
        }
    }
}

/// What to measure next, most telling first.
pub(super) fn next(fit: &Fit, diagnosis: Option<&Diagnosis>, still: &[&str]) -> Markup {
    let mut list: Vec<String> = Vec::new();
    let mut add = |line: String| {
        if !list.contains(&line) {
            list.push(line);
        }
    };
    if let Some(found) = diagnosis {
        if let Some(unexplained) = &found.unexplained {
            add(super::text::next_test(unexplained));
        }
        for finding in &found.findings {
            for (test, of) in tests(finding) {
                add(format!("{test} (tells {} at {} from {})", finding.effect, finding.at, of.join(" and ")));
            }
        }
    }
    if !still.is_empty() {
        add(format!("move what stood still: {}", still.join(", ")));
    }
    if fit.rank < fit.rank_in_general {
        add(format!(
            "poses all over the travel with all axes moving: {} instead of {}",
            fit.rank_in_general,
            count(fit.rank as u64, "combination", "combinations")
        ));
    }
    let hidden = fit.combinations.iter().filter(|c| c.share < HARDLY).count();
    if hidden > 0 && fit.rank >= fit.rank_in_general {
        add("another instrument, or another place of it: these see no more anywhere; `kincal describe MACHINE.ron` says what each kind sees".into());
    }
    add("the same again on another day, and `kincal predict` it with the calibrated file: what holds then may be entered".into());
    html! {
        h2 { "The next measurement" }
        ol { @for line in &list { li { (prose(line)) } } }
    }
}

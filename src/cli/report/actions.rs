//! What to do about it: every finding ends in an action, and so does every number of geometry that is clearly not zero.

use maud::{Markup, html};

use super::table::prose;
use super::text::{next_test, tests};
use crate::diagnose::{Diagnosis, Finding};
use crate::location::LocationErrors;

/// A name that others may take the place of with this probability is measured first.
const DOUBTED: f64 = 0.3;

/// What is the case, and what to do about all of it.
pub(super) struct Action {
    pub what: Vec<String>,
    pub remedy: String,
}

/// What to do about a finding.
pub(super) fn of_finding(finding: &Finding) -> String {
    let doubt: f64 = finding.confusable_with.iter().map(|other| other.probability).sum();
    let first = tests(finding).into_iter().next().filter(|_| doubt > DOUBTED || !finding.also_at.is_empty());
    let remedy = match finding.remedy.as_str() {
        "" => "let `kincal compensate` correct it with the file of -o".to_string(),
        remedy => remedy.to_string(),
    };
    match first {
        Some((test, _)) => format!("measure first: {test}; then {remedy}"),
        None => remedy,
    }
}

/// Everything that can be done, the most important first; what calls for the same stands together.
pub(super) fn actions(diagnosis: Option<&Diagnosis>, location: &LocationErrors) -> Vec<Action> {
    let mut list: Vec<Action> = Vec::new();
    let mut add = |what: String, remedy: String| match list.iter_mut().find(|a| a.remedy == remedy) {
        Some(action) => action.what.push(what),
        None => list.push(Action { what: vec![what], remedy }),
    };
    if let Some(found) = diagnosis {
        for finding in &found.findings {
            add(finding.explanation.clone(), of_finding(finding));
        }
        if let Some(unexplained) = &found.unexplained {
            add(unexplained.explanation.clone(), format!("measure this next: {}", next_test(unexplained)));
        }
    }
    for said in location.in_words() {
        add(format!("{} ({})", said.what, said.name), said.remedy.into());
    }
    list
}

/// The section.
pub(super) fn to_do(list: &[Action]) -> Markup {
    html! {
        @if !list.is_empty() {
            div.card {
                h2 { "What to do" }
                ol.do {
                    @for action in list {
                        li { @for what in &action.what { strong { (what) } br; } (prose(&action.remedy)) "." }
                    }
                }
            }
        }
    }
}

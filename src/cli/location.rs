//! ISO 230-1 location errors as people read them.

use std::fmt::Write;

use crate::location::LocationErrors;

use super::output::{Kind, length};
use super::table::table;

/// A short table, or the reason why location errors do not apply.
pub(crate) fn render_location_errors(found: &LocationErrors) -> String {
    let mut text = String::new();
    if let Some(reason) = &found.reason {
        return format!("\nno location errors: {reason}\n");
    }
    let seen_from = match found.reference_t_m {
        [0.0, 0.0, 0.0] => "the origin of t".to_string(),
        point => format!("({}) in t", point.map(length).join(", ")),
    };
    let _ = writeln!(
        text,
        "\nlocation errors, ISO 230-1 (primary axis {}, secondary {}; offsets seen from {seen_from})",
        found.primary.as_deref().unwrap_or("-"),
        found.secondary.as_deref().unwrap_or("-")
    );
    let rows: Vec<Vec<String>> = (found.errors.iter())
        .map(|error| {
            let kind = if error.unit == "m" { Kind::Length } else { Kind::Angle };
            let (value, spread, unit) = kind.show_with_error(error.value, error.std_error);
            let verdict = if error.identified { "identified" } else { "not identified" };
            let share = format!("{:.0} %", 100.0 * error.share);
            vec![error.name.clone(), value, format!("± {spread} {unit}"), share, verdict.into()]
        })
        .collect();
    text.push_str(&table("  ", &[false, true, false, true, false], &rows));
    if let Some(caution) = found.caution() {
        let _ = writeln!(text, "  {caution}");
    }
    text
}

//! ISO 230-1 location errors as people read them.

use std::fmt::Write;

use kincal::location::LocationErrors;

use super::output::{angle, length};

/// A short table, or the reason why location errors do not apply.
pub(crate) fn render_location_errors(found: &LocationErrors) -> String {
    let mut text = String::new();
    if let Some(reason) = &found.reason {
        return format!("\nno location errors: {reason}\n");
    }
    let [x, y, z] = found.reference_t_m.map(length);
    let _ = writeln!(
        text,
        "\nlocation errors, ISO 230-1 (value ± standard error, share of the data; primary axis {}, secondary {}; offsets seen from ({x}, {y}, {z}) in t)",
        found.primary.as_deref().unwrap_or("-"),
        found.secondary.as_deref().unwrap_or("-")
    );
    for error in &found.errors {
        let show = if error.unit == "m" { length } else { angle };
        let spread = if error.std_error.is_finite() { show(error.std_error) } else { "unknown".into() };
        let _ = writeln!(
            text,
            "  {:<16}{:>17} ± {:<12} {:>4.0} %  {}",
            error.name,
            show(error.value),
            spread,
            100.0 * error.share,
            if error.identified { "identified" } else { "not identified" }
        );
    }
    text
}

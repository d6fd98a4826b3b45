//! What the commands on NC programs share: how their arguments are spelled, and how places in programs and moves that are off are told.

use std::fmt::Write;

use crate::compensate::{Departure, IntegerUnit, Verification, Worst};
use crate::nc::Dialect;
use crate::units::{Quantity, Unit};

use super::output::length;

#[derive(Clone, Copy, clap::ValueEnum)]
pub(super) enum DialectWord {
    /// LinuxCNC, Fanuc, Haas and their kin
    Rs274,
    Siemens,
    Heidenhain,
}

#[derive(Clone, Copy, clap::ValueEnum)]
pub(super) enum IntegerWord {
    /// Millimetres and degrees
    Mm,
    /// Thousandths of them, the least increments of the control
    Um,
}

/// The unit of a word.
pub(super) fn integer_unit_of(word: IntegerWord) -> IntegerUnit {
    match word {
        IntegerWord::Mm => IntegerUnit::Mm,
        IntegerWord::Um => IntegerUnit::Um,
    }
}

/// The dialect of a word.
pub(super) fn dialect_of(word: DialectWord) -> Dialect {
    match word {
        DialectWord::Rs274 => Dialect::Rs274,
        DialectWord::Siemens => Dialect::Siemens,
        DialectWord::Heidenhain => Dialect::Heidenhain,
    }
}

/// A length with its unit, m.
pub(super) fn tolerance(text: &str) -> Result<f64, String> {
    let digits = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let unit = Unit::named(unit.trim()).filter(|u| u.quantity == Quantity::Length);
    match (number.trim().parse::<f64>(), unit) {
        (Ok(number), Some(unit)) if number > 0.0 && number.is_finite() => Ok(unit.to_si(number)),
        (Ok(_), Some(_)) => Err("expected a length above zero".into()),
        (Ok(_), None) => {
            Err(format!("expected a unit behind the number: {}", Unit::symbols_of(Quantity::Length)))
        }
        _ => Err("expected a length with its unit, such as 0.002mm".into()),
    }
}

/// A figure with the line at which it is reached.
pub(super) fn at(worst: Worst, show: fn(f64) -> String) -> String {
    match worst.line {
        0 => show(worst.value),
        line => format!("{} (line {line})", show(worst.value)),
    }
}

/// The worst of the moves that are not where they are meant.
pub(super) fn departures(found: &Verification) -> String {
    let mut text = String::new();
    let mut worst: Vec<_> = found.departures.first.iter().collect();
    let size =
        |d: &Departure| d.end_m.zip(d.between_m).map_or(f64::INFINITY, |(end, between)| end.max(between));
    worst.sort_by(|a, b| size(b).total_cmp(&size(a)));
    for departure in worst.into_iter().take(10) {
        let written = departure.compensated_line;
        let _ = match (departure.line, departure.end_m, departure.between_m) {
            (line, Some(end), Some(between)) => writeln!(
                text,
                "  line {line} (written in line {written}): {} at its end, {} beside its path",
                length(end),
                length(between)
            ),
            (0, ..) => {
                writeln!(text, "  line {written} of what was written: a move that the original does not have")
            }
            (line, ..) => writeln!(text, "  line {line}: no move was written for it"),
        };
    }
    text
}

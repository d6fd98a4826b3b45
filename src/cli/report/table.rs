//! Tables of a report: a column has one unit, numbers carry their SI value for sorting, and on a phone every row folds into lines.

use maud::{Markup, html};

use crate::cli::output::{Shown, decimals};

/// A word of more letters may be broken anywhere: a screen of 800 px has room for a table with one of so many.
const LONG: usize = 32;

/// What stands in a cell.
pub(super) struct Cell {
    text: String,
    /// By what it is sorted, where that is a number: SI.
    value: Option<f64>,
}

impl Cell {
    fn is_long(&self) -> bool {
        self.text.split_whitespace().any(|word| word.chars().count() > LONG)
    }
}

/// A word.
pub(super) fn word(text: impl Into<String>) -> Cell {
    Cell { text: text.into(), value: None }
}

/// A number in a unit that the head of its column says.
pub(super) fn number(si: f64, unit: Shown) -> Cell {
    let value = si * unit.per_si;
    let text = match value.is_finite() {
        true => format!("{value:.*}", decimals(value, 3).min(5)),
        false => "open".into(),
    };
    Cell { text: no_minus_before_zero(text), value: Some(si) }
}

/// The same, or nothing.
pub(super) fn number_or_none(si: Option<f64>, unit: Shown) -> Cell {
    si.map_or_else(|| word(""), |si| number(si, unit))
}

/// A number as it is written elsewhere.
pub(super) fn written(text: impl Into<String>, value: f64) -> Cell {
    Cell { text: text.into(), value: Some(value) }
}

/// A part of all.
pub(super) fn percent(share: f64) -> Cell {
    written(format!("{:.0} %", 100.0 * share), share)
}

fn no_minus_before_zero(text: String) -> String {
    let bare = text.trim_start_matches('-');
    if bare.chars().all(|c| c == '0' || c == '.') { bare.to_string() } else { text }
}

/// Lengths of a residual or angles, in one unit for all of them: um or mm, arcsec or deg.
pub(super) fn residual_unit(angle: bool, largest: f64) -> Shown {
    let (symbol, per_si) = match (angle, largest) {
        (false, s) if s < 1e-3 => ("um", 1e6),
        (false, s) if s < 1.0 => ("mm", 1e3),
        (false, _) => ("m", 1.0),
        (true, s) if s < 2e-3 => ("arcsec", 3600f64.to_degrees()),
        (true, _) => ("deg", 1f64.to_degrees()),
    };
    Shown { symbol, per_si }
}

/// The largest size among numbers that are some.
pub(super) fn largest(numbers: impl IntoIterator<Item = f64>) -> f64 {
    numbers.into_iter().map(f64::abs).filter(|x| x.is_finite()).fold(0.0, f64::max)
}

/// A text whose parts in backquotes are code.
pub(super) fn prose(text: &str) -> Markup {
    html! { @for (k, part) in text.split('`').enumerate() { @if k % 2 == 1 { code { (part) } } @else { (part) } } }
}

/// A table with a head; columns without any text are left out.
pub(super) fn table(heads: &[&str], rows: Vec<Vec<Cell>>) -> Markup {
    let is_used = |c: usize| rows.iter().any(|row| row.get(c).is_some_and(|cell| !cell.text.is_empty()));
    let columns: Vec<usize> = (0..heads.len()).filter(|c| is_used(*c)).collect();
    let is_number = |c: usize| rows.iter().any(|row| row.get(c).is_some_and(|cell| cell.value.is_some()));
    let numeric: Vec<bool> = (0..heads.len()).map(is_number).collect();
    html! {
        @if !rows.is_empty() {
            div.wide { table.fold {
                thead { tr {
                    @for c in &columns {
                        th scope="col" class=[numeric[*c].then_some("n")] { button type="button" { (heads[*c]) } }
                    }
                } }
                tbody {
                    @for row in &rows { tr {
                        @for c in &columns {
                            @if let Some(cell) = row.get(*c) {
                                td class=[numeric[*c].then_some("n").or(cell.is_long().then_some("long"))] data-h=(heads[*c])
                                    data-v=[cell.value.filter(|v| v.is_finite()).map(|v| format!("{v:e}"))] { (cell.text) }
                            }
                        }
                    } }
                }
            } }
        }
    }
}

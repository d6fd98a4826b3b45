//! What to enter in a control: the numbers that the exports know, which follow from the axes as lines and do not depend on how
//! deviations are shared out between neighbouring frames.

use maud::{Markup, html};

use super::table::{Cell, prose, table, word, written};
use crate::calibration::CalibratedMachine;
use crate::export::{ExportOptions, Exported, Format, export};

/// Controls, and what they are called here.
const CONTROLS: [(Format, &str); 4] = [
    (Format::Siemens, "SINUMERIK"),
    (Format::Heidenhain, "HEIDENHAIN"),
    (Format::Fanuc, "FANUC"),
    (Format::LinuxCnc, "LinuxCNC"),
];

/// The section; machines that no control here knows have their DH parameters.
pub(super) fn to_enter(calibrated: &CalibratedMachine) -> Markup {
    let options = ExportOptions::default();
    let of = |(format, name): (Format, &'static str)| {
        export(calibrated, format, &options).ok().map(|exported| (format, name, exported))
    };
    let mut found: Vec<(Format, &str, Exported)> = CONTROLS.into_iter().filter_map(of).collect();
    if found.is_empty() {
        found.extend(of((Format::Mdh, "Denavit-Hartenberg, modified")));
    }
    html! {
        @if !found.is_empty() {
            h2 { "What to enter" }
            p {
                "Numbers as " code { "kincal export CALIBRATED.ron --to FORMAT" } " writes them into files, here without a tool length \
                 (" code { "--tool-length" } "). What the recordings left open has no number."
            }
            @for (format, name, exported) in &found { (of_control(*format, name, exported)) }
        }
    }
}

fn of_control(format: Format, name: &str, exported: &Exported) -> Markup {
    let mut units: Vec<&str> = Vec::new();
    for number in &exported.numbers {
        if !units.contains(&number.unit.as_str()) {
            units.push(&number.unit);
        }
    }
    let open: Vec<&str> =
        exported.numbers.iter().filter(|n| n.value.is_none()).map(|n| n.name.as_str()).collect();
    html! {
        details {
            summary { (name) " (" code { "--to " (format.name()) } ")" }
            @for unit in &units { (of_unit(exported, unit)) }
            @if !open.is_empty() { p.note { "Left open: " (open.join(", ")) "." } }
            @if !exported.left_out.is_empty() {
                p.note { "Not held by it:" }
                ul {
                    @for left in &exported.left_out {
                        li {
                            (left.what)
                            @if let Some(max) = left.max_m { ", up to " (crate::cli::output::length(max)) " at the tool" }
                            "; " (prose(&left.because))
                        }
                    }
                }
            }
            ul.note { @for line in &exported.told { li { (line) } } }
        }
    }
}

/// Numbers in one unit, those that have a value.
fn of_unit(exported: &Exported, unit: &str) -> Markup {
    let own = exported.numbers.iter().filter(|n| n.unit == unit);
    // 0.1 um, 0.1 urad.
    let decimals = match unit {
        "mm" => 4,
        "um" | "urad" => 1,
        _ => 7,
    };
    let text = |value: f64, sign: bool| {
        // No sign before what is zero to so many decimals.
        let value = if value.abs() < 0.5 * 10f64.powi(-(decimals as i32)) { 0.0 } else { value };
        match sign && value != 0.0 {
            true => format!("{value:+.decimals$}"),
            false => format!("{value:.decimals$}"),
        }
    };
    let rows: Vec<Vec<Cell>> = own
        .filter_map(|number| {
            let value = number.value?;
            Some(vec![
                word(&number.name),
                written(text(number.declared, false), number.declared),
                written(text(value, false), value),
                written(text(value - number.declared, true), value - number.declared),
            ])
        })
        .collect();
    let with = |name: &str| if unit == "1" { name.to_string() } else { format!("{name}, {unit}") };
    table(&["name", &with("declared"), &with("to enter"), &with("change")], rows)
}

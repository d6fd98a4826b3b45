//! Root mean squares by recording and model, and how the models compare.

use maud::{Markup, html};

use super::residuals::ink_of;
use super::table::{Cell, largest, number_or_none, residual_unit, table, word, written};
use super::track::Figures;
use crate::cli::output::Shown;
use crate::units::Rms;

/// The section. `all`: over all recordings, by model, as text and JSON have them.
pub(super) fn before_after(figures: &[Figures], stages: &[&'static str], all: &[Rms]) -> Markup {
    html! {
        h2 { "Before and after" }
        @for angle in [false, true] { (of_quantity(figures, stages, all, angle)) }
    }
}

fn of(rms: &Rms, angle: bool) -> Option<f64> {
    if angle { rms.rad } else { rms.m }
}

fn of_quantity(figures: &[Figures], stages: &[&'static str], all: &[Rms], angle: bool) -> Markup {
    let own: Vec<&Figures> =
        figures.iter().filter(|f| f.rms.iter().any(|rms| of(rms, angle).is_some())).collect();
    let size = largest(own.iter().flat_map(|f| f.rms.iter().filter_map(|rms| of(rms, angle))));
    let unit = residual_unit(angle, size);
    let heads: Vec<String> = stages.iter().map(|stage| format!("{stage}, {}", unit.symbol)).collect();
    let heads: Vec<&str> =
        ["recording", "measurement", "samples"].into_iter().chain(heads.iter().map(String::as_str)).collect();
    let row = |f: &&Figures| -> Vec<Cell> {
        let mut row =
            vec![word(&f.recording), word(f.measurement), written(f.samples.to_string(), f.samples as f64)];
        row.extend(f.rms.iter().map(|rms| number_or_none(of(rms, angle), unit)));
        row
    };
    let mut rows: Vec<Vec<Cell>> = own.iter().map(row).collect();
    let totals: Vec<Option<f64>> = all.iter().map(|rms| of(rms, angle)).collect();
    if totals.iter().any(Option::is_some) && !own.is_empty() {
        let samples: u64 = own.iter().map(|f| f.samples).sum();
        let mut row = vec![word("all"), word(""), written(samples.to_string(), samples as f64)];
        row.extend(totals.iter().map(|total| number_or_none(*total, unit)));
        rows.push(row);
    }
    html! {
        @if !own.is_empty() {
            (bars(&totals, stages, unit))
            p.note { "Root mean square of the residuals (measured minus model) over samples." }
            (table(&heads, rows))
        }
    }
}

/// One bar for each model.
fn bars(totals: &[Option<f64>], stages: &[&'static str], unit: Shown) -> Markup {
    const WIDTH: f64 = 520.0;
    const ROW: f64 = 48.0;
    let most = largest(totals.iter().flatten().copied()).max(f64::MIN_POSITIVE);
    let shown: Vec<(usize, f64)> = totals.iter().enumerate().filter_map(|(k, x)| Some((k, (*x)?))).collect();
    let value = |x: f64| {
        let x = x * unit.per_si;
        format!("{x:.*} {}", crate::cli::output::decimals(x, 3), unit.symbol)
    };
    let told: Vec<String> = shown.iter().map(|(k, x)| format!("{}: {}", stages[*k], value(*x))).collect();
    html! {
        figure {
            svg xmlns="http://www.w3.org/2000/svg" role="img"
                viewBox=(format!("0 0 {WIDTH} {}", ROW * shown.len() as f64)) {
                title { "Error before and after" }
                desc { (told.join("; ")) "." }
                @for (i, (k, x)) in shown.iter().enumerate() {
                    @let y = ROW * i as f64;
                    text x="0" y=(y + 19.0) { (stages[*k]) }
                    text x=(WIDTH) y=(y + 19.0) text-anchor="end" { (value(*x)) }
                    rect class=(format!("bar {}", ink_of(*k).class())) x="0" y=(y + 25.0)
                        width=(format!("{:.1}", (WIDTH * x / most).max(1.0))) height="14" rx="2" {}
                }
            }
        }
    }
}

//! What a diagnosis found: a table, for each finding what there is to say and the shape of its effect, and what is left.

use maud::{Markup, html};

use super::plot::{Ink, Layer, Marks, Plot, envelope, thinned};
use super::table::{Cell, largest, number, percent, residual_unit, table, word, written};
use super::text::{about, about_unexplained, amount, beside, calm, figures, places_of, probability, tests};
use crate::cli::output::Kind;
use crate::diagnose::{Along, Curve, CurvePoint, Diagnosis, Finding, Size};
use crate::effects::in_words;
use crate::feature::Dimension;
use crate::location::LocationErrors;

/// Dots and corners of all pictures of findings together, and of one at most.
const ALL_POINTS: usize = 7_000;
const MOST_POINTS: usize = 900;

/// The sections of what was found and of what no name explains.
pub(super) fn found(diagnosis: &Diagnosis) -> Markup {
    let traces = &diagnosis.traces;
    let most = (ALL_POINTS / (traces.findings.len() + 1)).clamp(50, MOST_POINTS);
    html! {
        h2 { "What was looked at" }
        ul { @for line in figures(diagnosis) { li { (line) } } }
        @if !diagnosis.findings.is_empty() {
            h2 { "What was found" }
            (shares(&diagnosis.findings))
            (table_of(&diagnosis.findings))
            @for (i, finding) in diagnosis.findings.iter().enumerate() {
                h3 { (i + 1) ". " (finding.explanation) }
                ul.plain { @for line in about(diagnosis, finding) { li { (line) } } }
                @if let Some(curve) = traces.findings.get(i) { (against(curve, Some(finding), most)) }
            }
        }
        @for line in beside(diagnosis) { p { (line) } }
        @if diagnosis.findings.is_empty() && diagnosis.unexplained.is_none() { p { (calm(diagnosis)) } }
        @if let Some(unexplained) = &diagnosis.unexplained {
            h2 { "Unexplained" }
            p { (unexplained.explanation) }
            ul.plain { @for line in about_unexplained(unexplained) { li { (line) } } }
            @if let Some(curve) = &traces.unexplained { (against(curve, None, most)) }
        }
    }
}

/// Which part of the misfit goes with which finding: one bar.
fn shares(findings: &[Finding]) -> Markup {
    const WIDTH: f64 = 520.0;
    let total: f64 = findings.iter().map(|finding| finding.share).sum();
    let scale = WIDTH / total.max(1.0);
    let inks = [Ink::Forward, Ink::Backward, Ink::Named, Ink::Before, Ink::Curve];
    let (mut from, mut parts) = (0.0, Vec::new());
    for (k, finding) in findings.iter().enumerate() {
        let width = finding.share * scale;
        parts.push((inks[k % inks.len()], from, width));
        from += width;
    }
    let names: Vec<String> = findings
        .iter()
        .map(|finding| format!("{} at {}, {:.0} %", finding.name(), finding.at, 100.0 * finding.share))
        .collect();
    let mut entries: Vec<(Ink, &str)> =
        parts.iter().zip(&names).map(|((ink, ..), name)| (*ink, name.as_str())).collect();
    entries.push((Ink::Neither, "the rest"));
    html! {
        figure {
            figcaption { strong { "Share of what geometry leaves over" } (super::plot::legend(&entries)) }
            svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {WIDTH} 22")) role="img" {
                title { "Share of what geometry leaves over" }
                desc { (names.join("; ")) "." }
                rect class="bar m-none" x="0" y="2" width=(WIDTH) height="18" opacity="0.5" {}
                @for (ink, from, width) in &parts {
                    rect class=(format!("bar {}", ink.class())) x=(format!("{from:.1}")) y="2"
                        width=(format!("{width:.1}")) height="18" {}
                }
            }
        }
    }
}

fn table_of(findings: &[Finding]) -> Markup {
    let row = |(i, finding): (usize, &Finding)| -> Vec<Cell> {
        let held_out = [(finding.held_out_rms.m, false), (finding.held_out_rms.rad, true)];
        let held_out: Vec<String> = held_out
            .iter()
            .filter_map(|(pair, angle)| {
                pair.map(|pair| format!("{} → {}", amount(pair.before, *angle), amount(pair.after, *angle)))
            })
            .collect();
        let others = finding.confusable_with.iter();
        let others: Vec<String> =
            others.map(|o| format!("{} at {} ({})", o.effect, o.at, probability(o.probability))).collect();
        let tests: Vec<&str> = tests(finding).into_iter().map(|(test, _)| test).collect();
        vec![
            written((i + 1).to_string(), i as f64),
            word(finding.name()),
            word(places_of(finding)),
            word(sizes(finding).join("; ")),
            written(probability(finding.probability), finding.probability),
            percent(finding.share),
            word(held_out.join("; ")),
            word(others.join("; ")),
            word(tests.join("; ")),
        ]
    };
    let heads = [
        "no.",
        "effect",
        "at",
        "size",
        "probability",
        "share",
        "held-out error",
        "may be instead",
        "next test",
    ];
    table(&heads, findings.iter().enumerate().map(row).collect())
}

/// The first numbers of a finding; the rest of a curve says nothing to people.
fn sizes(finding: &Finding) -> Vec<String> {
    let of = |size: &Size| {
        let dimension = Dimension::parse(&size.unit, None).unwrap_or(Dimension::ONE);
        let error = size.std_error.is_finite().then_some(size.std_error);
        format!("{} {}", size.name.replace('_', " "), in_words(size.value, error, dimension, None))
    };
    finding.coefficients.iter().take(4).map(of).collect()
}

/// Residual against what a finding depends on, by direction, and what the finding takes away of it.
fn against(curve: &Curve, finding: Option<&Finding>, most: usize) -> Markup {
    let points: Vec<CurvePoint> = curve.runs.iter().flatten().copied().collect();
    let unit = residual_unit(curve.angle, largest(points.iter().map(|p| p.residual)));
    let (factor, symbol) = (unit.per_si, unit.symbol);
    let (x_factor, x_label, who) = match &curve.along {
        Along::Joint { name, angle: true } => {
            (1f64.to_degrees(), format!("position of {name}, deg"), &name[..])
        }
        Along::Joint { name, angle: false } => (1e3, format!("position of {name}, mm"), &name[..]),
        Along::Load { name } => (1.0, format!("load of {name} by gravity"), &name[..]),
        Along::Time => (1.0, "time, s".to_string(), ""),
        Along::Sample => (1.0, "sample".to_string(), ""),
    };
    let mut layers = Vec::new();
    for (direction, ink, name) in [
        (1, Ink::Forward, format!("{who} forward")),
        (-1, Ink::Backward, format!("{who} backward")),
        (0, Ink::Neither, "residual".to_string()),
    ] {
        let own: Vec<(f64, f64)> = (points.iter().filter(|p| p.direction == direction))
            .map(|p| (p.x * x_factor, p.residual * factor))
            .collect();
        if !own.is_empty() {
            let part = (most * own.len()).div_ceil(points.len());
            layers.push(Layer { ink, name, marks: Marks::Dots(thinned(&own, part)) });
        }
    }
    if finding.is_some() {
        let line = |run: &Vec<CurvePoint>| -> Vec<(f64, f64)> {
            let line: Vec<(f64, f64)> = run.iter().map(|p| (p.x * x_factor, p.effect * factor)).collect();
            envelope(&line, (most * run.len()).div_ceil(points.len()).max(2))
        };
        let is_cloud = is_scattered(curve) || matches!(curve.along, Along::Load { .. });
        let marks = match is_cloud {
            true => Marks::Dots(points.iter().map(|p| (p.x * x_factor, p.effect * factor)).collect()),
            false => Marks::Lines(curve.runs.iter().filter(|run| run.len() > 1).map(line).collect()),
        };
        layers.push(Layer { ink: Ink::Curve, name: "what this finding explains".into(), marks });
    }
    let caption = match finding {
        Some(_) => {
            "Residual with geometry and all other findings fitted, and the part of it that goes with this one."
        }
        None => "Residual with geometry fitted, against the place that it fits best.",
    };
    let plot = Plot {
        title: finding.map_or("what is unexplained".into(), |f| format!("{} at {}", f.name(), f.at)),
        x_label,
        y_label: format!("residual, {symbol}"),
        layers,
        ..Plot::default()
    };
    html! { @if let Some(figure) = plot.figure(caption) { (figure) } }
}

/// From one sample to the next, poses that come in no order go farther than this part of the whole range.
const FAR: f64 = 0.15;

/// Whether neighbours in time lie anywhere along it, so that no line joins them.
fn is_scattered(curve: &Curve) -> bool {
    let x = || curve.runs.iter().flatten().map(|p| p.x);
    let range = x().fold(f64::NEG_INFINITY, f64::max) - x().fold(f64::INFINITY, f64::min);
    let mut steps: Vec<f64> =
        curve.runs.iter().flat_map(|run| run.windows(2).map(|w| (w[1].x - w[0].x).abs())).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).is_some_and(|step| *step > FAR * range)
}

/// The section of what is left.
pub(super) fn left(diagnosis: &Diagnosis) -> Markup {
    html! {
        h2 { "What is left" }
        div.figures { @for angle in [false, true] { (distribution(diagnosis, angle)) } }
    }
}

/// How the residuals that are left are distributed, against the noise.
fn distribution(diagnosis: &Diagnosis, angle: bool) -> Markup {
    const HALF: usize = 20;
    const WIDTH: f64 = 0.25;
    let noise = if angle { diagnosis.noise_floor.rad } else { diagnosis.noise_floor.m };
    let own = diagnosis.traces.recordings.iter().filter(|trace| trace.angle == angle);
    let left: Vec<f64> = own.flat_map(|trace| trace.r#final.iter().flatten().copied()).collect();
    let Some(noise) = noise.filter(|n| *n > 0.0 && !left.is_empty()) else { return html! {} };
    let mut counts = [0u32; 2 * HALF];
    for residual in &left {
        let bin = (residual / noise / WIDTH).floor().clamp(-(HALF as f64), HALF as f64 - 1.0);
        counts[(bin + HALF as f64) as usize] += 1;
    }
    let edge = |k: usize| WIDTH * (k as f64 - HALF as f64);
    let bars =
        counts.iter().enumerate().map(|(k, n)| (edge(k), edge(k + 1), f64::from(*n))).collect::<Vec<_>>();
    let peak = left.len() as f64 * WIDTH / std::f64::consts::TAU.sqrt();
    let normal =
        (-100..=100).map(|k| f64::from(k) * 0.05).map(|z| (z, peak * (-0.5 * z * z).exp())).collect();
    let plot = Plot {
        title: "what is left".into(),
        x_label: format!("residual over the noise of the readings ({})", amount(noise, angle)),
        y_label: "readings".into(),
        layers: vec![
            Layer { ink: Ink::After, name: "what is left".into(), marks: Marks::Bars(bars) },
            Layer { ink: Ink::Curve, name: "noise alone".into(), marks: Marks::Lines(vec![normal]) },
        ],
        ..Plot::default()
    };
    let caption = "Readings more than five times the noise off stand in the outermost bars.";
    html! { @if let Some(figure) = plot.figure(caption) { (figure) } }
}

/// Location errors of the machine.
pub(super) fn geometry(found: &LocationErrors) -> Markup {
    let of = |unit: &str| -> Vec<_> { found.errors.iter().filter(|error| error.unit == unit).collect() };
    let table_of = |symbol: &str| {
        let own = of(symbol);
        let size = largest(own.iter().map(|error| error.value));
        let unit = if symbol == "m" { residual_unit(false, size) } else { Kind::Angle.unit(size) };
        let row = |error: &&crate::location::LocationError| {
            vec![
                word(&error.name),
                word(&error.axis),
                number(error.value, unit),
                number(error.std_error, unit),
                percent(error.share),
                word(if error.identified { "identified" } else { "not identified" }),
            ]
        };
        let heads = [format!("value, {}", unit.symbol), format!("standard error, {}", unit.symbol)];
        table(
            &["name", "axis", &heads[0], &heads[1], "share of the data", "verdict"],
            own.iter().map(row).collect(),
        )
    };
    html! {
        h2 { "Geometry" }
        @if let Some(reason) = &found.reason {
            p { "No ISO 230-1 location errors: " (reason) "." }
        } @else {
            p.note {
                "Location errors of ISO 230-1 (primary axis " (found.primary.as_deref().unwrap_or("-")) ", secondary "
                (found.secondary.as_deref().unwrap_or("-")) ")."
            }
            (table_of("rad"))
            (table_of("m"))
            @if let Some(caution) = found.caution() { p.note { "Errors " (caution) "." } }
        }
    }
}

//! The report of a diagnosis: one HTML file that needs nothing else.

use crate::diagnose::{Along, Curve, CurvePoint, Diagnosis, Finding, Size, Trace};
use crate::effects::in_words;
use crate::feature::Dimension;
use crate::location::LocationErrors;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::plot::{AFTER, BACKWARD, BEFORE, CURVE, FORWARD, Layer, Marks, NEITHER, Plot, envelope, thinned};
use super::text::{CALM, about, about_unexplained, amount, beside, figures, not_tried, probability, tests};
use crate::cli::output::{Kind, count};

/// Dots and corners of all pictures together, and of one at most: the file stays below a megabyte.
const ALL_POINTS: usize = 36_000;
const MOST_POINTS: usize = 1500;
/// A picture of a recording with so few samples has dots, not lines.
const FEW: usize = 200;
/// A gap this many times the usual step breaks a line.
const GAP: f64 = 20.0;

const STYLE: &str = "body{font:15px/1.5 sans-serif;color:#222;max-width:60rem;margin:2rem auto;padding:0 1rem}\
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2.2rem;border-bottom:1px solid #ccc}h3{font-size:1rem}\
table{border-collapse:collapse;width:100%;font-size:.87rem}th,td{text-align:left;vertical-align:top;padding:.35rem .6rem;border-bottom:1px solid #ddd}\
td.n{text-align:right;white-space:nowrap}svg{width:100%;height:auto}figure{margin:1rem 0}figcaption,.note{color:#555;font-size:.87rem}\
ul.plain{list-style:none;padding:0}@media print{figure,tr{break-inside:avoid}}";

/// The whole file.
pub(crate) fn page(diagnosis: &Diagnosis) -> String {
    let traces = &diagnosis.traces;
    let pictures = traces.recordings.len() + traces.findings.len() + 1;
    let most = (ALL_POINTS / pictures).clamp(50, MOST_POINTS);
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "Diagnosis of " (diagnosis.machine) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { "Diagnosis of " (diagnosis.machine) }
                (summary(diagnosis))
                @if !diagnosis.findings.is_empty() {
                    h2 { "What was found" }
                    (table_of(&diagnosis.findings))
                    @for (i, finding) in diagnosis.findings.iter().enumerate() {
                        h3 { (i + 1) ". " (finding.explanation) }
                        ul.plain { @for line in about(diagnosis, finding) { li { (line) } } }
                        @if let Some(curve) = traces.findings.get(i) { (against(curve, Some(finding), most)) }
                    }
                    @for line in beside(diagnosis) { p { (line) } }
                }
                @if let Some(unexplained) = &diagnosis.unexplained {
                    h2 { "Unexplained" }
                    p { (unexplained.explanation) }
                    ul.plain { @for line in about_unexplained(unexplained) { li { (line) } } }
                    @if let Some(curve) = &traces.unexplained { (against(curve, None, most)) }
                }
                h2 { "The recordings" }
                @for trace in &traces.recordings { (along(trace, diagnosis.has_more_than_geometry(), most)) }
                h2 { "What is left" }
                @for angle in [false, true] { (left(diagnosis, angle)) }
                (geometry(&diagnosis.location_errors))
                @if !diagnosis.not_tried.is_empty() {
                    h2 { "What could not be looked for" }
                    ul { @for line in not_tried(diagnosis) { li { (line) } } }
                }
                p.note {
                    "Residuals are measured minus model. Pictures show every so many samples, extremes along the path kept; they are of the \
                     linearised model that the search works on. kincal " (env!("CARGO_PKG_VERSION")) "."
                }
            }
        }
    };
    markup.into_string() + "\n"
}

fn summary(diagnosis: &Diagnosis) -> Markup {
    html! {
        p { (count(diagnosis.samples, "sample", "samples")) " in " (diagnosis.recordings.join(", ")) "." }
        ul { @for line in figures(diagnosis) { li { (line) } } }
        @if diagnosis.findings.is_empty() && diagnosis.unexplained.is_none() { p { strong { (CALM) } } }
    }
}

fn table_of(findings: &[Finding]) -> Markup {
    html! {
        table {
            tr {
                th { "" } th { "effect" } th { "at" } th { "size" } th { "probability" } th { "share" }
                th { "held-out error" } th { "may be instead" } th { "next test" }
            }
            @for (i, finding) in findings.iter().enumerate() {
                tr {
                    td { (i + 1) }
                    td { (finding.name()) }
                    td { (finding.at) }
                    td { @for size in sizes(finding) { (size) br; } }
                    td { (probability(finding.probability)) }
                    td.n { (format!("{:.0} %", 100.0 * finding.share)) }
                    td {
                        @for (pair, angle) in [(finding.held_out_rms.m, false), (finding.held_out_rms.rad, true)] {
                            @if let Some(pair) = pair {
                                (amount(pair.before, angle)) " → " (amount(pair.after, angle)) br;
                            }
                        }
                    }
                    td {
                        @if finding.confusable_with.is_empty() { "–" }
                        @for other in &finding.confusable_with {
                            (other.effect) " at " (other.at) " (" (probability(other.probability)) ")" br;
                        }
                    }
                    td {
                        @if finding.confusable_with.is_empty() { "–" }
                        @for (test, _) in tests(finding) { (test) br; }
                    }
                }
            }
        }
    }
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

/// Factor from SI and symbol, for the axis of a picture.
fn unit(angle: bool, size: f64) -> (f64, &'static str) {
    match (angle, size) {
        (false, s) if s < 1e-3 => (1e6, "um"),
        (false, _) => (1e3, "mm"),
        (true, s) if s < 2e-3 => (3600f64.to_degrees(), "arcsec"),
        (true, _) => (1f64.to_degrees(), "deg"),
    }
}

fn largest(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.map(f64::abs).fold(0.0, f64::max)
}

fn figure(plot: &Plot, caption: &str) -> Markup {
    html! {
        @if let Some(picture) = plot.draw() { figure { (picture) figcaption { (caption) } } }
    }
}

/// Residual against what a finding depends on, by direction, and what the finding takes away of it.
fn against(curve: &Curve, finding: Option<&Finding>, most: usize) -> Markup {
    let points: Vec<CurvePoint> = curve.runs.iter().flatten().copied().collect();
    let (factor, symbol) = unit(curve.angle, largest(points.iter().map(|p| p.residual)));
    let (x_factor, x_label, who) = match &curve.along {
        Along::Joint { name, angle: true } => {
            (1f64.to_degrees(), format!("position of {name}, deg"), &name[..])
        }
        Along::Joint { name, angle: false } => (1e3, format!("position of {name}, mm"), &name[..]),
        Along::Time => (1.0, "time, s".to_string(), ""),
        Along::Sample => (1.0, "sample".to_string(), ""),
    };
    let mut layers = Vec::new();
    for (direction, colour, name) in [
        (1, FORWARD, format!("{who} forward")),
        (-1, BACKWARD, format!("{who} backward")),
        (0, NEITHER, "residual".to_string()),
    ] {
        let own: Vec<(f64, f64)> = (points.iter().filter(|p| p.direction == direction))
            .map(|p| (p.x * x_factor, p.residual * factor))
            .collect();
        if !own.is_empty() {
            let part = (most * own.len()).div_ceil(points.len());
            layers.push(Layer { colour, name, marks: Marks::Dots(thinned(&own, part)) });
        }
    }
    if finding.is_some() {
        let line = |run: &Vec<CurvePoint>| -> Vec<(f64, f64)> {
            let line: Vec<(f64, f64)> = run.iter().map(|p| (p.x * x_factor, p.effect * factor)).collect();
            envelope(&line, (most * run.len()).div_ceil(points.len()).max(2))
        };
        let marks = match is_scattered(curve) {
            true => Marks::Dots(points.iter().map(|p| (p.x * x_factor, p.effect * factor)).collect()),
            false => Marks::Lines(curve.runs.iter().filter(|run| run.len() > 1).map(line).collect()),
        };
        layers.push(Layer { colour: CURVE, name: "what this finding explains".into(), marks });
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
    };
    figure(&plot, caption)
}

/// Residuals of a recording, before and after.
fn along(trace: &Trace, found: bool, most: usize) -> Markup {
    let (before, after) = trace.lines();
    let (factor, symbol) = unit(trace.angle, largest(before.iter().copied()));
    let times: Vec<f64> = match &trace.time {
        Some(time) => time.clone(),
        None => (0..before.len()).map(|k| k as f64).collect(),
    };
    let marks = |values: &[f64]| {
        let line: Vec<(f64, f64)> = times.iter().zip(values).map(|(t, v)| (*t, v * factor)).collect();
        if line.len() <= FEW {
            return Marks::Dots(line);
        }
        let pieces = pieces(&line);
        let part = |piece: &[(f64, f64)]| (most / 2 * piece.len()).div_ceil(line.len()).max(2);
        Marks::Lines(pieces.into_iter().map(|piece| envelope(piece, part(piece))).collect())
    };
    let mut layers =
        vec![Layer { colour: BEFORE, name: "geometry calibrated".into(), marks: marks(&before) }];
    if found {
        layers.push(Layer { colour: AFTER, name: "and what was found".into(), marks: marks(&after) });
    }
    let signed = trace.geometric.len() == 1;
    let plot = Plot {
        title: format!("residuals of {}", trace.recording),
        x_label: if trace.time.is_some() { "time, s".into() } else { "sample".into() },
        y_label: format!("{}residual, {symbol}", if signed { "" } else { "size of " }),
        layers,
    };
    figure(&plot, &trace.recording)
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

/// A line cut at its gaps.
fn pieces(line: &[(f64, f64)]) -> Vec<&[(f64, f64)]> {
    let mut steps: Vec<f64> = line.windows(2).map(|w| w[1].0 - w[0].0).collect();
    steps.sort_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    line.chunk_by(|a, b| b.0 - a.0 <= GAP * usual).collect()
}

/// How the residuals that are left are distributed, against the noise.
fn left(diagnosis: &Diagnosis, angle: bool) -> Markup {
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
            Layer { colour: "#56b4e9", name: "what is left".into(), marks: Marks::Bars(bars) },
            Layer { colour: CURVE, name: "noise alone".into(), marks: Marks::Lines(vec![normal]) },
        ],
    };
    figure(
        &plot,
        "What is left with everything taken in; readings more than five times the noise off stand in the outermost bars.",
    )
}

/// Location errors that were identified.
fn geometry(found: &LocationErrors) -> Markup {
    let identified: Vec<_> = found.errors.iter().filter(|error| error.identified).collect();
    html! {
        h2 { "Geometry" }
        @if let Some(reason) = &found.reason {
            p { "No ISO 230-1 location errors: " (reason) "." }
        } @else {
            p.note {
                "ISO 230-1 location errors that these recordings identify: " (identified.len()) " of " (found.errors.len())
                " (primary axis " (found.primary.as_deref().unwrap_or("-")) ", secondary " (found.secondary.as_deref().unwrap_or("-")) ")."
            }
            @if !identified.is_empty() {
                table {
                    tr { th { "name" } th { "axis" } th { "value" } th { "share of the data" } }
                    @for error in identified {
                        @let kind = if error.unit == "m" { Kind::Length } else { Kind::Angle };
                        @let (value, spread, unit) = kind.show_with_error(error.value, error.std_error);
                        tr {
                            td { (error.name) }
                            td { (error.axis) }
                            td.n { (value) " ± " (spread) " " (unit) }
                            td.n { (format!("{:.0} %", 100.0 * error.share)) }
                        }
                    }
                }
            }
        }
    }
}

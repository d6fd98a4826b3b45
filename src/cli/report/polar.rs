//! Circular tests as polar pictures, magnified, with their figures after ISO 230-4.

use std::f64::consts::TAU;

use maud::{Markup, html};

use super::plot::{Ink, dotted, joined, legend, thinned};
use super::table::{Cell, largest, number, number_or_none, residual_unit, table, word};
use super::track::Track;
use crate::circular::{CircularTest, OneSense, SeenFrom, Turned};

/// Half the size of a picture, the radius of the nominal circle in it, and how far the largest deviation goes from it.
const HALF: f64 = 200.0;
const RADIUS: f64 = 120.0;
const REACH: f64 = 62.0;
/// Points of all pictures together, and of one at most.
const ALL_POINTS: usize = 8_000;
const MOST_POINTS: usize = 800;
/// Tests that have pictures; the table has them all.
const MOST_TESTS: usize = 8;

/// The section; nothing where there is no such test. `last`: the name of the model that is left with.
pub(super) fn circular(tests: &[CircularTest], tracks: &[Track], last: &str) -> Markup {
    let most = (ALL_POINTS / (2 * tests.len().min(MOST_TESTS)).max(1)).clamp(100, MOST_POINTS);
    html! {
        @if !tests.is_empty() {
            h2 { "Circular tests" }
            p.note {
                "Radial deviation along the circle or cone of the bar, magnified; outwards is longer. What was measured is drawn about its \
                 least-squares circle, so that its shape shows: radius and centre of that are in the table."
            }
            @for test in tests.iter().take(MOST_TESTS) {
                div.pair {
                    (picture(test, &shape(test), "as measured", most))
                    @if let Some(left) = left(test, tracks) { (picture(test, &left, &format!("left over: {last}"), most)) }
                }
            }
            @if tests.len() > MOST_TESTS { p.note { "The first " (MOST_TESTS) " of " (tests.len()) " are drawn." } }
            (figures(tests))
            p.note {
                "G: circular deviation, between two circles about the least-squares centre. F: largest and smallest radial deviation from the \
                 nominal circle as the instrument is centred. G(b), H, D: of both senses together, circular deviation, hysteresis and mean \
                 radial deviation. On a cone they are formed along the bar in the same way."
            }
        }
    }
}

/// The path about its least-squares circle.
fn shape(test: &CircularTest) -> Vec<Turned> {
    let [x, y] = test.centre_m;
    let about = |t: &Turned| t.deviation - test.radius_m - x * t.angle.cos() - y * t.angle.sin();
    test.path.iter().map(|t| Turned { deviation: about(t), ..*t }).collect()
}

/// The path with what the last model leaves.
fn left(test: &CircularTest, tracks: &[Track]) -> Option<Vec<Turned>> {
    let track = tracks.iter().find(|track| track.recording == test.recording)?;
    let residual = track.residuals.last().filter(|residual| residual.len() == test.path.len())?;
    Some(test.path.iter().zip(residual).map(|(turned, r)| Turned { deviation: *r, ..*turned }).collect())
}

fn picture(test: &CircularTest, path: &[Turned], state: &str, most: usize) -> Markup {
    let size = largest(path.iter().map(|t| t.deviation)).max(1e-12);
    let unit = residual_unit(false, size);
    let division = round_step(size * unit.per_si / 2.0);
    let scale = REACH / size;
    let magnified = scale * test.length_m / RADIUS;
    let place = |angle: f64, radius: f64| (HALF + radius * angle.cos(), HALF - radius * angle.sin());
    let ring = |radius: f64| html! { circle.grid cx=(HALF) cy=(HALF) r=(format!("{radius:.1}")) {} };
    let step = division / unit.per_si * scale;
    let mut traces = Vec::new();
    let usual = usual_step(path);
    for (sense, ink) in [(1, Ink::Forward), (-1, Ink::Backward)] {
        let of = |run: &[Turned]| -> Vec<(f64, f64)> {
            let kept = thinned(run, (most * run.len()).div_ceil(path.len().max(1)).max(2));
            kept.iter().map(|t| place(t.angle, RADIUS + scale * t.deviation)).collect()
        };
        let runs = path.chunk_by(|a, b| a.sense == b.sense && (b.angle - a.angle).abs() <= 20.0 * usual);
        let runs: Vec<Vec<(f64, f64)>> =
            runs.filter(|run| run.first().is_some_and(|t| t.sense == sense)).map(of).collect();
        // Where neighbours are far apart no line joins them.
        let (class, d) = match usual < TAU / 40.0 {
            true => ("line", runs.iter().map(|run| joined(run)).collect::<String>()),
            false => ("dots", runs.iter().map(|run| dotted(run)).collect::<String>()),
        };
        if !d.is_empty() {
            traces.push((ink, html! { path class=(format!("{class} {}", ink.class())) d=(d) {} }));
        }
    }
    let names = |ink: Ink| if ink == Ink::Forward { "counter-clockwise" } else { "clockwise" };
    let entries: Vec<(Ink, &str)> = traces.iter().map(|(ink, _)| (*ink, names(*ink))).collect();
    let shape = if test.is_circle() { "circle" } else { "cone" };
    let told = format!(
        "{} um to {} um",
        three(1e6 * path.iter().map(|t| t.deviation).fold(f64::INFINITY, f64::min)),
        three(1e6 * path.iter().map(|t| t.deviation).fold(f64::NEG_INFINITY, f64::max))
    );
    let scale_text = format!("1 division = {division} {}, magnified {} times", unit.symbol, three(magnified));
    html! {
        figure {
            figcaption { strong { (test.recording) ", " (state) } br; (scale_text) (legend(&entries)) }
            svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {0} {0}", 2.0 * HALF)) role="img" {
                title { "Polar trace of " (test.recording) ", " (state) }
                desc { "Radial deviation along a " (shape) " of " (three(1e3 * test.length_m)) " mm: " (told) ". " (scale_text) "." }
                line.grid x1=(HALF) x2=(HALF) y1="8" y2=(2.0 * HALF - 8.0) {}
                line.grid x1="8" x2=(2.0 * HALF - 8.0) y1=(HALF) y2=(HALF) {}
                @for k in [-2.0, -1.0, 1.0, 2.0] { (ring(RADIUS + k * step)) }
                circle.frame cx=(HALF) cy=(HALF) r=(RADIUS) {}
                @for (_, trace) in &traces { (trace) }
                text.t x=(2.0 * HALF - 6.0) y=(HALF - 6.0) text-anchor="end" { "0°" }
                text.t x=(HALF + 6.0) y="18" { "90°" }
                text x=(HALF) y=(HALF + 5.0) text-anchor="middle" { (division) " " (unit.symbol) " / div" }
            }
        }
    }
}

/// The step from one sample to the next, rad.
fn usual_step(path: &[Turned]) -> f64 {
    let mut steps: Vec<f64> = path.windows(2).map(|pair| (pair[1].angle - pair[0].angle).abs()).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

/// 1, 2 or 5 times a power of ten, at most this.
fn round_step(most: f64) -> f64 {
    let power = 10f64.powf(most.max(1e-9).log10().floor());
    let step = [5.0, 2.0, 1.0].into_iter().map(|m| m * power).find(|step| *step <= most).unwrap_or(power);
    // Without the dust of powers of ten.
    format!("{step:.9}").parse().unwrap_or(step)
}

fn three(value: f64) -> String {
    format!("{value:.*}", crate::cli::output::decimals(value, 3))
}

/// Figures of all tests: of each sense, then of both together.
fn figures(tests: &[CircularTest]) -> Markup {
    let senses =
        |test: &CircularTest| [("counter-clockwise", test.counter_clockwise), ("clockwise", test.clockwise)];
    let own = tests.iter().flat_map(|test| senses(test).into_iter().filter_map(|(_, sense)| sense));
    let unit = residual_unit(false, largest(own.flat_map(|s| [Some(s.g_m), s.f_max_m, s.f_min_m]).flatten()));
    let of_sense = |test: &CircularTest| -> Vec<Vec<Cell>> {
        let row = |(name, sense): (&str, Option<OneSense>)| {
            let sense = sense?;
            let mut row =
                vec![word(&test.recording), word(path_of(test)), word(name), number(sense.g_m, unit)];
            row.extend([sense.f_max_m, sense.f_min_m].map(|x| number_or_none(x, unit)));
            Some(row)
        };
        senses(test).into_iter().filter_map(row).collect()
    };
    let heads = ["G", "F max", "F min"].map(|name| format!("{name}, {}", unit.symbol));
    let heads = ["recording", "path", "sense", &heads[0], &heads[1], &heads[2]];
    let both = |test: &CircularTest| [test.g_both_m, test.h_m, test.d_m];
    let all = tests.iter().flat_map(|test| both(test).into_iter().flatten().chain(test.centre_m));
    let shared = residual_unit(false, largest(all));
    let row = |test: &CircularTest| -> Vec<Cell> {
        let mut row = vec![word(&test.recording)];
        row.extend(both(test).map(|x| number_or_none(x, shared)));
        row.extend(test.centre_m.map(|x| number(x, shared)));
        row
    };
    let names =
        ["G(b)", "H", "D", "centre 0°", "centre 90°"].map(|name| format!("{name}, {}", shared.symbol));
    let names: Vec<&str> = ["recording"].into_iter().chain(names.iter().map(String::as_str)).collect();
    html! {
        (table(&heads, tests.iter().flat_map(of_sense).collect()))
        (table(&names, tests.iter().map(row).collect()))
    }
}

/// `cone of 90 deg seen from w`
fn path_of(test: &CircularTest) -> String {
    let shape = match test.is_circle() {
        true => "circle".to_string(),
        false => format!("cone of {:.0} deg", 2.0 * test.half_apex_rad.to_degrees()),
    };
    let from = match test.seen_from {
        SeenFrom::Workpiece => "w",
        SeenFrom::Base => "the base",
        SeenFrom::Tool => "t",
    };
    format!("{shape} seen from {from}")
}

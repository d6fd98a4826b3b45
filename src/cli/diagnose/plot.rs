//! Small pictures as SVG: a frame with ticks, dots, lines. Colours are those of Okabe and Ito, which colour-blind people tell apart.

use std::fmt::Write;

use maud::{Markup, html};

/// Colours: before, after, forward, backward, neither, the fitted curve.
pub(super) const BEFORE: &str = "#e69f00";
pub(super) const AFTER: &str = "#0072b2";
pub(super) const FORWARD: &str = "#0072b2";
pub(super) const BACKWARD: &str = "#d55e00";
pub(super) const NEITHER: &str = "#666666";
pub(super) const CURVE: &str = "#000000";

/// Outer size and the margins around the frame, in the picture's own units.
const SIZE: (f64, f64) = (760.0, 260.0);
const LEFT: f64 = 64.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 42.0;

/// What is drawn in one colour.
pub(super) struct Layer {
    pub colour: &'static str,
    /// As the legend says; layers of the same name share an entry.
    pub name: String,
    pub marks: Marks,
}

pub(super) enum Marks {
    Dots(Vec<(f64, f64)>),
    /// Broken between the lists.
    Lines(Vec<Vec<(f64, f64)>>),
    /// From 0 up: left, right, height.
    Bars(Vec<(f64, f64, f64)>),
}

impl Marks {
    fn points(&self) -> Box<dyn Iterator<Item = (f64, f64)> + '_> {
        match self {
            Marks::Dots(dots) => Box::new(dots.iter().copied()),
            Marks::Lines(lines) => Box::new(lines.iter().flatten().copied()),
            Marks::Bars(bars) => Box::new(bars.iter().flat_map(|(a, b, h)| [(*a, 0.0), (*b, *h)])),
        }
    }
}

/// A picture with its labels; numbers in the units that the labels say.
pub(super) struct Plot {
    /// What it shows, for those who cannot see it.
    pub title: String,
    pub x_label: String,
    pub y_label: String,
    pub layers: Vec<Layer>,
}

/// Least and greatest of finite numbers, a little apart.
fn range(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    let (from, to) = numbers
        .filter(|x| x.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    if from > to {
        return (-1.0, 1.0);
    }
    let room = if to > from { 0.03 * (to - from) } else { from.abs().max(1.0) * 0.1 };
    (from - room, to + room)
}

/// Round numbers within a range, five or so, and how many decimals they need.
fn ticks((from, to): (f64, f64)) -> (Vec<f64>, usize) {
    let rough = (to - from) / 5.0;
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= rough).unwrap_or(rough);
    let decimals = (-(step.log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize;
    let first = (from / step).ceil() as i64;
    let last = (to / step).floor() as i64;
    ((first..=last).map(|k| k as f64 * step).collect(), decimals)
}

impl Plot {
    /// The picture; `None` where there is nothing to be drawn.
    pub fn draw(&self) -> Option<Markup> {
        let all = || self.layers.iter().flat_map(|layer| layer.marks.points());
        all().next()?;
        let x_range = range(all().map(|p| p.0));
        let y_range = range(all().map(|p| p.1));
        let (right, bottom) = (SIZE.0 - RIGHT, SIZE.1 - BOTTOM);
        let x = |value: f64| LEFT + (value - x_range.0) / (x_range.1 - x_range.0) * (right - LEFT);
        let y = |value: f64| bottom - (value - y_range.0) / (y_range.1 - y_range.0) * (bottom - TOP);
        let (x_ticks, x_decimals) = ticks(x_range);
        let (y_ticks, y_decimals) = ticks(y_range);
        let mut legend: Vec<(&str, &str, bool)> = Vec::new();
        for layer in &self.layers {
            if !legend.iter().any(|(name, ..)| *name == layer.name) {
                legend.push((&layer.name, layer.colour, matches!(layer.marks, Marks::Lines(_))));
            }
        }
        // Letters of 12 units are some 6.6 wide.
        let mut from = LEFT;
        let legend: Vec<(f64, &str, &str, bool)> = legend
            .into_iter()
            .map(|(name, colour, line)| {
                let at = from;
                from += 34.0 + 6.6 * name.chars().count() as f64;
                (at, name, colour, line)
            })
            .collect();
        let number = |value: f64, decimals: usize| {
            let text = format!("{value:.decimals$}");
            if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') { "0".into() } else { text }
        };
        Some(html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {} {}", SIZE.0, SIZE.1)) role="img"
                aria-label=(self.title) font-family="sans-serif" font-size="12" fill="#222" {
                title { (self.title) }
                @for tick in &x_ticks {
                    line x1=(at(x(*tick))) x2=(at(x(*tick))) y1=(TOP) y2=(bottom) stroke="#e4e4e4" {}
                    text x=(at(x(*tick))) y=(bottom + 16.0) text-anchor="middle" { (number(*tick, x_decimals)) }
                }
                @for tick in &y_ticks {
                    line x1=(LEFT) x2=(right) y1=(at(y(*tick))) y2=(at(y(*tick)))
                        stroke=(if *tick == 0.0 { "#999" } else { "#e4e4e4" }) {}
                    text x=(LEFT - 6.0) y=(at(y(*tick) + 4.0)) text-anchor="end" { (number(*tick, y_decimals)) }
                }
                @for layer in &self.layers { (draw_marks(layer, &x, &y)) }
                rect x=(LEFT) y=(TOP) width=(right - LEFT) height=(bottom - TOP) fill="none" stroke="#999" {}
                text x=(at(0.5 * (LEFT + right))) y=(SIZE.1 - 8.0) text-anchor="middle" { (self.x_label) }
                text transform=(format!("translate(14 {}) rotate(-90)", at(0.5 * (TOP + bottom))))
                    text-anchor="middle" { (self.y_label) }
                @for (from, name, colour, line) in legend {
                    @if line {
                        line x1=(at(from)) x2=(at(from + 16.0)) y1="15" y2="15" stroke=(colour) stroke-width="2" {}
                    } @else {
                        rect x=(at(from + 3.0)) y="10" width="10" height="10" fill=(colour) {}
                    }
                    text x=(at(from + 21.0)) y="19" { (name) }
                }
            }
        })
    }
}

/// One decimal is a tenth of a dot on the screen.
fn at(value: f64) -> String {
    format!("{value:.1}")
}

fn draw_marks(layer: &Layer, x: &dyn Fn(f64) -> f64, y: &dyn Fn(f64) -> f64) -> Markup {
    let mut path = String::new();
    let seen = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
    match &layer.marks {
        Marks::Dots(dots) => {
            // One path of strokes without length, with round ends, is a tenth the size of as many circles.
            for (a, b) in dots.iter().filter(seen) {
                let _ = write!(path, "M{:.1} {:.1}h0", x(*a), y(*b));
            }
            html! { path d=(path) stroke=(layer.colour) stroke-width="2.4" stroke-linecap="round" fill="none" {} }
        }
        Marks::Lines(lines) => {
            for line in lines {
                for (k, (a, b)) in line.iter().filter(seen).enumerate() {
                    let _ = write!(path, "{}{:.1} {:.1}", if k == 0 { 'M' } else { 'L' }, x(*a), y(*b));
                }
            }
            html! { path d=(path) stroke=(layer.colour) stroke-width="1.4" stroke-linejoin="round" fill="none" {} }
        }
        Marks::Bars(bars) => html! {
            @for (a, b, height) in bars {
                rect x=(at(x(*a))) y=(at(y(*height))) width=(at((x(*b) - x(*a) - 0.6).max(0.4)))
                    height=(at((y(0.0) - y(*height)).max(0.0))) fill=(layer.colour) {}
            }
        },
    }
}

/// Every so many, so that no more than `most` are left.
pub(super) fn thinned<T: Copy>(all: &[T], most: usize) -> Vec<T> {
    let stride = all.len().div_ceil(most.max(1)).max(1);
    all.iter().copied().step_by(stride).collect()
}

/// A line along which nothing that stands out is lost: of each stretch the least and the greatest.
pub(super) fn envelope(all: &[(f64, f64)], most: usize) -> Vec<(f64, f64)> {
    if all.len() <= most {
        return all.to_vec();
    }
    let stretch = (2 * all.len()).div_ceil(most.max(2));
    let mut kept = Vec::new();
    for stretch in all.chunks(stretch) {
        let ends = || stretch.iter().enumerate();
        let by = |a: &(usize, &(f64, f64)), b: &(usize, &(f64, f64))| a.1.1.total_cmp(&b.1.1);
        if let (Some(least), Some(most)) = (ends().min_by(by), ends().max_by(by)) {
            let (first, last) = if least.0 <= most.0 { (least, most) } else { (most, least) };
            kept.extend([*first.1, *last.1]);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within() {
        for (range, step) in [((-1.0, 1.0), 0.5), ((0.0, 61.2), 20.0), ((-2.1e-3, 4e-3), 2e-3)] {
            let (ticks, decimals) = ticks(range);
            assert!(ticks.len() >= 2 && ticks.iter().all(|t| range.0 <= *t && *t <= range.1), "{ticks:?}");
            assert!((ticks[1] - ticks[0] - step).abs() < 1e-12, "{ticks:?}");
            let shown: Vec<String> = ticks.iter().map(|t| format!("{t:.decimals$}")).collect();
            assert!(shown.windows(2).all(|w| w[0] != w[1]), "{shown:?}");
        }
    }

    #[test]
    fn an_envelope_keeps_a_lone_spike() {
        let mut line: Vec<(f64, f64)> = (0..10_000).map(|k| (f64::from(k), 0.0)).collect();
        line[7321].1 = 5.0;
        let thin = envelope(&line, 1000);
        assert!(thin.len() <= 1000 && thin.contains(&(7321.0, 5.0)));
        assert!(thin.windows(2).all(|w| w[0].0 <= w[1].0));
    }
}

//! Pictures along two axes as SVG: a frame with ticks, dots, lines, bars. Colours are classes of [`super::style`], so that they follow
//! light and dark; the legend stands below as text, where a phone can fold it.

use std::fmt::Write;

use maud::{Markup, html};

/// Outer size and the margins around the frame, in the picture's own units. Letters are up to 20 units high on a phone.
const SIZE: (f64, f64) = (520.0, 260.0);
const LEFT: f64 = 70.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 50.0;

/// What something is drawn as: the class of its colour.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Ink {
    Before,
    After,
    Named,
    Forward,
    Backward,
    Neither,
    Curve,
    Band,
}

impl Ink {
    pub fn class(self) -> &'static str {
        match self {
            Ink::Before => "m-before",
            Ink::After => "m-after",
            Ink::Named => "m-named",
            Ink::Forward => "m-fwd",
            Ink::Backward => "m-back",
            Ink::Neither => "m-none",
            Ink::Curve => "m-curve",
            Ink::Band => "m-band",
        }
    }
}

/// What is drawn in one colour.
pub(super) struct Layer {
    pub ink: Ink,
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
#[derive(Default)]
pub(super) struct Plot {
    /// What it shows, in a few words.
    pub title: String,
    pub x_label: String,
    pub y_label: String,
    pub layers: Vec<Layer>,
    /// Stretches of x that are set off, and what they are.
    pub bands: Vec<(f64, f64)>,
    pub band_name: String,
}

/// Least and greatest of finite numbers, a little apart.
fn range(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    let (from, to) = ends(numbers);
    if from > to {
        return (-1.0, 1.0);
    }
    let room = if to > from { 0.03 * (to - from) } else { from.abs().max(1.0) * 0.1 };
    (from - room, to + room)
}

fn ends(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    numbers
        .filter(|x| x.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
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

/// A number with so many decimals; zero is no more than `0`.
fn numeral(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') { "0".into() } else { text }
}

/// For those who cannot see it: labels, and from where to where each layer goes.
fn description(plot: &Plot) -> String {
    let mut text = format!("{} across, {} up.", plot.x_label, plot.y_label);
    for layer in &plot.layers {
        let (x, y) = (ends(layer.marks.points().map(|p| p.0)), ends(layer.marks.points().map(|p| p.1)));
        let short = |value: f64| {
            let digits = (2 - value.abs().max(1e-9).log10().floor() as i32).clamp(0, 6) as usize;
            numeral(value, digits)
        };
        let _ = write!(
            text,
            " {}: from {} to {}, for x from {} to {}.",
            layer.name,
            short(y.0),
            short(y.1),
            short(x.0),
            short(x.1)
        );
    }
    for (from, to) in &plot.bands {
        let _ = write!(text, " {}: x from {from:.3} to {to:.3}.", plot.band_name);
    }
    text
}

/// Swatches with their names.
pub(super) fn legend(entries: &[(Ink, &str)]) -> Markup {
    html! {
        div.legend {
            @for (k, (ink, name)) in entries.iter().enumerate() {
                @if !entries[..k].iter().any(|(_, known)| known == name) {
                    span { i class=(ink.class()) {} (name) }
                }
            }
        }
    }
}

impl Plot {
    /// The picture with its title, legend and caption; `None` where there is nothing to be drawn.
    pub fn figure(&self, caption: &str) -> Option<Markup> {
        let picture = self.draw()?;
        let mut entries: Vec<(Ink, &str)> =
            self.layers.iter().map(|layer| (layer.ink, layer.name.as_str())).collect();
        if !self.bands.is_empty() {
            entries.push((Ink::Band, &self.band_name));
        }
        Some(html! {
            figure {
                figcaption { strong { (self.title) } @if !caption.is_empty() { br; (caption) } (legend(&entries)) }
                (picture)
            }
        })
    }

    fn draw(&self) -> Option<Markup> {
        let all = || self.layers.iter().flat_map(|layer| layer.marks.points());
        all().next()?;
        let x_range = range(all().map(|p| p.0));
        let y_range = range(all().map(|p| p.1));
        let (right, bottom) = (SIZE.0 - RIGHT, SIZE.1 - BOTTOM);
        let x = |value: f64| LEFT + (value - x_range.0) / (x_range.1 - x_range.0) * (right - LEFT);
        let y = |value: f64| bottom - (value - y_range.0) / (y_range.1 - y_range.0) * (bottom - TOP);
        let (x_ticks, x_decimals) = ticks(x_range);
        let (y_ticks, y_decimals) = ticks(y_range);
        let band = |(from, to): &(f64, f64)| (x(*from).clamp(LEFT, right), x(*to).clamp(LEFT, right));
        Some(html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {} {}", SIZE.0, SIZE.1)) role="img" {
                title { (self.title) }
                desc { (description(self)) }
                @for (from, to) in self.bands.iter().map(band) {
                    rect.band x=(at(from)) y=(TOP) width=(at((to - from).max(1.0))) height=(at(bottom - TOP)) {}
                }
                @for tick in &x_ticks {
                    line.grid x1=(at(x(*tick))) x2=(at(x(*tick))) y1=(TOP) y2=(bottom) {}
                    text x=(at(x(*tick))) y=(bottom + 18.0) text-anchor="middle" { (numeral(*tick, x_decimals)) }
                }
                @for tick in &y_ticks {
                    line class=(if *tick == 0.0 { "zero" } else { "grid" })
                        x1=(LEFT) x2=(right) y1=(at(y(*tick))) y2=(at(y(*tick))) {}
                    text x=(LEFT - 6.0) y=(at(y(*tick) + 5.0)) text-anchor="end" { (numeral(*tick, y_decimals)) }
                }
                @for layer in &self.layers { (draw_marks(layer, &x, &y)) }
                rect.frame x=(LEFT) y=(TOP) width=(right - LEFT) height=(bottom - TOP) {}
                text.t x=(at(right)) y=(SIZE.1 - 7.0) text-anchor="end" { (self.x_label) }
                text.t x="4" y="20" { (self.y_label) }
            }
        })
    }
}

/// One decimal is a tenth of a dot on the screen.
pub(super) fn at(value: f64) -> String {
    format!("{value:.1}")
}

fn draw_marks(layer: &Layer, x: &dyn Fn(f64) -> f64, y: &dyn Fn(f64) -> f64) -> Markup {
    let seen = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
    match &layer.marks {
        Marks::Dots(dots) => {
            let dots: Vec<(f64, f64)> = dots.iter().filter(seen).map(|(a, b)| (x(*a), y(*b))).collect();
            html! { path class=(format!("dots {}", layer.ink.class())) d=(dotted(&dots)) {} }
        }
        Marks::Lines(lines) => {
            let path: String = (lines.iter())
                .map(|line| {
                    joined(&line.iter().filter(seen).map(|(a, b)| (x(*a), y(*b))).collect::<Vec<_>>())
                })
                .collect();
            html! { path class=(format!("line {}", layer.ink.class())) d=(path) {} }
        }
        Marks::Bars(bars) => html! {
            @for (a, b, height) in bars {
                rect class=(format!("bar {}", layer.ink.class())) x=(at(x(*a))) y=(at(y(*height)))
                    width=(at((x(*b) - x(*a) - 0.6).max(0.4))) height=(at((y(0.0) - y(*height)).max(0.0))) {}
            }
        },
    }
}

/// Dots as one path: strokes without length, with round ends, are a tenth the size of as many circles.
pub(super) fn dotted(dots: &[(f64, f64)]) -> String {
    let mut path = String::new();
    for (a, b) in dots {
        let _ = write!(path, "M{a:.1} {b:.1}h0");
    }
    path
}

/// A line through points.
pub(super) fn joined(points: &[(f64, f64)]) -> String {
    let mut path = String::new();
    for (k, (a, b)) in points.iter().enumerate() {
        let _ = write!(path, "{}{a:.1} {b:.1}", if k == 0 { 'M' } else { 'L' });
    }
    path
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

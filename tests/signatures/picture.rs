//! A trace as a small picture that is readable on light and on dark ground.

use std::fmt::Write as _;

use super::trace::Trace;

/// The colours of the reports, which colour-blind people tell apart. One sense is dashed, so that neither hides the other.
const STYLE: &str = "svg{--i:#1d1d1d;--s:#595959;--b:#fff;--g:#dcdcdc;--f:#0072b2;--k:#c44e00}\
@media(prefers-color-scheme:dark){svg{--i:#e8e8e8;--s:#ababab;--b:#161616;--g:#3a3a3a;--f:#56b4e9;--k:#ff8a4c}}\
text{font:13px system-ui,sans-serif;fill:var(--s)}.g,.o,.f,.k{fill:none;stroke-linejoin:round;vector-effect:non-scaling-stroke}\
.g{stroke:var(--g)}.o{stroke:var(--s)}.f{stroke:var(--f);stroke-width:2.4}.k{stroke:var(--k);stroke-width:2.4;stroke-dasharray:6 5}";

const WIDTH: f64 = 320.0;
const HEIGHT: f64 = 344.0;
const CENTRE: f64 = 160.0;
/// Of the nominal circle, and two divisions from it.
const RADIUS: f64 = 104.0;
const REACH: f64 = 44.0;
/// Coordinates in the picture's unit are whole numbers of this.
const FINE: f64 = 0.25;

/// The picture of a family's trace.
pub fn draw(name: &str, trace: &Trace) -> String {
    let largest = trace.readings.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    let division = division(largest * 1e6);
    // Two divisions hold the largest.
    let scale = REACH / (2.0 * division * 1e-6);
    let polar = trace.is_polar();
    let mut paths = String::new();
    for (positive, points) in trace.passes() {
        let points: Vec<(f64, f64)> =
            points.iter().map(|(at, reading)| place(polar, *at, reading * scale)).collect();
        let class = if positive { 'f' } else { 'k' };
        let _ = writeln!(paths, "<path class=\"{class}\" d=\"{}\"/>", line(&points));
    }
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\">\n\
         <title>{name}</title>\n<desc>{}. {}</desc>\n<style>{STYLE}</style>\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" style=\"fill:var(--b)\"/>\n",
        trace.conditions,
        super::sign::of(trace)
    );
    text.push_str(&if polar { rings() } else { lines() });
    let _ = write!(text, "<g transform=\"scale({FINE})\">\n{paths}</g>\n");
    let (there, back) = if polar { ("positive sense", "negative sense") } else { ("there", "back") };
    let middle = if polar { (CENTRE, CENTRE + 4.0, "middle") } else { (8.0, 16.0, "start") };
    let _ = writeln!(
        text,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"{}\">{} um / div</text>",
        middle.0,
        middle.1,
        middle.2,
        shown(division)
    );
    let y = HEIGHT - 10.0;
    let _ = write!(
        text,
        "<path class=\"f\" d=\"M40 {0}h22\"/><text x=\"68\" y=\"{y}\">{there}</text>\
         <path class=\"k\" d=\"M176 {0}h22\"/><text x=\"204\" y=\"{y}\">{back}</text>\n</svg>\n",
        y - 4.0
    );
    text
}

/// Nominal circle, two divisions to either side, axes.
fn rings() -> String {
    let mut text = String::new();
    for k in [-2.0, -1.0, 0.0, 1.0, 2.0] {
        let class = if k == 0.0 { 'o' } else { 'g' };
        let _ = writeln!(
            text,
            "<circle class=\"{class}\" cx=\"{CENTRE}\" cy=\"{CENTRE}\" r=\"{}\"/>",
            RADIUS + k * REACH / 2.0
        );
    }
    let (low, high) = (8.0, WIDTH - 8.0);
    let _ = writeln!(
        text,
        "<path class=\"g\" d=\"M{low} {CENTRE}H{high}M{CENTRE} {low}V{high}\"/>\
         <text x=\"{high}\" y=\"{}\" text-anchor=\"end\">0°</text><text x=\"{}\" y=\"18\">90°</text>",
        CENTRE - 5.0,
        CENTRE + 5.0
    );
    text
}

/// Zero and two divisions up and down.
fn lines() -> String {
    let mut text = String::new();
    for k in [-2.0, -1.0, 0.0, 1.0, 2.0] {
        let class = if k == 0.0 { 'o' } else { 'g' };
        let y = CENTRE - k * REACH;
        let _ = writeln!(text, "<path class=\"{class}\" d=\"M16 {y}H304\"/>");
    }
    let _ = writeln!(
        text,
        "<text x=\"16\" y=\"{0}\">X -150 mm</text><text x=\"304\" y=\"{0}\" text-anchor=\"end\">150 mm</text>",
        CENTRE + 2.0 * REACH + 18.0
    );
    text
}

/// Where a reading stands, in fine units. `off`: by how much, in the picture's unit.
fn place(polar: bool, at: f64, off: f64) -> (f64, f64) {
    let (x, y) = match polar {
        true => (CENTRE + (RADIUS + off) * at.cos(), CENTRE - (RADIUS + off) * at.sin()),
        false => (CENTRE + at * 144.0 / 150.0, CENTRE - 2.0 * off),
    };
    ((x / FINE).round(), (y / FINE).round())
}

/// A line in whole steps from point to point.
fn line(points: &[(f64, f64)]) -> String {
    let mut path = String::new();
    let mut last: Option<(f64, f64)> = None;
    for (x, y) in points {
        match last {
            None => {
                let _ = write!(path, "M{x} {y}l");
            }
            Some(before) if before == (*x, *y) => continue,
            Some((a, b)) => {
                let (dx, dy) = (x - a, y - b);
                let gap = if dx >= 0.0 && !path.ends_with('l') { " " } else { "" };
                let between = if dy >= 0.0 { " " } else { "" };
                let _ = write!(path, "{gap}{dx}{between}{dy}");
            }
        }
        last = Some((*x, *y));
    }
    path
}

/// 1, 2 or 5 times a power of ten, so that two of them hold this.
fn division(largest: f64) -> f64 {
    let half = largest.max(1e-6) / 2.0;
    let power = 10f64.powf(half.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|step| *step >= half).unwrap_or(half)
}

fn shown(value: f64) -> String {
    // Without the dust of powers of ten.
    format!("{:.6}", value).trim_end_matches('0').trim_end_matches('.').to_string()
}

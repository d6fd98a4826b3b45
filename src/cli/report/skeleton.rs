//! The machine, drawn from its chain: frames, axes, the way to the workpiece and the way to the tool; for arms a stick figure.

use maud::{Markup, html};

use super::plot::{Ink, at, joined, legend};
use super::table::{Cell, table, word, written};
use crate::chain::Chain;
use crate::lie::Vec3;
use crate::machine::{JointKind, Machine};

/// Size of the picture and the room around what is in it.
const SIZE: (f64, f64) = (520.0, 380.0);
const ROOM: f64 = 46.0;
/// Arrows and circles of axes, as a part of the largest extent.
const ARROW: f64 = 0.2;
const CIRCLE: f64 = 0.08;
/// A machine whose frames all lie in one point is drawn this large, m.
const ALONE: f64 = 0.2;
/// Labels keep this far from each other.
const APART: f64 = 19.0;

/// The section: picture and table of frames.
pub(super) fn skeleton(machine: &Machine) -> Markup {
    html! {
        h2 { "The machine" }
        @if let Some(about) = machine.about() { p { (about) } }
        (picture(machine))
        (frames(machine))
    }
}

/// Seen from the front right and above: X to the right, Y away, Z up.
fn seen(p: Vec3<f64>) -> (f64, f64) {
    let [x, y, z] = p.0;
    (0.9 * x + 0.42 * y, -(z + 0.26 * y - 0.2 * x))
}

/// What is drawn of a joint.
struct Axis {
    name: String,
    kind: JointKind,
    line: [(f64, f64); 2],
    circle: Vec<(f64, f64)>,
}

fn picture(machine: &Machine) -> Markup {
    let home = vec![0.0; machine.commands().len().max(1)];
    let sweep = Chain::nominal(machine).sweep(&home);
    let origin = |j: usize| sweep.b_from_frame(j).translation;
    let count = machine.dyads().len();
    let split = machine.w_index() + 1;
    let base = Vec3([0.0; 3]);
    let branch = |from: usize, to: usize| -> Vec<Vec3<f64>> {
        std::iter::once(base).chain((from..to).map(origin)).collect()
    };
    let branches = [branch(0, split), branch(split, count)];
    let points = || branches.iter().flatten();
    let extent = (0..3)
        .map(|k| {
            let (from, to) = points().fold((0.0f64, 0.0f64), |(a, b), p| (a.min(p.0[k]), b.max(p.0[k])));
            to - from
        })
        .fold(0.0, f64::max);
    let extent = if extent > 0.0 { extent } else { ALONE };
    let axes: Vec<Axis> = machine
        .joints()
        .map(|(j, joint)| {
            let frame = sweep.b_from_frame(j);
            let along = frame.rotation * joint.axis;
            let tip = |by: f64| seen(frame.translation + along.times(by * extent));
            let [u, v] = along.across();
            let turn = |k: u32| {
                let angle = f64::from(k) * std::f64::consts::TAU / 24.0;
                let radius = CIRCLE * extent;
                seen(frame.translation + u.times(radius * angle.cos()) + v.times(radius * angle.sin()))
            };
            Axis {
                name: joint.name.clone(),
                kind: joint.kind,
                line: [tip(-ARROW), tip(ARROW)],
                circle: if joint.kind == JointKind::Revolute {
                    (0..=24).map(turn).collect()
                } else {
                    Vec::new()
                },
            }
        })
        .collect();
    // Everything into the frame.
    let corners: Vec<(f64, f64)> =
        points().map(|p| seen(*p)).chain(axes.iter().flat_map(|axis| axis.line)).collect();
    let ends = |of: fn(&(f64, f64)) -> f64| {
        corners.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
    };
    let (x, y) = (ends(|p| p.0), ends(|p| p.1));
    let scale =
        ((SIZE.0 - 2.0 * ROOM) / (x.1 - x.0).max(1e-9)).min((SIZE.1 - 2.0 * ROOM) / (y.1 - y.0).max(1e-9));
    let height = ((y.1 - y.0) * scale + 2.0 * ROOM).min(SIZE.1);
    let place = |p: (f64, f64)| {
        (0.5 * SIZE.0 + (p.0 - 0.5 * (x.0 + x.1)) * scale, 0.5 * height + (p.1 - 0.5 * (y.0 + y.1)) * scale)
    };
    let mut labels: Vec<(f64, f64, String)> = Vec::new();
    let mut label = |(x, y): (f64, f64), text: &str| {
        let (x, mut y) = (x + 6.0, y - 4.0);
        while labels.iter().any(|(a, b, _)| (a - x).abs() < 1.8 * APART && (b - y).abs() < APART) {
            y += APART;
        }
        labels.push((x, y, text.to_string()));
    };
    axes.iter().for_each(|axis| label(place(axis.line[1]), &axis.name));
    for (branch, name) in branches.iter().zip(["w", "t"]) {
        if let Some(end) = branch.last() {
            label(place(seen(*end)), name);
        }
    }
    label(place(seen(base)), "base");
    let way = |branch: &[Vec3<f64>]| joined(&branch.iter().map(|p| place(seen(*p))).collect::<Vec<_>>());
    let dots: Vec<(f64, f64)> = points().map(|p| place(seen(*p))).collect();
    let inks = [(Ink::Before, "base to workpiece"), (Ink::After, "base to tool"), (Ink::Neither, "axes")];
    let word = |axis: &Axis| match axis.kind {
        JointKind::Prismatic => format!("{} linear", axis.name),
        JointKind::Revolute => format!("{} rotary", axis.name),
    };
    html! {
        figure {
            figcaption { strong { (machine.name()) " with all axes at zero" } (legend(&inks)) }
            svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {} {height:.0}", SIZE.0)) role="img" {
                title { "The machine with all axes at zero" }
                desc { "Axes: " (axes.iter().map(word).collect::<Vec<_>>().join(", ")) ". The table below has the places of their frames." }
                @for axis in &axes {
                    @let [a, b] = axis.line.map(place);
                    line.line.m-none x1=(at(a.0)) y1=(at(a.1)) x2=(at(b.0)) y2=(at(b.1))
                        stroke-dasharray=[(axis.kind == JointKind::Revolute).then_some("12 3 2 3")] {}
                    @if axis.kind == JointKind::Prismatic { (arrow(a, b)) (arrow(b, a)) }
                    @else { path.line.m-none d=(joined(&axis.circle.iter().map(|p| place(*p)).collect::<Vec<_>>())) {} }
                }
                @for (branch, (ink, _)) in branches.iter().zip(inks) {
                    path class=(format!("line way {}", ink.class())) d=(way(branch)) {}
                }
                @for (x, y) in &dots { circle.bar.m-curve cx=(at(*x)) cy=(at(*y)) r="3" {} }
                @for (x, y, text) in &labels { text x=(at(*x)) y=(at(*y)) { (text) } }
            }
        }
    }
}

/// The head of an arrow from `a` at `b`.
fn arrow(a: (f64, f64), b: (f64, f64)) -> Markup {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length = dx.hypot(dy).max(1e-9);
    let (ux, uy) = (7.0 * dx / length, 7.0 * dy / length);
    let wing = |side: f64| (b.0 - ux - side * 0.5 * uy, b.1 - uy + side * 0.5 * ux);
    html! { path.line.m-none d=(joined(&[wing(1.0), b, wing(-1.0)])) {} }
}

/// Frames in the order of the chain.
fn frames(machine: &Machine) -> Markup {
    let split = machine.w_index() + 1;
    let three = |v: Vec3<f64>, factor: f64| {
        let of = |x: f64| format!("{}", (x * factor * 1e4).round() / 1e4 + 0.0);
        v.0.map(of).join(", ")
    };
    let row = |(j, dyad): (usize, &crate::machine::Dyad)| -> Vec<Cell> {
        let joint = dyad.joint.as_ref();
        let kind = joint.map_or("fixed", |joint| match joint.kind {
            JointKind::Prismatic => "linear",
            JointKind::Revolute => "rotary",
        });
        let turned = dyad.placement.rotation;
        vec![
            written((j + 1).to_string(), j as f64),
            word(if j < split { "workpiece" } else { "tool" }),
            word(&dyad.frame),
            word(joint.map_or("-", |joint| &joint.name)),
            word(kind),
            word(joint.map_or(String::new(), |joint| three(joint.axis, 1.0))),
            word(three(dyad.placement.at, 1e3)),
            word(if turned.norm() > 0.0 { three(turned, 1f64.to_degrees()) } else { String::new() }),
        ]
    };
    let heads = ["no.", "branch", "frame", "joint", "kind", "axis", "offset, mm", "turned by, deg"];
    table(&heads, machine.dyads().iter().enumerate().map(row).collect())
}

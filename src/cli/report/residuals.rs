//! Residuals against time and against every axis, with the stretches in which findings act.

use maud::{Markup, html};

use super::plot::{Ink, Layer, Marks, Plot, envelope, thinned};
use super::table::{largest, residual_unit};
use super::track::Track;
use crate::diagnose::Diagnosis;
use crate::machine::{JointKind, Machine};

/// Dots and corners of all pictures of residuals together, and of one at most.
const ALL_POINTS: usize = 13_000;
const MOST_POINTS: usize = 1200;
/// Recordings that have pictures of their own; axes likewise.
const MOST_PICTURES: usize = 10;
/// A gap this many times the usual step breaks a line.
const GAP: f64 = 20.0;
/// What is this many times smaller than the model before it has a picture of its own.
const SMALLER: f64 = 4.0;

/// The inks of models in their order.
pub(super) fn ink_of(stage: usize) -> Ink {
    [Ink::Before, Ink::After, Ink::Named][stage.min(2)]
}

/// Both kinds of pictures.
pub(super) fn residuals(
    machine: &Machine,
    tracks: &[Track],
    stages: &[&'static str],
    diagnosis: Option<&Diagnosis>,
) -> Markup {
    let pictures = 2 * tracks.len().min(MOST_PICTURES) + machine.commands().len().min(MOST_PICTURES);
    let most = (ALL_POINTS / pictures.max(1)).clamp(60, MOST_POINTS);
    let along_time =
        tracks.iter().take(MOST_PICTURES).flat_map(|track| along(track, stages, diagnosis, most));
    let mut against_axes = Vec::new();
    for angle in [false, true] {
        let own: Vec<&Track> = tracks.iter().filter(|track| track.angle == angle).collect();
        for c in 0..machine.commands().len().min(MOST_PICTURES) {
            against_axes.extend(against(machine, c, &own, stages, diagnosis, most));
        }
    }
    html! {
        h2 { "Residuals against time" }
        p.note { "Measured minus model. Extremes along the path are kept where samples are thinned out." }
        div.figures { @for figure in along_time { (figure) } }
        @if tracks.len() > MOST_PICTURES {
            p.note { "The first " (MOST_PICTURES) " of " (tracks.len()) " recordings are drawn; tables and axes below have them all." }
        }
        @if !against_axes.is_empty() {
            h2 { "Residuals against every axis" }
            p.note { "All recordings together, by the direction in which the axis travels. What flips with the direction is play or friction; \
                      what does not is geometry, or depends on where the axis stands." }
            div.figures { @for figure in against_axes { (figure) } }
        }
    }
}

/// Pictures of a recording: all models, and the last of them by themselves where they are much smaller.
fn along(track: &Track, stages: &[&'static str], diagnosis: Option<&Diagnosis>, most: usize) -> Vec<Markup> {
    let rms = |stage: usize| {
        let all = &track.residuals[stage];
        (all.iter().map(|x| x * x).sum::<f64>() / all.len().max(1) as f64).sqrt()
    };
    let mut pictures = Vec::new();
    let mut from = 0;
    loop {
        let shown: Vec<usize> = (from..stages.len()).collect();
        pictures.extend(of_stages(track, stages, &shown, diagnosis, most));
        match (from + 1..stages.len()).find(|k| rms(*k - 1) > SMALLER * rms(*k)) {
            Some(next) if pictures.len() < 2 => from = next,
            _ => break,
        }
    }
    pictures
}

fn of_stages(
    track: &Track,
    stages: &[&'static str],
    shown: &[usize],
    diagnosis: Option<&Diagnosis>,
    most: usize,
) -> Option<Markup> {
    let size = largest(shown.iter().flat_map(|k| track.residuals[*k].iter().copied()));
    let unit = residual_unit(track.angle, size);
    let count = track.residuals.first()?.len();
    let times: Vec<f64> = track.time.clone().unwrap_or_else(|| (0..count).map(|k| k as f64).collect());
    let most = most / shown.len().max(1);
    let marks = |values: &[f64]| {
        let line: Vec<(f64, f64)> = times.iter().zip(values).map(|(t, v)| (*t, v * unit.per_si)).collect();
        if track.settled {
            return Marks::Dots(thinned(&line, most));
        }
        let part = |piece: &[(f64, f64)]| (most * piece.len()).div_ceil(line.len().max(1)).max(2);
        Marks::Lines(pieces(&line).into_iter().map(|piece| envelope(piece, part(piece))).collect())
    };
    let layer =
        |k: &usize| Layer { ink: ink_of(*k), name: stages[*k].into(), marks: marks(&track.residuals[*k]) };
    let (bands, band_name) = diagnosis.map_or_else(Default::default, |found| acts(found, track));
    let plot = Plot {
        title: format!(
            "{}: {}",
            track.recording,
            shown.iter().map(|k| stages[*k]).collect::<Vec<_>>().join(", ")
        ),
        x_label: if track.time.is_some() { "time, s".into() } else { "sample".into() },
        y_label: label(track, unit.symbol),
        layers: shown.iter().map(layer).collect(),
        bands,
        band_name,
    };
    plot.figure("")
}

fn label(track: &Track, symbol: &str) -> String {
    format!("{}residual, {symbol}", if track.signed { "" } else { "size of " })
}

/// Where the strongest finding that is confined to a part of the recording acts.
fn acts(found: &Diagnosis, track: &Track) -> (Vec<(f64, f64)>, String) {
    let Some(time) = &track.time else { return Default::default() };
    let (first, last) = (time.first().copied().unwrap_or(0.0), time.last().copied().unwrap_or(0.0));
    for finding in &found.findings {
        let own = finding.r#where.iter().filter(|place| place.recording == track.recording);
        let bands: Vec<(f64, f64)> = own.filter_map(|place| Some((place.from_s?, place.to_s?))).collect();
        let covered: f64 = bands.iter().map(|(from, to)| to - from).sum();
        if !bands.is_empty() && covered < 0.8 * (last - first) {
            return (bands, format!("where {} at {} acts", finding.effect, finding.at));
        }
    }
    Default::default()
}

/// Residuals of all recordings against one command.
fn against(
    machine: &Machine,
    c: usize,
    tracks: &[&Track],
    stages: &[&'static str],
    diagnosis: Option<&Diagnosis>,
    most: usize,
) -> Option<Markup> {
    // The model before the last one shows what the last one takes away; of two it is the calibrated one itself.
    let stage = if stages.len() > 2 { stages.len() - 2 } else { stages.len().checked_sub(1)? };
    let joint = machine.command_joint(c);
    let (x_factor, x_symbol) =
        if joint.kind == JointKind::Revolute { (1f64.to_degrees(), "deg") } else { (1e3, "mm") };
    let range = |track: &&Track| {
        let all = &track.commands[c];
        all.iter().copied().fold(f64::NEG_INFINITY, f64::max)
            - all.iter().copied().fold(f64::INFINITY, f64::min)
    };
    let moving: Vec<&&Track> = tracks.iter().filter(|track| range(track) > 0.0).collect();
    let first = moving.first()?;
    let size = largest(moving.iter().flat_map(|track| track.residuals[stage].iter().copied()));
    let unit = residual_unit(first.angle, size);
    let name = &machine.commands()[c];
    let mut layers = Vec::new();
    let inks = [
        (1, Ink::Forward, "forward"),
        (-1, Ink::Backward, "backward"),
        (0, Ink::Neither, "direction unknown"),
    ];
    for (direction, ink, word) in inks {
        let points = moving.iter().flat_map(|track| {
            let samples = track.commands[c].iter().zip(&track.directions[c]).zip(&track.residuals[stage]);
            samples
                .filter(move |((_, own), _)| **own == direction)
                .map(|((x, _), r)| (x * x_factor, r * unit.per_si))
        });
        let points: Vec<(f64, f64)> = points.collect();
        if !points.is_empty() {
            layers.push(Layer {
                ink,
                name: format!("{name} {word}"),
                marks: Marks::Dots(thinned(&points, most / 2)),
            });
        }
    }
    let bands: Vec<(f64, f64)> = diagnosis.map_or_else(Vec::new, |found| {
        stretches(found, name).into_iter().map(|(from, to)| (from * x_factor, to * x_factor)).collect()
    });
    let plot = Plot {
        title: format!("{}, against {name}", stages[stage]),
        x_label: format!("position of {name}, {x_symbol}"),
        y_label: label(first, unit.symbol),
        layers,
        bands,
        band_name: "located stretch".into(),
    };
    plot.figure("")
}

/// Stretches of a joint's travel to which findings there are confined, m or rad.
fn stretches(found: &Diagnosis, joint: &str) -> Vec<(f64, f64)> {
    let here = found.findings.iter().filter(|finding| finding.at == joint);
    here.filter_map(|finding| {
        let size = |names: &[&str]| {
            let of = |name: &&str| finding.coefficients.iter().find(|size| size.name == **name);
            names.iter().find_map(of).map(|size| size.value)
        };
        let at = size(&["at"])?;
        let half = size(&["extent", "width"]).unwrap_or(0.0).abs();
        Some((at - half, at + half))
    })
    .collect()
}

/// A line cut at its gaps.
fn pieces(line: &[(f64, f64)]) -> Vec<&[(f64, f64)]> {
    let mut steps: Vec<f64> = line.windows(2).map(|w| w[1].0 - w[0].0).collect();
    steps.sort_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    line.chunk_by(|a, b| b.0 - a.0 <= GAP * usual).collect()
}

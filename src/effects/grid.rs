//! Which values of a family's parameters are tried: fine enough that none is missed, `docs/effects.md` (48).

use super::facts::RecordingFacts;
use super::family::{Grid, ParameterForm, Range};
use crate::feature::Dimension;
use crate::machine::JointKind;

/// Part of a step between settled positions within which a take-up cannot be told from none.
const TAKEN_UP: f64 = 0.3;
/// Part of a recording at its beginning and its end in which no slip is looked for.
const EDGE: f64 = 0.05;
/// More points than this are not tried: waves end at the shortest that are reached in steps that miss none, all others are spread evenly.
const MOST_POINTS: usize = 1_000_000;

/// A parameter's range at one place, SI; the reason where there is none.
pub(super) fn range(
    form: &ParameterForm,
    own: Option<JointKind>,
    travel: Option<(f64, f64)>,
    (spacing, finest): (f64, f64),
    stride: f64,
    facts: &RecordingFacts,
) -> Result<(f64, f64), String> {
    match form.range {
        Range::Travel => {
            let (from, to) = travel.ok_or("the joint does not move")?;
            // Among few targets nobody sees where along the travel something begins and ends.
            if matches!(form.grid, Grid::Within(..)) && spacing >= to - from {
                return Err(TOO_FAR.into());
            }
            Ok((from, to))
        }
        Range::Order if insides(facts).is_empty() => Err("there are too few samples to show it".into()),
        Range::Order => Ok((0.0, facts.samples)),
        Range::Time if facts.time.is_some() && !facts.one_clock => Err(MANY_CLOCKS.into()),
        Range::Time => facts.time.ok_or_else(|| NO_TIME.into()).map(|(from, to)| (0.0, to - from)),
        Range::ByKind | Range::Between(..) => {
            let (from, to, dimension) = form.stated(own).ok_or("no range is given for this kind of place")?;
            let (from, to) = narrowed(form, dimension, (from, to), travel, facts);
            // What is taken up within a step from one settled position to the next looks as if it were taken up at once.
            let from = from.max(TAKEN_UP * stride);
            if from > to {
                return Err(TOO_FAR.into());
            }
            resolved(form, dimension, (from, to), finest)
        }
    }
}

/// What is finer than positions tell looks like something coarse.
fn resolved(
    form: &ParameterForm,
    dimension: Dimension,
    (from, to): (f64, f64),
    wave: f64,
) -> Result<(f64, f64), String> {
    let (from, to) = match form.grid {
        Grid::Periods(_) if dimension != Dimension::TIME => (from.max(wave), to),
        Grid::Orders(_) if wave > 0.0 => (from, to.min(std::f64::consts::TAU / wave)),
        _ => return Ok((from, to)),
    };
    if from > to {
        return Err(TOO_FAR.into());
    }
    Ok((from, to))
}

pub(super) const TOO_FAR: &str = "positions lie too far apart to show it";

pub(super) const MANY_CLOCKS: &str = "it needs one clock, and the recordings' times overlap";

pub(crate) const NO_TIME: &str = "it needs time, and a recording has no column t";

/// Lengths, angles and times beyond what was seen cannot be told apart there: the range ends at a few times that. What is faster
/// than the samples follow each other cannot be seen either.
fn narrowed(
    form: &ParameterForm,
    dimension: Dimension,
    (from, to): (f64, f64),
    travel: Option<(f64, f64)>,
    facts: &RecordingFacts,
) -> (f64, f64) {
    let seen = travel.map(|(a, b)| b - a);
    let to = match (&form.grid, seen) {
        (Grid::Frequencies(_), _) => match facts.step.filter(|s| *s > 0.0) {
            Some(step) => to.min(0.5 / step),
            None => to,
        },
        (Grid::Logarithmic(_), Some(seen))
            if dimension == Dimension::LENGTH || dimension == Dimension::ANGLE =>
        {
            to.min(seen)
        }
        (Grid::Periods(_), Some(seen)) if dimension != Dimension::TIME => to.min(seen),
        _ => to,
    };
    (from.min(to), to)
}

/// Points of all parameters together; one point without numbers where there is no parameter.
pub(super) fn points(
    forms: &[ParameterForm],
    ranges: &[(f64, f64)],
    travel: Option<(f64, f64)>,
    facts: &RecordingFacts,
) -> Vec<Vec<f64>> {
    let seen = travel.map_or(1.0, |(a, b)| b - a);
    let names: Vec<&str> = forms.iter().map(|f| f.name.as_str()).collect();
    // Parameters whose steps follow another one come after it, whatever the order in which they are written.
    let mut order: Vec<usize> = (0..forms.len()).collect();
    order.sort_by_key(|i| matches!(forms[*i].grid, Grid::Within(..)));
    let mut points = vec![vec![f64::NAN; forms.len()]];
    for i in order {
        let (from, to) = ranges[i];
        let mut finer = Vec::new();
        for point in &points {
            let values = match &forms[i].grid {
                Grid::Parts(parts) if forms[i].range == Range::Order => orders(*parts, facts),
                Grid::Logarithmic(ratio) => logarithmic(from, to, *ratio),
                Grid::Parts(parts) => even(from, to, *parts),
                Grid::Whole => whole(from, to),
                Grid::Orders(_) if seen >= 0.99 * std::f64::consts::TAU => whole(from, to),
                Grid::Orders(part) => waves(from, to, part * std::f64::consts::TAU / seen),
                Grid::Periods(part) => {
                    let extent = if forms[i].unit == "s" { facts.longest } else { seen };
                    let (most, least) = (1.0 / from, 1.0 / to);
                    waves(least, most, part / extent).into_iter().rev().map(f64::recip).collect()
                }
                Grid::Frequencies(part) => waves(from, to, part / facts.followed().max(1e-9)),
                Grid::Within(other, part) => {
                    let width = names.iter().position(|n| n == other).map_or(to - from, |o| point[o]);
                    let parts = ((to - from) / (part * width).abs().max(1e-12)).ceil().max(1.0) as usize;
                    even(from, to, parts.min(MOST_POINTS))
                }
            };
            for value in values {
                let mut point = point.clone();
                point[i] = value;
                finer.push(point);
            }
        }
        points = finer;
    }
    points.truncate(MOST_POINTS);
    points
}

fn whole(from: f64, to: f64) -> Vec<f64> {
    (from.ceil() as i64..=to.floor() as i64).map(|n| n as f64).collect()
}

fn even(from: f64, to: f64, parts: usize) -> Vec<f64> {
    if to <= from {
        return vec![from];
    }
    (0..=parts).map(|i| from + (to - from) * i as f64 / parts as f64).collect()
}

/// Frequencies no further apart than `step`.
fn waves(from: f64, to: f64, step: f64) -> Vec<f64> {
    let to = to.min(from + step * MOST_POINTS as f64);
    even(from, to, ((to - from) / step).ceil().max(1.0) as usize)
}

/// Numbers of samples inside every recording, away from where it begins and ends: there nothing has a before and an after.
pub(super) fn insides(facts: &RecordingFacts) -> Vec<(f64, f64)> {
    let ends = facts.begins.iter().skip(1).map(|(_, n)| *n).chain([facts.samples]);
    let inside = |from: f64, to: f64| {
        let edge = (EDGE * (to - from)).max(2.0);
        (from + edge, to - edge)
    };
    let all = facts.begins.iter().map(|(_, n)| *n).zip(ends).map(|(from, to)| inside(from, to));
    all.filter(|(from, to)| to > from).collect()
}

/// Numbers of samples in all recordings, about as many as parts.
fn orders(parts: usize, facts: &RecordingFacts) -> Vec<f64> {
    let inner = insides(facts).into_iter().flat_map(|(from, to)| {
        let own = (parts as f64 * (to - from) / facts.samples).ceil().max(8.0);
        // Between two samples, so that no rounding decides.
        even(from, to, own as usize).into_iter().map(move |n| (n.floor() + 0.5).min(to))
    });
    let mut points: Vec<f64> = inner.collect();
    points.dedup();
    points
}

fn logarithmic(from: f64, to: f64, ratio: f64) -> Vec<f64> {
    if to <= from || from <= 0.0 {
        return vec![from.max(to)];
    }
    let parts = ((to / from).ln() / ratio.ln()).ceil().max(1.0);
    (0..=parts as usize).map(|i| from * (to / from).powf(i as f64 / parts)).collect()
}

//! Residuals sample by sample, and what goes with each finding, for pictures.

use super::diagnosis::Diagnosis;
use super::held_out::Model;
use super::linear::Span;
use super::pictures::{Along, Curve, CurvePoint, Trace};
use super::search::Search;
use super::terms::ModelTerm;
use crate::effects::Place;
use crate::machine::{JointKind, Machine};

/// Recordings in which a finding takes away less than this part of all that it does are left out of its curve.
const SLIGHT: f64 = 0.02;

/// Puts the traces into the diagnosis, and what part of the misfit goes with each finding. `last`: residuals with all of them.
pub(super) fn fill(
    search: &Search,
    told: &[ModelTerm],
    last: &[f64],
    machine: &Machine,
    diagnosis: &mut Diagnosis,
) {
    let linear = search.rows.linear;
    let geometric = &linear.residual;
    for (s, span) in linear.spans.iter().enumerate() {
        for angle in [false, true] {
            let readings = readings_of(search, span, angle);
            if readings.is_empty() {
                continue;
            }
            let of = |residual: &[f64]| -> Vec<Vec<f64>> {
                readings
                    .iter()
                    .map(|i| rows_of(search, span, *i).map(|row| residual[row]).collect())
                    .collect()
            };
            diagnosis.traces.recordings.push(Trace {
                recording: span.label.clone(),
                angle,
                time: linear.samples[s].time.clone(),
                geometric: of(geometric),
                r#final: of(last),
            });
        }
    }
    for (i, effect) in told.iter().enumerate() {
        let is_other =
            |(k, other): &(usize, &ModelTerm)| *k != i && !search.is_one(effect.candidate, other.candidate);
        let others: Vec<ModelTerm> =
            told.iter().enumerate().filter(is_other).map(|(_, other)| other.clone()).collect();
        let without = Model::new(search, &others).residual(search, &others);
        let along = match search.candidates[effect.candidate].place {
            Place::Joint(j) => Some(j),
            Place::Pair(_, partner) => Some(partner),
            Place::Frame(_) | Place::Measurement => None,
        };
        let mut curve = curve(search, machine, along, &without, last);
        if let Some(load) = load_of(search, effect) {
            against_load(&mut curve, &load);
        }
        let square = |residual: &[f64]| -> f64 {
            (0..residual.len()).filter(|r| linear.angle[*r] == curve.angle).map(|r| residual[r].powi(2)).sum()
        };
        let share = (square(&without) - square(last)) / square(geometric).max(f64::MIN_POSITIVE);
        diagnosis.findings[i].share = share.clamp(0.0, 1.0);
        diagnosis.traces.findings.push(curve);
    }
    if let Some(unexplained) = &diagnosis.unexplained {
        let named = machine.joints().find(|(_, joint)| joint.name == unexplained.at);
        let nothing = vec![0.0; last.len()];
        let mut curve = curve(search, machine, named.map(|(j, _)| j), last, &nothing);
        curve.runs.iter_mut().flatten().for_each(|point| point.effect = 0.0);
        diagnosis.traces.unexplained = Some(curve);
    }
}

fn readings_of(search: &Search, span: &Span, angle: bool) -> Vec<usize> {
    let first = span.rows.0..span.rows.1.min(span.rows.0 + span.readings);
    first.filter(|row| search.rows.linear.angle[*row] == angle).map(|row| row - span.rows.0).collect()
}

/// Rows of one reading.
fn rows_of(search: &Search, span: &Span, reading: usize) -> impl Iterator<Item = usize> {
    let linear = search.rows.linear;
    (span.rows.0..span.rows.1).filter(move |row| linear.reading[*row] == reading)
}

/// By sample the load that a finding depends on, where it depends on gravity and on nothing that came before.
fn load_of(search: &Search, effect: &ModelTerm) -> Option<Vec<f64>> {
    let first = search.candidates[effect.candidate].features.first()?;
    let stands = first.needs_gravity() && !first.needs_history();
    stands.then(|| first.over(&search.rows.linear.samples, &effect.score.parameters))
}

/// The same curve against this load, the direction of travel left aside.
fn against_load(curve: &mut Curve, load: &[f64]) {
    let Along::Joint { name, .. } = &curve.along else { return };
    curve.along = Along::Load { name: name.clone() };
    for point in curve.runs.iter_mut().flatten() {
        point.x = load.get(point.sample).copied().unwrap_or(f64::NAN);
    }
}

/// `along`: dyad of the joint against which it is shown; without one it runs along time.
fn curve(search: &Search, machine: &Machine, along: Option<usize>, without: &[f64], with: &[f64]) -> Curve {
    let linear = search.rows.linear;
    let energy = |row: usize| (without[row] - with[row]).powi(2);
    let sum_over = |angle: bool| -> f64 {
        (0..without.len()).filter(|row| linear.angle[*row] == angle).map(energy).sum()
    };
    // Lengths, where there are any that it changes.
    let angle = sum_over(false) == 0.0;
    let total = sum_over(angle).max(f64::MIN_POSITIVE);
    let joint = along.and_then(|j| machine.dyads()[j].joint.as_ref().map(|joint| (j, joint)));
    let timed = linear.samples.iter().all(|s| s.time.is_some());
    let mut curve = Curve {
        along: match joint {
            Some((_, joint)) => {
                Along::Joint { name: joint.name.clone(), angle: joint.kind == JointKind::Revolute }
            }
            None if timed => Along::Time,
            None => Along::Sample,
        },
        angle,
        runs: Vec::new(),
    };
    for (span, samples) in linear.spans.iter().zip(&linear.samples) {
        let sum_of = |reading: usize| rows_of(search, span, reading).map(energy).sum::<f64>();
        let Some((reading, own)) = (readings_of(search, span, angle).into_iter())
            .map(|reading| (reading, sum_of(reading)))
            .max_by(|a, b| a.1.total_cmp(&b.1))
        else {
            continue;
        };
        if own < SLIGHT * total {
            continue;
        }
        let mut before: Option<(i8, f64)> = None;
        for row in rows_of(search, span, reading) {
            let sample = linear.sample[row];
            let k = sample - span.samples.0;
            let column = joint.and_then(|(j, _)| samples.joints[j].as_ref());
            let time = samples.time.as_ref().map_or(0.0, |t| t[k]);
            let (x, direction) = match (column, &samples.time) {
                (Some(joint), _) => (joint.position[k], joint.direction[k].clamp(-1.0, 1.0) as i8),
                (None, Some(t)) if timed => (t[k], 0),
                (None, _) => (sample as f64, 0),
            };
            let goes_on = before.is_some_and(|(d, t)| d == direction && time - t <= span.pause_after);
            before = Some((direction, time));
            let point =
                CurvePoint { sample, x, direction, residual: without[row], effect: without[row] - with[row] };
            match curve.runs.last_mut().filter(|_| goes_on) {
                Some(run) => run.push(point),
                None => curve.runs.push(vec![point]),
            }
        }
    }
    curve
}

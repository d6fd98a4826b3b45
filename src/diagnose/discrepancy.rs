//! The shape of an effect as it may depart from the family's: the same motion, as another function of what the effect depends on.
//!
//! No play is quite a step and no worm quite a sine. What is left at the place of an effect because of that is taken for its shape and
//! not for a second effect; and where the shape would have to be most of it, the name is wrong, `docs/diagnosis-method.md` (66).

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::curves::{column, product, squares};
use super::equations::Column;
use super::linear::Linear;
use super::marginal::square;
use super::score::Rows;
use super::terms::ModelTerm;
use super::whitener::FEW;
use crate::effects::{Candidate, Place};
use crate::feature::{Feature, Samples};
use crate::lie::Twist;
use crate::variation::Slot;

/// A column of the shape may have this part of the effect's amplitude.
pub(super) const PART: f64 = 0.3;
/// Shapes that are smaller than this part of the noise, all rows together, are left aside.
const HIDDEN: f64 = 0.2;
/// A function of position with so many coefficients may bend as it likes.
pub(super) const BENDS: usize = 3;
/// Orders of curves along travel and time.
const CURVE: usize = 12;
/// Orders of what multiplies the effect's own features.
const WANDER: usize = 3;
/// Curves of position that differ by side.
const SIDES: usize = 5;
/// Curves of a joint's history with more numbers than this are not kept.
const MOST_KEPT: usize = 1 << 20;
/// Travel over which something decays after a reversal, as parts of the range of travel.
const DECAYS: [f64; 5] = [0.003, 0.01, 0.03, 0.1, 0.3];
/// The same for what is remembered of the time before a recording.
pub(super) const EARLY: [f64; 3] = [0.003, 0.01, 0.03];
/// Most recordings whose beginnings have unknowns of their own. Each of them is a column as long as all samples: with thousands of recordings
/// these would fill the memory, and say little beside those that last longest.
const BEGINNINGS: usize = 64;
/// Effects with more directions keep the mixture of them that was found.
pub(super) const MOST_DIRECTIONS: usize = 3;

/// Columns of the shape of an effect, each times what its coefficient may be; `answers`: to its motion. `with_sides`: with those that every effect
/// of the same history has, [`past_curves`].
pub(super) fn shape(
    rows: &Rows,
    candidate: &Candidate,
    in_model: &ModelTerm,
    answers: Vec<Column>,
    with_sides: bool,
) -> Unmixed {
    let curves = curves(rows, candidate, &in_model.score.parameters, with_sides);
    whitened(rows, answers, curves.into_iter().map(Arc::new).collect(), PART * amplitude(in_model))
}

/// Columns of what an effect with a memory may have been before anybody looked: until its joint first turns round in a
/// recording, nobody knows from which side it came nor how far. As large as the effect itself; `answers`: to its motion.
pub(super) fn initial_conditions(
    rows: &Rows,
    candidate: &Candidate,
    in_model: &ModelTerm,
    answers: Vec<Column>,
) -> Unmixed {
    let with_history = candidate.features.iter().filter(|f| f.needs_history());
    let pasts = with_history.flat_map(|f| f.joints().into_iter().map(|j| (j, f.remembers())));
    let known = |of| past_curves(rows.linear, of).map(|[before, _]| before);
    let before = |of: (usize, bool)| known(of).unwrap_or_else(|| beginnings(rows.linear, of.0, of.1));
    let mut curves: Vec<Column> = pasts.flat_map(before).collect();
    curves.extend(turns(rows, candidate, &in_model.score.parameters));
    whitened(rows, answers, curves, amplitude(in_model))
}

/// The same without those columns that every effect of the same history has, [`past_curves`].
pub(super) fn own_initial_conditions(
    rows: &Rows,
    candidate: &Candidate,
    in_model: &ModelTerm,
    answers: Vec<Column>,
) -> Unmixed {
    whitened(rows, answers, turns(rows, candidate, &in_model.score.parameters), amplitude(in_model))
}

/// The joint of an effect that depends on that joint alone and on which way it has come, whether that lasts, and how many of its features do so
/// alike; `None` where they differ.
pub(super) fn history(candidate: &Candidate) -> Option<(usize, bool, usize)> {
    let features = &candidate.features;
    let joint = features.iter().find_map(|f| f.joints().first().copied())?;
    let with_history: Vec<&Feature> = features.iter().filter(|f| f.needs_history()).collect();
    let lasts = with_history.first()?.remembers();
    let is_alike = features.iter().flat_map(Feature::joints).all(|j| j == joint)
        && with_history.iter().all(|f| f.joints().len() == 1 && f.remembers() == lasts);
    is_alike.then_some((joint, lasts, with_history.len()))
}

/// What all effects of a history have: curves of what was there before anybody looked, and of what their shape may be; `None` where these would be
/// too many to be kept.
pub(super) fn past_curves(linear: &Linear, of: (usize, bool)) -> Option<[Vec<Column>; 2]> {
    let recordings = linear.spans.len().min(BEGINNINGS);
    if (EARLY.len() * recordings + SIDES + DECAYS.len()) * linear.lines.len() > MOST_KEPT {
        return None;
    }
    // Never held while other work is done: a thread may take another's up meanwhile.
    if let Some(known) = linear.pasts.lock().ok().and_then(|map| map.get(&of).cloned()) {
        return Some(known);
    }
    let sides = sides(&linear.samples, of.0).into_iter().map(Arc::new).collect();
    let curves = [beginnings(linear, of.0, of.1), sides];
    if let Ok(mut map) = linear.pasts.lock() {
        map.insert(of, curves.clone());
    }
    Some(curves)
}

/// How an effect changes where joints have turned round just before each recording, of every recording for itself.
fn turns(rows: &Rows, candidate: &Candidate, parameters: &[f64]) -> Vec<Column> {
    let (stretches, mut curves) = (&rows.linear.samples, Vec::new());
    // Machines that stand before a recording may have turned round just there.
    for feature in candidate.features.iter().filter(|f| f.needs_history()) {
        let with = feature.over(rows.linear.turned_before(), parameters);
        let without = feature.over(stretches, parameters);
        let change: Vec<f64> = with.iter().zip(&without).map(|(a, b)| a - b).collect();
        let (mut first, mut lengths) = (0, Vec::new());
        for stretch in stretches {
            let own = first..first + stretch.len;
            first = own.end;
            lengths.push(change[own].iter().filter(|x| x.abs() > 0.0).count());
        }
        let taken = longest(&lengths);
        first = 0;
        for (at, stretch) in stretches.iter().enumerate() {
            let own = first..first + stretch.len;
            first = own.end;
            if taken.binary_search(&at).is_ok() && change[own.clone()].iter().any(|x| x.abs() > 0.0) {
                let only = |k: usize| if own.contains(&k) { change[k] } else { 0.0 };
                curves.push(Arc::new((0..change.len()).map(only).collect()));
            }
        }
    }
    curves
}

/// What was there before joint `j` first turned round in a recording: curves that decay as it goes on, of every recording for itself. `lasts`:
/// what is taken up gradually does not end where the joint turns round.
fn beginnings(linear: &Linear, j: usize, lasts: bool) -> Vec<Column> {
    let (stretches, mut curves) = (&linear.samples, Vec::new());
    let since = column(stretches, j, |c| &c.since_reversal);
    let travelled = column(stretches, j, |c| &c.travelled);
    let range = extent(&column(stretches, j, |c| &c.position));
    let mut first = 0;
    let early = |s: &Samples| {
        let own = s.joints[j].iter().flat_map(|of| &of.since_reversal);
        own.filter(|since| lasts || **since >= UNKNOWN).count()
    };
    let taken = longest(&stretches.iter().map(early).collect::<Vec<usize>>());
    for (at, stretch) in stretches.iter().enumerate() {
        let own = first..first + stretch.len;
        first = own.end;
        if taken.binary_search(&at).is_err() {
            continue;
        }
        let before = |part: f64| -> Column {
            let unknown = |k: &usize| own.contains(k) && (lasts || since[*k] >= UNKNOWN);
            let decay = |k: usize| (-travelled[k] / (part * range)).exp();
            Arc::new((0..since.len()).map(|k| if unknown(&k) { decay(k) } else { 0.0 }).collect())
        };
        let stands_still = travelled[own.clone()].iter().all(|x| *x < EARLY[0] * range);
        match stands_still {
            true => curves.push(before(1.0)),
            false => curves.extend(EARLY.map(before)),
        }
    }
    curves
}

/// The recordings whose beginnings last longest, in their order: all of them where there are not too many.
pub(super) fn longest(lengths: &[usize]) -> Vec<usize> {
    let mut all: Vec<usize> = (0..lengths.len()).collect();
    // Stable: of equals the first ones.
    all.sort_by_key(|i| std::cmp::Reverse(lengths[*i]));
    all.truncate(BEGINNINGS);
    all.sort_unstable();
    all
}

/// Norm of what an effect does to the whitened rows.
pub(super) fn amplitude(in_model: &ModelTerm) -> f64 {
    (&in_model.columns * &in_model.solution).norm()
}

/// Columns of answers times curves, each as long as it may be, those included that noise hides.
pub(super) struct Unmixed {
    /// Whitened.
    pub white: DMatrix<f64>,
    /// Which answer and curve they were made of, and by what they were multiplied.
    pub made_of: Vec<(usize, usize, f64)>,
    answers: Vec<Column>,
    curves: Vec<Column>,
}

impl Unmixed {
    /// Combinations of them that noise does not hide.
    pub fn mixed(self) -> Columns {
        let mixture = seen(square(&self.white));
        Columns { white: &self.white * &mixture, mixture, of: self }
    }
}

/// Columns that noise does not hide, each as long as it may be.
pub(super) struct Columns {
    /// Whitened.
    pub white: DMatrix<f64>,
    /// How those were mixed that it was made of.
    mixture: DMatrix<f64>,
    of: Unmixed,
}

impl Columns {
    /// As they are, m and rad.
    pub fn raw(&self, rows: &Rows) -> DMatrix<f64> {
        let Unmixed { made_of, answers, curves, .. } = &self.of;
        let mut unmixed = DMatrix::zeros(self.white.nrows(), made_of.len());
        for ((answer, curve, scale), mut column) in made_of.iter().zip(unmixed.column_iter_mut()) {
            let (answer, curve) = (&answers[*answer], &curves[*curve]);
            for ((x, a), sample) in column.iter_mut().zip(answer.iter()).zip(&rows.linear.sample) {
                *x = scale * a * curve[*sample];
            }
        }
        unmixed * &self.mixture
    }

    /// As they are, m and rad, each times its number, added up.
    pub fn sum(&self, rows: &Rows, numbers: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; self.white.nrows()];
        let mixed = &self.mixture * DVector::from_column_slice(numbers);
        let Unmixed { made_of, answers, curves, .. } = &self.of;
        for ((answer, curve, scale), number) in made_of.iter().zip(mixed.iter()) {
            let (answer, curve) = (&answers[*answer], &curves[*curve]);
            for ((sum, a), sample) in sum.iter_mut().zip(answer.iter()).zip(&rows.linear.sample) {
                *sum += number * scale * a * curve[*sample];
            }
        }
        sum
    }
}

/// Columns of answers times curves, each of this norm.
pub(super) fn whitened(rows: &Rows, answers: Vec<Column>, curves: Vec<Column>, amplitude: f64) -> Unmixed {
    let n = rows.residual.len();
    let mut made_of: Vec<(usize, usize, f64)> =
        (0..answers.len()).flat_map(|a| (0..curves.len()).map(move |c| (a, c, 0.0))).collect();
    let mut all = DMatrix::zeros(n, made_of.len());
    let columns = all.as_mut_slice().par_chunks_mut(FEW * n.max(1));
    columns.zip(made_of.par_chunks_mut(FEW)).for_each_init(
        || vec![0.0; FEW * n],
        |plain, (white, made_of)| {
            let plain = &mut plain[..white.len()];
            for (plain, (a, c, _)) in plain.chunks_mut(n.max(1)).zip(&*made_of) {
                let curve = &curves[*c];
                let answers = answers[*a].iter();
                // One reading a sample: a row is its sample.
                if curve.len() == n {
                    let both = plain.iter_mut().zip(answers).zip(curve.iter());
                    both.for_each(|((plain, answer), x)| *plain = answer * x);
                    continue;
                }
                for ((plain, answer), sample) in plain.iter_mut().zip(answers).zip(&rows.linear.sample) {
                    *plain = answer * curve[*sample];
                }
            }
            rows.whitener.apply_few(plain, white);
            let both = plain.chunks(n.max(1)).zip(white.chunks_mut(n.max(1)));
            for ((plain, white), (.., scale)) in both.zip(made_of) {
                // Rows that are left out have their part in how long it may be.
                let length = (squares(white) / rows.whitener.part_in_use(plain)).sqrt();
                *scale = if length > 0.0 && length.is_finite() { amplitude / length } else { 0.0 };
                white.iter_mut().for_each(|x| *x *= *scale);
            }
        },
    );
    let used: Vec<usize> = (0..made_of.len()).filter(|i| made_of[*i].2 > 0.0).collect();
    if used.len() < made_of.len() {
        all = all.select_columns(&used);
        made_of.retain(|(.., scale)| *scale > 0.0);
    }
    Unmixed { white: all, made_of, answers, curves }
}

/// Mixtures of columns with the same covariance `S Sᵀ`, without those that noise hides; `gram`: their Gram matrix.
pub(super) fn seen(gram: DMatrix<f64>) -> DMatrix<f64> {
    if gram.is_empty() {
        return gram;
    }
    let eigen = gram.symmetric_eigen();
    let kept: Vec<usize> =
        (0..eigen.eigenvalues.len()).filter(|i| eigen.eigenvalues[*i] > HIDDEN * HIDDEN).collect();
    eigen.eigenvectors.select_columns(&kept)
}

/// Whether one effect is a curve along the travel of a joint, and the other a bump of the same motion there.
pub(super) fn is_of_curve(curve: &Candidate, other: &Candidate) -> bool {
    let motions = |candidate: &Candidate| -> Vec<(Slot, Twist<f64>)> {
        candidate.coefficients.iter().flat_map(|c| &c.parts).map(|part| (part.slot, part.direction)).collect()
    };
    curve.place == other.place
        && curve.parameters.is_empty()
        && is_along_travel(curve)
        && is_along_travel(other)
        && motions(other).iter().all(|motion| motions(curve).contains(motion))
}

/// Whether it is a curve along the travel of a joint, of so many coefficients.
pub(super) fn is_curve(candidate: &Candidate) -> bool {
    candidate.parameters.is_empty() && is_along_travel(candidate) && candidate.coefficients.len() >= BENDS
}

/// Whether it is a curve over time of what is read, of so many coefficients.
pub(super) fn is_drift(candidate: &Candidate) -> bool {
    let by_clock = |f: &Feature| {
        f.needs_moment() && f.joints().is_empty() && f.channels().is_empty() && f.wave().is_none()
    };
    candidate.place == Place::Measurement
        && candidate.parameters.is_empty()
        && candidate.features.len() >= BENDS
        && candidate.features.iter().all(by_clock)
}

/// Whether it depends on where one joint stands and on nothing else, and is no wave.
pub(super) fn is_along_travel(candidate: &Candidate) -> bool {
    is_of_position(candidate) && candidate.features.iter().all(|f| f.wave().is_none())
}

/// Whether it depends on where one joint stands and on nothing else.
pub(super) fn is_of_position(candidate: &Candidate) -> bool {
    !candidate.features.is_empty()
        && candidate.features.iter().all(|f| {
            !(f.needs_history() || f.needs_rates() || f.needs_gravity() || f.needs_moment())
                && f.channels().is_empty()
                && f.joints().len() == 1
        })
}

/// How many of its waves go into a turn (rad) or a metre of its joint, where it is a wave of where that stands and a whole number of them.
///
/// Such a wave comes back with each turn, and no shape of it has fewer a turn, nor what does not come back.
pub(super) fn order(rows: &Rows, candidate: &Candidate, parameters: &[f64]) -> Option<f64> {
    if !is_of_position(candidate) || !candidate.parameters.iter().all(|p| p.whole) {
        return None;
    }
    let position = column(&rows.linear.samples, *candidate.features[0].joints().first()?, |c| &c.position);
    let (low, high) = (index_of(&position, f64::min)?, index_of(&position, f64::max)?);
    let of = |feature: &Feature| -> Option<f64> {
        let phase = feature.wave()?.1.over(&rows.linear.samples, parameters);
        Some((phase[high] - phase[low]).abs() / (position[high] - position[low]))
    };
    let orders: Option<Vec<f64>> = candidate.features.iter().map(of).collect();
    let order = orders?.into_iter().fold(f64::INFINITY, f64::min);
    order.is_finite().then_some(order)
}

/// How many periods of it there are along the travel, where it is a wave of where one joint stands; else none.
pub(super) fn periods(rows: &Rows, candidate: &Candidate, parameters: &[f64]) -> f64 {
    let of = |feature: &Feature| {
        let (_, phase) = feature.wave()?;
        Some(extent(&phase.over(&rows.linear.samples, parameters)) / std::f64::consts::TAU)
    };
    let each = candidate.features.iter().map(|feature| of(feature).unwrap_or(0.0));
    if is_of_position(candidate) { each.reduce(f64::min).unwrap_or(0.0) } else { 0.0 }
}

/// Where the extreme of a column is.
fn index_of(x: &[f64], extreme: impl Fn(f64, f64) -> f64) -> Option<usize> {
    let value = x.iter().copied().reduce(extreme)?;
    x.iter().position(|x| *x == value)
}

/// The directions of the effect, each once.
pub(super) fn directions(candidate: &Candidate, in_model: &ModelTerm) -> Vec<(Slot, Twist<f64>)> {
    let mut distinct: Vec<(Slot, Twist<f64>)> = Vec::new();
    for part in candidate.coefficients[..in_model.score.coefficients].iter().flat_map(|c| &c.parts) {
        let is_known = distinct.iter().any(|(slot, d)| *slot == part.slot && *d == part.direction);
        if !is_known {
            distinct.push((part.slot, part.direction));
        }
    }
    distinct
}

/// Answers of the readings to each direction of the effect.
pub(super) fn each_answer(rows: &Rows, candidate: &Candidate, in_model: &ModelTerm) -> Vec<Column> {
    directions(candidate, in_model).into_iter().map(|(slot, d)| rows.answer(slot, d)).collect()
}

/// The same, or of many directions to the mixture of them that was found.
pub(super) fn answers(rows: &Rows, candidate: &Candidate, in_model: &ModelTerm) -> Vec<Column> {
    let each = each_answer(rows, candidate, in_model);
    if each.len() <= MOST_DIRECTIONS {
        return each;
    }
    let used = &candidate.coefficients[..in_model.score.coefficients];
    let units = rows.units(candidate, &in_model.score.parameters);
    let mut mixture = vec![0.0; rows.residual.len()];
    for ((coefficient, unit), x) in used.iter().zip(&units).zip(in_model.solution.iter()) {
        for part in &coefficient.parts {
            let answer = rows.answer(part.slot, part.direction);
            mixture.iter_mut().zip(answer.iter()).for_each(|(sum, a)| *sum += unit * x * a);
        }
    }
    vec![Arc::new(mixture)]
}

/// Distance since a reversal that nobody has seen, m or rad.
pub(super) const UNKNOWN: f64 = 1e5;

/// Any function of position and side that decays after a reversal or does not.
fn sides(stretches: &[Samples], j: usize) -> Vec<Vec<f64>> {
    let position = column(stretches, j, |c| &c.position);
    let direction = column(stretches, j, |c| &c.direction);
    let since = column(stretches, j, |c| &c.since_reversal);
    let range = extent(&position);
    let decays = DECAYS.map(|part| {
        let decay: Vec<f64> = since.iter().map(|s| (-s / (part * range)).max(-200.0).exp()).collect();
        product(&direction, &decay)
    });
    let along = chebyshev(SIDES - 1, &rescaled(&position));
    along.iter().map(|t| product(&direction, t)).chain(decays).collect()
}

/// Other functions of what the effect's features depend on, at every sample; with sides or without.
fn curves(rows: &Rows, candidate: &Candidate, parameters: &[f64], with_sides: bool) -> Vec<Vec<f64>> {
    let stretches = &rows.linear.samples;
    let features = &candidate.features;
    let any = |test: &dyn Fn(&Feature) -> bool| features.iter().any(test);
    let own: Vec<Vec<f64>> = features.iter().map(|f| f.over(stretches, parameters)).collect();
    let joints: Vec<usize> = {
        let mut all: Vec<usize> = features.iter().flat_map(Feature::joints).collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    let mut curves: Vec<Vec<f64>> = Vec::new();
    let (history, rates, gravity, time) = (
        any(&Feature::needs_history),
        any(&Feature::needs_rates),
        any(&Feature::needs_gravity),
        any(&Feature::needs_moment),
    );
    // Overtones of a wave.
    for pair in features.chunks(2) {
        let Some((_, phase)) = pair[0].wave() else { continue };
        let phase = phase.over(stretches, parameters);
        for overtone in [2.0, 3.0, 4.0, 5.0] {
            curves.push(phase.iter().map(|p| (overtone * p).sin()).collect());
            curves.push(phase.iter().map(|p| (overtone * p).cos()).collect());
        }
    }
    let is_wave = !curves.is_empty();
    if joints.len() <= 2 {
        for j in &joints {
            let position = rescaled(&column(stretches, *j, |c| &c.position));
            if rates {
                let (v, a) =
                    (column(stretches, *j, |c| &c.velocity), column(stretches, *j, |c| &c.acceleration));
                let (v, a) = (by_largest(&v), by_largest(&a));
                curves.extend([
                    power(&v, 2),
                    power(&v, 3),
                    power(&a, 2),
                    power(&a, 3),
                    absolute(&v),
                    absolute(&a),
                ]);
                curves.extend([v, a]);
            }
            if gravity {
                let g = by_largest(&column(stretches, *j, |c| &c.gravity));
                let load = by_largest(&column(stretches, *j, |c| &c.load));
                curves.extend([
                    power(&g, 2),
                    power(&g, 3),
                    absolute(&g),
                    power(&load, 2),
                    power(&load, 3),
                    load,
                    g,
                ]);
            }
            if history {
                curves.extend(if with_sides { sides(stretches, *j) } else { Vec::new() });
            } else if !rates && !is_wave {
                curves.extend(chebyshev(CURVE, &position).drain(1..));
            }
            // Its strength may differ along the way.
            if !is_wave || history {
                let wander = chebyshev(WANDER, &position);
                curves.extend(own.iter().flat_map(|f| wander[1..].iter().map(|t| product(f, t))));
            }
        }
    }
    if time && !is_wave {
        let clock: Vec<f64> = stretches.iter().flat_map(|s| s.time.clone().unwrap_or_default()).collect();
        let clock = rescaled(&clock);
        if clock.len() == rows.linear.lines.len() {
            let course = chebyshev(CURVE, &clock);
            let wander = &course[1..=WANDER];
            let wandering = own.iter().flat_map(|f| wander.iter().map(|t| product(f, t)));
            curves.extend(course[1..].iter().cloned().chain(wandering));
        }
    }
    curves
}

fn extent(x: &[f64]) -> f64 {
    let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    (high - low).max(1e-12)
}

/// From -1 to 1 over what there is.
fn rescaled(x: &[f64]) -> Vec<f64> {
    let low = x.iter().copied().fold(f64::INFINITY, f64::min);
    let range = extent(x);
    x.iter().map(|x| 2.0 * (x - low) / range - 1.0).collect()
}

fn by_largest(x: &[f64]) -> Vec<f64> {
    let most = x.iter().fold(1e-12f64, |m, x| m.max(x.abs()));
    x.iter().map(|x| x / most).collect()
}

fn power(x: &[f64], n: i32) -> Vec<f64> {
    x.iter().map(|x| x.powi(n)).collect()
}

fn absolute(x: &[f64]) -> Vec<f64> {
    x.iter().map(|x| x.abs()).collect()
}

/// Chebyshev polynomials of orders 0 to `last`, by their recurrence.
fn chebyshev(last: usize, x: &[f64]) -> Vec<Vec<f64>> {
    let mut all = vec![vec![1.0; x.len()], x.to_vec()];
    for n in 2..=last {
        let next = |k: usize| 2.0 * x[k] * all[n - 1][k] - all[n - 2][k];
        all.push((0..x.len()).map(next).collect());
    }
    all
}

//! Where structure without a name sits: which joint, frame or reading foretells most of it, whatever the law.
//!
//! Each place is asked with motions that it can make, times functions of what it knows: where the joint stands, the way it goes, how fast,
//! the time. By their evidence they compete with each other and with the named effects that came nearest, `docs/diagnosis.md` (69).

use std::f64::consts::PI;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::coarse::Level;
use super::curves::{column, product};
use super::evidence::{Worth, evidence};
use super::score::{Column, Rows, judge};
use super::search::Search;
use super::shape::{EARLY, UNKNOWN};
use super::space::Space;
use super::sums::sums;
use crate::effects::{Place, Slot};
use crate::elementary::sines_cosines;
use crate::feature::{JointSamples, Samples};
use crate::lie::Twist;
use crate::machine::{Joint, JointKind, Machine};

/// Orders of the series along a joint's travel for its own motion, and for what its guideway or bearing does.
const FINE: usize = 40;
const COARSE: usize = 6;
/// The same where it depends on another joint as well.
const CROSSED: usize = 4;
/// Orders of what is smooth, along a joint's travel or over time.
const SMOOTH: usize = 12;
/// What begins at a reversal: the shortest way as part of the range, and how many ways there are, each twice the one before.
const SHORTEST: f64 = 0.0005;
const WAYS: usize = 11;
/// Usual sizes of errors, m and rad.
const USUAL: (f64, f64) = (3e-6, 3e-5);
/// What no place foretells by at least this part is the instrument's, or the time's.
const FORETOLD: f64 = 0.1;
/// A series comes into question if it takes at least this part of what the best one does, on blocks of samples.
const IN_QUESTION: f64 = 0.97;

/// A way in which a place can move.
pub(super) type Motion = (Slot, Twist<f64>);

/// Motions at one place, times one series of curves.
pub(super) struct Series {
    pub place: Place,
    /// Another joint whose position it goes with.
    with: Option<usize>,
    motions: Vec<Motion>,
    curves: Vec<Vec<f64>>,
    /// Whether the curves jump, which blocks of samples might hide.
    jumps: bool,
}

/// A series that stands out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standing {
    pub place: Place,
    /// Another joint whose position it goes with.
    pub with: Option<usize>,
    /// Logarithm of its evidence.
    pub evidence: f64,
    /// Half the energy that it takes away.
    pub gain: f64,
}

/// The place that most of what geometry leaves over depends on, and another joint whose position it goes with.
pub(super) fn whereabouts(search: &Search, machine: &Machine) -> (Place, Option<usize>) {
    let series = standing(search, machine, search.base.clone());
    let rivals = search.rivals(&[]);
    let named = rivals.first().map(|r| Standing {
        place: search.candidates[r.candidate].place,
        with: None,
        evidence: r.weight,
        gain: r.reach,
    });
    let best = series.into_iter().chain(named).max_by(|a, b| a.evidence.total_cmp(&b.evidence));
    let energy = search.leftover(&search.base).energy;
    best.filter(|best| 2.0 * best.gain > FORETOLD * energy)
        .map_or((Place::Measurement, None), |best| (best.place, best.with))
}

/// The series of most evidence beside a space.
///
/// Blocks of samples hide a little of every curve, which may be more than what one place is ahead of another: they say which series come
/// into question, and all samples which of these it is.
pub(super) fn standing(search: &Search, machine: &Machine, space: Space) -> Option<Standing> {
    let (rows, heat) = (search.rows, search.heat);
    let field = rows.field(space);
    let one = |series: &Series, level: Option<usize>| {
        let (space, left) = level.map_or((&*field.space, &field.left), |level| {
            let (space, left) = rows.on_level(&field, level);
            (space, left)
        });
        let columns = level.map_or_else(|| series.columns(rows), |level| series.on_blocks(rows, level));
        let mut standing = None;
        let count = columns.ncols();
        judge(&columns.columns(0, count), space, left, &[0], &mut |_, equations| {
            let Worth { evidence, gain, .. } = evidence(&equations.gram, &equations.toward, count, heat, 0);
            standing = Some(series.standing(evidence, gain));
        });
        standing
    };
    let courses = courses(search, machine);
    let all = all(search, &courses);
    let coarse = |series: &Series| {
        let level = series.level(rows);
        one(series, level).map(|standing| (standing, level.is_some()))
    };
    let judged: Vec<Option<(Standing, bool)>> = all.par_iter().map(coarse).collect();
    let most = judged.iter().flatten().map(|(standing, _)| standing.gain).fold(0.0, f64::max);
    let fine = |(series, judged): (&Series, &Option<(Standing, bool)>)| {
        let (standing, on_blocks) = (*judged)?;
        if on_blocks && standing.gain > IN_QUESTION * most { one(series, None) } else { Some(standing) }
    };
    let mut settled: Vec<Standing> = all.par_iter().zip(&judged).filter_map(fine).collect();
    settled.extend(sums(rows, &field, &courses, heat));
    settled.into_iter().max_by(|a, b| a.evidence.total_cmp(&b.evidence))
}

impl Series {
    /// Of a joint that goes with another one, without blocks.
    pub fn of(joint: usize, with: usize, motions: Vec<Motion>, curves: Vec<Vec<f64>>) -> Self {
        Series { place: Place::Joint(joint), with: Some(with), motions, curves, jumps: true }
    }

    pub fn standing(&self, evidence: f64, gain: f64) -> Standing {
        Standing { place: self.place, with: self.with, evidence, gain }
    }

    /// The level on whose blocks its curves change little, the longest first.
    fn level(&self, rows: &Rows) -> Option<usize> {
        let follows = |level: &Level| self.curves.iter().all(|curve| level.follows(curve));
        let levels = rows.coarse.levels();
        (!self.jumps).then(|| levels.iter().position(follows)).flatten()
    }

    /// One whitened column for each motion and curve, times the size usual on machines.
    pub fn columns(&self, rows: &Rows) -> DMatrix<f64> {
        let answers = self.motions.iter().map(|(slot, direction)| rows.answer(*slot, *direction));
        let mut columns = self.products(answers.collect(), &self.curves, &rows.linear.sample);
        rows.whiten(&mut columns);
        columns
    }

    /// The same on the blocks of a level.
    fn on_blocks(&self, rows: &Rows, number: usize) -> DMatrix<f64> {
        let level = &rows.coarse.levels()[number];
        let answers =
            self.motions.iter().map(|(slot, direction)| rows.coarse_answer(number, *slot, *direction));
        let curves: Vec<Vec<f64>> = self.curves.iter().map(|curve| level.in_middles(curve)).collect();
        self.products(answers.collect(), &curves, &level.sample)
    }

    /// Every answer times every curve; `sample`: of each row.
    fn products(&self, answers: Vec<Column>, curves: &[Vec<f64>], sample: &[usize]) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(sample.len(), answers.len() * curves.len());
        let of =
            answers.iter().zip(&self.motions).flat_map(|(a, (_, d))| curves.iter().map(move |c| (a, d, c)));
        for (mut column, (answer, direction, curve)) in columns.column_iter_mut().zip(of) {
            let turns = direction.to_array()[3..].iter().any(|w| *w != 0.0);
            let size = if turns { USUAL.1 } else { USUAL.0 };
            for ((x, answer), sample) in column.iter_mut().zip(answer.iter()).zip(sample) {
                *x = size * answer * curve[*sample];
            }
        }
        columns
    }
}

/// The ways of all joints that move.
fn courses<'a>(search: &Search<'a>, machine: &Machine) -> Vec<Course<'a>> {
    let samples = &search.rows.linear.samples;
    machine.joints().filter_map(|(j, joint)| Course::of(samples, j, joint)).collect()
}

/// Every series of every place.
fn all(search: &Search, courses: &[Course]) -> Vec<Series> {
    let mut all: Vec<Series> = courses.iter().flat_map(Course::series).collect();
    for one in courses {
        for other in courses.iter().filter(|other| other.joint != one.joint) {
            let (own, others) = (one.crossing(), other.crossing());
            let curves = own.iter().flat_map(|a| others.iter().map(|b| product(a, b))).collect();
            let (place, motions) = (Place::Joint(one.joint), vec![one.own()]);
            all.push(Series { place, with: Some(other.joint), motions, curves, jumps: false });
        }
    }
    all.extend(over_time(search));
    all
}

/// The way of one joint through all recordings.
pub(super) struct Course<'a> {
    pub joint: usize,
    kind: JointKind,
    twist: Twist<f64>,
    /// Where it stands, over the range that it goes, from 0 to 1.
    pub along: Vec<f64>,
    range: f64,
    samples: &'a [Samples],
}

impl<'a> Course<'a> {
    /// `None` where it does not move, or a recording does not tell.
    fn of(samples: &'a [Samples], joint: usize, of: &Joint) -> Option<Self> {
        let known = samples.iter().all(|s| s.joints[joint].is_some());
        let mut course =
            Course { joint, kind: of.kind, twist: of.twist(), along: Vec::new(), range: 0.0, samples };
        (course.along, course.range) = over_range(&course.column(|c| &c.position)).filter(|_| known)?;
        Some(course)
    }

    fn column(&self, pick: impl Fn(&JointSamples) -> &Vec<f64>) -> Vec<f64> {
        column(self.samples, self.joint, pick)
    }

    /// Its own motion.
    pub fn own(&self) -> Motion {
        (Slot::Before(self.joint), self.twist)
    }

    /// Translations of the frame that it stands on.
    pub fn translations(&self) -> Vec<Motion> {
        let unit = |k: usize| Twist::from_array(std::array::from_fn(|i| f64::from(u8::from(i == k))));
        (0..3).map(|k| (Slot::Before(self.joint), unit(k))).collect()
    }

    /// What may depend on another joint as well: slow waves of where it stands, and its sine and cosine, as weights on a rotary joint have them.
    fn crossing(&self) -> Vec<Vec<f64>> {
        let mut curves = series(&self.along, 0, CROSSED);
        if self.kind == JointKind::Revolute {
            curves.extend(self.turns(1.0));
        }
        curves
    }

    /// Sine and cosine of so many times its angle.
    fn turns(&self, times: f64) -> [Vec<f64>; 2] {
        let angles: Vec<f64> = self.column(|c| &c.position).into_iter().map(|q| times * q).collect();
        let (sines, cosines) = sines_cosines(&angles);
        [sines, cosines]
    }

    /// Any function of the way since the last reversal: hats along its logarithm.
    fn since_reversal(&self) -> Vec<Vec<f64>> {
        let steps: Vec<f64> = (self.column(|c| &c.since_reversal).iter())
            .map(|since| (since / (SHORTEST * self.range)).max(1.0).log2())
            .collect();
        let hat = |k: usize| steps.iter().map(|s| (1.0 - (s - k as f64).abs()).max(0.0)).collect();
        (0..WAYS).map(hat).collect()
    }

    /// How far it is from the middle of a play of this width (part of the range), -1 to 1: any lost motion that does not know the time is a
    /// sum of such.
    fn play(&self, width: f64) -> Vec<f64> {
        let half = 0.5 * width;
        let mut curve = Vec::with_capacity(self.along.len());
        for recording in self.samples {
            let own = &self.along[curve.len()..curve.len() + recording.len];
            let side =
                recording.joints[self.joint].as_ref().and_then(|c| c.direction.first()).unwrap_or(&0.0);
            let mut middle = own.first().unwrap_or(&0.0) - side * half;
            for x in own {
                middle = middle.clamp(x - half, x + half);
                curve.push((x - middle) / half);
            }
        }
        curve
    }

    /// What is left, until the joint first turns round in a recording, of what was there before.
    fn before(&self) -> Vec<Vec<f64>> {
        let mut curves = Vec::new();
        for (at, recording) in self.samples.iter().enumerate() {
            let Some(columns) = &recording.joints[self.joint] else { continue };
            if columns.since_reversal.first().is_none_or(|since| *since < UNKNOWN) {
                continue;
            }
            let own = columns.since_reversal.iter().zip(&columns.travelled);
            for part in EARLY {
                let left = own.clone().map(|(since, way)| match *since < UNKNOWN {
                    true => 0.0,
                    false => (-way / (part * self.range)).exp(),
                });
                let zeros = |of: &[Samples]| vec![0.0; of.iter().map(|s| s.len).sum()];
                let (before, after) = (zeros(&self.samples[..at]), zeros(&self.samples[at + 1..]));
                curves.push(before.into_iter().chain(left).chain(after).collect());
            }
        }
        curves
    }

    /// What depends on this joint alone: its own motion by position, by side, since reversals and by rates; what its bearing or guideway does by
    /// position and by side.
    fn series(&self) -> Vec<Series> {
        let slot = match self.kind {
            JointKind::Revolute => Slot::Before(self.joint),
            JointKind::Prismatic => Slot::After(self.joint),
        };
        let unit = |k: usize| Twist::from_array(std::array::from_fn(|i| f64::from(u8::from(i == k))));
        let (own, six) = (vec![self.own()], (0..6).map(|k| (slot, unit(k))).collect::<Vec<Motion>>());
        let direction = self.column(|c| &c.direction);
        let mut sides: Vec<Vec<f64>> =
            series(&self.along, 0, COARSE).iter().map(|curve| product(curve, &direction)).collect();
        sides.extend(self.since_reversal().iter().map(|curve| product(curve, &direction)));
        sides.extend((0..WAYS).map(|k| self.play(SHORTEST * 2f64.powi(k as i32))));
        sides.extend(self.before());
        let rates = [self.column(|c| &c.velocity), self.column(|c| &c.acceleration)];
        let rates = rates.iter().filter_map(|rate| over_largest(rate));
        let mut motion = series(&self.along, 1, COARSE);
        if self.kind == JointKind::Revolute {
            motion.extend([1.0, 2.0, 3.0].into_iter().flat_map(|times| self.turns(times)));
        }
        let all = [
            (own.clone(), series(&self.along, 1, FINE), false),
            (own.clone(), smooth(&self.along), false),
            (own.clone(), sides, true),
            (own, rates.flat_map(|r| [product(&r, &r), r]).collect(), true),
            (six.clone(), motion, false),
            (six, vec![product(&direction, &self.along), direction], true),
        ];
        let place = Place::Joint(self.joint);
        let all = all.into_iter().filter(|(_, curves, _)| !curves.is_empty());
        all.map(|(motions, curves, jumps)| Series { place, with: None, motions, curves, jumps }).collect()
    }
}

/// What frames and readings do over time, as candidates say that they can.
fn over_time(search: &Search) -> Vec<Series> {
    let times: Option<Vec<Vec<f64>>> = search.rows.linear.samples.iter().map(|s| s.time.clone()).collect();
    let Some((clock, _)) = times.and_then(|times| over_range(&times.concat())) else { return Vec::new() };
    let mut all: Vec<Series> = Vec::new();
    let is_still = |place: Place| matches!(place, Place::Frame(_) | Place::Measurement);
    for candidate in search.candidates.iter().filter(|c| is_still(c.place)) {
        let at = all.iter().position(|series| series.place == candidate.place).unwrap_or_else(|| {
            let curves = smooth(&clock);
            all.push(Series {
                place: candidate.place,
                with: None,
                motions: Vec::new(),
                curves,
                jumps: false,
            });
            all.len() - 1
        });
        for part in candidate.coefficients.iter().flat_map(|c| &c.parts) {
            let motion = (part.slot, part.direction);
            if !all[at].motions.contains(&motion) {
                all[at].motions.push(motion);
            }
        }
    }
    let swift = all.iter().find(|series| series.place == Place::Measurement).map(|readings| Series {
        motions: readings.motions.clone(),
        curves: series(&clock, 1, FINE),
        ..*readings
    });
    all.extend(swift);
    all
}

/// `cos nπx` of what runs from 0 to 1, for these orders: any smooth function.
fn series(x: &[f64], from: usize, to: usize) -> Vec<Vec<f64>> {
    let angles = |n: usize| x.iter().map(|x| n as f64 * PI * x).collect::<Vec<f64>>();
    (from..=to).map(|n| sines_cosines(&angles(n)).1).collect()
}

/// Chebyshev polynomials of what runs from 0 to 1: what is smooth needs few of them, and says something at the ends too.
fn smooth(x: &[f64]) -> Vec<Vec<f64>> {
    let angles: Vec<f64> = x.iter().map(|x| (2.0 * x - 1.0).clamp(-1.0, 1.0).acos() / PI).collect();
    series(&angles, 1, SMOOTH)
}

/// From 0 to 1 over what there is, and how much that is; `None` where it stands still.
fn over_range(x: &[f64]) -> Option<(Vec<f64>, f64)> {
    let low = x.iter().copied().fold(f64::INFINITY, f64::min);
    let range = x.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low;
    (range > 1e-9).then(|| (x.iter().map(|x| (x - low) / range).collect(), range))
}

/// From -1 to 1; `None` where it is nothing throughout.
fn over_largest(x: &[f64]) -> Option<Vec<f64>> {
    let most = x.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    (most > 1e-12 && most.is_finite()).then(|| x.iter().map(|x| x / most).collect())
}

//! The way of one joint through all recordings, and what an error that depends on this joint alone may be,
//! `docs/diagnosis-method.md` (69).

use super::curves::{column, product};
use super::discrepancy::{EARLY, UNKNOWN, longest};
use super::series::{Motion, Series, over_range, series, smooth, unit};
use crate::effects::Place;
use crate::feature::{JointSamples, Samples};
use crate::lie::Twist;
use crate::machine::{Joint, JointKind};
use crate::scalar::sines_cosines;
use crate::variation::Slot;

/// Orders of the series along a joint's travel for its own motion, and for what its guideway or bearing does.
pub(super) const FINE: usize = 40;
const COARSE: usize = 6;
/// The same where it depends on another joint as well.
const CROSSED: usize = 4;
/// What begins at a reversal: the shortest way as part of the range, and how many ways there are, each twice the one before.
const SHORTEST: f64 = 0.0005;
const WAYS: usize = 11;

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
    pub fn of(samples: &'a [Samples], joint: usize, of: &Joint) -> Option<Self> {
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
        (0..3).map(|k| (Slot::Before(self.joint), unit(k))).collect()
    }

    /// What may depend on another joint as well: slow waves of where it stands, and its sine and cosine, as weights on a rotary joint have them.
    pub fn crossing(&self) -> Vec<Vec<f64>> {
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

    /// What is left, until the joint first turns round in a recording, of what was there before: in those recordings where that lasts longest.
    fn before(&self) -> Vec<Vec<f64>> {
        let early = |recording: &Samples| -> usize {
            let since = recording.joints[self.joint].as_ref().map(|columns| &columns.since_reversal);
            since.map_or(0, |since| since.iter().take_while(|since| **since >= UNKNOWN).count())
        };
        let mut curves = Vec::new();
        for at in longest(&self.samples.iter().map(early).collect::<Vec<usize>>()) {
            let recording = &self.samples[at];
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
    pub fn series(&self) -> Vec<Series> {
        let slot = match self.kind {
            JointKind::Revolute => Slot::Before(self.joint),
            JointKind::Prismatic => Slot::After(self.joint),
        };
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

/// From -1 to 1; `None` where it is nothing throughout.
fn over_largest(x: &[f64]) -> Option<Vec<f64>> {
    let most = x.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    (most > 1e-12 && most.is_finite()).then(|| x.iter().map(|x| x / most).collect())
}

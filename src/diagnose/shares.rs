//! What belongs to the shape of the effects that were found, and what is an effect of its own.

use nalgebra::DMatrix;

use super::discrepancy;
use super::leftover::Leftover;
use super::marginal::Marginal;
use super::policy::Rule;
use super::search::Search;
use super::terms::{Hypothesis, ModelTerm, side_by_side};
use crate::effects::Place;
use crate::feature::Feature;

/// Part of an effect's energy by which its shape may depart from the family's, seen at its own place and anywhere else.
const OWN_DISCREPANCY: f64 = 0.004;
const OTHER_DISCREPANCY: f64 = 0.002;
/// The same of a train of waves along the travel, seen as another function of where its joint stands: gears mesh harder on one side.
const SWELL: f64 = 0.02;
/// So many periods are a train.
const TRAIN: f64 = 6.0;
/// A tone is heard in the edges of every other shape, and one course over time in another.
const CLOCK_DISCREPANCY: f64 = 0.01;
/// A second line of the same family at the same place takes away at least this part of what the first does.
const REPEATED: f64 = 0.15;
/// What takes away this part of what shapes take up and leave beside a curve is no shape of it.
const ALL: f64 = 0.9;
/// The shapes of what was found may make up this part of all; less, by a root, the more names share it.
const DISCREPANCY: f64 = 0.35;

/// Where nothing tells how far they depart, they are expected to by this part of what the search allows them.
const UNKNOWN_DISCREPANCY: f64 = 0.04;
/// Median of what is normal with mean zero and may not be negative, in standard deviations.
const MEDIAN: f64 = 0.674;

/// Along a path, where everything shows its shape, it is no more than this part in effects that have their right name, and this many
/// standard deviations of chance.
const UNLIKE: f64 = 0.1;
const CHANCE: f64 = 3.0;
/// What leaves this part of all beside curves over time jumps.
const JUMPS: f64 = 0.02;

/// So many functions of where a joint stands may be found at one joint.
const PATCHES: usize = 2;

/// Where the energy goes that constant geometry leaves over, in units of the noise's variance.
pub(super) struct Shares {
    /// With the effects as their families say.
    pub names: f64,
    /// With the freedom of their shapes.
    pub discrepancies: f64,
    /// With nothing.
    pub left: Leftover,
    /// What of the shapes is the course of a drift that may take any.
    free: f64,
    /// How many parameters the shapes have.
    freedom: f64,
}

impl Shares {
    /// All of it that stands out from noise.
    pub fn total(&self) -> f64 {
        (self.names + self.discrepancies + self.left.energy).max(1e-300)
    }

    /// Part of what shapes may depart from the families' by which they do: what they seem to, or what chance hides of it as likely as not.
    pub fn departure(&self) -> f64 {
        let hidden = MEDIAN * self.left.overdispersion * (2.0 * self.freedom).sqrt();
        (self.discrepancies / self.total())
            .sqrt()
            .max((hidden / self.total()).sqrt().min(UNKNOWN_DISCREPANCY))
    }

    /// Whether the shapes depart so far from the families' that the names are wrong.
    pub fn is_discrepant(&self, effects: usize) -> bool {
        let several = effects.max(2) - 1;
        self.discrepancies > DISCREPANCY * self.total() / (several as f64).sqrt()
    }

    /// Whether the shapes depart farther from the families' than those of a right name do. No law says what course an instrument's drift
    /// takes, but it is smooth: its shape leaves next to nothing.
    pub fn is_unlike(&self) -> bool {
        let free = if self.left.energy < JUMPS * self.total() { self.free } else { 0.0 };
        self.discrepancies - free
            > UNLIKE * self.total() + CHANCE * self.left.overdispersion * (2.0 * self.freedom).sqrt()
    }
}

impl Search<'_> {
    /// What becomes of the energy that geometry leaves over, what chance would take not counted.
    pub fn shares(&self, in_model: &[ModelTerm]) -> Shares {
        let (names, full) = (self.beside_names(in_model), self.beside(in_model, None));
        let energy = |marginal: &Marginal| self.rows.residual.dot(&marginal.apply(&self.rows.residual));
        let taken = |from: &Marginal, to: &Marginal| {
            (energy(from) - energy(to) - (to.parameters() - from.parameters())).max(0.0)
        };
        let drifts =
            in_model.iter().filter(|effect| discrepancy::is_drift(&self.candidates[effect.candidate]));
        let courses: Vec<&DMatrix<f64>> = drifts.map(|effect| &effect.discrepancy).collect();
        let free = match courses.is_empty() {
            true => 0.0,
            false => taken(&names, &names.with(&side_by_side(&courses, self.rows.residual.len()))),
        };
        Shares {
            names: taken(&self.reference(in_model), &names),
            discrepancies: taken(&names, &full),
            free,
            left: self.leftover(&full),
            freedom: full.parameters() - names.parameters(),
        }
    }

    /// Whether it is a wave in time: noise whose colour is not quite known has many.
    pub fn is_tone(&self, candidate: usize) -> bool {
        self.candidates[candidate].features.iter().any(|f| f.needs_time() && f.wave().is_some())
    }

    /// Whether it happens at one moment of the recordings, or from one sample on.
    pub fn is_event(&self, candidate: usize) -> bool {
        let candidate = &self.candidates[candidate];
        candidate.jumps() && candidate.features.iter().any(Feature::needs_moment)
    }

    /// A joint at which more effects than that are functions of where it stands: each a patch of a curve that has no name. Waves of
    /// whole orders count as one.
    pub fn patched(&self, in_model: &[ModelTerm]) -> Option<Place> {
        let of_position: Vec<(Place, bool)> = (in_model.iter())
            .map(|effect| (&self.candidates[effect.candidate], &effect.score.parameters))
            .filter(|(candidate, _)| discrepancy::is_of_position(candidate))
            .map(|(candidate, at)| (candidate.place, discrepancy::order(self.rows, candidate, at).is_some()))
            .collect();
        let patches = |place: &Place| {
            let here = || of_position.iter().filter(|(at, _)| at == place);
            let others = here().filter(|(_, is_order)| !is_order).count();
            others + usize::from(here().any(|(_, is_order)| *is_order))
        };
        of_position.iter().map(|(place, _)| *place).find(|place| patches(place) > PATCHES)
    }

    /// Whether two candidates are forms of one effect at one place.
    pub fn is_form(&self, a: usize, b: usize) -> bool {
        let (a, b) = (&self.candidates[a], &self.candidates[b]);
        a.told_as == b.told_as && a.place == b.place
    }

    /// Whether two candidates are orders of one error motion.
    pub fn is_one(&self, a: usize, b: usize) -> bool {
        self.is_form(a, b) && self.candidates[a].as_one && self.candidates[b].as_one
    }

    /// Whether it is little beside what was found already at its place and has its name, or is another shape along the travel where
    /// a curve was found: that is its shape, unless along a path it alone is all that the curve does not say.
    pub fn repeats(&self, hypothesis: &Hypothesis, in_model: &[ModelTerm]) -> bool {
        let of = |candidate: usize| (&self.candidates[candidate].effect, self.candidates[candidate].place);
        let is_alike = |a: &ModelTerm| of(a.candidate) == of(hypothesis.candidate);
        let is_of_curve = |a: &ModelTerm| {
            discrepancy::is_of_curve(&self.candidates[a.candidate], &self.candidates[hypothesis.candidate])
        };
        let is_all = || {
            let shares = self.shares(in_model);
            2.0 * hypothesis.score.gain > ALL * (shares.discrepancies + shares.left.energy)
        };
        let mut small = in_model.iter().filter(|a| hypothesis.score.gain < REPEATED * a.score.gain);
        small.any(|a| {
            is_alike(a) && Rule::Repeats.decides()
                || is_of_curve(a) && !(self.in_motion && is_all()) && Rule::RepeatsCurve.decides()
        })
    }

    /// Whether it changes with time, whatever the axes do.
    pub fn goes_by_clock(&self, candidate: usize) -> bool {
        self.candidates[candidate].features.iter().any(Feature::needs_moment)
    }

    /// Whether it may be the course over time of what was found: of two courses the smaller one is the other one's shape.
    pub fn is_of_course(&self, hypothesis: &Hypothesis, in_model: &[ModelTerm]) -> bool {
        let is_course = |a: &ModelTerm| {
            self.goes_by_clock(a.candidate) && hypothesis.score.gain < DISCREPANCY * a.score.gain
        };
        self.goes_by_clock(hypothesis.candidate)
            && in_model.iter().any(is_course)
            && Rule::OneCourse.decides()
    }

    /// Whether an effect is a wave of a whole order, which comes back with every turn, and the hypothesis depends on where the same joint stands
    /// and does not, or has fewer waves a turn: then it is no shape of that wave.
    fn is_no_discrepancy(&self, hypothesis: &Hypothesis, effect: &ModelTerm) -> bool {
        let order =
            |candidate: usize, at: &[f64]| discrepancy::order(self.rows, &self.candidates[candidate], at);
        let place = |candidate: usize| self.candidates[candidate].place;
        if place(hypothesis.candidate) != place(effect.candidate)
            || !discrepancy::is_of_position(&self.candidates[hypothesis.candidate])
        {
            return false;
        }
        let Some(of) = order(effect.candidate, &effect.score.parameters) else { return false };
        let own = order(hypothesis.candidate, &hypothesis.score.parameters);
        own.is_none_or(|own| own.round() % of.round() != 0.0)
    }

    /// Whether an effect is a train of waves along the travel, and the hypothesis another function of where the same joint stands.
    fn is_swell(&self, hypothesis: &Hypothesis, effect: &ModelTerm) -> bool {
        let (own, other) = (&self.candidates[effect.candidate], &self.candidates[hypothesis.candidate]);
        discrepancy::is_along_travel(other)
            && discrepancy::periods(self.rows, own, &effect.score.parameters) >= TRAIN
    }

    /// Half the energy that what was found may leave over because its shape departs from the family's: more at the same place and where
    /// both go by the clock.
    pub fn discrepancy_error(&self, hypothesis: &Hypothesis, in_model: &[ModelTerm]) -> f64 {
        let place = |candidate: usize| self.candidates[candidate].place.dyad();
        let timed = |candidate: usize| self.goes_by_clock(candidate);
        let share = |effect: &ModelTerm| {
            let is_here = place(effect.candidate) == place(hypothesis.candidate);
            if is_here && self.is_swell(hypothesis, effect) && Rule::TrainsSwell.decides() {
                SWELL
            } else if self.is_no_discrepancy(hypothesis, effect) && Rule::OrdersHaveNoShape.decides() {
                0.0
            } else if is_here {
                OWN_DISCREPANCY
            } else if self.is_tone(hypothesis.candidate)
                || timed(effect.candidate) && timed(hypothesis.candidate)
            {
                CLOCK_DISCREPANCY
            } else {
                OTHER_DISCREPANCY
            }
        };
        in_model.iter().map(|effect| share(effect) * effect.score.gain).sum()
    }
}

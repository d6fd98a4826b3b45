//! What a search for effects looks at: rows, candidates, what constant geometry leaves, and what is known so far.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::DMatrix;

use super::leftover::{Leftover, measure};
use super::marginal::Marginal;
use super::policy::Rule;
use super::score::Rows;
use super::terms::{Hypothesis, Mark, ModelTerm, all_but, side_by_side};
use crate::effects::{Candidate, Place};

pub(super) struct Search<'a> {
    pub rows: &'a Rows<'a>,
    pub runs: &'a [Vec<usize>],
    pub base: Marginal,
    pub candidates: &'a [Candidate],
    /// Logarithm of what is expected of each candidate beforehand.
    pub priors: Vec<f64>,
    /// Logarithm of how often its family is met at all, 0 for all that are common.
    pub commonness: Vec<f64>,
    pub progress: &'a Tell,
    /// By how much chance counts as larger than the noise says.
    pub overdispersion: f64,
    /// Whether the recordings follow a path; else they are settled positions, of which the side of approach is known.
    pub in_motion: bool,
    /// Hypotheses that are known, by what has been taken in besides.
    pub known: Mutex<Known>,
    /// The last spaces that candidates were judged beside, by what had been taken in, and whether that was by names alone.
    pub grounds: Mutex<VecDeque<(Ground, Arc<Marginal>)>>,
}

/// Takes what is told of the progress, from any thread.
pub(super) type Tell = dyn Fn(&str) + Sync;

/// What had been taken in, and whether it stands for its names alone.
pub(super) type Ground = (Vec<Mark>, bool);

/// Hypotheses by the effect that stood aside, by those that were taken in, and by whether these stand for their names alone.
pub(super) type Known = HashMap<(Option<usize>, Vec<Mark>, bool), Arc<Vec<Hypothesis>>>;

/// Effects of more energy (half of it) than this show their shape.
pub(super) const LARGE: f64 = 300.0;
/// What leaves so much more than the noise, as part of it, anybody would see.
pub(super) const VISIBLE: f64 = 0.02;
/// Fewer rows show no shape and foretell nothing.
pub(super) const MANY: usize = 500;
/// So many spaces are kept.
const GROUNDS: usize = 12;
/// More effects are not looked for: among settled positions many joints give way at once, and where fewer are looked for the weakest one has no
/// place beside what is new; what takes more names in a motion has none.
const MOST: usize = 10;
const MOST_IN_MOTION: usize = 5;
/// Logarithm of the odds at which an effect is taken in.
pub(super) const ENTER: f64 = 8.0;

/// How likely each candidate is beforehand, as a logarithm.
pub(super) fn priors(candidates: &[Candidate]) -> Vec<f64> {
    let total: f64 = candidates.iter().map(|c| c.often).sum();
    candidates.iter().map(|c| (c.often / total).ln()).collect()
}

impl Search<'_> {
    /// A hypothesis where chance is larger than what it was searched with.
    pub fn tempered(&self, hypothesis: &Hypothesis, overdispersion: f64) -> Hypothesis {
        let overdispersion = (overdispersion / self.overdispersion).max(1.0);
        let prior = self.priors[hypothesis.candidate];
        Hypothesis { weight: prior + (hypothesis.weight - prior) / overdispersion, ..hypothesis.clone() }
    }

    /// Columns of what every model has, m and rad, but for drives that these effects name: what these say of them is theirs.
    pub fn always(&self, in_model: &[ModelTerm]) -> DMatrix<f64> {
        self.rows.always(self.names(in_model))
    }

    /// The marginal beside that.
    pub fn reference(&self, in_model: &[ModelTerm]) -> Marginal {
        match self.rows.drives().is_any(self.names(in_model)) {
            true => self.rows.base_but(self.names(in_model)),
            false => self.base.clone(),
        }
    }

    /// Whether one of these effects has this name and place.
    fn names(&self, in_model: &[ModelTerm]) -> impl Fn(&str, Place) -> bool {
        let named = in_model.iter().map(|effect| &self.candidates[effect.candidate]);
        move |effect, place| named.clone().any(|own| own.effect == effect && own.place == place)
    }

    /// The marginal beside all effects in the model but one.
    pub fn beside(&self, in_model: &[ModelTerm], but: Option<usize>) -> Marginal {
        let others = in_model.iter().enumerate().filter(|(i, _)| Some(*i) != but);
        let parts: Vec<&DMatrix<f64>> =
            others.flat_map(|(_, e)| [&e.columns, &e.initial, &e.discrepancy]).collect();
        self.base.with(&side_by_side(&parts, self.rows.residual.len()))
    }

    /// The marginal beside all effects in the model but one, their shapes as the families' where they would depart too far: what is hidden there
    /// is another effect, or unexplained.
    pub(super) fn ground(&self, in_model: &[ModelTerm], but: Option<usize>) -> Arc<Marginal> {
        let others = all_but(in_model, but);
        let hidden = but.is_some_and(|i| in_model[i].hidden);
        let marks = (others.iter().map(ModelTerm::mark).collect(), hidden);
        let grounds = || self.grounds.lock().unwrap_or_else(PoisonError::into_inner);
        let before = grounds().iter().find(|(of, _)| *of == marks).map(|(_, known)| known.clone());
        if let Some(known) = before {
            return known;
        }
        let is_discrepant = |others: &[ModelTerm]| {
            self.shares(others).is_discrepant(others.len()) && Rule::BesideNames.decides()
        };
        let ground = Arc::new(match hidden || !others.is_empty() && is_discrepant(&others) {
            true => self.beside_names(&others),
            false => self.beside(&others, None),
        });
        let mut grounds = grounds();
        grounds.push_front((marks, ground.clone()));
        grounds.truncate(GROUNDS);
        ground
    }

    /// The marginal beside the names alone, as if their shapes were the families'.
    pub fn beside_names(&self, in_model: &[ModelTerm]) -> Marginal {
        let parts: Vec<&DMatrix<f64>> = in_model.iter().flat_map(|e| [&e.columns, &e.initial]).collect();
        self.base.with(&side_by_side(&parts, self.rows.residual.len()))
    }

    /// Logarithm of the evidence of all effects in the model together, with what they were before and their shapes.
    pub fn worth(&self, in_model: &[ModelTerm]) -> f64 {
        let parts: Vec<&DMatrix<f64>> =
            in_model.iter().flat_map(|e| [&e.columns, &e.initial, &e.discrepancy]).collect();
        let left = self.base.apply(&self.rows.residual);
        self.base.worth(&side_by_side(&parts, left.len()), &left, self.overdispersion)
    }

    /// What is left beside the effects in the model.
    pub fn leftover(&self, marginal: &Marginal) -> Leftover {
        let left = marginal.apply(&self.rows.residual);
        measure(left.as_slice(), self.runs, &self.rows.whitener.out)
    }

    /// The same rows where no drive gives way but those that are asked for.
    pub fn rigid<'b>(&'b self, rows: &'b Rows<'b>) -> Search<'b> {
        Search { rows, base: rows.base(), ..self.against(self.overdispersion) }
    }

    /// The same where chance counts as so much larger than the noise says.
    pub fn against(&self, overdispersion: f64) -> Search<'_> {
        Search {
            overdispersion,
            base: self.base.clone(),
            priors: self.priors.clone(),
            commonness: self.commonness.clone(),
            known: Mutex::default(),
            grounds: Mutex::default(),
            ..*self
        }
    }

    /// How many effects are looked for at most.
    pub fn most(&self) -> usize {
        if self.in_motion { MOST_IN_MOTION } else { MOST }
    }
}

impl ModelTerm {
    /// Its columns as they are, m and rad; `None` where a feature is not there.
    pub fn raw(&self, search: &Search) -> Option<DMatrix<f64>> {
        let raw = search.rows.raw(&search.candidates[self.candidate], &self.score.parameters)?;
        Some(raw.columns(0, self.columns.ncols()) * self.score.room)
    }

    /// Standard deviations of the priors of its coefficients, SI.
    pub fn scales(&self, search: &Search) -> Vec<f64> {
        let units = search.rows.units(&search.candidates[self.candidate], &self.score.parameters);
        units.iter().map(|unit| self.score.room * unit).collect()
    }
}

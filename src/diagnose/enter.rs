//! Effects taken in: their columns, their initial conditions and discrepancies, and their coefficients.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::beside::Beside;
use super::discrepancy;
use super::equations::{Equations, Score};
use super::evidence::likely_part;
use super::marginal::{Marginal, solved};
use super::refine::refine;
use super::search::Search;
use super::terms::{Hypothesis, ModelTerm};
use crate::effects::Candidate;
use crate::feature::Feature;

/// Parameters are others beside unknown initial conditions where that brings so much, as a logarithm.
const MOVED: f64 = 3.0;

impl Search<'_> {
    /// Takes a hypothesis in, at its best point beside what nobody knows of how it was before: a hysteresis is found with another length of
    /// take-up where the way before the first reversal is wrong.
    pub(super) fn settle(&self, hypothesis: &Hypothesis, marginal: &Arc<Marginal>) -> Option<ModelTerm> {
        let entered = self.enter(hypothesis, marginal)?;
        let candidate = &self.candidates[hypothesis.candidate];
        if entered.initial.ncols() == 0 || candidate.parameters.iter().all(|p| p.whole) {
            return Some(entered);
        }
        let beside = self.rows.field(marginal.with(&entered.initial));
        let score =
            self.rows.score_at(candidate, &hypothesis.score.parameters, &beside, self.overdispersion)?;
        let start = Hypothesis::new(hypothesis.candidate, score.evidence, score);
        let moved = refine(self.rows, candidate, &start, &beside, self.overdispersion);
        if moved.score.at_best < start.score.at_best + MOVED {
            return Some(entered);
        }
        let score = self.rows.score_at(
            candidate,
            &moved.score.parameters,
            &self.rows.field(marginal.clone()),
            self.overdispersion,
        )?;
        self.enter(
            &Hypothesis {
                score: Score { evidence: hypothesis.score.evidence, ..score },
                ..hypothesis.clone()
            },
            marginal,
        )
    }

    /// Takes a hypothesis in, at its best point.
    pub fn enter(&self, hypothesis: &Hypothesis, marginal: &Marginal) -> Option<ModelTerm> {
        let candidate = &self.candidates[hypothesis.candidate];
        let white = self.rows.of(candidate, &hypothesis.score.parameters)?;
        let left = marginal.apply(&self.rows.residual);
        let mut effect = self.enter_directed(hypothesis, &white, (marginal, &left))?;
        effect.initial = self.initial_of(&effect);
        effect.discrepancy = self.shape_of(&effect);
        Some(effect)
    }

    /// The same without initial conditions and discrepancy.
    pub fn enter_bare(&self, hypothesis: &Hypothesis, marginal: &Marginal) -> Option<ModelTerm> {
        let candidate = &self.candidates[hypothesis.candidate];
        let white = self.rows.of(candidate, &hypothesis.score.parameters)?;
        let left = marginal.apply(&self.rows.residual);
        self.enter_as(candidate, hypothesis, &white, (marginal, &left))
    }

    /// The same where many directions of what has a memory are mixed as they are found where each of them may have been anything beforehand.
    /// `white`: the candidate's columns, `left`: what the marginal leaves of the residuals.
    pub(super) fn enter_directed(
        &self,
        hypothesis: &Hypothesis,
        white: &DMatrix<f64>,
        (marginal, left): (&Marginal, &DVector<f64>),
    ) -> Option<ModelTerm> {
        let candidate = &self.candidates[hypothesis.candidate];
        let mut effect = self.enter_as(candidate, hypothesis, white, (marginal, left))?;
        if self.in_motion && candidate.features.iter().any(Feature::needs_history) {
            let each = discrepancy::each_answer(self.rows, candidate, &effect);
            if each.len() > discrepancy::MOST_DIRECTIONS {
                let anything = discrepancy::initial_conditions(self.rows, candidate, &effect, each).white;
                let both = Beside::new(&[&anything, &effect.columns], marginal, left);
                let Equations { gram, toward, .. } = both.seen(1).others().last();
                effect.solution = solved(gram, &toward)?;
            }
        }
        Some(effect)
    }

    /// The same as another candidate than the hypothesis's own, and as it stands there.
    pub(super) fn enter_as(
        &self,
        candidate: &Candidate,
        hypothesis: &Hypothesis,
        white: &DMatrix<f64>,
        (marginal, left): (&Marginal, &DVector<f64>),
    ) -> Option<ModelTerm> {
        debug_assert_eq!(white.ncols(), candidate.coefficients.len());
        let mut score = hypothesis.score.clone();
        let mut columns = white.columns(0, score.coefficients) * score.room;
        let (mut gram, mut toward) = self.normal_beside(&columns, marginal, left);
        if score.coefficients > 1 {
            let part = likely_part(&gram, &toward, self.overdispersion);
            score.room *= part;
            columns *= part;
            gram *= part * part;
            toward *= part;
        }
        let solution = solved(gram, &toward)?;
        let none = DMatrix::zeros(columns.nrows(), 0);
        let (initial, discrepancy) = (none.clone(), none);
        Some(ModelTerm {
            candidate: hypothesis.candidate,
            score,
            columns,
            solution,
            initial,
            discrepancy,
            near: Vec::new(),
            hidden: false,
        })
    }

    /// An effect as it stands, whitened by the noise of this search.
    pub fn anew(&self, effect: &ModelTerm) -> ModelTerm {
        let Some(mut columns) = effect.raw(self) else { return effect.clone() };
        self.rows.whiten(&mut columns);
        let (gram, toward) = self.normal(&columns, &self.base);
        let solution = solved(gram, &toward).unwrap_or_else(|| effect.solution.clone());
        let mut anew = ModelTerm { columns, solution, ..effect.clone() };
        anew.initial = self.initial_of(&anew);
        anew.discrepancy = self.shape_of(&anew);
        anew
    }

    /// Columns of what an effect was before anybody looked.
    pub fn initial_of(&self, effect: &ModelTerm) -> DMatrix<f64> {
        self.initial_conditions_of(effect)
            .map_or_else(|| DMatrix::zeros(effect.columns.nrows(), 0), |initial| initial.white)
    }

    /// The same, with what they are made of; `None` among settled positions, where every side of approach is known.
    pub fn initial_conditions_of(&self, effect: &ModelTerm) -> Option<discrepancy::Columns> {
        let candidate = &self.candidates[effect.candidate];
        let answers = || discrepancy::answers(self.rows, candidate, effect);
        self.in_motion
            .then(|| discrepancy::initial_conditions(self.rows, candidate, effect, answers()).mixed())
    }

    /// Columns by which the shape of an effect may depart from its family's.
    fn shape_of(&self, effect: &ModelTerm) -> DMatrix<f64> {
        let candidate = &self.candidates[effect.candidate];
        let answers = discrepancy::answers(self.rows, candidate, effect);
        discrepancy::shape(self.rows, candidate, effect, answers, true).mixed().white
    }

    /// Gram matrix of columns beside a marginal, and what leads from them to the residuals.
    pub(super) fn normal(&self, columns: &DMatrix<f64>, marginal: &Marginal) -> (DMatrix<f64>, DVector<f64>) {
        self.normal_beside(columns, marginal, &marginal.apply(&self.rows.residual))
    }

    /// The same; `left`: what the marginal leaves of the residuals.
    fn normal_beside(
        &self,
        columns: &DMatrix<f64>,
        marginal: &Marginal,
        left: &DVector<f64>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let along = marginal.along(&columns.as_view());
        (columns.tr_mul(columns) - along.tr_mul(&along), columns.tr_mul(left))
    }
}

//! Which effects together explain the recordings best: forward, backward, swaps, each against all candidates.

use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::contained::prefer_simpler;
use super::folds;
use super::leftover::{Leftover, measure};
use super::marginal::Marginal;
use super::refine::refine;
use super::score::{Rows, Score};
use super::shares::Shares;
use crate::effects::Candidate;

/// An effect that has been taken in.
#[derive(Clone)]
pub(super) struct ModelTerm {
    /// Index of the candidate.
    pub candidate: usize,
    pub score: Score,
    /// Whitened columns, each times the size that its coefficient may have.
    pub columns: DMatrix<f64>,
    /// Its coefficients, in units of the columns.
    pub solution: DVector<f64>,
    /// Whitened columns of what it may have been before anybody looked.
    pub state: DMatrix<f64>,
    /// Whitened columns by which its shape may depart from the family's.
    pub shape: DMatrix<f64>,
    /// Candidates that might take its place.
    pub near: Vec<usize>,
    /// Whether it had been taken for the shape of the others, and so is judged beside their names alone.
    pub hidden: bool,
}

impl ModelTerm {
    fn mark(&self) -> Mark {
        let parameters = self.score.parameters.iter().map(|x| x.to_bits()).collect();
        (self.candidate, self.score.coefficients, parameters)
    }

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

    /// With a shape that is quite the family's.
    pub(super) fn without_shape(&self) -> ModelTerm {
        ModelTerm { shape: DMatrix::zeros(self.columns.nrows(), 0), ..self.clone() }
    }

    /// In the place of another.
    pub(super) fn instead_of(self, other: &ModelTerm) -> ModelTerm {
        ModelTerm { near: other.near.clone(), hidden: other.hidden, ..self }
    }
}

/// A candidate that competes for one finding, and its weight.
#[derive(Clone, Debug)]
pub(super) struct Hypothesis {
    pub candidate: usize,
    /// Logarithm of evidence and prior together.
    pub weight: f64,
    pub score: Score,
    /// Half the misfit energy that it takes away with what nobody knows of how it was before.
    pub reach: f64,
}

impl Hypothesis {
    pub fn new(candidate: usize, weight: f64, score: Score) -> Self {
        Hypothesis { candidate, weight, reach: score.gain, score }
    }
}

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

/// What tells an effect that has been taken in: candidate, coefficients and parameters.
pub(super) type Mark = (usize, usize, Vec<u64>);

/// So many candidates that came next to an effect are compared with it again and again.
pub(super) const NEAR: usize = 40;
/// Candidates with this part of the best one's weight come into question, and at most so many.
const CLOSE: f64 = 0.6;
const REFINED: usize = 8;
/// Effects of more energy (half of it) than this show their shape; of hypotheses with this part of the best one's, so many are looked at.
pub(super) const LARGE: f64 = 300.0;
const SIMILAR: f64 = 0.8;
const SHAPED: usize = 8;
/// What comes within this part of the best one's energy is a matter of shape, and the more common name is to be preferred.
const UNKNOWN_SHAPE: f64 = 0.002;
/// So is the one that needs less of a shape of its own: the whole slack is lost by one that owes this part of the energy to it.
const BENT: f64 = 0.05;
/// But not where it leaves so much more than the noise, as part of it, that anybody would see.
pub(super) const VISIBLE: f64 = 0.02;
/// Fewer rows show no shape and foretell nothing.
pub(super) const MANY: usize = 500;
/// An effect that takes away less than this part of the structure that is left is a poor name for it.
const WORTH: f64 = 0.2;
/// The same among settled positions, where many joints give way a little each.
const WORTH_SETTLED: f64 = 0.08;
/// An effect that was taken for the shape of another is at least this part of it; it is looked for where shapes are this part of all.
const HIDDEN: f64 = 0.8;
const ODD: f64 = 0.12;
/// So many spaces are kept.
const GROUNDS: usize = 12;
/// More effects are not looked for: among settled positions many joints give way at once; what takes more names in a motion has none.
const MOST: usize = 8;
const MOST_IN_MOTION: usize = 5;
/// Logarithm of the odds at which an effect is taken in.
pub(super) const ENTER: f64 = 8.0;

impl Search<'_> {
    /// Evidence of every candidate beside the effects in the model, better first.
    pub fn hypotheses(&self, in_model: &[ModelTerm]) -> Arc<Vec<Hypothesis>> {
        self.known_or(in_model, None, None)
    }

    /// Evidence of those that might take the place of effect `i`, beside all others.
    pub fn rivals_of(&self, in_model: &[ModelTerm], i: usize) -> Arc<Vec<Hypothesis>> {
        self.known_or(in_model, Some(i), Some(&in_model[i].near))
    }

    fn known_or(
        &self,
        in_model: &[ModelTerm],
        but: Option<usize>,
        among: Option<&[usize]>,
    ) -> Arc<Vec<Hypothesis>> {
        let others = in_model.iter().enumerate().filter(|(i, _)| Some(*i) != but);
        let mut marks: Vec<Mark> = others.map(|(_, effect)| effect.mark()).collect();
        marks.sort();
        let (of, hidden) = (but.map(|i| in_model[i].candidate), but.is_some_and(|i| in_model[i].hidden));
        let key = |of: Option<usize>| (of, marks.clone(), hidden);
        // Never held while other work is done: a thread may take another's up meanwhile.
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let before = {
            let known = known();
            known.get(&key(None)).or_else(|| known.get(&key(of))).cloned()
        };
        before.unwrap_or_else(|| {
            let hypotheses = Arc::new(self.compare(self.ground(in_model, but), among));
            known().insert(key(among.and(of)), hypotheses.clone());
            hypotheses
        })
    }

    pub(super) fn compare(&self, marginal: Arc<Marginal>, among: Option<&[usize]>) -> Vec<Hypothesis> {
        let field = self.rows.field(marginal);
        let (rows, priors, candidates, overdispersion) =
            (self.rows, &self.priors, self.candidates, self.overdispersion);
        let all: Vec<usize> = among.map_or_else(|| (0..candidates.len()).collect(), <[usize]>::to_vec);
        let mut hypotheses: Vec<Hypothesis> = (all.into_par_iter())
            .filter_map(|i| {
                let score = rows.screen(i, &candidates[i], &field, overdispersion)?;
                Some(Hypothesis::new(i, score.evidence + priors[i], score))
            })
            .collect();
        let better_first = |a: &Hypothesis, b: &Hypothesis| b.weight.total_cmp(&a.weight);
        hypotheses.sort_by(better_first);
        self.bring_up(&mut hypotheses, &field);
        // Between the points of its grid a candidate may be much better: those that come into question are refined.
        let near = hypotheses.iter().map(|r| r.weight).fold(0.0, f64::max) * CLOSE;
        let is_close = |r: &Hypothesis| r.weight > 0.0 && (r.weight >= near || r.reach > r.score.gain);
        let close = hypotheses.iter().take_while(|r| is_close(r)).count().min(REFINED);
        let refined: Vec<Hypothesis> = hypotheses[..close]
            .par_iter()
            .map(|r| refine(rows, &candidates[r.candidate], r, &field, overdispersion))
            .collect();
        hypotheses.splice(..close, refined);
        hypotheses[..close].sort_by(better_first);
        // No play is quite a step: what explains nearly as much may do so better once its shape may depart a little from the family's.
        let most = hypotheses[..close].iter().map(|r| r.reach / overdispersion).fold(0.0, f64::max);
        if most > LARGE && rows.whitener.count() > MANY {
            let alike: Vec<usize> = (0..close)
                .filter(|i| hypotheses[*i].reach / overdispersion > SIMILAR * most)
                .take(SHAPED)
                .collect();
            let weights: Vec<f64> =
                alike.par_iter().map(|i| self.with_shape(&hypotheses[*i], &field)).collect();
            alike.iter().zip(weights).for_each(|(i, weight)| hypotheses[*i].weight = weight);
            let slack = (UNKNOWN_SHAPE * most).min(VISIBLE * rows.whitener.count() as f64 / overdispersion);
            for hypothesis in &mut hypotheses[..close] {
                let bent = ((most - hypothesis.reach / overdispersion) / (BENT * most)).clamp(0.0, 1.0);
                hypothesis.weight += slack * (self.commonness[hypothesis.candidate] - bent);
            }
            hypotheses.sort_by(better_first);
        }
        prefer_simpler(self, &mut hypotheses, close, &field.marginal);
        hypotheses.sort_by(better_first);
        self.likeliest_name_first(&mut hypotheses);
        hypotheses
    }

    /// A name is as likely as all its forms at its place together: the best form of the likeliest one comes first.
    fn likeliest_name_first(&self, hypotheses: &mut [Hypothesis]) {
        let Some(most) = hypotheses.first().map(|best| best.weight) else { return };
        let mut names: Vec<(usize, f64)> = Vec::new();
        for (i, r) in hypotheses.iter().enumerate() {
            let weight = (r.weight - most).exp();
            match names.iter_mut().find(|(first, _)| self.is_form(hypotheses[*first].candidate, r.candidate))
            {
                Some((_, sum)) => *sum += weight,
                // One that is less than a thousandth as likely does not become the likeliest by its forms.
                None if weight > 1e-3 => names.push((i, weight)),
                None => {}
            }
        }
        // The earlier of two that are as likely.
        let likeliest = names.into_iter().rev().max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((i, _)) = likeliest {
            hypotheses[..=i].rotate_right(1);
        }
    }

    /// A hypothesis where chance is larger than what it was searched with.
    pub fn tempered(&self, hypothesis: &Hypothesis, overdispersion: f64) -> Hypothesis {
        let overdispersion = (overdispersion / self.overdispersion).max(1.0);
        let prior = self.priors[hypothesis.candidate];
        Hypothesis { weight: prior + (hypothesis.weight - prior) / overdispersion, ..hypothesis.clone() }
    }

    /// The marginal beside all effects in the model but one.
    pub fn beside(&self, in_model: &[ModelTerm], but: Option<usize>) -> Marginal {
        let others = in_model.iter().enumerate().filter(|(i, _)| Some(*i) != but);
        let parts: Vec<&DMatrix<f64>> = others.flat_map(|(_, e)| [&e.columns, &e.state, &e.shape]).collect();
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
        let is_misshapen = |others: &[ModelTerm]| self.shares(others).is_misshapen(others.len());
        let ground = Arc::new(match hidden || !others.is_empty() && is_misshapen(&others) {
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
        let parts: Vec<&DMatrix<f64>> = in_model.iter().flat_map(|e| [&e.columns, &e.state]).collect();
        self.base.with(&side_by_side(&parts, self.rows.residual.len()))
    }

    /// Logarithm of the evidence of all effects in the model together, with what they were before and their shapes.
    pub fn worth(&self, in_model: &[ModelTerm]) -> f64 {
        let parts: Vec<&DMatrix<f64>> =
            in_model.iter().flat_map(|e| [&e.columns, &e.state, &e.shape]).collect();
        let left = self.base.apply(&self.rows.residual);
        self.base.worth(&side_by_side(&parts, left.len()), &left, self.overdispersion)
    }

    /// What is left beside the effects in the model.
    pub fn leftover(&self, marginal: &Marginal) -> Leftover {
        let left = marginal.apply(&self.rows.residual);
        measure(left.as_slice(), self.runs, &self.rows.whitener.out)
    }

    /// Forward with full comparison, and after each step every effect against all others in its place.
    ///
    /// A step counts only if its evidence stands out from the structure that it leaves, and if it takes away more than the shape of
    /// what was found before may be off by.
    ///
    /// `from`: what had been found under another noise. `holds`: whether the noise is still what it is searched with; where nothing had been
    /// found and the first effect changes it, everything else is left to the search with the noise that is left. Among settled positions noise
    /// is what is left, and less of it with every effect: there all are judged by the same.
    pub fn run(&self, from: &[ModelTerm], holds: impl Fn(&[ModelTerm]) -> bool) -> Vec<ModelTerm> {
        let mut in_model: Vec<ModelTerm> = Vec::new();
        for effect in from {
            let marginal = self.beside(&in_model, None);
            let (rows, candidate) = (self.rows, &self.candidates[effect.candidate]);
            let Some(score) = rows.score_at(
                candidate,
                &effect.score.parameters,
                &rows.field(marginal.clone()),
                self.overdispersion,
            ) else {
                continue;
            };
            let hypothesis = Hypothesis::new(effect.candidate, score.evidence, score);
            in_model.extend(self.enter(&hypothesis, &marginal).map(|again| again.instead_of(effect)));
        }
        self.swap(&mut in_model);
        let mut tried: HashSet<Vec<usize>> = HashSet::new();
        let (mut sound, mut harmful) = (in_model.clone(), 0);
        while in_model.len() < self.most() {
            // Swaps may throw out what the next step takes in again.
            if !tried.insert(in_model.iter().map(|effect| effect.candidate).collect()) {
                break;
            }
            (self.progress)(&format!("looking for effect {}", in_model.len() + 1));
            let Some(entered) = self.next(&in_model) else { break };
            in_model.push(entered);
            if self.in_motion && from.is_empty() && in_model.len() == 1 && !holds(&in_model) {
                return in_model;
            }
            if in_model.len() > 1 {
                self.swap(&mut in_model);
            }
            // A name that makes stretches worse that were left out is a patch, unless the next one mends it.
            let is_patched = self.rows.whitener.count() > MANY && folds::harmful(self, &in_model).is_some();
            harmful = if is_patched { harmful + 1 } else { 0 };
            match harmful {
                0 => sound.clone_from(&in_model),
                1 => {}
                _ => break,
            }
        }
        self.swap(&mut sound);
        sound
    }

    /// How many effects are looked for at most.
    pub fn most(&self) -> usize {
        if self.in_motion { MOST_IN_MOTION } else { MOST }
    }

    /// The effect to be taken in next: what stands out beside those found, else what was taken for their shape.
    fn next(&self, in_model: &[ModelTerm]) -> Option<ModelTerm> {
        let shares = self.shares(in_model);
        if shares.is_misshapen(in_model.len()) {
            return self.hidden(in_model, &self.hypotheses(in_model), &shares);
        }
        self.beyond(in_model).or_else(|| {
            let is_odd = shares.shapes > ODD * shares.total();
            let ground = || Arc::new(self.beside_names(in_model));
            is_odd.then(|| self.hidden(in_model, &self.compare(ground(), None), &shares)).flatten()
        })
    }

    /// The effect that stands out beside those found and their shapes.
    fn beyond(&self, in_model: &[ModelTerm]) -> Option<ModelTerm> {
        let (hypotheses, marginal) = (self.hypotheses(in_model), self.ground(in_model, None));
        let before = self.leftover(&marginal);
        let best = self.best(&hypotheses, in_model, &before)?;
        let least = if self.in_motion { WORTH } else { WORTH_SETTLED } * before.energy;
        if best.score.gain < self.shape_error(best, in_model) || 2.0 * best.score.gain < least {
            return None;
        }
        self.entered(best, &hypotheses, &marginal)
    }

    /// The effect that takes most of what was taken for the shape of those found; `hypotheses`: beside their names alone.
    fn hidden(
        &self,
        in_model: &[ModelTerm],
        hypotheses: &[Hypothesis],
        shares: &Shares,
    ) -> Option<ModelTerm> {
        let marginal = Arc::new(self.beside_names(in_model));
        let best = self.best(hypotheses, in_model, &self.leftover(&marginal))?;
        let is_most = 2.0 * best.score.gain >= HIDDEN * shares.shapes;
        let is_own = best.score.gain < self.shape_error(best, in_model) || self.is_of_course(best, in_model);
        let entered = (is_most && !is_own).then(|| self.entered(best, hypotheses, &marginal)).flatten();
        entered.map(|effect| ModelTerm { hidden: true, ..effect })
    }

    /// The best hypothesis that is neither chance nor what was found already.
    fn best<'r>(
        &self,
        hypotheses: &'r [Hypothesis],
        in_model: &[ModelTerm],
        before: &Leftover,
    ) -> Option<&'r Hypothesis> {
        let is_chance =
            |r: &Hypothesis| r.weight <= ENTER * if self.is_tone(r.candidate) { before.band } else { 1.0 };
        let mut worthy = hypotheses.iter().take_while(|r| r.weight > ENTER);
        worthy.find(|r| !is_chance(r) && !self.repeats(r, in_model))
    }

    /// A hypothesis taken in, if its evidence stands out from the structure that it leaves.
    fn entered(
        &self,
        best: &Hypothesis,
        hypotheses: &[Hypothesis],
        marginal: &Arc<Marginal>,
    ) -> Option<ModelTerm> {
        let near = hypotheses.iter().take(NEAR).map(|r| r.candidate).collect();
        let entered = ModelTerm { near, ..self.settle(best, marginal)? };
        let left = self.leftover(&marginal.with(&entered.columns).with(&entered.state).with(&entered.shape));
        (best.weight >= ENTER * (left.overdispersion / self.overdispersion).max(1.0)).then_some(entered)
    }

    /// Every effect gives its place to a better one, beside the others; one that is no longer needed goes.
    fn swap(&self, in_model: &mut Vec<ModelTerm>) {
        for _ in 0..2 {
            let mut changed = false;
            let mut i = 0;
            while i < in_model.len() {
                let hypotheses = self.rivals_of(in_model, i);
                let others = all_but(in_model, Some(i));
                let mut worthy = hypotheses.iter().take_while(|r| r.weight > ENTER);
                let Some(best) = worthy.find(|r| !self.repeats(r, &others)) else {
                    in_model.remove(i);
                    changed = true;
                    continue;
                };
                // What it was worth when it was taken in counts no longer: the others have changed.
                let ground = self.ground(in_model, Some(i));
                let own = &in_model[i];
                let candidate = &self.candidates[own.candidate];
                let field = self.rows.field(ground.clone());
                let now = self.rows.score_at(candidate, &own.score.parameters, &field, self.overdispersion);
                let now =
                    now.filter(|now| best.candidate == own.candidate && best.score.gain <= now.gain + 0.5);
                changed |= now.is_none();
                let hypothesis = now.map(|score| Hypothesis::new(own.candidate, best.weight, score));
                if let Some(entered) = self.settle(hypothesis.as_ref().unwrap_or(best), &ground) {
                    in_model[i] = entered.instead_of(&in_model[i]);
                }
                i += 1;
            }
            if !changed {
                break;
            }
        }
    }
}

/// Columns of all parts.
pub(super) fn side_by_side(parts: &[&DMatrix<f64>], rows: usize) -> DMatrix<f64> {
    let mut joined = DMatrix::zeros(rows, parts.iter().map(|p| p.ncols()).sum());
    let mut at = 0;
    for part in parts {
        joined.columns_mut(at, part.ncols()).copy_from(part);
        at += part.ncols();
    }
    joined
}

/// All effects but one.
pub(super) fn all_but(in_model: &[ModelTerm], but: Option<usize>) -> Vec<ModelTerm> {
    in_model.iter().enumerate().filter(|(i, _)| Some(*i) != but).map(|(_, effect)| effect.clone()).collect()
}

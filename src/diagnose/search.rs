//! Which effects together explain the recordings best: forward, backward, swaps, each against all candidates.

use std::cell::RefCell;
use std::collections::{HashMap, HashSet, VecDeque};
use std::rc::Rc;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::contained::prefer_simpler;
use super::folds;
use super::leftover::{Leftover, measure};
use super::refine::refine;
use super::score::{Rows, Score};
use super::shares::Shares;
use super::space::Space;
use crate::effects::Candidate;

/// An effect that has been taken in.
#[derive(Clone)]
pub(super) struct Active {
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

impl Active {
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
    pub(super) fn without_shape(&self) -> Active {
        Active { shape: DMatrix::zeros(self.columns.nrows(), 0), ..self.clone() }
    }

    /// In the place of another.
    pub(super) fn instead_of(self, other: &Active) -> Active {
        Active { near: other.near.clone(), hidden: other.hidden, ..self }
    }
}

/// A candidate that competes for one finding, and its weight.
#[derive(Clone, Debug)]
pub(super) struct Rival {
    pub candidate: usize,
    /// Logarithm of evidence and prior together.
    pub weight: f64,
    pub score: Score,
    /// Half the misfit energy that it takes away with what nobody knows of how it was before.
    pub reach: f64,
}

impl Rival {
    pub fn new(candidate: usize, weight: f64, score: Score) -> Self {
        Rival { candidate, weight, reach: score.gain, score }
    }
}

pub(super) struct Search<'a> {
    pub rows: &'a Rows<'a>,
    pub runs: &'a [Vec<usize>],
    pub base: Space,
    pub candidates: &'a [Candidate],
    /// Logarithm of what is expected of each candidate beforehand.
    pub priors: Vec<f64>,
    /// Logarithm of how often its family is met at all, 0 for all that are common.
    pub commonness: Vec<f64>,
    pub progress: &'a dyn Fn(&str),
    /// By how much chance counts as larger than the noise says.
    pub heat: f64,
    /// Whether the recordings follow a path; else they are settled positions, of which the side of approach is known.
    pub in_motion: bool,
    /// Rivals that are known, by what has been taken in besides.
    pub known: RefCell<Known>,
    /// The last spaces that candidates were judged beside, by what had been taken in, and whether that was by names alone.
    pub grounds: RefCell<VecDeque<(Ground, Arc<Space>)>>,
}

/// What had been taken in, and whether it stands for its names alone.
pub(super) type Ground = (Vec<Mark>, bool);

/// Rivals by the effect that stood aside, by those that were taken in, and by whether these stand for their names alone.
pub(super) type Known = HashMap<(Option<usize>, Vec<Mark>, bool), Rc<Vec<Rival>>>;

/// What tells an effect that has been taken in: candidate, coefficients and parameters.
pub(super) type Mark = (usize, usize, Vec<u64>);

/// So many candidates that came next to an effect are compared with it again and again.
pub(super) const NEAR: usize = 40;
/// Candidates with this part of the best one's weight come into question, and at most so many.
const CLOSE: f64 = 0.6;
const REFINED: usize = 8;
/// Effects of more energy (half of it) than this show their shape; of rivals with this part of the best one's, so many are looked at.
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
    /// Evidence of every candidate beside the active effects, better first.
    pub fn rivals(&self, active: &[Active]) -> Rc<Vec<Rival>> {
        self.known_or(active, None, None)
    }

    /// Evidence of those that might take the place of effect `i`, beside all others.
    pub fn rivals_of(&self, active: &[Active], i: usize) -> Rc<Vec<Rival>> {
        self.known_or(active, Some(i), Some(&active[i].near))
    }

    fn known_or(&self, active: &[Active], but: Option<usize>, among: Option<&[usize]>) -> Rc<Vec<Rival>> {
        let others = active.iter().enumerate().filter(|(i, _)| Some(*i) != but);
        let mut marks: Vec<Mark> = others.map(|(_, effect)| effect.mark()).collect();
        marks.sort();
        let (of, hidden) = (but.map(|i| active[i].candidate), but.is_some_and(|i| active[i].hidden));
        let mut known = self.known.borrow_mut();
        let key = |of: Option<usize>| (of, marks.clone(), hidden);
        if let Some(known) = known.get(&key(None)).or_else(|| known.get(&key(of))) {
            return known.clone();
        }
        let rivals = Rc::new(self.compare(self.ground(active, but), among));
        known.insert(key(among.and(of)), rivals.clone());
        rivals
    }

    pub(super) fn compare(&self, space: Arc<Space>, among: Option<&[usize]>) -> Vec<Rival> {
        let field = self.rows.field(space);
        // What progress is told is no matter of the threads.
        let (rows, priors, candidates, heat) = (self.rows, &self.priors, self.candidates, self.heat);
        let all: Vec<usize> = among.map_or_else(|| (0..candidates.len()).collect(), <[usize]>::to_vec);
        let mut rivals: Vec<Rival> = (all.into_par_iter())
            .filter_map(|i| {
                let score = rows.screen(i, &candidates[i], &field, heat)?;
                Some(Rival::new(i, score.evidence + priors[i], score))
            })
            .collect();
        let better_first = |a: &Rival, b: &Rival| b.weight.total_cmp(&a.weight);
        rivals.sort_by(better_first);
        self.bring_up(&mut rivals, &field);
        // Between the points of its grid a candidate may be much better: those that come into question are refined.
        let near = rivals.iter().map(|r| r.weight).fold(0.0, f64::max) * CLOSE;
        let is_close = |r: &Rival| r.weight > 0.0 && (r.weight >= near || r.reach > r.score.gain);
        let close = rivals.iter().take_while(|r| is_close(r)).count().min(REFINED);
        let refined: Vec<Rival> = rivals[..close]
            .par_iter()
            .map(|r| refine(rows, &candidates[r.candidate], r, &field, heat))
            .collect();
        rivals.splice(..close, refined);
        rivals[..close].sort_by(better_first);
        // No play is quite a step: what explains nearly as much may do so better once its shape may depart a little from the family's.
        let most = rivals[..close].iter().map(|r| r.reach / heat).fold(0.0, f64::max);
        if most > LARGE && rows.whitener.count() > MANY {
            let alike: Vec<usize> =
                (0..close).filter(|i| rivals[*i].reach / heat > SIMILAR * most).take(SHAPED).collect();
            for i in alike {
                rivals[i].weight = self.with_shape(&rivals[i], &field);
            }
            let slack = (UNKNOWN_SHAPE * most).min(VISIBLE * rows.whitener.count() as f64 / heat);
            for rival in &mut rivals[..close] {
                let bent = ((most - rival.reach / heat) / (BENT * most)).clamp(0.0, 1.0);
                rival.weight += slack * (self.commonness[rival.candidate] - bent);
            }
            rivals.sort_by(better_first);
        }
        prefer_simpler(self, &mut rivals, close, &field.space);
        rivals.sort_by(better_first);
        rivals
    }

    /// A rival where chance is larger than what it was searched with.
    pub fn tempered(&self, rival: &Rival, heat: f64) -> Rival {
        let heat = (heat / self.heat).max(1.0);
        let prior = self.priors[rival.candidate];
        Rival { weight: prior + (rival.weight - prior) / heat, ..rival.clone() }
    }

    /// The space beside all active effects but one.
    pub fn beside(&self, active: &[Active], but: Option<usize>) -> Space {
        let others = active.iter().enumerate().filter(|(i, _)| Some(*i) != but);
        let parts: Vec<&DMatrix<f64>> = others.flat_map(|(_, e)| [&e.columns, &e.state, &e.shape]).collect();
        self.base.with(&side_by_side(&parts, self.rows.residual.len()))
    }

    /// The space beside all active effects but one, their shapes as the families' where they would depart too far: what is hidden there
    /// is another effect, or unexplained.
    pub(super) fn ground(&self, active: &[Active], but: Option<usize>) -> Arc<Space> {
        let others = all_but(active, but);
        let hidden = but.is_some_and(|i| active[i].hidden);
        let marks = (others.iter().map(Active::mark).collect(), hidden);
        if let Some((_, known)) = self.grounds.borrow().iter().find(|(of, _)| *of == marks) {
            return known.clone();
        }
        let is_misshapen = |others: &[Active]| self.shares(others).is_misshapen(others.len());
        let ground = Arc::new(match hidden || !others.is_empty() && is_misshapen(&others) {
            true => self.beside_names(&others),
            false => self.beside(&others, None),
        });
        let mut grounds = self.grounds.borrow_mut();
        grounds.push_front((marks, ground.clone()));
        grounds.truncate(GROUNDS);
        ground
    }

    /// The space beside the names alone, as if their shapes were the families'.
    pub fn beside_names(&self, active: &[Active]) -> Space {
        let parts: Vec<&DMatrix<f64>> = active.iter().flat_map(|e| [&e.columns, &e.state]).collect();
        self.base.with(&side_by_side(&parts, self.rows.residual.len()))
    }

    /// Logarithm of the evidence of all active effects together, with what they were before and their shapes.
    pub fn worth(&self, active: &[Active]) -> f64 {
        let parts: Vec<&DMatrix<f64>> =
            active.iter().flat_map(|e| [&e.columns, &e.state, &e.shape]).collect();
        let left = self.base.apply(&self.rows.residual);
        self.base.worth(&side_by_side(&parts, left.len()), &left, self.heat)
    }

    /// What is left beside the active effects.
    pub fn leftover(&self, space: &Space) -> Leftover {
        let left = space.apply(&self.rows.residual);
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
    pub fn run(&self, from: &[Active], holds: impl Fn(&[Active]) -> bool) -> Vec<Active> {
        let mut active: Vec<Active> = Vec::new();
        for effect in from {
            let space = self.beside(&active, None);
            let (rows, candidate) = (self.rows, &self.candidates[effect.candidate]);
            let Some(score) =
                rows.score_at(candidate, &effect.score.parameters, &rows.field(space.clone()), self.heat)
            else {
                continue;
            };
            let rival = Rival::new(effect.candidate, score.evidence, score);
            active.extend(self.enter(&rival, &space).map(|again| again.instead_of(effect)));
        }
        self.swap(&mut active);
        let mut tried: HashSet<Vec<usize>> = HashSet::new();
        let (mut sound, mut harmful) = (active.clone(), 0);
        while active.len() < self.most() {
            // Swaps may throw out what the next step takes in again.
            if !tried.insert(active.iter().map(|effect| effect.candidate).collect()) {
                break;
            }
            (self.progress)(&format!("looking for effect {}", active.len() + 1));
            let Some(entered) = self.next(&active) else { break };
            active.push(entered);
            if self.in_motion && from.is_empty() && active.len() == 1 && !holds(&active) {
                return active;
            }
            if active.len() > 1 {
                self.swap(&mut active);
            }
            // A name that makes stretches worse that were left out is a patch, unless the next one mends it.
            let is_patched = self.rows.whitener.count() > MANY && folds::harmful(self, &active).is_some();
            harmful = if is_patched { harmful + 1 } else { 0 };
            match harmful {
                0 => sound.clone_from(&active),
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
    fn next(&self, active: &[Active]) -> Option<Active> {
        let shares = self.shares(active);
        if shares.is_misshapen(active.len()) {
            return self.hidden(active, &self.rivals(active), &shares);
        }
        self.beyond(active).or_else(|| {
            let is_odd = shares.shapes > ODD * shares.total();
            let ground = || Arc::new(self.beside_names(active));
            is_odd.then(|| self.hidden(active, &self.compare(ground(), None), &shares)).flatten()
        })
    }

    /// The effect that stands out beside those found and their shapes.
    fn beyond(&self, active: &[Active]) -> Option<Active> {
        let (rivals, space) = (self.rivals(active), self.ground(active, None));
        let before = self.leftover(&space);
        let best = self.best(&rivals, active, &before)?;
        let least = if self.in_motion { WORTH } else { WORTH_SETTLED } * before.energy;
        if best.score.gain < self.shape_error(best, active) || 2.0 * best.score.gain < least {
            return None;
        }
        self.entered(best, &rivals, &space)
    }

    /// The effect that takes most of what was taken for the shape of those found; `rivals`: beside their names alone.
    fn hidden(&self, active: &[Active], rivals: &[Rival], shares: &Shares) -> Option<Active> {
        let space = Arc::new(self.beside_names(active));
        let best = self.best(rivals, active, &self.leftover(&space))?;
        let is_most = 2.0 * best.score.gain >= HIDDEN * shares.shapes;
        let is_own = best.score.gain < self.shape_error(best, active) || self.is_of_course(best, active);
        let entered = (is_most && !is_own).then(|| self.entered(best, rivals, &space)).flatten();
        entered.map(|effect| Active { hidden: true, ..effect })
    }

    /// The best rival that is neither chance nor what was found already.
    fn best<'r>(&self, rivals: &'r [Rival], active: &[Active], before: &Leftover) -> Option<&'r Rival> {
        let is_chance =
            |r: &Rival| r.weight <= ENTER * if self.is_tone(r.candidate) { before.band } else { 1.0 };
        let mut worthy = rivals.iter().take_while(|r| r.weight > ENTER);
        worthy.find(|r| !is_chance(r) && !self.repeats(r, active))
    }

    /// A rival taken in, if its evidence stands out from the structure that it leaves.
    fn entered(&self, best: &Rival, rivals: &[Rival], space: &Arc<Space>) -> Option<Active> {
        let near = rivals.iter().take(NEAR).map(|r| r.candidate).collect();
        let entered = Active { near, ..self.settle(best, space)? };
        let left = self.leftover(&space.with(&entered.columns).with(&entered.state).with(&entered.shape));
        (best.weight >= ENTER * (left.heat / self.heat).max(1.0)).then_some(entered)
    }

    /// Every effect gives its place to a better one, beside the others; one that is no longer needed goes.
    fn swap(&self, active: &mut Vec<Active>) {
        for _ in 0..2 {
            let mut changed = false;
            let mut i = 0;
            while i < active.len() {
                let rivals = self.rivals_of(active, i);
                let others = all_but(active, Some(i));
                let mut worthy = rivals.iter().take_while(|r| r.weight > ENTER);
                let Some(best) = worthy.find(|r| !self.repeats(r, &others)) else {
                    active.remove(i);
                    changed = true;
                    continue;
                };
                // What it was worth when it was taken in counts no longer: the others have changed.
                let ground = self.ground(active, Some(i));
                let own = &active[i];
                let candidate = &self.candidates[own.candidate];
                let field = self.rows.field(ground.clone());
                let now = self.rows.score_at(candidate, &own.score.parameters, &field, self.heat);
                let now =
                    now.filter(|now| best.candidate == own.candidate && best.score.gain <= now.gain + 0.5);
                changed |= now.is_none();
                let rival = now.map(|score| Rival::new(own.candidate, best.weight, score));
                if let Some(entered) = self.settle(rival.as_ref().unwrap_or(best), &ground) {
                    active[i] = entered.instead_of(&active[i]);
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
pub(super) fn all_but(active: &[Active], but: Option<usize>) -> Vec<Active> {
    active.iter().enumerate().filter(|(i, _)| Some(*i) != but).map(|(_, effect)| effect.clone()).collect()
}

//! What has no name is modelled all the same: parts of it, each with a place and with what it depends on, `docs/diagnosis-method.md` (79).
//!
//! Where the names do not explain what is there, free functions of what each place knows compete with the families by their evidence, one
//! part after the other. A part stays in the model if stretches that were left out are foretold better with it.

use std::sync::Arc;

use super::coarse::Coarse;
use super::diagnosis::Named;
use super::folds;
use super::held_out::Model;
use super::nameless::UnnamedPart;
use super::noise::Noise;
use super::rms::rms_of;
use super::score::Rows;
use super::search::{ENTER, Search, priors};
use super::shares::Shares;
use super::terms::{Hypothesis, ModelTerm, all_but};
use super::whitener::Whitener;
use crate::effects::{Candidate, Library, Place, RecordingFacts};
use crate::feature::Dependence;
use crate::machine::Machine;
use crate::units::{ByQuantity, Quantity};
use crate::variation::Slot;

/// More parts are not looked for.
const MOST: usize = 16;
/// So many hypotheses are held against stretches left out before it is said that nothing more is foretold.
pub(super) const TRIES: usize = 6;

/// Whether stretches that were left out are foretold better with term `i` of these, and whole recordings where there are several, each by
/// more than one standard error of that.
pub(super) fn is_foretold(search: &Search, all: &[ModelTerm], i: usize) -> bool {
    standard_errors(search, all, i) > 1.0
}

/// By how many standard errors both are foretold better with term `i`: the fewer of the two.
fn standard_errors(search: &Search, all: &[ModelTerm], i: usize) -> f64 {
    let by = |(gain, error): (f64, f64)| gain / error.max(f64::MIN_POSITIVE);
    let own = folds::gain(search, all, i).map_or(f64::NEG_INFINITY, by);
    folds::gain_elsewhere(search, all, i).map_or(own, by).min(own)
}

/// Of the terms that are not foretold so, the one that is so least.
pub(super) fn least_foretold(search: &Search, all: &[ModelTerm]) -> Option<usize> {
    let each: Vec<f64> = (0..all.len()).map(|i| standard_errors(search, all, i)).collect();
    (0..all.len()).filter(|i| each[*i] <= 1.0).min_by(|a, b| each[*a].total_cmp(&each[*b]))
}

/// Free functions as candidates, beside the families of a search: what is no name for all that is there may be one for a part of it.
pub(super) struct Unnamed {
    pub(super) library: Library,
    pub(super) candidates: Vec<Candidate>,
    /// The first of them that is a free function.
    pub(super) first: usize,
    coarse: Coarse,
}

impl Unnamed {
    pub fn beside(search: &Search, machine: &Machine, facts: &RecordingFacts) -> Self {
        Unnamed::of(Library::unnamed(), search, machine, facts)
    }

    /// The families of another library in place of free functions.
    pub fn of(library: Library, search: &Search, machine: &Machine, facts: &RecordingFacts) -> Self {
        let mut candidates = search.candidates.to_vec();
        let first = candidates.len();
        candidates.extend(library.candidates(machine, facts).all);
        let coarse = Coarse::new(search.rows.linear, &candidates);
        Unnamed { library, candidates, first, coarse }
    }

    /// Whether two candidates of its library move what they sit on in the same directions, as all terms of one family do.
    pub fn moves_alike(&self, a: &Candidate, b: &Candidate) -> bool {
        let (a, b) = (&self.library.families()[a.family], &self.library.families()[b.family]);
        a.directions == b.directions && a.pivot == b.pivot
    }

    /// The rows of a search, for these candidates, beside its own noise or another.
    pub fn rows<'a>(&'a self, search: &Search<'a>, noise: Option<&[Noise]>) -> Rows<'a> {
        let whitener = &search.rows.whitener;
        let whitener = match noise {
            Some(noise) => {
                Whitener::new(search.rows.residual.len(), search.runs, noise, whitener.out.clone())
            }
            None => whitener.clone(),
        };
        Rows::new(search.rows.linear, search.rows.drives(), &self.coarse, whitener)
    }

    /// The search with these candidates.
    pub fn search<'a>(&'a self, search: &Search<'a>, rows: &'a Rows<'a>) -> Search<'a> {
        let mut commonness = search.commonness.clone();
        commonness.resize(self.candidates.len(), 0.0);
        Search {
            rows,
            runs: search.runs,
            base: rows.base(),
            candidates: &self.candidates,
            priors: priors(&self.candidates),
            commonness,
            progress: search.progress,
            overdispersion: search.overdispersion,
            in_motion: search.in_motion,
            known: Default::default(),
            grounds: Default::default(),
        }
    }

    /// The parts that what was found leaves to be modelled; where there are none, the likeliest one, that can only be told. `search`: with
    /// these candidates.
    pub fn parts(&self, search: &Search, in_model: &[ModelTerm]) -> (Vec<ModelTerm>, Option<ModelTerm>) {
        let found = self.parts_beside(search, in_model);
        if search.overdispersion <= 1.0 {
            return found;
        }
        // What stands out is known to be no chance, and where nothing does, what is there is none.
        let all = [in_model, &found.0].concat();
        let overdispersion = match found.0.is_empty() {
            true => 1.0,
            false => search.leftover(&search.beside_names(&all)).overdispersion.max(1.0),
        };
        if overdispersion >= search.overdispersion {
            return found;
        }
        let search = Search { overdispersion, ..self.search(search, search.rows) };
        let again = self.parts_beside(&search, in_model);
        let with = [in_model, &again.0].concat();
        if again.0.is_empty() || folds::are_better(&search, &all, &with) { found } else { again }
    }

    /// The same, where chance is as large as the search has it.
    fn parts_beside(&self, search: &Search, in_model: &[ModelTerm]) -> (Vec<ModelTerm>, Option<ModelTerm>) {
        let (mut all, first) = (in_model.to_vec(), in_model.len());
        let mut told = None;
        let is_reading = |c: &usize| {
            let mut parts = self.candidates[*c].coefficients.iter().flat_map(|c| &c.parts);
            self.candidates[*c].place == Place::Measurement && parts.all(|part| part.slot == Slot::Reading)
        };
        // What a joint or a frame does is no reading's.
        let (mut rest, mut open): (Vec<usize>, Vec<usize>) = (0..self.candidates.len()).partition(is_reading);
        while all.len() - first < MOST {
            (search.progress)(&format!("modelling what has no name, part {}", all.len() - first + 1));
            let marginal = Arc::new(search.beside_names(&all));
            let hypotheses = search.compare(marginal.clone(), Some(&open));
            // What the law of a motion leaves is not the time's.
            let is_own = |h: &&Hypothesis| {
                !search.goes_by_clock(h.candidate) || h.score.gain > search.discrepancy_error(h, &all)
            };
            let (mut next, mut tries) = (None, 0);
            for hypothesis in hypotheses.iter().filter(|h| h.weight > ENTER).filter(is_own) {
                let Some(term) = search.enter_bare(hypothesis, &marginal) else { continue };
                let with = [all.as_slice(), std::slice::from_ref(&term)].concat();
                if is_foretold(search, &with, all.len()) {
                    next = Some(term);
                    break;
                }
                // What fails now is not asked again; what fails because it goes by the clock says nothing of the others.
                open.retain(|candidate| *candidate != term.candidate);
                tries += usize::from(!search.goes_by_clock(term.candidate));
                told = told.or(Some(term));
                if tries == TRIES {
                    break;
                }
            }
            let Some(term) = next else {
                if rest.is_empty() {
                    break;
                }
                open = std::mem::take(&mut rest);
                continue;
            };
            all.push(ModelTerm { initial: search.initial_of(&term), ..term });
        }
        // What came later may say what was said before.
        while let Some(i) = (first..all.len()).find(|i| !is_foretold(search, &all, *i)) {
            all.remove(i);
        }
        let parts = all.split_off(first);
        let told = told.filter(|_| parts.is_empty());
        (parts, told)
    }

    /// All terms as parts are told, and as they are put into the model.
    pub fn told(
        &self,
        search: &Search,
        all: &[ModelTerm],
        shares: &Shares,
        (machine, library): (&Machine, &Library),
        modelled: bool,
    ) -> Vec<(UnnamedPart, Named)> {
        let model = Model::new(search, all);
        let left = model.residual(search, all);
        let one = |i: usize| {
            let (term, candidate) = (&all[i], &search.candidates[all[i].candidate]);
            let library = if term.candidate < self.first { library } else { &self.library };
            let solved = model.effect(search, all, i, shares.departure());
            let identified = solved.identified(candidate, library, term.score.parameters.clone());
            let sizes = identified.sizes(&search.rows.linear.samples);
            let named = Named { effect: identified.stored(machine, &sizes), scales: term.scales(search) };
            let others = all_but(all, Some(i));
            let without = Model::new(search, &others).residual(search, &others);
            let made: Vec<f64> = without.iter().zip(&left).map(|(without, with)| without - with).collect();
            let of = |quantity: Quantity| rms_of(search, &made, quantity == Quantity::Angle);
            let part = UnnamedPart {
                at: candidate.place.name(machine),
                depends_on: depends_on(term, candidate, machine),
                rms: ByQuantity::of(of),
                held_out_rms: folds::pair(search, all, i),
                modelled,
                names: Vec::new(),
            };
            (part, named)
        };
        (0..all.len()).map(one).collect()
    }
}

/// What the features of a candidate that take part depend on, in words.
fn depends_on(term: &ModelTerm, candidate: &Candidate, machine: &Machine) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    let parts = candidate.coefficients[..term.score.coefficients].iter().flat_map(|c| &c.parts);
    for on in parts.flat_map(|part| candidate.features[part.feature].depends_on()) {
        let text = match on {
            Dependence::Joint(what, j) => format!("{what} of {}", Place::Joint(j).name(machine)),
            Dependence::Other(what) => what,
        };
        if !all.contains(&text) {
            all.push(text);
        }
    }
    all
}

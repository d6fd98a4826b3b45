//! A family for what has no name: the shortest law that foretells as much as the free function in its place, `docs/diagnosis-method.md` (81).
//!
//! Terms of the library's own language compete at the place of a part, one after the other, beside everything else that was found. Where a
//! few of them foretell stretches that were left out as well as the free function does, they are the law; else the function itself is.

use std::sync::Arc;

use super::finding::HeldOutPair;
use super::folds;
use super::held_out::Model;
use super::nameless::{LikelyName, Proposal};
use super::parts::{TRIES, Unnamed, is_foretold};
use super::search::{ENTER, Search};
use super::terms::ModelTerm;
use crate::effects::{
    Candidate, Directions, Family, Library, LookAlike, Meaning, Output, Partner, Place, RecordingFacts, Seat,
    Size,
};
use crate::feature::Expression;
use crate::machine::{JointKind, Machine};
use crate::units::ByQuantity;

/// A law has no more terms.
const MOST_TERMS: usize = 3;

/// Families for what the model has by free functions: at each place a law, or the functions as they are. `search`: with these functions;
/// `known`: what has a name; `names`: those that come into question for a part.
pub(super) fn proposals(
    search: &Search,
    unnamed: &Unnamed,
    (known, parts): (&[ModelTerm], &[ModelTerm]),
    names: &dyn Fn(&ModelTerm) -> Vec<LikelyName>,
    (machine, library, facts): (&Machine, &Library, &RecordingFacts),
) -> Vec<Proposal> {
    let laws = Unnamed::of(Library::primitives(), search, machine, facts);
    let rows = laws.rows(search, None);
    let search = &laws.search(search, &rows);
    let draft = Draft { search, unnamed, laws: &laws, machine };
    let seat = |term: &ModelTerm| search.candidates[term.candidate].place.seat();
    // A part may be a family of the library, too.
    let is_free = |term: &&ModelTerm| term.candidate >= unnamed.first;
    let mut places: Vec<Place> = Vec::new();
    for place in parts.iter().filter(is_free).map(seat) {
        if !places.contains(&place) {
            places.push(place);
        }
    }
    places.sort_by_key(|place| place.dyad());
    let mut all: Vec<Proposal> = Vec::new();
    for place in places {
        (search.progress)("putting a law together for what has no name");
        let (free, others): (Vec<ModelTerm>, Vec<ModelTerm>) =
            parts.iter().cloned().partition(|part| is_free(&part) && seat(part) == place);
        let others = [known, &others].concat();
        let mut looks_like: Vec<LikelyName> = Vec::new();
        for name in free.iter().flat_map(names) {
            let is_new = looks_like.iter().all(|other| other.effect != name.effect);
            if is_new && library.family(&name.effect).is_some() {
                looks_like.push(name);
            }
        }
        let law = law(search, &laws, place, &others, &free);
        let sets = match &law {
            Some(law) => vec![law.clone()],
            None => draft.together(&free),
        };
        for (i, terms) in sets.iter().enumerate() {
            let beside = sets.iter().enumerate().filter(|(k, _)| *k != i).flat_map(|(_, set)| set);
            let others: Vec<ModelTerm> = others.iter().chain(beside).cloned().collect();
            let family = draft.family(format!("proposed_{}", all.len() + 1), &others, terms, &looks_like);
            let ron = family.to_ron();
            all.push(Proposal {
                name: family.name,
                at: place.name(machine),
                partner: draft.partner(terms).map(|k| Place::Joint(k).name(machine)),
                law: family.features.iter().map(Expression::to_string).collect(),
                free: law.is_none(),
                held_out_rms: held_out(search, &others, terms),
                free_held_out_rms: held_out(search, &others, if law.is_none() { terms } else { &free }),
                ron,
            });
        }
    }
    all
}

/// RMS of stretches left out, without and with these terms beside the others.
fn held_out(search: &Search, others: &[ModelTerm], terms: &[ModelTerm]) -> ByQuantity<Option<HeldOutPair>> {
    let all = [others, terms].concat();
    let (before, after) =
        (folds::rms_left_out(search, &all, others.len()), folds::rms_left_out(search, &all, all.len()));
    ByQuantity::of(|quantity| Some(HeldOutPair { before: before[quantity]?, after: after[quantity]? }))
}

/// A few terms at a place that foretell stretches left out as well as the free function.
fn law(
    search: &Search,
    laws: &Unnamed,
    place: Place,
    others: &[ModelTerm],
    free: &[ModelTerm],
) -> Option<Vec<ModelTerm>> {
    let free = [others, free].concat();
    let mut all = others.to_vec();
    let mut open: Vec<usize> =
        (laws.first..laws.candidates.len()).filter(|c| laws.candidates[*c].place.seat() == place).collect();
    while all.len() - others.len() < MOST_TERMS {
        let marginal = Arc::new(search.beside_names(&all));
        let hypotheses = search.compare(marginal.clone(), Some(&open));
        let likely = hypotheses.iter().filter(|h| h.weight > ENTER).take(TRIES);
        let enters = |term: &ModelTerm| {
            let with = [all.as_slice(), std::slice::from_ref(term)].concat();
            is_foretold(search, &with, all.len())
        };
        let term = likely.filter_map(|h| search.enter_bare(h, &marginal)).find(enters)?;
        let taken = &laws.candidates[term.candidate];
        open.retain(|c| {
            let other = &laws.candidates[*c];
            // A family has one other joint and one kind of motion, and grids of several terms would multiply.
            let is_third =
                matches!((taken.place, other.place), (Place::Pair(_, k), Place::Pair(_, l)) if k != l);
            let has_grid = |c: &Candidate| !c.parameters.is_empty();
            other.effect != taken.effect
                && !is_third
                && laws.moves_alike(taken, other)
                && !(has_grid(taken) && has_grid(other))
        });
        all.push(ModelTerm { initial: search.initial_of(&term), ..term });
        // What came later may say what was said before.
        if let Some(i) = (others.len()..all.len()).find(|i| !is_foretold(search, &all, *i)) {
            all.remove(i);
        }
        if folds::are_as_good(search, &all, &free) {
            return Some(all.split_off(others.len()));
        }
    }
    None
}

/// Families that are written from terms of the model.
struct Draft<'a> {
    search: &'a Search<'a>,
    unnamed: &'a Unnamed,
    laws: &'a Unnamed,
    machine: &'a Machine,
}

impl Draft<'_> {
    fn library_of(&self, term: &ModelTerm) -> &Library {
        if term.candidate < self.laws.first { &self.unnamed.library } else { &self.laws.library }
    }

    fn family_of(&self, term: &ModelTerm) -> &Family {
        &self.library_of(term).families()[self.search.candidates[term.candidate].family]
    }

    /// The other joint.
    fn partner(&self, terms: &[ModelTerm]) -> Option<usize> {
        terms.iter().find_map(|term| match self.search.candidates[term.candidate].place {
            Place::Pair(_, k) => Some(k),
            _ => None,
        })
    }

    /// Terms at one place by what one family can say: one kind of motion, one other joint. One with parameters is a family of its own: over
    /// their grid everything else in it would be built again and again.
    fn together(&self, terms: &[ModelTerm]) -> Vec<Vec<ModelTerm>> {
        let mut sets: Vec<Vec<ModelTerm>> = Vec::new();
        for term in terms {
            let own = self.family_of(term);
            let partner = self.partner(std::slice::from_ref(term));
            let goes_with = |set: &[ModelTerm]| {
                let alike = |other: &Family| other.directions == own.directions && other.pivot == own.pivot;
                let families = || set.iter().map(|other| self.family_of(other));
                let of_set = self.partner(set);
                (of_set.is_none() || partner.is_none() || of_set == partner)
                    && families().all(alike)
                    && own.parameters.is_empty()
                    && families().all(|other| other.parameters.is_empty())
            };
            match sets.iter_mut().find(|set| goes_with(set)) {
                Some(set) => set.push(term.clone()),
                None => sets.push(vec![term.clone()]),
            }
        }
        sets
    }

    /// What a term is a sum of, as far as the recordings asked for it.
    fn features(&self, term: &ModelTerm) -> &[Expression] {
        let used = &self.search.candidates[term.candidate].coefficients[..term.score.coefficients];
        let count = used.iter().map(|c| c.order + 1).max().unwrap_or(0);
        let all = &self.family_of(term).features;
        &all[..count.min(all.len())]
    }

    /// Root mean square of what terms move their joint by beside the others, m or rad.
    fn size(&self, others: &[ModelTerm], terms: &[ModelTerm]) -> f64 {
        let all = [others, terms].concat();
        let model = Model::new(self.search, &all);
        let samples = &self.search.rows.linear.samples;
        let mut sum: Vec<f64> = Vec::new();
        for (i, term) in terms.iter().enumerate() {
            let candidate = &self.search.candidates[term.candidate];
            let solved = model.effect(self.search, &all, others.len() + i, 0.0);
            let found = solved.identified(candidate, self.library_of(term), term.score.parameters.clone());
            for (coefficient, value) in candidate.coefficients.iter().zip(&found.coefficients) {
                let Some(part) = coefficient.parts.first() else { continue };
                let column = candidate.features[part.feature].over(samples, &term.score.parameters);
                sum.resize(column.len(), 0.0);
                sum.iter_mut().zip(&column).for_each(|(sum, f)| *sum += value * f);
            }
        }
        (sum.iter().map(|x| x * x).sum::<f64>() / sum.len().max(1) as f64).sqrt()
    }

    /// One family of terms that go together.
    fn family(
        &self,
        name: String,
        others: &[ModelTerm],
        terms: &[ModelTerm],
        looks_like: &[LikelyName],
    ) -> Family {
        let first = self.family_of(&terms[0]);
        let place = self.search.candidates[terms[0].candidate].place.seat();
        let partner = self.partner(terms);
        let features: Vec<Expression> = terms.iter().flat_map(|term| self.features(term)).cloned().collect();
        let law = features.iter().map(Expression::to_string).collect::<Vec<_>>().join(", ");
        let turns =
            |j: usize| self.machine.dyads()[j].joint.as_ref().is_some_and(|q| q.kind == JointKind::Revolute);
        let named = |place: Place| place.name(self.machine);
        let at = partner
            .map_or_else(|| named(place), |k| format!("{} and {}", named(place), named(Place::Joint(k))));
        let joint = |j: usize| if turns(j) { Seat::Revolute } else { Seat::Prismatic };
        let (seat, who) = match place {
            Place::Joint(j) | Place::Pair(j, _) => (joint(j), "what carries {at}"),
            Place::Frame(_) => (Seat::Frame, "frame {at}"),
            Place::Measurement => (Seat::Measurement, "the reading"),
        };
        let is_along = first.directions == [Directions::Along];
        // Of a pose in lengths and angles the usual size stands.
        let size = match (is_along, seat) {
            (true, Seat::Revolute) => Size { urad: 1e6 * self.size(others, terms), ..first.size },
            (true, _) => Size { um: 1e6 * self.size(others, terms), ..first.size },
            (false, _) => first.size,
        };
        let peak = Output { name: "peak".into(), is: Meaning::Peak, unit: "travel".into(), shown: None };
        let separate_by =
            "a path on which the two foretell different errors, with this file beside the library";
        let look_alike =
            |name: &LikelyName| LookAlike { effect: name.effect.clone(), separate_by: separate_by.into() };
        Family {
            name,
            about: format!("In no book. Found at {at}: a sum of {law}, each times a number."),
            sits: vec![seat],
            partner: partner.map(|k| if turns(k) { Partner::Revolute } else { Partner::Prismatic }),
            features,
            least: None,
            parameters: terms.iter().flat_map(|term| self.family_of(term).parameters.clone()).collect(),
            size,
            often: 0.2,
            coefficients: if is_along { vec![peak] } else { Vec::new() },
            sentence: match is_along {
                true => format!("axis {{at}} errs by up to {{peak}}, by a law that is in no book: {law}"),
                false => format!("{who} errs by a law that is in no book: {law}"),
            },
            cause: "not known: look at what moves as this law does".into(),
            remedy: "`kincal compensate` takes it away; measure {at} on another path before a cause is named"
                .into(),
            look_alikes: looks_like.iter().map(look_alike).collect(),
            source: "in no book".into(),
            ..first.clone()
        }
    }
}

//! A family for what has no name: the shortest law that foretells as much as the free function in its place, `docs/diagnosis-method.md` (83).
//!
//! Terms of the library's own language compete at the place of a part, one after the other, beside everything else that was found. Where a
//! few of them foretell stretches that were left out as well as the free function does, they are the law; else the function itself is.

use std::fmt::Write;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::finding::HeldOutPair;
use super::folds;
use super::held_out::Model;
use super::names::LikelyName;
use super::parts::{Unnamed, is_foretold};
use super::search::{ENTER, ModelTerm, Search};
use crate::effects::{Family, Library, Place, RecordingFacts};
use crate::feature::Expression;
use crate::machine::{JointKind, Machine};
use crate::units::{ByQuantity, field_by_quantity};

field_by_quantity!(held_out_rms, free_held_out_rms);

/// A law has no more terms.
const MOST_TERMS: usize = 3;
/// So many hypotheses are held against stretches left out before it is said that no term says more.
const TRIES: usize = 6;

/// A family that is in no book yet.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Proposal {
    /// Name of the family.
    pub name: String,
    /// Joint where it was found.
    pub at: String,
    /// The other joint that it depends on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub partner: Option<String>,
    /// What it is a sum of, as formulas, each times a number of its own.
    pub law: Vec<String>,
    /// Whether it is the free function itself, because nothing shorter foretells as much.
    pub free: bool,
    /// RMS on stretches that were left out, without it and with it, all else taken in.
    #[serde(flatten, with = "held_out_rms")]
    pub held_out_rms: ByQuantity<Option<HeldOutPair>>,
    /// The same without and with the free function.
    #[serde(flatten, with = "free_held_out_rms")]
    pub free_held_out_rms: ByQuantity<Option<HeldOutPair>>,
    /// The family, as it stands in a file of effects.
    pub ron: String,
}

/// A family for each place where the model has parts without a name. `search`: with these free functions; `known`: what has a name;
/// `names`: those that come into question for a part.
pub(super) fn proposals(
    search: &Search,
    unnamed: &Unnamed,
    (known, parts): (&[ModelTerm], &[ModelTerm]),
    names: &dyn Fn(&ModelTerm) -> Vec<LikelyName>,
    (machine, library, facts): (&Machine, &Library, &RecordingFacts),
) -> Vec<Proposal> {
    let laws = Unnamed::of(Library::primitives(), search, machine, facts);
    let rows = laws.rows(search);
    let search = &laws.search(search, &rows);
    let dyad = |term: &ModelTerm| search.candidates[term.candidate].place.dyad();
    let mut places: Vec<Option<usize>> = Vec::new();
    for part in parts {
        if !places.contains(&dyad(part)) {
            places.push(dyad(part));
        }
    }
    let mut all = Vec::new();
    for place in places.into_iter().flatten() {
        (search.progress)("putting a law together for what has no name");
        let (free, others): (Vec<ModelTerm>, Vec<ModelTerm>) =
            parts.iter().cloned().partition(|part| dyad(part) == Some(place));
        let others = [known, &others].concat();
        let law = law(search, &laws, place, &others, &free);
        let terms = law.as_deref().unwrap_or(&free);
        let mut looks_like: Vec<LikelyName> = Vec::new();
        for name in free.iter().flat_map(names) {
            let is_new = looks_like.iter().all(|other| other.effect != name.effect);
            if is_new && library.family(&name.effect).is_some() {
                looks_like.push(name);
            }
        }
        let name = format!("proposed_{}", all.len() + 1);
        let libraries = [(laws.first, &laws.library), (unnamed.first, &unnamed.library), (0, library)];
        let draft = Draft { search, terms, libraries, machine };
        let held_out = |terms: &[ModelTerm]| held_out(search, &others, terms);
        all.extend(draft.family(&others, &name, &looks_like).map(|ron| Proposal {
            name,
            at: Place::Joint(place).name(machine),
            partner: draft.partner().map(|k| Place::Joint(k).name(machine)),
            law: draft.features().iter().map(|(e, _)| e.to_string()).collect(),
            free: law.is_none(),
            held_out_rms: held_out(terms),
            free_held_out_rms: held_out(&free),
            ron,
        }));
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

/// A few terms at a place that foretell stretches left out no worse than the free function, by less than one standard error.
fn law(
    search: &Search,
    laws: &Unnamed,
    place: usize,
    others: &[ModelTerm],
    free: &[ModelTerm],
) -> Option<Vec<ModelTerm>> {
    let free = [others, free].concat();
    let mut all = others.to_vec();
    let mut open: Vec<usize> = (laws.first..laws.candidates.len())
        .filter(|c| laws.candidates[*c].place.dyad() == Some(place))
        .collect();
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
            // A family has one other joint.
            let is_third =
                matches!((taken.place, other.place), (Place::Pair(_, k), Place::Pair(_, l)) if k != l);
            other.effect != taken.effect && !is_third
        });
        all.push(term);
        // What came later may say what was said before.
        if let Some(i) = (others.len()..all.len()).find(|i| !is_foretold(search, &all, *i)) {
            all.remove(i);
        }
        if !folds::are_better(search, &free, &all) {
            return Some(all.split_off(others.len()));
        }
    }
    None
}

/// A family that is written from terms of the model.
struct Draft<'a> {
    search: &'a Search<'a>,
    terms: &'a [ModelTerm],
    /// Whose families the candidates are of, each with its first candidate; the last ones first.
    libraries: [(usize, &'a Library); 3],
    machine: &'a Machine,
}

impl Draft<'_> {
    fn library_of(&self, term: &ModelTerm) -> &Library {
        let of = self.libraries.iter().find(|(first, _)| term.candidate >= *first);
        of.map_or(self.libraries[2].1, |(_, library)| library)
    }

    fn family_of(&self, term: &ModelTerm) -> &Family {
        &self.library_of(term).families()[self.search.candidates[term.candidate].family]
    }

    /// The other joint.
    fn partner(&self) -> Option<usize> {
        self.terms.iter().find_map(|term| match self.search.candidates[term.candidate].place {
            Place::Pair(_, k) => Some(k),
            _ => None,
        })
    }

    /// What it is a sum of, as far as the recordings asked for it, and the term that each is of.
    fn features(&self) -> Vec<(&Expression, usize)> {
        let of = |(i, term): (usize, &ModelTerm)| {
            let candidate = &self.search.candidates[term.candidate];
            let used = candidate.coefficients[..term.score.coefficients].iter().map(|c| c.order + 1).max();
            let features = &self.family_of(term).features;
            features[..used.unwrap_or(0).min(features.len())].iter().map(|e| (e, i)).collect::<Vec<_>>()
        };
        self.terms.iter().enumerate().flat_map(of).collect()
    }

    /// Root mean square of what it moves the joint by beside the others, m or rad.
    fn size(&self, others: &[ModelTerm]) -> f64 {
        let all = [others, self.terms].concat();
        let model = Model::new(self.search, &all);
        let samples = &self.search.rows.linear.samples;
        let mut sum: Vec<f64> = Vec::new();
        for (i, term) in self.terms.iter().enumerate() {
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

    /// The family in RON; `None` where it would not be read, or its terms do not go together.
    fn family(&self, others: &[ModelTerm], name: &str, looks_like: &[LikelyName]) -> Option<String> {
        let first = self.family_of(self.terms.first()?);
        let is_alike = |term: &ModelTerm| {
            let family = self.family_of(term);
            family.directions == first.directions && family.pivot == first.pivot
        };
        // Where motions of several kinds have no short law, the first of them is written.
        let terms: Vec<ModelTerm> = self.terms.iter().filter(|term| is_alike(term)).cloned().collect();
        let own = Draft { terms: &terms, ..*self };
        let place = self.search.candidates[terms[0].candidate].place.dyad()?;
        let kind = |j: usize| self.machine.dyads()[j].joint.as_ref().map(|joint| joint.kind);
        let seat = |j: usize| match kind(j) {
            Some(JointKind::Revolute) => "Revolute",
            _ => "Prismatic",
        };
        let size = own.size(others);
        let (um, urad) = match kind(place) {
            Some(JointKind::Revolute) => (10.0, size * 1e6),
            _ => (size * 1e6, 60.0),
        };
        let features = own.features();
        let law = features.iter().map(|(e, _)| e.to_string()).collect::<Vec<_>>().join(", ");
        let at = Place::Joint(place).name(self.machine);
        let partner = own.partner();
        let mut text = String::new();
        let mut line = |inner: &str| {
            let _ = writeln!(text, "        {inner}");
        };
        line(&format!("name: {name:?},"));
        let beside =
            partner.map_or(String::new(), |k| format!(" and {}", Place::Joint(k).name(self.machine)));
        line(&format!(
            "about: {:?},",
            format!("In no book. Found at {at}{beside}: a sum of {law}, each times a number.")
        ));
        let pivot = if first.pivot == Default::default() { "" } else { " pivot: After," };
        line(&format!("sits: [{}],{pivot} directions: {},", seat(place), compact(&first.directions)?));
        if let Some(k) = partner {
            line(&format!("partner: {},", seat(k)));
        }
        line("features: [");
        for (feature, _) in &features {
            line(&format!("    {},", compact(feature)?));
        }
        line("],");
        let mut parameters = Vec::new();
        for family in terms.iter().map(|term| self.family_of(term)) {
            for parameter in &family.parameters {
                parameters.push(compact(parameter)?);
            }
        }
        if !parameters.is_empty() {
            line(&format!("parameters: [{}],", parameters.join(", ")));
        }
        line(&format!("size: (um: {um:.3}, urad: {urad:.3}), often: 0.2,"));
        let along = matches!(first.directions.as_slice(), [crate::effects::Directions::Along]);
        let sentence = match along {
            true => {
                line("coefficients: [(name: \"peak\", is: Peak, unit: \"travel\")],");
                format!("axis {{at}} errs by up to {{peak}}, by a law that is in no book: {law}")
            }
            false => format!("what carries {{at}} errs by a law that is in no book: {law}"),
        };
        line(&format!("sentence: {sentence:?},"));
        line("cause: \"not known: look at what moves as this law does\",");
        line(
            "remedy: \"`kincal compensate` takes it away; measure {at} on another path before a cause is named\",",
        );
        let separate = "a path on which the two foretell different errors: `kincal diagnose` with this file beside the library";
        let alike: Vec<String> = (looks_like.iter())
            .map(|name| format!("(effect: {:?}, separate_by: {separate:?})", name.effect))
            .collect();
        if !alike.is_empty() {
            line(&format!("look_alikes: [{}],", alike.join(", ")));
        }
        line("source: \"in no book\",");
        let ron = format!("    (\n{text}    ),\n");
        let file = format!("Effects(families: [\n{ron}])\n");
        Library::standard().with_text("proposal", &file).is_ok().then_some(ron)
    }
}

/// A value in RON on one line.
fn compact(value: &impl Serialize) -> Option<String> {
    ron::ser::to_string(value).ok()
}

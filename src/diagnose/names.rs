//! Which family describes what was modelled as a part without a name, `docs/diagnosis-method.md` (80).
//!
//! Real shapes depart from those of textbooks, and several things act at one place, each driven by a motion of its own: a cable brings
//! along another axis, and loses motion where its own axis turns round. So the families compete for what the same joints drive at one place,
//! with each other and with none, beside everything else that was found, while a free function of these joints may depart from each by a
//! part of its size that nobody knows.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::DMatrix;

use super::contained::says_no_more;
use super::evidence::{evidence, log_mean_exp, log_sum_exp};
use super::marginal::{Marginal, solved};
use super::nameless::LikelyName;
use super::odds::LISTED;
use super::parts::{Unnamed, is_foretold};
use super::policy::Rule;
use super::search::Search;
use super::terms::{Hypothesis, ModelTerm, side_by_side};
use crate::effects::Place;
use crate::feature::Dependence;

/// Parts of its size by which the shape of what happens may depart from its family's; each is as likely beforehand.
const DEPARTURES: [f64; 3] = [0.05, 0.1, 0.2];
/// By more than twice the largest of these nothing departs from its family: functions of a few coefficients have wide tails.
const FARTHEST: f64 = 0.4;

/// How often what is found has no name.
const NAMELESS: f64 = 0.2;
/// So many hypotheses are compared.
const COMPARED: usize = 12;
/// What is told by name is likelier than not.
pub(super) const LIKELY: f64 = 0.5;

/// Parts that belong together: at one place, driven by the same joints.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Group {
    place: Place,
    /// Dyads of the joints that it depends on, in their order.
    drivers: Vec<usize>,
}

/// What was modelled, after families were asked for.
pub(super) struct Naming {
    /// Terms that have a name.
    pub told: Vec<GivenName>,
    /// What stays without.
    pub parts: Vec<ModelTerm>,
    /// Names that come into question, by group.
    likely: Vec<(Group, Vec<LikelyName>)>,
    /// All groups, the one of which most is there first.
    groups: Vec<Group>,
}

/// A part that has a name now.
pub(super) struct GivenName {
    pub term: ModelTerm,
    pub probability: f64,
    /// What it was a part of.
    pub group: Group,
}

impl Naming {
    /// With nothing modelled.
    pub fn withdrawn(self) -> Self {
        Naming { told: Vec::new(), parts: Vec::new(), ..self }
    }

    /// Names that come into question for a group.
    pub fn likely(&self, group: &Group) -> Vec<LikelyName> {
        self.likely.iter().find(|(own, _)| own == group).map(|(_, names)| names.clone()).unwrap_or_default()
    }

    /// The how many-th of all places that of a group is, by how much is there.
    pub fn rank(&self, group: &Group) -> Option<usize> {
        self.groups.iter().position(|other| other.place == group.place)
    }
}

/// A family that comes into question.
struct Name {
    /// Its best hypothesis.
    hypothesis: Hypothesis,
    /// Probability of its name, all forms of it together.
    probability: f64,
}

/// Families in question, the likeliest first.
struct Names {
    all: Vec<Name>,
    /// The likeliest as a term beside everything else that was found.
    best: ModelTerm,
}

impl Unnamed {
    /// Gives their names to these parts, group by group, the largest first, where a name is likely and foretells what was left out; what a
    /// part does beside it stays only if that foretells more. Beside something larger that has no name, a name may be for its shadow: the
    /// first group without one ends it.
    pub fn named(&self, search: &Search, in_model: &[ModelTerm], mut parts: Vec<ModelTerm>) -> Naming {
        let groups = self.groups(search, in_model, &parts);
        let (mut told, mut likely): (Vec<GivenName>, Vec<_>) = (Vec::new(), Vec::new());
        let mut is_open = true;
        // Settled positions show no course: any family of where a joint stands comes near there.
        for here in groups.iter().filter(|_| search.in_motion) {
            (search.progress)("naming what was modelled");
            let (own, elsewhere): (Vec<ModelTerm>, Vec<ModelTerm>) =
                parts.iter().cloned().partition(|part| self.group(part) == *here);
            let found = told.iter().map(|given| given.term.clone());
            let mut all: Vec<ModelTerm> = in_model.iter().cloned().chain(found).collect();
            all.extend(elsewhere.iter().cloned());
            let Some(names) = self.names(search, &own, &all) else {
                is_open = false;
                continue;
            };
            let effect = |name: &Name| self.candidates[name.hypothesis.candidate].told_as.clone();
            let listed = names.all.iter().take_while(|name| name.probability > LISTED);
            let listed = listed.map(|n| LikelyName { effect: effect(n), probability: n.probability });
            likely.push((here.clone(), listed.collect()));
            let probability = names.all[0].probability;
            all.push(names.best.clone());
            let last = all.len() - 1;
            let holds = || is_foretold(search, &all, last) && !says_no_more(search, &all, last);
            is_open &= probability > LIKELY && holds();
            if !is_open {
                is_open = !Rule::LargestFirst.decides();
                continue;
            }
            parts = elsewhere;
            for part in own.into_iter().filter(|part| part.candidate != names.best.candidate) {
                all.push(part.clone());
                match is_foretold(search, &all, all.len() - 1) {
                    true => parts.push(part),
                    false => drop(all.pop()),
                }
            }
            told.push(GivenName { term: names.best, probability, group: here.clone() });
        }
        Naming { told, parts, likely, groups }
    }

    /// What a term belongs to.
    pub fn group(&self, term: &ModelTerm) -> Group {
        self.group_of(term.candidate)
    }

    fn group_of(&self, candidate: usize) -> Group {
        let candidate = &self.candidates[candidate];
        let joint = |on: Dependence| match on {
            Dependence::Joint(_, j) => Some(j),
            Dependence::Other(_) => None,
        };
        let on = candidate.features.iter().flat_map(|feature| feature.depends_on());
        let mut drivers: Vec<usize> = on.filter_map(joint).collect();
        drivers.sort_unstable();
        drivers.dedup();
        Group { place: candidate.place.seat(), drivers }
    }

    /// The groups of these parts by how much of what is there goes with all parts of a group together, most first.
    fn groups(&self, search: &Search, in_model: &[ModelTerm], parts: &[ModelTerm]) -> Vec<Group> {
        let mut groups: Vec<Group> = Vec::new();
        for part in parts {
            let own = self.group(part);
            if !groups.contains(&own) {
                groups.push(own);
            }
        }
        let left_without = |group: &Group| {
            let others = parts.iter().filter(|part| self.group(part) != *group);
            let others: Vec<ModelTerm> = in_model.iter().chain(others).cloned().collect();
            search.rows.residual.dot(&search.beside_names(&others).apply(&search.rows.residual))
        };
        let mut by_size: Vec<(f64, Group)> =
            groups.into_iter().map(|group| (left_without(&group), group)).collect();
        by_size.sort_by(|a, b| b.0.total_cmp(&a.0));
        by_size.into_iter().map(|(_, group)| group).collect()
    }

    /// Names for what the group of `own`, which is all of it, does beside the `others`. `search`: with free functions.
    fn names(&self, search: &Search, own: &[ModelTerm], others: &[ModelTerm]) -> Option<Names> {
        let group = self.group(own.first()?);
        let here = |c: &usize| self.group_of(*c) == group;
        let all: Vec<usize> = (0..self.candidates.len()).filter(here).collect();
        let (families, free): (Vec<usize>, Vec<usize>) = all.into_iter().partition(|c| *c < self.first);
        // By how much chance is larger than the noise says counts against all of them alike.
        let taken_in = [others, own].concat();
        let overdispersion = search.leftover(&search.beside_names(&taken_in)).overdispersion.max(1.0);
        let search = &Search { overdispersion, ..self.search(search, search.rows) };
        let ground = Arc::new(search.beside_names(others));
        let left = ground.apply(&search.rows.residual);
        let Departure { columns: departure, energy, nameless } =
            self.departure(search, own, &free, &ground)?;
        let worth = |columns: &DMatrix<f64>| ground.worth(columns, &left, overdispersion);
        let often = |c: usize| search.priors[c].exp();
        let of_all: f64 = families.iter().map(|c| often(*c)).sum();
        let each = (1.0 - NAMELESS) / of_all / DEPARTURES.len() as f64;
        let mut weighed: BTreeMap<&str, Vec<Hypothesis>> = BTreeMap::new();
        for plain in search.compare(ground.clone(), Some(&families)).iter().take(COMPARED) {
            let c = plain.candidate;
            // It departs by a part of its own size: what does next to nothing explains nothing by departing from it.
            let size = (2.0 * plain.score.gain.max(0.0) / energy).sqrt().min(1.0);
            if 1.0 - size * size > (FARTHEST * size).powi(2) && Rule::FarFromFamily.decides() {
                continue;
            }
            let Some(term) = search.enter_bare(plain, &ground) else { continue };
            // What the family does itself is no departure from it.
            let departure = ground.across(&departure, &term.columns);
            for part in DEPARTURES {
                let columns = &departure * (part * size);
                let beside = Arc::new(ground.with(&(&columns / overdispersion.sqrt())));
                for hypothesis in search.compare(beside, Some(&[c])) {
                    let prior = (each * often(c)).ln() - search.priors[c];
                    let weight = worth(&columns) + hypothesis.weight + prior;
                    let of_name = weighed.entry(self.candidates[c].told_as.as_str()).or_default();
                    of_name.push(Hypothesis { weight, ..hypothesis });
                }
            }
        }
        let nothing = nameless + NAMELESS.ln();
        let of_name = |hypotheses: &Vec<Hypothesis>| {
            log_sum_exp(&hypotheses.iter().map(|h| h.weight).collect::<Vec<f64>>())
        };
        let weights: Vec<f64> = weighed.values().map(of_name).chain([nothing]).collect();
        let total = log_sum_exp(&weights);
        let best = |hypotheses: Vec<Hypothesis>| {
            hypotheses.into_iter().max_by(|a, b| a.weight.total_cmp(&b.weight)).expect("one at least")
        };
        let mut all: Vec<Name> = (weighed.into_values().zip(weights))
            .map(|(own, weight)| Name { hypothesis: best(own), probability: (weight - total).exp() })
            .collect();
        all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        let best = search.enter_bare(&all.first()?.hypothesis, &ground)?;
        let initial = search.initial_of(&best);
        Some(Names { all, best: ModelTerm { initial, near: families, ..best } })
    }

    /// What the free functions of the group say beside the `ground`; `None` where that is nothing.
    fn departure(
        &self,
        search: &Search,
        own: &[ModelTerm],
        free: &[usize],
        ground: &Arc<Marginal>,
    ) -> Option<Departure> {
        let compared = search.compare(ground.clone(), Some(free));
        let each = compared.iter().map(|h| h.weight - search.priors[h.candidate]);
        let best = search.enter_bare(compared.first()?, ground)?;
        let is_free = |term: &&ModelTerm| term.candidate >= self.first && term.candidate != best.candidate;
        let functions: Vec<&ModelTerm> = own.iter().filter(is_free).chain([&best]).collect();
        let side_by_side = |of: &dyn Fn(&ModelTerm) -> DMatrix<f64>| {
            let parts: Vec<DMatrix<f64>> = functions.iter().map(|term| of(term)).collect();
            side_by_side(&parts.iter().collect::<Vec<_>>(), search.rows.residual.len())
        };
        let columns = side_by_side(&|term| term.columns.clone());
        let (gram, toward) = search.normal(&columns, ground);
        // As large as is usual: how much larger they are is integrated over, as it is for a name.
        let usual = side_by_side(&|term| &term.columns / term.score.room);
        let (usual_gram, usual_toward) = search.normal(&usual, ground);
        let overdispersion = search.overdispersion;
        let together = evidence(&usual_gram, &usual_toward, usual.ncols(), overdispersion, 0).evidence;
        // One of the free functions, or a set of several: nobody knows beforehand which.
        let one = log_mean_exp(&each.collect::<Vec<f64>>());
        let count = free.len().max(functions.len());
        let several = |k: usize| ((count - k) as f64 / (k + 1) as f64).ln();
        let sets: f64 = (0..functions.len()).map(several).sum();
        let nameless = if functions.len() > 1 { log_mean_exp(&[one, together - sets]) } else { one };
        let spread = gram.trace();
        let solution = solved(gram.clone(), &toward)?;
        let energy = solution.dot(&(gram * &solution));
        let columns = columns * (energy / spread).sqrt();
        (spread > 0.0 && energy > 0.0).then_some(Departure { columns, energy, nameless })
    }
}

/// What the free functions of a group say.
struct Departure {
    /// Whitened columns of those that are there; with standard normal coefficients as large as what is there.
    columns: DMatrix<f64>,
    /// The energy of that.
    energy: f64,
    /// Logarithm of the evidence that it is a free function, or a set of them, and no family.
    nameless: f64,
}

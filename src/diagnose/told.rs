//! What is told by name: how likely it is, what else it may be, how large, and what to do.

use super::diagnosis::Named;
use super::evidence::log_sum_exp;
use super::finding::{AlsoAt, Confusable, Finding, Size};
use super::held_out::Model;
use super::names::{GivenName, Naming};
use super::odds::{LISTED, Odds, confusable, is_same_elsewhere, odds, trust};
use super::placebo::Placebo;
use super::policy::Rule;
use super::search::Search;
use super::shares::Shares;
use super::stretch::wheres;
use super::terms::{Hypothesis, ModelTerm, all_but};
use crate::effects::Library;
use crate::machine::Machine;
use crate::units::ByQuantity;

/// A common effect of which the shape is less than this part of all is what it looks like.
const PLAIN: f64 = 0.01;
/// Logarithm of the odds at which a finding is told.
const TOLD: f64 = 5.0;
/// A name whose cause may be exchanged for a meaningless one, with evidence greater by this logarithm, is none.
const OUTDONE: f64 = 5.0;

/// What is told by name.
#[derive(Clone)]
pub(super) struct Told {
    pub term: ModelTerm,
    pub finding: Finding,
    pub named: Named,
    pub placebo: Option<Placebo>,
}

/// The finding of a part that got a name, beside the `others`. Its size is that of all that its group does; what the model leaves to a free
/// function there departs from it.
pub(super) fn promoted(
    search: &Search,
    others: &[ModelTerm],
    naming: &Naming,
    k: usize,
    shares: &Shares,
    (machine, library): (&Machine, &Library),
) -> Option<Told> {
    let GivenName { term, probability, group } = &naming.told[k];
    let named = naming.told.iter().map(|given| given.term.clone());
    let all: Vec<ModelTerm> = named.chain(others.iter().cloned()).collect();
    let model = Model::new(search, &all);
    let (finding, named) = finding(search, &all, k, shares, (machine, library), &model)?;
    let mut finding = Finding { probability: *probability, also_at: Vec::new(), ..finding };
    // What else it may be there has been asked together with its name.
    let names = naming.likely(group);
    finding.confusable_with.retain_mut(|other| {
        let asked = names.iter().find(|name| name.effect == other.effect && other.at == finding.at);
        other.probability = asked.map_or(0.0, |name| name.probability);
        asked.is_some()
    });
    Some(Told { term: term.clone(), finding, named, placebo: None })
}

/// Whether a meaningless cause does better.
pub(super) fn is_outdone(placebo: &Option<Placebo>) -> bool {
    placebo.as_ref().is_some_and(|placebo| placebo.ahead > OUTDONE && Rule::Outdone.decides())
}

/// Rivals of a name as what stands instead of it: what has its place beside the name as well is no other name for the same, (64).
fn instead(
    search: &Search,
    in_model: &[ModelTerm],
    own: &Hypothesis,
    overdispersion: f64,
    mut hypotheses: Vec<Hypothesis>,
) -> Vec<Hypothesis> {
    let counts =
        |r: &Hypothesis| !search.is_form(r.candidate, own.candidate) && r.weight > own.weight + LISTED.ln();
    if !hypotheses.iter().any(counts) {
        return hypotheses;
    }
    let field = search.rows.field(search.beside(in_model, None));
    for r in hypotheses.iter_mut().filter(|r| counts(r)) {
        let (candidate, at) = (&search.candidates[r.candidate], &r.score.parameters);
        let Some(score) = search.rows.score_at(candidate, at, &field, search.overdispersion) else {
            continue;
        };
        // What its other parameters cost is as it was.
        let weight = search.priors[r.candidate] + score.at_best + r.score.evidence - r.score.at_best;
        let beside = search.tempered(&Hypothesis::new(r.candidate, weight, score), overdispersion);
        r.weight -= log_sum_exp(&[0.0, beside.weight]);
    }
    hypotheses
}

/// What is said of effect `i`; nothing where its hypotheses leave too little evidence.
pub(super) fn finding(
    search: &Search,
    in_model: &[ModelTerm],
    i: usize,
    shares: &Shares,
    (machine, library): (&Machine, &Library),
    model: &Model,
) -> Option<(Finding, Named)> {
    let (left, total, effect) = (&shares.left, shares.total(), &in_model[i]);
    let hypotheses = search.rivals_of(in_model, i);
    let others = all_but(in_model, Some(i));
    let fit = |r: &&Hypothesis| r.candidate == effect.candidate || !search.repeats(r, &others);
    let hypotheses: Vec<Hypothesis> =
        hypotheses.iter().filter(fit).map(|r| search.tempered(r, left.overdispersion)).collect();
    let own =
        hypotheses.iter().find(|r| r.candidate == effect.candidate).filter(|r| r.weight > TOLD).cloned()?;
    let hypotheses = instead(search, in_model, &own, left.overdispersion, hypotheses);
    let is_plain = search.commonness[own.candidate] == 0.0 && shares.discrepancies < PLAIN * total;
    let odds = odds(search, &hypotheses, &own, left.overdispersion.max(search.overdispersion), is_plain);
    let is_same =
        |o: &Odds| o.is_listed && is_same_elsewhere(search, &own, o.hypothesis, left.overdispersion);
    let is_own = |o: &&Odds| search.is_form(o.hypothesis.candidate, own.candidate) || is_same(o);
    let own_odds: f64 = odds.iter().filter(is_own).map(|o| o.probability).sum();
    let trusted = trust(shares.discrepancies / total, 2.0 * own.weight);
    let probability = own_odds.min(1.0) * trusted;
    let candidate = &search.candidates[effect.candidate];
    let family = &library.families()[candidate.family];
    let mut solved = model.effect(search, in_model, i, shares.departure());
    let mut parameters = effect.score.parameters.clone();
    let jumps = |p: &usize| !candidate.parameters[*p].smooth && !candidate.parameters[*p].whole;
    for p in (0..parameters.len()).filter(jumps) {
        let Some((middle, deviation)) = Model::jumping(search, in_model, i, p) else { continue };
        parameters[p] = middle;
        let own = solved.coefficients.len() + p;
        solved.covariance[own][own] = deviation * deviation;
    }
    let identified = solved.identified(candidate, library, parameters);
    let sizes = identified.sizes(&search.rows.linear.samples);
    let named = Named { effect: identified.stored(machine, &sizes), scales: effect.scales(search) };
    let (mut confusable_with, mut also_at): (Vec<Confusable>, Vec<AlsoAt>) = (Vec::new(), Vec::new());
    for o in odds.iter().filter(|o| o.is_listed) {
        let other =
            Confusable { probability: o.probability * trusted, ..confusable(o, search, machine, family) };
        if is_same(o) {
            if also_at.iter().all(|known| known.at != other.at) {
                also_at.push(AlsoAt { at: other.at, separate_by: other.separate_by });
            }
            continue;
        }
        match confusable_with.iter_mut().find(|c| (&c.effect, &c.at) == (&other.effect, &other.at)) {
            Some(known) => known.probability += other.probability,
            None => confusable_with.push(other),
        }
    }
    let finding = Finding {
        effect: candidate.told_as.clone(),
        form: (candidate.told_as != candidate.effect).then(|| candidate.effect.clone()),
        at: candidate.place.name(machine),
        explanation: identified.sentence(machine, &sizes),
        cause: family.cause.clone(),
        remedy: identified.remedy(machine, &sizes),
        coefficients: sizes
            .into_iter()
            .map(|s| Size {
                name: s.name,
                value: s.value,
                unit: s.unit,
                std_error: s.std_error.unwrap_or(f64::NAN),
            })
            .collect(),
        probability,
        delta_bic: 2.0 * own.weight,
        held_out_rms: ByQuantity::default(),
        r#where: wheres(search, &|row| effect.columns.row(row).norm_squared()),
        placebo: None,
        also_at,
        confusable_with,
        share: 0.0,
    };
    Some((finding, named))
}

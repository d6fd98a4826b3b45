//! From what the search took in to what is said: which names hold, what is unexplained, and all figures.

use rayon::prelude::*;

use super::along::along_travel;
use super::approaches::approaches;
use super::contained::says_no_more;
use super::diagnosis::{Diagnosis, Named, SharedEffect, Thinned};
use super::finding::{Confusable, Finding, Meaningless, Size};
use super::folds;
use super::held_out::Model;
use super::marginal::Marginal;
use super::nameless::{Unexplained, UnnamedPart};
use super::names::{GivenName, LIKELY, Naming};
use super::noise::Noise;
use super::odds::{Odds, confusable, odds, trust};
use super::orders;
use super::outbid::outbid;
use super::outliers;
use super::parts::{Unnamed, least_foretold};
use super::pictures::Traces;
use super::placebo::{Placebo, placebo};
use super::propose;
use super::rms::{by_model, rms_of};
use super::search::Search;
use super::series::Standing;
use super::set_ups;
use super::shared;
use super::shares::Shares;
use super::speeds::levelled;
use super::stretch::wheres;
use super::terms::{Hypothesis, ModelTerm, all_but};
use super::traces;
use super::unexplained;
use super::whereabouts::{standing, whereabouts};
use crate::effects::{Library, Place, RecordingFacts, in_words};
use crate::feature::Dimension;
use crate::machine::Machine;
use crate::units::{ByQuantity, Quantity};

/// What is left may be this part of what geometry leaves over before nothing counts as explained.
const TOLERATED: f64 = 0.2;
/// What stretches that were left out hold beyond what the others foretell may be this part of all; more where noise that remembers
/// leaves fewer independent readings.
const SURPRISE: f64 = 0.003;
/// What is modelled without a name leaves no more than this part of the squares of left-out stretches beyond the noise's. Where it foretells
/// less, the law is another one, and where that does nothing, what was taken for it would do harm.
const HALF: f64 = 0.5;
/// Several names that make the mean square of stretches left out so many times that of geometry alone are a patchwork.
const WORSE: f64 = 2.0;
/// More events of one moment each in one session are no slips: something is loose, or the instrument jumps to and fro.
const EVENTS: usize = 2;
/// Structure counts beyond this many standard deviations of chance.
const CHANCE: f64 = 5.0;
/// The same for functions of where a joint stands: chance alone does so in one of some hundred recordings of settled positions.
const ALONG: f64 = 4.5;
/// Logarithm of the evidence at which a series (69) is structure: there are some hundred of them.
const STANDING: f64 = 12.0;
/// Where shapes make up less than this part of all, the names are no patches, whatever surprises.
const ODD_DISCREPANCY: f64 = 0.05;
/// A common effect of which the shape is less than this part of all is what it looks like.
const PLAIN: f64 = 0.01;
/// Names whose odds are no less than this part of the best one's cannot be told from it.
const ALIAS: f64 = 1.0 / 3.0;
/// Logarithm of the odds at which a finding is told.
const TOLD: f64 = 5.0;
/// A name whose cause may be exchanged for a meaningless one, with evidence greater by this logarithm, is none.
const OUTDONE: f64 = 5.0;

/// Residuals with the effects taken away, m and rad.
pub(super) fn residual_of(search: &Search, in_model: &[ModelTerm]) -> Vec<f64> {
    Model::new(search, in_model).residual(search, in_model)
}

/// Everything that is said of the effects that the search took in.
pub(super) fn report(
    search: &Search,
    in_model: &[ModelTerm],
    (machine, library, facts): (&Machine, &Library, &RecordingFacts),
    noise: &[Noise],
    propose: bool,
) -> Diagnosis {
    let linear = search.rows.linear;
    let mut shares = search.shares(in_model);
    let mut doubt = match doubt(search, in_model, machine, &shares, noise) {
        Some(Doubt { but: Some(i), .. }) => {
            return report(search, &in_model[i..=i], (machine, library, facts), noise, propose);
        }
        doubt => doubt,
    };
    // Where names do not explain all that is there, they stand if they foretell more than what has no name does.
    let proved = doubt.as_ref().and_then(|_| proved(search, in_model, (machine, facts), noise));
    let is_proved = proved.is_some();
    let in_model = proved.as_deref().unwrap_or(in_model);
    if is_proved {
        shares = search.shares(in_model);
    }
    let mut told: Vec<(usize, Finding, Named)> = match doubt {
        Some(_) if !is_proved => Vec::new(),
        _ => {
            let model = Model::new(search, in_model);
            let one = |i| finding(search, in_model, i, &shares, (machine, library), &model);
            let all = (0..in_model.len()).into_par_iter();
            all.filter_map(|i| one(i).map(|(finding, named)| (i, finding, named))).collect()
        }
    };
    let mut placebos: Vec<Option<Placebo>> =
        told.par_iter().map(|(i, ..)| placebo(search, in_model, *i, machine)).collect();
    for ((_, finding, _), placebo) in told.iter_mut().zip(&placebos) {
        finding.placebo = placebo
            .as_ref()
            .map(|placebo| Meaningless { cause: placebo.cause.clone(), share: placebo.share });
    }
    let place = |i: &usize| search.candidates[in_model[*i].candidate].place;
    // What is said at a place beside a name for nothing is the rest of a patchwork.
    let empty: Vec<Place> = (told.iter().zip(&placebos))
        .filter(|((i, ..), placebo)| is_outdone(placebo) || says_no_more(search, in_model, *i))
        .map(|((i, ..), _)| place(i))
        .collect();
    // Of settled positions, names are told only where they foretell others.
    let holds = |(i, finding, _): &(usize, Finding, Named)| {
        !empty.contains(&place(i)) && (!search.in_motion || finding.probability > LIKELY)
    };
    let likely = told.iter().filter(|told| holds(told)).count();
    if likely < told.len() {
        let unlikely = told.iter().filter(|told| !holds(told));
        doubt = unlikely
            .max_by(|a, b| in_model[a.0].score.gain.total_cmp(&in_model[b.0].score.gain))
            .map(|(i, ..)| Doubt::at(place(i), 2.0 * in_model[*i].score.gain));
        // Of a patchwork no piece is a name.
        let patchwork = told.len() - likely > likely;
        let both = told.into_iter().zip(placebos).filter(|(told, _)| !patchwork && holds(told));
        (told, placebos) = both.unzip();
    }
    // In order of evidence.
    let mut all: Vec<_> = told.into_iter().zip(placebos).collect();
    all.sort_by(|(a, _), (b, _)| b.1.delta_bic.total_cmp(&a.1.delta_bic));
    let (told, placebos): (Vec<_>, Vec<_>) = all.into_iter().unzip();
    let kept: Vec<ModelTerm> = told.iter().map(|(i, ..)| in_model[*i].clone()).collect();
    let mut shared_effects = shared::effects(search, library, &kept);
    let mut told: Vec<Told> = (told.into_iter().zip(placebos).zip(kept))
        .map(|(((_, finding, named), placebo), term)| Told { term, finding, named, placebo })
        .collect();
    // Names that explain most of what is there stand; what they leave may be foretold all the same.
    let is_rest = doubt.is_none() && !told.is_empty() && shares.left.beyond > CHANCE;
    let doubt = doubt.or_else(|| is_rest.then(|| Doubt::of(shares.left.energy)));
    // What has no name as it is, is modelled all the same, and then asked for its name.
    let unnamed = doubt.as_ref().map(|_| Unnamed::beside(search, machine, facts));
    let wide = unnamed.as_ref().map(|unnamed| unnamed.rows(search));
    let wide = unnamed.as_ref().zip(wide.as_ref()).map(|(unnamed, rows)| unnamed.search(search, rows));
    let (narrow, search) = (search, wide.as_ref().unwrap_or(search));
    let (mut parts, mut of_parts, mut unexplained) = (Vec::new(), Vec::new(), None);
    let mut of_shared = None;
    let mut proposals = Vec::new();
    if let Some((unnamed, doubt)) = unnamed.as_ref().zip(doubt) {
        let mut known: Vec<ModelTerm> =
            told.iter().map(|t| &t.term).chain(&shared_effects).cloned().collect();
        let (modelled, only_told) = unnamed.parts(search, &known);
        let naming = unnamed.named(search, &known, modelled.clone());
        let found: Vec<ModelTerm> =
            naming.told.iter().map(|given| &given.term).chain(&naming.parts).cloned().collect();
        let all = [known.as_slice(), &found].concat();
        let is_modelled = !modelled.is_empty()
            && folds::remaining(search, noise, &all, known.len()).is_some_and(|part| part <= HALF);
        // What helped alone may do harm beside them.
        while let Some(i) = is_modelled
            .then(|| folds::worst(search, &[known.as_slice(), &found].concat(), told.len()))
            .flatten()
        {
            told.remove(i);
            let kept: Vec<ModelTerm> = told.iter().map(|t| t.term.clone()).collect();
            shared_effects = shared::effects(narrow, library, &kept);
            known = [kept.as_slice(), &shared_effects].concat();
        }
        let (naming, only_told) = match is_modelled {
            true => (naming, Vec::new()),
            false if is_rest => (naming.withdrawn(), Vec::new()),
            false => (naming.withdrawn(), modelled.into_iter().chain(only_told).collect()),
        };
        for k in 0..naming.told.len() {
            let others = naming.parts.iter().filter(|part| unnamed.group(part) != naming.told[k].group);
            let others: Vec<ModelTerm> = known.iter().chain(others).cloned().collect();
            told.extend(promoted(search, &others, &naming, k, &shares, (machine, library)));
        }
        told.sort_by(|a, b| b.finding.delta_bic.total_cmp(&a.finding.delta_bic));
        let known: Vec<ModelTerm> = told.iter().map(|t| &t.term).chain(&shared_effects).cloned().collect();
        let shown = [naming.parts.as_slice(), &only_told].concat();
        let all = [known.as_slice(), &shown].concat();
        // All together: what stands in the model was solved with all that stands there.
        let mut described = unnamed.told(search, &all, &shares, (machine, library), is_modelled);
        let of_shown = described.split_off(known.len());
        let (told_terms, rest) = described.split_at(told.len());
        told.iter_mut().zip(told_terms).for_each(|(told, (_, named))| told.named = named.clone());
        of_shared = Some(rest.iter().map(|(_, named)| named.clone()).collect::<Vec<Named>>());
        let names = |term: &ModelTerm| naming.likely(&unnamed.group(term));
        let rank = |term: &ModelTerm| naming.rank(&unnamed.group(term));
        let mut shown_parts = Vec::new();
        for ((part, named), term) in of_shown.into_iter().zip(&shown) {
            shown_parts.push((rank(term), UnnamedPart { names: names(term), ..part }));
            if is_modelled {
                of_parts.push(named);
            }
        }
        if is_modelled {
            if propose {
                let given = (machine, library, facts);
                proposals = propose::proposals(search, unnamed, (&known, &shown), &names, given);
            }
            parts = shown;
        }
        let found = search.beside_names(&known);
        let is_named = is_rest || is_proved || !naming.told.is_empty();
        let doubt = match is_named {
            true => still(search, &found, doubt, !shown_parts.is_empty()),
            false => Some(doubt),
        };
        let left = if is_named { &found } else { &search.base };
        unexplained = doubt.map(|doubt| unexplained_by(search, machine, noise, &doubt, left));
        if let Some(unexplained) = &mut unexplained {
            unexplained.take(shown_parts);
        }
    }
    let kept: Vec<ModelTerm> = told.iter().map(|told| told.term.clone()).collect();
    let placebos: Vec<Option<Placebo>> = told.iter_mut().map(|told| told.placebo.take()).collect();
    let left_over = residual_of(search, &[kept.as_slice(), &parts].concat());
    let in_model = [kept.as_slice(), &shared_effects, &parts].concat();
    let set_ups_left_out = set_ups::left_out(search, &in_model, &placebos);
    let (findings, mut named): (Vec<Finding>, Vec<Named>) =
        told.into_iter().map(|told| (told.finding, told.named)).unzip();
    let of_shared =
        of_shared.unwrap_or_else(|| shared::named(search, (machine, library), &kept, &shared_effects));
    named.extend(of_shared);
    named.extend(of_parts);
    let mut diagnosis = Diagnosis {
        machine: machine.name().into(),
        recordings: linear.spans.iter().map(|s| s.label.clone()).collect(),
        samples: linear.all_samples,
        thinned: (linear.every > 1)
            .then_some(Thinned { every: linear.every, samples: linear.lines.len() as u64 }),
        noise_floor: ByQuantity::of(|quantity| noise_of(search, noise, quantity == Quantity::Angle)),
        rms: ByQuantity::of(|quantity| {
            let left = rms_of(search, &left_over, quantity == Quantity::Angle);
            by_model(linear.fit.rms[quantity], left)
        }),
        geometry_numbers: linear.fit.combinations.iter().filter(|c| c.share > 0.5).count() as u64,
        held_out_rms: ByQuantity::default(),
        set_ups_left_out,
        shape_share: (!findings.is_empty()).then(|| shares.discrepancies / shares.total()),
        findings,
        unexplained,
        proposals,
        shared: (shared_effects.iter())
            .map(|effect| &search.candidates[effect.candidate])
            .map(|c| SharedEffect {
                effect: c.effect.clone(),
                at: c.place.name(machine),
                of_set_up: library.families()[c.family].each_setup,
            })
            .collect(),
        stand_still: approaches(search, &in_model, machine),
        named,
        not_tried: Vec::new(),
        unseen_side_branches: Vec::new(),
        far_off: linear.fit.far_off(),
        dropped: linear.fit.dropped,
        outliers: Vec::new(),
        rms_without_outliers: ByQuantity::default(),
        traces: Traces::default(),
        location_errors: linear.fit.location_errors.clone(),
    };
    outliers::fill(search, &residual_of(search, &[]), &left_over, &mut diagnosis);
    folds::fill(search, &in_model, &mut diagnosis);
    traces::fill(search, &kept, &left_over, machine, &mut diagnosis);
    orders::join(search, &kept, &mut diagnosis);
    diagnosis.findings.iter_mut().for_each(Finding::share_out);
    diagnosis
}

/// What is told by name.
struct Told {
    term: ModelTerm,
    finding: Finding,
    named: Named,
    placebo: Option<Placebo>,
}

/// The finding of a part that got a name, beside the `others`. Its size is that of all that its group does; what the model leaves to a free
/// function there departs from it.
fn promoted(
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
    let mut finding = Finding { probability: *probability, ..finding };
    // What else it may be there has been asked together with its name.
    let names = naming.likely(group);
    finding.confusable_with.retain_mut(|other| {
        let asked = names.iter().find(|name| name.effect == other.effect && other.at == finding.at);
        other.probability = asked.map_or(0.0, |name| name.probability);
        asked.is_some()
    });
    Some(Told { term: term.clone(), finding, named, placebo: None })
}

/// The effects that foretell stretches that were left out, each beside the others, where all of them together leave no more than half of
/// the squares there; unless parts in their place foretell these better, by more than one standard error, `docs/diagnosis-method.md` (81).
fn proved(
    search: &Search,
    in_model: &[ModelTerm],
    (machine, facts): (&Machine, &RecordingFacts),
    noise: &[Noise],
) -> Option<Vec<ModelTerm>> {
    // No other recording has this one's clock.
    let lasting = in_model.iter().filter(|effect| !search.goes_by_clock(effect.candidate));
    let mut names: Vec<ModelTerm> = lasting.cloned().collect();
    let is_empty = |names: &[ModelTerm], i: usize| {
        is_outdone(&placebo(search, names, i, machine)) || says_no_more(search, names, i)
    };
    let worst = |names: &[ModelTerm]| {
        least_foretold(search, names).or_else(|| (0..names.len()).find(|i| is_empty(names, *i)))
    };
    while let Some(i) = worst(&names) {
        names.remove(i);
    }
    if folds::remaining(search, noise, &names, 0).is_none_or(|part| part > HALF) {
        return None;
    }
    let unnamed = Unnamed::beside(search, machine, facts);
    let rows = unnamed.rows(search);
    let search = unnamed.search(search, &rows);
    let (parts, _) = unnamed.parts(&search, &[]);
    // Parts that are these names and more say nothing against them.
    let is_among = |name: &ModelTerm| parts.iter().any(|part| part.candidate == name.candidate);
    let stand = names.iter().all(is_among) || !folds::are_better(&search, &parts, &names);
    stand.then_some(names)
}

/// Whether a meaningless cause does better.
fn is_outdone(placebo: &Option<Placebo>) -> bool {
    placebo.as_ref().is_some_and(|placebo| placebo.ahead > OUTDONE)
}

/// What is still without a name when names were found for a part of it.
fn still(search: &Search, found: &Marginal, doubt: Doubt, has_parts: bool) -> Option<Doubt> {
    let (left, all) = (search.leftover(found), search.leftover(&search.base));
    let is_much = left.beyond > CHANCE && left.energy > TOLERATED * all.energy;
    (is_much || has_parts).then_some(Doubt { energy: left.energy, ..doubt })
}

/// Structure without a name: where, if that is known, and its energy in units of the noise's variance.
struct Doubt {
    place: Option<Place>,
    /// Another joint whose position it goes with.
    with: Option<usize>,
    energy: f64,
    /// The effect that says nearly all of it by itself, if there is one.
    but: Option<usize>,
}

impl Doubt {
    fn of(energy: f64) -> Self {
        Doubt { place: None, with: None, energy, but: None }
    }

    fn at(place: Place, energy: f64) -> Self {
        Doubt { place: Some(place), ..Doubt::of(energy) }
    }

    fn standing(series: &Standing) -> Self {
        Doubt { with: series.with, ..Doubt::at(series.place, 2.0 * series.gain) }
    }
}

/// Why the names that were taken in do not explain what is there, if they do not.
fn doubt(
    search: &Search,
    in_model: &[ModelTerm],
    machine: &Machine,
    shares: &Shares,
    noise: &[Noise],
) -> Option<Doubt> {
    let (left, total) = (&shares.left, shares.total());
    let (surprise, deviation) = folds::surprise(search, in_model).unwrap_or((0.0, 1.0));
    let memory = noise.iter().map(Noise::memory).fold(1.0, f64::max);
    let patched = search.patched(in_model).or_else(|| search.wandering(in_model));
    // What sounds does so louder and softer, and hardly ever at quite one frequency.
    let wanders = in_model.iter().any(|effect| search.is_tone(effect.candidate));
    let is_unexplained = patched.is_some()
        || left.beyond > CHANCE && (in_model.is_empty() || left.energy > TOLERATED * total)
        || left.beyond > CHANCE && search.in_motion && in_model.len() >= search.most()
        || in_model.iter().filter(|effect| search.is_event(effect.candidate)).count() > EVENTS
        || shares.is_discrepant(in_model.len())
        || search.in_motion && in_model.len() > 1 && folds::worsen(search, in_model, WORSE)
        || search.in_motion && !wanders && shares.is_unlike()
        || shares.discrepancies > ODD_DISCREPANCY * total
            && surprise > CHANCE * left.overdispersion.max(1.0) * deviation
            && surprise > SURPRISE * memory * total;
    if is_unexplained {
        let energy = search.leftover(&search.base).energy.max(left.energy);
        return Some(Doubt { place: patched, ..Doubt::of(energy) });
    }
    if let Some((series, but)) = outbid(search, in_model, machine) {
        return Some(Doubt { but, ..Doubt::standing(&series) });
    }
    let is_much = |energy: f64| energy > TOLERATED * (total + energy);
    let beside = search.beside(in_model, None);
    let series = |beside: Marginal| {
        standing(search, machine, beside)
            .filter(|series| series.evidence > STANDING && is_much(2.0 * series.gain))
            .map(|series| Doubt::standing(&series))
    };
    if search.in_motion {
        // What is much shows in blocks of samples, what is weak in a series alone.
        return in_model.is_empty().then(|| series(beside)).flatten();
    }
    // Settled positions show no course, but they may show a function of where a joint stands, or of something else that is known.
    let along = along_travel(search, machine, &beside)
        .filter(|along| along.beyond > ALONG * search.overdispersion && is_much(along.energy))
        .map(|along| Doubt::at(Place::Joint(along.joint), along.energy));
    along.or_else(|| series(beside))
}

/// What is said of effect `i`; nothing where its hypotheses leave too little evidence.
fn finding(
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
    let is_plain = search.commonness[own.candidate] == 0.0 && shares.discrepancies < PLAIN * total;
    // A shape that is little beside all may be much beside this one.
    let in_discrepancy = shares.discrepancies < PLAIN * 2.0 * own.score.gain;
    let hypotheses = if in_discrepancy { hypotheses } else { levelled(search, &own, hypotheses) };
    let odds = odds(search, &hypotheses, &own, left.overdispersion.max(search.overdispersion), is_plain);
    let own_odds =
        odds.iter().find(|o| o.hypothesis.candidate == own.candidate).map_or(0.0, |o| o.probability);
    let is_alike = |o: &&Odds| {
        o.probability >= ALIAS * own_odds || search.is_form(o.hypothesis.candidate, own.candidate)
    };
    let alike = odds.iter().filter(is_alike).map(|o| o.probability);
    let probability = alike.sum::<f64>().min(1.0) * trust(shares.discrepancies / total, 2.0 * own.weight);
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
    let mut confusable_with: Vec<Confusable> = Vec::new();
    for o in odds.iter().filter(|o| o.is_listed) {
        let other = confusable(o, search, machine, family);
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
        confusable_with,
        share: 0.0,
    };
    Some((finding, named))
}

/// What is said of structure without a name; `found`: the marginal beside what has one.
fn unexplained_by(
    search: &Search,
    machine: &Machine,
    noise: &[Noise],
    doubt: &Doubt,
    found: &Marginal,
) -> Unexplained {
    let left = found.apply(&search.rows.residual);
    let (place, with) = doubt.place.map_or_else(|| whereabouts(search, machine), |place| (place, doubt.with));
    let at = place.name(machine);
    let goes_with = with.map(|joint| Place::Joint(joint).name(machine));
    let length = noise_of(search, noise, false);
    let sigma = length.or(noise_of(search, noise, true)).unwrap_or(1.0);
    let rms_m = sigma * (doubt.energy / search.rows.whitener.count().max(1) as f64).sqrt();
    let size = match length {
        Some(_) => format!("{:.2} um", 1e6 * rms_m),
        None => in_words(rms_m, None, Dimension::ANGLE, None),
    };
    let (r#where, gathers) = unexplained::gathered(search, machine, left.as_slice());
    let mut explanation =
        format!("structure of {size} is left that no named effect explains; it fits best at {at}");
    if let Some(other) = &goes_with {
        explanation += &format!(" and goes with where {other} stands too");
    }
    for gathering in &gathers {
        explanation += &format!("; {}", gathering.in_words());
    }
    Unexplained { rms_m, at, goes_with, r#where, gathers, parts: Vec::new(), explanation }
}

/// Standard deviation of the noise of lengths (m) or angles (rad), where such were read.
fn noise_of(search: &Search, noise: &[Noise], angle: bool) -> Option<f64> {
    let is_of = |run: &[usize]| run.first().is_some_and(|row| search.rows.linear.angle[*row] == angle);
    search.runs.iter().zip(noise).find(|(run, _)| is_of(run)).map(|(_, noise)| noise.sigma)
}

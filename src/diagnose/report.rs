//! From what the search took in to what is said: which names hold, what is unexplained, and all figures.

use rayon::prelude::*;

use super::approaches::{approaches, stand_still};
use super::contained::says_no_more;
use super::diagnosis::{Diagnosis, Named, RmsByModel, SharedEffect, Thinned};
use super::discrepancy::is_of_position;
use super::doubt::{CHANCE, Doubt, doubt, still};
use super::drives::Drives;
use super::finding::{Finding, Meaningless};
use super::folds;
use super::held_out::Model;
use super::marginal::Marginal;
use super::nameless::{Proposal, Unexplained, UnnamedPart};
use super::names::LIKELY;
use super::noise::{self, Noise};
use super::orders;
use super::outliers;
use super::parts::{Unnamed, least_foretold};
use super::pictures::Traces;
use super::placebo::{Placebo, placebo};
use super::policy::Rule;
use super::propose;
use super::rms::{LeftOut, rms_of};
use super::search::Search;
use super::set_ups;
use super::shared;
use super::shares::Shares;
use super::terms::ModelTerm;
use super::told::{Told, finding, is_outdone, promoted};
use super::traces;
use super::unexplained;
use super::whereabouts::whereabouts;
use crate::effects::{Candidate, Library, Place, RecordingFacts, in_words};
use crate::feature::Dimension;
use crate::machine::Machine;
use crate::units::{ByQuantity, Quantity};

/// What is modelled without a name leaves no more than this part of the squares of left-out stretches beyond the noise's. Where it foretells
/// less, the law is another one, and where that does nothing, what was taken for it would do harm.
const HALF: f64 = 0.5;

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
    let mut shares = search.shares(in_model);
    let mut doubt = doubt(search, in_model, machine, &shares);
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
    // It is likelier than not that what is told is right, or what it may be instead.
    let holds = |(i, finding, _): &(usize, Finding, Named)| {
        !empty.contains(&place(i)) && finding.probability_of_all() > LIKELY
    };
    if !told.iter().all(holds) {
        let unlikely = told.iter().filter(|told| !holds(told));
        doubt = unlikely
            .max_by(|a, b| in_model[a.0].score.gain.total_cmp(&in_model[b.0].score.gain))
            .map(|(i, ..)| Doubt::at(place(i), 2.0 * in_model[*i].score.gain));
        let both = told.into_iter().zip(placebos).filter(|(told, _)| holds(told));
        (told, placebos) = both.unzip();
    }
    // In order of evidence.
    let mut all: Vec<_> = told.into_iter().zip(placebos).collect();
    all.sort_by(|(a, _), (b, _)| b.1.delta_bic.total_cmp(&a.1.delta_bic));
    let (told, placebos): (Vec<_>, Vec<_>) = all.into_iter().unzip();
    let kept: Vec<ModelTerm> = told.iter().map(|(i, ..)| in_model[*i].clone()).collect();
    let shared_effects = shared::effects(search, library, &kept);
    let told: Vec<Told> = (told.into_iter().zip(placebos).zip(kept))
        .map(|(((_, finding, named), placebo), term)| Told { term, finding, named, placebo })
        .collect();
    // Names that explain most of what is there stand; what they leave may be foretold all the same. Of settled positions no block tells it.
    let is_rest = doubt.is_none() && (shares.left.beyond > CHANCE || !search.in_motion);
    let findings = Findings { told, shared_effects, shares, doubt, is_rest, is_proved };
    let given = (machine, library, facts);
    let (plain, _) = findings.with_parts(search, given, noise, None, propose);
    if !noise.iter().any(Noise::is_long) {
        return plain;
    }
    // A memory longer than instruments have may be what is to be modelled. Stretches that were left out tell.
    let short: Vec<Noise> = noise.iter().map(Noise::shortened).collect();
    let (shortened, has_parts) = findings.with_parts(search, given, noise, Some(&short), propose);
    if has_parts && shortened.foretells_more(&plain) && Rule::ShorterMemory.decides() {
        shortened
    } else {
        plain
    }
}

/// What is said by name, before what has none is asked for.
struct Findings {
    /// In order of evidence.
    told: Vec<Told>,
    /// The same effects at other places.
    shared_effects: Vec<ModelTerm>,
    shares: Shares,
    doubt: Option<Doubt>,
    /// Whether the doubt is of what names leave alone.
    is_rest: bool,
    /// Whether names stand in spite of it.
    is_proved: bool,
}

/// All that the model has beside geometry, and what is said of the rest.
struct Modelled {
    told: Vec<Told>,
    shared_effects: Vec<ModelTerm>,
    /// Shared effects as they are put into the model.
    of_shared: Vec<Named>,
    /// What has no name and is modelled all the same.
    parts: Vec<ModelTerm>,
    of_parts: Vec<Named>,
    unexplained: Option<Unexplained>,
    proposals: Vec<Proposal>,
}

impl Findings {
    /// With what has no name modelled all the same, and then asked for its name; whether anything was. `memory`: the noise beside which it
    /// is, if not the search's.
    fn with_parts(
        &self,
        search: &Search,
        given: (&Machine, &Library, &RecordingFacts),
        noise: &[Noise],
        memory: Option<&[Noise]>,
        propose: bool,
    ) -> (Diagnosis, bool) {
        let (machine, library, facts) = given;
        let noise = memory.unwrap_or(noise);
        // What is taken for noise otherwise is a rest, too.
        let is_rest = self.is_rest || memory.is_some() && self.doubt.is_none();
        let doubt = self.doubt.clone().or_else(|| is_rest.then(|| Doubt::of(self.shares.left.energy)));
        let Some(doubt) = doubt else {
            let modelled = self.alone(search, (machine, library));
            return (modelled.diagnosis(search, (machine, library), noise, &self.shares), false);
        };
        let unnamed = Unnamed::beside(search, machine, facts);
        let rows = unnamed.rows(search, memory);
        let wide = unnamed.search(search, &rows);
        let is_anew = memory.is_some();
        let (modelled, noise, has_parts) =
            self.modelled((search, &wide, is_anew), &unnamed, given, noise, (doubt, is_rest), propose);
        (modelled.diagnosis(&wide, (machine, library), &noise, &self.shares), has_parts)
    }

    /// The names alone.
    fn alone(&self, search: &Search, given: (&Machine, &Library)) -> Modelled {
        let kept: Vec<ModelTerm> = self.told.iter().map(|told| told.term.clone()).collect();
        Modelled {
            told: self.told.clone(),
            shared_effects: self.shared_effects.clone(),
            of_shared: shared::named(search, given, &kept, &self.shared_effects),
            parts: Vec::new(),
            of_parts: Vec::new(),
            unexplained: None,
            proposals: Vec::new(),
        }
    }

    /// Names and parts, the noise as they leave it, and whether there are parts. `narrow`, `search`: without and with free functions;
    /// `is_anew`: by another noise.
    fn modelled(
        &self,
        (narrow, search, is_anew): (&Search, &Search, bool),
        unnamed: &Unnamed,
        given: (&Machine, &Library, &RecordingFacts),
        noise: &[Noise],
        (doubt, is_rest): (Doubt, bool),
        propose: bool,
    ) -> (Modelled, Vec<Noise>, bool) {
        let (machine, library, facts) = given;
        let shares = &self.shares;
        let (mut told, mut shared_effects) = (self.told.clone(), self.shared_effects.clone());
        let beside = |term: &ModelTerm| match is_anew {
            true => search.anew(term),
            false => term.clone(),
        };
        let mut of_search: Vec<ModelTerm> = told.iter().map(|told| told.term.clone()).collect();
        told.iter_mut().for_each(|told| told.term = beside(&told.term));
        shared_effects.iter_mut().for_each(|term| *term = beside(term));
        let mut known: Vec<ModelTerm> =
            told.iter().map(|t| &t.term).chain(&shared_effects).cloned().collect();
        let (modelled, only_told) = unnamed.parts(search, &known);
        let naming = unnamed.named(search, &known, modelled.clone());
        let found: Vec<ModelTerm> =
            naming.told.iter().map(|given| &given.term).chain(&naming.parts).cloned().collect();
        let all = [known.as_slice(), &found].concat();
        // What goes to and fro from reading to reading was taken for noise.
        let judged = noise::of(
            search.rows.linear,
            &residual_of(search, &all),
            search.runs,
            &search.rows.whitener.out,
            facts,
        );
        let has_parts = !modelled.is_empty()
            && (folds::remaining(search, &judged, &all, known.len()).is_some_and(|part| part <= HALF)
                || !Rule::LeavesHalf.decides());
        // What helped alone may do harm beside them.
        while let Some(i) = has_parts
            .then(|| folds::worst(search, &[known.as_slice(), &found].concat(), told.len()))
            .flatten()
            .filter(|_| Rule::NoneDoesHarmBesideParts.decides())
        {
            told.remove(i);
            of_search.remove(i);
            shared_effects = shared::effects(narrow, library, &of_search);
            shared_effects.iter_mut().for_each(|term| *term = beside(term));
            known = told.iter().map(|t| &t.term).chain(&shared_effects).cloned().collect();
        }
        let noise = if has_parts { judged } else { noise.to_vec() };
        let (naming, only_told) = match has_parts {
            true => (naming, Vec::new()),
            false if is_rest => (naming.withdrawn(), Vec::new()),
            false => (naming.withdrawn(), modelled.into_iter().chain(only_told).collect()),
        };
        for k in 0..naming.told.len() {
            let others = naming.parts.iter().filter(|part| unnamed.group(part) != naming.told[k].group);
            let others: Vec<ModelTerm> = known.iter().chain(others).cloned().collect();
            told.extend(promoted(search, &others, &naming, k, shares, (machine, library)));
        }
        told.sort_by(|a, b| b.finding.delta_bic.total_cmp(&a.finding.delta_bic));
        let known: Vec<ModelTerm> = told.iter().map(|t| &t.term).chain(&shared_effects).cloned().collect();
        let shown = [naming.parts.as_slice(), &only_told].concat();
        let all = [known.as_slice(), &shown].concat();
        // All together: what stands in the model was solved with all that stands there.
        let mut described = unnamed.told(search, &all, shares, (machine, library), has_parts);
        let of_shown = described.split_off(known.len());
        let (told_terms, rest) = described.split_at(told.len());
        told.iter_mut().zip(told_terms).for_each(|(told, (_, named))| told.named = named.clone());
        let of_shared: Vec<Named> = rest.iter().map(|(_, named)| named.clone()).collect();
        let names = |term: &ModelTerm| naming.likely(&unnamed.group(term));
        let rank = |term: &ModelTerm| naming.rank(&unnamed.group(term));
        let (mut shown_parts, mut of_parts) = (Vec::new(), Vec::new());
        for ((part, named), term) in of_shown.into_iter().zip(&shown) {
            shown_parts.push((rank(term), UnnamedPart { names: names(term), ..part }));
            of_parts.push(named);
        }
        let proposals = match has_parts && propose {
            true => propose::proposals(search, unnamed, (&known, &shown), &names, given),
            false => Vec::new(),
        };
        let found = search.beside_names(&known);
        let is_named = is_rest || self.is_proved || !naming.told.is_empty();
        let doubt = match is_named {
            true => still(search, (&known, &found), doubt, !shown_parts.is_empty()),
            false => Some(doubt),
        };
        let left = if is_named { &found } else { &search.base };
        let mut unexplained = doubt.map(|doubt| unexplained_by(search, machine, &noise, &doubt, left));
        if let Some(unexplained) = &mut unexplained {
            unexplained.take(shown_parts);
        }
        let (parts, of_parts) = if has_parts { (shown, of_parts) } else { Default::default() };
        let modelled = Modelled { told, shared_effects, of_shared, parts, of_parts, unexplained, proposals };
        (modelled, noise, has_parts)
    }
}

impl Modelled {
    /// With all figures.
    fn diagnosis(
        self,
        search: &Search,
        (machine, library): (&Machine, &Library),
        noise: &[Noise],
        shares: &Shares,
    ) -> Diagnosis {
        let Modelled { mut told, shared_effects, of_shared, parts, of_parts, unexplained, proposals } = self;
        // Figures are of what the file has.
        let none = Drives::none(search.rows.residual.len());
        let rows = search.rows.with(&none);
        let search = &search.rigid(&rows);
        let linear = search.rows.linear;
        let kept: Vec<ModelTerm> = told.iter().map(|told| told.term.clone()).collect();
        let placebos: Vec<Option<Placebo>> = told.iter_mut().map(|told| told.placebo.take()).collect();
        let in_model = [kept.as_slice(), &shared_effects, &parts].concat();
        let left_over = residual_of(search, &in_model);
        let set_ups_left_out = set_ups::left_out(search, &in_model, &placebos);
        let approaches = approaches(search, &in_model);
        let (findings, mut named): (Vec<Finding>, Vec<Named>) =
            told.into_iter().map(|told| (told.finding, told.named)).unzip();
        named.extend(of_shared);
        named.extend(of_parts);
        let mut diagnosis = Diagnosis {
            machine: machine.name().into(),
            recordings: linear.spans.iter().map(|s| s.label.clone()).collect(),
            samples: linear.all_samples,
            thinned: (linear.every > 1)
                .then_some(Thinned { every: linear.every, samples: linear.lines.len() as u64 }),
            noise_floor: ByQuantity::of(|quantity| sigma_of(search, noise, quantity == Quantity::Angle)),
            rms: ByQuantity::of(|quantity| {
                let left = rms_of(search, &left_over, quantity == Quantity::Angle);
                RmsByModel::of(linear.fit.rms[quantity], left)
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
            stand_still: stand_still(search, &approaches, machine),
            approaches,
            named,
            not_tried: Vec::new(),
            unseen_side_branches: Vec::new(),
            far_off: linear.fit.far_off(),
            dropped: linear.fit.dropped,
            outliers: Vec::new(),
            rms_without_outliers: ByQuantity::default(),
            left_out: LeftOut::default(),
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
}

/// The effects that foretell stretches that were left out, each beside the others, where all of them together leave no more than half of
/// the squares there; unless parts in their place foretell these better, by more than one standard error, also where parts stand beside the
/// names, `docs/diagnosis-method.md` (79).
fn proved(
    search: &Search,
    in_model: &[ModelTerm],
    (machine, facts): (&Machine, &RecordingFacts),
    noise: &[Noise],
) -> Option<Vec<ModelTerm>> {
    let patched = search.patched(in_model).filter(|_| Rule::Patches.decides());
    let is_patch = |candidate: &Candidate| patched == Some(candidate.place) && is_of_position(candidate);
    // No other recording has this one's clock, and patches of a curve are no names.
    let is_name = |effect: &&ModelTerm| {
        !search.goes_by_clock(effect.candidate) && !is_patch(&search.candidates[effect.candidate])
    };
    let mut names: Vec<ModelTerm> = in_model.iter().filter(is_name).cloned().collect();
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
    let rows = unnamed.rows(search, None);
    let search = unnamed.search(search, &rows);
    let (parts, _) = unnamed.parts(&search, &[]);
    let stands = |names: &[ModelTerm]| !folds::are_better(&search, &parts, names);
    // What they leave is modelled beside them.
    let with_parts = || {
        let (beside, _) = unnamed.parts(&search, &names);
        [names.as_slice(), &beside].concat()
    };
    (stands(&names) || stands(&with_parts()) || !Rule::PartsOutdoNames.decides()).then_some(names)
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
    let length = sigma_of(search, noise, false);
    let sigma = length.or(sigma_of(search, noise, true)).unwrap_or(1.0);
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
fn sigma_of(search: &Search, noise: &[Noise], angle: bool) -> Option<f64> {
    let is_of = |run: &[usize]| run.first().is_some_and(|row| search.rows.linear.angle[*row] == angle);
    search.runs.iter().zip(noise).find(|(run, _)| is_of(run)).map(|(_, noise)| noise.sigma)
}

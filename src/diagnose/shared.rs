//! What comes anew with every set-up comes so at several joints, since axes are referenced together, and every joint gives way under
//! weight: `docs/diagnosis-method.md` (72).

use std::sync::Arc;

use super::diagnosis::Named;
use super::drives::Drives;
use super::folds;
use super::held_out::Model;
use super::search::Search;
use super::set_ups;
use super::terms::{Hypothesis, ModelTerm};
use crate::effects::Library;
use crate::machine::Machine;

/// Effects that hardly ever come alone, at all other places where they are more likely than not, beside those that are kept; each time the
/// one with the greatest evidence.
pub(super) fn effects(search: &Search, library: &Library, kept: &[ModelTerm]) -> Vec<ModelTerm> {
    let of = |candidate: usize| &search.candidates[candidate];
    let comes_along = |candidate: usize| {
        let (own, family) = (of(candidate), &library.families()[of(candidate).family]);
        let by_itself = family.of_every_drive && search.in_motion;
        let is_alike = |effect: &ModelTerm| match family.each_setup {
            true => of(effect.candidate).family == own.family,
            false => {
                family.at_every_joint && !search.in_motion && of(effect.candidate).told_as == own.told_as
            }
        };
        own.parameters.is_empty() && (by_itself || kept.iter().any(is_alike))
    };
    let known = |all: &[ModelTerm], candidate: usize| all.iter().any(|effect| effect.candidate == candidate);
    let mut all = kept.to_vec();
    let mut left: Vec<usize> =
        (0..search.candidates.len()).filter(|i| comes_along(*i) && !known(kept, *i)).collect();
    if left.is_empty() {
        return Vec::new();
    }
    // Against geometry and names alone: what stands anyhow says nothing for itself.
    let none = Drives::none(search.rows.residual.len());
    let rows = search.rows.with(&none);
    let search = &search.rigid(&rows);
    while !left.is_empty() {
        let marginal = Arc::new(search.beside(&all, None));
        let field = search.rows.field(marginal.clone());
        let judged = left.iter().filter_map(|i| {
            let score = search.rows.score_at(of(*i), &[], &field, search.overdispersion)?;
            Some(Hypothesis::new(*i, score.evidence, score))
        });
        let Some(best) = judged.max_by(|a, b| a.weight.total_cmp(&b.weight)).filter(|r| r.weight > 0.0)
        else {
            break;
        };
        left.retain(|i| *i != best.candidate);
        all.extend(search.enter(&best, &marginal));
    }
    let without = |all: &[ModelTerm], goes: &dyn Fn(&ModelTerm) -> bool| -> Vec<ModelTerm> {
        let stays = |(i, effect): &(usize, &ModelTerm)| *i < kept.len() || !goes(effect);
        all.iter().enumerate().filter(stays).map(|(_, effect)| effect.clone()).collect()
    };
    let family = |effect: &ModelTerm| &library.families()[of(effect.candidate).family];
    // Drives are told by what they do all together: where that foretells no more, it is another law's.
    let rigid = without(&all, &|effect| search.in_motion && family(effect).of_every_drive);
    if rigid.len() < all.len() && !folds::are_better(search, &all, &rigid) {
        all = rigid;
    }
    // What every joint has may still be different from what it is taken for, where set-ups that are left out do not bear it out.
    let borne_out = without(&all, &|effect| !family(effect).each_setup);
    if borne_out.len() < all.len() && set_ups::foretell(search, &all, &borne_out) == Some(false) {
        all = borne_out;
    }
    all.split_off(kept.len())
}

/// How they go into the model; `kept`: beside which effects.
pub(super) fn named(
    search: &Search,
    (machine, library): (&Machine, &Library),
    kept: &[ModelTerm],
    shared: &[ModelTerm],
) -> Vec<Named> {
    let all = [kept, shared].concat();
    let model = Model::new(search, &all);
    let one = |(i, effect): (usize, &ModelTerm)| {
        let candidate = &search.candidates[effect.candidate];
        let solved = model.effect(search, &all, kept.len() + i, 0.0);
        let identified = solved.identified(candidate, library, effect.score.parameters.clone());
        let sizes = identified.sizes(&search.rows.linear.samples);
        Named { effect: identified.stored(machine, &sizes), scales: effect.scales(search) }
    };
    shared.iter().enumerate().map(one).collect()
}

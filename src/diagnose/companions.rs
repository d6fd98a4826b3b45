//! What comes anew with every set-up comes so at several joints: axes are referenced together, `docs/diagnosis.md` (72).

use std::sync::Arc;

use serde::Serialize;

use super::diagnosis::Named;
use super::held_out::Model;
use super::search::{Active, Rival, Search};
use crate::effects::Library;
use crate::machine::Machine;

/// A joint that has an effect of the findings too, so little that it is no finding; the model has it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Companion {
    /// Name of the effect.
    pub effect: String,
    /// Name of the place.
    pub at: String,
}

/// Effects that come anew with every set-up, at all other places where they are more likely than not, beside those that are kept.
pub(super) fn companions(search: &Search, library: &Library, kept: &[Active]) -> Vec<Active> {
    let mut all = kept.to_vec();
    for (i, candidate) in search.candidates.iter().enumerate() {
        let comes_along = library.families()[candidate.family].each_setup
            && candidate.parameters.is_empty()
            && kept.iter().any(|effect| search.candidates[effect.candidate].family == candidate.family);
        if !comes_along || kept.iter().any(|effect| effect.candidate == i) {
            continue;
        }
        let space = Arc::new(search.beside(&all, None));
        let score = search.rows.score_at(candidate, &[], &search.rows.field(space.clone()), search.heat);
        let Some(score) = score.filter(|score| score.evidence > 0.0) else { continue };
        all.extend(search.enter(&Rival::new(i, score.evidence, score), &space));
    }
    all.split_off(kept.len())
}

/// How they go into the model; `kept`: beside which effects.
pub(super) fn named(
    search: &Search,
    (machine, library): (&Machine, &Library),
    kept: &[Active],
    companions: &[Active],
) -> Vec<Named> {
    let all = [kept, companions].concat();
    let model = Model::new(search, &all);
    let one = |(i, effect): (usize, &Active)| {
        let candidate = &search.candidates[effect.candidate];
        let solved = model.effect(search, &all, kept.len() + i, 0.0);
        let identified = solved.identified(candidate, library, effect.score.parameters.clone());
        let sizes = identified.sizes(&search.rows.linear.samples);
        Named { effect: identified.stored(machine, &sizes), scales: effect.scales(search) }
    };
    companions.iter().enumerate().map(one).collect()
}

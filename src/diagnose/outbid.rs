//! Several names that one place without a name outbids: a patchwork, `docs/diagnosis-method.md` (77).

use super::evidence::log_mean_exp;
use super::policy::Rule;
use super::search::Search;
use super::series::Standing;
use super::terms::ModelTerm;
use super::whereabouts::standing;
use crate::machine::Machine;

/// By so much, a logarithm, the place has more evidence than all names together.
const AHEAD: f64 = 5.0;

/// The place whose series (69) say more than several names do together, with all the freedom of their shapes.
///
/// Two effects are told apart because neither a place nor a shape takes both. Pieces of which each takes a part of one thing fall behind
/// a series that takes all of it, though that has ten times their number of coefficients. Settled positions show no course, and several
/// joints give way there in their own ways.
pub(super) fn outbid(search: &Search, in_model: &[ModelTerm], machine: &Machine) -> Option<Standing> {
    if in_model.len() < 2 || !search.in_motion {
        return None;
    }
    let rare: f64 = in_model.iter().map(|effect| search.priors[effect.candidate]).sum();
    // Orders of one error motion are each other's shape.
    let are_one = in_model[1..].iter().all(|effect| search.is_one(in_model[0].candidate, effect.candidate));
    let names = if are_one {
        let plain: Vec<ModelTerm> = in_model.iter().map(ModelTerm::without_discrepancy).collect();
        log_mean_exp(&[search.worth(in_model), search.worth(&plain)]) + rare
    } else {
        search.worth(in_model) + rare
    };
    let series = standing(search, machine, search.base.clone())?;
    (series.evidence > names + AHEAD && Rule::Outbid.decides()).then_some(series)
}

//! Several names that one place without a name outbids: a patchwork, `docs/diagnosis.md` (77).

use super::search::{Active, Search};
use super::whereabouts::{Standing, standing};
use crate::machine::Machine;

/// By so much, a logarithm, the place has more evidence than all names together.
const AHEAD: f64 = 5.0;

/// The place whose series (69) say more than several names do together, with all the freedom of their shapes.
///
/// Two effects are told apart because neither a place nor a shape takes both. Pieces of which each takes a part of one thing fall behind
/// a series that takes all of it, though that has ten times their number of coefficients. Settled positions show no course, and several
/// joints give way there in their own ways.
pub(super) fn outbid(search: &Search, active: &[Active], machine: &Machine) -> Option<Standing> {
    if active.len() < 2 || !search.in_motion {
        return None;
    }
    let rare: f64 = active.iter().map(|effect| search.priors[effect.candidate]).sum();
    let names = search.worth(active) + rare;
    standing(search, machine, search.base.clone()).filter(|series| series.evidence > names + AHEAD)
}

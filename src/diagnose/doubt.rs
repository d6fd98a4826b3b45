//! Why the names that were taken in do not explain what is there, if they do not.

use super::marginal::Marginal;
use super::outbid::outbid;
use super::policy::Rule;
use super::search::Search;
use super::series::Standing;
use super::shares::Shares;
use super::terms::ModelTerm;
use super::whereabouts::standing;
use crate::effects::Place;
use crate::machine::Machine;

/// What is left may be this part of what geometry leaves over before nothing counts as explained.
const TOLERATED: f64 = 0.2;
/// More events of one moment each in one session are no slips: something is loose, or the instrument jumps to and fro.
const EVENTS: usize = 2;
/// Structure counts beyond this many standard deviations of chance.
pub(super) const CHANCE: f64 = 5.0;
/// Logarithm of the evidence at which a series (69) is structure: there are some hundred of them.
const STANDING: f64 = 12.0;

/// Structure without a name: where, if that is known, and its energy in units of the noise's variance.
#[derive(Clone)]
pub(super) struct Doubt {
    pub place: Option<Place>,
    /// Another joint whose position it goes with.
    pub with: Option<usize>,
    pub energy: f64,
}

impl Doubt {
    pub fn of(energy: f64) -> Self {
        Doubt { place: None, with: None, energy }
    }

    pub fn at(place: Place, energy: f64) -> Self {
        Doubt { place: Some(place), ..Doubt::of(energy) }
    }

    fn standing(series: &Standing) -> Self {
        Doubt { with: series.with, ..Doubt::at(series.place, 2.0 * series.gain) }
    }
}

/// Why the names that were taken in do not explain what is there, if they do not.
pub(super) fn doubt(
    search: &Search,
    in_model: &[ModelTerm],
    machine: &Machine,
    shares: &Shares,
) -> Option<Doubt> {
    let (left, total) = (&shares.left, shares.total());
    let patched = search.patched(in_model).filter(|_| Rule::Patches.decides());
    // What sounds does so louder and softer, and hardly ever at quite one frequency.
    let wanders = in_model.iter().any(|effect| search.is_tone(effect.candidate));
    let is_unexplained = patched.is_some()
        || left.beyond > CHANCE
            && (in_model.is_empty() || left.energy > TOLERATED * total && Rule::LeavesMuch.decides())
        || in_model.iter().filter(|effect| search.is_event(effect.candidate)).count() > EVENTS
            && Rule::FewEvents.decides()
        || search.in_motion && !wanders && shares.is_unlike() && Rule::Unlike.decides();
    if is_unexplained {
        let energy = search.leftover(&search.base).energy.max(left.energy);
        return Some(Doubt { place: patched, ..Doubt::of(energy) });
    }
    if let Some(series) = outbid(search, in_model, machine) {
        return Some(Doubt::standing(&series));
    }
    // What is much shows in blocks of samples, what is weak in a series alone.
    if search.in_motion && !in_model.is_empty() {
        return None;
    }
    let is_much = |energy: f64| energy > TOLERATED * (total + energy);
    standing(search, machine, search.beside(in_model, None))
        .filter(|series| series.evidence > STANDING && is_much(2.0 * series.gain) && Rule::Standing.decides())
        .map(|series| Doubt::standing(&series))
}

/// What is still without a name when names were found for a part of it.
pub(super) fn still(
    search: &Search,
    (known, found): (&[ModelTerm], &Marginal),
    doubt: Doubt,
    has_parts: bool,
) -> Option<Doubt> {
    let (left, all) = (search.leftover(found), search.leftover(&search.reference(known)));
    let is_much = left.beyond > CHANCE && left.energy > TOLERATED * all.energy;
    (is_much || has_parts).then_some(Doubt { energy: left.energy, ..doubt })
}

//! Why the names that were taken in do not explain what is there, if they do not.

use super::along::along_travel;
use super::folds;
use super::marginal::Marginal;
use super::noise::Noise;
use super::outbid::outbid;
use super::search::Search;
use super::series::Standing;
use super::shares::Shares;
use super::terms::ModelTerm;
use super::whereabouts::standing;
use crate::effects::Place;
use crate::machine::Machine;

/// What is left may be this part of what geometry leaves over before nothing counts as explained.
const TOLERATED: f64 = 0.2;
/// What stretches that were left out hold beyond what the others foretell may be this part of all; more where noise that remembers
/// leaves fewer independent readings.
const SURPRISE: f64 = 0.003;
/// Several names that make the mean square of stretches left out so many times that of geometry alone are a patchwork.
const WORSE: f64 = 2.0;
/// More events of one moment each in one session are no slips: something is loose, or the instrument jumps to and fro.
const EVENTS: usize = 2;
/// Structure counts beyond this many standard deviations of chance.
pub(super) const CHANCE: f64 = 5.0;
/// The same for functions of where a joint stands: chance alone does so in one of some hundred recordings of settled positions.
const ALONG: f64 = 4.5;
/// Logarithm of the evidence at which a series (69) is structure: there are some hundred of them.
const STANDING: f64 = 12.0;
/// Where shapes make up less than this part of all, the names are no patches, whatever surprises.
const ODD_DISCREPANCY: f64 = 0.05;

/// Structure without a name: where, if that is known, and its energy in units of the noise's variance.
#[derive(Clone)]
pub(super) struct Doubt {
    pub place: Option<Place>,
    /// Another joint whose position it goes with.
    pub with: Option<usize>,
    pub energy: f64,
    /// The effect that says nearly all of it by itself, if there is one.
    pub but: Option<usize>,
}

impl Doubt {
    pub fn of(energy: f64) -> Self {
        Doubt { place: None, with: None, energy, but: None }
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

/// What is still without a name when names were found for a part of it.
pub(super) fn still(search: &Search, found: &Marginal, doubt: Doubt, has_parts: bool) -> Option<Doubt> {
    let (left, all) = (search.leftover(found), search.leftover(&search.base));
    let is_much = left.beyond > CHANCE && left.energy > TOLERATED * all.energy;
    (is_much || has_parts).then_some(Doubt { energy: left.energy, ..doubt })
}

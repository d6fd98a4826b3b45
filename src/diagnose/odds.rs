//! How likely a name is among its hypotheses, and which of them are told with it, `docs/diagnosis-method.md` (64).

use super::finding::Confusable;
use super::policy::Rule;
use super::search::{Search, VISIBLE};
use super::terms::Hypothesis;
use crate::effects::{Family, Place};
use crate::machine::Machine;

/// Names of which the data say less than this against the best are listed with it.
pub(super) const LISTED: f64 = 0.05;
/// How often the true shape of an effect is none of its family's, and the part of its energy by which that may shift the odds of other
/// names for the same place, and of its own name at other places.
const UNSURE: f64 = 0.2;
const SHIFT: f64 = 0.002;
/// Names that are so likely besides the best one, as their weights may shift, are listed too.
const ALIKE: f64 = 0.12;
/// But no names that are so much rarer, as a logarithm.
const RARER: f64 = 1.2;
/// Trust in names falls half the way where shapes take up this part of the structure, and never below this.
const ODDER: f64 = 0.12;
const LEAST: f64 = 0.55;
/// It falls by half where the evidence is no more than this.
const SLIGHT: f64 = 30.0;
/// Places between which the logarithm of the likelihood differs by less, as one standard deviation makes it, are not told apart.
const SAME: f64 = 0.5;

/// What one hypothesis has for itself.
pub(super) struct Odds<'a> {
    pub hypothesis: &'a Hypothesis,
    pub probability: f64,
    /// Whether it is told beside the best one.
    pub is_listed: bool,
}
/// How often a name is right that evidence alone makes certain, on cases whose answers are known: less where shapes take up much
/// (`discrepancy`, a part of the structure), and where the evidence (`bic`, twice its logarithm) is slight.
pub(super) fn trust(discrepancy: f64, bic: f64) -> f64 {
    let (odd, slight) = ((discrepancy / ODDER).powi(3), (SLIGHT / bic.max(1e-9)).powi(2));
    (LEAST + (1.0 - LEAST) / (1.0 + odd)) / (1.0 + slight)
}

/// Whether it is the same effect at another place, and the readings say no more for the one than for the other.
pub(super) fn is_same_elsewhere(
    search: &Search,
    own: &Hypothesis,
    other: &Hypothesis,
    overdispersion: f64,
) -> bool {
    let [a, b] = [own, other].map(|hypothesis| &search.candidates[hypothesis.candidate]);
    a.told_as == b.told_as
        && a.place != b.place
        && (own.score.gain - other.score.gain).abs() < SAME * overdispersion
}

/// Probability of every hypothesis, (64): by its weight, and to a part by weights that a shape which nobody knows may shift.
/// `overdispersion`: that of the weights, `is_plain`: a common family in its own shape.
pub(super) fn odds<'a>(
    search: &Search,
    hypotheses: &'a [Hypothesis],
    own: &Hypothesis,
    overdispersion: f64,
    is_plain: bool,
) -> Vec<Odds<'a>> {
    let unsure = if is_plain || !Rule::OddsMayShift.decides() { 0.0 } else { UNSURE };
    let place = |r: &Hypothesis| search.candidates[r.candidate].place;
    let effect = |r: &Hypothesis| &search.candidates[r.candidate].told_as;
    let plain = |r: &Hypothesis| (r.weight - own.weight).exp();
    let visible = VISIBLE * search.rows.whitener.count() as f64;
    let shift = 1.0 + (SHIFT * own.score.gain).min(visible) / overdispersion;
    // Another name at its place, or the same at another place.
    let is_alike = |r: &Hypothesis| place(r) == place(own) || effect(r) == effect(own);
    let is_same = |r: &Hypothesis| search.is_form(r.candidate, own.candidate);
    let shifted = |r: &Hypothesis| {
        if is_alike(r) { ((r.weight - own.weight) / shift).exp() } else { 0.0 }
    };
    let nothing = (-own.weight).exp();
    let (all, all_alike) =
        (hypotheses.iter().map(plain).sum::<f64>() + nothing, hypotheses.iter().map(shifted).sum::<f64>());
    let beside = hypotheses.iter().filter(|r| is_alike(r)).map(plain).sum::<f64>() / all;
    let probability =
        |r: &Hypothesis| (1.0 - unsure) * plain(r) / all + unsure * beside * shifted(r) / all_alike;
    let is_common =
        |r: &Hypothesis| search.commonness[r.candidate] > search.commonness[own.candidate] - RARER;
    let listed = |r: &Hypothesis| {
        probability(r) > LISTED * probability(own) || !is_plain && shifted(r) > ALIKE && is_common(r)
    };
    let one = |hypothesis| Odds {
        hypothesis,
        probability: probability(hypothesis),
        is_listed: !is_same(hypothesis) && listed(hypothesis),
    };
    hypotheses.iter().map(one).collect()
}

/// A hypothesis as it is told beside a finding of this family.
pub(super) fn confusable(odds: &Odds, search: &Search, machine: &Machine, family: &Family) -> Confusable {
    let candidate = &search.candidates[odds.hypothesis.candidate];
    let told = family.look_alikes.iter().find(|l| l.effect == candidate.effect);
    let at = candidate.place.name(machine);
    Confusable {
        effect: candidate.told_as.clone(),
        separate_by: told.map_or_else(
            || match candidate.place {
                Place::Joint(_) | Place::Pair(..) => {
                    format!("a path on which {at} moves on its own, to and fro over all of its travel")
                }
                Place::Frame(_) | Place::Measurement => {
                    "the same path again, in another order and at another speed".into()
                }
            },
            |l| l.separate_by.replace("{at}", &at),
        ),
        at,
        probability: odds.probability,
    }
}

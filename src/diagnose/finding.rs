//! What a diagnosis says, as data: `docs/diagnosis.md`.

use nalgebra::DVector;
use serde::Serialize;

use super::along::along_travel;
use super::folds;
use super::held_out::{self, Model};
use super::noise::Noise;
use super::not_tried::NotTried;
use super::outliers::{self, Outliers, WithoutOutliers};
use super::search::{Active, Rival, Search, VISIBLE, all_but};
use super::speeds::levelled;
use super::stretch::{Where, wheres};
use super::traces::{self, Traces};
use super::unexplained::{self, Unexplained};
use crate::effects::{Identified, Library, Place, StoredEffect, in_words};
use crate::feature::Dimension;
use crate::identify::BeforeAfter;
use crate::location::LocationErrors;
use crate::machine::Machine;

/// Everything that a diagnosis has to say. Numbers in SI; `docs/diagnosis.md` lists the fields.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// Name of the machine.
    pub machine: String,
    /// File names.
    pub recordings: Vec<String>,
    /// Samples judged.
    pub samples: u64,
    /// Standard deviation of the noise of lengths, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_floor_m: Option<f64>,
    /// The same of angles, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_floor_rad: Option<f64>,
    /// RMS of lengths under three models, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_m: Option<RmsByModel>,
    /// The same of angles, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_rad: Option<RmsByModel>,
    /// RMS of lengths over stretches that were left out of the fit, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_rms_m: Option<HeldOutRms>,
    /// The same of angles, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_rms_rad: Option<HeldOutRms>,
    /// What was found, strongest evidence first.
    pub findings: Vec<Finding>,
    /// What no family explains.
    pub unexplained: Option<Unexplained>,
    /// Part of the structure left over by geometry that is no family's shape, 0 to 1, where something was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape_share: Option<f64>,
    /// What the calibrated file is made of: the effects of `findings`, ready to be fitted on the real model.
    #[serde(skip)]
    pub(super) named: Vec<Named>,
    /// Effects that could not be looked for in these recordings.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_tried: Vec<NotTried>,
    /// Rows left out because a number was missing.
    #[serde(skip_serializing_if = "is_zero")]
    pub dropped: u64,
    /// Samples that were left out because they lie far off.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub outliers: Vec<Outliers>,
    /// RMS of lengths without them, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_without_outliers_m: Option<WithoutOutliers>,
    /// The same of angles, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_without_outliers_rad: Option<WithoutOutliers>,
    /// What its pictures show.
    #[serde(skip)]
    pub traces: Traces,
    /// The geometry as ISO 230-1 location errors.
    #[serde(skip)]
    pub location_errors: LocationErrors,
}

/// An effect that was found, as it is put into the model.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub effect: StoredEffect,
    /// Standard deviation of the prior of each of its terms, in the coefficient's unit.
    pub scales: Vec<f64>,
}

/// RMS under three models.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct RmsByModel {
    /// The machine as declared.
    pub nominal: f64,
    /// With constant deviations.
    pub geometric: f64,
    /// With what was found besides.
    pub r#final: f64,
}

/// Held-out RMS under two models.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct HeldOutRms {
    /// With constant deviations.
    pub geometric: f64,
    /// With what was found besides.
    pub r#final: f64,
}

/// Held-out RMS without and with one finding.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct HeldOutPair {
    /// All others taken in.
    pub before: f64,
    /// This one too.
    pub after: f64,
}

/// One effect.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// Its name.
    pub effect: String,
    /// Name of its family, where that is a form of what `effect` names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub form: Option<String>,
    /// Joint, frame or `measurement`.
    pub at: String,
    /// A sentence for a machinist.
    pub explanation: String,
    /// Its sizes.
    pub coefficients: Vec<Size>,
    /// Probability that name and place are right, or are those of a rival that the recordings cannot tell from it.
    pub probability: f64,
    /// Half of it is the logarithm of the evidence for it.
    pub delta_bic: f64,
    /// Lengths on stretches that were left out, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_rms_m: Option<HeldOutPair>,
    /// The same of angles, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_rms_rad: Option<HeldOutPair>,
    /// Where it acts.
    pub r#where: Vec<Where>,
    /// What these recordings cannot tell from it.
    pub confusable_with: Vec<Confusable>,
    /// Part of the mean square that geometry leaves over that goes with it, 0 to 1, the others taken in.
    pub share: f64,
}

impl Finding {
    /// Its name, with its form where it has one: `backlash (worn_stretch)`.
    pub fn name(&self) -> String {
        self.form.as_ref().map_or_else(|| self.effect.clone(), |form| format!("{} ({form})", self.effect))
    }
}

/// A number of a finding.
#[derive(Clone, Debug, Serialize)]
pub struct Size {
    /// Its name.
    pub name: String,
    /// SI.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// Standard uncertainty.
    pub std_error: f64,
}

/// Another name for the same.
#[derive(Clone, Debug, Serialize)]
pub struct Confusable {
    /// Name of the family.
    pub effect: String,
    /// Place.
    pub at: String,
    /// Its probability.
    pub probability: f64,
    /// The motion that would tell them apart.
    pub separate_by: String,
}

/// What is left may be this part of what geometry leaves over before nothing counts as explained.
const TOLERATED: f64 = 0.2;
/// What stretches that were left out hold beyond what the others foretell may be this part of all; more where noise that remembers
/// leaves fewer independent readings.
const SURPRISE: f64 = 0.003;
/// More events of one moment each in one session are no slips: something is loose, or the instrument jumps to and fro.
const EVENTS: usize = 2;
/// Structure counts beyond this many standard deviations of chance.
const CHANCE: f64 = 5.0;
/// The same for functions of where a joint stands: chance alone does so in one of some hundred recordings of settled positions.
const ALONG: f64 = 4.5;
/// Names of which the data say less than this against the best are listed with it.
const LISTED: f64 = 0.05;
/// Where shapes make up less than this part of all, the names are no patches, whatever surprises.
const ODD_SHAPE: f64 = 0.05;
/// How often the true shape of an effect is none of its family's, and the part of its energy by which that may shift the odds of other
/// names for the same place, and of its own name at other places.
const UNSURE: f64 = 0.2;
const SHIFT: f64 = 0.002;
/// Names that are so likely besides the best one, as their weights may shift, are listed too.
const ALIKE: f64 = 0.12;
/// A common effect of which the shape is less than this part of all is what it looks like.
const PLAIN: f64 = 0.01;
/// Names whose odds are no less than this part of the best one's cannot be told from it.
const ALIAS: f64 = 1.0 / 3.0;
/// Trust in names falls where shapes take up more than this part of the structure, to this at least, and by half where the evidence is
/// no more than this.
const ODDER: f64 = 0.12;
const LEAST: f64 = 0.55;
const SLIGHT: f64 = 30.0;
/// But no names that are so much rarer, as a logarithm.
const RARER: f64 = 1.2;
/// Logarithm of the odds at which a finding is told.
const TOLD: f64 = 5.0;

/// Residuals with the effects taken away, m and rad.
pub(super) fn residual_of(search: &Search, active: &[Active]) -> Vec<f64> {
    let model = held_out::Model::new(search, active);
    model.residual(search, active)
}

pub(super) fn report(
    search: &Search,
    active: &[Active],
    machine: &Machine,
    library: &Library,
    noise: &[Noise],
) -> Diagnosis {
    let linear = search.rows.linear;
    let geometric = search.leftover(&search.base);
    let shares = search.shares(active);
    let (left, total) = (&shares.left, shares.total());
    let (surprise, deviation) = folds::surprise(search, active).unwrap_or((0.0, 1.0));
    let memory = noise.iter().map(Noise::memory).fold(1.0, f64::max);
    let patched = search.patched(active);
    let is_unexplained = patched.is_some()
        || left.beyond > CHANCE && (active.is_empty() || left.energy > TOLERATED * total)
        || left.beyond > CHANCE && search.in_motion && active.len() >= search.most()
        || active.iter().filter(|effect| search.is_event(effect.candidate)).count() > EVENTS
        || shares.is_misshapen(active.len())
        || shares.shapes > ODD_SHAPE * total
            && surprise > CHANCE * left.heat.max(1.0) * deviation
            && surprise > SURPRISE * memory * total;
    // Settled positions show no course, but they may show a function of where a joint stands.
    let along = (!is_unexplained && !search.in_motion)
        .then(|| along_travel(search, machine, &search.beside(active, None)))
        .flatten()
        .filter(|along| {
            along.beyond > ALONG * search.heat && along.energy > TOLERATED * (total + along.energy)
        });
    let is_unexplained = is_unexplained || along.is_some();
    let noise_of = |angle: bool| {
        let own = search
            .runs
            .iter()
            .zip(noise)
            .find(|(run, _)| run.first().is_some_and(|r| linear.angle[*r] == angle));
        own.map(|(_, noise)| noise.sigma)
    };
    let (mut findings, mut named) = (Vec::new(), Vec::new());
    let mut kept = Vec::new();
    let model = Model::new(search, active);
    for (i, effect) in active.iter().enumerate() {
        let rivals = search.rivals_of(active, i);
        let others = all_but(active, Some(i));
        let fit = |r: &&Rival| r.candidate == effect.candidate || !search.repeats(r, &others);
        let rivals: Vec<Rival> = rivals.iter().filter(fit).map(|r| search.tempered(r, left.heat)).collect();
        let own = rivals.iter().find(|r| r.candidate == effect.candidate);
        let Some(own) = own.filter(|r| r.weight > TOLD).cloned() else { continue };
        if is_unexplained {
            continue;
        }
        let is_plain = search.commonness[own.candidate] == 0.0 && shares.shapes < PLAIN * total;
        // A shape that is little beside all may be much beside this one.
        let in_shape = shares.shapes < PLAIN * 2.0 * own.score.gain;
        let rivals = if in_shape { rivals } else { levelled(search, &own, rivals) };
        let odds = odds(search, &rivals, &own, left.heat.max(search.heat), is_plain);
        let own_odds = odds.iter().find(|(r, ..)| r.candidate == own.candidate).map_or(0.0, |(_, p, _)| *p);
        let is_alike =
            |r: &Rival, p: f64| p >= ALIAS * own_odds || search.is_form(r.candidate, own.candidate);
        let alike = odds.iter().filter(|(r, p, _)| is_alike(r, *p)).map(|(_, p, _)| *p);
        let probability = alike.sum::<f64>().min(1.0) * trust(shares.shapes / total, 2.0 * own.weight);
        let candidate = &search.candidates[effect.candidate];
        let family = &library.families()[candidate.family];
        let departure = (shares.shapes / total).sqrt();
        let mut solved = model.effect(search, active, i, departure);
        let mut parameters = effect.score.parameters.clone();
        let jumps = |p: &usize| !candidate.parameters[*p].smooth && !candidate.parameters[*p].whole;
        for p in (0..parameters.len()).filter(jumps) {
            let Some((middle, deviation)) = Model::jumping(search, active, i, p) else { continue };
            parameters[p] = middle;
            let own = solved.coefficients.len() + p;
            solved.covariance[own][own] = deviation * deviation;
        }
        let identified = Identified {
            family,
            candidate,
            coefficients: solved.coefficients,
            parameters,
            covariance: Some(solved.covariance),
        };
        let sizes = identified.sizes(&linear.samples);
        let explanation = identified.sentence(machine, &sizes);
        named.push(Named {
            effect: identified.stored(machine, &sizes),
            scales: (search.rows.units(candidate, &effect.score.parameters).iter())
                .map(|u| effect.score.room * u)
                .collect(),
        });
        let mut confusable_with: Vec<Confusable> = Vec::new();
        for (rival, probability, _) in odds.iter().filter(|(.., listed)| *listed) {
            let other = confusable(rival, *probability, search, machine, family);
            match confusable_with.iter_mut().find(|o| (&o.effect, &o.at) == (&other.effect, &other.at)) {
                Some(known) => known.probability += other.probability,
                None => confusable_with.push(other),
            }
        }
        findings.push(Finding {
            effect: candidate.told_as.clone(),
            form: (candidate.told_as != candidate.effect).then(|| candidate.effect.clone()),
            at: candidate.place.name(machine),
            explanation,
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
            held_out_rms_m: None,
            held_out_rms_rad: None,
            r#where: wheres(search, &|row| effect.columns.row(row).norm_squared()),
            confusable_with,
            share: 0.0,
        });
        kept.push(i);
    }
    let unexplained = is_unexplained.then(|| {
        let left_by_geometry = search.base.apply(&search.rows.residual);
        let best = search.rivals(active).first().map(|r| search.candidates[r.candidate].place);
        let place = patched.or(along.map(|along| Place::Joint(along.joint))).or(best);
        let at = place.map_or("measurement".to_string(), |place| place.name(machine));
        let energy = along.map_or(geometric.energy.max(left.energy), |along| along.energy);
        let sigma = noise_of(false).or(noise_of(true)).unwrap_or(1.0);
        let rms_m = sigma * (energy / search.rows.whitener.count().max(1) as f64).sqrt();
        let size = match noise_of(false) {
            Some(_) => format!("{:.2} um", 1e6 * rms_m),
            None => in_words(rms_m, None, Dimension::ANGLE, None),
        };
        let (r#where, gathers) = unexplained::gathered(search, machine, left_by_geometry.as_slice());
        let mut explanation =
            format!("structure of {size} is left that no named effect explains; it fits best at {at}");
        for gathering in &gathers {
            explanation += &format!("; {}", gathering.in_words());
        }
        Unexplained { rms_m, at, r#where, gathers, explanation }
    });
    let told: Vec<Active> = kept.iter().map(|i| active[*i].clone()).collect();
    let left_over = Model::new(search, &told).residual(search, &told);
    let recordings = linear.spans.iter().map(|s| s.label.clone()).collect();
    let mut diagnosis = Diagnosis {
        machine: machine.name().into(),
        recordings,
        samples: linear.lines.len() as u64,
        noise_floor_m: noise_of(false),
        noise_floor_rad: noise_of(true),
        rms_m: by_model(linear.fit.rms_m, rms_of(search, &left_over, false)),
        rms_rad: by_model(linear.fit.rms_rad, rms_of(search, &left_over, true)),
        held_out_rms_m: None,
        held_out_rms_rad: None,
        shape_share: (!findings.is_empty()).then(|| shares.shapes / total),
        findings,
        unexplained,
        named,
        not_tried: Vec::new(),
        dropped: linear.fit.dropped,
        outliers: Vec::new(),
        rms_without_outliers_m: None,
        rms_without_outliers_rad: None,
        traces: Traces::default(),
        location_errors: linear.fit.location_errors.clone(),
    };
    let geometric = Model::new(search, &[]).residual(search, &[]);
    outliers::fill(search, &geometric, &left_over, &mut diagnosis);
    folds::fill(search, &told, &mut diagnosis);
    traces::fill(search, &told, &left_over, machine, &mut diagnosis);
    diagnosis
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

fn by_model(fit: Option<BeforeAfter>, last: Option<f64>) -> Option<RmsByModel> {
    let (fit, last) = (fit?, last?);
    Some(RmsByModel { nominal: fit.nominal, geometric: fit.geometric, r#final: last })
}

/// Root mean square over samples of the norm of residual lengths or angles.
pub(super) fn rms_of(search: &Search, residual: &[f64], angle: bool) -> Option<f64> {
    let linear = search.rows.linear;
    let rows = || (0..residual.len()).filter(|row| linear.angle[*row] == angle);
    let mut samples: Vec<usize> = rows().map(|row| linear.sample[row]).collect();
    samples.dedup();
    let squares: f64 = rows().map(|row| residual[row] * residual[row]).sum();
    (!samples.is_empty()).then(|| (squares / samples.len() as f64).sqrt())
}

/// How often a name is right that evidence alone makes certain, on cases whose answers are known: less where shapes take up much
/// (`shape`, a part of the structure), and where the evidence (`bic`, twice its logarithm) is slight.
fn trust(shape: f64, bic: f64) -> f64 {
    let (odd, slight) = ((shape / ODDER).powi(3), (SLIGHT / bic.max(1e-9)).powi(2));
    (LEAST + (1.0 - LEAST) / (1.0 + odd)) / (1.0 + slight)
}

/// Probability of every rival, (64): by its weight, and to a part by weights that a shape which nobody knows may shift.
/// With each whether it is listed; `heat`: that of the weights, `is_plain`: a common family in its own shape.
fn odds<'a>(
    search: &Search,
    rivals: &'a [Rival],
    own: &Rival,
    heat: f64,
    is_plain: bool,
) -> Vec<(&'a Rival, f64, bool)> {
    let unsure = if is_plain { 0.0 } else { UNSURE };
    let place = |r: &Rival| search.candidates[r.candidate].place;
    let effect = |r: &Rival| &search.candidates[r.candidate].told_as;
    let plain = |r: &Rival| (r.weight - own.weight).exp();
    let visible = VISIBLE * search.rows.whitener.count() as f64;
    let shift = 1.0 + (SHIFT * own.score.gain).min(visible) / heat;
    // Another name at its place, or the same at another place.
    let is_alike = |r: &Rival| place(r) == place(own) || effect(r) == effect(own);
    let is_same = |r: &Rival| search.is_form(r.candidate, own.candidate);
    let shifted = |r: &Rival| {
        if is_alike(r) { ((r.weight - own.weight) / shift).exp() } else { 0.0 }
    };
    let nothing = (-own.weight).exp();
    let (all, all_alike) =
        (rivals.iter().map(plain).sum::<f64>() + nothing, rivals.iter().map(shifted).sum::<f64>());
    let beside = rivals.iter().filter(|r| is_alike(r)).map(plain).sum::<f64>() / all;
    let probability = |r: &Rival| (1.0 - unsure) * plain(r) / all + unsure * beside * shifted(r) / all_alike;
    let is_common = |r: &Rival| search.commonness[r.candidate] > search.commonness[own.candidate] - RARER;
    let listed = |r: &Rival| {
        probability(r) > LISTED * probability(own) || !is_plain && shifted(r) > ALIKE && is_common(r)
    };
    rivals.iter().map(|r| (r, probability(r), !is_same(r) && listed(r))).collect()
}

fn confusable(
    rival: &Rival,
    probability: f64,
    search: &Search,
    machine: &Machine,
    family: &crate::effects::Family,
) -> Confusable {
    let candidate = &search.candidates[rival.candidate];
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
        probability,
    }
}

/// A vector of zeros with the same length as the residuals.
pub(super) fn zeros(search: &Search) -> DVector<f64> {
    DVector::zeros(search.rows.linear.residual.len())
}

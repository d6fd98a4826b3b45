//! Axes that are late: what depends on where an axis stands depends on where it is by then, `docs/diagnosis-method.md` (76).

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::diagnosis::{Diagnosis, HeldOutRms};
use super::discrepancy;
use super::held_out::Model;
use super::search::Search;
use super::terms::ModelTerm;
use crate::effects::{Candidate, Place};
use crate::feature::Feature;
use crate::variation::Slot;

/// Half of so much energy by which the effects change, in units of the noise's variance, sways the odds of names.
const SWAYS: f64 = 10.0;
/// Logarithm of how rare sizes are that make one ask for another story.
const RARE: f64 = -1.0;
/// The other story is told where it leaves no more than this part of what the first one leaves on stretches left out.
const BETTER: f64 = 0.9;

/// Candidates as they are where axes follow their commands as late as was found; `plain`: as they are where none is late. `None` where
/// noise would hide what that changes.
pub(super) fn lagged(search: &Search, in_model: &[ModelTerm], plain: &[Candidate]) -> Option<Vec<Candidate>> {
    let model = Model::new(search, in_model);
    let mut lags: BTreeMap<usize, f64> = BTreeMap::new();
    for (i, effect) in in_model.iter().enumerate() {
        let candidate = &search.candidates[effect.candidate];
        for (coefficient, value) in candidate.coefficients.iter().zip(model.coefficients(search, in_model, i))
        {
            for part in &coefficient.parts {
                let joint = match part.slot {
                    Slot::Before(j) | Slot::After(j) => j,
                    Slot::Reading => continue,
                };
                if candidate.features[part.feature].lags() == Some(joint) {
                    *lags.entry(joint).or_default() += value;
                }
            }
        }
    }
    let is_here = |candidate: &Candidate| {
        discrepancy::is_of_position(candidate)
            && candidate.features[0].joints().iter().all(|j| lags.contains_key(j))
    };
    let lagged = |f: &Feature| lags.iter().fold(f.clone(), |f, (j, by)| f.late(*j, *by));
    let features = |candidate: &Candidate| candidate.features.iter().map(lagged).collect::<Vec<Feature>>();
    let less = |candidate: &Candidate| Candidate { features: features(candidate), ..candidate.clone() };
    let delayed = |candidate: &Candidate| Candidate {
        more_than: candidate.more_than.iter().map(less).collect(),
        ..less(candidate)
    };
    let mut change = 0.0;
    for (i, effect) in in_model.iter().enumerate() {
        let (now, then) = (&search.candidates[effect.candidate], &plain[effect.candidate]);
        if !is_here(then) {
            continue;
        }
        let raw = |candidate: &Candidate| search.rows.raw(candidate, &effect.score.parameters);
        let (now, then) = (raw(now)?, raw(&delayed(then))?);
        let units = search.rows.units(&search.candidates[effect.candidate], &effect.score.parameters);
        let values = model.coefficients(search, in_model, i);
        let sizes =
            values.iter().zip(&units).map(|(value, unit)| if *unit > 0.0 { value / unit } else { 0.0 });
        let sizes = DVector::from_iterator(values.len(), sizes);
        let moved = (then - now).columns(0, values.len()) * sizes;
        let mut moved = DMatrix::from_columns(&[moved]);
        search.rows.whiten(&mut moved);
        change += moved.norm_squared();
    }
    (change > SWAYS).then(|| plain.iter().map(|c| if is_here(c) { delayed(c) } else { c.clone() }).collect())
}

/// A joint of which more was found than is usual, that goes with its direction, its speed or the time, where no lag of it was: a large lag
/// makes waves of its position come too late one way and too early the other, and no single name but its own takes that.
pub(super) fn may_be_late(search: &Search, in_model: &[ModelTerm]) -> Option<usize> {
    let lags = |joint: usize| search.candidates.iter().any(|c| is_lag(c) && lagging(c).contains(&joint));
    let known: Vec<usize> = in_model
        .iter()
        .map(|e| &search.candidates[e.candidate])
        .filter(|c| is_lag(c))
        .flat_map(lagging)
        .collect();
    let moving: Vec<usize> = search
        .candidates
        .iter()
        .filter_map(|c| if let Place::Joint(j) = c.place { Some(j) } else { None })
        .collect();
    let only = moving.first().copied().filter(|first| moving.iter().all(|j| j == first));
    in_model.iter().enumerate().find_map(|(i, effect)| {
        let candidate = &search.candidates[effect.candidate];
        let joint = match candidate.place {
            Place::Joint(j) => Some(j),
            _ => only,
        }?;
        let hypotheses = search.rivals_of(in_model, i);
        let own = hypotheses.iter().find(|r| r.candidate == effect.candidate)?;
        let is_asked = !discrepancy::is_of_position(candidate)
            && lags(joint)
            && !known.contains(&joint)
            && search.rows.rarity(candidate, &own.score) < RARE;
        is_asked.then_some(joint)
    })
}

/// The candidates of the other story: what goes with the joint alone goes with where it is, and with how late it is.
pub(super) fn but_late(candidates: &[Candidate], joint: usize) -> Vec<Candidate> {
    let is_elsewhere = |candidate: &Candidate| {
        matches!(candidate.place, Place::Joint(j) if j != joint)
            || candidate.features.iter().flat_map(Feature::joints).any(|j| j != joint)
    };
    let stays = |c: &&Candidate| is_elsewhere(c) || discrepancy::is_of_position(c) || is_lag(c);
    candidates.iter().filter(stays).cloned().collect()
}

/// Whether another story foretells stretches that are left out better, and leaves nothing unexplained that the first one explains.
pub(super) fn foretells_better(other: &Diagnosis, first: &Diagnosis) -> bool {
    let ratio = |other: Option<HeldOutRms>, first: Option<HeldOutRms>| Some(other?.r#final / first?.r#final);
    let lengths = ratio(other.held_out_rms.m, first.held_out_rms.m);
    let angles = ratio(other.held_out_rms.rad, first.held_out_rms.rad);
    let ratios: Vec<f64> = lengths.into_iter().chain(angles).collect();
    (other.unexplained.is_none() || first.unexplained.is_some())
        && ratios.iter().all(|ratio| *ratio <= 1.0)
        && ratios.iter().any(|ratio| *ratio < BETTER)
}

fn is_lag(candidate: &Candidate) -> bool {
    !candidate.features.is_empty() && candidate.features.iter().all(|f| f.lags().is_some())
}

fn lagging(candidate: &Candidate) -> Vec<usize> {
    candidate.features.iter().filter_map(Feature::lags).collect()
}

//! One search from the constant geometry to what is said: rounds of judging the noise, of linearising the machine anew, of names.

use std::borrow::Cow;
use std::sync::Mutex;

use super::coarse::Coarse;
use super::diagnosis::Diagnosis;
use super::drives::Drives;
use super::folds;
use super::lag::{self, lagged};
use super::linear::{Linear, linear};
use super::noise::{self, Noise};
use super::policy::Rule;
use super::relinearised;
use super::report;
use super::score::Rows;
use super::search::{Search, Tell, priors};
use super::speeds::less_rare;
use super::terms::ModelTerm;
use super::whitener::Whitener;
use crate::effects::{Candidate, Library, RecordingFacts};
use crate::error::Result;
use crate::identify::CalibrateOptions;
use crate::machine::Machine;
use crate::recording::Recording;

/// Rounds of judging the noise from what is left.
const NOISE_ROUNDS: usize = 3;
/// So many times the machine is linearised anew, or taken as late as was found, where effects are so large that it has to be.
const MOVES: usize = 3;
/// So many times what is no longer the likeliest gives its place, where names go by what they foretell.
const EXCHANGES: usize = 4;
/// By so many standard errors a set whose effects have each proved themselves foretells more where it is told. What one stretch alone says is one
/// at most, however much it is.
const DECIDED: f64 = 0.5;
/// Where chance is that much larger than the noise, the effects are chosen once more against it.
const HOT: f64 = 3.0;

/// What is diagnosed.
pub(super) struct Case<'a> {
    pub machine: &'a Machine,
    pub recordings: &'a [Recording],
    pub library: &'a Library,
    pub facts: &'a RecordingFacts,
    pub options: CalibrateOptions,
    /// Whether families are proposed for what has no name.
    pub propose: bool,
    pub progress: &'a Tell,
}

/// What was said of a case.
pub(super) struct Said {
    pub diagnosis: Diagnosis,
    /// A joint of which something is said that is so large that it is rare, and would be a lag's if that joint were late.
    pub may_be_late: Option<usize>,
}

/// From where the machine was linearised anew.
struct Origin {
    linear: Linear,
    noise: Vec<Noise>,
    /// Candidates of what was found.
    found: Vec<usize>,
    /// What that leaves, as the machine is, m and rad.
    left: Vec<f64>,
}

impl Case<'_> {
    /// Everything that these candidates say of it.
    ///
    /// # Errors
    /// As [`crate::identify::calibrate`].
    pub fn told(&self, plain: &[Candidate]) -> Result<Said> {
        let Case { machine, recordings, library, facts, progress, .. } = *self;
        progress("fitting constant geometry");
        let in_motion = facts.are_smooth();
        let mut linear = linear(machine, recordings, self.options, &facts.dead_bands, in_motion, progress)?;
        let mut candidates = Cow::Borrowed(plain);
        let runs = noise::runs(&linear);
        let mut coarse = Coarse::new(&linear, &candidates);
        let drives_of = |linear: &Linear, coarse: &Coarse| match in_motion {
            true => drives(linear, coarse, plain, library),
            false => Drives::none(linear.residual.len()),
        };
        let mut give_way = drives_of(&linear, &coarse);
        let mut out = noise::outliers(&linear, &runs, facts.are_smooth());
        if facts.are_smooth() {
            noise::spare_reversals(&linear, &mut out);
            out.iter_mut().zip(noise::waiting(&linear)).for_each(|(out, waiting)| *out |= waiting);
        }
        // What is left is noise, once everything else is modelled: the noise is judged anew from it.
        let mut noise = noise::of(&linear, &linear.residual, &runs, &out, facts);
        let mut in_model: Vec<ModelTerm> = Vec::new();
        let (mut round, mut moves) = (1, 0);
        let mut origin: Option<Origin> = None;
        loop {
            let rows = Rows::new(
                &linear,
                &give_way,
                &coarse,
                Whitener::new(linear.residual.len(), &runs, &noise, out.clone()),
            );
            let search = Search {
                rows: &rows,
                runs: &runs,
                base: rows.base(),
                candidates: &candidates,
                priors: priors(&candidates),
                commonness: commonness(&candidates),
                progress,
                overdispersion: 1.0,
                in_motion: facts.are_smooth(),
                known: Mutex::default(),
                grounds: Mutex::default(),
            };
            let judge = |in_model: &[ModelTerm]| {
                noise::of(&linear, &report::residual_of(&search, in_model), &runs, &out, facts)
            };
            let is_settled = |judged: &[Noise]| noise.iter().zip(judged).all(|(a, b)| a.is_close(b));
            in_model =
                search.run(&in_model, |in_model| round == NOISE_ROUNDS || is_settled(&judge(in_model)));
            in_model = less_rare(&search, in_model);
            if !search.in_motion && round < NOISE_ROUNDS {
                // What was found hid how far single positions are off; a slip there and back again is one that is.
                let lasting = |effect: &&ModelTerm| !search.is_event(effect.candidate);
                let lasting: Vec<ModelTerm> = in_model.iter().filter(lasting).cloned().collect();
                let off =
                    noise::outliers_again(&out, &linear, &report::residual_of(&search, &lasting), &runs);
                if !lasting.is_empty() && off != out && Rule::OutliersAgain.decides() {
                    noise = noise::of(&linear, &report::residual_of(&search, &in_model), &runs, &off, facts);
                    (out, in_model, round) = (off, lasting, round + 1);
                    continue;
                }
            }
            let judged = judge(&in_model);
            let report = |search: &Search, in_model: &[ModelTerm]| -> Said {
                let diagnosis =
                    report::report(search, in_model, (machine, library, facts), &noise, self.propose);
                Said {
                    diagnosis,
                    may_be_late: lag::may_be_late(search, in_model).filter(|_| Rule::MayBeLate.decides()),
                }
            };
            // Of two sets the second one, of effects that have each proved themselves, if it foretells more with all that is modelled beside
            // it.
            let better = |search: &Search, sets: &(Vec<ModelTerm>, Option<Vec<ModelTerm>>)| -> Said {
                let first = report(search, &sets.0);
                let Some(proved) = sets.1.as_ref().map(|proved| report(search, proved)) else { return first };
                let (fall, error) = proved.diagnosis.left_out.fall_from(&first.diagnosis.left_out);
                if fall > DECIDED * error && Rule::ProvedAlone.decides() { proved } else { first }
            };
            if moves < MOVES && !in_model.is_empty() || origin.is_some() {
                let there =
                    relinearised::straightened(&search, &in_model, machine, recordings, &facts.dead_bands)?;
                if there.is_bent && there.is_nearer && moves < MOVES {
                    give_way = drives_of(&there.linear, &coarse);
                    let linear = std::mem::replace(&mut linear, there.linear);
                    let found = in_model.iter().map(|term| term.candidate).collect();
                    origin = Some(Origin { linear, noise, found, left: there.left });
                    (noise, moves) = (judged, moves + 1);
                    continue;
                }
                // Far enough off, geometry bends into anything: a name that is gone where it was to stand, though it left less, was none.
                let is_gone = |found: &usize| in_model.iter().all(|term| term.candidate != *found);
                let energy = |left: &[f64]| search.rows.whitener.energy(left);
                let is_astray = |origin: &mut Origin| {
                    origin.found.iter().any(is_gone) && energy(&there.left) > energy(&origin.left)
                };
                if there.is_bent
                    && let Some(origin) = origin.take_if(is_astray)
                {
                    let gone: Vec<usize> = origin.found.into_iter().filter(is_gone).collect();
                    let mut rest = 0..candidates.len();
                    candidates.to_mut().retain(|_| rest.next().is_some_and(|c| !gone.contains(&c)));
                    (linear, noise, in_model, moves) = (origin.linear, origin.noise, Vec::new(), 0);
                    coarse = Coarse::new(&linear, &candidates);
                    give_way = drives_of(&linear, &coarse);
                    continue;
                }
            }
            if round == NOISE_ROUNDS || is_settled(&judged) {
                let overdispersion = search.leftover(&search.beside(&in_model, None)).overdispersion;
                if overdispersion < HOT || !Rule::SearchesAgain.decides() {
                    return Ok(better(&search, &sets_of(&search, search.unfolded(in_model))));
                }
                // Much is left, as it always is on real machines: the simplest names that stand out from it count.
                let search = search.against(overdispersion);
                let sets = sets_of(&search, search.unfolded(search.run(&in_model, |_| true)));
                in_model.clone_from(&sets.0);
                if moves < MOVES
                    && let Some(lagged) = lagged(&search, &in_model, plain)
                {
                    (candidates, moves, origin) = (Cow::Owned(lagged), moves + 1, None);
                    coarse = Coarse::new(&linear, &candidates);
                    continue;
                }
                return Ok(better(&search, &sets));
            }
            (noise, round) = (judged, round + 1);
        }
    }
}

/// How drives give way by the families with `of_every_drive`, at all joints of what follows a path.
fn drives(linear: &Linear, coarse: &Coarse, candidates: &[Candidate], library: &Library) -> Drives {
    let count = linear.residual.len();
    let none = Drives::none(count);
    let rows = Rows::new(linear, &none, coarse, Whitener::new(count, &[], &[], vec![false; count]));
    let stand = |c: &&Candidate| library.families()[c.family].of_every_drive && c.parameters.is_empty();
    candidates.iter().filter(stand).fold(Drives::none(count), |all, candidate| {
        match rows.raw(candidate, &[]) {
            Some(own) => all.and(candidate, &own),
            None => all,
        }
    })
}

/// Of what the search found, the set that is told. Of settled positions two: the effects without which left-out stretches are foretold worse,
/// and those that have each proved themselves. Nothing is left to be gained by their parameters.
fn sets_of(search: &Search, found: Vec<ModelTerm>) -> (Vec<ModelTerm>, Option<Vec<ModelTerm>>) {
    let found = less_rare(search, found);
    let least = folds::least(search);
    if search.in_motion {
        return (search.polished(&kept(search, &found, least)), None);
    }
    let found = likelier(search, found);
    let (first, proved) = (kept(search, &found, 0.0), kept(search, &found, least));
    let of = |set: &[ModelTerm]| -> Vec<usize> { set.iter().map(|effect| effect.candidate).collect() };
    let is_other = of(&proved) != of(&first);
    (search.polished(&first), is_other.then(|| search.polished(&proved)))
}

/// As a likelier set and what stands out beside that, while there is one.
fn likelier(search: &Search, mut found: Vec<ModelTerm>) -> Vec<ModelTerm> {
    for _ in 0..EXCHANGES {
        let Some(set) = search.likelier_set(&found) else { break };
        let more = search.run(&set, |_| true);
        found = if search.weight_of(&more) > search.weight_of(&set) { more } else { set };
    }
    found
}

/// The effects that foretell what was left out. Where one goes, another name may be the likeliest for what stood beside it: that takes its place,
/// unless this foretells worse by more than one standard error.
fn kept(search: &Search, found: &[ModelTerm], least: f64) -> Vec<ModelTerm> {
    let useful = folds::useful(search, found, least);
    if useful.len() == found.len() {
        return useful;
    }
    let mut last = useful.clone();
    for _ in 0..EXCHANGES {
        if !search.likeliest(&mut last) {
            break;
        }
        let count = last.len();
        last = folds::useful(search, &last, least);
        if last.len() == count {
            break;
        }
    }
    if folds::are_better(search, &useful, &last) { useful } else { last }
}

/// Families that are met more often than this part of the most frequent one are common.
const COMMON: f64 = 0.2;

/// How rare the family of each candidate is at a place where it may be: the logarithm of how often it is met, 0 for all common ones. What has
/// few places on a machine is not rare at them.
fn commonness(candidates: &[Candidate]) -> Vec<f64> {
    let most = candidates.iter().map(|c| c.often).fold(f64::MIN_POSITIVE, f64::max);
    candidates.iter().map(|c| (c.often / (COMMON * most)).min(1.0).ln()).collect()
}

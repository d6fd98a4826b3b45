//! The noise and the solution that belong together: solved in rounds, from where the set-ups were found, and from afar.

use super::Info;
use super::loss::Loss;
use super::noise::{Noise, with_stated};
use super::normal::{self, Normal};
use super::plausible;
use super::solve::{Problem, Solution, Solver};
use super::source;
use super::tally::{Sums, Tally};
use super::thin;
use super::unknowns::Unknowns;
use crate::error::Result;
use crate::units::{Quantity, Rms};

/// Rounds of re-estimating the noise from the residuals.
const NOISE_ROUNDS: usize = 12;
/// Readings for each unknown from which the noise can be taken without the prior: as many are then left over as are used up.
const READINGS_EACH: u64 = 2;
/// A fit whose noise falls below this part without the prior was held back by it: three quarters of what was left were geometry.
const HELD_BACK: f64 = 0.5;
/// Tolerances pull at a deviation of so many of them, which it may keep from the optimum.
const FAR_OFF: f64 = 5.0;
/// Whatever lies so many tolerances off is no deviation but another machine; `docs/reliability.md`.
const OTHER_MACHINE: f64 = 100.0;

/// A solution and the noise that it was weighted with.
pub(crate) struct Found {
    pub solution: Solution,
    pub noise: Vec<Noise>,
    /// Noise that the residuals show, by recording, before a stated `sigma` overrides it.
    pub seen: Vec<Noise>,
}

impl Found {
    /// Root mean square of residual lengths and angles over all samples, m and rad.
    pub fn rms(&self) -> Rms {
        normal::rms_over(&self.solution.normal.tallies)
    }
}

/// Solves, takes the noise from what is left, and solves again until the noise no longer changes. Where other noise gives the same sums but
/// for a factor, they are not taken anew; a scheme that lets the prior and all scales alone would walk the same way again, and does not.
///
/// `at_start` are the sums at the start with this noise, where they are at hand.
pub(super) fn settle(
    problem: &Problem,
    solver: Solver,
    start: Unknowns,
    noise: Vec<Noise>,
    at_start: Option<Normal>,
) -> Result<Found> {
    let mut noise = noise;
    let mut solution = problem.solve_on(solver, start.clone(), at_start, &noise)?;
    let mut steps = solution.steps;
    let mut seen = noise.clone();
    for _ in 0..NOISE_ROUNDS {
        seen = noise_left(problem, &solution.normal, &noise);
        let next = with_stated(problem.sources, &seen);
        let changed = noise.iter().zip(&next).any(|(a, b)| {
            let differs = |x: f64, y: f64| (x - y).abs() > 3e-3 * y;
            differs(a.m, b.m) || differs(a.rad, b.rad)
        });
        if !changed {
            break;
        }
        let weighed = reweighed(problem, &solution.normal, &noise, &next);
        noise = next;
        solution = match weighed {
            Some(normal) if !solver.uses_prior() && !problem.prior => Solution { normal, ..solution },
            // The named rivals regularise by their number of steps, so they always start afresh.
            _ if !solver.uses_prior() => problem.solve(solver, start.clone(), &noise)?,
            weighed => problem.solve_on(solver, solution.unknowns, weighed, &noise)?,
        };
        steps = if solver.uses_prior() { steps + solution.steps } else { solution.steps };
    }
    solution.steps = steps;
    Ok(Found { solution, noise, seen })
}

/// The sums at other noise, where they follow from those at hand: of least squares, by one factor for all readings.
fn reweighed(problem: &Problem, normal: &Normal, from: &[Noise], to: &[Noise]) -> Option<Normal> {
    if problem.loss != Loss::Squares || problem.motions.len() > 0 {
        return None;
    }
    let of_source = |((tally, from), to): ((&Tally, &Noise), &Noise)| {
        let of = |quantity| (tally.residuals[quantity].rows > 0).then(|| from[quantity] / to[quantity]);
        [of(Quantity::Length), of(Quantity::Angle)]
    };
    let mut ratios = normal.tallies.iter().zip(from).zip(to).flat_map(of_source).flatten();
    let ratio = ratios.next()?;
    let is_one = ratios.all(|other| (other - ratio).abs() <= f64::EPSILON * ratio);
    is_one.then(|| normal.times(ratio * ratio))
}

/// As [`settle`], but not held back by the prior. Far from the optimum the residuals are large; taken for noise, they let the tolerances
/// outweigh the data, and nothing moves. Where what is left could still be geometry, the noise is taken apart from the prior: from an
/// optimum without it, from which the fit with it starts again.
pub(super) fn settle_from_afar(
    problem: &mut Problem,
    solver: Solver,
    start: Unknowns,
    noise: Vec<Noise>,
    at_start: Option<Normal>,
) -> Result<Found> {
    let found = settle(problem, solver, start, noise, at_start)?;
    let enough = problem.sources.readings() >= READINGS_EACH * problem.layout.len as u64;
    let constant = problem.varying.is_constant() && problem.motions.len() == 0;
    if !(problem.prior && constant && enough) {
        return Ok(found);
    }
    let pulled = problem.farthest(&found.solution.unknowns) > FAR_OFF;
    if !pulled && !plausible::may_be_geometry(problem, &found.solution.unknowns)? {
        return Ok(found);
    }
    problem.prior = false;
    // The prior is no part of the sums.
    let Solution { unknowns, normal, .. } = &found.solution;
    let without = settle(problem, solver, unknowns.clone(), found.noise.clone(), Some(normal.clone()));
    problem.prior = true;
    let without = without?;
    let held_back = |with: &Found, without: &Found| {
        let less = |(with, without): (&Noise, &Noise)| {
            without.m < HELD_BACK * with.m || without.rad < HELD_BACK * with.rad
        };
        with.seen.iter().zip(&without.seen).any(less)
    };
    if !held_back(&found, &without) {
        return Ok(found);
    }
    let Solution { unknowns, normal, .. } = without.solution;
    let again = settle(problem, solver, unknowns, without.noise, Some(normal))?;
    let is_deviation = problem.farthest(&again.solution.unknowns) <= OTHER_MACHINE;
    let explains = || plausible::explains(problem, &found.solution.unknowns, &again.solution.unknowns);
    Ok(if held_back(&found, &again) && is_deviation && explains()? { again } else { found })
}

/// Noise of every source from the residuals of its kind and stated `sigma`, freed of the parameters that the fit used up.
fn noise_left(problem: &Problem, normal: &Normal, present: &[Noise]) -> Vec<Noise> {
    let sources = &problem.sources.all;
    let free = problem.layout.mask(|_| true);
    let used = if problem.free == free {
        Info::new(&normal.matrix, problem.layout, problem.prior, problem.frozen.clone()).used
    } else {
        problem.free.iter().filter(|f| **f).count() as f64
    } + normal.used_by_motions;
    let kinds: Vec<_> = sources.iter().map(source::Source::noise_group).collect();
    let rows =
        normal.tallies.iter().map(|t| t.residuals.m.inliers + t.residuals.rad.inliers).sum::<u64>() as f64;
    // Every scalar row bears its part of the parameters that are used up.
    let left = (1.0 - used / rows).max(0.05);
    kinds
        .iter()
        .zip(present)
        .map(|(kind, present)| {
            let mut sum = Tally::default();
            let own = kinds.iter().zip(&normal.tallies).filter(|(k, _)| *k == kind);
            own.for_each(|(_, tally)| sum.add(tally));
            let scale = |sums: &Sums, present: f64| match sums.inliers {
                0 => present,
                n => (sums.inlier_squares / (n as f64 * left)).sqrt().max(thin::FINEST),
            };
            sum.residuals.zip(*present).map(|(sums, present)| scale(&sums, present))
        })
        .collect()
}

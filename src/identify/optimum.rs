//! The optimum of constant deviations with everything that it was found from: what a diagnosis starts from.

use super::source::Sources;
use super::unknowns::{Layout, Unknowns};
use super::{
    CalibrateOptions, ErrorModel, Fit, Info, Placed, Problem, enough_for_setups, enough_to_start, fit,
    information, is_of_setup, place, settle_from_afar,
};
use crate::error::Result;
use crate::machine::Machine;
use crate::recording::Recording;
use crate::variation::CONSTANT;

/// Constant deviations and set-ups at their best.
pub(crate) struct Optimum<'a> {
    pub sources: Sources<'a>,
    pub unknowns: Unknowns,
    pub fit: Fit,
}

/// Recordings as sources of constant deviations.
pub(crate) fn sources<'a>(
    machine: &'a Machine,
    recordings: &'a [Recording],
    progress: &dyn Fn(&str),
) -> Result<Sources<'a>> {
    Sources::new(recordings, machine, &CONSTANT, &ErrorModel::default().dead_bands, progress)
}

/// Calibrates with constant deviations.
pub(crate) fn optimum<'a>(
    machine: &'a Machine,
    recordings: &'a [Recording],
    options: CalibrateOptions,
    progress: &dyn Fn(&str),
) -> Result<Optimum<'a>> {
    let sources = sources(machine, recordings, progress)?;
    enough_to_start(machine, &sources)?;
    enough_for_setups(&sources)?;
    let layout = Layout::new(machine, &sources, &CONSTANT, 1.0);
    let mut problem = Problem::new(machine, &sources, &layout, &CONSTANT, is_of_setup);
    problem.progress = progress;
    let start = Unknowns::nominal(machine, &sources, &CONSTANT);
    let Placed { solution: placed, noise, loss, thin } = place(&mut problem, start)?;
    let (nominal, declared) = (placed.normal.tallies.clone(), placed.unknowns.clone());
    problem.loss = options.loss;
    problem.prior = options.prior;
    problem.free = vec![true; layout.len];
    let at_start = (loss == options.loss).then_some(placed.normal);
    let found = settle_from_afar(&mut problem, options.solver, placed.unknowns, noise, at_start)?;
    let open = problem.open(&found.solution.unknowns, &found.noise, &thin, information::OPEN);
    let information = Info::new(&found.solution.normal.matrix, &layout, problem.prior, open);
    let fit = fit::report(&problem, &nominal, &declared, &found, information, options)?;
    let unknowns = found.solution.unknowns;
    Ok(Optimum { sources, unknowns, fit })
}

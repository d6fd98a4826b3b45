//! Identification: from recordings to the deviations of a machine, `docs/model.md` (20) to (28).
//!
//! Exact residuals of all recordings, robust and weighted by the noise, and a prior on the **total** deviation from the machine
//! file's tolerances, so that what the data do not see stays at zero instead of drifting. The result is data: [`Fit`].

mod align;
mod basis;
mod blocks;
mod evaluator;
mod evidence;
mod far_off;
mod fit;
mod gauge;
mod information;
mod judge;
mod loss;
mod noise;
mod normal;
mod optimum;
mod options;
mod part;
mod partial;
mod places;
mod plausible;
mod replay;
mod set_up_values;
mod settle;
mod solve;
mod source;
mod stretch;
mod tally;
mod thin;
mod unknowns;
mod unseen;
mod upright;
mod warnings;

inner! {
    use information::Information;
}
pub(crate) use evaluator::{Evaluator, Moment, Values};
pub use far_off::FarOff;
pub use fit::{
    BeforeAfter, COMPONENTS, CoefficientFit, Combination, Fit, HeldOut, ParameterFit, RecordingFit, SetupFit,
    Suspect,
};
pub(crate) use gauge::EXTRAS;
pub use judge::{Figures, PieceFit};
pub use loss::Loss;
pub(crate) use optimum::{optimum, sources};
pub use options::{Approach, CalibrateOptions, ErrorModel};
pub use partial::{Merged, PartialEquations, Round, merge};
pub(crate) use places::Places;
pub(crate) use plausible::by_commands;
pub use plausible::{Plausibility, as_declared, worst};
pub(crate) use set_up_values::SetUpValues;
pub(crate) use settle::Found;
pub use solve::{Solver, Stop};
pub(crate) use source::{Known, Source, Sources, channel};
pub(crate) use stretch::{Beginning, Memories, Stretch, by_dyad, stretches};

use serde::{Deserialize, Serialize};

use crate::calibration::CalibratedMachine;
use crate::error::{Error, Result};
use crate::error_motion::Motions;
use crate::lie::{Pose, Twist};
use crate::machine::Machine;
use crate::recording::Recording;
use crate::units::Rms;
use crate::variation::{Variation, Varying};
use crate::wording;
use evidence::Sizes;
use information::Information as Info;
use noise::Noise;
use settle::{settle, settle_from_afar};
use solve::{Problem, Solution};
use thin::Thin;
use unknowns::Block;
pub(crate) use unknowns::{Layout, Role, Unknowns};
use upright::{Frames, turn_gravity, upright};

/// Direction parts other than play: factors on their prior among which the data choose.
const BUT_PLAY: [f64; 5] = [1.0, 0.3, 0.1, 0.03, 0.01];
/// Error motions: factors on their lengths and on their angles that the data weigh.
const LENGTHS: [f64; 3] = [0.5, 1.0, 2.0];
const ANGLES: [f64; 3] = [0.5, 1.0, 2.0];
/// Rounds of choosing factors; the second sees what the first has changed.
const SIZE_ROUNDS: usize = 2;

/// Identifies the deviations of `machine` from recordings, which may differ in kind and set-up.
///
/// # Errors
/// If a recording cannot be read, no joint moves, or there are no more readings than the set-ups alone need.
pub fn calibrate(
    machine: &Machine,
    recordings: &[Recording],
    options: CalibrateOptions,
) -> Result<(CalibratedMachine, Fit)> {
    calibrate_model(machine, recordings, &ErrorModel::default(), options, &|_| {})
}

/// As [`calibrate`], of a model whose deviations vary, telling `progress` what it is at.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_model(
    machine: &Machine,
    recordings: &[Recording],
    model: &ErrorModel,
    options: CalibrateOptions,
    progress: &dyn Fn(&str),
) -> Result<(CalibratedMachine, Fit)> {
    upright(|frames| attempt(machine, recordings, model, options, frames, progress))
}

fn attempt(
    machine: &Machine,
    recordings: &[Recording],
    model: &ErrorModel,
    options: CalibrateOptions,
    frames: Option<&[Pose<f64>]>,
    progress: &dyn Fn(&str),
) -> Result<((CalibratedMachine, Fit), Frames)> {
    let varying = &model.varying;
    let mut sources = Sources::new(recordings, machine, varying, &model.dead_bands, progress)?;
    sources.approach(&model.approaches)?;
    identify(machine, sources, model, options, frames, progress)
}

/// From sources to the machine.
fn identify(
    machine: &Machine,
    mut sources: Sources,
    model: &ErrorModel,
    options: CalibrateOptions,
    frames: Option<&[Pose<f64>]>,
    progress: &dyn Fn(&str),
) -> Result<((CalibratedMachine, Fit), Frames)> {
    let varying = &model.varying;
    if let Some(count) = model.samples {
        let directions = varying.directions.as_ref();
        sources.pick(count, directions.map_or(1, |d| d.piece_count()), |stretch, k| {
            directions.map_or(0, |d| d.piece(stretch.directions(k)))
        })?;
    }
    enough_to_start(machine, &sources)?;
    enough_for_setups(&sources)?;
    let layout = Layout::new(machine, &sources, varying, 1.0);
    let alone: usize = layout.blocks.iter().filter(|b| !b.prior).map(|b| b.len).sum();
    if sources.readings() <= alone as u64 {
        return Err(Error::Undetermined {
            what: format!(
                "{} for {} of the set-ups: nothing is left to identify the machine from",
                wording::count(sources.readings(), "scalar reading", "scalar readings"),
                wording::count(alone as u64, "unknown", "unknowns")
            ),
            mend:
                "record more poses, or declare what is known of the set-up (frame, tool point, zero, length)"
                    .into(),
        });
    }
    let prior = options.prior && options.solver.uses_prior();
    let start = Unknowns::nominal(machine, &sources, varying);
    let hangs = turn_gravity(machine, &mut sources, &layout, start.clone(), frames)?;
    // As declared: only what nobody has stated is fitted.
    let mut problem = Problem::new(machine, &sources, &layout, varying, is_of_setup);
    problem.progress = progress;
    progress("finding the set-ups");
    let Placed { solution: placed, noise, thin, loss } = place(&mut problem, start)?;
    let nominal = placed.normal.tallies.clone();
    let declared = placed.unknowns.clone();

    problem.loss = options.loss;
    problem.prior = prior;
    problem.free = vec![true; layout.len];
    if prior {
        let play = |j| varying.directions.as_ref().and_then(|directions| directions.play(machine, j));
        problem.motions = Motions::new(machine, &sources.ranges(), model.error_motions, play);
    }
    let Solution { unknowns, normal, .. } = placed;
    let at_start = (loss == options.loss && problem.motions.len() == 0).then_some(normal);
    let mut found = settle_from_afar(&mut problem, options.solver, unknowns, noise, at_start)?;
    let room = problem.motions.clone();
    let fitting = |but_play: f64| Layout::new(machine, &sources, varying, but_play);
    // Without room for error motions, those would speak for direction parts.
    let but_play: &[f64] = if varying.directions.is_some() { &BUT_PLAY } else { &[1.0] };
    let candidates: Vec<(f64, Layout)> = but_play.iter().map(|factor| (*factor, fitting(*factor))).collect();
    let mut sizes = Sizes { but_play: 1.0, motions: [1.0; 2] };
    for _ in 0..SIZE_ROUNDS {
        let likely = evidence::likely(
            &found.solution,
            problem.layout,
            &problem.motions,
            sizes.motions,
            &candidates,
            &of_motions(),
        );
        let Some(likely) = likely.filter(|likely| likely.differ(&sizes)) else { break };
        sizes = likely;
        problem.motions = room.sized(sizes.motions);
        if let Some((_, layout)) = candidates.iter().find(|(factor, _)| *factor == sizes.but_play) {
            problem.layout = layout;
        }
        let mut start = found.solution.unknowns;
        start.motions.clear();
        found = settle(&problem, options.solver, start, found.noise, None)?;
    }
    let layout = problem.layout;
    let open = problem.open(&found.solution.unknowns, &found.noise, &thin, information::OPEN);
    let information = Info::new(&found.solution.normal.matrix, layout, prior, open);
    let mut calibrated = calibrated(machine, &sources, &found);
    let open = unseen::unseen(machine, layout, &information);
    (calibrated.unseen, calibrated.unseen_at_all) = (Some(open.patterns), open.at_all);
    let fit = fit::report(&problem, &nominal, &declared, &found, information, options)?;
    let unknowns = &found.solution.unknowns;
    if !varying.is_constant() || problem.motions.len() > 0 {
        calibrated = calibrated.with_variation(Variation {
            motions: problem.motions.found(&unknowns.motions),
            varying: varying.clone(),
            parts: unknowns.parts.clone(),
            coefficients: unknowns.coefficients.clone(),
            dead_bands: sources.dead_bands.clone(),
            samples: fit.piece_samples.clone(),
        });
    }
    let frames = hangs.then(|| upright::frames(unknowns));
    Ok(((calibrated, fit), frames))
}

/// All pairs of factors on error motions.
fn of_motions() -> Vec<[f64; 2]> {
    LENGTHS.iter().flat_map(|length| ANGLES.iter().map(move |angle| [*length, *angle])).collect()
}

/// What nobody has stated: frames, tool points, zeros and lengths of the set-ups.
fn is_of_setup(block: &Block) -> bool {
    !block.prior && !matches!(block.role, Role::Term(_))
}

/// Finds again only what belongs to the set-up of `recordings`: frame `w`, unknown tool points, zeros and lengths, and of effects
/// that belong to where the machine stands ([`crate::effects::StoredEffect::of_setup`]) their coefficients there. The machine stays
/// as it is calibrated.
///
/// # Errors
/// As [`calibrate`].
pub fn fit_setup(
    calibrated: &CalibratedMachine,
    recordings: &[Recording],
    loss: Loss,
) -> Result<CalibratedMachine> {
    upright(|frames| attempt_setup(calibrated, recordings, loss, frames))
}

fn attempt_setup(
    calibrated: &CalibratedMachine,
    recordings: &[Recording],
    loss: Loss,
    frames: Option<&[Pose<f64>]>,
) -> Result<(CalibratedMachine, Frames)> {
    let calibrated = &calibrated.for_setups_of(recordings);
    let (machine, (variation, _)) = (calibrated.machine(), calibrated.variation_in(recordings));
    let varying = &variation.varying;
    let dead_bands: Vec<_> = variation.dead_bands.iter().map(|band| Some(*band)).collect();
    let mut sources = Sources::new(recordings, machine, varying, &dead_bands, &|_| {})?;
    enough_for_setups(&sources)?;
    let layout = Layout::new(machine, &sources, varying, 1.0);
    let mut start = Unknowns::nominal(machine, &sources, varying);
    start.dh = calibrated.deviations().to_vec();
    (start.parts, start.coefficients) = (variation.parts.clone(), variation.coefficients.clone());
    start.dh[machine.w_index()] = Twist::zero(0.0);
    let hangs = turn_gravity(machine, &mut sources, &layout, start.clone(), frames)?;
    let mut problem = Problem::new(machine, &sources, &layout, varying, |block| match block.role {
        Role::Term(i) => varying.terms[i].of_setup,
        role => !matches!(role, Role::Dyad(_) | Role::Part { .. }),
    });
    problem.loss = loss;
    let Placed { solution: placed, noise, .. } = place(&mut problem, start)?;
    let at_start = Some(placed.normal);
    let found = settle(&problem, Solver::LevenbergMarquardt, placed.unknowns, noise, at_start)?;
    let mut fitted = calibrated.clone();
    let unknowns = &found.solution.unknowns;
    put_setups(&mut fitted, &sources, unknowns);
    let terms = varying.terms.iter().zip(&unknowns.coefficients).filter(|(term, _)| term.of_setup);
    fitted.put_terms_of_setups(&terms.map(|(_, value)| *value).collect::<Vec<_>>());
    Ok((fitted, hangs.then(|| upright::frames(unknowns))))
}

/// The machine as declared, with the frames, tool points, zeros and lengths that the recordings declare unknown as they are found on it:
/// what `as declared` refers to in a [`Fit`].
///
/// # Errors
/// As [`calibrate`].
pub fn declared(machine: &Machine, recordings: &[Recording]) -> Result<CalibratedMachine> {
    let varying = Varying::default();
    let sources = Sources::new(recordings, machine, &varying, &[], &|_| {})?;
    enough_to_start(machine, &sources)?;
    enough_for_setups(&sources)?;
    let layout = Layout::new(machine, &sources, &varying, 1.0);
    let mut problem = Problem::new(machine, &sources, &layout, &varying, is_of_setup);
    let start = Unknowns::nominal(machine, &sources, &varying);
    let Placed { solution, .. } = place(&mut problem, start)?;
    let mut result = CalibratedMachine::nominal(machine.clone());
    put_setups(&mut result, &sources, &solution.unknowns);
    Ok(result)
}

/// The machine with all that was found.
fn calibrated(machine: &Machine, sources: &Sources, found: &Found) -> CalibratedMachine {
    let unknowns = &found.solution.unknowns;
    let mut deviations = unknowns.dh.clone();
    let known: Vec<_> = unknowns.setups.iter().filter(|s| !s.unknown).map(|s| s.dh).collect();
    if !known.is_empty() {
        let sum = known.iter().fold(Twist::zero(0.0), |sum, dh| sum + *dh);
        deviations[machine.w_index()] = sum.times(1.0 / known.len() as f64);
    }
    let seen = sources.ranges().into_iter().map(Some).collect();
    let mut result = CalibratedMachine::found(machine, deviations, seen, sources.samples(), found.rms());
    put_setups(&mut result, sources, unknowns);
    result
}

/// Frames, tool points and rotations, zeros and lengths as found, in place of any of the same name.
fn put_setups(calibrated: &mut CalibratedMachine, sources: &Sources, unknowns: &Unknowns) {
    let setup = |s: usize| sources.setups[s].clone();
    for (name, frame) in sources.setups.iter().zip(&unknowns.setups) {
        calibrated.setups.retain(|(known, _)| known != name);
        calibrated.setups.push((name.clone(), frame.pose()));
    }
    for (name, at) in sources.tool_points.iter().zip(&unknowns.values.tool_points) {
        calibrated.tool_points.retain(|(known, _)| known != name);
        calibrated.tool_points.push((name.clone(), *at));
    }
    for (name, rotation) in sources.tool_rotations.iter().zip(&unknowns.values.tool_rotations) {
        calibrated.tool_rotations.retain(|(known, _)| known != name);
        calibrated.tool_rotations.push((name.clone(), *rotation));
    }
    for ((s, of), value) in sources.zeros.iter().zip(&unknowns.values.zeros) {
        calibrated.zeros.retain(|(known, channel, _)| (known, channel) != (&sources.setups[*s], of));
        calibrated.zeros.push((setup(*s), of.clone(), *value));
    }
    for (s, value) in sources.lengths.iter().zip(&unknowns.values.lengths) {
        calibrated.lengths.retain(|(known, _)| *known != sources.setups[*s]);
        calibrated.lengths.push((setup(*s), *value));
    }
}

/// What recordings can tell, before anything is identified.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Reach {
    /// Independent combinations of all unknowns that these recordings see.
    pub rank: usize,
    /// Combinations that the same instruments would see on general poses.
    pub rank_in_general: usize,
    /// Unknowns in all: six per dyad and set-up, and what the recordings declare unknown.
    pub unknowns: usize,
    /// Samples used.
    pub samples: u64,
    /// Rows left out because a number was missing.
    pub dropped: u64,
    /// RMS of the residuals with the machine as declared.
    pub nominal: Rms,
}

/// How many combinations of the unknowns these recordings see, at the machine as declared.
///
/// # Errors
/// As [`calibrate`].
pub fn reach(machine: &Machine, recordings: &[Recording]) -> Result<Reach> {
    let varying = Varying::default();
    let sources = Sources::new(recordings, machine, &varying, &[], &|_| {})?;
    enough_to_start(machine, &sources)?;
    let layout = Layout::new(machine, &sources, &varying, 1.0);
    let mut problem = Problem::new(machine, &sources, &layout, &varying, is_of_setup);
    let Placed { solution: placed, .. } =
        place(&mut problem, Unknowns::nominal(machine, &sources, &varying))?;
    let general = normal::matrix_in_general(machine, &sources, &layout, &placed.unknowns);
    Ok(Reach {
        rank: Info::new(&placed.normal.matrix, &layout, true, Vec::new()).rank,
        rank_in_general: Info::new(&general, &layout, true, Vec::new()).rank,
        unknowns: layout.len,
        samples: sources.samples(),
        dropped: sources.all.iter().map(|s| s.summary.dropped).sum(),
        nominal: normal::rms_over(&placed.normal.tallies),
    })
}

/// Set-ups as found before anything of the machine is identified.
struct Placed {
    solution: Solution,
    /// With which the solution was weighted.
    noise: Vec<Noise>,
    loss: Loss,
    thin: Vec<Thin>,
}

/// Set-ups found from nothing and then exactly, the machine held. What the data leave open of them is frozen, here and in all that
/// follows: it stays as the machine file has it.
fn place(problem: &mut Problem, mut start: Unknowns) -> Result<Placed> {
    let (machine, sources) = (problem.machine, problem.sources);
    let thin = thin::thin(machine, sources)?;
    align::align(machine, sources, &thin, &mut start);
    let mut noise = thin::robust_noise(machine, sources, &thin, &start);
    problem.frozen = problem.open(&start, &noise, &thin, 0.0);
    let mut solution = problem.solve(Solver::LevenbergMarquardt, start, &noise)?;
    let rounds = if problem.free.contains(&true) { 3 } else { 0 };
    for _ in 0..rounds {
        noise = thin::robust_noise(machine, sources, &thin, &solution.unknowns);
        solution = problem.solve(Solver::LevenbergMarquardt, solution.unknowns, &noise)?;
    }
    Ok(Placed { solution, noise, loss: problem.loss, thin })
}

/// Refuses what cannot be identified at all.
fn enough_to_start(machine: &Machine, sources: &Sources) -> Result<()> {
    let moving = (0..machine.commands().len())
        .any(|c| sources.all.iter().any(|s| s.summary.moving.get(c).copied().unwrap_or(false)));
    let several = sources.ranges().iter().any(|(low, high)| high - low > 1e-9);
    if sources.samples() < 2 {
        return Err(Error::Undetermined {
            what: "there is only one sample in all recordings".into(),
            mend: "record the same quantity at many positions of the joints".into(),
        });
    }
    if !moving && !several {
        return Err(Error::Undetermined {
            what: "no joint moves in any recording: nothing of the machine can be identified".into(),
            mend: "record while the joints move through their travel".into(),
        });
    }
    Ok(())
}

/// Refuses set-ups and tool points that have fewer readings than unknowns of their own.
fn enough_for_setups(sources: &Sources) -> Result<()> {
    let readings = |pick: &dyn Fn(&source::Source) -> bool| -> u64 {
        sources.all.iter().filter(|s| pick(s)).map(source::Source::readings).sum()
    };
    let mend = || "record more poses with this set-up, or declare what is known of it".to_string();
    for (setup, name) in sources.setups.iter().enumerate() {
        let frame = if sources.frame_unknown[setup] { 6 } else { 0 };
        let lengths = sources.lengths.iter().filter(|s| **s == setup).count() as u64;
        let needed = frame + lengths;
        let has = readings(&|s| s.setup == setup && s.sees_frames());
        if needed > 0 && has < needed {
            let name = if name.is_empty() { "the set-up".into() } else { format!("set-up \"{name}\"") };
            let of = match (frame > 0, lengths > 0) {
                (true, true) => "frame w and length",
                (true, false) => "frame w",
                (false, _) => "length",
            };
            return Err(Error::Undetermined {
                what: format!(
                    "{} for the {} of {name} ({of})",
                    wording::count(has, "scalar reading", "scalar readings"),
                    wording::count(needed, "unknown", "unknowns")
                ),
                mend: mend(),
            });
        }
    }
    for (point, name) in sources.tool_points.iter().enumerate() {
        let has = readings(&|s| s.tool_point.unknown() == Some(point) && s.sees_frames());
        if (1..3).contains(&has) {
            return Err(Error::Undetermined {
                what: format!(
                    "{} for the 3 coordinates of tool point \"{name}\"",
                    wording::count(has, "scalar reading", "scalar readings")
                ),
                mend: mend(),
            });
        }
    }
    Ok(())
}

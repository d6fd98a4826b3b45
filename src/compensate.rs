//! Rewrites NC programs so that a machine with known errors cuts what the program means.
//!
//! The program says where tip and tool axis should be under the nominal kinematics; the inverse of the
//! calibrated chain says which joint commands bring the actual machine there; those are written where the
//! program's own numbers stood, every other byte as it was. `docs/compensate.md`.
//!
//! ```
//! use kincal::compensate::{Options, Setup, compensate_text};
//! use kincal::lie::Twist;
//! use kincal::{CalibratedMachine, Machine};
//!
//! let machine = Machine::parse("mill.ron", r#"Machine(
//!     name: "mill", units: (length: mm, angle: deg),
//!     workpiece: [(frame: "w")],
//!     tool: [(frame: "x", joint: Prismatic(axis: "x")), (frame: "y", joint: Prismatic(axis: "y")),
//!            (frame: "z", joint: Prismatic(axis: "z")), (frame: "t")],
//! )"#)?;
//! // Y is out of square with X by 1 mrad.
//! let mut deviations = vec![Twist::from_array([0.0; 6]); 5];
//! deviations[2].w.0[2] = 1e-3;
//! deviations[3].w.0[2] = -1e-3;
//! let calibrated = CalibratedMachine::nominal(machine).with_deviations(deviations);
//! let program = "G1 X0. Y0. Z0. F900 (corner)\nY100.\n";
//! let (text, report) =
//!     compensate_text(&calibrated, "part.nc", program, &Setup::default(), &Options::default())?;
//! assert_eq!(text, "G1 X0. Y0. Z0. F900 (corner)\nX0.1 Y100.\n");
//! assert_eq!(report.inserted_words, 1);
//! # Ok::<(), kincal::Error>(())
//! ```

mod arc;
mod calls;
mod control;
mod correct;
mod effects;
mod fault;
mod follower;
mod frame;
mod gaps;
mod model;
mod report;
mod setup;
mod straight;
mod target;
mod tool;
mod ways;

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;

pub use fault::CompensateFault;
pub use model::Model;
pub use report::{
    Listed, MOST_LISTED, OutOfTravel, Report, Reversal, SingularBlock, UnknownWay, Unreached, Unseen,
    UnseenPattern, Worst,
};
pub use setup::{Setup, ToolAxis};

use crate::calibration::CalibratedMachine;
use crate::error::{Error, Result};
use crate::inverse::Mode;
use crate::machine::Machine;
use crate::nc::{Dialect, Program, State};
use calls::{Bounds, Calls};
use follower::{Follower, put};
use gaps::Gaps;

/// How to write.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Digits behind the point; without, the most that the program itself has, but 3 (4 in inch) at least.
    pub decimals: Option<usize>,
    /// Tolerance within which arcs become lines, m; without, an arc that the errors deform is refused.
    pub arcs: Option<f64>,
    /// Largest error of the tip that a straight move may leave between its ends, m; without, moves stay
    /// whole.
    pub split: Option<f64>,
    /// What counts, where it is not what the machine has joints for.
    pub mode: Option<Mode>,
    /// The dialect, where it is not to be taken from the program.
    pub dialect: Option<Dialect>,
}

/// A name without quotes.
pub(crate) fn named(name: &str) -> String {
    name.trim().trim_matches('"').to_string()
}

/// Corrects the program `path` and writes it to `out`. Memory does not grow with the program, sub-programs
/// aside.
///
/// # Errors
/// [`Error::Input`] with the line that cannot be read or corrected, [`Error::File`]; `out` then
/// holds a part.
pub fn compensate(
    calibrated: &CalibratedMachine,
    path: impl AsRef<Path>,
    setup: &Setup,
    options: &Options,
    out: &mut dyn Write,
) -> Result<Report> {
    let path = path.as_ref();
    let open = || {
        let file = File::open(path).map_err(|e| Error::file(path, e))?;
        Program::new(path, BufReader::new(file))
    };
    let mut model = model::of_machine(calibrated);
    run(calibrated.machine(), &mut *model, &open, setup, options, out)
}

/// As [`compensate`], from a text to a text; `file` is only the name that messages use.
///
/// # Errors
/// As [`compensate`].
pub fn compensate_text(
    calibrated: &CalibratedMachine,
    file: impl AsRef<Path>,
    text: impl AsRef<[u8]>,
    setup: &Setup,
    options: &Options,
) -> Result<(String, Report)> {
    let mut model = model::of_machine(calibrated);
    let machine = calibrated.machine();
    let (bytes, report) = compensate_with(machine, &mut *model, file, text.as_ref(), setup, options)?;
    Ok((String::from_utf8_lossy(&bytes).into_owned(), report))
}

/// As [`compensate_text`], for any model of a machine's errors.
///
/// # Errors
/// As [`compensate`].
pub fn compensate_with(
    machine: &Machine,
    model: &mut dyn Model,
    file: impl AsRef<Path>,
    text: &[u8],
    setup: &Setup,
    options: &Options,
) -> Result<(Vec<u8>, Report)> {
    let mut out = Vec::with_capacity(text.len() + text.len() / 4);
    let open = || Program::new(file.as_ref(), text);
    let report = run(machine, model, &open, setup, options, &mut out)?;
    Ok((out, report))
}

/// One pass over the program behind a look for sub-programs; one more before it where directions of travel count, as far as the first
/// motion of each axis, and one where there are sub-programs, for what their lines need.
fn run<R: BufRead>(
    machine: &Machine,
    model: &mut dyn Model,
    open: &dyn Fn() -> Result<Program<R>>,
    setup: &Setup,
    options: &Options,
    out: &mut dyn Write,
) -> Result<Report> {
    let open = || {
        let mut program = open()?;
        if let Some(dialect) = options.dialect {
            program.set_dialect(dialect);
        }
        Ok::<_, Error>(program)
    };
    if model.is_nominal() {
        return copy(machine, &mut open()?, out);
    }
    match correct(machine, model, &open, setup, options, out) {
        Err(error) if error.fault().is_some_and(Gaps::is_one) => {
            let all = gaps(machine, model, &open, setup, options)?.together();
            Err(match (error.place(), all) {
                (Some(place), Some(all)) => Error::input(place.clone(), all),
                _ => error,
            })
        }
        other => other,
    }
}

/// The passes of [`run`] over a program that needs any.
fn correct<R: BufRead>(
    machine: &Machine,
    model: &mut dyn Model,
    open: &dyn Fn() -> Result<Program<R>>,
    setup: &Setup,
    options: &Options,
    out: &mut dyn Write,
) -> Result<Report> {
    let mut program = open()?;
    let dialect = program.dialect();
    let mut calls = sub_programs(&mut program)?;
    let mut first = vec![0; machine.commands().len()];
    if !model.keyed().is_empty() {
        let mut follower = Follower::new(machine, model, setup, options, dialect, &first);
        follower.scouting = true;
        // What is wrong with the program is told when it is corrected.
        let _ = follow(&mut follower, &mut open()?, &mut calls, &mut std::io::sink());
        first = follower.ways.first;
    }
    if !calls.is_empty() {
        calls.collecting = true;
        let mut follower = Follower::new(machine, model, setup, options, dialect, &first);
        follow(&mut follower, &mut open()?, &mut calls, &mut std::io::sink())?;
        calls.collecting = false;
    }
    let mut follower = Follower::new(machine, model, setup, options, dialect, &first);
    let blocks = follow(&mut follower, &mut open()?, &mut calls, out)?;
    let mut report = follower.finish();
    report.blocks = blocks;
    Ok(report)
}

/// The sub-programs of a file.
fn sub_programs<R: BufRead>(program: &mut Program<R>) -> Result<Calls> {
    let (dialect, mut bounds, mut calls) = (program.dialect(), Bounds::default(), Calls::default());
    while let Some(block) = program.next_block()? {
        if let Some(name) = bounds.of(&block, dialect) {
            calls.add(&name, &block);
        }
    }
    Ok(calls)
}

/// All that the program needs of the set-up and the set-up does not say.
fn gaps<R: BufRead>(
    machine: &Machine,
    model: &mut dyn Model,
    open: &dyn Fn() -> Result<Program<R>>,
    setup: &Setup,
    options: &Options,
) -> Result<Gaps> {
    let mut calls = sub_programs(&mut open()?)?;
    let mut program = open()?;
    let (dialect, mut bounds) = (program.dialect(), Bounds::default());
    let first = vec![0; machine.commands().len()];
    let mut follower = Follower::new(machine, model, setup, options, dialect, &first);
    follower.gaps = Some(Gaps::default());
    while let Some(mut block) = program.next_block()? {
        if bounds.of(&block, dialect).is_none() {
            // Whatever else is wrong with a block is told once the set-up is complete.
            let _ = calls.block(&mut follower, &mut block, 0, &mut std::io::sink());
        }
    }
    Ok(follower.gaps.unwrap_or_default())
}

/// One pass; how many blocks there are.
fn follow<R: BufRead>(
    follower: &mut Follower,
    program: &mut Program<R>,
    calls: &mut Calls,
    out: &mut dyn Write,
) -> Result<u64> {
    let dialect = program.dialect();
    let mut bounds = Bounds::default();
    let mut blocks = 0;
    while let Some(mut block) = program.next_block()? {
        blocks += 1;
        if bounds.of(&block, dialect).is_some() {
            calls.write(&block, out)?;
        } else {
            calls.block(follower, &mut block, 0, out)?;
        }
        if follower.scouting && follower.ways.found(follower.model) {
            break;
        }
    }
    Ok(blocks)
}

/// A machine without errors: the program as it is.
fn copy<R: BufRead>(machine: &Machine, program: &mut Program<R>, out: &mut dyn Write) -> Result<Report> {
    let addresses = (0..machine.commands().len()).map(|c| machine.command_joint(c).nc_word().address);
    let mut state = State::new(program.dialect(), addresses);
    let mut report = Report { machine: machine.name().to_string(), ..Report::default() };
    while let Some(block) = program.next_block()? {
        report.blocks += 1;
        // A block that no control would take is not our trouble here.
        if let Ok(step) = state.apply(&block)
            && let Some(motion) = step.motion
        {
            let moves = if motion.machine_frame { &mut report.machine_moves } else { &mut report.moves };
            *moves += 1;
        }
        put(&block, out)?;
    }
    Ok(report)
}

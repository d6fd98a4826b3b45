//! Rewrites NC programs so that a machine with known errors cuts what the program means.
//!
//! The program says where tip and tool axis should be under the nominal kinematics; the inverse of the
//! calibrated chain says which joint commands bring the actual machine there; those are written where the
//! program's own numbers stood, every other byte as it was. `docs/compensate.md`.
//!
//! ```
//! use kincal::compensate::{CompensateOptions, Setup, compensate_text};
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
//!     compensate_text(&calibrated, "part.nc", program, &Setup::default(), &CompensateOptions::default())?;
//! assert_eq!(text, "G1 X0. Y0. Z0. F900 (corner)\nX0.1 Y100.\n");
//! assert_eq!(report.inserted_words, 1);
//! # Ok::<(), kincal::Error>(())
//! ```

// In the order in which they are imported, earliest first; a paragraph is a layer whose files do not import each other.

// What is asked for and told.
mod fault;
mod mark;
mod options;
mod report;
mod setup;

// What is wrong with the machine.
mod model;

mod pieces;

mod effects;

mod calibrated;

// What a block says.
mod axis;
mod code;
mod event;
mod motion_word;
mod output;
mod position;
mod refusal;

mod call;

// The program as its control follows it.
mod frame;
mod places;
mod tool;

mod control;

mod target;
mod ways;

mod interpreter;

mod arc;

// The correction of a position.
mod style;
mod tip_error;
mod unseen;

mod corrector;
mod envelope;

mod looks;

mod words;

// The program as it is followed, what there is to tell and what stands behind some lines of it.
mod part;
mod subprograms;

mod ahead;

mod standing;

// The program as it is written.
mod pass;

mod lines;

mod cycle;
mod feed;
mod straight;
mod turned;

mod curve;

// What goes over a whole program.
mod passage;

mod gaps;
mod scout;
mod trace;
mod writer;

mod batches;

mod verify;

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;

pub use fault::CompensateFault;
#[cfg(feature = "cli")]
pub(crate) use mark::Fingerprint;
pub use model::Model;
pub use options::{CompensateOptions, IntegerUnit, UnknownAxes};
pub use report::{
    ExtrapolatedJoint, Listed, MOST_LISTED, Report, Reversal, SingularBlock, UnknownPlace, UnknownWay,
    Unreached, Unseen, UnseenPattern, UnseenPiece, Worst,
};
pub use setup::{Setup, ToolAxis};
#[cfg(feature = "cli")]
pub(crate) use verify::verify_written;
pub use verify::{Departure, Verification, VerifyOptions, verify, verify_text};

use crate::calibration::CalibratedMachine;
use crate::error::{Error, Result};
use crate::machine::Machine;
use crate::meter::Meter;
pub use crate::nc::Dialect;
use crate::nc::{Program, State};
use batches::{How, Make, ends_batch};
use calibrated::{is_constant, model_of};
use corrector::Solvers;
use gaps::{Gaps, is_gap};
use interpreter::Interpreter;
use mark::{Mark, Origin};
use output::put;
use part::Part;
use passage::{Passage, Survey, read_as};
use scout::Scout;
use writer::Writer;

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
    options: &CompensateOptions,
    out: &mut dyn Write,
) -> Result<Report> {
    compensate_counted(calibrated, path.as_ref(), setup, options, out, &Meter::default())
}

/// As [`compensate`]; the bytes that each pass reads of the program are counted.
pub(crate) fn compensate_counted(
    calibrated: &CalibratedMachine,
    path: &Path,
    setup: &Setup,
    options: &CompensateOptions,
    out: &mut dyn Write,
    meter: &Meter,
) -> Result<Report> {
    let open = || {
        let file = File::open(path).map_err(|e| Error::file(path, e))?;
        meter.begin(file.metadata().ok().filter(std::fs::Metadata::is_file).map(|known| known.len()));
        Program::new(path, BufReader::new(meter.counting(file)))
    };
    let (mut model, make) = (model_of(calibrated), || model_of(calibrated));
    let models = Models { own: &mut *model, more: more(calibrated, &make) };
    run(calibrated.machine(), models, Some(Origin::of(calibrated)), &open, setup, options, out)
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
    options: &CompensateOptions,
) -> Result<(String, Report)> {
    let (mut model, make) = (model_of(calibrated), || model_of(calibrated));
    let models = Models { own: &mut *model, more: more(calibrated, &make) };
    let (machine, origin) = (calibrated.machine(), Some(Origin::of(calibrated)));
    let (bytes, report) = run_on_text(machine, models, origin, file.as_ref(), text.as_ref(), setup, options)?;
    Ok((String::from_utf8_lossy(&bytes).into_owned(), report))
}

/// As [`compensate_text`], for any model of a machine's errors; what is written bears no mark.
///
/// # Errors
/// As [`compensate`].
pub fn compensate_with(
    machine: &Machine,
    model: &mut dyn Model,
    file: impl AsRef<Path>,
    text: &[u8],
    setup: &Setup,
    options: &CompensateOptions,
) -> Result<(Vec<u8>, Report)> {
    run_on_text(machine, Models { own: model, more: None }, None, file.as_ref(), text, setup, options)
}

/// A model of a machine's errors, and where these have no history what makes more of it for other threads.
struct Models<'f, 'm> {
    own: &'f mut dyn Model,
    more: Option<Make<'f, 'm>>,
}

fn more<'f, 'm>(calibrated: &CalibratedMachine, make: Make<'f, 'm>) -> Option<Make<'f, 'm>> {
    is_constant(calibrated).then_some(make)
}

fn run_on_text(
    machine: &Machine,
    models: Models<'_, '_>,
    origin: Option<Origin>,
    file: &Path,
    text: &[u8],
    setup: &Setup,
    options: &CompensateOptions,
) -> Result<(Vec<u8>, Report)> {
    let mut out = Vec::with_capacity(text.len() + text.len() / 4);
    let open = || Program::new(file, text);
    let report = run(machine, models, origin, &open, setup, options, &mut out)?;
    Ok((out, report))
}

/// One pass over the program behind a look for sub-programs; one more before it where directions of travel count, as far as the first
/// motion of each axis, and one where there are sub-programs, for what their lines need.
fn run<R: BufRead + Send>(
    machine: &Machine,
    models: Models<'_, '_>,
    origin: Option<Origin>,
    open: &dyn Fn() -> Result<Program<R>>,
    setup: &Setup,
    options: &CompensateOptions,
    out: &mut dyn Write,
) -> Result<Report> {
    let open = || {
        let mut program = open()?;
        read_as(&mut program, options.dialect, options.integer_unit);
        Ok::<_, Error>(program)
    };
    if models.own.is_nominal() {
        return copy(machine, &mut open()?, out);
    }
    match correct(machine, models, origin, &open, setup, options, out) {
        Err(error) if error.fault().is_some_and(is_gap) => {
            let all = gaps(machine, &open, setup)?.together();
            Err(match (error.place(), all) {
                (Some(place), Some(all)) => Error::input(place.clone(), all),
                _ => error,
            })
        }
        other => other,
    }
}

/// The passes of [`run`] over a program that needs any.
fn correct<R: BufRead + Send>(
    machine: &Machine,
    Models { own: model, more }: Models<'_, '_>,
    origin: Option<Origin>,
    open: &dyn Fn() -> Result<Program<R>>,
    setup: &Setup,
    options: &CompensateOptions,
    out: &mut dyn Write,
) -> Result<Report> {
    let program = open()?;
    let dialect = program.dialect();
    let Survey { mut calls, fingerprint, foot, .. } = {
        let survey = Survey::of(program)?;
        if !options.force {
            survey.refuse_marked(origin)?;
        }
        survey
    };
    let start = Interpreter::new(machine, setup, dialect);
    let mut first = vec![0; machine.commands().len()];
    if !model.keyed().is_empty() {
        let mut scout = Scout::new(start.clone(), model);
        let mut passage = Passage::new(open()?, &mut calls);
        // What is wrong with the program is told when it is corrected.
        while !scout.has_found() && passage.step(&mut scout, &mut std::io::sink()).unwrap_or(false) {}
        first = scout.finish();
    }
    let solvers = Solvers::new(machine, options.mode);
    if !calls.is_empty() {
        calls.collect(true);
        let mut writer = Writer::new(start.clone(), model, &solvers, options, &first);
        Passage::new(open()?, &mut calls).finish(&mut writer)?;
        calls.collect(false);
    }
    let mark = origin.filter(|_| options.marked).map(|origin| Mark { program: fingerprint, origin });
    let sign = |has_corrected: bool, out: &mut dyn Write| match mark.filter(|_| has_corrected) {
        Some(mark) => foot.write(&mark, dialect, out).map_err(|e| Error::file("output", e)),
        None => Ok(()),
    };
    let mut writer = Writer::new(start, model, &solvers, options, &first);
    let (blocks, without_point) = match more {
        Some(make) if calls.is_empty() => {
            let how = How { make, solvers: &solvers, options };
            let start = writer.stop().1;
            let sign = &mut |part: &Part, out: &mut dyn Write| sign(part.report.has_corrected(), out);
            let all = batches::correct(open()?, start, how, &foot, out, sign)?;
            writer = Writer::behind(all.end, model, &solvers, options);
            writer.absorb(all.part);
            (all.lines, all.without_point)
        }
        _ => {
            let mut passage = Passage::new(open()?, &mut calls);
            loop {
                if ends_batch(passage.passed(), &foot) {
                    writer.end_batch()?;
                }
                if foot.is_before(passage.passed() + 1) {
                    sign(writer.has_corrected(), out)?;
                }
                if !passage.step(&mut writer, out)? {
                    break;
                }
            }
            (passage.passed(), passage.without_point())
        }
    };
    if foot.is_last() {
        sign(writer.has_corrected(), out)?;
    }
    let mut report = writer.finish()?;
    report.blocks = blocks as u64;
    if dialect == Dialect::Rs274 && options.integer_unit.is_none() {
        report.numbers_without_point = without_point;
    }
    Ok(report)
}

/// All that the program needs of the set-up and the set-up does not say.
fn gaps<'a, R: BufRead>(
    machine: &'a Machine,
    open: &dyn Fn() -> Result<Program<R>>,
    setup: &'a Setup,
) -> Result<Gaps<'a>> {
    let program = open()?;
    let mut gaps = Gaps::new(Interpreter::new(machine, setup, program.dialect()));
    let mut calls = Survey::of(program)?.calls;
    Passage::new(open()?, &mut calls).finish(&mut gaps)?;
    Ok(gaps)
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

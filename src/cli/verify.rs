//! `kincal verify`

use std::fmt::Write;
use std::path::PathBuf;

use crate::calibration::CalibratedMachine;
use crate::compensate::{Setup, Verification, VerifyOptions, verify};

use super::Common;
use super::output::{Failure, Outcome, angle, count, length, open_machine};
use super::program::{DialectWord, IntegerWord, at, departures, dialect_of, integer_unit_of, tolerance};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// NC program as it was
    #[arg(value_name = "PROGRAM.nc")]
    program: PathBuf,
    /// NC program that was written for it
    #[arg(value_name = "COMPENSATED.nc")]
    compensated: PathBuf,
    /// Calibrated machine
    #[arg(value_name = "CALIBRATED.ron")]
    machine: PathBuf,
    /// How far the tip may be off at the end of a move
    #[arg(long, value_name = "LENGTH", value_parser = tolerance, default_value = "0.002mm")]
    tolerance: f64,
    /// How far the tip may be off the path between the ends of moves; without this it is told and not judged
    #[arg(long, value_name = "LENGTH", value_parser = tolerance)]
    between: Option<f64>,
    /// Distance of the places at which a move is looked at
    #[arg(long, value_name = "LENGTH", value_parser = tolerance, default_value = "1mm")]
    chord: f64,
    /// Tools and work offsets, docs/compensate.md
    #[arg(long, value_name = "SETUP.ron")]
    setup: Option<PathBuf>,
    /// M codes of the machine's builder and the axes that they move, {"M170": [], "M60": ["Z"]}
    #[arg(long, value_name = "FILE")]
    m_codes: Option<PathBuf>,
    /// The control, where the program's first lines do not say it
    #[arg(long, value_enum)]
    dialect: Option<DialectWord>,
    /// What axis numbers without a point count in RS-274 programs
    #[arg(long, value_enum)]
    integer_unit: Option<IntegerWord>,
    /// Compare even where the mark of the compensated program says that it was written from something else
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let calibrated = open_machine(&args.machine, |path| CalibratedMachine::open(path))?;
    let mut setup = args.setup.as_ref().map_or(Ok(Setup::default()), Setup::open)?;
    if let Some(codes) = &args.m_codes {
        setup = setup.with_m_codes(codes)?;
    }
    let options = VerifyOptions {
        tolerance: args.tolerance,
        between: args.between,
        chord: args.chord,
        dialect: args.dialect.map(dialect_of),
        integer_unit: args.integer_unit.map(integer_unit_of),
        force: args.force,
    };
    let progress = args.common.progress();
    progress.say(&format!("reading {}", args.compensated.display()));
    let found = verify(&calibrated, &args.program, &args.compensated, &setup, &options)?;
    drop(progress);
    args.common.say(&render(&found))?;
    args.common.write_json(&found)?;
    if found.holds() {
        return Ok(());
    }
    let moves = count(found.departures.count, "move", "moves");
    Err(Failure::Answer(format!(
        "{}: {moves} not where {} means it",
        args.compensated.display(),
        args.program.display()
    )))
}

/// What was found, as people read it.
fn render(found: &Verification) -> String {
    let mut text = format!("{}, {} judged\n", count(found.moves, "move", "moves"), found.judged);
    let _ = writeln!(
        text,
        "largest error at the end of a move: tip {}, tool axis {}",
        at(found.largest_end_m, length),
        at(found.largest_axis_rad, angle)
    );
    let _ = writeln!(text, "largest error beside the meant path: {}", at(found.largest_between_m, length));
    text + &departures(found)
}

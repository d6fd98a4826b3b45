//! The command line of kincal. No mathematics here: every command is one library call.

mod calibrate;
mod check;
mod compare;
mod compensate;
mod completions;
mod convert;
mod demo;
mod describe;
mod diagnose;
mod examples;
mod export;
pub mod face;
mod failure;
mod files;
mod help;
mod import;
mod join;
mod keep;
mod location;
mod machines;
mod man;
mod merge;
mod new;
mod normal;
mod output;
mod part;
mod predict;
mod program;
mod progress;
mod report;
mod simulate;
mod streams;
mod table;
mod verdict;
mod verify;
mod width;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use failure::Outcome;
use files::{Destination, Files};
use output::{complain, printed};
use streams::StandardInput;

/// Calibrates the geometry of any serial or bifurcated machine.
#[derive(Parser)]
#[command(version, about, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Topology, model equation, parameters, and what each instrument can identify
    Describe(describe::Args),
    /// Every Jacobian of this machine against forward-mode autodiff
    Check(check::Args),
    /// Identifies the deviations of a machine from recordings
    Calibrate(calibrate::Args),
    /// Partial normal equations: what recordings add to a calibration, without the recordings
    Normal(normal::Args),
    /// The calibrated machine from partial normal equations, or the round that is still needed
    Merge(merge::Args),
    /// Other ways to identify, fitted to the same recordings and judged side by side
    Compare(compare::Args),
    /// What a calibrated machine says the instrument would read, sample by sample
    Predict(predict::Args),
    /// A recording with the columns of another one of the same moments beside its own
    Join(join::Args),
    /// Locates what a model leaves over, names the physics left out, and models it
    Diagnose(diagnose::Args),
    /// The NC program with corrected axis words, everything else as it was
    Compensate(compensate::Args),
    /// Prove that a compensated program brings the tool of the calibrated machine where the original means it
    Verify(verify::Args),
    /// Recordings of a machine whose errors are known: standard tests, random poses, NC programs
    Simulate(Box<simulate::Args>),
    /// A new machine file with comments: a copy of one that comes with the program, a list of joints, or answers to questions
    New(new::Args),
    /// A machine file from URDF, MJCF, a DH table or a configuration of LinuxCNC
    Import(import::Args),
    /// A recording from a table of another program: other names, units, separators, forms of rotations
    Convert(Box<convert::Args>),
    /// A calibrated machine as ISO 230-1 table, URDF, MJCF, DH table, parameters of a control or compensation table
    Export(export::Args),
    /// The machines that come with the program, or the file of one of them
    Machines(machines::Args),
    /// What lets a shell complete commands, options and files
    Completions(completions::Args),
    /// The manual page of the program, or of one command
    Man(man::Args),
    /// The reference machine, a simulated ballbar recording, and its calibration; needs no input
    Demo(demo::Args),
}

/// What is common to all commands.
#[derive(clap::Args, Clone)]
pub(crate) struct Common {
    /// Machine-readable result, into a file or `-` for standard output
    #[arg(long, value_name = "FILE|-")]
    json: Option<Destination>,
    /// Nothing on standard output but what was asked for
    #[arg(long)]
    quiet: bool,
}

/// All commands with their arguments and examples.
fn command() -> clap::Command {
    examples::shown(Cli::command())
}

/// Runs the command line: 0 done, 1 input at fault, 2 usage.
pub fn run() -> ExitCode {
    ExitCode::from(run_with(std::env::args_os()))
}

/// The same with these arguments, the name of the program first.
fn run_with(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let input = StandardInput::new();
    let mut known = help::laid_out(input.understood(command()));
    let matches = known.try_get_matches_from_mut(arguments);
    let parsed = matches.and_then(|matches| {
        let cli = Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut known))?;
        let named = matches.subcommand().and_then(|(name, own)| Some((known.find_subcommand(name)?, own)));
        Ok((cli.command, named.map_or_else(Files::default, |(command, own)| Files::of(command, own))))
    });
    let (status, outcome) = match parsed {
        // Help and version are such errors too, with status 0.
        Err(error) => (error.exit_code().try_into().unwrap_or(2), printed(help::fitted(error).print())),
        Ok((command, files)) => {
            part::tidy_when_interrupted();
            let run = || {
                files.check()?;
                let _until_the_end = input.read()?;
                execute(&command, &files)
            };
            (0, run())
        }
    };
    match outcome {
        Ok(()) => status,
        Err(failure) => {
            complain(&failure, &input.path());
            1
        }
    }
}

fn execute(command: &Command, files: &Files) -> Outcome {
    match command {
        Command::Describe(args) => describe::run(args),
        Command::Check(args) => check::run(args),
        Command::Calibrate(args) => calibrate::run(args),
        Command::Normal(args) => normal::run(args),
        Command::Merge(args) => merge::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Predict(args) => predict::run(args),
        Command::Join(args) => join::run(args),
        Command::Diagnose(args) => diagnose::run(args),
        Command::Compensate(args) => compensate::run(args),
        Command::Verify(args) => verify::run(args),
        Command::Simulate(args) => simulate::run(args, files),
        Command::New(args) => new::run(args),
        Command::Import(args) => import::run(args, files),
        Command::Convert(args) => convert::run(args, files),
        Command::Export(args) => export::run(args),
        Command::Machines(args) => machines::run(args),
        Command::Completions(args) => completions::run(args, self::command()),
        Command::Man(args) => man::run(args, self::command()),
        Command::Demo(args) => demo::run(args),
    }
}

//! What another face of the crate, such as the module for Python, shares with the command line: the commands themselves, and results with
//! the refusals, the verdict and the fields that a command's `--json` has. No promise of any version.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::failure::Failure;
use super::output::{open_machine, open_recordings};
use super::report;
use super::{calibrate, diagnose};
use crate::calibration::CalibratedMachine;
use crate::circular::circular_tests;
use crate::diagnose::DiagnoseOptions;
use crate::effects::Library;
use crate::error::Error;
use crate::identify::{CalibrateOptions, ErrorModel, declared};
use crate::machine::Machine;
use crate::recording::Recording;

/// Why there is no result.
#[derive(Debug)]
pub enum Refusal {
    /// The library's error.
    Error(Error),
    /// Inputs are sound each by itself and do not belong together.
    Refused {
        /// What is wrong.
        what: String,
        /// How to mend it.
        mend: String,
    },
}

impl From<Failure> for Refusal {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Input(error) => Refusal::Error(error),
            Failure::Answer(what) => Refusal::Refused { what, mend: String::new() },
            Failure::Told { what, mend } => Refusal::Refused { what, mend },
        }
    }
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Refusal::Error(error)
    }
}

/// Runs the command line with these arguments, the name of the program first: 0 done, 1 input at fault, 2 usage.
pub fn run_with(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    super::run_with(arguments)
}

/// A machine file, calibrated or not.
///
/// # Errors
/// As [`CalibratedMachine::open`]; a recording in its place is told as such.
pub fn machine(path: &Path) -> Result<CalibratedMachine, Refusal> {
    Ok(open_machine(path, |path| CalibratedMachine::open(path))?)
}

/// The recordings of one call; `machine_file` is where messages say that the machine is.
///
/// # Errors
/// As [`open_all`](crate::recording::open_all); a table of another program is told the command that makes a recording of it.
pub fn recordings(
    paths: &[PathBuf],
    machine: &Machine,
    machine_file: &Path,
) -> Result<Vec<Recording>, Refusal> {
    Ok(open_recordings(paths, machine, machine_file)?)
}

/// As JSON, SI throughout.
fn json(told: &impl Serialize) -> String {
    // What cannot be written would be a map whose keys are no text; there is none.
    serde_json::to_string(told).unwrap_or_default()
}

/// What `kincal calibrate` writes: the calibrated machine, and the text of `--json`.
///
/// # Errors
/// As [`calibrate_model`](crate::identify::calibrate_model), and a result that is nonsense, unless `force` says that it is wanted.
pub fn calibrated(
    machine: &Machine,
    recordings: &[Recording],
    model: &ErrorModel,
    options: CalibrateOptions,
    force: bool,
) -> Result<(CalibratedMachine, String), Refusal> {
    let (calibrated, fit, _) = calibrate::judged(machine, recordings, (model, options), force, &|_| ())?;
    let circular = circular_tests(&calibrated, recordings)?;
    let told = json(&calibrate::Told { verdict: report::of_fit(&fit), fit: &fit, circular_tests: &circular });
    Ok((calibrated, told))
}

/// What `kincal diagnose` writes with `-o`: the machine with what was found, and the text of `--json`.
///
/// # Errors
/// As [`diagnose`](crate::diagnose::diagnose()), and recordings that are nonsense, unless `force` says that they are wanted.
pub fn diagnosed(
    machine: &Machine,
    recordings: &[Recording],
    library: &Library,
    force: bool,
) -> Result<(CalibratedMachine, String), Refusal> {
    let request = DiagnoseOptions::default();
    let (diagnosis, model, _) =
        diagnose::judged(machine, recordings, library, &request, (true, force), &|_| ())?;
    let model = match model {
        Some(model) => model,
        None => declared(machine, recordings)?,
    };
    let circular = circular_tests(&model, recordings)?;
    let verdict = report::of_diagnosis(&diagnosis);
    let told = json(&diagnose::Told { verdict, diagnosis: &diagnosis, circular_tests: &circular });
    Ok((model, told))
}

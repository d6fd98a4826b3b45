//! The command line, as the program `kincal` has it.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the command line with these arguments, the name of the program first, and returns its status.
#[pyfunction]
pub fn run_command_line(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| kincal::face::run_with(arguments))
}

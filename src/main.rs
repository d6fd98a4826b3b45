//! The program: all that it does is in the library's room `cli`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    kincal::run_command_line()
}

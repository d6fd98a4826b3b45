//! kincal for Python: NumPy arrays in, dictionaries out, SI throughout. What each function does is told in `package/kincal/_native.pyi`.
// pyo3's macros allow themselves the unsafe code that they write; nothing of ours does, which `forbid` could not tell apart.
#![deny(unsafe_code)]

mod calibrate;
mod commands;
mod failure;
mod inverse;
mod machine;
mod recording;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::calibrate::{calibrate, diagnose, predict};
    #[pymodule_export]
    use super::commands::run_command_line;
    #[pymodule_export]
    use super::failure::Error;
    #[pymodule_export]
    use super::inverse::inverse;
    #[pymodule_export]
    use super::machine::{Machine, load_machine, parse_machine};
    #[pymodule_export]
    use super::recording::Recording;
}

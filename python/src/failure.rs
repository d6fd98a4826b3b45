//! What is wrong, as an exception that carries what the command line prints: where, what, and the mend.

use kincal::face::Refusal;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

pyo3::create_exception!(
    kincal,
    Error,
    PyException,
    "What is wrong with an input, where, and how to mend it."
);

/// An exception with the text of the command line. `place` is a file with a line and a column, 0 where there is none.
fn exception(py: Python<'_>, what: &str, mend: &str, place: Option<&kincal::Place>) -> PyErr {
    let text = if mend.is_empty() { what.to_string() } else { format!("{what}\n  = {mend}") };
    let error = Error::new_err(text);
    let value = error.value(py);
    let set = || -> PyResult<()> {
        value.setattr("what", what)?;
        value.setattr("mend", mend)?;
        value.setattr("file", place.map(|place| place.file.display().to_string()))?;
        value.setattr("line", place.map_or(0, |place| place.line))?;
        value.setattr("column", place.map_or(0, |place| place.column))
    };
    match set() {
        Ok(()) => error,
        Err(other) => other,
    }
}

/// Words alone.
pub fn told(py: Python<'_>, what: impl AsRef<str>, mend: impl AsRef<str>) -> PyErr {
    exception(py, what.as_ref(), mend.as_ref(), None)
}

/// The library's error.
pub fn of_error(py: Python<'_>, error: &kincal::Error) -> PyErr {
    exception(py, &error.to_string(), &error.mend(), error.place())
}

/// Why there is no result.
pub fn of_refusal(py: Python<'_>, refusal: &Refusal) -> PyErr {
    match refusal {
        Refusal::Error(error) => of_error(py, error),
        // The flag of the command line is an argument here.
        Refusal::Refused { what, mend } => told(py, what, mend.replace("--force", "force=True")),
    }
}

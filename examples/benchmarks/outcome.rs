//! Why a section could not be measured.

use std::fmt;

use kincal::machine::MachineFault;

/// What went wrong.
#[derive(Debug)]
pub enum Failure {
    /// Recordings that are not there; other sections can still be measured.
    Missing(String),
    /// Anything else.
    Broken(String),
}

/// A result.
pub type Outcome<T> = Result<T, Failure>;

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::Missing(what) | Failure::Broken(what) => f.write_str(what),
        }
    }
}

impl From<kincal::Error> for Failure {
    fn from(error: kincal::Error) -> Self {
        Failure::Broken(error.to_string())
    }
}

impl From<(String, MachineFault)> for Failure {
    fn from((place, fault): (String, MachineFault)) -> Self {
        Failure::Broken(format!("{place}: {fault}"))
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Failure::Broken(error.to_string())
    }
}

/// A figure that the library leaves out where a recording has no readings of its kind.
pub fn given<T>(figure: Option<T>, what: &str) -> Outcome<T> {
    figure.ok_or_else(|| Failure::Broken(format!("no {what}")))
}

//! Why a command ends with status 1.

use std::path::Path;

use crate::error::Error;

/// Why a command ended with status 1.
pub(crate) enum Failure {
    /// The library's error.
    Input(Error),
    /// The command did its work, and the answer is no.
    Answer(String),
    /// What the command line itself found wrong, and the mend.
    Told { what: String, mend: String },
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Failure::Input(error)
    }
}

/// Result of a command.
pub(crate) type Outcome<T = ()> = Result<T, Failure>;

/// A file that cannot be written, and why.
pub(super) fn not_written(path: &Path, source: &std::io::Error) -> Failure {
    let folder = folder_of(path);
    let mend = if !folder.exists() {
        format!("create the folder {} first, or write elsewhere", folder.display())
    } else if !folder.is_dir() {
        format!("{} is no folder; write elsewhere", folder.display())
    } else if path.is_dir() {
        "name a file, not a folder".into()
    } else {
        "write where there is space and leave to write".into()
    };
    Failure::Told { what: format!("{}: cannot be written: {source}", path.display()), mend }
}

pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

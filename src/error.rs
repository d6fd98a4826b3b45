//! What can go wrong, where, and how to mend it.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::compensate::CompensateFault;
use crate::effects::LibraryFault;
use crate::machine::MachineFault;
use crate::nc::NcFault;
use crate::recording::RecordingFault;

/// `Result` with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A place in a text that a user wrote: lines and columns count from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file as the user named it.
    pub file: PathBuf,
    /// Line, from 1; 0 where the whole file is meant.
    pub line: usize,
    /// Column in characters (in a recording: the number of the CSV column), from 1; 0 where the whole line is meant.
    pub column: usize,
}

impl Place {
    /// The whole file.
    pub fn file(file: impl AsRef<Path>) -> Self {
        Place { file: file.as_ref().to_path_buf(), line: 0, column: 0 }
    }

    /// A line of the file, column 0 where the whole line is meant.
    pub fn at(file: impl AsRef<Path>, line: usize, column: usize) -> Self {
        Place { file: file.as_ref().to_path_buf(), line, column }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if self.line > 0 {
            write!(f, ":{}", self.line)?;
            if self.column > 0 {
                write!(f, ":{}", self.column)?;
            }
        }
        Ok(())
    }
}

/// Every failure of this crate. The text says where and what; [`Error::mend`] says how to mend it.
#[non_exhaustive]
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A machine file that cannot stand.
    #[error("{place}: {fault}")]
    Machine {
        /// Where in the file.
        place: Place,
        /// What is wrong.
        fault: MachineFault,
    },
    /// A recording that cannot be used.
    #[error("{place}: {fault}")]
    Recording {
        /// Where in the file.
        place: Place,
        /// What is wrong.
        fault: Box<RecordingFault>,
    },
    /// An NC program that cannot be read or rewritten.
    #[error("{place}: {fault}")]
    Nc {
        /// Where in the program.
        place: Place,
        /// What is wrong.
        fault: Box<NcFault>,
    },
    /// A library of effects that cannot stand.
    #[error("{place}: {fault}")]
    Effects {
        /// Where in the file.
        place: Place,
        /// What is wrong.
        fault: LibraryFault,
    },
    /// An NC program that cannot be corrected as it stands.
    #[error("{place}: {fault}")]
    Compensate {
        /// Where in the program.
        place: Place,
        /// Why not.
        fault: Box<CompensateFault>,
    },
    /// A text in RON that cannot be read at all.
    #[error("{place}: {message}")]
    Ron {
        /// Where the reader stopped.
        place: Place,
        /// What it expected.
        message: String,
        /// How to mend it.
        mend: String,
    },
    /// A file that cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file as the user named it.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Recordings and machine are sound, but do not determine what was asked for.
    #[error("{what}")]
    Undetermined {
        /// What could not be found.
        what: String,
        /// What would help.
        mend: String,
    },
    /// Faults, an NC program or a table of commands that a simulation cannot use.
    #[error("{place}: {message}")]
    Simulation {
        /// Where in the file.
        place: Place,
        /// What is wrong.
        message: String,
        /// How to mend it.
        mend: String,
    },
    /// A motion that the machine cannot make.
    #[error("{what}")]
    Motion {
        /// Which, and where it fails.
        what: String,
        /// What would help.
        mend: String,
    },
}

impl Error {
    /// How to mend it, in one sentence; empty where there is nothing to add.
    pub fn mend(&self) -> String {
        match self {
            Error::Machine { fault, .. } => fault.mend(),
            Error::Recording { fault, .. } => fault.mend(),
            Error::Nc { fault, .. } => fault.mend(),
            Error::Effects { fault, .. } => fault.mend.clone(),
            Error::Compensate { fault, .. } => fault.mend(),
            Error::Ron { mend, .. }
            | Error::Simulation { mend, .. }
            | Error::Undetermined { mend, .. }
            | Error::Motion { mend, .. } => mend.clone(),
            Error::File { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                "check the path; nothing is there".into()
            }
            Error::File { .. } => String::new(),
        }
    }

    /// Where in a user's file, if it is about one.
    pub fn place(&self) -> Option<&Place> {
        match self {
            Error::Machine { place, .. }
            | Error::Recording { place, .. }
            | Error::Nc { place, .. }
            | Error::Effects { place, .. }
            | Error::Compensate { place, .. }
            | Error::Ron { place, .. }
            | Error::Simulation { place, .. } => Some(place),
            Error::File { .. } | Error::Undetermined { .. } | Error::Motion { .. } => None,
        }
    }

    pub(crate) fn file(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Error::File { path: path.as_ref().to_path_buf(), source }
    }
}

//! What can go wrong, where, and how to mend it.

use std::fmt;
use std::path::{Path, PathBuf};

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

/// What is wrong with something that a user wrote. Every room that reads brings its own faults; [`Error::fault`] finds them again.
pub trait Fault: std::error::Error + Send + Sync + 'static {
    /// How to mend it, in one sentence; empty where there is nothing to add.
    fn mend(&self) -> String;
}

/// A fault that is told in words alone.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub struct Mistake {
    /// What is wrong.
    pub what: String,
    /// How to mend it.
    pub mend: String,
}

impl Fault for Mistake {
    fn mend(&self) -> String {
        self.mend.clone()
    }
}

/// Every failure of this crate. The text says where and what; [`Error::mend`] says how to mend it.
#[non_exhaustive]
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Something that a user wrote and that cannot stand: a machine, a recording, an NC program, a library of effects.
    #[error("{place}: {fault}")]
    Input {
        /// Where in the file.
        place: Place,
        /// What is wrong.
        fault: Box<dyn Fault>,
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
            Error::Input { fault, .. } => fault.mend(),
            Error::Undetermined { mend, .. } | Error::Motion { mend, .. } => mend.clone(),
            Error::File { source, .. } => match source.kind() {
                std::io::ErrorKind::NotFound => "check the path; nothing is there".into(),
                std::io::ErrorKind::IsADirectory => "name a file, not a folder".into(),
                std::io::ErrorKind::PermissionDenied => "check who may read and write it".into(),
                _ => String::new(),
            },
        }
    }

    /// Where in a user's file, if it is about one.
    pub fn place(&self) -> Option<&Place> {
        match self {
            Error::Input { place, .. } => Some(place),
            Error::File { .. } | Error::Undetermined { .. } | Error::Motion { .. } => None,
        }
    }

    /// What is wrong with an input, where it is a fault of this kind.
    ///
    /// ```
    /// use kincal::machine::{Machine, MachineFault};
    ///
    /// let error = Machine::parse("empty.ron", r#"Machine(
    ///     name: "empty", units: (length: mm, angle: deg), workpiece: [], tool: [(frame: "t")],
    /// )"#).unwrap_err();
    /// assert!(matches!(error.fault(), Some(MachineFault::EmptyBranch { .. })));
    /// ```
    pub fn fault<F: Fault>(&self) -> Option<&F> {
        match self {
            Error::Input { fault, .. } => (&**fault as &dyn std::error::Error).downcast_ref(),
            _ => None,
        }
    }

    /// Something at fault at a place.
    pub(crate) fn input(place: Place, fault: impl Fault) -> Self {
        Error::Input { place, fault: Box::new(fault) }
    }

    /// The same, told in words alone.
    pub(crate) fn mistake(place: Place, what: impl Into<String>, mend: impl Into<String>) -> Self {
        Error::input(place, Mistake { what: what.into(), mend: mend.into() })
    }

    /// What a reader of bytes has to say of them beyond what the system says passes as it is.
    pub(crate) fn file(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        let path = path.as_ref().to_path_buf();
        source.downcast::<Error>().unwrap_or_else(|source| Error::File { path, source })
    }
}

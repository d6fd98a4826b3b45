//! The files of a call: what its arguments read and write, and that no output takes the place of an input or of another output.
//!
//! The type of an argument says what it is: an [`Output`] or a [`Destination`] is written, a `PathBuf` is read. So one check sees all
//! commands, and a new argument is in it from the start.

use std::any::Any;
use std::ffi::OsString;
use std::ops::Deref;
use std::path::{Path, PathBuf};

use clap::{Arg, ArgMatches, Command};

use super::failure::{Failure, Outcome, folder_of, not_written};

/// What stands for standard input or standard output in the place of a file.
pub(super) const DASH: &str = "-";

pub(super) fn is_standard(path: &Path) -> bool {
    path.as_os_str() == DASH
}

/// An argument that names a file to be written.
#[derive(Clone, Debug)]
pub(crate) struct Output(PathBuf);

impl From<OsString> for Output {
    fn from(text: OsString) -> Self {
        Output(text.into())
    }
}

impl Deref for Output {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

/// An argument `FILE|-`: a file to be written, or standard output.
#[derive(Clone, Debug)]
pub(crate) enum Destination {
    StandardOutput,
    File(Output),
}

impl From<OsString> for Destination {
    fn from(text: OsString) -> Self {
        if text == DASH { Destination::StandardOutput } else { Destination::File(text.into()) }
    }
}

/// A path with the argument that names it, as it is written: `--output`, `REC.csv`.
#[derive(Clone, Debug)]
struct Named {
    argument: String,
    path: PathBuf,
}

/// What a call reads and writes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Files {
    inputs: Vec<Named>,
    outputs: Vec<Named>,
}

impl Files {
    /// The files of a subcommand's arguments, defaults included.
    pub fn of(command: &Command, matches: &ArgMatches) -> Files {
        let mut files = Files::default();
        for arg in command.get_arguments() {
            let of = |path: PathBuf| Named { argument: written(arg), path };
            files.inputs.extend(values::<PathBuf>(matches, arg).cloned().map(of));
            files.outputs.extend(values::<Output>(matches, arg).map(|output| of(output.0.clone())));
            let files_of = values::<Destination>(matches, arg).map(|destination| match destination {
                Destination::StandardOutput => of(DASH.into()),
                Destination::File(output) => of(output.0.clone()),
            });
            files.outputs.extend(files_of);
        }
        files
    }

    /// The same where an argument stands for files whose names come from its own.
    pub fn with_outputs(&self, argument: &str, paths: &[PathBuf]) -> Files {
        let mut files = self.clone();
        files.outputs.retain(|output| output.argument != argument);
        files
            .outputs
            .extend(paths.iter().map(|path| Named { argument: argument.into(), path: path.clone() }));
        files
    }

    /// The same where files that an argument reads name others, which are read too.
    pub fn with_inputs(&self, argument: &str, paths: &[PathBuf]) -> Files {
        let mut files = self.clone();
        files.inputs.extend(paths.iter().map(|path| Named { argument: argument.into(), path: path.clone() }));
        files
    }

    /// Refuses outputs that cannot be written, and those that would overwrite an input or each other, before any work is done.
    pub fn check(&self) -> Outcome {
        for (i, output) in self.outputs.iter().enumerate() {
            if let Some(input) = self.inputs.iter().find(|input| output.is(input)) {
                return Err(Failure::Told {
                    what: format!(
                        "{}: {} would overwrite {}, which the call reads{}",
                        output.path.display(),
                        output.argument,
                        input.argument,
                        input.as_spelled(output)
                    ),
                    mend: format!("give {} another name; inputs are never overwritten", output.argument),
                });
            }
            if let Some(other) = self.outputs[..i].iter().find(|other| output.is(other)) {
                return Err(Failure::Told {
                    what: format!(
                        "{}: two outputs have this name, {} and {}{}",
                        output.path.display(),
                        other.argument,
                        output.argument,
                        other.as_spelled(output)
                    ),
                    mend: format!("give {} a name of its own", output.argument),
                });
            }
            output.can_be_written()?;
        }
        Ok(())
    }
}

impl Named {
    /// Whether both are one file.
    fn is(&self, other: &Named) -> bool {
        matches!((identity(&self.path), identity(&other.path)), (Some(a), Some(b)) if a == b)
    }

    /// How this path is spelled, where the other is spelled otherwise.
    fn as_spelled(&self, other: &Named) -> String {
        if self.path == other.path { String::new() } else { format!(" (as {})", self.path.display()) }
    }

    fn can_be_written(&self) -> Outcome {
        if is_standard(&self.path) {
            return Ok(());
        }
        if self.path.is_dir() {
            return Err(not_written(&self.path, &std::io::ErrorKind::IsADirectory.into()));
        }
        match std::fs::metadata(folder_of(&self.path)) {
            Ok(folder) if !folder.is_dir() => {
                Err(not_written(&self.path, &std::io::ErrorKind::NotADirectory.into()))
            }
            Ok(_) => Ok(()),
            Err(source) => Err(not_written(&self.path, &source)),
        }
    }
}

/// The path without links, `.` and `..` of the file that is there or will be. Nothing where it is no file: several may write to a pipe or to
/// `/dev/null`, and nothing there is lost.
fn identity(path: &Path) -> Option<PathBuf> {
    if is_standard(path) {
        return Some(path.into());
    }
    match std::fs::metadata(path) {
        Ok(known) if !known.is_file() => None,
        Ok(_) => path.canonicalize().ok(),
        // A link to nothing is replaced itself.
        Err(_) => Some(folder_of(path).canonicalize().ok()?.join(path.file_name()?)),
    }
}

/// Values of an argument, if they are of this type.
fn values<'a, T: Any + Clone + Send + Sync>(
    matches: &'a ArgMatches,
    arg: &Arg,
) -> impl Iterator<Item = &'a T> {
    matches.try_get_many::<T>(arg.get_id().as_str()).ok().flatten().into_iter().flatten()
}

/// An argument as people write it.
fn written(arg: &Arg) -> String {
    match (arg.get_long(), arg.get_value_names()) {
        (Some(long), _) => format!("--{long}"),
        (None, Some([name, ..])) => name.to_string(),
        (None, _) => arg.get_id().to_string(),
    }
}

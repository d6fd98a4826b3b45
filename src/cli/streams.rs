//! `-`: standard input in the place of a file that is read, standard output in the place of one that is written.
//!
//! Files are read more than once, which a pipe cannot be: what comes from it stands in a file of its own for as long as the call lasts.

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Command;
use clap::builder::{PathBufValueParser, TypedValueParser, ValueParser};

use super::failure::{Outcome, not_written};
use super::files::{DASH, Output, is_standard};
use super::part::Part;

/// Standard input of one call.
#[derive(Clone)]
pub(super) struct StandardInput {
    folder: PathBuf,
    is_named: Arc<AtomicBool>,
}

impl StandardInput {
    pub fn new() -> StandardInput {
        let folder = std::env::temp_dir().join(format!("kincal-{}-input", std::process::id()));
        StandardInput { folder, is_named: Arc::default() }
    }

    /// The file in which it will be.
    pub fn path(&self) -> PathBuf {
        self.folder.join("stdin")
    }

    /// The same command line, taking `-` for files that are read, and silent where standard output is one that is written.
    pub fn understood(&self, command: Command) -> Command {
        command.mut_subcommands(|own| {
            let outputs: Vec<clap::Id> = (own.get_arguments())
                .filter(|arg| is_of(arg.get_value_parser(), clap::value_parser!(Output).into()))
                .map(|arg| arg.get_id().clone())
                .collect();
            own.mut_args(|arg| {
                if arg.get_id() == "quiet" {
                    arg.default_value_ifs(outputs.iter().map(|id| (id.clone(), DASH, Some("true"))))
                } else if is_of(arg.get_value_parser(), clap::value_parser!(PathBuf)) {
                    let input = self.clone();
                    arg.value_parser(PathBufValueParser::new().try_map(move |path| input.named(path)))
                } else {
                    arg
                }
            })
        })
    }

    fn named(&self, path: PathBuf) -> Result<PathBuf, &'static str> {
        if !is_standard(&path) {
            return Ok(path);
        }
        match self.is_named.swap(true, Ordering::Relaxed) {
            true => Err("standard input is one file, and another argument reads it already"),
            false => Ok(self.path()),
        }
    }

    /// Reads it, where an argument names it; what is returned takes it away at the end of the call.
    pub fn read(&self) -> Outcome<Vec<Part>> {
        if !self.is_named.load(Ordering::Relaxed) {
            return Ok(Vec::new());
        }
        let path = self.path();
        let failed = |source: io::Error| not_written(&path, &source);
        // Nobody else has put anything there.
        let folder = Part::folder(&self.folder).map_err(failed)?;
        let mut options = OpenOptions::new();
        options.write(true).create_new(true);
        // What was measured is for nobody else.
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let (part, mut file) = Part::new(&path, |path| options.open(path)).map_err(failed)?;
        io::copy(&mut io::stdin().lock(), &mut file).map_err(failed)?;
        Ok(vec![part, folder])
    }
}

fn is_of(own: &ValueParser, other: ValueParser) -> bool {
    own.type_id() == other.type_id()
}

/// Standard output as a file: a reader that closes it early (`| head`) is no fault.
pub(super) struct StandardOutput {
    out: io::Stdout,
    is_closed: bool,
}

impl StandardOutput {
    pub fn new() -> StandardOutput {
        StandardOutput { out: io::stdout(), is_closed: false }
    }

    fn tolerated<T>(&mut self, result: io::Result<T>, all: T) -> io::Result<T> {
        match result {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {
                self.is_closed = true;
                Ok(all)
            }
            result => result,
        }
    }
}

impl Write for StandardOutput {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.is_closed {
            return Ok(bytes.len());
        }
        let written = self.out.write(bytes);
        self.tolerated(written, bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.out.flush();
        self.tolerated(flushed, ())
    }
}

//! A page in parts: each part stands between two marks that name it and the command that writes it, and is replaced alone.

use std::io;
use std::path::{Path, PathBuf};

/// The page's own first lines, where it does not exist yet.
const HEAD: &str = "# Benchmarks\n";

/// A page in a file.
pub struct Page {
    path: PathBuf,
}

impl Page {
    /// Of this file, which need not exist yet.
    pub fn new(path: &Path) -> Self {
        Page { path: path.into() }
    }

    /// Puts `body` in the place of the part `name`, or at the end where there is none, and the page in the place of the file.
    ///
    /// The page is read anew, so that what has been written to it since the last part stays.
    pub fn put(&self, name: &str, command: &str, body: &str) -> io::Result<()> {
        let text = match std::fs::read_to_string(&self.path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => HEAD.into(),
            Err(error) => return Err(error),
        };
        // Beside the page, so that a rename puts the whole of it there or nothing.
        let beside = self.path.with_extension(format!("{}.part", std::process::id()));
        let written = std::fs::write(&beside, with_part(&text, name, command, body))
            .and_then(|()| std::fs::rename(&beside, &self.path));
        if written.is_err() {
            let _ = std::fs::remove_file(&beside);
        }
        written
    }
}

/// `text` with `body` as its part `name`.
fn with_part(text: &str, name: &str, command: &str, body: &str) -> String {
    let begin = format!("<!-- begin {name}: written by {command} -->");
    let end = format!("<!-- end {name} -->");
    let part = format!("{begin}\n\n{}\n\n{end}", body.trim());
    let stands = text.find(&format!("<!-- begin {name}:")).and_then(|from| {
        let to = from + text[from..].find(&end)? + end.len();
        Some((from, to))
    });
    match stands {
        Some((from, to)) => format!("{}{part}{}", &text[..from], &text[to..]),
        None => format!("{}\n\n{part}\n", text.trim_end()),
    }
}

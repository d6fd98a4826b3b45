//! Files in the making: each grows beside its output until it is whole, and is taken away where it never will be.

use std::fs::File;
use std::io::Result;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What an interruption has to take away.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file that is not whole yet; dropped before [`Part::finish`] it is removed.
pub(super) struct Part(PathBuf);

impl Part {
    /// Begins the file that is to become `target`.
    pub fn begin(target: &Path) -> Result<(Part, File)> {
        let mut name = target.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".part{}", std::process::id()));
        Part::new(&target.with_file_name(name), |path| File::create(path))
    }

    /// A file that lasts no longer than this.
    pub fn new(path: &Path, create: impl FnOnce(&Path) -> Result<File>) -> Result<(Part, File)> {
        // Held until the file is there: an interruption finds it in the list, or comes before it.
        let mut unfinished = unfinished();
        let file = create(path)?;
        unfinished.insert(0, path.into());
        Ok((Part(path.into()), file))
    }

    /// A folder that lasts no longer than this, and than the files in it.
    pub fn folder(path: &Path) -> Result<Part> {
        let mut unfinished = unfinished();
        std::fs::create_dir(path)?;
        unfinished.push(path.into());
        Ok(Part(path.into()))
    }

    /// Where the file is until then.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Puts the file in the place of `target`.
    pub fn finish(self, target: &Path) -> Result<()> {
        std::fs::rename(&self.0, target)
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        // Behind a rename there is nothing of this name.
        remove(&self.0);
        unfinished().retain(|path| *path != self.0);
    }
}

fn remove(path: &Path) {
    let _ = std::fs::remove_file(path).or_else(|_| std::fs::remove_dir(path));
}

/// From here on an interruption (Ctrl-C, `kill`) takes away what is not whole before it ends the program.
#[cfg(unix)]
pub(super) fn tidy_when_interrupted() {
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    // Where signals cannot be had the program ends by them as ever.
    let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) else { return };
    std::thread::spawn(move || {
        let Some(signal) = signals.forever().next() else { return };
        // Never given back: nothing is begun between here and the end.
        let unfinished = unfinished();
        for path in unfinished.iter() {
            remove(path);
        }
        // Ended by the signal itself, so that a shell stops its loop; it calls this status 130 or 143.
        let _ = emulate_default_handler(signal);
        std::process::exit(128 + signal);
    });
}

#[cfg(not(unix))]
pub(super) fn tidy_when_interrupted() {}

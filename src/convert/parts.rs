//! Files that are one recording together: a bag that its recorder has split, `NAME_0.mcap`, `NAME_1.mcap`, in a folder of its own.

use std::path::{Path, PathBuf};

use crate::error::{Error, Place, Result};
use crate::foreign::{self, Foreign};

/// The files of one recording, in the order in which they were written.
#[derive(Debug, PartialEq)]
pub(super) struct Parts {
    pub files: Vec<PathBuf>,
    /// What is missing of them.
    pub told: Vec<String>,
}

impl Parts {
    /// Files as they are named, folders with the bag that is in them.
    ///
    /// # Errors
    /// [`Error::Input`]: a folder that holds no bag, or several.
    pub fn of(paths: &[PathBuf]) -> Result<Parts> {
        let mut parts = Parts { files: Vec::new(), told: Vec::new() };
        for path in paths {
            match path.is_dir() {
                true => parts.take(path)?,
                false => parts.files.push(path.clone()),
            }
        }
        // A shell lists `_10` before `_2`.
        parts.files.sort_by_cached_key(|file| numbered(file));
        Ok(parts)
    }

    /// The bag in a folder.
    fn take(&mut self, folder: &Path) -> Result<()> {
        let fault = |what: String, mend: String| Error::mistake(Place::file(folder), what, mend);
        let entries = std::fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
        let entries = entries.map_err(|source| Error::file(folder, source))?;
        let all: Vec<PathBuf> = entries.iter().map(std::fs::DirEntry::path).collect();
        let ends =
            |path: &Path, ending: &str| path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
        let mut files: Vec<PathBuf> = all.iter().filter(|path| ends(path, "mcap")).cloned().collect();
        files.sort_by_cached_key(|file| numbered(file));
        let Some(first) = files.first() else {
            // Bags of other kinds have a folder too, and compressed ones.
            for path in all.iter().filter(|path| ["db3", "zstd"].iter().any(|ending| ends(path, ending))) {
                if let Some(Foreign { what, mend: Some(mend) }) = begun(path) {
                    return Err(fault(
                        format!("{} is {what}, which is not read", name(path)),
                        mend.replace("FOLDER", &folder.display().to_string()),
                    ));
                }
            }
            let mend = "name a table, or a folder that `ros2 bag record --storage mcap` has written";
            return Err(fault("no file .mcap is in this folder".into(), mend.into()));
        };
        let bag = numbered(first).0;
        if let Some(other) = files.iter().find(|file| numbered(file).0 != bag) {
            let what = format!("{} and {} in this folder are of different bags", name(first), name(other));
            return Err(fault(what, "name the files of one bag, one after the other".into()));
        }
        let mut missing: Vec<String> = Vec::new();
        let numbers: Vec<u64> = files.iter().filter_map(|file| numbered(file).1).collect();
        for pair in numbers.windows(2) {
            // Numbers may be dates, and a list of all that are not there is for nobody.
            missing
                .extend((pair[0] + 1..pair[1]).take(4).map(|number| format!("{}_{number}.mcap", name(&bag))));
        }
        // What the recorder has written beside them when it closed the bag.
        let listed = std::fs::read_to_string(folder.join("metadata.yaml")).unwrap_or_default();
        for line in listed.lines() {
            let own =
                line.trim().trim_start_matches("- ").trim_start_matches("path: ").trim_matches(['\'', '"']);
            let is_there = files.iter().any(|file| name(file) == own);
            let is_name = own.ends_with(".mcap") && !own.contains(char::is_control);
            if is_name && !is_there && !missing.iter().any(|it| it == own) {
                missing.push(own.into());
            }
        }
        if !missing.is_empty() {
            self.told.push(format!(
                "not in the folder: {}; what was recorded there is missing",
                missing.join(", ")
            ));
        }
        self.files.extend(files);
        Ok(())
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The bag that a file is of, and its number in it: of `run_12.mcap` `run` and 12.
fn numbered(file: &Path) -> (PathBuf, Option<u64>) {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    match stem.rsplit_once('_').and_then(|(bag, number)| Some((bag, number.parse().ok()?))) {
        Some((bag, number)) => (file.with_file_name(bag), Some(number)),
        None => (file.with_file_name(stem), None),
    }
}

/// What a file is by its beginning.
fn begun(file: &Path) -> Option<Foreign> {
    use std::io::Read;
    let mut start = Vec::new();
    std::fs::File::open(file).ok()?.take(foreign::START as u64).read_to_end(&mut start).ok()?;
    foreign::of(file, &start)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_a_bag_come_in_the_order_of_their_numbers() {
        let named = ["run_10.mcap", "run_2.mcap", "run_0.mcap"].map(PathBuf::from);
        let parts = Parts::of(&named).expect("no folder");
        assert_eq!(parts.files, ["run_0.mcap", "run_2.mcap", "run_10.mcap"].map(PathBuf::from));
        assert_eq!(numbered(Path::new("a/run_a_3.mcap")), (PathBuf::from("a/run_a"), Some(3)));
        assert_eq!(numbered(Path::new("a/run.mcap")), (PathBuf::from("a/run"), None));
    }
}

//! The recordings of one call: where what hangs on the machine was recorded too, its columns belong beside the machine's own rows.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use super::join::{beside, whole};
use super::{Recording, Source};
use crate::error::{Error, Result};
use crate::machine::{Machine, SideBranch};

/// No more than so much of a file is looked at for the name of its machine.
const HEADER: u64 = 1 << 16;

/// Opens the recordings of one call.
///
/// A recording of the machine that a side branch is [recorded as](SideBranch::recorded_as) is none of this machine: it is laid beside those of
/// the call that have as many rows and share a column that changes, as [`join`](super::join()) does, and each of these says so in
/// [`Recording::warnings`]. What fits none of them is an error.
///
/// # Errors
/// As [`Recording::open`] and [`join`](super::join()).
pub fn open_all(paths: &[PathBuf], machine: &Machine) -> Result<Vec<Recording>> {
    let side = |path: &PathBuf| -> Option<&SideBranch> {
        let name = machine_of(path).filter(|name| name != machine.name())?;
        machine.side_branches().iter().find(|side| side.recorded_as.as_ref() == Some(&name))
    };
    let (of_sides, own): (Vec<_>, Vec<_>) =
        paths.iter().map(|path| (path, side(path))).partition(|(_, side)| side.is_some());
    let mut recordings =
        own.iter().map(|(path, _)| Recording::open(path, machine)).collect::<Result<Vec<_>>>()?;
    warn_of_copies(&mut recordings)?;
    for (other, side) in of_sides {
        let Some(name) = side.and_then(SideBranch::prefix) else { continue };
        let text = whole(other)?;
        let (mut fits, mut refused) = (false, None);
        for recording in &mut recordings {
            match recording.with_beside((other, &text), name) {
                Ok(joined) => (*recording, fits) = (joined, true),
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        match refused.filter(|_| !fits) {
            Some(error) => return Err(error),
            // Alone it is of the wrong machine.
            None if !fits => drop(Recording::open(other, machine)?),
            None => {}
        }
    }
    Ok(recordings)
}

/// A file that holds the bytes of another one of the call says so: its samples would count twice.
fn warn_of_copies(recordings: &mut [Recording]) -> Result<()> {
    let mut known: HashMap<u64, Vec<usize>> = HashMap::new();
    for i in 0..recordings.len() {
        let Ok(size) = std::fs::metadata(&recordings[i].path).map(|it| it.len()) else { continue };
        let as_long = known.entry(size).or_default();
        let mut copy_of = None;
        for earlier in as_long.iter() {
            if same_bytes(&recordings[*earlier], &recordings[i])? {
                copy_of = Some(recordings[*earlier].path.display().to_string());
                break;
            }
        }
        as_long.push(i);
        if let Some(other) = copy_of {
            let text = format!(
                "it holds the same bytes as {other}: every sample counts twice; leave one of them out"
            );
            recordings[i].warnings.push(text);
        }
    }
    Ok(())
}

/// Whether two files hold the same, read side by side.
fn same_bytes(one: &Recording, other: &Recording) -> Result<bool> {
    let open = |recording: &Recording| -> Result<_> {
        Ok(BufReader::new(recording.source.read_from(&recording.path, 0)?))
    };
    let (mut a, mut b) = (open(one)?, open(other)?);
    loop {
        let (left, right) = (
            a.fill_buf().map_err(|e| Error::file(&one.path, e))?,
            b.fill_buf().map_err(|e| Error::file(&other.path, e))?,
        );
        let length = left.len().min(right.len());
        if left[..length] != right[..length] {
            return Ok(false);
        }
        if length == 0 {
            return Ok(left.len() == right.len());
        }
        a.consume(length);
        b.consume(length);
    }
}

impl Recording {
    /// The same recording with another one's columns behind its own, as `NAME.column`.
    fn with_beside(&self, (other, text): (&Path, &str), name: &str) -> Result<Recording> {
        let own = match &self.source {
            Source::File => whole(&self.path)?,
            Source::Bytes(bytes) => String::from_utf8_lossy(bytes).into_owned(),
        };
        let joined = beside((&self.path, &own), (other, text), name)?;
        let bytes = Source::Bytes(joined.text.into_bytes().into());
        let mut recording = Recording::read(self.path.clone(), bytes, &self.machine)?;
        recording.warnings.clone_from(&self.warnings);
        recording.memory = self.memory.clone();
        recording.warnings.push(format!(
            "{} columns of {} are laid beside it, row by row: both have the same {}",
            joined.added.len(),
            other.display(),
            joined.shared.join(", ")
        ));
        Ok(recording)
    }
}

/// The name of the machine that a file says it is of.
fn machine_of(path: &Path) -> Option<String> {
    let start = BufReader::new(Source::File.read_from(path, 0).ok()?.take(HEADER));
    start.lines().map_while(std::result::Result::ok).find_map(|line| {
        let (key, value) = line.trim_start_matches('\u{feff}').trim().strip_prefix('#')?.split_once(':')?;
        (key.trim() == "machine").then(|| value.trim().to_string())
    })
}

//! The blind harness: a generator that shares no feature, motion, effect or simulation code with the library, and a scorer.
//!
//! Used by `tests/engine/blind.rs` (reduced) and `examples/blind.rs` (the whole table). From the library it takes the nominal numbers
//! of machine files; from the engine only what it says of the recordings.
#![allow(dead_code)]

pub mod ablation;
pub mod answer;
pub mod baseline;
pub mod body;
pub mod case;
pub mod effect;
pub mod folder;
pub mod left_out;
pub mod odd;
pub mod path;
pub mod proposed;
pub mod random;
pub mod score;
pub mod setting;
pub mod shape;
pub mod table;
pub mod textbook;
pub mod track;
pub mod verdict;
pub mod world;

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use case::{Kind, Mode};
use kincal::Machine;
use score::Score;
use verdict::Diagnoser;

/// Where the machine files are.
pub fn machine_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("machines")
}

/// Every shipped machine, sorted by file.
pub fn machines() -> Vec<Machine> {
    machines_in(&machine_folder()).unwrap_or_else(|e| panic!("{e}"))
}

/// Every machine of a folder, sorted by file.
///
/// # Errors
/// If the folder or a machine in it cannot be read, or it holds none.
pub fn machines_in(folder: &Path) -> Result<Vec<Machine>, String> {
    let told = |e: std::io::Error| format!("{}: {e}", folder.display());
    let entries = std::fs::read_dir(folder).map_err(told)?;
    let mut files: Vec<PathBuf> =
        entries.map(|e| e.map(|e| e.path()).map_err(told)).collect::<Result<_, _>>()?;
    files.retain(|f| f.extension().is_some_and(|e| e == "ron"));
    files.sort();
    if files.is_empty() {
        return Err(format!("{}: no machine (*.ron) in this folder", folder.display()));
    }
    files.iter().map(|f| Machine::open(f).map_err(|e| e.to_string())).collect()
}

/// Draws cases and writes them with their answers.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    folder: &Path,
    machines: &[Machine],
    kind: Kind,
    mode: Option<Mode>,
    seed: u64,
    count: usize,
) -> Result<(), String> {
    let told = |e: &dyn std::fmt::Display| format!("{}: {e}", folder.display());
    let answers: Vec<serde_json::Value> = (0..count)
        .into_par_iter()
        .map(|number| case::draw(machines, kind, mode, seed, number).write(folder))
        .collect::<Result<_, _>>()
        .map_err(|e| told(&e))?;
    let text = serde_json::to_string_pretty(&answers).map_err(|e| told(&e))?;
    std::fs::write(folder.join("answers.json"), text).map_err(|e| told(&e))
}

/// Diagnoses every answered case of a folder, its machine taken from the folder `machines`, one core a case, and scores what was said.
///
/// # Errors
/// If the folder cannot be read; a case that fails is counted in [`Score::broken`].
pub fn judge(folder: &Path, machines: &Path, diagnoser: &dyn Diagnoser) -> Result<Score, String> {
    let cases = answer::open(folder, machines)?;
    let results: Vec<_> =
        cases.into_par_iter().map(|(files, answer)| (answer, diagnoser.diagnose(&files))).collect();
    Ok(Score::of(&results))
}

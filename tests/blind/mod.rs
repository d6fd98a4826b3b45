//! The blind harness: a generator that shares no feature, motion, effect or simulation code with the library, and a scorer.
//!
//! Used by `tests/blind.rs` (reduced) and `examples/blind.rs` (the whole table). From the library it takes the nominal numbers
//! of machine files; from the engine only what it says of the recordings.
#![allow(dead_code)]

pub mod body;
pub mod case;
pub mod effect;
pub mod folder;
pub mod odd;
pub mod path;
pub mod random;
pub mod setting;
pub mod shape;
pub mod textbook;
pub mod track;
pub mod world;

use std::path::Path;

use kincal::Machine;

/// Every shipped machine, sorted by file.
pub fn machines() -> Vec<Machine> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("machines");
    let mut files: Vec<_> =
        std::fs::read_dir(folder).expect("machines/ is there").flatten().map(|e| e.path()).collect();
    files.sort();
    let ron = files.into_iter().filter(|f| f.extension().is_some_and(|e| e == "ron"));
    ron.map(|f| Machine::open(&f).unwrap_or_else(|e| panic!("{e}"))).collect()
}

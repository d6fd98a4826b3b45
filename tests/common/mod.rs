//! What several tests need.
#![allow(dead_code)]

pub mod channels;
pub mod draws;
pub mod folder;
pub mod paper;
pub mod planted;
pub mod random;

use std::path::{Path, PathBuf};

use kincal::effects::Library;
use kincal::inverse::{Goal, Inverse, InverseOptions, Mode, Outcome};
use kincal::lie::{Mat3, Pose, Vec3};
use kincal::{Chain, Machine};

/// Every shipped machine with the stem of its file, sorted.
pub fn machines() -> Vec<(String, Machine)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("machines");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("machines/ is there").map(|e| e.expect("readable").path()).collect();
    files.sort();
    files
        .into_iter()
        .filter(|f| f.extension().is_some_and(|e| e == "ron"))
        .map(|file| {
            let stem = file.file_stem().expect("a name").to_string_lossy().into_owned();
            (stem, Machine::open(&file).unwrap_or_else(|e| panic!("{e}")))
        })
        .collect()
}

/// One shipped machine.
pub fn machine(stem: &str) -> Machine {
    machines().into_iter().find(|(name, _)| name == stem).unwrap_or_else(|| panic!("{stem} is shipped")).1
}

/// The library without these families, their forms and kinds.
pub fn library_without(families: &[&str]) -> Library {
    let without = |library: Library, family: &&str| library.without(family).unwrap_or_else(|e| panic!("{e}"));
    families.iter().fold(Library::standard(), without)
}

/// Columns of `f64` have sines and exponentials of their own, to a few units in the last place of one; dual numbers those of the standard library.
pub fn are_the_same_but_for_rounding(one: &[f64], other: &[f64]) {
    assert_eq!(one.len(), other.len());
    let largest = one.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    for (a, b) in one.iter().zip(other) {
        assert!((a - b).abs() <= 1e-15 + 1e-14 * largest, "{a} {b}, largest {largest}");
    }
}

/// A file of the data sets beside the project, or where `KINCAL_DATA` says. Only tests that are ignored for that reason ask for one.
pub fn data(path: &str) -> PathBuf {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let full = std::env::var_os("KINCAL_DATA").map_or_else(beside, PathBuf::from).join(path);
    assert!(full.exists(), "{path} of the data sets is not here: KINCAL_DATA=FOLDER says where they are");
    full
}

/// What was read, or nothing where it was refused; then the message says where, and there is a mend.
pub fn read_or_refused<T>(outcome: kincal::Result<T>, file: &str) -> Option<T> {
    outcome
        .map_err(|error| {
            assert!(error.to_string().starts_with(file), "{error}");
            assert!(!error.mend().is_empty(), "{error} has no mend");
        })
        .ok()
}

/// Commands that bring the origin of frame `t` to `p_w` (m) and its z axis along `axis_w` (unit vector), whatever the travel.
pub fn aimed(
    chain: &Chain<f64>,
    machine: &Machine,
    p_w: Vec3<f64>,
    axis_w: Vec3<f64>,
    start: &[f64],
) -> Option<Vec<f64>> {
    let exact = InverseOptions::default().with_weak(1e-6).with_within_travel(false);
    let inverse = Inverse::new(machine).with_mode(Mode::PositionAndAxis).with_options(exact);
    let first = axis_w.across()[0];
    let columns = [first, axis_w.cross(first), axis_w];
    let rotation = Mat3(std::array::from_fn(|i| std::array::from_fn(|j| columns[j].0[i])));
    let goal = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: Pose { rotation, translation: p_w } };
    let solution = inverse.solve(chain, &goal, start, &vec![true; start.len()]);
    (solution.outcome == Outcome::Reached).then_some(solution.commands)
}

//! What a caller tells of a table that has no place for it: a slip, which would pass for something that was heeded.

use std::path::Path;

use super::Request;
use super::draft::Draft;
use crate::error::{Error, Place, Result};
use crate::wording::shown;

/// Refuses a line for the head without a key: the recording would hold it as a comment.
pub(super) fn heads(file: &Path, request: &Request) -> Result<()> {
    let Some(line) = request.head.iter().find(|line| !line.contains(':')) else { return Ok(()) };
    let what = format!("--head '{}': no colon parts a key from its value", shown(line));
    Err(Error::mistake(Place::file(file), what, "write 'KEY: VALUE', such as 'workpiece_frame: unknown'"))
}

/// Asks about what other kinds of files have, where a table is read column by column.
pub(super) fn foreign(draft: &mut Draft) {
    let request = draft.request;
    let laser = "files of a laser and deviations at targets";
    let r_test = "an R-test, which --measurement r-test says";
    for (flag, value, of) in [
        ("joint", &request.joint, laser),
        ("approach", &request.approach, laser),
        ("deviation", &request.deviation, "a laser, of deviations at targets, and of an R-test"),
        ("axes", &request.axes, r_test),
    ] {
        if value.is_some() {
            let what = format!("--{flag} is of {of}; this table is read column by column");
            draft.ask(what, format!("leave --{flag} out, or check the headings: docs/convert.md"));
        }
    }
}

/// Tells which forms of rotations were said of a table that has none of them.
pub(super) fn rotations(draft: &mut Draft) {
    let has = |stem: &str| draft.map.columns.iter().any(|part| part.to.starts_with(stem));
    let request = draft.request;
    let idle = [
        ("euler", request.euler.is_some() && !has("euler"), "no Euler angles are"),
        ("rotation-vector", request.rotation_vector && !has("rx"), "no rotation vector is"),
        ("matrix", request.matrix.is_some() && !has("matrix"), "no matrix is"),
    ];
    let told = idle.into_iter().filter(|(_, is_idle, _)| *is_idle);
    let told: Vec<String> = told
        .map(|(flag, _, what)| format!("--{flag} changes nothing: {what} taken from this table"))
        .collect();
    draft.told.extend(told);
}

//! The program as it is run by tests, and a folder for what it reads and writes.

use std::process::{Command, Output};

pub use crate::common::folder::Folder;

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_kincal");

/// The program, to be run in the project's folder.
pub fn command() -> Command {
    let mut command = Command::new(PROGRAM);
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

pub fn kincal(args: &[&str]) -> Output {
    command().args(args).output().expect("it runs")
}

pub fn out(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

pub fn err(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("UTF-8")
}

/// Status, standard output, standard error.
pub fn said(args: &[&str]) -> (Option<i32>, String, String) {
    let output = kincal(args);
    (output.status.code(), out(&output), err(&output))
}

/// Standard output of a run that must succeed without a word on standard error.
pub fn done(args: &[&str]) -> String {
    let (status, out, err) = said(args);
    assert_eq!((status, err.as_str()), (Some(0), ""), "{args:?}");
    out
}

/// Standard error of a run that must end with this status and an empty standard output.
pub fn fails(status: i32, args: &[&str]) -> String {
    let (got, out, err) = said(args);
    assert_eq!((got, out.as_str()), (Some(status), ""), "{args:?}: {err}");
    err
}

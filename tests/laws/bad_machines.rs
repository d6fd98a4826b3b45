//! Every mistake in a machine file has a message that says where it is and how to mend it, and no text makes the reader panic.

use std::path::{Path, PathBuf};

use crate::common::read_or_refused;
use kincal::{CalibratedMachine, Error, Machine};
use proptest::prelude::*;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn files(name: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder(name)).expect("part of the project");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("a readable folder").path()).collect();
    paths.sort();
    paths
}

/// The error of one of the bad machines, its path cut down to the file's name.
fn error_of(path: &Path) -> Error {
    CalibratedMachine::open(path).err().unwrap_or_else(|| panic!("{} can be read", path.display()))
}

/// `line:column` of a message, and what stands there.
fn token_at(path: &Path, error: &Error) -> String {
    let place = error.place().expect("an error about a text has a place");
    assert!(place.line > 0 && place.column > 0, "{error}");
    let bytes = std::fs::read(path).expect("a readable file");
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let line = text.lines().nth(place.line - 1).unwrap_or_default();
    line.chars().skip(place.column - 1).collect()
}

#[test]
fn every_bad_machine_has_a_message_and_a_mend() {
    let lines = files("tests/bad/machines").into_iter().map(|path| {
        let error = error_of(&path);
        let parent = format!("{}/", path.parent().expect("a folder").display());
        assert!(error.place().is_some(), "{error}");
        assert!(!error.mend().is_empty(), "{error}");
        format!("{} | {}", error.to_string().replace(&parent, ""), error.mend())
    });
    insta::assert_snapshot!(lines.collect::<Vec<_>>().join("\n"));
}

#[test]
fn a_folder_in_the_place_of_a_file_is_told_with_its_mend() {
    let error = Machine::open(folder("machines")).expect_err("a folder");
    assert_eq!(error.mend(), "name a file, not a folder", "{error}");
}

#[test]
fn messages_point_at_the_token_at_fault() {
    let expected = [
        ("zero_axis", "(0, 0, 0), travel"),
        ("dh_beside_tool", "("),
        ("dh_limits_reversed", "(60, -100)"),
        ("dh_sign_of_two", "2)"),
        ("dh_joint_named_twice", "\"q1\", a: 440"),
        ("dh_number_too_large", "1e300, alpha"),
        ("dh_tool_too_far", "Tz(1e300)"),
        ("dh_follows_an_unknown_joint", "1}"),
        ("axis_not_of_length_one", "(0, 1, 1), travel"),
        ("unknown_axis_word", "\"up\""),
        ("missing_w", "\"work\""),
        ("frame_named_twice", "\"x\", joint: Prismatic(axis: \"z\")"),
        ("joint_named_twice", "\"x\")"),
        ("bad_frame_name", "\"x axis\""),
        ("joint_on_last_frame", "Revolute("),
        ("limits_reversed", "(180, -180)"),
        ("limit_not_finite", "inf)"),
        ("not_a_number", "NaN"),
        ("infinite", "-inf"),
        ("far_too_large", "1e300"),
        ("move_too_large", "Tz(1e300)"),
        ("gravity_zero", "(0, 0, 0)"),
        ("empty_workpiece", "[]"),
        ("follows_an_unknown_joint", "1}"),
        ("follows_a_passive_joint", "2}"),
        ("follows_factor_infinite", "inf}"),
        ("moves_beside_at", "[Rz(90)]"),
        ("negative_tolerance", "-0.03"),
        ("tolerance_of_a_frame_zero", "0, rotation"),
        ("negative_mass", "-2"),
        ("bad_nc_address", "(address: \"4\")"),
        ("bad_nc_sign", "(address: \"C\", sign: 2)"),
        ("not_utf8", "\u{fffd}d\""),
    ];
    for (stem, start) in expected {
        let path = folder("tests/bad/machines").join(format!("{stem}.ron"));
        let error = error_of(&path);
        let token = token_at(&path, &error);
        assert!(token.starts_with(start), "{error}\n  points at {token}\n  should at {start}");
    }
}

#[test]
fn a_file_that_is_far_too_large_is_refused() {
    let text = format!("// {}\n", "x".repeat(9 << 20));
    let error = Machine::parse("large.ron", &text).expect_err("too large");
    assert!(error.to_string().starts_with("large.ron: file has"), "{error}");
    assert!(!error.mend().is_empty());
}

#[test]
fn a_missing_file_is_told() {
    let error = Machine::open("no/such/machine.ron").expect_err("nothing there");
    assert!(error.to_string().starts_with("no/such/machine.ron: "), "{error}");
    assert!(!error.mend().is_empty());
}

/// Shipped machines as texts, to be damaged.
fn shipped() -> Vec<String> {
    files("machines").iter().map(|path| std::fs::read_to_string(path).expect("a machine")).collect()
}

/// The same cases on every run.
fn fixed_cases() -> ProptestConfig {
    ProptestConfig {
        cases: 1024,
        rng_seed: proptest::test_runner::RngSeed::Fixed(20_260_102),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(fixed_cases())]

    #[test]
    fn any_text_is_read_or_refused(text in "\\PC*") {
        read_or_refused(Machine::parse("any.ron", &text), "any.ron");
    }

    #[test]
    fn any_text_of_ron_tokens_is_read_or_refused(tokens in proptest::collection::vec(proptest::sample::select(vec![
        "Machine", "(", ")", "[", "]", "{", "}", ",", ":", "\"", "\"x\"", "name", "units", "tool", "workpiece", "frame",
        "joint", "Revolute", "Prismatic", "axis", "1", "-1e400", "NaN", "inf", "0x1", "//", "/*", "*/", "\n", "r#\"", "'", "\\", "é",
        "Some", "#![enable(", "b\"",
    ]), 0..60)) {
        read_or_refused(Machine::parse("tokens.ron", &tokens.concat()), "tokens.ron");
    }

    #[test]
    fn a_damaged_machine_is_read_or_refused(which in 0usize..64, at in 0.0..1.0f64, len in 0usize..12, put in "\\PC{0,4}") {
        let texts = shipped();
        let mut letters: Vec<char> = texts[which % texts.len()].chars().collect();
        let start = (at * letters.len() as f64) as usize;
        let end = (start + len).min(letters.len());
        letters.splice(start..end, put.chars());
        let text: String = letters.into_iter().collect();
        read_or_refused(Machine::parse("damaged.ron", &text), "damaged.ron");
    }
}

//! Every mistake in a library of effects has a message that says where it is and how to mend it.

use std::path::{Path, PathBuf};

use kincal::Error;
use kincal::effects::Library;
use proptest::prelude::*;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn error_of(path: &Path) -> Error {
    Library::standard().with_file(path).err().unwrap_or_else(|| panic!("{} can be read", path.display()))
}

#[test]
fn every_bad_library_has_a_message_and_a_mend() {
    let entries = std::fs::read_dir(folder("tests/bad/effects")).expect("part of the project");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("a readable folder").path()).collect();
    paths.sort();
    let lines = paths.into_iter().map(|path| {
        let error = error_of(&path);
        let parent = format!("{}/", path.parent().expect("a folder").display());
        let place = error.place().unwrap_or_else(|| panic!("{error} has no place"));
        assert!(place.line > 0, "{error}");
        assert!(!error.mend().is_empty(), "{error}");
        format!("{} | {}", error.to_string().replace(&parent, ""), error.mend())
    });
    insta::assert_snapshot!(lines.collect::<Vec<_>>().join("\n"));
}

#[test]
fn messages_point_at_the_token_at_fault() {
    for (stem, start) in [
        ("sum_of_unlike_things", "Velocity]"),
        ("sine_of_a_length", "Position)"),
        ("wrong_unit_deep_inside", "Quotient("),
        ("take_up_in_seconds", "Parameter(\"p\")"),
        ("chebyshev_of_a_length", "Position)"),
        ("unknown_unit", "Value(3"),
        ("along_on_a_frame", "Along]"),
        ("coefficient_in_the_wrong_unit", "\"m\")"),
        ("sentence_asks_for_nothing_known", "\"axis {at} wears by"),
        ("look_alike_unknown", "\"rust\""),
    ] {
        let path = folder("tests/bad/effects").join(format!("{stem}.ron"));
        let error = error_of(&path);
        let place = error.place().expect("a place");
        let text = std::fs::read_to_string(&path).expect("a text");
        let line = text.lines().nth(place.line - 1).unwrap_or_default();
        let token: String = line.chars().skip(place.column - 1).collect();
        assert!(token.starts_with(start), "{error}\n  points at {token}\n  should at {start}");
    }
}

#[test]
fn a_missing_library_is_told() {
    let error = Library::standard().with_file("no/such/effects.ron").expect_err("nothing there");
    assert!(error.to_string().starts_with("no/such/effects.ron: ") && !error.mend().is_empty(), "{error}");
}

/// The same cases on every run.
fn fixed_cases() -> ProptestConfig {
    ProptestConfig {
        cases: 128,
        rng_seed: proptest::test_runner::RngSeed::Fixed(20_260_104),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(fixed_cases())]

    #[test]
    fn a_damaged_library_is_read_or_refused(at in 0.0..1.0f64, len in 0usize..12, put in "\\PC{0,4}") {
        let standard = std::fs::read_to_string(folder("src/effects/library.ron")).expect("the library");
        let mut letters: Vec<char> = standard.chars().collect();
        let start = (at * letters.len() as f64) as usize;
        let end = (start + len).min(letters.len());
        letters.splice(start..end, put.chars());
        let text: String = letters.into_iter().collect();
        if let Err(error) = Library::standard().with_text("damaged.ron", &text) {
            prop_assert!(!error.to_string().is_empty());
            prop_assert!(!error.mend().is_empty());
        }
    }
}

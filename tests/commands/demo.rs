//! The demonstration: it needs no input, repeats itself by its seed, and prints what the README shows.

use std::process::Command;
use std::sync::OnceLock;

use crate::documents::{block, compare};
use crate::program::{Folder, PROGRAM, done, err, out};
use insta::assert_snapshot;
use serde_json::Value;

/// What a run printed and wrote.
#[derive(PartialEq)]
struct Run {
    text: String,
    json: String,
    report: String,
    files: Vec<String>,
}

/// Runs it in a folder of its own.
fn run(args: &[&str]) -> Run {
    let folder = Folder::new("demo");
    let mut command = Command::new(PROGRAM);
    let command = command.arg("demo").args(args).args(["--json", "demo.json"]).current_dir(&folder.0);
    let output = command.output().expect("it runs");
    assert_eq!((output.status.code(), err(&output).as_str()), (Some(0), ""), "{args:?}");
    let (json, report) = (folder.read("demo.json"), folder.read("kincal_demo.html"));
    Run { text: out(&output), json, report, files: folder.names() }
}

/// One run without any argument serves several tests.
fn plain() -> &'static Run {
    static PLAIN: OnceLock<Run> = OnceLock::new();
    PLAIN.get_or_init(|| run(&[]))
}

/// Digits of measured numbers as `#`: they may differ in the last place from processor to processor.
fn redacted(text: &str) -> String {
    let hide = |text: &str| text.replace(|c: char| c.is_ascii_digit(), "#");
    let word = |word: &str| {
        if word.contains('.') && !word.ends_with(".csv") { hide(word) } else { word.to_string() }
    };
    let is_measured = |line: &str| line.contains("um/m") || line.contains(" um towards ");
    let line = |line: &str| match line.contains('±') && line.contains('%') || is_measured(line) {
        true => hide(line),
        false => line.split(' ').map(word).collect::<Vec<_>>().join(" "),
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

#[test]
fn it_needs_no_input_and_finds_what_was_concealed() {
    let run = plain();
    assert_snapshot!(redacted(&run.text));
    assert_eq!(run.files, ["demo.json", "kincal_demo.html"], "what it says that it writes");
    let value: Value = serde_json::from_str(&run.json).expect("JSON");
    let found = |i: usize, key: &str| value["findings"][i][key].as_str().expect("a text").to_string();
    let mut names: Vec<_> = (0..2).map(|i| (found(i, "effect"), found(i, "at"))).collect();
    names.sort();
    let concealed = [("backlash".to_string(), "a".to_string()), ("cyclic_error".into(), "c".into())];
    assert_eq!(names, concealed, "what was concealed");
    assert_eq!(value["findings"].as_array().map(Vec::len), Some(2), "and nothing else");
    let rms = |of: &str| value["rms_m"][of].as_f64().expect("a number");
    assert!(rms("nominal") > 1e-5 && rms("geometric") > 1e-6 && rms("final") < 6e-7);
    assert!(run.report.contains("backlash"));
}

#[test]
fn it_repeats_itself_by_its_seed() {
    assert!(*plain() == run(&["--seed", "2"]), "the same seed, the same bytes");
    let other = run(&["--seed", "3"]);
    assert!(plain().text != other.text && plain().report != other.report);
}

#[test]
fn it_is_quiet_where_its_result_goes_to_standard_output() {
    let folder = Folder::new("demo-quiet");
    let text = done(&["demo", "--report", &folder.path("demo.html"), "--quiet", "--json", "-"]);
    assert!(serde_json::from_str::<Value>(&text).is_ok_and(|value| value["findings"].is_array()), "{text}");
}

#[test]
fn the_readme_shows_what_it_prints() {
    let text = &plain().text;
    let printed: Vec<&str> = text.lines().collect();
    let shown = block("The machine is ");
    assert!(shown.len() > 20, "{shown:?}");
    compare(&shown, &printed).unwrap_or_else(|e| panic!("{e}\n\n{text}"));
    // Another figure, another word, or a line left out without a sign of it is found.
    let wrong = |from: &str, to: &str| {
        let changed: Vec<String> = shown.iter().map(|line| line.replace(from, to)).collect();
        assert!(changed != shown && compare(&changed, &printed).is_err(), "{from}");
    };
    wrong("84.6 um", "85.6 um");
    wrong("1802", "1803");
    wrong("held-out", "left-out");
    let mut without = shown.clone();
    without.remove(7);
    assert!(compare(&without, &printed).is_err());
}

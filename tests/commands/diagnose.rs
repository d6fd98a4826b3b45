//! What `kincal diagnose` says to people, on the terminal and in its report.

use crate::common::random::Random;
use crate::program::{Folder, said};
use crate::report::{assert_page, has};
use insta::assert_snapshot;

const MACHINE: &str = "machines/rotary_axis.ron";
/// Play and noise of the simulated axis, arcsec.
const PLAY: f64 = 12.0;
const NOISE: f64 = 0.5;

/// A reference encoder on a rotary axis that goes to and fro twice, with this much play.
fn recording(folder: &Folder, play: f64) -> String {
    let mut random = Random::new(3);
    let mut text = String::from(
        "# machine: rotary_axis\n# measurement: joint\n# zero: unknown\nt[s],c[deg],c_meas[deg]\n",
    );
    let count = 360;
    for k in 0..4 * count {
        let (leg, step) = (k / count, k % count);
        let c = if leg % 2 == 0 { step } else { count - step };
        // Where it turns it has come from the leg before.
        let direction = if (k.max(1) - 1) / count % 2 == 0 { 1.0 } else { -1.0 };
        // Twelve uniform numbers less six: nearly normal.
        let noise: f64 = (0..12).map(|_| random.between(0.0, 1.0)).sum::<f64>() - 6.0;
        let error = 3.0 - direction * play / 2.0 + NOISE * noise;
        text += &format!("{:.2},{c},{:.7}\n", 0.1 * f64::from(k), f64::from(c) + error / 3600.0);
    }
    let path = folder.path("to_and_fro.csv");
    std::fs::write(&path, text).expect("written");
    path
}

/// Numbers with a point to two digits, so that the last ones may differ from processor to processor.
fn rounded(text: &str) -> String {
    let word = |word: &str| match word.parse::<f64>() {
        Ok(x) if word.contains('.') && x != 0.0 => {
            let places = (1 - x.abs().log10().floor() as i32).clamp(0, 9) as usize;
            format!("{x:.places$}")
        }
        _ => word.to_string(),
    };
    text.lines()
        .map(|line| line.split(' ').map(word).collect::<Vec<_>>().join(" "))
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn play_of_an_axis_is_told_as_a_machinist_would() {
    let folder = Folder::new("text");
    let rec = recording(&folder, PLAY);
    let (status, text, err) = said(&["diagnose", MACHINE, &rec]);
    assert_eq!((status, err.as_str()), (Some(0), ""));
    assert_snapshot!(rounded(&text));
}

#[test]
fn an_axis_without_errors_is_told_in_one_calm_sentence() {
    let folder = Folder::new("clean");
    let rec = recording(&folder, 0.0);
    let (status, text, _) = said(&["diagnose", MACHINE, &rec]);
    assert_eq!(status, Some(0));
    assert!(text.ends_with("there is nothing else to be found in them.\n"), "{text}");
    assert!(text.starts_with("The machine is 0.49") && text.contains(" off, which is noise.\n"), "{text}");
    assert_eq!(text.matches("\n\n").count(), 2, "{text}");
}

#[test]
fn the_report_is_one_file_with_everything_that_was_found() {
    let folder = Folder::new("report");
    let rec = recording(&folder, PLAY);
    let report = folder.path("report.html");
    let json = folder.path("found.json");
    let (status, text, err) = said(&["diagnose", MACHINE, &rec, "--report", &report, "--json", &json]);
    assert_eq!((status, err.as_str()), (Some(0), ""));
    assert!(text.ends_with(&format!("report written to {report}\n")), "{text}");
    assert_eq!(folder.names(), ["found.json", "report.html", "to_and_fro.csv"]);
    let page = std::fs::read_to_string(&report).expect("a report");
    assert_page(&page);
    let found: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&json).expect("a result")).expect("JSON");
    let findings = found["findings"].as_array().expect("a list");
    assert!(!findings.is_empty());
    for finding in findings {
        let sentence = finding["explanation"].as_str().expect("a sentence");
        assert!(page.contains(sentence), "{sentence}");
        let share = finding["share"].as_f64().expect("a number");
        // The play's mean square against all that is left over.
        let expected = (PLAY / 2.0).powi(2) / ((PLAY / 2.0).powi(2) + NOISE.powi(2));
        assert!((share - expected).abs() < 0.01, "{share} {expected}");
    }
    // Bars before and after, one of shares, the recording twice (the last models once more where they are small), its axis, one of each
    // finding, one of what is left, the machine.
    assert_eq!(page.matches("<svg").count(), 7 + findings.len());
    for stage in ["nominal", "geometric", "final"] {
        assert!(has(&page, &found["rms_rad"][stage]), "{stage}");
    }
    let remedy = findings[0]["remedy"].as_str().expect("what to do");
    assert!(page.contains(remedy) && text.contains(&format!("do: {remedy}")), "{remedy}");
}

#[test]
fn a_report_that_cannot_be_written_is_told_before_any_work() {
    let folder = Folder::new("unwritable");
    let rec = recording(&folder, PLAY);
    let missing = folder.path("no_such_folder/report.html");
    let (status, text, err) = said(&["diagnose", MACHINE, &rec, "--report", &missing]);
    assert_eq!((status, text.as_str()), (Some(1), ""));
    assert!(err.starts_with(&format!("error: {missing}: cannot be written: ")), "{err}");
    assert!(err.contains("\n  = create the folder "), "{err}");
    let (status, ..) = said(&["diagnose", MACHINE, &rec, "--report", &rec]);
    assert_eq!(status, Some(1), "a recording is never overwritten");
    assert_eq!(folder.names(), ["to_and_fro.csv"]);
}

//! Results that are nonsense are refused, with the mistake that explains them; what is odd in recordings is told.

use crate::program::{Folder, done, fails, said};
use insta::assert_snapshot;

const MACHINE: &str = "machines/ac_table_tilting.ron";

fn bad(name: &str) -> String {
    format!("tests/bad/mistakes/{name}.csv")
}

/// Where a fit of nonsense ends may differ from processor to processor.
fn without_figures(line: &str) -> String {
    if let Some((words, _)) = line.split_once("belong together: ") {
        return format!("{words}belong together: ...");
    }
    match line.rsplit_once("would be left instead of ") {
        Some((words, _)) => format!("{words}would be left instead of ..."),
        None => line.to_string(),
    }
}

#[test]
fn every_mistake_has_its_message() {
    let folder = Folder::new("mistakes");
    let names = ["axis_reversed", "columns_swapped", "mirrored", "radians_called_degrees", "two_mistakes"];
    let files = std::fs::read_dir("tests/bad/mistakes").expect("a folder").count();
    assert_eq!(files, names.len());
    let output = folder.path("out.ron");
    let message = |name: &str| {
        let text = fails(1, &["calibrate", MACHINE, &bad(name), "-o", &output]);
        format!("{name}\n{}\n", text.lines().map(without_figures).collect::<Vec<_>>().join("\n"))
    };
    assert_snapshot!(names.map(message).join("\n"));
    assert!(folder.names().is_empty(), "{:?}", folder.names());
}

#[test]
fn nonsense_is_written_only_if_it_is_wanted() {
    let folder = Folder::new("force");
    let (file, output) = (bad("axis_reversed"), folder.path("out.ron"));
    for command in ["diagnose", "compare"] {
        let message = fails(1, &[command, MACHINE, &file, "--json", &folder.path("out.json")]);
        assert!(message.contains("With the sign of x reversed"), "{command}: {message}");
    }
    assert!(folder.names().is_empty(), "{:?}", folder.names());
    let text = done(&["calibrate", MACHINE, &file, "-o", &output, "--force"]);
    assert!(text.contains("note: axis_reversed.csv: recording and machine do not belong together"), "{text}");
    assert_eq!(folder.names(), ["out.ron"]);
}

#[test]
fn describe_says_where_the_tool_is() {
    let machine = "machines/kuka_iiwa14.ron";
    let tail = |args: &[&str]| {
        let text = done(args);
        text[text.find("pose of t in w").expect("it is there")..].to_string()
    };
    assert_snapshot!(tail(&["describe", machine, "--at", "q2=90deg,q4=-30deg"]));
    let message = |at: &str| fails(1, &["describe", machine, "--at", at]);
    assert_snapshot!([message("q9=1deg"), message("q1=1mm"), message("q1")].join("\n"));
}

#[test]
fn a_recording_given_twice_and_a_clock_that_jumps_are_told() {
    let folder = Folder::new("odd");
    let rows: Vec<String> = (0..40)
        .map(|k| {
            let (t, x) = (if k < 20 { k } else { 3600 + k }, 10.0 * f64::from(k));
            format!("{t},{x},{x},0.00{},80", k % 3)
        })
        .collect();
    let text = format!("# measurement: position\nt[s],x[mm],px[mm],py[mm],pz[mm]\n{}\n", rows.join("\n"));
    let machine = folder.write(
        "slide.ron",
        r#"Machine(name: "slide", units: (length: mm, angle: deg), workpiece: [(frame: "w")],
            tool: [(frame: "x", joint: Prismatic(axis: "x", travel: (0, 500))), (frame: "t", at: (0, 0, 80))])"#,
    );
    let (one, other) = (folder.write("one.csv", &text), folder.write("other.csv", &text));
    let (status, out, err) = said(&["calibrate", &machine, &one, &other]);
    assert_eq!(status, Some(0), "{err}");
    let jump = "note: one.csv: `t` jumps by 3601 s at line 23, and runs for 38 s in all the rest: a long pause, or a clock that was set";
    assert!(out.contains(jump), "{out}");
    assert!(out.contains("note: other.csv: it holds the same bytes as "), "{out}");
}

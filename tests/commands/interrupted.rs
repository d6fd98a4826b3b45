//! A run that is interrupted leaves nothing of what it was writing.
#![cfg(unix)]

use std::fmt::Write as _;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::program::{Folder, PROGRAM};

/// A run in a folder.
fn started(folder: &Folder, args: &[&str]) -> Child {
    let mut command = Command::new(PROGRAM);
    command.current_dir(&folder.0).args(args);
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program runs")
}

fn machine(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("machines").join(name).to_string_lossy().into_owned()
}

/// Sends the signal; what the run ended by.
fn stopped(mut run: Child, signal: &str) -> ExitStatus {
    let sent = Command::new("kill").args([signal, &run.id().to_string()]).stderr(Stdio::null()).status();
    assert!(sent.is_ok(), "kill runs");
    run.wait().expect("a child")
}

/// Interrupts a run once it writes `output`; the signal that it ended by.
fn interrupted_at_work(folder: &Folder, args: &[&str], output: &str, signal: &str) -> Option<i32> {
    let mut run = started(folder, args);
    let patience = Instant::now() + Duration::from_secs(60);
    while !folder.names().iter().any(|name| name.starts_with(&format!("{output}.part"))) {
        assert!(
            Instant::now() < patience && run.try_wait().expect("a child").is_none(),
            "nothing is written"
        );
        std::thread::sleep(Duration::from_millis(1));
    }
    stopped(run, signal).signal()
}

/// A recording of so many rows that writing it outlasts the test.
fn interrupted(folder: &Folder, signal: &str) -> Option<i32> {
    let machine = machine("ac_table_tilting.ron");
    let args =
        ["simulate", &machine, "--test", "poses", "--count", "100000000", "--noise", "1um", "-o", "rec.csv"];
    interrupted_at_work(folder, &args, "rec.csv", signal)
}

#[test]
fn interrupting_leaves_no_part_and_no_output() {
    for (signal, number) in [("-INT", 2), ("-TERM", 15)] {
        let folder = Folder::new("interrupted");
        assert_eq!(interrupted(&folder, signal), Some(number));
        assert_eq!(folder.names(), Vec::<String>::new(), "{signal}");
    }
}

#[test]
fn interrupting_leaves_an_output_that_was_there_as_it_was() {
    let folder = Folder::new("kept");
    std::fs::write(folder.0.join("rec.csv"), "of yesterday").expect("writable");
    assert_eq!(interrupted(&folder, "-INT"), Some(2));
    assert_eq!(folder.names(), ["rec.csv"]);
    assert_eq!(std::fs::read_to_string(folder.0.join("rec.csv")).expect("there"), "of yesterday");
}

#[test]
fn what_streams_its_output_leaves_no_part_of_it() {
    let folder = Folder::new("streams");
    let (axis, mill) = (machine("linear_axis.ron"), machine("xyz_mill.ron"));
    let mut rec = String::from("# measurement: joint\nx[mm],x_meas[mm]\n");
    let mut program = String::from("G90 G21\n");
    for k in 0..400_000 {
        let x = k % 300;
        let _ = writeln!(rec, "{x},{x}.001");
        let _ = writeln!(program, "G1 X{x}. Y{}. Z0. F900", x / 2);
    }
    folder.write("rec.csv", &rec);
    folder.write("part.nc", &program);
    let truth = [
        "simulate",
        &mill,
        "--test",
        "poses",
        "--count",
        "20",
        "--random",
        "1",
        "-o",
        "poses.csv",
        "--truth",
        "true.ron",
    ];
    assert!(started(&folder, &truth).wait().expect("a child").success());
    let names = folder.names();
    for (args, output) in [
        (["predict", &axis, "rec.csv", "-o", "out.csv"], "out.csv"),
        (["compensate", "true.ron", "part.nc", "-o", "out.nc"], "out.nc"),
    ] {
        assert_eq!(interrupted_at_work(&folder, &args, output, "-INT"), Some(2), "{args:?}");
        assert_eq!(folder.names(), names, "{args:?}");
    }
}

/// What is written in one go is there whole or not at all, whenever the interruption comes.
#[test]
fn a_run_interrupted_at_any_moment_leaves_whole_files_only() {
    let folder = Folder::new("moments");
    let axis = machine("linear_axis.ron");
    let rec = ["simulate", &axis, "--test", "poses", "--random", "1", "--noise", "1um", "-o", "rec.csv"];
    assert!(started(&folder, &rec).wait().expect("a child").success());
    let predict = ["predict", &axis, "rec.csv", "-o", "other.csv"];
    assert!(started(&folder, &predict).wait().expect("a child").success());
    let names = folder.names();
    let runs: [&[&str]; 8] = [
        &["describe", &axis, "rec.csv", "--json", "a.json"],
        &["check", &axis, "--json", "a.json"],
        &["calibrate", &axis, "rec.csv", "-o", "a.ron", "--json", "a.json"],
        &["compare", &axis, "rec.csv", "--json", "a.json"],
        &["predict", &axis, "rec.csv", "-o", "a.csv", "--json", "a.json"],
        &["join", "rec.csv", "other.csv", "--as", "n", "-o", "a.csv", "--json", "a.json"],
        &["diagnose", &axis, "rec.csv", "-o", "a.ron", "--report", "a.html", "--json", "a.json"],
        &["demo", "--report", "a.html", "--json", "a.json"],
    ];
    for args in runs {
        for wait in [0, 5, 15, 40, 100] {
            let run = started(&folder, args);
            std::thread::sleep(Duration::from_millis(wait));
            let ended = stopped(run, "-INT");
            assert!(ended.success() || ended.signal() == Some(2), "{args:?} after {wait} ms: {ended}");
            for name in folder.names().into_iter().filter(|name| !names.contains(name)) {
                assert!(
                    ["a.json", "a.ron", "a.csv", "a.html"].contains(&name.as_str()),
                    "{args:?} leaves {name}"
                );
                let text = folder.read(&name);
                let whole = match &name[2..] {
                    "json" => text.ends_with("}\n"),
                    "ron" => text.ends_with(")\n"),
                    "html" => text.trim_end().ends_with("</html>"),
                    _ => text.ends_with('\n'),
                };
                assert!(whole, "{args:?} after {wait} ms: {name} is a part");
                std::fs::remove_file(folder.0.join(name)).expect("removed");
            }
        }
    }
}

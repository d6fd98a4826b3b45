//! A run that is interrupted leaves nothing of what it was writing.
#![cfg(unix)]

use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::program::{Folder, PROGRAM};

/// A recording of so many rows that writing it outlasts the test.
fn long_run(folder: &Folder) -> Child {
    let machine = Path::new(env!("CARGO_MANIFEST_DIR")).join("machines/ac_table_tilting.ron");
    let mut command = Command::new(PROGRAM);
    command.current_dir(&folder.0).arg("simulate").arg(machine);
    command.args(["--test", "poses", "--count", "100000000", "--noise", "1um", "-o", "rec.csv"]);
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program runs")
}

/// Interrupts a run once it writes; the signal that it ended by.
fn interrupted(folder: &Folder, signal: &str) -> Option<i32> {
    let mut run = long_run(folder);
    let patience = Instant::now() + Duration::from_secs(60);
    while !folder.names().iter().any(|name| name.starts_with("rec.csv.part")) {
        assert!(
            Instant::now() < patience && run.try_wait().expect("a child").is_none(),
            "nothing is written"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    let sent = Command::new("kill").args([signal, &run.id().to_string()]).status().expect("kill runs");
    assert!(sent.success());
    run.wait().expect("a child").signal()
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

//! What a command leaves where its output is named: a whole file, and never a file in the place of something else.
#![cfg(unix)]

use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use crate::program::{Folder, command};

/// A recording of random poses, written to `output`.
fn simulating(output: &Path) -> Child {
    command()
        .args(["simulate", "machines/scara.ron", "--test", "poses", "--random", "1", "-o"])
        .arg(output)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs")
}

fn simulated(output: &Path) {
    let done = simulating(output).wait_with_output().expect("it ends");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}

#[test]
fn a_pipe_stays_a_pipe_and_is_written_to() {
    let folder = Folder::new("pipe");
    let (pipe, plain) = (folder.0.join("pipe"), folder.0.join("plain.csv"));
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo runs").success());
    simulated(&plain);
    let writer = simulating(&pipe);
    let read = std::fs::read(&pipe).expect("read");
    assert!(writer.wait_with_output().expect("it ends").status.success());
    assert_eq!(read, std::fs::read(&plain).expect("read"));
    assert!(std::fs::metadata(&pipe).expect("there").file_type().is_fifo());
    assert_eq!(std::fs::read_dir(&folder.0).expect("a folder").count(), 2, "nothing else is left behind");
}

#[test]
fn a_link_stays_a_link_and_a_file_keeps_who_may_read_it() {
    let folder = Folder::new("link");
    let (file, link) = (folder.0.join("file.csv"), folder.0.join("link.csv"));
    std::fs::write(&file, "old").expect("written");
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o600)).expect("set");
    std::os::unix::fs::symlink("file.csv", &link).expect("linked");
    simulated(&link);
    assert!(std::fs::symlink_metadata(&link).expect("there").is_symlink());
    let there = std::fs::metadata(&file).expect("there");
    assert!(there.len() > 100 && there.permissions().mode() & 0o777 == 0o600);
}

#[test]
fn samples_beyond_memory_go_to_a_file_of_which_nothing_is_left() {
    let folder = Folder::new("spool");
    let rec = folder.0.join("rec.csv");
    let made = command()
        .args(["simulate", "machines/scara.ron", "--test", "poses", "--random", "1", "--count", "200", "-o"])
        .arg(&rec)
        .output()
        .expect("it runs");
    assert!(made.status.success());
    let calibrate = |memory: &str, temporary: &Path| {
        let run = command()
            .args(["calibrate", "machines/scara.ron", "--memory", memory])
            .arg(&rec)
            .env("TMPDIR", temporary)
            .output()
            .expect("it runs");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (run.status.code(), text(&run.stdout), text(&run.stderr))
    };
    let temporary = folder.0.join("temporary");
    std::fs::create_dir(&temporary).expect("a folder");
    let in_memory = calibrate("128", &temporary);
    assert_eq!(in_memory.0, Some(0), "{}", in_memory.2);
    assert_eq!(calibrate("0", &temporary), in_memory);
    assert_eq!(std::fs::read_dir(&temporary).expect("a folder").count(), 0, "nothing is left behind");
    let (status, _, error) = calibrate("0", &temporary.join("nowhere"));
    assert_eq!(status, Some(1));
    assert!(error.contains("samples that memory has no room for cannot be written here"), "{error}");
    assert!(
        error.contains("= keep more in memory (`--memory MB`), or let the variable TMPDIR name"),
        "{error}"
    );
}

//! What a call reads is never overwritten by what it writes, whatever the command and however the file is spelled.

use std::process::Command;

use crate::program::{Folder, PROGRAM, err};

/// Arguments of a command that name files; what is read by position stands first, and in order.
struct Row {
    command: &'static str,
    /// What the call needs besides.
    besides: &'static [&'static str],
    reads: &'static [&'static str],
    writes: &'static [&'static str],
}

const fn row(
    command: &'static str,
    besides: &'static [&'static str],
    reads: &'static [&'static str],
    writes: &'static [&'static str],
) -> Row {
    Row { command, besides, reads, writes }
}

const TABLE: [Row; 20] = [
    row("describe", &[], &["MACHINE.ron", "REC.csv"], &["--json"]),
    row("check", &[], &["MACHINE.ron"], &["--json"]),
    row("calibrate", &[], &["MACHINE.ron", "REC.csv"], &["--output", "--report", "--json"]),
    row("normal", &[], &["MACHINE.ron", "REC.csv", "--at"], &["--output", "--json"]),
    row("merge", &[], &["PART.ron"], &["--output", "--json"]),
    row("compare", &[], &["MACHINE.ron", "REC.csv", "--judge", "--truth"], &["--json"]),
    row("predict", &[], &["CALIBRATED.ron", "REC.csv", "BESIDE.csv"], &["--output", "--json"]),
    row("join", &["--as", "n"], &["REC.csv", "OTHER.csv"], &["--output", "--json"]),
    row(
        "diagnose",
        &[],
        &["MACHINE.ron", "REC.csv", "--effects"],
        &["--output", "--report", "--propose", "--json"],
    ),
    row(
        "compensate",
        &[],
        &["CALIBRATED.ron", "PROGRAM.nc", "--setup", "--m-codes"],
        &["--output", "--report", "--json"],
    ),
    row(
        "verify",
        &[],
        &["PROGRAM.nc", "COMPENSATED.nc", "CALIBRATED.ron", "--setup", "--m-codes"],
        &["--json"],
    ),
    row(
        "simulate",
        &["--test", "path"],
        &["MACHINE.ron", "--input", "--faults"],
        &["--output", "--nc", "--truth", "--json"],
    ),
    row("new", &[], &["--joints"], &["--output", "--json"]),
    row("import", &[], &["FILE", "--hal"], &["--output", "--json"]),
    row("convert", &[], &["FILE", "--machine", "--map", "--path"], &["--write-map", "--output", "--json"]),
    row("export", &["--to", "urdf"], &["CALIBRATED.ron", "--base-file"], &["--output", "--json"]),
    row("machines", &[], &[], &["--json"]),
    row("completions", &["bash"], &[], &[]),
    row("man", &[], &[], &[]),
    row("demo", &[], &[], &["--report", "--json"]),
];

impl Row {
    /// A run whose arguments name the files `in0`, `in1`, ... and what `written` says.
    fn run(&self, folder: &Folder, written: &[(&str, &str)]) -> (Option<i32>, String, Vec<u8>) {
        let mut command = Command::new(PROGRAM);
        command.current_dir(&folder.0).arg(self.command).args(self.besides);
        for (i, name) in self.reads.iter().enumerate() {
            command.args(name.starts_with("--").then_some(name)).arg(format!("in{i}"));
        }
        for (name, path) in written {
            command.args([name, path]);
        }
        // What a command cannot do without.
        let needs_output =
            ["normal", "merge", "join", "simulate", "new", "import", "convert"].contains(&self.command);
        if needs_output && written.iter().all(|(name, _)| *name != "--output") {
            command.args(["--output", "elsewhere"]);
        }
        let output = command.output().expect("it runs");
        (output.status.code(), err(&output), output.stdout)
    }

    /// A folder with files to read, each with its own text, a link to each, and a folder.
    fn folder(&self) -> Folder {
        let folder = Folder::new("apart");
        std::fs::create_dir(folder.0.join("sub")).expect("a folder");
        for i in 0..self.reads.len() {
            folder.write(&format!("in{i}"), &format!("text {i}"));
            #[cfg(unix)]
            std::os::unix::fs::symlink(format!("in{i}"), folder.0.join(format!("link{i}"))).expect("linked");
        }
        folder
    }

    fn is_as_it_was(&self, folder: &Folder, names: &[String]) {
        assert_eq!(folder.names(), names, "{}", self.command);
        for i in 0..self.reads.len() {
            assert_eq!(folder.read(&format!("in{i}")), format!("text {i}"), "{}", self.command);
        }
    }
}

/// Spellings of one file, the last two of them through links.
fn spellings(name: &str, i: usize) -> Vec<String> {
    let mut all = vec![name.to_string(), format!("./{name}"), format!("sub/../{name}")];
    if cfg!(unix) {
        all.extend([format!("link{i}"), format!("./sub/../link{i}")]);
    }
    all
}

#[test]
fn no_output_overwrites_an_input() {
    for row in &TABLE {
        let folder = row.folder();
        let names = folder.names();
        for (i, read) in row.reads.iter().enumerate() {
            for written in row.writes {
                for spelling in spellings(&format!("in{i}"), i) {
                    let (status, message, out) = row.run(&folder, &[(written, &spelling)]);
                    assert_eq!(
                        (status, out.len()),
                        (Some(1), 0),
                        "{} {written} {spelling}: {message}",
                        row.command
                    );
                    let says =
                        format!("error: {spelling}: {written} would overwrite {read}, which the call reads");
                    assert!(message.starts_with(&says), "{}: {message}", row.command);
                    assert!(message.contains(&format!("\n  = give {written} another name")), "{message}");
                    row.is_as_it_was(&folder, &names);
                }
            }
        }
    }
}

#[test]
fn no_two_outputs_have_one_name() {
    for row in &TABLE {
        let folder = row.folder();
        let names = folder.names();
        for (i, one) in row.writes.iter().enumerate() {
            for other in &row.writes[..i] {
                for spelling in ["out", "./out", "sub/../out"] {
                    let (status, message, _) = row.run(&folder, &[(other, "out"), (one, spelling)]);
                    assert_eq!(status, Some(1), "{} {one} {other}: {message}", row.command);
                    assert!(message.contains("two outputs have this name"), "{message}");
                    assert!(
                        [one, other].iter().all(|name| message.contains(**name)),
                        "{one} {other}: {message}"
                    );
                    assert!(message.contains("\n  = give --"), "{message}");
                    row.is_as_it_was(&folder, &names);
                }
            }
        }
    }
}

/// Options of a command that take a file, and what stands before them, as its help shows them.
fn files_in_help(command: &str) -> Vec<String> {
    let help = crate::program::done(&[command, "--help"]);
    let is_file = |name: &str| {
        [".ron", ".csv", ".nc", ".html", ".urdf"].iter().any(|end| name.ends_with(end))
            || name.starts_with("FILE")
    };
    let mut found: Vec<String> = Vec::new();
    for line in help.lines().map(str::trim_start).filter(|line| line.starts_with(['-', '<', '['])) {
        let names = line.split(['<', '>', '[', ']']).skip(1).step_by(2);
        if let Some(name) = names.clone().find(|name| is_file(name)) {
            let option = line.split([' ', ',']).find(|word| word.starts_with("--"));
            found.push(option.unwrap_or(name).to_string());
        }
    }
    found
}

#[test]
fn every_command_and_every_file_it_takes_is_in_the_table() {
    let help = crate::program::done(&["--help"]);
    let commands = help.lines().skip_while(|line| !line.starts_with("Commands:")).skip(1);
    let commands: Vec<&str> =
        commands.map_while(|line| line.split_whitespace().next()).filter(|name| *name != "help").collect();
    assert_eq!(commands.len(), TABLE.len(), "{commands:?}");
    for command in commands {
        let row = TABLE.iter().find(|row| row.command == command).unwrap_or_else(|| panic!("{command}"));
        let mut known: Vec<&str> = row.reads.iter().chain(row.writes).copied().collect();
        let mut found = files_in_help(command);
        known.sort_unstable();
        found.sort_unstable();
        assert_eq!(found, known, "{command}");
    }
}

#[cfg(unix)]
#[test]
fn what_is_no_file_may_be_named_twice() {
    let folder = Folder::new("null");
    let rec = folder.path("rec.csv");
    let machine = "machines/linear_axis.ron";
    let simulated = ["simulate", machine, "--test", "poses", "--random", "1", "-o", &rec];
    crate::program::done(&simulated);
    crate::program::done(&["calibrate", machine, &rec, "-o", "/dev/null", "--json", "/dev/null"]);
}

#[test]
fn numbered_recordings_overwrite_no_input_either() {
    let folder = Folder::new("numbered");
    std::fs::copy("machines/xyz_mill.ron", folder.0.join("rec_2.csv")).expect("copied");
    let machine = folder.path("rec_2.csv");
    let rec = folder.path("rec.csv");
    let plane = ["--test", "circle", "--plane", "x,y", "--length", "100mm,150mm"];
    let all: Vec<&str> = ["simulate", &machine].into_iter().chain(plane).chain(["-o", &rec]).collect();
    let message = crate::program::fails(1, &all);
    assert!(message.contains("rec_2.csv: --output would overwrite MACHINE.ron"), "{message}");
    assert_eq!(folder.names(), ["rec_2.csv"]);
}

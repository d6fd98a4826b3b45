//! Standard output that cannot take what is printed, and paths that are no UTF-8.
#![cfg(target_os = "linux")]

use std::ffi::{OsStr, OsString};
use std::fs::OpenOptions;
use std::io::Write;
use std::os::unix::ffi::OsStrExt;
use std::process::{Command, Stdio};

use crate::program::{Folder, PROGRAM, command};

/// Calls of every command, in this order: what earlier ones write, later ones read. `@` stands before what is a file of the folder.
const CALLS: [&str; 11] = [
    "simulate @m.ron --test path --input @table.csv --random 1 --noise 1um --faults @faults.ron -o @rec.csv --nc @part.nc --truth @true.ron",
    "describe @m.ron @rec.csv",
    "check @m.ron --poses 2",
    "calibrate @m.ron @rec.csv -o @cal.ron",
    "predict @cal.ron @rec.csv -o @out.csv",
    "join @rec.csv @out.csv --as n -o @joined.csv",
    "compare @m.ron @rec.csv --judge @rec.csv --truth @true.ron --rivals declared,local",
    "compensate @cal.ron @part.nc --setup @setup.ron -o @corrected.nc",
    "verify @part.nc @corrected.nc @cal.ron --setup @setup.ron --tolerance 1mm",
    "diagnose @m.ron @rec.csv --effects @effects.ron -o @found.ron --report @page.html",
    "demo --report @demo.html",
];

/// From here on calls take seconds.
const SLOW: usize = 9;

/// Ends of the names of what the calls write.
const WRITTEN: [&str; 10] = [
    "rec.csv",
    "part.nc",
    "true.ron",
    "cal.ron",
    "out.csv",
    "joined.csv",
    "corrected.nc",
    "found.ron",
    "page.html",
    "demo.html",
];

/// A folder with what the calls read; names begin with `start`.
fn folder(start: &[u8]) -> Folder {
    let folder = Folder::new("streams");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.0.join(named(start, name)), text).expect("written");
    };
    write("m.ron", &std::fs::read_to_string("machines/linear_axis.ron").expect("a machine"));
    let table: String =
        (0..60).map(|k| format!("{}\n", 250.0 + 240.0 * (f64::from(k) / 7.0).sin())).collect();
    write("table.csv", &format!("x[mm]\n{table}"));
    write(
        "faults.ron",
        "Faults(units: (length: um, angle: urad), deviations: [(frame: \"x\", v: (1, 0, 0), w: (0, 0, 0))])",
    );
    write("setup.ron", "Setup(tools: {\"1\": 50})");
    write("effects.ron", &std::fs::read_to_string("tests/effects/foreign.ron").expect("a library"));
    folder
}

fn named(start: &[u8], name: &str) -> OsString {
    let mut whole = OsStr::from_bytes(start).to_os_string();
    whole.push(name);
    whole
}

/// Arguments of a call.
fn arguments(call: &str, start: &[u8]) -> Vec<OsString> {
    let words = call.split(' ');
    words.map(|word| word.strip_prefix('@').map_or_else(|| word.into(), |name| named(start, name))).collect()
}

#[test]
fn every_command_takes_and_gives_files_whose_names_are_no_utf_8() {
    let start = b"\xff\xfe ";
    let folder = folder(start);
    for call in CALLS {
        let name = call.split(' ').next().unwrap_or_default();
        let json = named(start, &format!("{name}.json"));
        let mut run = Command::new(PROGRAM);
        run.current_dir(&folder.0).args(arguments(call, start)).arg("--json").arg(&json);
        let output = run.output().expect("it runs");
        assert!(output.status.success(), "{call}: {}", String::from_utf8_lossy(&output.stderr));
        let text = std::fs::read_to_string(folder.0.join(json)).expect("its JSON");
        serde_json::from_str::<serde_json::Value>(&text).unwrap_or_else(|e| panic!("{call}: {e}"));
    }
    for name in WRITTEN {
        let file = folder.0.join(named(start, name));
        assert!(std::fs::metadata(&file).is_ok_and(|it| it.len() > 20), "{name}");
    }
}

#[test]
fn a_message_about_a_file_whose_name_is_no_utf_8_is_told() {
    let start = b"\xff";
    let folder = folder(start);
    let mut run = Command::new(PROGRAM);
    run.current_dir(&folder.0)
        .args(arguments("simulate @m.ron --test circle --length 1mm,2mm -o @m.ron", start));
    let output = run.output().expect("it runs");
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("m.ron: --output would overwrite MACHINE.ron"));
}

/// Runs calls whose standard output is full; `status` of each, and the message where that is not 0.
fn printed_in_vain(folder: &Folder, calls: impl IntoIterator<Item = impl AsRef<str>>, status: i32) {
    for call in calls {
        let call = call.as_ref();
        let full = OpenOptions::new().write(true).open("/dev/full").expect("Linux has it");
        let mut run = Command::new(PROGRAM);
        run.current_dir(&folder.0).args(arguments(call, b"")).stdout(full);
        let output = run.output().expect("it runs");
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(status), "{call}: {message}");
        if status > 0 {
            let says = "error: standard output cannot be written: No space left";
            assert!(message.contains(says) && message.contains("\n  = "), "{call}: {message}");
        }
    }
}

#[test]
fn full_standard_output_is_told_by_every_command() {
    let folder = folder(b"");
    printed_in_vain(&folder, &CALLS[..SLOW], 1);
    // JSON goes the same way from all of them.
    printed_in_vain(&folder, CALLS[1..4].iter().map(|call| format!("{call} --json -")), 1);
    printed_in_vain(&folder, ["--help", "--version", "help", "calibrate --help"], 1);
    // Nothing was to be printed.
    printed_in_vain(&folder, CALLS[..4].iter().map(|call| format!("{call} --quiet")), 0);
}

#[test]
#[ignore = "long: two diagnoses"]
fn full_standard_output_is_told_by_commands_that_diagnose() {
    let folder = folder(b"");
    printed_in_vain(&folder, &CALLS[..1], 1);
    printed_in_vain(&folder, &CALLS[SLOW..], 1);
}

#[test]
fn a_reader_that_has_seen_enough_is_no_fault() {
    let mut run = command()
        .args(["describe", "machines/linear_axis.ron"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    drop(run.stdout.take());
    let output = run.wait_with_output().expect("it ends");
    assert!(
        output.status.success() && output.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// Runs a call with this on its standard input, temporary files in the folder; status, standard output, standard error.
fn piped(folder: &Folder, call: &str, input: &[u8]) -> (Option<i32>, Vec<u8>, String) {
    let mut run = Command::new(PROGRAM);
    run.current_dir(&folder.0).args(call.split(' ')).env("TMPDIR", &folder.0);
    let streams = run.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = streams.spawn().expect("it runs");
    // A call that is refused does not read it.
    let _ = child.stdin.take().expect("piped").write_all(input);
    let output = child.wait_with_output().expect("it ends");
    (output.status.code(), output.stdout, String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn a_dash_is_standard_input_and_standard_output() {
    let folder = folder(b"");
    let simulate = "simulate m.ron --test path --input table.csv --random 1 --noise 1um -o";
    let done = |call: &str, input: &[u8]| {
        let (status, out, err) = piped(&folder, call, input);
        assert_eq!((status, &*err), (Some(0), ""), "{call}");
        out
    };
    done(&format!("{simulate} rec.csv"), b"");
    done("calibrate m.ron rec.csv -o cal.ron --json cal.json", b"");
    let before = folder.names();
    let recording = done(&format!("{simulate} -"), b"");
    assert_eq!(recording, folder.read("rec.csv").into_bytes());
    assert_eq!(done("calibrate m.ron - -o -", &recording), folder.read("cal.ron").into_bytes());
    let json = done("calibrate m.ron - --json -", &recording);
    let [own, of_file] = [&json, folder.read("cal.json").as_bytes()].map(|text| {
        let value: serde_json::Value = serde_json::from_slice(text).expect("JSON");
        value["rms_m"].clone()
    });
    assert!(own == of_file && own.is_object(), "{own}");
    let machine = folder.read("m.ron");
    assert_eq!(done("describe -", machine.as_bytes()), done("describe m.ron", b""));
    assert_eq!(folder.names(), before, "nothing of it stays");
}

#[test]
fn what_is_wrong_with_standard_input_and_output_is_told() {
    let folder = folder(b"");
    let text = "# measurement: joint\nx[mm],x_meas[furlong]\n0,0\n";
    let (status, out, err) = piped(&folder, "calibrate m.ron - -o -", text.as_bytes());
    assert_eq!((status, out), (Some(1), Vec::new()));
    assert!(err.starts_with("error: standard input:2:2: column `x_meas` has unit `furlong`"), "{err}");
    let (status, _, err) = piped(&folder, "calibrate - - -o cal.ron", b"");
    assert_eq!(status, Some(2));
    assert!(err.contains("standard input is one file, and another argument reads it already"), "{err}");
    let (status, _, err) = piped(&folder, "calibrate m.ron - -o - --json -", text.as_bytes());
    assert_eq!(status, Some(1));
    assert!(err.starts_with("error: -: two outputs have this name, --"), "{err}");
    printed_in_vain(&folder, ["simulate m.ron --test poses -o - --quiet"], 1);
}

#[test]
fn an_output_that_is_full_is_told_by_name() {
    let folder = folder(b"");
    for call in ["simulate m.ron --test poses -o /dev/full", "describe m.ron --json /dev/full"] {
        let output =
            Command::new(PROGRAM).current_dir(&folder.0).args(call.split(' ')).output().expect("it runs");
        assert_eq!(output.status.code(), Some(1), "{call}");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(message.contains("error: /dev/full: cannot be written: No space left"), "{call}: {message}");
    }
}

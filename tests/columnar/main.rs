//! Tables in columns: what other programs have written, recordings there and back, messages for what is at fault.
//!
//! `cargo test --features columnar --test columnar`; `make.py` wrote the files.

#[path = "../common/folder.rs"]
mod folder;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};

use folder::Folder;
use kincal::convert::{Converted, Request, read};
use kincal::recording::{Chunk, Recording, bytes_of};
use kincal::{Error, Machine};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// Names by which a file in columns is written.
const ENDINGS: [&str; 3] = ["parquet", "arrow", "arrows"];

fn project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn machine(name: &str) -> Machine {
    Machine::open(project("machines").join(format!("{name}.ron"))).expect("a machine of the project")
}

/// Files of a folder but for texts and programs, sorted.
fn files(folder: &str) -> Vec<PathBuf> {
    let is_one = |path: &PathBuf| {
        path.extension().is_some_and(|e| !["csv", "py", "rs"].contains(&&*e.to_string_lossy()))
    };
    let entries = std::fs::read_dir(project(folder)).expect("a folder");
    let mut all: Vec<PathBuf> =
        entries.map(|e| e.expect("readable").path()).filter(|p| p.is_file() && is_one(p)).collect();
    all.sort();
    all
}

fn converted(path: &Path, machine: &Machine, request: &Request) -> Result<Converted, Error> {
    read(path, &std::fs::read(path).expect("readable"), Some(machine), request)
}

fn samples(recording: &Recording) -> Result<Vec<Chunk>, Error> {
    recording.chunks()?.collect()
}

/// Samples with every number as its bits, so that zeros have their sign and NaN is NaN.
fn bits(recording: &Recording) -> Vec<String> {
    let of = |numbers: &[f64]| {
        format!("{:?}", numbers.iter().map(|x| if x.is_nan() { 1 } else { x.to_bits() }).collect::<Vec<_>>())
    };
    let chunks = samples(recording).expect("sound");
    chunks
        .iter()
        .map(|c| {
            let all = [&c.commands, &c.values]
                .into_iter()
                .chain(&c.time)
                .chain(c.directions.iter().flatten())
                .chain(&c.channels);
            format!("{} {} {}", c.len, c.dropped, all.map(|numbers| of(numbers)).collect::<String>())
        })
        .collect()
}

#[test]
fn tables_of_other_programs_are_the_recording_that_their_csv_is() {
    let scara = machine("scara");
    let own = |path: &Path, request: &Request| {
        let found = converted(path, &scara, request).unwrap_or_else(|e| panic!("{e}\n  = {}", e.mend()));
        assert_eq!(found.recordings.len(), 1, "{}", path.display());
        let text = found.recordings[0].text.as_bytes();
        Recording::from_bytes("rec.csv", text, &scara).expect("a recording")
    };
    let one = Request::default().with_rows("run", "one");
    let table = project("tests/columnar/table.csv");
    let tables: Vec<PathBuf> =
        files("tests/columnar").into_iter().filter(|p| !p.ends_with("recording.parquet")).collect();
    assert!(tables.len() > 10);
    for path in tables {
        for request in [&Request::default(), &one] {
            let (found, csv) = (own(&path, request), own(&table, request));
            assert_eq!(found.header(), csv.header(), "{}", path.display());
            assert_eq!(bits(&found), bits(&csv), "{}", path.display());
        }
    }
}

/// A file of another program that says what was measured is a recording without being converted.
#[test]
fn metadata_of_another_program_make_a_recording() {
    let axis = machine("linear_axis");
    let path = project("tests/columnar/recording.parquet");
    let text = "# machine: linear_axis\n# measurement: joint\nx[mm],x_meas[um],x_direction[1]\n0.0,0.5,1\n10.0,10003.0,1\n20.0,,-1\n";
    assert_eq!(converted(&path, &axis, &Request::default()).expect("sound").recordings[0].text, text);
    let csv = Recording::from_bytes("rec.csv", text.as_bytes(), &axis).expect("a recording");
    assert_eq!(bits(&Recording::open(&path, &axis).expect("a recording")), bits(&csv));
}

/// Cells as people and programs write them.
fn cell() -> impl Strategy<Value = String> {
    let number = |x: f64| format!("{x:?}");
    prop_oneof![
        8 => (-1e6..1e6).prop_map(number),
        2 => (-1_000i32..1_000).prop_map(|n| format!("{}.{:03}0", n / 10, n.unsigned_abs())),
        1 => any::<i16>().prop_map(|n| format!(" {n}")),
        1 => (-1e-300..1e-300).prop_map(number),
        1 => prop::sample::select(vec!["", "NaN", "-0.0", "1e-5", "\"12.5\"", "+3"]).prop_map(String::from),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 96,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(20261126),
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_recording_in_columns_is_the_same_recording(
        rows in proptest::collection::vec(proptest::collection::vec(cell(), 5), 1..40),
        crlf in any::<bool>(),
        comment in any::<bool>(),
    ) {
        let axis = machine("linear_axis");
        let end = if crlf { "\r\n" } else { "\n" };
        let mut lines = vec!["# made on a Tuesday; 20 °C", "# machine: linear_axis", "#measurement: joint", "# zero: unknown"];
        lines.push("x[mm],\"x_meas[um]\",temperature[degC],u[V],load[1]");
        let rows: Vec<String> = rows.iter().map(|row| row.join(",")).collect();
        for (i, row) in rows.iter().enumerate() {
            lines.extend((comment && i == 1).then_some("# half-way"));
            lines.push(row);
        }
        let text: String = lines.iter().flat_map(|line| [line, end]).collect();
        let csv = Recording::from_bytes("rec.csv", text.as_bytes(), &axis).expect("a recording");
        for ending in ENDINGS {
            let name = format!("rec.{ending}");
            let bytes = bytes_of(&name, &text).expect("numbers");
            prop_assert_eq!(&bytes, &bytes_of(&name, &text).expect("numbers"));
            let found = Recording::from_bytes(&name, bytes.clone(), &axis).expect("a recording");
            prop_assert_eq!(found.header(), csv.header());
            prop_assert_eq!(found.columns(), csv.columns());
            prop_assert_eq!(bits(&found), bits(&csv));
            // Back as text, and once more.
            let again = read(&name, &bytes, None, &Request::default()).expect("a recording").recordings;
            let back = Recording::from_bytes("back.csv", again[0].text.as_bytes(), &axis).expect("a recording");
            prop_assert_eq!(bits(&back), bits(&csv));
            prop_assert_eq!(bytes_of(&name, &again[0].text).expect("numbers"), bytes);
        }
    }
}

/// Every file of `tests/bad/columnar` with what is said of it.
#[test]
fn what_is_no_table_in_columns_is_told_with_its_place_and_mend() {
    let (scara, axis) = (machine("scara"), machine("linear_axis"));
    let mut said = String::new();
    for path in files("tests/bad/columnar") {
        let error = if path.ends_with("recording.parquet") {
            Recording::open(&path, &axis).expect_err("no recording")
        } else {
            converted(&path, &scara, &Request::default()).expect_err(&path.to_string_lossy())
        };
        let folder = format!("{}/", project("tests/bad/columnar").display());
        assert!(!error.mend().is_empty(), "{error}");
        said.push_str(&format!("{error}\n  = {}\n", error.mend()).replace(&folder, ""));
    }
    insta::assert_snapshot!(said);
}

/// Damage shows as it is met, in the middle of a pass too, and is told as in any other file.
#[test]
fn damaged_files_are_refused_or_read_and_end_nothing() {
    let (scara, axis) = (machine("scara"), machine("linear_axis"));
    let recording: String = (0..40).map(|i| format!("{i},{}\n", f64::from(i) * 1000.1)).collect();
    let recording = format!("# measurement: joint\nx[mm],x_meas[um]\n{recording}");
    let mut all: Vec<(PathBuf, Vec<u8>)> = files("tests/columnar")
        .into_iter()
        .map(|p| (p.clone(), std::fs::read(p).expect("readable")))
        .collect();
    all.extend(ENDINGS.map(|e| {
        let name = format!("own.{e}");
        let bytes = bytes_of(&name, &recording).expect("numbers");
        (name.into(), bytes)
    }));
    // Panics of the readers are caught, and no news.
    static CAUGHT: AtomicUsize = AtomicUsize::new(0);
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| match info.location() {
        Some(place) if place.file().contains("/registry/") => {
            CAUGHT.fetch_add(1, Ordering::Relaxed);
        }
        _ => usual(info),
    }));
    let (mut refused, mut sound) = (0, 0);
    let mut judge = |path: &Path, bytes: &[u8], is_cut: bool| {
        let outcomes = [
            read(path, bytes, Some(&scara), &Request::default()).map(drop),
            Recording::from_bytes(&path.to_string_lossy(), bytes, &axis).and_then(|r| r.scan()).map(drop),
        ];
        for outcome in outcomes {
            match outcome {
                Ok(()) => sound += 1,
                Err(error) => {
                    refused += 1;
                    assert!(error.to_string().starts_with(&*path.to_string_lossy()), "{error}");
                    assert!(!error.mend().is_empty(), "{error}");
                }
            }
        }
        assert!(!is_cut || refused > 0);
    };
    let mut state = 20_261_126u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for (path, bytes) in &all {
        for end in (0..bytes.len()).step_by(97) {
            judge(path, &bytes[..end], true);
        }
        for _ in 0..150 {
            let mut bytes = bytes.clone();
            for _ in 0..=random(3) {
                let at = random(bytes.len());
                bytes[at] = match random(3) {
                    0 => 0xff,
                    1 => 0,
                    _ => bytes[at] ^ (1 << random(8)),
                };
            }
            judge(path, &bytes, false);
        }
    }
    println!("{sound} read, {refused} refused, {} panics caught", CAUGHT.load(Ordering::Relaxed));
    assert!(sound > 100 && refused > 1000, "{sound} {refused}");
}

impl Folder {
    /// Runs the program here; its status and what it says of what is wrong.
    fn run(&self, args: &[&str]) -> (Option<i32>, String) {
        let output = Command::new(env!("CARGO_BIN_EXE_kincal")).current_dir(&self.0).args(args).output();
        let output = output.expect("it runs");
        (output.status.code(), String::from_utf8(output.stderr).expect("UTF-8"))
    }

    fn done(&self, args: &[&str]) {
        assert_eq!(self.run(args), (Some(0), String::new()), "{args:?}");
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.0.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }
}

#[test]
fn every_command_takes_a_recording_in_columns_as_the_csv() {
    let folder = Folder::new("columns");
    let machine = project("machines/linear_axis.ron");
    let machine = machine.to_str().expect("UTF-8");
    let there =
        (0..200).map(|i| format!("{},{}\n", f64::from(i) / 10.0, 100.0 * (f64::from(i) / 20.0).sin()));
    let commands = format!("t[s],x[mm]\n{}", there.collect::<String>());
    let test = ["--test", "path", "--input", "commands.csv"];
    std::fs::write(folder.0.join("commands.csv"), commands).expect("written");
    let simulate = ["simulate", machine, "--noise", "1um", "--quiet", "-o", "rec.csv"];
    let (status, says) = folder.run(&[&simulate[..], &test].concat());
    assert_eq!(status, Some(0), "{says}");
    for ending in ENDINGS {
        let rec = format!("rec.{ending}");
        folder.done(&["convert", "rec.csv", "--machine", machine, "-o", &rec]);
        for (command, last) in [("calibrate", "ron"), ("predict", "csv"), ("diagnose", "ron")] {
            let of = |input: &str, output: &str| {
                folder.done(&[command, machine, input, "-o", output, "--json", "out.json", "--quiet"]);
                let json = String::from_utf8(folder.bytes("out.json")).expect("UTF-8");
                json.replace(input, "REC")
            };
            let csv = of("rec.csv", &format!("csv.{last}"));
            assert_eq!(of(&rec, &format!("columns.{last}")), csv, "{command} {ending}");
        }
        // What predict writes in columns is what it writes as text.
        let predicted = format!("predicted.{ending}");
        folder.done(&["predict", machine, &rec, "-o", &predicted, "--quiet"]);
        folder.done(&["convert", &predicted, "-o", "again.csv", "--quiet"]);
        let text = String::from_utf8(folder.bytes("csv.csv")).expect("UTF-8");
        assert_eq!(bytes_of(&predicted, &text).expect("numbers"), folder.bytes(&predicted));
    }
}

#[test]
fn a_file_in_columns_is_written_whole_or_not_at_all() {
    let folder = Folder::new("whole");
    std::fs::write(folder.0.join("out.parquet"), "as it was").expect("written");
    std::fs::write(folder.0.join("rec.csv"), "# measurement: joint\nx[mm],x_meas[um]\n0,1\n1,word\n")
        .expect("written");
    let (status, says) = folder.run(&["convert", "rec.csv", "-o", "out.parquet"]);
    assert_eq!(status, Some(1));
    assert!(
        says.starts_with("error: out.parquet:4:2: `word` in column `x_meas[um]` is no number\n  = "),
        "{says}"
    );
    assert_eq!(folder.bytes("out.parquet"), b"as it was");
    assert_eq!(std::fs::read_dir(&folder.0).expect("there").count(), 2);
}

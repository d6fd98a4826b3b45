//! `kincal compensate` as a user meets it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use kincal::CalibratedMachine;
use kincal::compensate::Setup;
use kincal::simulate::random_deviations;

mod common;

/// A folder of its own for one test, with a calibrated machine and a program in it.
struct Bench(PathBuf);

impl Bench {
    fn new(name: &str, program: &str) -> Bench {
        let folder = std::env::temp_dir().join(format!("kincal_compensate_{name}_{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let machine = common::machine("ac_table_tilting");
        let deviations = random_deviations(&machine, 1.0, 6);
        let calibrated = CalibratedMachine::nominal(machine).with_deviations(deviations);
        std::fs::write(folder.join("machine.ron"), calibrated.to_ron()).expect("writable");
        std::fs::write(folder.join("part.nc"), program).expect("writable");
        Bench(folder)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kincal"));
        command.current_dir(&self.0).arg("compensate").arg("machine.ron").arg("part.nc").args(arguments);
        command.output().expect("the program runs")
    }

    fn read(&self, name: &str) -> Option<String> {
        std::fs::read_to_string(self.0.join(name)).ok()
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

const PROGRAM: &str = "G21 G90\nG0 X10 Y20 Z30 A40 C50\nG1 X60 F500 (cut)\nM30\n";

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn the_corrected_program_and_its_report_are_written() {
    let bench = Bench::new("whole", PROGRAM);
    let out = bench.run(&["-o", "out.nc", "--json", "out.json"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let said = text(&out.stdout);
    for part in ["4 lines, 2 moves", "axis words corrected", "largest correction: tip", "written to out.nc"] {
        assert!(said.contains(part), "{part}\n{said}");
    }
    let written = bench.read("out.nc").expect("written");
    assert!(written.contains(" F500 (cut)\nM30\n") && written != PROGRAM, "{written}");
    let json: serde_json::Value =
        serde_json::from_str(&bench.read("out.json").expect("written")).expect("JSON");
    assert_eq!(json["moves"], 2);
    assert!(json["largest_left_m"]["value"].as_f64().expect("a number") < 1e-6);
    assert!(json["unseen"].is_null() && json["singular"]["count"] == 0);
}

#[test]
fn a_refused_program_leaves_nothing_behind() {
    let bench = Bench::new("refused", "G0 X1 Y2 Z3 A4 C5\nG2 X5 I2 J1\n");
    let out = bench.run(&["-o", "out.nc"]);
    assert_eq!(out.status.code(), Some(1));
    let said = text(&out.stderr);
    assert!(said.contains("part.nc:2:") && said.contains("  = "), "{said}");
    assert!(bench.read("out.nc").is_none());
    let left = std::fs::read_dir(&bench.0).expect("readable").count();
    assert_eq!(left, 2);
}

#[test]
fn a_program_is_not_corrected_onto_itself() {
    let bench = Bench::new("itself", PROGRAM);
    let out = bench.run(&["-o", "part.nc"]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains("one of the inputs"), "{}", text(&out.stderr));
    assert_eq!(bench.read("part.nc").as_deref(), Some(PROGRAM));
}

#[test]
fn a_tolerance_needs_its_unit() {
    let bench = Bench::new("unit", PROGRAM);
    let out = bench.run(&["--arcs", "0.002"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("unit"), "{}", text(&out.stderr));
}

#[test]
fn the_set_up_of_the_documents_reads_as_it_stands() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/compensate.md");
    let page = std::fs::read_to_string(page).expect("the page");
    let examples: Vec<&str> =
        page.split("```ron\n").skip(1).filter_map(|part| part.split("```").next()).collect();
    assert_eq!(examples.len(), 1);
    for example in examples {
        Setup::parse("docs/compensate.md", example).unwrap_or_else(|e| panic!("{e}: {}", e.mend()));
    }
    let wrong = Setup::parse("setup.ron", "Setup(tool: {})").expect_err("a misspelt field");
    assert!(wrong.to_string().starts_with("setup.ron:1:"), "{wrong}");
}

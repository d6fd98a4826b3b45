//! `kincal compensate` as a user meets it.

use std::path::Path;
use std::process::Output;

use crate::common;
use crate::program::{Folder, command};
use kincal::CalibratedMachine;
use kincal::compensate::Setup;
use kincal::identify::{CalibrateOptions, ErrorModel, calibrate_model};
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{
    Claims, CommandTable, Faults, Instrument, Plant, Run, Style, random_deviations, recordings,
};
use kincal::variation::{Directions, Varying};

/// A folder of its own for one test, with a calibrated machine and a program in it.
struct Bench(Folder);

impl Bench {
    fn new(name: &str, program: &str) -> Bench {
        let folder = Folder::new(name);
        let machine = common::machine("ac_table_tilting");
        let deviations = random_deviations(&machine, 1.0, 6);
        let calibrated = CalibratedMachine::nominal(machine).with_deviations(deviations);
        folder.write("machine.ron", &calibrated.to_ron());
        folder.write("part.nc", program);
        Bench(folder)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = command();
        command
            .current_dir(self.0.path(""))
            .arg("compensate")
            .arg("machine.ron")
            .arg("part.nc")
            .args(arguments);
        command.output().expect("the program runs")
    }

    fn read(&self, name: &str) -> Option<String> {
        std::fs::read_to_string(self.0.0.join(name)).ok()
    }
}

const PROGRAM: &str = "G21 G90\nG0 X10 Y20 Z30 A40 C50\nG1 X60 F500 (cut)\nM30\n";

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn a_program_without_a_word_of_the_machine_is_told() {
    let told = |program: &str| {
        let out = Bench::new("other_words", program).run(&["-o", "out.nc"]);
        assert!(out.status.success(), "{}", text(&out.stderr));
        text(&out.stdout)
    };
    let said = told("G21 G90\nM5\nM30\n");
    assert!(
        said.contains("no block moves an axis of ac_table_tilting: its words are A, C, Y, X, Z"),
        "{said}"
    );
    assert!(!told(PROGRAM).contains("no block moves"));
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
    let left = std::fs::read_dir(&bench.0.0).expect("readable").count();
    assert_eq!(left, 2);
}

#[test]
fn a_program_is_not_corrected_onto_itself() {
    let bench = Bench::new("itself", PROGRAM);
    let out = bench.run(&["-o", "part.nc"]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains("would overwrite PROGRAM.nc"), "{}", text(&out.stderr));
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

#[test]
fn reversals_and_directions_never_seen_are_told_with_their_lines() {
    let bench =
        Bench::new("pieces", "G21 G90\nG0 X10 Y20 Z30 A40 C50\nG1 X60 F500\nC40\nA30\nA50\nC41\nM30\n");
    let machine = common::machine("ac_table_tilting");
    let faults = "Faults(units: (length: um, angle: urad), backlash: [(joint: \"a\", width: 60), (joint: \"c\", width: 40)])";
    let faults = Faults::parse("faults.ron", faults, &machine).unwrap_or_else(|e| panic!("{e}"));
    let plant = Plant::new(&CalibratedMachine::nominal(machine.clone())).with_faults(&faults);
    // Settled positions, never with both axes from below.
    let mut table = String::from("a[deg],c[deg],y[mm],x[mm],z[mm],a_direction[1],c_direction[1]\n");
    for k in 0..120 {
        let s = f64::from(k);
        let (a, c) = [(1, -1), (-1, 1), (-1, -1)][k as usize % 3];
        let at = [
            60.0 * s.sin(),
            3.1 * s,
            200.0 * (1.7 * s).sin(),
            200.0 * (2.3 * s).cos(),
            90.0 * (0.9 * s).sin(),
        ];
        let at = at.map(|x| format!("{x:.3}")).join(",");
        table.push_str(&format!("{at},{a},{c}\n"));
    }
    std::fs::write(bench.0.0.join("poses.csv"), table).expect("writable");
    let course =
        CommandTable::open(bench.0.0.join("poses.csv"), &machine, 1.0).unwrap_or_else(|e| panic!("{e}"));
    let run = Run {
        course: Box::new(course),
        instrument: Instrument::new(Sensor::Pose, 1e-7, 1e-6),
        claims: Claims::default(),
        directions: true,
    };
    let texts = recordings(&plant, &[run], &Style::si(), 1).unwrap_or_else(|e| panic!("{e}"));
    let measured =
        Recording::from_bytes("rec.csv", texts[0].as_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"));
    let axes = ["a", "c"].map(|name| machine.commands().iter().position(|c| c == name).expect("an axis"));
    let varying = Varying { directions: Some(Directions::new(axes.to_vec())), terms: Vec::new() };
    let model = ErrorModel::default().with_varying(varying);
    let (calibrated, _) =
        calibrate_model(&machine, &[measured], &model, CalibrateOptions::default(), &|_| {})
            .unwrap_or_else(|e| panic!("{e}"));
    std::fs::write(bench.0.0.join("machine.ron"), calibrated.to_ron()).expect("writable");
    let out = bench.run(&["-o", "out.nc", "--json", "out.json", "--max-step", "8um"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let said = text(&out.stdout);
    // Where the machine came from before line 2 is not known: the direction of each axis' first motion, C down in line 4 and A down in
    // line 5, holds before it. 6: A up; 7: C up, A still as it came.
    let parts = [
        "at 2 blocks where a direction of travel changes",
        "lines 6, 7",
        "from where a, c comes at line 2 is not known; taken is the direction of its first motion",
        "at 1 block the axes travel in a pattern of directions that the calibration has not seen (AFCF)",
        "have shown: line 7",
        "larger than --max-step are the steps at 1 block: line 7",
    ];
    for part in parts {
        assert!(said.contains(part), "{part}\n{said}");
    }
    let json: serde_json::Value =
        serde_json::from_str(&bench.read("out.json").expect("written")).expect("JSON");
    // A turns round in line 6, with a play of 60 urad.
    let step = json["reversals"]["first"][0]["step_rad"].as_f64().expect("a number");
    assert!((step - 60e-6).abs() < 6e-6, "{json}");
    assert_eq!(json["unseen_directions"]["first"][0], serde_json::json!({"line": 7, "piece": "AFCF"}));
}

#[test]
fn what_is_written_is_proved_and_what_was_not_corrected_is_not() {
    let bench = Bench::new("verify", PROGRAM);
    assert!(bench.run(&["-o", "out.nc"]).status.success());
    let verify = |written: &str| {
        let arguments = ["verify", "part.nc", written, "machine.ron", "--json", "found.json"];
        command().current_dir(bench.0.path("")).args(arguments).output().expect("the program runs")
    };
    let out = verify("out.nc");
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(text(&out.stdout).starts_with("2 moves, 2 judged\n"), "{}", text(&out.stdout));
    let out = verify("part.nc");
    assert_eq!(out.status.code(), Some(1));
    assert!(
        text(&out.stderr).contains("part.nc: 2 moves not where part.nc means it"),
        "{}",
        text(&out.stderr)
    );
    let found: serde_json::Value =
        serde_json::from_str(&bench.read("found.json").expect("written")).expect("JSON");
    assert_eq!(found["departures"]["first"][1]["line"], 3, "{found}");
}

#[test]
fn what_an_m_code_moves_is_taken_from_a_file() {
    let bench = Bench::new("m_codes", "G21 G90\nG0 X10. Y20. Z30. A40. C50.\nM170\nG1 X60. F500\nM30\n");
    let refused = bench.run(&["-o", "out.nc"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("part.nc:4:1"), "{}", text(&refused.stderr));
    bench.0.write("codes.ron", "{\"M170\": []}");
    let out = bench.run(&["-o", "out.nc", "--m-codes", "codes.ron"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
}

#[test]
fn what_was_written_is_read_anew_and_marked() {
    let bench = Bench::new("mark", PROGRAM);
    let out = bench.run(&["-o", "out.nc", "--json", "out.json"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(
        text(&out.stdout).contains("read anew: 2 moves judged, the tip at most "),
        "{}",
        text(&out.stdout)
    );
    let json: serde_json::Value =
        serde_json::from_str(&bench.read("out.json").expect("written")).expect("JSON");
    assert_eq!(json["verification"]["judged"], 2, "{json}");
    assert!(json["verdict"].as_str().is_some_and(|v| v.contains(" is left, says the model")), "{json}");
    assert_eq!(json["verification"]["departures"]["count"], 0, "{json}");
    let written = bench.read("out.nc").expect("written");
    assert!(written.lines().last().is_some_and(|line| line.starts_with("(KINCAL ")), "{written}");
    // The mark names what the program was, and once is enough.
    bench.0.write("part.nc", &written);
    let again = bench.run(&["-o", "again.nc"]);
    assert_eq!(again.status.code(), Some(1));
    let said = text(&again.stderr);
    assert!(
        said.contains(
            "part.nc:5:1: this program is compensated already, for this machine and with this model"
        ),
        "{said}"
    );
    assert!(bench.read("again.nc").is_none());
    assert!(bench.run(&["-o", "again.nc", "--force", "--no-verify"]).status.success());
    let verify = command()
        .current_dir(bench.0.path(""))
        .args(["verify", "part.nc", "out.nc", "machine.ron"])
        .output()
        .expect("the program runs");
    assert_eq!(verify.status.code(), Some(1));
    assert!(text(&verify.stderr).contains("out.nc:5:1: this program was written from another program"));
}

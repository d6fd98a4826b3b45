//! `kincal simulate` as its users meet it, and files that it refuses.

use std::path::{Path, PathBuf};
use std::process::Output;

use crate::common;
use crate::program::{Folder, command};
use insta::assert_snapshot;
use kincal::lie::Vec3;
use kincal::recording::Recording;
use kincal::simulate::{At, CommandTable, Course, Drive, Faults, PartProgram, Sample, rest};
use kincal::{CalibratedMachine, Chain, Machine};
use proptest::prelude::*;

fn kincal(args: &[&str]) -> Output {
    command().arg("simulate").args(args).output().expect("it runs")
}

/// Standard output of a run that must succeed; the folder's path is left out.
fn done(folder: &Folder, args: &[&str]) -> String {
    let output = kincal(args);
    let err = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), err.as_str()), (Some(0), ""), "{args:?}");
    folder.without_path(&output.stdout)
}

/// Standard error of a run that must be refused, and leave nothing behind.
fn refused(folder: &Folder, args: &[&str]) -> String {
    let output = kincal(args);
    assert_eq!(output.status.code(), Some(1), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stdout.is_empty());
    assert!(!folder.0.join("rec.csv").exists(), "{args:?} leaves a recording");
    folder.without_path(&output.stderr)
}

#[test]
fn a_cone_a_circle_and_poses_are_summed_up() {
    let folder = Folder::new("summary");
    let out = folder.path("rec.csv");
    let cone =
        ["machines/ac_table_tilting.ron", "--test", "BK4", "--random", "1", "--noise", "0.5um", "-o", &out];
    let circle = [
        "machines/xyz_mill.ron",
        "--test",
        "circle",
        "--plane",
        "x,y",
        "--length",
        "100mm,150mm",
        "--feed",
        "500mm/min,2000mm/min",
        "--height",
        "0mm,50mm",
        "--drop-outs",
        "0.01",
        "-o",
        &out,
    ];
    let poses = [
        "machines/ur10.ron",
        "--test",
        "poses",
        "--count",
        "50",
        "--measure",
        "pose",
        "--noise",
        "0.1mm",
        "-o",
        &out,
    ];
    assert_snapshot!([&cone[..], &circle, &poses].map(|args| done(&folder, args)).join("\n"));
    let machine = common::machine("xyz_mill");
    for i in 1..=4 {
        let recording =
            Recording::open(folder.path(&format!("rec_{i}.csv")), &machine).unwrap_or_else(|e| panic!("{e}"));
        let summary = recording.scan().unwrap_or_else(|e| panic!("{e}"));
        assert!(summary.warnings.is_empty() && summary.dropped > 50, "{:?}", summary.warnings);
    }
}

#[test]
fn what_is_written_is_a_recording_and_a_result() {
    let folder = Folder::new("result");
    let args = [
        "machines/bc_head_table.ron",
        "--test",
        "ck2",
        "--from",
        "0deg",
        "--to",
        "20deg",
        "--step",
        "10deg",
        "--length",
        "50mm",
        "--ball",
        "0,0,20mm",
        "--tool-point",
        "0,0,-5mm",
        "--setup",
        "table",
        "--sigma",
        "1um",
        "--dwell",
        "10ms",
        "-o",
        &folder.path("rec.csv"),
        "--json",
        "-",
    ];
    let result: serde_json::Value = serde_json::from_str(&done(&folder, &args)).expect("JSON");
    assert_snapshot!(folder.read("rec.csv"));
    let keys: Vec<&String> = result.as_object().expect("an object").keys().collect();
    assert_eq!(keys, ["deviations", "machine", "recordings", "seed", "test", "varies"]);
    let recording = &result["recordings"][0];
    assert_eq!((&result["test"], &recording["samples"]), (&"CK2".into(), &8.into()));
    assert_eq!(recording["nominal_length_m"], 0.05);
    let c = recording["travel"]
        .as_array()
        .expect("axes")
        .iter()
        .find(|axis| axis["joint"] == "c")
        .expect("an axis");
    assert!((c["to"].as_f64().expect("rad") - 20f64.to_radians()).abs() < 1e-12);
    assert_eq!(result["deviations"].as_array().expect("frames").len(), 7);
}

#[test]
fn what_cannot_be_run_is_refused_with_the_reason() {
    let folder = Folder::new("refused");
    let out = folder.path("rec.csv");
    let program = folder.write("part.nc", "G90 G21\nG1 X10 F100\nM98 P1000\n");
    let frame = folder.write("frame.nc", "G90 G21\nG1 X10 F100\nG52 X5\nG1 X20\n");
    let arc = folder.write("arc.nc", "G90 G21\nG1 X0 Y0 F100\nG2 X10 Y0 I3 J0\n");
    let far = folder.write("far.nc", "G90 G21\nG1 X10 F1000\nG1 X99999\n");
    let table = folder.write("table.csv", "x[mm],y[mm]\n0,0\n");
    let wrong = folder.write("wrong.csv", "x[mm],y[mm],z[mm]\n0,0,0\n1,zwei,0\n");
    let faults =
        folder.write("faults.ron", "Faults(units: (length: um, angle: urad), twists: [(joint: \"q\")])");
    let mill = "machines/xyz_mill.ron";
    let reference = "machines/ac_table_tilting.ron";
    let all: Vec<Vec<&str>> = vec![
        vec![reference, "--test", "AK4"],
        vec![mill, "--test", "BK1"],
        vec![mill, "--test", "cone"],
        vec![mill, "--test", "rotary"],
        vec![reference, "--test", "rotary", "--axis", "b"],
        vec![reference, "--test", "BK4", "--length", "900mm"],
        vec![reference, "--test", "BK4", "--inclination", "45deg"],
        vec![reference, "--test", "BK4", "--plane", "x,y"],
        vec![reference, "--test", "BK1", "--feed", "1000mm/min"],
        vec![reference, "--test", "circle", "--plane", "x,c"],
        vec!["machines/linear_axis.ron", "--test", "circle"],
        vec![reference, "--test", "BK4", "--hold", "q=3mm"],
        vec![reference, "--test", "BK4", "--measure", "joint"],
        vec![reference, "--test", "poses", "--measure", "distance"],
        vec![reference, "--test", "BK4", "--faults", &faults],
        vec![mill, "--test", "program"],
        vec![mill, "--test", "program", "--input", &program],
        vec![mill, "--test", "program", "--input", &frame],
        vec![mill, "--test", "program", "--input", &arc],
        vec![mill, "--test", "program", "--input", &far],
        vec![mill, "--test", "path", "--input", &table],
        vec![mill, "--test", "path", "--input", &wrong],
        vec![mill, "--test", "path", "--input", "no/such/table.csv"],
        vec![mill, "--test", "circle", "--nc", &out],
        vec![mill, "--test", "path", "--input", &table, "--truth", &table],
    ];
    let told = all.into_iter().map(|mut args| {
        args.extend(["-o", &out]);
        let shown = args[..args.len() - 2].join(" ").replace(&format!("{}/", folder.0.display()), "");
        format!("$ {shown}\n{}", refused(&folder, &args))
    });
    assert_snapshot!(told.collect::<Vec<_>>().join("\n"));
}

#[test]
fn help_is_worth_reading() {
    let output = kincal(&["--help"]);
    assert_snapshot!(String::from_utf8_lossy(&output.stdout));
}

#[test]
fn the_papers_command_writes_the_printed_rows() {
    let folder = Folder::new("paper");
    let nc = folder.path("paper.nc");
    done(
        &folder,
        &[
            "machines/ac_table_tilting_paper.ron",
            "--test",
            "BK4",
            "--tcp",
            "off",
            "--reverse-rotary",
            "--length",
            "100mm,150mm",
            "--parts",
            "2",
            "--step",
            "0.1deg",
            "--bar-decimals",
            "5",
            "--rotary-step",
            "0.001deg",
            "--nc",
            &nc,
            "-o",
            &folder.path("paper.csv"),
        ],
    );
    let program = folder.read("paper.nc");
    let blocks: Vec<&str> = program.lines().filter(|l| l.contains('A')).collect();
    assert_eq!(blocks.len(), 2 * 7204);
    let first = [
        "G1 F1000 X0.0000 Y-44.0232 Z41.0652 A75.0000 C0.0000",
        "X0.1213 Y-44.0749 Z40.8723 A75.0000 C0.0730",
    ];
    assert_eq!(blocks[..2], first);
    assert_eq!(blocks[7204 + 5], "X0.9146 Y-31.3441 Z88.3925 A74.9990 C0.3660");
}

#[test]
fn equal_options_give_equal_bytes_and_the_truth_calibrates_them_away() {
    let folder = Folder::new("truth");
    let (rec, truth) = (folder.path("rec.csv"), folder.path("truth.ron"));
    let args = [
        "machines/ac_table_tilting.ron",
        "--test",
        "BK4",
        "--lead",
        "60deg",
        "--random",
        "1",
        "--step",
        "5deg",
        "--noise",
        "0.1um",
        "--truth",
        &truth,
        "-o",
        &rec,
    ];
    done(&folder, &args);
    let (first, machine) =
        (folder.read("rec.csv"), CalibratedMachine::open(&truth).unwrap_or_else(|e| panic!("{e}")));
    done(&folder, &args);
    assert_eq!(first, folder.read("rec.csv"));
    let recording = Recording::open(&rec, machine.machine()).unwrap_or_else(|e| panic!("{e}"));
    let chain = machine.chain();
    let (mut worst, mut largest) = (0.0f64, 0.0f64);
    for chunk in recording.chunks().expect("rows") {
        let chunk = chunk.expect("rows");
        for (q, d) in chunk.commands.chunks_exact(5).zip(&chunk.values) {
            worst = worst.max((chain.w_from_t(q).translation.norm() - 0.1 - d).abs());
            largest = largest.max(d.abs());
        }
    }
    assert!(worst < 6e-7 && largest > 1e-5, "{worst} of {largest}");
}

fn drive() -> Drive {
    Drive {
        tool_centre_point: None,
        tool_point_t: Vec3([0.0; 3]),
        feed: 0.02,
        rapid: 0.3,
        rapid_rotary: 3.0,
        acceleration: 0.5,
        rotary_acceleration: 20.0,
        corner: 0.1,
        without_approach: false,
        rate: 200.0,
    }
}

fn run(folder: &Folder, machine: &Machine, program: &str) -> Vec<Sample> {
    let path = folder.write("part.nc", program);
    let course = PartProgram::new(path, machine, drive(), rest(machine));
    course.samples().expect("it opens").map(|s| s.unwrap_or_else(|e| panic!("{e}"))).collect()
}

#[test]
fn a_program_runs_its_lines_and_arcs_with_its_feed_and_dwells() {
    let folder = Folder::new("program");
    let machine = common::machine("xyz_mill");
    let text =
        "G90 G21 G17\nG0 X10 Y0 Z5\nG1 X20 F1200\nX30\nG3 X30 Y20 I0 J10\nG1 X10\nG4 P0.5\nG91 G1 Z-2\n";
    let all = run(&folder, &machine, text);
    let chain = Chain::nominal(&machine);
    let p: Vec<[f64; 3]> = all.iter().map(|s| chain.w_from_t(&s.q).translation.0.map(|x| x * 1e3)).collect();
    let line = |k: usize| match all[k].at {
        At::Line(line) => line,
        _ => panic!("a line"),
    };
    let v: Vec<f64> =
        p.windows(2).map(|w| Vec3([0, 1, 2].map(|i| w[1][i] - w[0][i])).norm() * 200.0).collect();
    // 1200 mm/min: reached in the lines, kept through the tangential start of the arc.
    for (k, v) in v.iter().enumerate() {
        if line(k) > 2 && line(k + 1) == line(k) {
            assert!(*v < 20.01, "{v} in line {}", line(k));
        }
    }
    let entering: Vec<usize> = (1..all.len()).filter(|k| line(*k) == 5 && line(*k - 1) == 4).collect();
    assert!(v[entering[0]] > 19.9, "{}", v[entering[0]]);
    for (k, p) in p.iter().enumerate().filter(|(k, _)| line(*k) == 5) {
        assert!(((p[0] - 30.0).hypot(p[1] - 10.0) - 10.0).abs() < 1e-9, "{k}: {p:?}");
        assert!(p[0] >= 30.0 - 1e-9, "counter-clockwise lies beyond");
    }
    let standing = (0..all.len()).filter(|k| line(*k) == 7).count();
    assert!((99..=101).contains(&standing), "{standing}");
    let end = p[p.len() - 1];
    assert!(end.iter().zip([10.0, 20.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{end:?}");
    // The clock is the rate's, and the acceleration holds along the lines.
    assert!(all.iter().enumerate().all(|(k, s)| (s.time - k as f64 / 200.0).abs() < 1e-9));
    let a = (1..v.len())
        .filter(|k| line(*k) == line(k - 1) && line(*k + 1) == line(*k))
        .map(|k| (v[k] - v[k - 1]).abs() * 0.2);
    assert!(a.fold(0.0, f64::max) < 0.5 * 1.02);
}

#[test]
fn with_the_tool_centre_point_a_program_names_the_tip_in_the_workpiece() {
    let folder = Folder::new("tip");
    let machine = common::machine("ac_table_tilting");
    let text = "G90 G21\nG0 X0 Y0 Z50 A0 C0\nG43.4\nG1 X10 Y-5 Z40 A-20 C30 F1000\nX20 C60\n";
    let all = run(&folder, &machine, text);
    let chain = Chain::nominal(&machine);
    for (line, from, to) in
        [(4, [0.0, 0.0, f64::NAN], [10.0, -5.0, 40.0]), (5, [10.0, -5.0, 40.0], [20.0, -5.0, 40.0])]
    {
        let tips: Vec<[f64; 3]> = all
            .iter()
            .filter(|s| s.at == At::Line(line))
            .map(|s| chain.w_from_t(&s.q).translation.0.map(|x| x * 1e3))
            .collect();
        // Along a straight line in the workpiece, whatever the rotary axes do.
        for tip in &tips {
            let part = (tip[0] - from[0]) / (to[0] - from[0]);
            let off = (tip[1] - from[1] - part * (to[1] - from[1])).abs();
            assert!(off < 1e-6, "line {line}: {tip:?}");
        }
        let last = tips[tips.len() - 1];
        assert!((last[0] - to[0]).abs() < 0.2 && (last[2] - to[2]).abs() < 0.2, "{last:?}");
    }
}

#[test]
fn a_program_that_was_written_runs_as_the_test_did() {
    let folder = Folder::new("again");
    let nc = folder.path("cone.nc");
    let reference = "machines/bc_table_tilting.ron";
    done(
        &folder,
        &[reference, "--test", "BK4", "--step", "10deg", "--nc", &nc, "-o", &folder.path("rec.csv")],
    );
    let machine = common::machine("bc_table_tilting");
    let all = run(&folder, &machine, &folder.read("cone.nc"));
    let recording = Recording::open(folder.path("rec.csv"), &machine).unwrap_or_else(|e| panic!("{e}"));
    let mut rows = 0;
    for chunk in recording.chunks().expect("rows") {
        for wanted in chunk.expect("rows").commands.chunks_exact(5) {
            let off = |s: &Sample| s.q.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // Each block ends within a sample of its point: here the path stops, corners being sharp.
            let nearest = all.iter().map(off).fold(f64::INFINITY, f64::min);
            assert!(nearest < 2e-4, "{nearest}");
            rows += 1;
        }
    }
    assert_eq!(rows, 74);
}

#[test]
fn any_recording_can_be_run_again() {
    let folder = Folder::new("path");
    let (first, second) = (folder.path("first.csv"), folder.path("second.csv"));
    let arm = "machines/six_r_arm.ron";
    done(&folder, &[arm, "--test", "poses", "--count", "20", "--random", "1", "-o", &first]);
    done(&folder, &[arm, "--test", "path", "--input", &first, "--random", "1", "-o", &second]);
    let (first, second) = (folder.read("first.csv"), folder.read("second.csv"));
    assert_eq!(first.lines().count(), second.lines().count());
    for (a, b) in first.lines().zip(second.lines()) {
        let numbers = |line: &str| -> Vec<f64> { line.split(',').filter_map(|f| f.parse().ok()).collect() };
        // Commands have nine decimals of a degree: what is read may differ in the last digit.
        assert!(numbers(a).iter().zip(numbers(b)).all(|(x, y)| (x - y).abs() < 1.5e-7), "{a}\n{b}");
    }
}

/// Bad faults files, told without the folder.
#[test]
fn every_bad_faults_file_has_a_message_and_a_mend() {
    let machine = common::machine("ac_table_tilting");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad/faults");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&folder).expect("part of the project").map(|e| e.expect("a file").path()).collect();
    files.sort();
    let lines = files.iter().map(|path| {
        let error =
            Faults::open(path, &machine).err().unwrap_or_else(|| panic!("{} can be read", path.display()));
        assert!(error.place().is_some() && !error.mend().is_empty(), "{error}");
        format!("{} | {}", error.to_string().replace(&format!("{}/", folder.display()), ""), error.mend())
    });
    assert_snapshot!(lines.collect::<Vec<_>>().join("\n"));
}

#[test]
fn the_faults_file_of_the_document_reads() {
    let document = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/simulate.md"))
        .expect("a document");
    let block = document.split("```ron\n").nth(1).and_then(|t| t.split("```").next()).expect("an example");
    let machine = common::machine("ac_table_tilting_paper");
    let faults = Faults::parse("example.ron", block, &machine).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        (faults.deviations.len(), faults.twists.len(), faults.displacements.len(), faults.backlash.len()),
        (2, 2, 2, 4)
    );
    let z = faults.backlash[3].1.at(0.1);
    assert!((z - 3e-6).abs() < 1e-15, "2 um and 0.01 um for each of 100 mm");
}

/// Pieces of programs, tables and faults, put together at random.
fn pieces() -> impl Strategy<Value = String> {
    let words = [
        "G0",
        "G1",
        "G2",
        "G3",
        "G4",
        "G17",
        "G19",
        "G20",
        "G90",
        "G91",
        "G93",
        "G43.4",
        "G49",
        "X",
        "Y1",
        "Z-2.5",
        "X1e300",
        "I1",
        "J0",
        "K3",
        "R-2",
        "R0",
        "F0",
        "F1e9",
        "P1",
        "A90",
        "C-30",
        "=",
        "(",
        ")",
        ";",
        " ",
        "\n",
        "#1",
        "TRAORI",
        "M6",
        "L ",
        "x[mm]",
        "y[mm]",
        "z[mm]",
        "t[s]",
        ",",
        "1",
        "-1e400",
        "nan",
        "# fixed z[mm]: 0\n",
        "x_direction[1]",
        "Faults(",
        "units: (length: um, angle: urad)",
        "backlash: [",
        "(joint: \"x\", ",
        "width: 1",
        "]",
        "by_position: Points([(0, 1)])",
        "Harmonics(mean: 1, period: 0)",
        "Polynomial([1])",
    ];
    proptest::collection::vec(proptest::sample::select(words.to_vec()), 0..40)
        .prop_map(|words| words.concat())
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 512,
        rng_seed: proptest::test_runner::RngSeed::Fixed(20_260_103),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn any_input_is_run_or_refused(text in pieces()) {
        let folder = Folder::new("any");
        let path = folder.write("any", &text);
        for machine in [common::machine("xyz_mill"), common::machine("ac_table_tilting")] {
            let _ = Faults::parse("any.ron", &text, &machine);
            let program = PartProgram::new(&path, &machine, drive(), rest(&machine));
            let table = CommandTable::open(&path, &machine, 10.0).ok();
            let courses = table.iter().map(|t| t as &dyn Course).chain([&program as &dyn Course]);
            for samples in courses.filter_map(|course| course.samples().ok()) {
                for sample in samples.take(2000).map_while(Result::ok) {
                    prop_assert!(sample.time.is_finite() && sample.q.iter().all(|x| x.is_finite()), "{text}");
                }
            }
        }
    }
}

#[test]
fn the_approach_of_a_program_is_left_out_when_asked() {
    let folder = Folder::new("approach");
    let machine = common::machine("xyz_mill");
    let lines = |text: &str, without_approach: bool| -> Vec<usize> {
        let path = folder.write("part.nc", text);
        let course = PartProgram::new(path, &machine, Drive { without_approach, ..drive() }, rest(&machine));
        let all = course.samples().expect("it opens").map(|s| s.unwrap_or_else(|e| panic!("{e}")));
        let line = |s: Sample| match s.at {
            At::Line(line) => line,
            _ => panic!("a line"),
        };
        let mut lines: Vec<usize> = all.filter(|s| s.recorded).map(line).collect();
        lines.dedup();
        lines
    };
    // Rapid motion later on is the program's own.
    let rapid = "G90\nG0 X10\nG4 P0.1\nG0 Z5\nG1 X20 F1200\nG0 Z9\nG1 X9\n";
    assert_eq!(lines(rapid, false), [2, 3, 4, 5, 6, 7]);
    assert_eq!(lines(rapid, true), [5, 6, 7]);
    let straight = "G90 G1 X10 F900\nX20\nG0 X9\n";
    assert_eq!(lines(straight, true), [2, 3]);
}

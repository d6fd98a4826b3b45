//! The command line as its users meet it: status, standard output, standard error, files.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common;
use crate::program::{Folder, PROGRAM, done, err, fails, out};
use insta::assert_snapshot;
use kincal::CalibratedMachine;
use kincal::lie::Vec3;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use serde_json::Value;

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

const MACHINE: &str = "machines/ac_table_tilting.ron";

/// Positions of a ball by a tracker that stands somewhere, with two drop-outs; positions in mm.
fn tracker(setup: &str, samples: usize) -> String {
    let machine = common::machine("ac_table_tilting");
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 3));
    let mut instrument = Instrument::new(Sensor::Position, 1e-6, 0.0);
    instrument.state.tool_point_t = Vec3([0.02, -0.03, 0.05]);
    let header = [
        format!("setup: {setup}"),
        "workpiece_frame: unknown".to_string(),
        "tool_point[mm]: 20, -30, 50".to_string(),
    ];
    let text = recording(&truth, &instrument, &random_commands(&machine, samples, 4), &header, 5);
    let mut rows = 0;
    let lines = text.lines().map(|line| {
        if line.starts_with('#') {
            return line.to_string();
        }
        if line.starts_with('t') {
            return line.replace("px[m],py[m],pz[m]", "px[mm],py[mm],pz[mm]");
        }
        rows += 1;
        let mut cells: Vec<String> = line.split(',').map(str::to_string).collect();
        for cell in &mut cells[6..] {
            *cell = format!("{:.6}", 1e3 * cell.parse::<f64>().expect("a number"));
        }
        match rows {
            3 => cells[7] = String::new(),
            5 => cells[8] = "NaN".into(),
            _ => {}
        }
        cells.join(",")
    });
    lines.collect::<Vec<_>>().join("\n") + "\n"
}

/// Calibrates on a tracker recording; the folder, the recording and the calibrated file.
fn calibrated(name: &str) -> (Folder, String, String) {
    let folder = Folder::new(name);
    let (rec, ron) = (folder.write("rec.csv", &tracker("hall", 60)), folder.path("calibrated.ron"));
    done(&["calibrate", MACHINE, &rec, "-o", &ron, "--quiet"]);
    (folder, rec, ron)
}

// Usage and status.

#[test]
fn usage_errors_have_status_2_and_help_has_status_0() {
    assert!(fails(2, &[]).contains("Usage: kincal"));
    assert!(fails(2, &["calibrat"]).contains("tip: a similar subcommand exists: 'calibrate'"));
    assert!(fails(2, &["calibrate", MACHINE]).contains("<REC.csv>"));
    assert!(fails(2, &["describe", MACHINE, "--jason", "-"]).contains("--json"));
    assert!(
        fails(2, &["calibrate", MACHINE, "x.csv", "--tuning", "-1"]).contains("expected a number above zero")
    );
    assert!(fails(2, &["check", MACHINE, "--poses", "0"]).contains("0 is not in"));
    for command in ["describe", "check", "calibrate", "predict", "demo"] {
        let help = done(&[command, "--help"]);
        for option in ["--json", "--quiet"] {
            assert!(help.contains(option), "{command}");
        }
        assert!(done(&["--help"]).contains(command));
    }
    assert!(done(&["--version"]).starts_with("kincal "));
}

// Describe and check.

#[test]
fn describe_says_what_a_machine_is() {
    for (stem, _) in common::machines() {
        let text = done(&["describe", &format!("machines/{stem}.ron")]);
        assert!(text.lines().all(|line| line.trim_end() == line));
        assert_snapshot!(format!("describe_{stem}"), text);
    }
}

/// Numbers to four significant digits, rounding to zero; of long lists only their length.
fn rounded(value: &mut Value) {
    match value {
        Value::Number(number) if number.is_f64() => {
            let x = number.as_f64().unwrap_or(0.0);
            let x: f64 = if x.abs() < 1e-12 { 0.0 } else { format!("{x:.3e}").parse().expect("a number") };
            *value = Value::from(x);
        }
        Value::Array(items) => items.iter_mut().for_each(rounded),
        Value::Object(fields) => {
            for (key, field) in fields.iter_mut() {
                match field {
                    Value::Array(items) if key == "unseen" => {
                        *field = format!("{} combinations", items.len()).into()
                    }
                    _ => rounded(field),
                }
            }
        }
        _ => {}
    }
}

#[test]
fn describe_has_a_machine_readable_result() {
    let mut value = json(&done(&["describe", MACHINE, "--json", "-"]));
    rounded(&mut value);
    assert_snapshot!(serde_json::to_string_pretty(&value).expect("JSON"));
}

#[test]
fn describe_lists_what_is_not_seen_when_asked() {
    let text = done(&["describe", "machines/linear_axis.ron", "--unseen"]);
    assert!(text.contains("not seen by pose: shifts (m, rad) that change no reading"), "{text}");
    assert!(text.contains("+1.0000 "), "{text}");
}

#[test]
fn check_passes_for_a_shipped_machine() {
    let text = done(&["check", MACHINE, "--poses", "3"]);
    assert!(text.ends_with("limit 1e-12: all agree\n"), "{text}");
    let value = json(&done(&["check", MACHINE, "--poses", "3", "--json", "-"]));
    assert_eq!(value["passes"], true);
    assert!(value["worst"].as_f64().is_some_and(|x| x < 1e-12));
}

#[test]
fn a_closed_pipe_is_no_trouble() {
    for command in
        ["describe --unseen machines/dlr_justin_left.ron", "describe --json - machines/dlr_justin_left.ron"]
    {
        let line = format!("('{PROGRAM}' {command}; echo status $? >&2) | head -1");
        let output = Command::new("sh")
            .args(["-c", &line])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .expect("a shell");
        assert_eq!(err(&output), "status 0\n");
        assert_eq!(out(&output).lines().count(), 1);
    }
}

// Calibrate and predict.

#[test]
fn calibrate_writes_a_file_that_reads_back() {
    let folder = Folder::new("calibrate");
    let (rec, ron) = (folder.write("rec.csv", &tracker("hall", 60)), folder.path("calibrated.ron"));
    let text = done(&["calibrate", MACHINE, &rec, "-o", &ron]);
    assert!(
        text.contains("\n\nac_table_tilting: 58 samples in 1 recording, 2 rows left out as drop-outs\n"),
        "{text}"
    );
    assert!(text.ends_with(&format!("written to {ron}\n")), "{text}");
    let calibrated = CalibratedMachine::open(&ron).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(calibrated.samples(), 58);
    assert_eq!(calibrated.setup_names().collect::<Vec<_>>(), ["hall"]);
    assert!(calibrated.deviations().iter().any(|dh| dh.v.norm() > 1e-6));
    let described = done(&["describe", &ron]);
    for part in
        ["calibrated on 58 samples, left over ", "set-up hall", "frame w at (", "joint a", "deviations dh_j"]
    {
        assert!(described.contains(part), "{part} in {described}");
    }
    let value = json(&done(&["describe", &ron, "--json", "-"]));
    assert_eq!(
        keys(&value["calibration"]),
        [
            "deviations",
            "lengths",
            "rms_m",
            "rms_rad",
            "samples",
            "seen",
            "setups",
            "tool_points",
            "tool_rotations",
            "zeros"
        ]
    );
    assert_eq!(folder.names(), ["calibrated.ron", "rec.csv"]);
}

#[test]
fn calibrate_names_every_recording_in_aligned_columns() {
    let folder = Folder::new("names");
    let long = "a_recording_with_a_name_that_is_longer_than_any_column.csv";
    let recs = [folder.write(long, &tracker("one", 40)), folder.write("b.csv", &tracker("two", 40))];
    let text = done(&["calibrate", MACHINE, &recs[0], &recs[1]]);
    let from = text.lines().position(|l| l.trim_start().starts_with("recording ")).expect("a table");
    let table: Vec<&str> = text.lines().skip(from).take(4).collect();
    let column = table[0].find("measurement").expect("a heading");
    assert!(table[1..3].iter().all(|l| l[column..].starts_with("position")), "{text}");
    assert!(table.iter().all(|l| l.len() == table[0].len()), "{text}");
}

#[test]
fn predict_writes_the_input_with_model_and_residual() {
    let (folder, rec, ron) = calibrated("predict");
    let text = done(&["predict", &ron, &rec, "-o", &folder.path("out.csv")]);
    assert!(text.starts_with(
        "rec.csv: 58 samples, 2 rows left out as drop-outs\nresidual (measured minus model): RMS "
    ));
    let (input, output) = (folder.read("rec.csv"), folder.read("out.csv"));
    assert_eq!(input.lines().count(), output.lines().count());
    let mut rows = 0;
    let mut sum = 0.0;
    for (before, after) in input.lines().zip(output.lines()) {
        if before.starts_with('#') {
            assert_eq!(before, after);
            continue;
        }
        let added =
            after.strip_prefix(before).unwrap_or_else(|| panic!("{after} does not begin with {before}"));
        if before.starts_with('t') {
            let columns = ["px", "py", "pz"].map(|n| format!(",{n}_model[mm],{n}_residual[mm]"));
            assert_eq!(added, columns.concat());
            continue;
        }
        rows += 1;
        if rows == 3 || rows == 5 {
            assert_eq!(added, ",,,,,,", "a drop-out keeps its row");
            continue;
        }
        let number = |cell: &str| cell.parse::<f64>().unwrap_or_else(|e| panic!("{cell}: {e}"));
        let measured: Vec<f64> = before.split(',').skip(6).map(number).collect();
        let new: Vec<f64> = added[1..].split(',').map(number).collect();
        for i in 0..3 {
            let (model, residual) = (new[2 * i], new[2 * i + 1]);
            assert!((measured[i] - model - residual).abs() < 1e-8, "{after}");
            assert!(residual.abs() < 0.01, "noise is 1 um: {after}");
            sum += residual * residual * 1e-6;
        }
    }
    let value = json(&done(&["predict", &ron, &rec, "--json", "-"]));
    assert_eq!(value["samples"], 58);
    assert_eq!(value["extrapolated_samples"], 0);
    let figure = |key: &str| value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"));
    assert!((figure("rms_m") / (sum / 58.0f64).sqrt() - 1.0).abs() < 1e-5);
    assert!(
        figure("max_m") > figure("rms_m") && figure("rms_m") > figure("mean_m") && figure("mean_m") > 0.0
    );
    // The output is a recording too: extra channels.
    done(&["predict", &ron, &folder.path("out.csv")]);
}

#[test]
fn predict_gives_quaternions_the_sign_that_the_file_has() {
    let folder = Folder::new("quaternion");
    let rows = "0,0,0,0,0,0,-1,0,0,0\n0,10,0,10,0,0,1,0,0,0\n0,0,20,0,0,20,-1,0.00001,0,0\n";
    let head = "# machine: xyz_mill\n# measurement: pose\nx[mm],y[mm],z[mm],px[mm],py[mm],pz[mm],qw[1],qx[1],qy[1],qz[1]\n";
    let rec = folder.write("pose.csv", &format!("{head}{rows}"));
    done(&["predict", "machines/xyz_mill.ron", &rec, "-o", &folder.path("out.csv"), "--quiet"]);
    for line in folder.read("out.csv").lines().skip(3) {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().expect("a number")).collect();
        for i in 0..4 {
            let (measured, model, residual) = (cells[6 + i], cells[16 + 2 * i], cells[17 + 2 * i]);
            assert!((measured - model - residual).abs() < 1e-6 && residual.abs() < 1e-4, "{line}");
        }
    }
}

#[test]
fn predict_counts_samples_beyond_the_calibration() {
    let (folder, _, ron) = calibrated("extrapolated");
    let text = tracker("hall", 60);
    let mut lines: Vec<String> = text.lines().map(str::to_string).collect();
    let mut cells: Vec<String> = lines[7].split(',').map(str::to_string).collect();
    cells[3] = "9".into();
    lines[7] = cells.join(",");
    let rec = folder.write("beyond.csv", &lines.join("\n"));
    let text = done(&["predict", &ron, &rec]);
    assert!(text.contains("note: at 1 sample a joint leaves the range"), "{text}");
    assert_eq!(json(&done(&["predict", &ron, &rec, "--json", "-"]))["extrapolated_samples"], 1);
}

#[test]
fn predict_on_an_unknown_set_up_names_the_option_that_finds_it() {
    let (folder, _, ron) = calibrated("setup");
    let rec = folder.write("new.csv", &tracker("yard", 30));
    let message = fails(1, &["predict", &ron, &rec]);
    assert_eq!(
        message,
        "error: where set-up \"yard\" of this recording stands is not in the calibrated file\n  \
         = add --fit-setup to find it from this recording; the file knows: hall\n"
    );
    let value = json(&done(&["predict", &ron, &rec, "--fit-setup", "--json", "-"]));
    assert!(value["rms_m"].as_f64().is_some_and(|rms| rms < 1e-5), "{value}");
}

#[test]
fn json_goes_to_a_file_or_alone_to_standard_output_and_quiet_says_nothing() {
    let (folder, rec, ron) = calibrated("json");
    let file = folder.path("result.json");
    let text = done(&["calibrate", MACHINE, &rec, "--json", &file]);
    assert!(
        text.starts_with("The machine is ") && text.contains("\n\nac_table_tilting: 58 samples"),
        "{text}"
    );
    assert_eq!(json(&folder.read("result.json")), json(&done(&["calibrate", MACHINE, &rec, "--json", "-"])));
    for args in [
        vec!["describe", MACHINE],
        vec!["check", MACHINE, "--poses", "1"],
        vec!["calibrate", MACHINE, &rec],
        vec!["predict", &ron, &rec],
    ] {
        assert_eq!(done(&[&args[..], &["--quiet"]].concat()), "");
        json(&done(&[&args[..], &["--quiet", "--json", "-"]].concat()));
    }
}

// Failures.

#[test]
fn an_output_that_cannot_be_written_is_told_and_leaves_nothing() {
    let (folder, rec, ron) = calibrated("unwritable");
    let missing = folder.path("no_such_folder/out");
    for args in [
        vec!["calibrate", MACHINE, &rec, "-o", &missing],
        vec!["predict", &ron, &rec, "-o", &missing],
        vec!["describe", MACHINE, "--json", &missing],
    ] {
        let message = fails(1, &args);
        assert!(message.starts_with(&format!("error: {missing}: cannot be written: ")), "{message}");
        assert!(message.contains("\n  = create the folder "), "{message}");
    }
    let below_a_file = format!("{rec}/out.csv");
    assert!(fails(1, &["predict", &ron, &rec, "-o", &below_a_file]).contains("is no folder"));
    let folder_itself = folder.0.to_string_lossy();
    assert!(fails(1, &["predict", &ron, &rec, "-o", &folder_itself]).contains("name a file, not a folder"));
    assert_eq!(folder.names(), ["calibrated.ron", "rec.csv"]);
}

#[cfg(unix)]
#[test]
fn a_read_only_folder_is_told_and_leaves_nothing() {
    use std::os::unix::fs::PermissionsExt;
    let (folder, rec, ron) = calibrated("read_only");
    let closed = Folder::new("closed");
    let mode = |mode| {
        std::fs::set_permissions(&closed.0, std::fs::Permissions::from_mode(mode)).expect("own folder")
    };
    mode(0o555);
    // Whoever may write anywhere meets no closed folder; the kernel's own folder refuses even then.
    let place = match std::fs::write(closed.path("probe"), "") {
        Ok(()) => PathBuf::from("/proc/kincal.csv"),
        Err(_) => closed.0.join("out.csv"),
    };
    let place = place.to_string_lossy();
    let message = fails(1, &["predict", &ron, &rec, "-o", &place]);
    mode(0o755);
    assert!(message.starts_with(&format!("error: {place}: cannot be written: ")), "{message}");
    assert!(closed.names().iter().all(|name| name == "probe"));
    assert_eq!(folder.names(), ["calibrated.ron", "rec.csv"]);
}

#[test]
fn a_failing_run_leaves_an_existing_output_as_it_was() {
    let (folder, _, ron) = calibrated("untouched");
    let bad = folder.write("bad.csv", &tracker("hall", 60).replace("\n0.550,", "\n0.550,x"));
    let kept = folder.write("kept", "precious");
    for args in [vec!["calibrate", MACHINE, &bad, "-o", &kept], vec!["predict", &ron, &bad, "-o", &kept]] {
        let message = fails(1, &args);
        assert!(message.contains("bad.csv:62:2: `x"), "{message}");
        assert!(message.contains("\n  = write a number with a decimal point"), "{message}");
        assert_eq!(folder.read("kept"), "precious");
    }
    assert_eq!(folder.names(), ["bad.csv", "calibrated.ron", "kept", "rec.csv"]);
}

#[test]
fn a_recording_is_never_overwritten() {
    let (folder, rec, ron) = calibrated("overwrite");
    let before = folder.read("rec.csv");
    let message = fails(1, &["predict", &ron, &rec, "-o", &rec]);
    assert!(message.contains("would overwrite REC.csv"), "{message}");
    fails(1, &["calibrate", MACHINE, &rec, "-o", &rec]);
    fails(1, &["calibrate", MACHINE, &rec, "--json", &rec]);
    assert_eq!(folder.read("rec.csv"), before);
}

#[test]
fn errors_name_file_line_column_and_mend() {
    let folder = Folder::new("errors");
    let ron =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(MACHINE)).expect("a machine");
    let at = ron.lines().position(|l| l.contains("Revolute")).expect("a joint") + 1;
    let bad = folder.write("bad.ron", &ron.replace("Revolute", "Revolut"));
    let message = fails(1, &["describe", &bad]);
    assert!(message.starts_with(&format!("error: {bad}:{at}:")), "{message}");
    assert!(message.contains(&format!("\n{at} | ")), "the line itself is shown: {message}");
    assert!(message.contains("^\n  = "), "a mark below it, then the mend: {message}");
    let rec = folder.write("units.csv", &tracker("hall", 9).replace("py[mm]", "py[deg]"));
    let message = fails(1, &["calibrate", MACHINE, &rec]);
    assert_eq!(
        message,
        format!(
            "error: {rec}:6:8: column `py` has unit `deg`, a unit of angle\n  = write one of: m mm um nm in\n"
        )
    );
    let nothing = folder.path("nothing.csv");
    let message = fails(1, &["calibrate", MACHINE, &nothing]);
    assert!(
        message.starts_with(&format!("error: {nothing}: ")) && message.contains("nothing is there"),
        "{message}"
    );
}

#[test]
fn files_in_each_others_place_are_told() {
    let folder = Folder::new("swapped");
    let rec = folder.write("rec.csv", &tracker("hall", 9));
    for args in [
        vec!["describe", &rec],
        vec!["check", &rec],
        vec!["calibrate", &rec, MACHINE],
        vec!["predict", &rec, MACHINE],
    ] {
        let message = fails(1, &args);
        assert_eq!(
            message,
            format!(
                "error: {rec}: this is a recording, where a machine file is expected\n  \
                 = name the machine file first, then the recordings\n"
            )
        );
    }
    for args in [vec!["calibrate", MACHINE, MACHINE], vec!["predict", MACHINE, MACHINE]] {
        assert!(fails(1, &args).contains(": this is a machine file, where a recording is expected\n"));
    }
}

#[test]
fn faults_of_recordings_reach_the_user() {
    let file = |name: &str| format!("tests/bad/identification/{name}.csv");
    let message = fails(1, &["calibrate", "machines/xyz_mill.ron", &file("missing_joint")]);
    assert!(message.starts_with(
        "error: tests/bad/identification/missing_joint.csv:3: joint \"z\" has no column\n  = add"
    ));
    let message = fails(1, &["calibrate", "machines/linear_axis.ron", &file("wrong_machine")]);
    assert!(
        message.starts_with("error: tests/bad/identification/wrong_machine.csv:1:12: recording was made on")
    );
    let message = fails(1, &["calibrate", "machines/linear_axis.ron", &file("one_row")]);
    assert_eq!(
        message,
        "error: there is only one sample in all recordings\n  = record the same quantity at many positions of the joints\n"
    );
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    let help = done(&["--help"]);
    let commands =
        help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let commands: Vec<&str> = commands.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(commands.contains(&"diagnose"), "{help}");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let text = done(&["completions", shell]);
        assert!(commands.iter().all(|command| text.contains(command)), "{shell}");
    }
    let page = done(&["man"]);
    assert!(commands.iter().all(|command| page.contains(command)), "{page}");
    let page = done(&["man", "diagnose"]);
    assert!(page.contains("kincal diagnose") && page.contains("\\-\\-report"), "{page}");
    let said = fails(1, &["man", "diagnoze"]);
    assert!(said.contains("\"diagnoze\"") && said.contains("`kincal --help` lists them"), "{said}");
}

#[test]
fn parts_are_merged_to_what_calibrate_finds() {
    let folder = Folder::new("merge");
    let recordings =
        [folder.write("a.csv", &tracker("hall", 60)), folder.write("b.csv", &tracker("yard", 50))];
    let [a, b] = &recordings;
    let whole = folder.path("whole.ron");
    done(&["calibrate", MACHINE, a, b, "-o", &whole, "--quiet"]);
    let mut at: Option<String> = None;
    for round in 0..40 {
        let part = |name: &str, rec: &str| {
            let path = folder.path(&format!("{name}{round}"));
            let mut args = vec!["normal", MACHINE, rec, "-o", &path, "--quiet"];
            if let Some(at) = &at {
                args.extend(["--at", at]);
            }
            done(&args);
            path
        };
        let (one, other, next) = (part("a", a), part("b", b), folder.path(&format!("round{round}.ron")));
        let told = json(&done(&["merge", &one, &other, "-o", &next, "--json", "-"]));
        if told["converged"] == true {
            assert_eq!(folder.read(&format!("round{round}.ron")), folder.read("whole.ron"));
            let error = fails(1, &["normal", MACHINE, a, "--at", &next, "-o", &folder.path("more")]);
            assert!(error.contains("this is not a round"), "{error}");
            let error = fails(1, &["normal", MACHINE, a, "--directions", "a", "-o", &folder.path("more")]);
            assert!(error.contains("pieces by direction of travel cannot be merged"), "{error}");
            return;
        }
        assert_eq!(told["round"], round + 1);
        at = Some(next);
    }
    panic!("no end");
}

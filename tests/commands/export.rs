//! `kincal export` as people call it.

use std::path::Path;

use crate::program::{Folder, PROGRAM, done, err, fails, out};

const LIFT: &str = "tests/exports/lift.ron";

/// The lines of all blocks of commands in a document.
fn commands(document: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(document);
    let text = std::fs::read_to_string(path).expect("part of the project");
    let blocks = text.split("```sh\n").skip(1).filter_map(|part| part.split("```").next());
    blocks.flat_map(str::lines).map(str::to_string).collect()
}

#[test]
fn the_commands_of_the_document_run() {
    let folder = Folder::new("export");
    let copy = |from: &str, to: &str| {
        let to = folder.0.join(to);
        std::fs::create_dir_all(to.parent().expect("a folder")).expect("a folder");
        std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join(from), to).expect("copied");
    };
    copy("machines/ac_table_tilting.ron", "machines/ac_table_tilting.ron");
    copy(LIFT, "lift.ron");
    copy("tests/urdf/arm.urdf", "robot.urdf");
    let commands = commands("export.md");
    assert!(commands.len() > 8, "{commands:?}");
    for line in &commands {
        let words: Vec<&str> = line.split(' ').collect();
        assert_eq!(words[0], "kincal");
        let run = std::process::Command::new(PROGRAM)
            .args(&words[1..])
            .current_dir(&folder.0)
            .output()
            .expect("runs");
        assert!(run.status.success() && err(&run).is_empty(), "{line}: {}", err(&run));
        let file = words.iter().skip_while(|word| **word != "-o").nth(1).expect("an output");
        assert!(folder.0.join(file).is_file(), "{line}: {}", out(&run));
    }
    // The base file comes back byte for byte: an imported arm has no deviation.
    assert_eq!(folder.read("robot_calibrated.urdf"), folder.read("robot.urdf"));
}

#[test]
fn a_file_is_printed_where_no_output_is_named() {
    let printed = done(&["export", LIFT, "--to", "linuxcnc-comp"]);
    assert_eq!(printed.lines().count(), 21);
    assert!(printed.starts_with("-100.000000 -100.007000 -100.001000\n"), "{printed}");
    assert_eq!(done(&["export", LIFT, "--to", "linuxcnc-comp", "--quiet", "--json", "/dev/null"]), printed);
}

#[test]
fn what_belongs_to_one_form_alone_is_refused_beside_another() {
    for (flag, value) in [("--axis", "z"), ("--base-file", "tests/urdf/arm.urdf")] {
        let said = fails(1, &["export", LIFT, "--to", "dh", flag, value]);
        assert!(said.contains(flag) && said.contains("this is --to dh"), "{said}");
    }
}

#[test]
fn json_says_what_the_file_holds_and_what_not() {
    let text = done(&["export", LIFT, "--to", "dh", "--json", "-"]);
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((&json["machine"], &json["format"]), (&"lift".into(), &"dh".into()));
    assert!(json["text"].as_str().is_some_and(|text| text.contains("joint,kind,displacement,")));
    assert_eq!(json["numbers"].as_array().map(Vec::len), Some(5));
    let left: Vec<&str> =
        json["left_out"].as_array().expect("a list").iter().filter_map(|l| l["what"].as_str()).collect();
    assert_eq!(left, ["scale_error at z", "backlash at z"]);
    // 40 um a metre at 400 mm.
    let max = json["left_out"][0]["max_m"].as_f64().expect("a size");
    assert!((10e-6..17e-6).contains(&max), "{max}");
}

//! Machines that come in: imported ones, and those that the program carries.

use std::path::Path;

use serde_json::Value;

use crate::program::{Folder, PROGRAM, done, err, fails};

/// What `docs/import.md` shows: files named behind the fence are made, commands of ours run.
#[test]
fn the_commands_of_the_page_on_imports_run() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/import.md");
    let page = std::fs::read_to_string(page).expect("part of the project");
    let folder = Folder::new("imports");
    let mut run = 0;
    for block in page.split("```").skip(1).step_by(2) {
        let (kind, text) = block.split_once('\n').expect("a fence");
        match kind.split_whitespace().collect::<Vec<_>>()[..] {
            [_, name] => {
                folder.write(name, text);
            }
            _ => {
                for line in text.lines().filter(|line| line.starts_with("kincal ")) {
                    let words: Vec<&str> = line.split(' ').skip(1).collect();
                    let output =
                        std::process::Command::new(PROGRAM).current_dir(&folder.0).args(&words).output();
                    let output = output.expect("it runs");
                    assert!(output.status.success() && err(&output).is_empty(), "{line}: {}", err(&output));
                    run += 1;
                }
            }
        }
    }
    assert!(run >= 2, "{run}");
}

#[test]
fn every_file_in_machines_is_carried_by_the_program_as_it_is() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("machines");
    let listed: Vec<Value> =
        serde_json::from_str(&done(&["machines", "--json", "-"])).expect("a list in JSON");
    let listed: Vec<&str> = listed.iter().map(|m| m["machine"].as_str().expect("a name")).collect();
    let mut there = Vec::new();
    for entry in std::fs::read_dir(&folder).expect("a folder") {
        let path = entry.expect("readable").path();
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        assert_eq!(done(&["machines", &name]), std::fs::read_to_string(&path).expect("a text"), "{name}");
        there.push(name);
    }
    there.sort();
    assert_eq!(listed, there);
}

#[test]
fn a_machine_that_does_not_come_with_the_program_is_told() {
    let said = fails(1, &["machines", "ac_tabel"]);
    assert!(said.contains("\"ac_tabel\"") && said.contains("`kincal machines` lists them"), "{said}");
    let said = fails(1, &["machines", "scarra"]);
    assert!(said.contains("write scara;"), "{said}");
    let said = fails(1, &["new", "--like", "panda", "-o", "/dev/null"]);
    assert!(said.contains("write franka_panda;"), "{said}");
}

#[test]
fn an_imported_file_is_a_machine_that_every_command_takes() {
    let folder = Folder::new("import");
    let ron = folder.path("arm.ron");
    let said = done(&["import", "tests/urdf/arm.urdf", "--tip", "finger", "-o", &ron]);
    assert!(said.contains("joint \"lift/1\" is called lift_1") && said.contains("written to"), "{said}");
    assert!(done(&["describe", &ron, "--at", "elbow=10deg"]).contains("elbow=10deg"));
    let said = fails(1, &["import", "tests/urdf/arm.urdf", "--tip", "toe", "-o", &folder.path("toe.ron")]);
    assert!(said.contains("--tip toe") && said.contains("finger"), "{said}");
    assert!(!Path::new(&folder.path("toe.ron")).exists());
}

#[test]
fn no_output_overwrites_a_file_that_a_model_includes() {
    let folder = Folder::new("included");
    std::fs::create_dir(folder.0.join("parts")).expect("a folder");
    for name in ["arm.xml", "parts/defaults.xml", "parts/hand.xml"] {
        std::fs::copy(Path::new("tests/mjcf").join(name), folder.0.join(name)).expect("copied");
    }
    let before = folder.read("parts/hand.xml");
    let (model, hand) = (folder.path("arm.xml"), folder.path("parts/hand.xml"));
    let said = fails(1, &["import", &model, "--tip", "tip", "-o", &hand]);
    assert!(said.contains("--output would overwrite FILE, which the call reads"), "{said}");
    assert_eq!(folder.read("parts/hand.xml"), before);
    assert!(done(&["import", &model, "--tip", "tip", "-o", &folder.path("arm.ron")]).contains("5 joints"));
}

//! Long chains and many recordings: in time and in memory, or refused.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use kincal::CalibratedMachine;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};

use crate::common;
use crate::program::{Folder, command, done};

/// A chain of so many revolute joints.
fn chain(joints: usize) -> String {
    let mut text = String::from(
        "Machine(name: \"chain\", units: (length: mm, angle: deg), workpiece: [(frame: \"w\")], tool: [\n",
    );
    for j in 0..joints {
        let axis = ["x", "y", "z"][j * j % 3];
        let _ = writeln!(
            text,
            "(frame: \"j{j}\", at: ({}, 0, 50), joint: Revolute(axis: \"{axis}\", travel: (-90, 90))),",
            j % 7
        );
    }
    text + "(frame: \"t\", at: (0, 0, 50))])\n"
}

#[test]
fn a_chain_of_thousands_of_joints_is_described_at_once() {
    let folder = Folder::new("chain");
    for joints in [200, 3000] {
        let machine = folder.write("chain.ron", &chain(joints));
        let begun = Instant::now();
        let text = done(&["describe", &machine]);
        // 0.01 s and 0.15 s where the program is optimised and alone; without the limit on what is counted, half a minute and out of memory.
        assert!(begun.elapsed() < Duration::from_secs(5), "{joints}: {:?}", begun.elapsed());
        assert!(
            text.contains(&format!("(here {})", joints + 2)) && text.contains("--unseen counts it up to 256"),
            "{text}"
        );
        assert!(text.contains(&format!("j{}", joints - 1)));
    }
    let machine = folder.write("chain.ron", &chain(3000));
    let text = done(&["describe", &machine, "--unseen", "--json", &folder.path("chain.json")]);
    assert!(text.contains("is not counted with more than 256 frames (here 3002)\n"), "{text}");
    let json: serde_json::Value = serde_json::from_str(&folder.read("chain.json")).expect("JSON");
    assert!(json["uncounted"].is_string() && json["identifiable"].as_array().is_some_and(Vec::is_empty));
}

#[test]
#[ignore = "long: a diagnosis of 150 recordings"]
fn hundreds_of_recordings_are_diagnosed_in_one_call() {
    let folder = Folder::new("many");
    let machine = common::machine("ac_table_tilting");
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 3));
    let instrument = Instrument::new(Sensor::Position, 1e-6, 1e-6);
    let files: Vec<PathBuf> = (0..150)
        .map(|i| {
            let text = recording(&truth, &instrument, &random_commands(&machine, 10, i), &[], i);
            folder.write(&format!("r{i}.csv"), &text).into()
        })
        .collect();
    let json = folder.path("diagnosis.json");
    let mut run = command();
    run.args(["diagnose", "machines/ac_table_tilting.ron", "--quiet", "--json", &json]).args(files);
    let output = run.output().expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: serde_json::Value = serde_json::from_str(&folder.read("diagnosis.json")).expect("JSON");
    assert_eq!(
        (json["samples"].as_u64(), json["recordings"].as_array().map(Vec::len)),
        (Some(1500), Some(150))
    );
}

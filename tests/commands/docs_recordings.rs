//! The examples in `docs/recordings.md` and `docs/commands.md` read as they stand.

use std::path::Path;

use crate::common;
use kincal::identify::{BeforeAfter, CalibrateOptions, calibrate};
use kincal::recording::Recording;
use kincal::{CalibratedMachine, Machine};

/// The fenced blocks of one language in a document.
fn blocks(document: &str, language: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(document);
    let text = std::fs::read_to_string(path).expect("a document");
    let start = format!("```{language}\n");
    let cut = |part: &str| part.split("```").next().unwrap_or_default().to_string();
    text.split(&start).skip(1).map(cut).collect()
}

/// An example of a recording, with the machine that it names.
fn recorded(example: &str) -> (Machine, Recording) {
    let name = example.lines().next().and_then(|l| l.strip_prefix("# machine: ")).expect("a machine first");
    let machine = common::machine(name);
    let recording = Recording::from_bytes("example.csv", example.to_string().into_bytes(), &machine)
        .unwrap_or_else(|e| panic!("{e}\n{example}"));
    (machine, recording)
}

#[test]
fn examples_of_recordings_parse_and_cover_every_measurement() {
    let examples = blocks("recordings.md", "csv");
    let mut kinds: Vec<&str> = Vec::new();
    for example in &examples {
        let (_, recording) = recorded(example);
        let summary = recording.scan().unwrap_or_else(|e| panic!("{e}\n{example}"));
        assert!(summary.warnings.is_empty(), "{:?}\n{example}", summary.warnings);
        assert!(summary.samples >= 3);
        kinds.push(recording.header().measurement.word());
    }
    for kind in ["distance", "position", "pose", "displacement", "joint"] {
        assert!(kinds.contains(&kind), "{kind} has no example");
    }
}

#[test]
fn examples_of_recordings_calibrate_and_are_of_their_machine() {
    for example in blocks("recordings.md", "csv") {
        let (machine, recording) = recorded(&example);
        let (_, fit) = calibrate(&machine, &[recording], CalibrateOptions::default())
            .unwrap_or_else(|e| panic!("{e}: {}\n{example}", e.mend()));
        // Readings of this machine: as declared it explains them within five of its tolerances, at a reach of a metre.
        let tolerances = (0..machine.dyads().len()).map(|j| machine.tolerance(j));
        let (m, rad) =
            tolerances.fold((0.0f64, 0.0f64), |(m, rad), t| (m.max(t.translation), rad.max(t.rotation)));
        let nominal = |rms: Option<BeforeAfter>| rms.map_or(0.0, |rms| rms.nominal);
        let (off_m, off_rad) = (nominal(fit.rms.m), nominal(fit.rms.rad));
        assert!(off_m < 5.0 * (m + rad) && off_rad < 5.0 * rad, "off by {off_m} m, {off_rad} rad\n{example}");
    }
}

#[test]
fn the_first_example_has_one_drop_out_and_the_last_one_pause() {
    let examples = blocks("recordings.md", "csv");
    let scan = |example: &String, machine: &str| {
        let machine = common::machine(machine);
        let recording = Recording::from_bytes("e.csv", example.clone().into_bytes(), &machine);
        recording.and_then(|r| r.scan()).unwrap_or_else(|e| panic!("{e}"))
    };
    assert_eq!(scan(&examples[0], "ac_table_tilting").dropped, 1);
    assert_eq!(scan(examples.last().expect("examples"), "rotary_axis").pauses, 1);
}

#[test]
fn every_header_key_and_unit_is_documented() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/recordings.md");
    let text = std::fs::read_to_string(path).expect("a document");
    for unit in kincal::units::UNITS {
        let symbol = unit.symbol;
        let stands = |c: char| format!("{c}{symbol}");
        assert!(text.contains(&stands(' ')) || text.contains(&stands('`')), "{symbol}");
    }
}

#[test]
fn the_example_of_a_calibrated_file_reads() {
    let block = blocks("commands.md", "ron").remove(0);
    let machine =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("machines/ac_table_tilting.ron"))
            .expect("a machine");
    let (start, _) = machine.rsplit_once(')').expect("a bracket");
    let calibrated = CalibratedMachine::parse("example.ron", &format!("{start}{block})"))
        .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(calibrated.samples(), 1761);
    assert_eq!(calibrated.lengths().next(), Some(("hall", 0.1000021)));
    let (setup, of, zero) = calibrated.zeros().next().expect("a zero");
    assert!((setup, of) == ("hall", "c") && (zero - 0.0011f64.to_radians()).abs() < 1e-15);
}

//! Error motions of the axes as they are exported: each deviation where ISO 230-1 has its name.

use std::path::Path;

use kincal::CalibratedMachine;
use kincal::export::{ExportOptions, Format, export};

/// A table that turns and shifts, a slide that pitches.
const MACHINE: &str = r#"Machine(
    name: "two", units: (length: mm, angle: deg),
    workpiece: [(frame: "c", joint: Revolute(axis: "z", travel: (-180, 180))), (frame: "w", at: (30, 0, 50))],
    tool: [(frame: "x", at: (0, 0, 300), joint: Prismatic(axis: "x", travel: (-200, 200))), (frame: "t", at: (0, 0, -80))],
    calibration: (
        deviations: [(frame: "x", v: (0, 0.02, 0), w: (0, 0, 0))],
        unseen: [],
        effects: [
            (effect: "angular_error", at: "x", terms: [(value: 1e-4, unit: "rad/m", parts: [(slot: After("x"), v: (0, 0, 0), w: (0, 1, 0), feature: Of("x", Position))])]),
            (effect: "radial_runout", at: "c", terms: [(value: 5e-6, unit: "m", parts: [(slot: Before("c"), v: (1, 0, 0), w: (0, 0, 0), feature: Cos(Of("c", Position)))])]),
            (effect: "backlash", at: "c", terms: [(value: 2e-5, unit: "rad", parts: [(slot: Before("c"), v: (0, 0, 0), w: (0, 0, 1), feature: Product([Number(-0.5), Of("c", Direction)]))])]),
        ],
    ),
)"#;

/// Rows of one name: position, forward, backward, reversal.
fn rows(text: &str, name: &str, units: (&str, &str)) -> Vec<[f64; 4]> {
    let own = text.lines().filter(|line| line.split(',').nth(1) == Some(name));
    own.map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!((cells[3], cells[7]), units, "{line}");
        [2, 4, 5, 6].map(|i| cells[i].parse().expect("a number"))
    })
    .collect()
}

fn same(a: f64, b: f64) {
    assert!((a - b).abs() < 2e-3, "{a} {b}");
}

#[test]
fn error_motions_stand_under_their_names() {
    let calibrated = CalibratedMachine::parse("two.ron", MACHINE).unwrap_or_else(|e| panic!("{e}"));
    let text = export(&calibrated, Format::ErrorMotions, &ExportOptions::default()).expect("motions").text;
    // The slide pitches about its own frame, and takes the tip with it, 80 mm below.
    let pitch = rows(&text, "EBX", ("mm", "urad"));
    assert_eq!(pitch.len(), 21);
    pitch.iter().for_each(|[q, forward, backward, _]| {
        same(*forward, 0.1 * q);
        same(*backward, 0.1 * q);
    });
    rows(&text, "EXX", ("mm", "um")).iter().for_each(|[q, forward, ..]| same(*forward, -0.08 * 0.1 * q));
    // The table is what moves, not the tool: its displacement has the sign of its own deviation.
    let shift = rows(&text, "EXC", ("deg", "um"));
    assert_eq!(shift.len(), 21);
    shift.iter().for_each(|[q, forward, ..]| same(*forward, 5.0 * (q.to_radians().cos() - 1.0)));
    rows(&text, "ECC", ("deg", "urad")).iter().for_each(|[_, forward, backward, reversal]| {
        same(*forward, -10.0);
        same(*backward, 10.0);
        same(*reversal, -20.0);
    });
    for name in ["EYX", "EZX", "EAX", "ECX", "EZC", "EAC", "EBC"] {
        assert!(rows(&text, name, ("", "")).is_empty(), "{name}\n{text}");
    }
}

#[test]
fn a_position_error_is_that_of_the_table_of_positions() {
    let lift = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/exports/lift.ron");
    let lift = CalibratedMachine::open(lift).expect("sound");
    let text = export(&lift, Format::ErrorMotions, &ExportOptions::default()).expect("motions").text;
    let table = export(&lift, Format::Table, &ExportOptions::default()).expect("curves").text;
    let other: Vec<Vec<&str>> =
        table.lines().filter(|l| l.starts_with("z,")).map(|l| l.split(',').collect()).collect();
    let own = rows(&text, "EZZ", ("mm", "um"));
    assert_eq!(own.len(), other.len());
    for ([q, forward, backward, reversal], cells) in own.iter().zip(&other) {
        let number = |i: usize| cells[i].parse::<f64>().expect("a number");
        same(*q, number(1));
        same(*forward, number(3));
        same(*backward, number(4));
        same(*reversal, -6.0);
    }
}

#[test]
fn a_machine_without_error_motions_is_told_how_to_find_them() {
    let mill = Path::new(env!("CARGO_MANIFEST_DIR")).join("machines/xyz_mill.ron");
    let mill = CalibratedMachine::open(mill).expect("sound");
    let error = export(&mill, Format::ErrorMotions, &ExportOptions::default()).expect_err("nothing varies");
    assert_eq!(error.to_string(), "no axis of machine \"xyz_mill\" has an error that depends on where it is");
    assert!(error.mend().contains("kincal diagnose"));
}

//! Laws of compensation: what stays byte for byte, what an arc may leave, what adds up, and what real readers say.

use std::path::Path;

use crate::common;
use kincal::compensate::{
    CompensateOptions, IntegerUnit, Model, Report, Setup, UnknownAxes, VerifyOptions, compensate_text,
    compensate_with, verify_text,
};
use kincal::lie::{Twist, Vec3};
use kincal::nc::{Program, State};
use kincal::simulate::random_deviations;
use kincal::{CalibratedMachine, Chain, Machine};
use proptest::prelude::*;

use crate::common::machine;

mod any;
mod batches;
mod clients;
mod constructs;
mod linuxcnc;
mod pieces;
mod verify;

/// A shipped machine with random deviations, `size` times its tolerances.
fn erroneous(stem: &str, size: f64) -> CalibratedMachine {
    let machine = machine(stem);
    let deviations = random_deviations(&machine, size, 42);
    CalibratedMachine::nominal(machine).with_deviations(deviations)
}

fn run(calibrated: &CalibratedMachine, text: &str, options: &CompensateOptions) -> (String, Report) {
    with_setup(calibrated, text, "Setup()", options)
}

fn with_setup(
    calibrated: &CalibratedMachine,
    text: &str,
    setup: &str,
    options: &CompensateOptions,
) -> (String, Report) {
    let setup = Setup::parse("setup.ron", setup).unwrap_or_else(|e| panic!("{e}"));
    compensate_text(calibrated, "part.nc", text, &setup, options).unwrap_or_else(|e| panic!("{e}"))
}

fn message(calibrated: &CalibratedMachine, text: &str) -> String {
    let refused =
        compensate_text(calibrated, "part.nc", text, &Setup::default(), &CompensateOptions::default());
    let error = refused.err().unwrap_or_else(|| panic!("corrected:\n{text}"));
    format!("{error} | {}", error.mend())
}

/// Targets of every move in program units, followed by the tokeniser's own modal state.
fn targets(text: &str, addresses: &[&str]) -> Vec<Vec<f64>> {
    let mut program = Program::new("part.nc", text.as_bytes()).expect("readable");
    let mut state = State::new(program.dialect(), addresses.iter().copied());
    let mut all = Vec::new();
    while let Some(block) = program.next_block().expect("readable") {
        if let Some(motion) = state.apply(&block).expect("one word per axis").motion {
            all.push(motion.target.iter().map(|x| x.unwrap_or(0.0)).collect());
        }
    }
    all
}

/// Error of the tip where the joints of `ac_table_tilting` are sent to `sent` and `meant` is meant (X Y Z A C, mm and deg).
fn tip_error(actual: &Chain<f64>, machine: &Machine, meant: &[f64], sent: &[f64]) -> f64 {
    (tip(&Chain::nominal(machine), machine, meant) - tip(actual, machine, sent)).norm()
}

fn tip(chain: &Chain<f64>, machine: &Machine, program: &[f64]) -> Vec3<f64> {
    let of = |c: usize| {
        let word = machine.command_joint(c).nc_word();
        let k = ["X", "Y", "Z", "A", "C"].iter().position(|a| *a == word.address).expect("an axis");
        f64::from(word.sign) * if k < 3 { program[k] / 1e3 } else { program[k].to_radians() }
    };
    let q: Vec<f64> = (0..machine.commands().len()).map(of).collect();
    chain.w_from_t(&q).translation
}

const AXES: [&str; 5] = ["X", "Y", "Z", "A", "C"];

#[test]
fn a_modal_coordinate_is_corrected_where_it_is_not_repeated() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let text = "G21 G90\nG0 X0 Y0 Z50 A40 C10 (start)\nG1 X100. F500\n\tY-80.5 ; edge\nA41\n";
    let (out, report) = run(&calibrated, text, &CompensateOptions::default());
    let (machine, actual) = (calibrated.machine(), calibrated.chain());
    let (meant, sent) = (targets(text, &AXES), targets(&out, &AXES));
    assert_eq!(meant.len(), sent.len());
    for (meant, sent) in meant.iter().zip(&sent) {
        assert!(tip_error(&actual, machine, meant, meant) > 2e-5);
        // Three coordinates, half a digit each.
        assert!(tip_error(&actual, machine, meant, sent) < 1e-6, "{meant:?} {sent:?}\n{out}");
    }
    assert!(report.inserted_words > 4 && report.corrected_words > 4, "{report:?}");
    assert!(out.contains(" (start)\n") && out.contains("F500\n\t") && out.contains(" ; edge\n"), "{out}");
    for line in out.lines().filter(|l| l.contains('X')) {
        let places: Vec<usize> =
            ['X', 'Y', 'Z', 'A', 'C', 'F'].iter().filter_map(|c| line.find(*c)).collect();
        assert!(places.is_sorted(), "{line}");
    }
}

#[test]
fn increments_add_up_without_drift() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let mut text = String::from("G90 G0 X0 Y0 Z50 A40 C10\nG91\n");
    for k in 0..3000 {
        let (x, c) = if k % 200 < 100 { (0.7, 0.11) } else { (-0.7, -0.07) };
        text.push_str(&format!("G1 X{x} Y.03 C{c} F900\n"));
    }
    let (out, _) = run(&calibrated, &text, &CompensateOptions::default());
    let (machine, actual) = (calibrated.machine(), calibrated.chain());
    for (meant, sent) in targets(&text, &AXES).iter().zip(&targets(&out, &AXES)) {
        let left = tip_error(&actual, machine, meant, sent);
        assert!(left < 1e-6, "{left}: {meant:?} {sent:?}");
    }
}

#[test]
fn inch_programs_are_corrected_in_inches() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let metric = "G21\nG0 X50.8 Y-25.4 Z12.7 A40 C10\n";
    let inch = "G20\nG0 X2. Y-1. Z.5 A40 C10\n";
    let decimals = CompensateOptions::default().with_decimals(6);
    let (a, b) = (run(&calibrated, metric, &decimals).0, run(&calibrated, inch, &decimals).0);
    for (mm, inch) in targets(&a, &AXES)[0].iter().zip(&targets(&b, &AXES)[0]).take(3) {
        assert!((mm - 25.4 * inch).abs() < 3e-5, "{a}{b}");
    }
}

#[test]
fn arcs_become_lines_within_the_tolerance_of_the_exact_arc() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let (machine, actual) = (calibrated.machine(), calibrated.chain());
    // Start, block, centre in the plane, sweep, and the exact arc by hand.
    let exact =
        |s: f64, plane: [usize; 2], centre: [f64; 2], from: f64, sweep: f64, r: f64, rest: [f64; 2]| {
            let mut p = vec![0.0, 0.0, 0.0, 40.0, 10.0];
            let other = 3 - plane[0] - plane[1];
            let angle = from + sweep * s;
            p[plane[0]] = centre[0] + r * angle.cos();
            p[plane[1]] = centre[1] + r * angle.sin();
            p[other] = rest[0] + (rest[1] - rest[0]) * s;
            p
        };
    use std::f64::consts::PI;
    type Case<'a> = (&'a str, &'a str, [usize; 2], [f64; 2], f64, f64, f64, [f64; 2]);
    let cases: [Case; 8] = [
        ("X30 Y0 Z5", "G17 G3 X0 Y30 I-30 J0", [0, 1], [0.0, 0.0], 0.0, PI / 2.0, 30.0, [5.0, 5.0]),
        ("X30 Y0 Z5", "G2 X30 Y0 I-30", [0, 1], [0.0, 0.0], 0.0, -2.0 * PI, 30.0, [5.0, 5.0]),
        ("X30 Y0 Z5", "G2 X0 Y30 R-30", [0, 1], [0.0, 0.0], 0.0, -1.5 * PI, 30.0, [5.0, 5.0]),
        ("X30 Y0 Z5", "G3 X0 Y30 R30", [0, 1], [0.0, 0.0], 0.0, PI / 2.0, 30.0, [5.0, 5.0]),
        ("X30 Y0 Z5", "G3 X0 Y30 Z-2 I-30 J0 P3", [0, 1], [0.0, 0.0], 0.0, 4.5 * PI, 30.0, [5.0, -2.0]),
        ("X0 Y7 Z20", "G18 G2 X20 Z0 I0 K-20", [2, 0], [0.0, 0.0], 0.0, -1.5 * PI, 20.0, [7.0, 7.0]),
        ("X4 Y20 Z0", "G19 G3 Y0 Z20 J-20 K0", [1, 2], [0.0, 0.0], 0.0, PI / 2.0, 20.0, [4.0, 4.0]),
        ("X30 Y10 Z5", "G90.1 G3 X0 Y40 I0 J10", [0, 1], [0.0, 10.0], 0.0, PI / 2.0, 30.0, [5.0, 5.0]),
    ];
    for tolerance in [2e-6, 2e-5] {
        for (start, block, plane, centre, from, sweep, r, rest) in cases {
            let text = format!("G21 G90\nG0 {start} A40 C10\n{block} F800 (arc)\nG1 X1 Y2 Z3\n");
            let options = CompensateOptions::default().with_arcs(tolerance);
            let (out, report) = run(&calibrated, &text, &options);
            assert_eq!(report.split_arcs, 1);
            assert!(report.largest_arc_m.value <= tolerance, "{block}: {:?}", report.largest_arc_m);
            let sent = targets(&out, &AXES);
            let points = &sent[..sent.len() - 1];
            assert_eq!(points.len() as u64, report.arc_lines + 1, "{out}");
            let ideal = |s: f64| {
                tip(&Chain::nominal(machine), machine, &exact(s, plane, centre, from, sweep, r, rest))
            };
            // Every point of every line, against the arc nearby.
            let lines = points.len() - 1;
            for k in 0..lines {
                for part in [0.1, 0.35, 0.5, 0.8, 1.0] {
                    let mix: Vec<f64> =
                        points[k].iter().zip(&points[k + 1]).map(|(a, b)| a + (b - a) * part).collect();
                    let p = tip(&actual, machine, &mix);
                    let at = (k as f64 + part) / lines as f64;
                    let near = (-20..=20).map(|i| at + f64::from(i) * 0.002 / lines as f64);
                    let off = near.map(|s| (ideal(s) - p).norm()).fold(f64::MAX, f64::min);
                    assert!(off <= tolerance, "{block} at {at}: {off}");
                }
            }
            assert!(!out.contains("G2 ") && !out.contains("G3 ") && !out.contains('I'), "{out}");
            assert!(out.contains("F800 (arc)"), "{out}");
        }
    }
}

#[test]
fn the_motion_in_force_survives_an_arc_that_became_lines() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let text = "G21 G90 G0 X30 Y0 Z5 A40 C10\nG3 X0 Y30 I-30 J0 F80\nX-30 Y0 I0 J-30\nG1 X0\n";
    let (out, report) = run(&calibrated, text, &CompensateOptions::default().with_arcs(1e-4));
    assert_eq!(report.split_arcs, 2);
    // The second arc named no motion of its own.
    assert_eq!(out.matches("G1 ").count(), 3, "{out}");
    let ends = targets(&out, &AXES);
    assert!((ends.last().expect("a move")[0]).abs() < 0.5);
}

#[test]
fn under_inverse_time_every_line_has_its_share() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let text = "G21 G90 G0 X30 Y0 Z5 A40 C10\nG93 G3 X0 Y30 I-30 J0 F2.5\nG1 X4 F7\n";
    let (out, report) = run(&calibrated, text, &CompensateOptions::default().with_arcs(1e-4));
    let lines: Vec<&str> = out.lines().collect();
    let wanted = format!("F{}", 2.5 * report.arc_lines as f64);
    let count = report.arc_lines as usize;
    assert!(count > 3 && lines[1..=count].iter().all(|l| l.contains(&wanted)), "{wanted}\n{out}");
    assert!(lines[count + 1].ends_with("F7"), "{out}");
}

#[test]
fn a_split_move_leaves_less_between_its_ends() {
    let calibrated = erroneous("ac_table_tilting", 20.0);
    let text = "G21 G90 G0 X-200 Y-200 Z5 A20 C-170\nG1 X250 Y200 Z60 A80 C170 F900 M5\n";
    let unbounded = CompensateOptions::default().with_max_correction(0.01);
    let (_, whole) = run(&calibrated, text, &unbounded);
    assert!(whole.largest_mid_line_m.value > 5e-5, "{whole:?}");
    let options = unbounded.with_split(1e-5).with_decimals(4);
    let (out, split) = run(&calibrated, text, &options);
    assert_eq!(split.split_moves, 1);
    assert!(split.largest_mid_line_m.value < 1.5e-5, "{:?}", split.largest_mid_line_m);
    // The spindle stops behind the last line; the first one feeds.
    assert!(out.trim_end().ends_with("F900 M5"), "{out}");
    assert!(out.lines().nth(1).is_some_and(|l| l.starts_with("G1 X") && l.ends_with("F900")), "{out}");
    let (machine, actual) = (calibrated.machine(), calibrated.chain());
    let (meant, sent) = (targets(text, &AXES), targets(&out, &AXES));
    let last = tip_error(&actual, machine, meant.last().expect("a move"), sent.last().expect("a move"));
    assert!(last < 1e-6, "{last}");
}

#[test]
fn frames_compose() {
    let calibrated = erroneous("bc_table_tilting", 1.0);
    let options = CompensateOptions::default().with_decimals(6);
    let plain = "G710 G90\nG0 X10 Y-20 Z30 B30 C40\nTRAORI\nG1 X60 Y35 Z12\n";
    let framed =
        "G710 G90\nG0 X10 Y-20 Z30 B30 C40\nTRAORI\nTRANS X10 Y5\nAROT Z90\nATRANS Z2\nG1 X30 Y-50 Z10\n";
    let last = |text: &str| {
        let (out, _) = run(&calibrated, text, &options);
        targets(&out, &["X", "Y", "Z"]).pop().expect("a move")
    };
    let (a, b) = (last(plain), last(framed));
    let turned = [10.0 - b[1], 5.0 + b[0], 2.0 + b[2]];
    for k in 0..3 {
        assert!((a[k] - turned[k]).abs() < 3e-6, "{a:?} {b:?}");
    }
    let straight = "G90\nG0 X10 Y-20 Z30 B30 C40\nG1 X60 Y35 Z12\n";
    let a = last(straight);
    for shift in ["G92 X0 Y-25", "G52 X10 Y5"] {
        let shifted = format!("G90\nG0 X10 Y-20 Z30 B30 C40\n{shift}\nG1 X50 Y30 Z12\n");
        let b = last(&shifted);
        let moved = [b[0] + 10.0, b[1] + 5.0, b[2]];
        assert!((0..3).all(|k| (a[k] - moved[k]).abs() < 3e-6), "{a:?} {b:?}");
    }
    let turned = "G90\nG0 X10 Y-20 Z30 B30 C40\nG68 X10 Y0 R90\nG1 X45 Y-50 Z12\nG69\n";
    let b = last(turned);
    let back = [10.0 - b[1], b[0] - 10.0, b[2]];
    assert!((0..3).all(|k| (a[k] - back[k]).abs() < 3e-6), "{a:?} {b:?}");
}

#[test]
fn offsets_tools_and_machine_zero_enter_the_correction() {
    let calibrated = erroneous("bc_head_table", 1.0);
    let options = CompensateOptions::default().with_decimals(6);
    let setup = r#"Setup(zero: {"X": 7}, tools: {"4": 90}, work_offsets: {
        "G54": {"X": 107, "Z": -30, "C": 25}, "G55": {"X": 57, "Y": 10, "Z": -30, "C": 25}})"#;
    let one = "G54 T4 M6\nG43 H4\nG0 X10 Y0 Z20 B30 C15\n";
    let two = "G55 T4 M6\nG43 H4\nG0 X60 Y-10 Z20 B30 C15\n";
    let out =
        |text: &str| targets(&with_setup(&calibrated, text, setup, &options).0, &["X", "Y", "Z", "B", "C"]);
    let (a, b) = (out(one).remove(0), out(two).remove(0));
    let same = [b[0] - 50.0, b[1] + 10.0, b[2], b[3], b[4]];
    assert!((0..5).all(|k| (a[k] - same[k]).abs() < 3e-6), "{a:?} {b:?}");
    // The joints by hand: X 10 + 107 - 7 = 110, Z 20 - 30 + 90 = 80, C 40; the tip 90 mm below frame t.
    let bare = "G0 X110 Y0 Z80 B30 C40\n";
    let (c, _) = with_setup(&calibrated, bare, r#"Setup(tools: {"4": 90}, tool_at_start: "4")"#, &options);
    let c = targets(&c, &["X", "Y", "Z", "B", "C"]).remove(0);
    let same = [c[0] - 100.0, c[1], c[2] - 60.0, c[3], c[4] - 25.0];
    assert!((0..5).all(|k| (a[k] - same[k]).abs() < 3e-6), "{a:?} {c:?}");
    // With another offset in force unnamed axes stay where they are, also those that were corrected.
    let (text, _) =
        with_setup(&calibrated, "G54 T4 M6\nG43 H4\nG0 X10 Y0 Z20 B30 C15\nG55\nG1 X60\n", setup, &options);
    assert_eq!(text.lines().last().map(|l| l.matches(' ').count()), Some(1), "{text}");
}

#[test]
fn places_of_the_machine_stay() {
    let calibrated = erroneous("bc_table_tilting", 1.0);
    let text = "G90 G53 G0 Z300\nG53 G0 X-100 Y50\nG0 B20 C10\nG0 X1 Y2 Z30\nG28 Z0\nG0 X5\n";
    let (out, report) = run(&calibrated, text, &CompensateOptions::default());
    let lines: Vec<&str> = out.lines().collect();
    assert_eq!(lines[..2], text.lines().collect::<Vec<_>>()[..2]);
    assert!(lines[2].starts_with("G0 B") && !lines[2].contains('X'), "{out}");
    assert_eq!(lines[4], "G28 Z0");
    assert!(!lines[5].contains('Z'), "{out}");
    assert_eq!(report.machine_moves, 3);
}

#[test]
fn drilling_cycles_are_corrected_in_their_plane() {
    let calibrated = erroneous("xyz_mill", 5.0);
    let (out, report) = run(
        &calibrated,
        "G90 G0 X100 Y200 Z50\nG81 X100 Y200 Z-12 R2 F100\nX300\nG80\n",
        &CompensateOptions::default(),
    );
    assert_eq!(report.cycles, 2);
    let lines: Vec<&str> = out.lines().collect();
    assert!(lines[1].contains(" Z-12 R2 F100") && !lines[1].contains("X100 "), "{out}");
    assert!(lines[2].starts_with('X') && !lines[2].contains('Z'), "{out}");
}

#[test]
fn other_controls_are_written_in_their_own_way() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let (machine, actual) = (calibrated.machine(), calibrated.chain());
    let heidenhain = "0 BEGIN PGM T MM\n1 L X+0,5 Y-10 Z+20 A+40 C+0 R0 FMAX M3\n2 L X+30 F500\n3 L IY-5,25 IC+10\n4 M30\n5 END PGM T MM\n";
    let siemens = "G710 G90\nN10 G0 X=0.5 Y-10 Z20 A=AC(40) C=DC(0)\nN20 G1 X=IC(29.5) F500\nN30 Y=IC(-5.25) C=ACP(10)\nM30\n";
    for text in [heidenhain, siemens] {
        let (out, report) = run(&calibrated, text, &CompensateOptions::default());
        assert_eq!(report.moves, 3);
        let (meant, sent) = (targets(text, &AXES), targets(&out, &AXES));
        for (meant, sent) in meant.iter().zip(&sent) {
            // 0 may be written as nearly a turn.
            let mut sent = sent.clone();
            sent[4] -= 360.0 * ((sent[4] - meant[4]) / 360.0).round();
            assert!(tip_error(&actual, machine, meant, &sent) < 1e-6, "{out}");
        }
        assert!(out.contains("M30\n") && out.lines().count() == text.lines().count(), "{out}");
    }
    let (out, _) = run(&calibrated, heidenhain, &CompensateOptions::default());
    assert!(
        out.contains("L X+29,996 Y-9,768 F500") && out.contains(" R0 FMAX M3") && out.contains("IC+"),
        "{out}"
    );
    let (out, _) = run(&calibrated, siemens, &CompensateOptions::default());
    assert!(out.contains("X=IC(29.") && out.contains("A=AC(") && out.contains("C=DC("), "{out}");
}

#[test]
fn singular_blocks_are_told_by_line_and_travel_is_not_exceeded() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let within = "G90 G0 X0 Y0 Z0 A0 C0\nG0 A30\nG0 X340 Y390\n";
    let (_, report) = run(&calibrated, within, &CompensateOptions::default());
    assert!(report.singular.count == 1 && report.singular.first[0].line == 1, "{:?}", report.singular);
    let told = message(&calibrated, &format!("{within}G0 X350 Y400\nG0 X-550 Y-500\n"));
    assert!(told.starts_with("part.nc:") && told.contains("beyond its travel"), "{told}");
}

#[test]
fn a_correction_that_no_machine_of_these_tolerances_needs_is_refused() {
    let calibrated = erroneous("ac_table_tilting", 60.0);
    let text = "G90 G0 X0 Y0 Z0 A0 C0\nG1 X100 Y50 A30 F500\n";
    let told = message(&calibrated, text);
    assert!(told.contains("are taken for a correction") && told.contains("--max-correction"), "{told}");
    run(&calibrated, text, &CompensateOptions::default().with_max_correction(0.1));
}

#[test]
fn a_preset_means_the_place_that_the_program_means() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let text = "G21 G90\nG0 X30. Y-20. Z40. A20. C30.\nG92 X0. Y0.\nG1 X5. Y7. F500\n";
    let (out, _) = run(&calibrated, text, &CompensateOptions::default());
    // The control presets where it stands: its own frame is that place less the number.
    let lines: Vec<Vec<f64>> =
        out.lines().map(|line| targets(line, &["X", "Y"]).pop().unwrap_or_default()).collect();
    let preset = out.lines().nth(2).expect("a line");
    let number = |address: char| -> f64 {
        let text = preset.split(address).nth(1).expect("a word");
        text.split_ascii_whitespace().next().expect("a number").parse().expect("a number")
    };
    let sent = [lines[1][0] - number('X') + lines[3][0], lines[1][1] - number('Y') + lines[3][1]];
    let plain = "G21 G90\nG0 X30. Y-20. Z40. A20. C30.\nG1 X35. Y-13. F500\n";
    let (plain, _) = run(&calibrated, plain, &CompensateOptions::default());
    let wanted = targets(&plain, &["X", "Y"]).pop().expect("a move");
    assert!(
        (sent[0] - wanted[0]).abs() < 2.1e-6 && (sent[1] - wanted[1]).abs() < 2.1e-6,
        "{sent:?} {wanted:?}\n{out}"
    );
}

#[test]
fn a_rotary_move_that_gets_linear_words_keeps_its_time() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let text = "G21 G90 G94\nG1 X30. Y-20. Z40. A20. C30. F500.\nG1 C120. F600.\nG1 X31.\n";
    let (out, _) = run(&calibrated, text, &CompensateOptions::default());
    let lines: Vec<&str> = out.lines().collect();
    assert!(lines[2].starts_with("G1 G93 ") && lines[2].contains("X"), "{out}");
    // 90 deg at 600 deg/min.
    assert!(lines[2].ends_with("F6.666667") && lines[3] == "G94 F600.", "{out}");
    assert!(lines[4].starts_with("G1 X31.06") && !lines[4].contains('F'), "{out}");
    let heidenhain = "0 BEGIN PGM T MM\n1 L X+30 Y-20 Z+40 A+20 C+30 F500\n2 L C+120 F600\n";
    assert!(message(&calibrated, heidenhain).contains("degrees per minute"));
}

#[test]
fn axes_that_went_elsewhere_get_no_word_until_the_program_names_them() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let setup = r#"Setup(tools: {"2": 100})"#;
    let text =
        "G21 G90\nG0 X10. Y10. Z10. A20. C30.\nT2 M6\nG0 X50. Y-50. A40.\nG43 H2 Z100.\nG1 X51. F500\n";
    let (out, report) = with_setup(&calibrated, text, setup, &CompensateOptions::default());
    assert!(!out.lines().nth(3).expect("a line").contains('Z'), "{out}");
    assert_eq!((report.unknown_places.count, report.unknown_places.first[0].line), (1, 4));
    assert_eq!(report.unknown_places.first[0].axes, ["Z"]);
    let refuses = CompensateOptions::default().with_unknown(UnknownAxes::Refuse);
    let setup = Setup::parse("setup.ron", setup).unwrap_or_else(|e| panic!("{e}"));
    let error = compensate_text(&calibrated, "part.nc", text, &setup, &refuses).expect_err("Z is unknown");
    assert!(error.to_string().starts_with("part.nc:4:1: "), "{error}");
}

#[test]
fn a_sub_program_with_one_context_is_corrected_once() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let body = "G1 X10. Y5. Z-2. A20. C30. F200\nX40.\nG0 Z20.\n";
    let inline = format!("G90 G0 X0. Y0. Z20. A20. C30.\n{body}G0 X0. Y0. Z20.\n{body}M30\n");
    let (flat, _) = run(&calibrated, &inline, &CompensateOptions::default());
    let called = format!(
        "%\nO0007\nG90 G0 X0. Y0. Z20. A20. C30.\nM98 P100\nG0 X0. Y0. Z20.\nM98 P100\nM30\nO0100 (pocket)\n{body}M99\n%\n"
    );
    let (out, _) = run(&calibrated, &called, &CompensateOptions::default());
    for line in flat.lines().skip(1).take(3) {
        assert!(out.contains(line), "{line}\n{out}");
    }
    let linuxcnc =
        format!("o<pocket> sub\n{body}o<pocket> endsub\nG90 G0 X0. Y0. Z20. A20. C30.\no<pocket> call\nM2\n");
    let (out, _) = run(&calibrated, &linuxcnc, &CompensateOptions::default());
    for line in flat.lines().skip(1).take(3) {
        assert!(out.contains(line), "{line}\n{out}");
    }
    // Increments from two places need two corrections.
    let twice = "O1\nG90 G0 X0. Y0. Z20. A20. C30.\nM98 P2\nG0 X-350. Y-200. C90.\nM98 P2\nM30\nO2\nG91 G1 X50. Z-30. F9\nZ30.\nG90\nM99\n";
    assert!(
        message(&calibrated, twice).contains("calls need different corrections"),
        "{}",
        message(&calibrated, twice)
    );
}

#[test]
fn errors_below_the_written_digits_leave_the_program_alone() {
    let calibrated = erroneous("ac_table_tilting", 1e-5);
    let text = "G21 G90\nG0 X1.5 Y-2. Z+3 A10. C20\nG91 G1 X-.001 F9\nG3 X10 Y10 I10 (arc)\nG90 G1 X007.0\n";
    assert_eq!(run(&calibrated, text, &CompensateOptions::default()).0, text);
}

#[test]
fn a_program_without_motion_comes_back() {
    let calibrated = erroneous("ac_table_tilting", 10.0);
    let text =
        "%\r\nO1 (no motion)\r\nG21 G90 G94 S1000 M3\r\n(X1 Y2)\r\n\r\nG4 P1.5\r\n#5=[1+2]\r\nM5\r\nM30\r\n%";
    assert_eq!(run(&calibrated, text, &CompensateOptions::default()).0, text);
}

#[test]
fn every_bad_program_has_a_message_and_a_mend() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad/programs");
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .expect("part of the project")
        .map(|e| e.expect("readable").path())
        .collect();
    files.sort();
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let options = CompensateOptions::default();
    let lines: Vec<String> = files
        .into_iter()
        .map(|path| {
            let mut out = Vec::new();
            let refused =
                kincal::compensate::compensate(&calibrated, &path, &Setup::default(), &options, &mut out);
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            let error = refused.err().unwrap_or_else(|| panic!("{name} was corrected"));
            let place = error.place().unwrap_or_else(|| panic!("{name}: no place in {error}"));
            assert!(place.line > 0 && !error.mend().is_empty(), "{error}");
            let folder = format!("{}/", path.parent().expect("a folder").display());
            format!("{} | {}", error.to_string().replace(&folder, ""), error.mend())
        })
        .collect();
    insta::assert_snapshot!(lines.join("\n"));
}

#[test]
fn numbers_without_a_point_count_what_is_said() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let um = CompensateOptions::default().with_integer_unit(IntegerUnit::Um);
    let counted = "G90 G0 X10000 Y-5000 Z30. A20000 C0\nG1 X20500 F500\nG91 G1 X-1000 C007500\nG90 G3 X19500 Y0 I0 J2500 F300\nM30\n";
    let pointed = "G90 G0 X10. Y-5. Z30. A20. C0\nG1 X20.5 F500\nG91 G1 X-1. C7.5\nG90 G3 X19.5 Y0. I0. J2.5 F300\nM30\n";
    let arcs = |options: CompensateOptions| options.with_arcs(5e-6);
    let (a, told) = run(&calibrated, counted, &arcs(um));
    let (b, _) = run(&calibrated, pointed, &arcs(CompensateOptions::default()));
    // The same places, whatever their numbers look like.
    let read_a = |text: &str| {
        let how = VerifyOptions::default().with_integer_unit(IntegerUnit::Um);
        verify_text(&calibrated, counted, text, &Setup::default(), &how).unwrap_or_else(|e| panic!("{e}"))
    };
    assert!(read_a(&a).holds(), "{a}");
    assert!(read_a(&b).largest_end_m.value < 2e-6, "{b}");
    assert_eq!(told.numbers_without_point, 0);
    // By default they are millimetres, and it is told that there are such.
    let (_, told) =
        run(&calibrated, "G90 G0 X10 Y-5 Z30. A20 C0\nG1 X20.5 F500\n", &CompensateOptions::default());
    assert_eq!(told.numbers_without_point, 3);
    let refused = |text: &str, options: &CompensateOptions| {
        let out = compensate_text(&calibrated, "part.nc", text, &Setup::default(), options);
        out.err().map_or_else(String::new, |error| format!("{error} | {}", error.mend()))
    };
    let inch = refused("G90\nG20 G0 X10\n", &um);
    assert!(inch.starts_with("part.nc:2:1: numbers without a point are to count um"), "{inch}");
    let siemens = refused("G90\nG0 X10\n", &um.with_dialect(kincal::nc::Dialect::Siemens));
    assert!(siemens.contains("this control never does") && siemens.contains("--integer-unit"), "{siemens}");
}

mod data_sets {
    use super::*;

    #[test]
    #[ignore = "needs the data sets, see tests/real"]
    fn real_part_programs_go_through() {
        // The programs' machine goes further along z than the one that is shipped.
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("machines/bc_table_tilting.ron");
        let text = std::fs::read_to_string(file).expect("part of the project");
        let taller = text.replace("travel: (-300, 400)", "travel: (-600, 700)");
        let machine = Machine::parse("bc_table_tilting.ron", &taller).unwrap_or_else(|e| panic!("{e}"));
        let deviations = random_deviations(&machine, 1.0, 4);
        let calibrated = CalibratedMachine::nominal(machine).with_deviations(deviations);
        let setup = r#"Setup(reference_length: 100, work_offsets: {"G54": {"Z": -100}}, tools: {"PLAN_D50_N_AP4": 100,
            "SCHAFT_D12_N_AP30": 100, "SCHAFT_D6_N_AP15": 100, "ENTFRAESER_D8_N_90GRAD": 100, "BOHRER_D3.3_VHM": 100})"#;
        for name in ["keychain", "axis_cross"] {
            let path = common::data(&format!("data/spinner-u5-nc/{name}.mpf"));
            let text = std::fs::read_to_string(path).expect("readable");
            let options = CompensateOptions::default().with_arcs(5e-6);
            let (out, report) = with_setup(&calibrated, &text, setup, &options);
            assert!(report.split_arcs > 50 && report.largest_arc_m.value <= 5e-6, "{name}: {report:?}");
            assert!(report.largest_left_m.value < 2e-6, "{name}: {:?}", report.largest_left_m);
            let how = VerifyOptions::default().with_tolerance(report.largest_left_m.value + 1e-9);
            let setup = Setup::parse("setup.ron", setup).unwrap_or_else(|e| panic!("{e}"));
            let found = verify_text(&calibrated, &text, &out, &setup, &how).unwrap_or_else(|e| panic!("{e}"));
            assert!(found.holds() && found.judged > 500, "{name}: {found:?}");
            // What is no motion stays as it was.
            let still = |text: &str| -> Vec<String> {
                let quiet = ["MSG", "CYCLE", "DEF", "T=", "TRA", "AROT", "SUPA", ";", "M5", "M6", "COMPOF"];
                text.lines().filter(|l| quiet.iter().any(|q| l.contains(q))).map(String::from).collect()
            };
            assert_eq!(still(&text), still(&out), "{name}");
        }
    }
}

#[test]
fn an_arc_names_the_axes_that_it_needs_or_is_refused() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let (machine, actual) = (calibrated.machine(), calibrated.chain());
    let text = "G21 G90\nG0 X30 Y0 A40 C10\nG1 X31 F800\nX30\nG3 X0 Y30 I-30 J0 F800\n";
    let options = CompensateOptions::default().with_arcs(1e-5).with_unknown(UnknownAxes::Keep);
    // Z stands somewhere, and no word says where.
    let refused =
        compensate_text(&calibrated, "part.nc", text, &Setup::default(), &options).expect_err("no Z");
    let told = format!("{refused} | {}", refused.mend());
    assert!(told.starts_with("part.nc:5:1: ") && told.contains("has not placed Z before it"), "{told}");
    assert!(told.contains("start: {\"Z\": ...}"), "{told}");
    // So it is where Z was only ever sent to a place of the machine.
    let parked = text.replacen("G0", "G53 G0 Z0\nG0", 1);
    assert!(compensate_text(&calibrated, "part.nc", parked, &Setup::default(), &options).is_err());
    // A word elsewhere, or the set-up, says where: the word that is missing in the arc is written.
    let elsewhere = text.replacen("G1 X31", "G1 X31 Z5", 1);
    for (text, setup) in [(text, "Setup(start: {\"Z\": 5})"), (elsewhere.as_str(), "Setup()")] {
        let (out, report) = with_setup(&calibrated, text, setup, &options);
        assert!(report.split_arcs == 1 && report.largest_arc_m.value <= 1e-5, "{report:?}");
        let arc: Vec<&str> = out.lines().skip(4).collect();
        assert!(arc.iter().filter(|line| line.contains('Z')).count() > 2, "{out}");
        let mut sent = targets(&out, &AXES);
        let end = sent.pop().expect("a move");
        assert!(tip_error(&actual, machine, &[0.0, 30.0, 5.0, 40.0, 10.0], &end) < 2e-6, "{end:?}");
    }
}

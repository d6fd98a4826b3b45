//! Verification holds what compensation writes, and nothing else.

use super::*;
use kincal::compensate::Verification;

/// Arcs, increments, a frame, a cycle and a rotary move at feed.
const PROGRAM: &str = "G21 G90 G94\nG0 X30. Y0. Z40. A20. C10.\nG1 Z10. F800.\nX35. Y4. C25.\nG3 X0. Y35.2278 I-35. J-4. F600.\nG91 G1 X5. Z-2.\nG90\n\
    G1 C90.\nG52 X10. Y5.\nX3. Y2. A35.\nG52 X0. Y0.\nG0 Z60.\nG81 X20. Y10. Z5. R50. F100.\nX25.\nG80\nG0 X0. Y0. Z80.\nM30\n";

/// What verification says of a program and what was written for it.
fn verified(
    calibrated: &CalibratedMachine,
    (program, written): (&str, &str),
    options: &VerifyOptions,
) -> Verification {
    verify_text(calibrated, program, written, &Setup::default(), options).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn what_is_written_is_where_it_is_meant_on_every_five_axis_machine() {
    for stem in ["ac_table_tilting", "ac_head_head", "bc_table_tilting", "bc_head_table", "bc_nutating_table"]
    {
        let calibrated = erroneous(stem, 1.0);
        let program = if stem.starts_with('b') { PROGRAM.replace('A', "B") } else { PROGRAM.to_string() };
        let (out, _) = run(&calibrated, &program, &CompensateOptions::default().with_arcs(5e-6));
        let found = verified(&calibrated, (&program, &out), &VerifyOptions::default());
        assert!(found.holds() && found.judged > 8, "{stem}: {found:?}\n{out}");
        assert!(found.largest_end_m.value < 1.5e-6, "{stem}: {found:?}");
    }
}

#[test]
fn a_wrong_digit_a_lost_line_and_a_line_too_many_are_found() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let (out, _) = run(&calibrated, PROGRAM, &CompensateOptions::default().with_arcs(5e-6));
    let options = VerifyOptions::default();
    // The program as it was is off by its whole correction.
    assert!(verified(&calibrated, (PROGRAM, PROGRAM), &options).departures.count > 5);
    let lines: Vec<&str> = out.lines().collect();
    let fourth = lines[3].replacen("X35.", "X36.", 1).replacen("X34.", "X35.", 1);
    assert_ne!(fourth, lines[3], "{out}");
    let wrong = out.replacen(lines[3], &fourth, 1);
    let found = verified(&calibrated, (PROGRAM, &wrong), &options);
    assert!(
        found
            .departures
            .first
            .iter()
            .any(|d| d.line == 4 && d.end_m.is_some_and(|end| (end - 1e-3).abs() < 1e-4)),
        "{found:?}"
    );
    let lost = out.replacen(&format!("{}\n", lines[2]), "", 1);
    assert!(!verified(&calibrated, (PROGRAM, &lost), &options).holds());
    let more = out.replacen("M30", "G1 X7. F100.\nM30", 1);
    let found = verified(&calibrated, (PROGRAM, &more), &options);
    assert!(found.departures.first.iter().any(|d| d.line == 0), "{found:?}");
}

#[test]
fn a_program_is_compensated_once_and_says_from_what() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let options = CompensateOptions::default().with_arcs(5e-6).with_mark();
    let (out, _) = run(&calibrated, PROGRAM, &options);
    let (bare, _) = run(&calibrated, PROGRAM, &CompensateOptions::default().with_arcs(5e-6));
    let mark = out.strip_prefix(&bare).unwrap_or_else(|| panic!("{out}"));
    assert!(mark.starts_with("(KINCAL ") && mark.ends_with(")\n"), "{mark}");
    // Once more: refused, whatever the machine, unless it is wanted.
    let other_model = calibrated.clone().with_deviations(random_deviations(calibrated.machine(), 1.0, 43));
    let other_machine = erroneous("ac_head_head", 1.0);
    let line = out.lines().count();
    for (machine, how) in [
        (&calibrated, "for this machine and with this model"),
        (&other_model, "for this machine and with another model"),
        (&other_machine, "for another machine"),
    ] {
        let told = message(machine, &out);
        let expected = format!("part.nc:{line}:1: this program is compensated already, {how}");
        assert!(told.starts_with(&expected) && told.contains("--force"), "{told}");
    }
    let (twice, _) = run(&calibrated, &out, &options.with_force());
    assert_ne!(twice, out);
    // What it was written from is held against its mark.
    let told = |calibrated: &CalibratedMachine, program: &str| {
        let found = verify_text(calibrated, program, &out, &Setup::default(), &VerifyOptions::default());
        found.err().map_or_else(|| "nothing".to_string(), |error| error.to_string())
    };
    assert_eq!(told(&calibrated, PROGRAM), "nothing");
    assert!(told(&calibrated, &PROGRAM.replace("X35.", "X34.")).contains("from another program"));
    assert!(told(&other_model, PROGRAM).contains("with another model"));
    assert!(told(&other_machine, PROGRAM).contains("for another machine"));
    // Where nothing is corrected, nothing is written.
    let nominal = CalibratedMachine::nominal(calibrated.machine().clone());
    assert_eq!(run(&nominal, PROGRAM, &options).0, PROGRAM);
    let still = "G21 G90\nM30\n";
    assert_eq!(run(&calibrated, still, &options).0, still);
}

/// A scale error of one percent along `x`, seen between -50 and 50 mm.
const SCALED: &str = r#"Machine(
    name: "mill", units: (length: mm, angle: deg),
    workpiece: [(frame: "w")],
    tool: [(frame: "x", joint: Prismatic(axis: "x")), (frame: "y", joint: Prismatic(axis: "y")),
           (frame: "c", joint: Revolute(axis: "z")), (frame: "t")],
    calibration: (
        deviations: [],
        seen: [(joint: "x", from: -50, to: 50), (joint: "y", from: -50, to: 50), (joint: "c", from: 0, to: 100)],
        effects: [(
            effect: "scale_error", at: "x", says: "", sizes: [],
            terms: [(value: 1e-2, unit: "m/m", parts: [(slot: Before("x"), v: (1.0, 0.0, 0.0), w: (0.0, 0.0, 0.0), feature: Of("x", Position))])],
        )],
    ),
)"#;

#[test]
fn a_model_is_not_continued_far_beyond_what_it_has_seen() {
    let calibrated = CalibratedMachine::parse("mill.ron", SCALED).unwrap_or_else(|e| panic!("{e}"));
    let options = CompensateOptions::default();
    // A little beyond: corrected, and told with the joint and by how much.
    let (out, report) = run(&calibrated, "G21 G90\nG1 X60. Y0. C0. F500\nY-80.\nC460.\n", &options);
    assert!(out.contains("X59.406"), "{out}");
    let beyond: Vec<(&str, f64, usize)> =
        report.extrapolated_joints.iter().map(|b| (b.joint.as_str(), b.by.value, b.by.line)).collect();
    assert_eq!(report.extrapolated_moves, 3);
    assert_eq!(beyond[0].0, "x");
    assert!((beyond[0].1 - 0.01).abs() < 1e-12 && beyond[0].2 == 2, "{beyond:?}");
    assert!((beyond[1].1 - 0.03).abs() < 1e-12 && beyond[1].2 == 3, "{beyond:?}");
    // c comes back to where it was seen after a whole turn.
    assert_eq!(beyond.len(), 2);
    // So far that the scale alone moves the tip further than any machine of these tolerances would be off.
    let far = "G21 G90\nG1 X60. Y0. C0. F500\nX2000.\n";
    let told = message(&calibrated, far);
    assert!(
        told.starts_with("part.nc:3:1: the model is continued beyond") && told.contains("by x: "),
        "{told}"
    );
    assert!(run(&calibrated, far, &options.with_force().with_max_correction(1.0)).0.contains("X1980.198"));
    // Constant deviations are the same everywhere.
    let square = CalibratedMachine::parse("mill.ron", &SCALED.replace("value: 1e-2", "value: 0"))
        .unwrap_or_else(|e| panic!("{e}"))
        .with_deviations(random_deviations(calibrated.machine(), 1.0, 1));
    assert!(run(&square, "G21 G90\nG1 X400. Y0. C0. F500\n", &options).1.extrapolated_moves == 1);
}

#[test]
fn lines_before_a_block_that_ends_the_program_take_its_modes_over() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let text =
        "G21 G90\nG0 X30. Y0. Z40. A20. C10.\nG91\nG1 X5. F500.\nG90 G3 X0. Y35. I-35. J0. F600. M30\n";
    let (out, _) = run(&calibrated, text, &CompensateOptions::default().with_arcs(5e-6));
    let found = verified(&calibrated, (text, &out), &VerifyOptions::default());
    assert!(found.holds() && found.judged == 3, "{found:?}\n{out}");
}

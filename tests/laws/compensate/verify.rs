//! Verification holds what compensation writes, and nothing else.

use super::*;
use kincal::compensate::{Verification, VerifyOptions, verify};

/// Arcs, increments, a frame, a cycle and a rotary move at feed.
const PROGRAM: &str = "G21 G90 G94\nG0 X30. Y0. Z40. A20. C10.\nG1 Z10. F800.\nX35. Y4. C25.\nG3 X0. Y35.2278 I-35. J-4. F600.\nG91 G1 X5. Z-2.\nG90\n\
    G1 C90.\nG52 X10. Y5.\nX3. Y2. A35.\nG52 X0. Y0.\nG0 Z60.\nG81 X20. Y10. Z5. R50. F100.\nX25.\nG80\nG0 X0. Y0. Z80.\nM30\n";

/// Both programs as files of a folder of their own, and what verification says.
fn verified(
    name: &str,
    calibrated: &CalibratedMachine,
    (program, written): (&str, &str),
    options: &VerifyOptions,
) -> Verification {
    let folder = std::env::temp_dir().join(format!("kincal_verify_{}_{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let [original, compensated] = ["part.nc", "out.nc"].map(|name| folder.join(name));
    std::fs::write(&original, program).expect("a file");
    std::fs::write(&compensated, written).expect("a file");
    let found = verify(calibrated, &original, &compensated, &Setup::default(), options)
        .unwrap_or_else(|e| panic!("{e}"));
    std::fs::remove_dir_all(&folder).expect("a folder");
    found
}

#[test]
fn what_is_written_is_where_it_is_meant_on_every_five_axis_machine() {
    for stem in ["ac_table_tilting", "ac_head_head", "bc_table_tilting", "bc_head_table", "bc_nutating_table"]
    {
        let calibrated = erroneous(stem, 1.0);
        let program = if stem.starts_with('b') { PROGRAM.replace('A', "B") } else { PROGRAM.to_string() };
        let (out, _) = run(&calibrated, &program, &CompensateOptions::default().with_arcs(5e-6));
        let found = verified(stem, &calibrated, (&program, &out), &VerifyOptions::default());
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
    assert!(verified("as_it_was", &calibrated, (PROGRAM, PROGRAM), &options).departures.count > 5);
    let lines: Vec<&str> = out.lines().collect();
    let fourth = lines[3].replacen("X35.", "X36.", 1).replacen("X34.", "X35.", 1);
    assert_ne!(fourth, lines[3], "{out}");
    let wrong = out.replacen(lines[3], &fourth, 1);
    let found = verified("digit", &calibrated, (PROGRAM, &wrong), &options);
    assert!(
        found
            .departures
            .first
            .iter()
            .any(|d| d.line == 4 && d.end_m.is_some_and(|end| (end - 1e-3).abs() < 1e-4)),
        "{found:?}"
    );
    let lost = out.replacen(&format!("{}\n", lines[2]), "", 1);
    assert!(!verified("lost", &calibrated, (PROGRAM, &lost), &options).holds());
    let more = out.replacen("M30", "G1 X7. F100.\nM30", 1);
    let found = verified("more", &calibrated, (PROGRAM, &more), &options);
    assert!(found.departures.first.iter().any(|d| d.line == 0), "{found:?}");
}

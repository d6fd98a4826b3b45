//! What controls make of numbers and feeds as they are written.

use super::*;

#[test]
fn presets_leave_no_rounding_behind() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let mut text = String::from("G21 G90\nG0 X30. Y-20. Z40. A20. C30.\n");
    for k in 0..60 {
        text.push_str(&format!("G92 X{k}. A20. C30.\nG1 X{}. A20.00{} F500\nX{k}. A20.\n", k + 1, k % 8 + 1));
    }
    let (out, _) = run(&calibrated, &text, &CompensateOptions::default());
    // Where the control's own axes stand: each preset gives its numbers to the place of the move before.
    let followed = |text: &str| {
        let (mut frame, mut last) = ([0.0; 5], [0.0; 5]);
        for line in text.lines() {
            let named = |k: usize| {
                let rest = line.split(AXES[k]).nth(1).filter(|_| !line.starts_with("G21"))?;
                rest.split_ascii_whitespace().next()?.parse::<f64>().ok()
            };
            for k in 0..5 {
                match named(k) {
                    Some(number) if line.starts_with("G92") => frame[k] = last[k] - number,
                    Some(number) => last[k] = number + frame[k],
                    None => {}
                }
            }
        }
        last
    };
    let (machine, actual) = (calibrated.machine(), calibrated.chain());
    let left = tip_error(&actual, machine, &followed(&text), &followed(&out));
    assert!(left < 1.5e-6, "{left}\n{out}");
}

#[test]
fn a_short_linear_part_does_not_hurry_a_rotary_axis() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    // At 2 deg/min a linear part of some micrometres is slower than the least feed of a control.
    let text = "G21 G90 G94\nG1 X30. Y-20. Z40. A20. C30. F500.\nG1 C30.5 F2.\nG1 X31. F500.\n";
    let (out, report) = run(&calibrated, text, &CompensateOptions::default());
    let lines: Vec<&str> = out.lines().collect();
    assert!(lines[2].starts_with("G1 C30.5") && lines[2].ends_with(" F2."), "{out}");
    assert!(!lines[2].contains('X') && !lines[3].contains('C') && !lines[3].contains('G'), "{out}");
    assert!(report.largest_mid_line_m.value > 5e-7, "{report:?}");
    let (machine, actual) = (calibrated.machine(), calibrated.chain());
    let ends = targets(&out, &AXES);
    assert_eq!(ends.len(), 4);
    assert!(tip_error(&actual, machine, &[30.0, -20.0, 40.0, 20.0, 30.5], &ends[2]) < 1e-6, "{out}");
}

#[test]
fn an_arc_holds_its_tolerance_where_the_correction_bends() {
    // Tool along the axis of C: there its correction grows from nothing within a few degrees of B.
    let calibrated = erroneous("bc_head_table", 1.5);
    let text = "G21 G90\nG0 X150 Y90 Z40 B0.1 C-25\nG3 X147 Y91.5 Z32 B-5 R6.5 F800\n";
    let options = CompensateOptions::default().with_arcs(5e-6).with_decimals(5);
    let (_, report) = run(&calibrated, text, &options);
    assert!(report.split_arcs == 1 && report.largest_arc_m.value <= 5e-6, "{report:?}");
}

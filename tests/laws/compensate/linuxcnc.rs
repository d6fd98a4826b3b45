//! LinuxCNC's interpreter makes the same moves of what was written.

use std::process::Command;

use super::*;

mod any_program;
mod by_hand;
mod client;
mod draw;
mod drawn;

/// Moves in what LinuxCNC's interpreter says.
fn canonical_moves(text: &str) -> (usize, usize) {
    static NUMBER: std::sync::atomic::AtomicUsize = std::sync::atomic::AtomicUsize::new(0);
    let number = NUMBER.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("kincal_rs274_{}_{number}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for a moment");
    let (program, tools) = (folder.join("part.ngc"), folder.join("tool.tbl"));
    std::fs::write(&program, text).expect("writable");
    std::fs::write(&tools, "T1 P1 Z40 D6\n").expect("writable");
    let out = Command::new("rs274")
        .arg("-g")
        .arg("-t")
        .arg(&tools)
        .arg(&program)
        .current_dir(&folder)
        // Where it shares its tools with other processes.
        .env("HOME", &folder)
        .output();
    let _ = std::fs::remove_dir_all(&folder);
    let out = out.unwrap_or_else(|e| panic!("rs274, the interpreter of LinuxCNC, does not start: {e}"));
    let text = String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success() && text.contains("PROGRAM_END"), "{text}");
    let count = |what: &str| text.matches(what).count();
    (count("STRAIGHT_TRAVERSE(") + count("STRAIGHT_FEED("), count("ARC_FEED("))
}

#[test]
#[ignore = "needs rs274, the interpreter of LinuxCNC"]
fn what_is_written_is_read_with_the_same_moves() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let mut text = String::from("%\n(five axes)\nG21 G90 G94 G17 G54\nT1 M6\nG43 H1\nG0 X0 Y0 Z10 A20 C0\n");
    for k in 0..400 {
        let s = f64::from(k) * 0.05;
        text.push_str(&match k % 5 {
            0 => format!("N{k} G1 X{:.3} Y{:.3} F500\n", 40.0 * s.sin(), 30.0 * s.cos()),
            1 => format!("Z{:.2}(depth)\n", 5.0 * (0.3 * s).sin()),
            2 => format!("A{:.4} C{:.4}\n", 20.0 + 30.0 * s.sin(), 20.0 * s),
            3 => "G91 X-.25 C1.5\n".to_string(),
            _ => "G90 G0 Z12.\n".to_string(),
        });
    }
    text.push_str("G93\nG1 X3 A10 F30\nG94\nM2\n%\n");
    let setup = r#"Setup(tools: {"1": 40}, work_offsets: {"G54": {"Z": -40}})"#;
    let (out, _) = with_setup(&calibrated, &text, setup, &CompensateOptions::default());
    let before = canonical_moves(&text);
    assert_eq!(canonical_moves(&out), before);
    assert!(before.0 > 390);
    // With arcs there are as many lines as the report says.
    let arcs = "%\nG21 G90 G17 G54\nT1 M6\nG43 H1\nG0 X0 Y0 Z10 A20 C0\nG2 X20 Y0 I10 J0 F300\nG3 X20 Y0 Z8 I-10 J5 P2\nG18 G2 X30 Z8 R8\nG19 G3 Y8 Z16 K8 J0\nG1 X1\nM2\n%\n";
    let options = CompensateOptions::default().with_arcs(5e-6);
    let (out, report) = with_setup(&calibrated, arcs, setup, &options);
    assert_eq!(report.split_arcs, 4);
    assert_eq!(canonical_moves(arcs), (2, 4));
    assert_eq!(canonical_moves(&out), (2 + report.arc_lines as usize, 0));
    // Sub-programs.
    let sub = "o100 sub\nG1 X10. Y5. Z-2. F200\nX40.\nG0 Z20.\no100 endsub\nG21 G90 G54\nT1 M6\nG43 H1\nG0 X0. Y0. Z20. A20. C30.\no100 call\nM2\n";
    let (out, _) = with_setup(&calibrated, sub, setup, &CompensateOptions::default());
    assert_eq!(canonical_moves(&out), canonical_moves(sub));
}

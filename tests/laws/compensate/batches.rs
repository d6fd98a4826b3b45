//! A program that many threads correct is the one that a single thread writes.

use super::*;
use std::fmt::Write;

/// On so many threads: text and report, or the message.
fn on(threads: usize, calibrated: &CalibratedMachine, program: &str, setup: &str) -> (String, String) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let setup = Setup::parse("setup.ron", setup).unwrap_or_else(|e| panic!("{e}"));
    let mut options = CompensateOptions::default().with_arcs(2e-6);
    options.marked = true;
    match pool.install(|| compensate_text(calibrated, "part.nc", program, &setup, &options)) {
        Ok((text, report)) => (text, serde_json::to_string(&report).expect("a report")),
        Err(error) => (String::new(), format!("{error} | {}", error.mend())),
    }
}

/// Errors that are the same everywhere, of which nobody is told that they are.
struct Plain(Chain<f64>);

impl Model for Plain {
    fn advance(&mut self, _: &[f64], _: &[bool]) {}

    fn chain(&self) -> &Chain<f64> {
        &self.0
    }

    fn piece(&self) -> usize {
        0
    }

    fn is_nominal(&self) -> bool {
        false
    }

    fn extrapolates(&self, _: &[f64]) -> bool {
        false
    }

    fn restart(&mut self, _: &[i8]) {}

    fn ahead(&self) -> Box<dyn Model + '_> {
        Box::new(Plain(self.0.clone()))
    }
}

/// One line after the other.
fn by_lines(calibrated: &CalibratedMachine, program: &str, setup: &str) -> (String, Report) {
    let setup = Setup::parse("setup.ron", setup).unwrap_or_else(|e| panic!("{e}"));
    let mut model = Plain(calibrated.chain());
    let options = CompensateOptions::default().with_arcs(2e-6);
    let written =
        compensate_with(calibrated.machine(), &mut model, "part.nc", program.as_bytes(), &setup, &options);
    let (bytes, report) = written.unwrap_or_else(|e| panic!("{e}"));
    (String::from_utf8(bytes).expect("text"), report)
}

/// Moves that are looked at together come to what each of them comes to: largest values to rounding.
fn is_told_alike(together: &str, apart: &Report) {
    let together: Report = serde_json::from_str(together).expect("a report");
    assert_eq!((together.moves, together.corrected_words), (apart.moves, apart.corrected_words));
    for (a, b) in [
        (together.largest_left_m, apart.largest_left_m),
        (together.largest_left_rad, apart.largest_left_rad),
        (together.largest_correction_m, apart.largest_correction_m),
        (together.largest_correction_rad, apart.largest_correction_rad),
        (together.largest_mid_line_m, apart.largest_mid_line_m),
    ] {
        // Coordinates of a metre have rounding of 1e-16 m in each of some ten steps.
        assert!((a.value - b.value).abs() < 1e-14 && a.value > 0.0, "{a:?} {b:?}");
    }
}

fn is_alike(calibrated: &CalibratedMachine, program: &str, setup: &str) -> (String, String) {
    let alone = on(1, calibrated, program, setup);
    for threads in [2, 3] {
        let many = on(threads, calibrated, program, setup);
        let differs = alone.0.lines().zip(many.0.lines()).position(|(a, b)| a != b);
        assert!(alone == many, "{threads} threads, from line {differs:?}\n{}\n{}", alone.1, many.1);
    }
    alone
}

/// Lines that go along a curve; `each` writes one.
fn program(head: &str, count: usize, each: impl Fn(&mut String, usize, [f64; 5])) -> String {
    let mut text = format!("%\n{head}\n");
    for i in 0..count {
        let t = 0.01 * i as f64;
        each(
            &mut text,
            i,
            [
                30.0 * t.sin(),
                20.0 * (0.7 * t).cos(),
                10.0 + t.sin(),
                8.0 * (0.3 * t).sin(),
                20.0 * (0.2 * t).sin(),
            ],
        );
    }
    text + "M30\n%\n"
}

#[test]
fn one_thread_and_many_write_the_same_bytes() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let setup = r#"Setup(tools: {"1": 100}, tool_at_start: "1", start: {"A": 0, "C": 0})"#;
    let all = |text: &mut String, _: usize, [x, y, z, a, c]: [f64; 5]| {
        let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} Z{z:.4} A{a:.4} C{c:.4}");
    };
    // Axes that a line does not name get words of their own, and increments go from where the last one has led.
    let some = |text: &mut String, i: usize, [x, y, z, a, c]: [f64; 5]| {
        let _ = match i % 701 {
            0 => writeln!(text, "A{a:.3} C{c:.3}"),
            1 => writeln!(text, "G0 Z{z:.3}"),
            2 => writeln!(text, "G91 X0.5\nG90"),
            3 => writeln!(text, "G2 X{:.3} Y{y:.3} R25.", x + 0.5),
            4 => writeln!(text, "G92 X{x:.3}"),
            _ => writeln!(text, "G1 X{x:.3} Y{y:.3}"),
        };
    };
    let increments = |text: &mut String, i: usize, _: [f64; 5]| {
        let _ = writeln!(text, "X{:.3} Y-0.01 C0.01", 0.02 * (i % 3) as f64);
    };
    for (head, count, each) in [
        ("G21 G90\nG1 F2000", 3000, &all as &dyn Fn(&mut String, usize, [f64; 5])),
        ("G21 G90\nG43.4 H1\nG1 F2000", 1200, &all),
        ("G21 G90\nG1 F2000 X0 Y0 Z0", 3000, &some),
        ("G21 G90\nG1 F2000 X0 Y0 Z0 A0 C0\nG91", 1500, &increments),
    ] {
        let text = program(head, count, each);
        let (written, report) = is_alike(&calibrated, &text, setup);
        assert!(written.lines().count() > count && written.contains("KINCAL"), "{report}");
        let unmarked: String =
            written.split_inclusive('\n').filter(|line| !line.contains("KINCAL")).collect();
        let (alone, told) = by_lines(&calibrated, &text, setup);
        assert_eq!(unmarked, alone);
        is_told_alike(&report, &told);
    }
}

#[test]
fn what_stops_a_program_is_told_the_same() {
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let far = |text: &mut String, i: usize, [x, y, ..]: [f64; 5]| {
        let x = if i == 1700 { 3e4 } else { x };
        let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} Z1.{}", if i == 2100 { " Q=?" } else { "" });
    };
    let (_, message) = is_alike(&calibrated, &program("G21 G90\nG1 F2000", 2500, far), "Setup()");
    assert!(message.contains("part.nc:1704"), "{message}");
}

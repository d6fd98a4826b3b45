//! Any program at all: what is no axis word stays, and what cannot be corrected is refused.

use super::*;

/// The same cases on every run.
fn fixed_cases() -> ProptestConfig {
    ProptestConfig {
        cases: 192,
        rng_seed: proptest::test_runner::RngSeed::Fixed(20_260_203),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// A block of axis words and whatever else a program has.
fn block() -> impl Strategy<Value = String> {
    let number = (-9_000i32..9_000, 0usize..5).prop_map(|(n, d)| format!("{:.*}", d, f64::from(n) / 970.0));
    let word =
        (prop::sample::select(vec!["X", "Y", "Z", "A", "C"]), number, prop::sample::select(vec!["", " "]));
    let words = prop::collection::vec(word, 0..5).prop_map(|words| {
        let mut seen = Vec::new();
        let mut text = String::new();
        for (address, number, blank) in words {
            if !seen.contains(&address) {
                seen.push(address);
                text.push_str(&format!("{address}{blank}{number} "));
            }
        }
        text
    });
    let head = prop::sample::select(vec![
        "",
        "G1 ",
        "G0 ",
        "G90 ",
        "N20 G1",
        "N7 ",
        "G21",
        "G91 G1 ",
        "G94 ",
        "n30  g01 ",
    ]);
    let tail = prop::sample::select(vec!["", "F200", "(X1 (in) Y2)", ";C3", "M8", " S500 M3 (on)", "  \t"]);
    let ending = prop::sample::select(vec!["\n", "\r\n"]);
    (head, words, tail, ending).prop_map(|(h, w, t, e)| format!("{h}{w}{t}{e}"))
}

/// A text without its axis words, the blanks before them, what keeps the time of rotary moves, and lines that have nothing else.
fn without_axis_words(text: &str) -> Vec<u8> {
    let mut program = Program::new("part.nc", text.as_bytes()).expect("readable");
    let mut rest = Vec::new();
    while let Some(block) = program.next_block().expect("readable") {
        let bytes = block.bytes();
        let mut at = 0;
        let keeps_time = |w: &kincal::nc::Word| {
            w.address == "F" || w.address == "G" && matches!(w.number(), Some(93.0 | 94.0))
        };
        let start = rest.len();
        for word in block.words().iter().filter(|w| AXES.contains(&w.address.as_str()) || keeps_time(w)) {
            rest.extend(bytes[at..word.span.start].iter().filter(|b| **b != b' '));
            at = word.span.end;
        }
        rest.extend(bytes[at..].iter().filter(|b| **b != b' '));
        if !block.words().is_empty() && rest[start..].iter().all(u8::is_ascii_whitespace) {
            rest.truncate(start);
        }
    }
    rest
}

/// Blocks with a mark behind each.
fn marked(blocks: &[String]) -> String {
    blocks.iter().map(|block| format!("{block}(@)\n")).collect()
}

/// Where the axes have last been sent at each mark: a block may take several lines.
fn at_marks(text: &str) -> Vec<Vec<f64>> {
    let parts: Vec<&str> = text.split("(@)").collect();
    let upto = |k: usize| targets(&parts[..k].concat(), &AXES).pop().unwrap_or_default();
    (1..parts.len()).map(upto).collect()
}

proptest! {
    #![proptest_config(fixed_cases())]

    #[test]
    fn a_nominal_machine_gives_every_byte_back(blocks in prop::collection::vec("\\PC{0,30}\n?", 0..20)) {
        let nominal = CalibratedMachine::nominal(machine("ac_table_tilting"));
        let text = blocks.concat();
        let (out, _) = run(&nominal, &text, &CompensateOptions::default());
        prop_assert_eq!(out, text);
    }

    #[test]
    fn nothing_but_axis_words_changes(blocks in prop::collection::vec(block(), 1..40)) {
        let calibrated = erroneous("ac_table_tilting", 1.0);
        let text = format!("G90 G0 X0 Y0 Z0 A30 C0 F300\n{}", blocks.concat());
        let written =
            compensate_text(&calibrated, "part.nc", &text, &Setup::default(), &CompensateOptions::default());
        // Blocks go as far as the ends of travel.
        prop_assume!(!written.as_ref().is_err_and(|e| e.to_string().contains("beyond its travel")));
        let (out, report) = written.unwrap_or_else(|e| panic!("{e}"));
        prop_assert_eq!(without_axis_words(&out), without_axis_words(&text));
        prop_assert_eq!(report.blocks as usize, text.lines().count());
    }

    #[test]
    fn every_end_of_a_move_is_where_the_program_means_it(blocks in prop::collection::vec(block(), 1..30)) {
        let calibrated = erroneous("ac_table_tilting", 1.0);
        let text = format!("G90 G0 X0 Y0 Z0 A30 C0 F300\n(@)\n{}", marked(&blocks));
        let out = match compensate_text(&calibrated, "part.nc", &text, &Setup::default(), &CompensateOptions::default()) {
            Ok((out, _)) => out,
            // Blocks go as far as the ends of travel.
            Err(error) => {
                let told = error.to_string();
                prop_assert!(told.contains("beyond its travel"), "{} of {}", told, text);
                return Ok(());
            }
        };
        let (machine, actual) = (calibrated.machine(), calibrated.chain());
        let (meant, sent) = (at_marks(&text), at_marks(&out));
        prop_assert_eq!(meant.len(), sent.len());
        for (meant, sent) in meant.iter().zip(&sent) {
            prop_assert!(tip_error(&actual, machine, meant, sent) < 1.1e-6, "{}\n{}", text, out);
        }
    }

    #[test]
    fn any_text_is_corrected_or_refused(blocks in prop::collection::vec("\\PC{0,20}", 0..12)) {
        let calibrated = erroneous("bc_table_tilting", 1.0);
        let setup = Setup::default();
        let options = CompensateOptions::default().with_arcs(0.05).with_split(0.05);
        if let Err(error) = compensate_text(&calibrated, "any.nc", blocks.join("\n"), &setup, &options) {
            prop_assert!(!error.to_string().is_empty() && !error.mend().is_empty());
        }
    }

    #[test]
    fn any_words_are_corrected_or_refused(tokens in prop::collection::vec(prop::sample::select(vec![
        "G0", "G1", "G2", "G3", "G17", "G18", "G19", "G20", "G21", "G28", "G43", "G43.4", "G49", "G52", "G53", "G54", "G68", "G69",
        "G80", "G81", "G90", "G91", "G92", "G93", "X1", "Y-2.5", "Z.3", "A10", "C=20", "X[1+2]", "I3", "J-1", "K2", "R4", "P2", "F9",
        "H1", "T1", "M6", "M98", "M99", "M30", "O100", "o100 sub\n", "o100 endsub\n", "\n", "\n", "\n", "TRAORI", "TRANS", "AROT", "SUPA", "(c)", ";e\n", "/", "%",
        "MCALL CYCLE81(1,2)", "L X+1", "FMAX", "1e999", "X99999999999999999999", "D0", "IX3",
    ]), 0..60)) {
        let calibrated = erroneous("bc_table_tilting", 1.0);
        let setup = Setup::parse("s.ron", r#"Setup(tools: {"1": 50}, work_offsets: {"G54": {"X": 3}})"#).expect("a set-up");
        let options = CompensateOptions::default().with_arcs(0.05).with_split(0.05);
        if let Err(error) = compensate_text(&calibrated, "any.nc", tokens.join(" "), &setup, &options) {
            prop_assert!(!error.to_string().is_empty() && !error.mend().is_empty());
        }
    }
}

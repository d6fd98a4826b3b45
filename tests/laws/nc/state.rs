//! What a program has set so far.

use super::*;

/// Steps and the state behind a program.
fn follow(dialect: Dialect, addresses: &[&str], text: &str) -> (Vec<Step>, State) {
    let mut state = State::new(dialect, addresses.iter().copied());
    let apply = |(i, line): (usize, &str)| {
        state.apply(&Block::new(i + 1, line.as_bytes(), dialect)).unwrap_or_else(|e| panic!("{e}"))
    };
    let steps = text.lines().enumerate().map(apply).collect();
    (steps, state)
}

#[test]
fn modal_coordinates_and_motions_are_followed() {
    let program = "G21 G17 G94 G90\nG00 X1 Y2\nG1 Z-.5\nX3\nG91 X1 Y-1\nG90 G2 X0 Y0 I1 J1\nG4 X5\nG3 I2\nY[#1]\nX9 Y1\nG80\nX1";
    let (steps, state) = follow(Dialect::Rs274, &["X", "Y", "Z", "A"], program);
    let motion = |i: usize| steps[i].motion.as_ref().expect("moves");
    assert!(steps[0].motion.is_none() && steps[6].motion.is_none());
    assert_eq!(
        (motion(1).kind, &motion(1).target[..]),
        (MotionKind::Rapid, &[Some(1.0), Some(2.0), None, None][..])
    );
    assert_eq!(motion(3).target[..], [Some(3.0), Some(2.0), Some(-0.5), None]);
    assert_eq!(
        (motion(3).kind, &motion(3).words[..]),
        (MotionKind::Linear, &[Some(0), None, None, None][..])
    );
    assert_eq!(motion(4).target[..], [Some(4.0), Some(1.0), Some(-0.5), None]);
    assert_eq!((motion(7).kind, &motion(7).words[..]), (MotionKind::ArcCcw, &[None; 4][..]));
    assert_eq!(motion(8).target[1], None);
    assert_eq!(motion(9).target[..], [Some(9.0), Some(1.0), Some(-0.5), None]);
    assert_eq!(motion(11).kind, MotionKind::Unstated);
    assert_eq!(state.coordinates()[3], Coordinate::Unprogrammed);
}

#[test]
fn what_is_not_known_any_more_is_told_with_its_line() {
    let (_, state) = follow(Dialect::Siemens, &FIVE, "G0 X1 Y2 Z3 B4 C5\nX=R1\nG1 Y=IC(2)");
    assert_eq!(state.coordinates()[0], Coordinate::Lost { line: 2, why: Why::Expression, last: Some(1.0) });
    assert_eq!(state.target(), [None, Some(4.0), Some(3.0), Some(4.0), Some(5.0)]);

    let known = |dialect, rest: &str| {
        let (steps, state) = follow(dialect, &FIVE, &format!("G0 X1 Y2 Z3 B4 C5\n{rest}"));
        let seen: String =
            state.target().iter().zip(FIVE).filter(|(v, _)| v.is_some()).map(|(_, a)| a).collect();
        let step = steps.last().expect("a block").clone();
        (seen, step.changes_frame, step.calls, step.motion.is_some())
    };
    let table: &[(Dialect, &str, &str, bool, bool, bool)] = &[
        (Dialect::Siemens, "TRANS X5", "BC", true, false, false),
        (Dialect::Siemens, "AROT Z90", "BC", true, false, false),
        (Dialect::Siemens, "TRANS C5", "B", true, false, false),
        (Dialect::Siemens, "CYCLE800()", "", true, false, false),
        (Dialect::Siemens, "TRAORI", "BC", false, false, false),
        (Dialect::Siemens, "CYCLE832(1,2)", "XYZBC", false, false, false),
        (Dialect::Siemens, "COMPOF", "XYZBC", false, false, false),
        (Dialect::Siemens, "MYPART", "", false, true, false),
        (Dialect::Siemens, "MYPART(1)", "", false, true, false),
        (Dialect::Siemens, "L123", "", false, true, false),
        (Dialect::Siemens, "SUPA G0 Z100", "XYBC", false, false, true),
        (Dialect::Siemens, "G54", "BC", false, false, false),
        (Dialect::Siemens, "POS[X]=3", "YZBC", false, false, false),
        (Dialect::Siemens, "G1 AP=3 RP=5", "BC", false, false, true),
        (Dialect::Siemens, "A3=0 B3=0 C3=1", "XYZ", false, false, true),
        (Dialect::Siemens, "MCALL CYCLE81(1)\nX1", "XYBC", false, true, true),
        (Dialect::Rs274, "G43 H1", "XYBC", false, false, false),
        (Dialect::Rs274, "G43.4 H1", "BC", false, false, false),
        (Dialect::Rs274, "G92 X0", "XYZBC", true, false, false),
        (Dialect::Rs274, "G52 X1", "BC", true, false, false),
        (Dialect::Rs274, "G10 L2 P1 X5", "BC", true, false, false),
        (Dialect::Rs274, "G28 Z0", "XYBC", false, false, false),
        (Dialect::Rs274, "G53 G0 Z0", "XYBC", false, false, true),
        (Dialect::Rs274, "G20", "XYZBC", false, false, false),
        (Dialect::Rs274, "G21\nG20", "BC", false, false, false),
        (Dialect::Rs274, "M98 P1", "", false, true, false),
        (Dialect::Rs274, "G65 P1 X5", "", false, true, false),
        (Dialect::Rs274, "G81 X5 Z-3 R1", "XYBC", false, false, true),
        (Dialect::Rs274, "G38.2 Z-3", "XYBC", false, false, true),
        (Dialect::Rs274, "M6 T1", "BC", false, false, false),
        (Dialect::Rs274, "G68 X0 Y0 R30", "BC", true, false, false),
    ];
    for (dialect, line, seen, frame, calls, moves) in table {
        assert_eq!(known(*dialect, line), (seen.to_string(), *frame, *calls, *moves), "{line}");
    }
}

#[test]
fn modes_are_followed_in_every_dialect() {
    let (steps, state) =
        follow(Dialect::Rs274, &["X"], "G20 G18 G93 G91 G55\nG43.4 H3 T5\nG54.1 P3\nIF [#1 EQ 1] GOTO 5");
    let modes = state.modes();
    assert_eq!((modes.tool_centre_point, modes.length_offset), (Some(true), Some(3.0)));
    assert_eq!((modes.work_offset.as_deref(), modes.tool.as_deref()), (Some("G54.1 P3"), Some("5")));
    assert_eq!(modes.distance, Some(kincal::nc::Distance::Incremental));
    assert_eq!(modes.units, Some(kincal::nc::Units::Inch));
    assert_eq!(modes.plane, Some(kincal::nc::Plane::Zx));
    assert_eq!(modes.feed, Some(kincal::nc::Feed::InverseTime));
    assert!(steps[3].jumps);
    let (_, state) = follow(Dialect::Rs274, &["X"], "G43.5\nG49");
    assert_eq!(state.modes().tool_centre_point, Some(false));

    let (_, state) = follow(Dialect::Siemens, &["X"], "G710 G505 D2\nTRAORI(1)\nT=\"MILL\"");
    let modes = state.modes();
    assert_eq!((modes.tool_centre_point, modes.length_offset), (Some(true), Some(2.0)));
    assert_eq!((modes.work_offset.as_deref(), modes.tool.as_deref()), (Some("G505"), Some("\"MILL\"")));

    let program = "0 BEGIN PGM A MM\n1 TOOL CALL 5 Z S3000\n2 L X+1 Y+2 R0 FMAX\n3 CC X+9 Y+9\n4 C X+3 Y+4 DR-\n5 L IX+1\n6 M128\n7 L X+5";
    let (steps, state) = follow(Dialect::Heidenhain, &["X", "Y"], program);
    let kinds: Vec<_> = steps.iter().map(|s| s.motion.as_ref().map(|m| m.kind)).collect();
    use MotionKind::*;
    assert_eq!(kinds, [None, None, Some(Rapid), None, Some(Other), Some(Linear), None, Some(Linear)]);
    assert_eq!(steps[5].motion.as_ref().expect("moves").target[..], [Some(4.0), Some(4.0)]);
    assert_eq!(
        state.coordinates()[1],
        Coordinate::Lost { line: 7, why: Why::Transformation, last: Some(4.0) }
    );
    assert_eq!((state.modes().tool.as_deref(), state.modes().tool_centre_point), (Some("5"), Some(true)));
    let (_, state) = follow(Dialect::Heidenhain, &["X"], "FUNCTION TCPM F TCP AXIS POS\nFUNCTION RESET TCPM");
    assert_eq!(state.modes().tool_centre_point, Some(false));
}

#[test]
fn a_long_program_runs_through() {
    let line = |i: usize| format!("N{i} G1 X{}. Y-.{:03} Z={} (pass {i})\n", i % 90, i % 1000, i % 7);
    let text: String = (0..10_000).map(line).collect();
    let mut program = Program::new("long.nc", text.as_bytes()).expect("opens");
    let mut state = State::new(program.dialect(), FIVE);
    let (mut motions, mut out) = (0, Vec::new());
    while let Some(block) = program.next_block().expect("blocks") {
        motions += usize::from(state.apply(&block).expect("no fault").motion.is_some());
        block.write_to(&mut out).expect("memory");
    }
    assert_eq!((motions, out == text.as_bytes()), (10_000, true));
}

/// What a reader of few lines counts in a Siemens program: blocks that move, axis words, those with a number.
fn counted(text: &str) -> (usize, usize, usize) {
    let (mut motions, mut words, mut numbers) = (0, 0, 0);
    for line in text.lines() {
        let code = line.split(';').next().unwrap_or_default();
        if code.contains('(') || ["TRANS", "AROT", "DEF "].iter().any(|w| code.contains(w)) {
            continue;
        }
        let is_axis = |w: &&str| {
            w.starts_with(['X', 'Y', 'Z', 'B', 'C'])
                && w[1..].starts_with(|c: char| c.is_ascii_digit() || "=.-+".contains(c))
        };
        let axes: Vec<&str> = code.split_ascii_whitespace().filter(is_axis).collect();
        motions += usize::from(!axes.is_empty());
        words += axes.len();
        numbers += axes.iter().filter(|w| !w.contains('=')).count();
    }
    (motions, words, numbers)
}

mod data_sets {
    use super::*;
    use crate::common::data;

    #[test]
    #[ignore = "needs the data sets, see tests/real"]
    fn real_programs_are_read_as_a_simple_count_says() {
        let expected = [("keychain", (576, 1247, 1222)), ("axis_cross", (2606, 4358, 4253))];
        for (name, figures) in expected {
            let path = data(&format!("data/spinner-u5-nc/{name}.mpf"));
            let bytes = std::fs::read(&path).expect("readable");
            assert_eq!(rewritten(&bytes, None, false), bytes);
            assert_eq!(rewritten(&bytes, None, true), bytes);
            let mut program = Program::open(&path).expect("opens");
            assert_eq!(program.dialect(), Dialect::Siemens);
            let mut state = State::new(program.dialect(), FIVE);
            let (mut motions, mut words, mut numbers, mut frames, mut calls) = (0, 0, 0, 0, 0);
            let (mut pointed, mut pointed_known, mut known) = (0, 0, 0);
            while let Some(block) = program.next_block().expect("blocks") {
                let step = state.apply(&block).unwrap_or_else(|e| panic!("{e}"));
                frames += usize::from(step.changes_frame);
                calls += usize::from(step.calls);
                let Some(motion) = step.motion else { continue };
                let whole = motion.target.iter().all(Option::is_some);
                motions += 1;
                known += usize::from(whole);
                if state.modes().tool_centre_point == Some(true) {
                    pointed += 1;
                    pointed_known += usize::from(whole);
                }
                for word in motion.words.into_iter().flatten() {
                    words += 1;
                    numbers += usize::from(block.words()[word].number().is_some());
                }
            }
            println!(
                "{name}: {motions} motions, {known} with all five axes known ({pointed_known} of {pointed} with TRAORI), \
                 {words} axis words, {numbers} of them numbers, {frames} blocks change the frame, {calls} call"
            );
            let text = String::from_utf8_lossy(&bytes);
            assert_eq!((motions, words, numbers), counted(&text), "{name}");
            assert_eq!((motions, words, numbers), figures, "{name}");
        }
    }
}

//! The same on a machine with play.

use super::*;

/// Errors of tip (m) and tool axis (rad) at each block's end, on a machine whose play remembers how it came there. The side of
/// the first motion is that of the path as meant: corrections are motions too, but smaller than play.
fn each_error_with_play(plant: &Plant, path: &[Vec<f64>], sent: &[Vec<f64>]) -> Vec<(f64, f64)> {
    assert_eq!(path.len(), sent.len());
    let sample = |(k, q): (usize, &Vec<f64>)| Sample {
        time: k as f64,
        q: q.clone(),
        directions: None,
        recorded: true,
        at: At::Pose(k + 1),
    };
    let first = plant.first_directions(path.iter().enumerate().map(sample).map(Ok)).expect("samples");
    let mut state = plant.start(first);
    let error = |(k, (q, now)): (usize, (&Vec<f64>, &Vec<f64>))| {
        plant.advance(&mut state, &sample((k, now)));
        let (wanted, is) = (meant(plant.machine(), q), state.chain().w_from_t(now));
        let turn = wanted.rotation.column(2).cross(is.rotation.column(2));
        ((wanted.translation - is.translation).norm(), turn.norm())
    };
    path.iter().zip(sent).enumerate().map(error).collect()
}

/// As [`errors`], on a machine with play.
fn errors_with_play(plant: &Plant, path: &[Vec<f64>], sent: &[Vec<f64>]) -> (f64, f64) {
    let all = each_error_with_play(plant, path, sent);
    let mean = |of: fn(&(f64, f64)) -> f64| {
        (all.iter().map(|e| of(e).powi(2)).sum::<f64>() / all.len() as f64).sqrt()
    };
    (mean(|e| e.0), mean(|e| e.1))
}

/// A machine with play on these joints and random deviations, its recording, and what was identified by pieces.
fn with_play(machine: &Machine, rotary: &[usize], seed: u64) -> (Plant, Vec<String>, CalibratedMachine) {
    let plays: Vec<String> = (rotary.iter().zip([120, 90]))
        .map(|(c, width)| format!("(joint: \"{}\", width: {width})", machine.commands()[*c]))
        .collect();
    let faults = format!("Faults(units: (length: um, angle: urad), backlash: [{}])", plays.join(", "));
    let faults = Faults::parse("faults.ron", &faults, machine).unwrap_or_else(|e| panic!("{e}"));
    let plant =
        Plant::new(&CalibratedMachine::nominal(machine.clone())).with_random(1.0, seed).with_faults(&faults);
    let course = RandomPoses { machine: machine.clone(), count: 300, seed: 9, rate: 1.0 };
    let run = Run {
        course: Box::new(course),
        instrument: Instrument::new(Sensor::Pose, 3e-7, 3e-6),
        claims: Claims::default(),
        directions: true,
    };
    let texts = recordings(&plant, &[run], &Style::si(), 4).unwrap_or_else(|e| panic!("{e}"));
    let measured =
        Recording::from_bytes("rec.csv", texts[0].as_bytes(), machine).unwrap_or_else(|e| panic!("{e}"));
    // The path's steps are fine where an axis turns round.
    let model = ErrorModel::default()
        .with_varying(Varying { directions: Some(Directions::new(rotary.to_vec())), terms: Vec::new() })
        .with_dead_bands(vec![Some(1e-7); 5]);
    let (pieces, _) = calibrate_model(machine, &[measured], &model, Fitting::default(), &|_| {})
        .unwrap_or_else(|e| panic!("{e}"));
    let pieces = CalibratedMachine::parse("pieces.ron", &pieces.to_ron()).unwrap_or_else(|e| panic!("{e}"));
    (plant, texts, pieces)
}

#[test]
fn a_machine_with_play_cuts_better_when_its_program_is_corrected_piece_by_piece() {
    // Tables, heads and one of each.
    for (k, (name, machine)) in five_axis().into_iter().enumerate().step_by(3) {
        let rotary: Vec<usize> =
            (0..5).filter(|c| machine.command_joint(*c).kind == JointKind::Revolute).collect();
        let (plant, texts, pieces) = with_play(&machine, &rotary, 500 + k as u64);
        let constant = calibrated_from(&machine, &texts);
        let path = path(&machine, blocks());
        // The lines at which a rotary axis turns round, behind the first block's.
        let reversed = |k: usize| {
            rotary.iter().any(|c| (path[k][*c] - path[k - 1][*c]) * (path[k - 1][*c] - path[k - 2][*c]) < 0.0)
        };
        for tcp in [true, false] {
            let (text, setup) = (program(&machine, &path, tcp), setup(&machine, tcp));
            let before = text.lines().take_while(|line| !line.starts_with('N')).count();
            let correct = |model| {
                compensate_text(model, "path.nc", &text, &setup, &CompensateOptions::default())
                    .unwrap_or_else(|e| panic!("{name}: {e}"))
            };
            let ((by_pieces, report), (by_constant, steady)) = (correct(&pieces), correct(&constant));
            let of = |text: &str| errors_with_play(&plant, &path, &execute(&machine, text, tcp));
            let (plain, with, without) = (of(&text), of(&by_pieces), of(&by_constant));
            println!(
                "{name} tcp {tcp}: tip {:.2} um, constant {:.3}, pieces {:.3}; axis {:.2} urad, constant {:.3}, pieces {:.3}; {} reversals, {:.2} um",
                plain.0 * 1e6,
                without.0 * 1e6,
                with.0 * 1e6,
                plain.1 * 1e6,
                without.1 * 1e6,
                with.1 * 1e6,
                report.reversals.count,
                report.largest_reversal_m.value * 1e6
            );
            assert!(with.0 < 0.3 * without.0, "{name} tcp {tcp}: {with:?} against {without:?}");
            assert!(with.0 < 0.05 * plain.0, "{name} tcp {tcp}: {with:?} of {plain:?}");
            let second = before + 2;
            let told: Vec<usize> =
                report.reversals.first.iter().map(|r| r.line).filter(|l| *l > second).collect();
            let mut expected: Vec<usize> =
                (2..path.len()).filter(|k| reversed(*k)).map(|k| before + k + 1).collect();
            assert!(expected.len() > 4, "{name}: {expected:?}");
            expected.truncate(told.len());
            assert_eq!(told, expected, "{name} tcp {tcp}");
            assert!(report.reversals.count >= expected.len() as u64 && steady.reversals.count == 0);
            assert!(report.largest_reversal_m.value > 1e-6, "{name}: {:?}", report.largest_reversal_m);
            assert_eq!(report.unseen_directions.count, 0, "{name}: {:?}", report.unseen_directions);
        }
    }
}

#[test]
fn an_axis_that_moves_only_once_is_corrected_on_the_side_that_it_comes_to() {
    let machine = common::machine("ac_table_tilting");
    let rotary: Vec<usize> =
        (0..5).filter(|c| machine.command_joint(*c).kind == JointKind::Revolute).collect();
    let (plant, _, pieces) = with_play(&machine, &rotary, 700);
    let blocks = |a: f64, c: f64, rest: &str| {
        format!("G21 G90\nN1 G0 X10 Y20 Z30 A{a:.3} C{c:.3}\nN2 G1 X80 F900\nN3 Y-90\nN4 Z60\n{rest}M30\n")
    };
    let of = |text: &str, start: Option<&str>| {
        let setup = start.map_or_else(|| "Setup()".to_string(), |start| format!("Setup(start: {{{start}}})"));
        let setup = Setup::parse("setup.ron", &setup).expect("readable");
        let (out, report) = compensate_text(&pieces, "part.nc", text, &setup, &CompensateOptions::default())
            .unwrap_or_else(|e| panic!("{e}"));
        (out, report)
    };
    for (to, from) in
        [([40.0, -50.0], [0.0, 0.0]), ([40.0, 20.0], [80.0, 0.0]), ([-30.0, -9.0], [5.0, -90.0])]
    {
        let text = blocks(to[0], to[1], "");
        let start = format!("\"X\": 0, \"Y\": 0, \"Z\": 0, \"A\": {}, \"C\": {}", from[0], from[1]);
        // The drives stand at the start before the first block.
        let before = format!("N0 G0 X0 Y0 Z0 A{} C{}\n", from[0], from[1]);
        let path = |text: &str| execute(&machine, &format!("{before}{text}"), false);
        // The start is where it is; the error there is not the program's.
        let left = |text: &str, wanted: &str| {
            let all = each_error_with_play(&plant, &path(wanted), &path(text));
            all[1..].iter().map(|(m, _)| *m).fold(0.0, f64::max)
        };
        let ((told, report), (untold, guessed)) = (of(&text, Some(&start)), of(&text, None));
        let (plain, with, without) = (left(&text, &text), left(&told, &text), left(&untold, &text));
        println!(
            "{from:?} to {to:?}: tip {:.2} um, start told {:.3}, not told {:.3}",
            plain * 1e6,
            with * 1e6,
            without * 1e6
        );
        assert!(with < 1e-6 && with < 0.01 * plain && with < 0.1 * without, "{plain} {with} {without}");
        assert_eq!((report.unknown_ways.count, guessed.unknown_ways.count), (0, 2));
        // Not told, and never on a known way: the mean of both directions.
        assert!(guessed.unknown_ways.first.iter().all(|way| way.side == 0 && way.line == 2), "{guessed:?}");
    }
    // Not told, but turned later: the first motion's direction holds before it, as simulation has it.
    let text = blocks(40.0, -50.0, "N5 A35\nN6 C-40\nN7 A50\n");
    let (out, _) = of(&text, None);
    let sent = |text: &str| execute(&machine, text, false);
    let (m, _) = errors_with_play(&plant, &sent(&text), &sent(&out));
    // 2.1 um measured, 18 um on the other side. Not looked into: likely corrections of A and C against their direction, smaller than the play.
    println!("not told, turned later: tip {:.3} um", m * 1e6);
    assert!(m < 3e-6, "{m}");
}

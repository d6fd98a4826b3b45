//! Machines with play and periodic errors: measured, diagnosed, their programs corrected, and cut on the erroneous machine.

use std::f64::consts::TAU;
use std::fmt::Write;

use crate::common;
use kincal::compensate::{CompensateOptions, Report, Setup, VerifyOptions, compensate_text, verify_text};
use kincal::diagnose::{DiagnoseOptions, diagnose};
use kincal::effects::{Identified, Library, RecordingFacts, StoredEffect};
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{At, Faults, Instrument, Plant, Sample, random_deviations, recording};
use kincal::{CalibratedMachine, Chain, Machine};

/// Commands (y, x, z) along which all axes of the mill go to and fro from rest, m.
fn path(count: usize, turns: [f64; 3]) -> Vec<Vec<f64>> {
    (0..count)
        .map(|k| {
            let u = k as f64 / count as f64;
            turns.map(|turns| 0.1 - 0.13 * (TAU * turns * u).cos()).to_vec()
        })
        .collect()
}

const LEARNT: [f64; 3] = [2.3, 3.1, 1.7];

fn measured(machine: &CalibratedMachine, commands: &[Vec<f64>], noise: f64) -> Recording {
    let csv = recording(machine, &Instrument::new(Sensor::Position, noise, 0.0), commands, &[], 3);
    Recording::from_bytes("r.csv", csv.into_bytes(), machine.machine()).unwrap_or_else(|e| panic!("{e}"))
}

/// An effect of the library at a joint, with the point of its grid next to `parameters`.
fn effect(machine: &Machine, name: &str, at: &str, coefficients: &[f64], parameters: &[f64]) -> StoredEffect {
    let library = Library::standard();
    let plain = CalibratedMachine::nominal(machine.clone());
    let facts = RecordingFacts::of(machine, &[measured(&plain, &path(1500, LEARNT), 0.0)])
        .unwrap_or_else(|e| panic!("{e}"));
    let candidates = library.candidates(machine, &facts);
    let own = |c: &&kincal::effects::Candidate| c.effect == name && c.place.name(machine) == at;
    let candidate = candidates.all.iter().find(own).unwrap_or_else(|| panic!("{name} at {at}"));
    let mut all = coefficients.to_vec();
    all.resize(candidate.coefficients.len(), 0.0);
    let found = Identified {
        family: &library.families()[candidate.family],
        candidate,
        coefficients: all,
        parameters: parameters.to_vec(),
        covariance: None,
    };
    found.stored(machine, &[])
}

/// A mill out of square, with 30 um of play in X and a screw of Y that errs by 8 um every 10 mm.
fn erroneous(machine: &Machine, more: Vec<StoredEffect>) -> CalibratedMachine {
    let mut effects = vec![
        effect(machine, "backlash", "x", &[30e-6], &[]),
        effect(machine, "cyclic_error", "y", &[8e-6, 0.0], &[0.01]),
    ];
    effects.extend(more);
    CalibratedMachine::nominal(machine.clone())
        .with_deviations(random_deviations(machine, 0.3, 5))
        .with_effects(effects, vec![1e-9; 3])
        .unwrap_or_else(|e| panic!("{e}"))
}

fn program(path: &[Vec<f64>]) -> String {
    let mut text = String::from("G21 G90 G94 G17 G54\nT1 M6\nG43 H1\n");
    for q in path {
        let mm = |c: usize| q[c] * 1e3;
        let _ = writeln!(text, "N1 G1 X{:.6} Y{:.6} Z{:.6} F2000", mm(1), mm(0), mm(2));
    }
    text + "M30\n"
}

fn compensated(model: &CalibratedMachine, path: &[Vec<f64>]) -> (Vec<Vec<f64>>, Report) {
    let setup = "Setup(tools: {\"1\": 120}, reference_length: 120, work_offsets: {\"G54\": {\"X\": 0, \"Y\": 0, \"Z\": -120}})";
    let setup = Setup::parse("setup.ron", setup).unwrap_or_else(|e| panic!("{e}"));
    let program = program(path);
    let (text, report) = compensate_text(model, "part.nc", &program, &setup, &CompensateOptions::default())
        .unwrap_or_else(|e| panic!("{e}"));
    // With play and waves, too, what was written is where it says.
    let options = VerifyOptions::default().with_tolerance(report.largest_left_m.value + 1e-9);
    let found = verify_text(model, &program, &text, &setup, &options).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.holds() && found.judged as usize == path.len(), "{found:?}");
    let sent = text.lines().filter(|line| line.starts_with("N1 ")).map(|line| {
        let word = |letter: char| line.split(' ').find_map(|w| w.strip_prefix(letter)).expect("a word");
        ['Y', 'X', 'Z'].map(|l| word(l).parse::<f64>().expect("a number") / 1e3).to_vec()
    });
    (sent.collect(), report)
}

/// Root mean square of the tip's error over the path, m: the erroneous machine sent to `sent` where `meant` is meant.
fn error(truth: &CalibratedMachine, sent: &[Vec<f64>], meant: &[Vec<f64>]) -> f64 {
    let (plant, nominal) = (Plant::new(truth), Chain::nominal(truth.machine()));
    let sample = |(k, q): (usize, &Vec<f64>)| Sample {
        time: k as f64,
        q: q.clone(),
        directions: None,
        recorded: true,
        at: At::Pose(k + 1),
    };
    let first = plant.first_directions(sent.iter().enumerate().map(sample).map(Ok)).expect("directions");
    let mut state = plant.start(first);
    let mut squares = 0.0;
    for (k, (q, meant)) in sent.iter().zip(meant).enumerate() {
        plant.advance(&mut state, &sample((k, q)));
        let gap = state.chain().w_from_t(q).translation - nominal.w_from_t(meant).translation;
        squares += gap.dot(gap);
    }
    (squares / sent.len() as f64).sqrt()
}

#[test]
fn a_simulated_recording_of_a_machine_with_effects_is_what_its_file_predicts() {
    let machine = common::machine("xyz_mill");
    let more = vec![
        effect(&machine, "hysteresis", "z", &[2e-5], &[1e-3]),
        effect(&machine, "presliding_friction", "x", &[0.1, 0.05, 0.02], &[]),
        effect(&machine, "straightness", "z", &[4e-6, -3e-6, 2e-6], &[]),
        effect(&machine, "thermal_drift", "z", &[1e-5, 4e-6], &[20.0]),
        effect(&machine, "servo_lag", "y", &[1e-3], &[]),
        effect(&machine, "sensor_drift", "measurement", &[1e-6], &[]),
    ];
    let truth = erroneous(&machine, more);
    let text = truth.to_ron();
    let read = CalibratedMachine::parse("truth.ron", &text).unwrap_or_else(|e| panic!("{e}"));
    let recording = measured(&read, &path(1500, [1.3, 2.2, 2.9]), 0.0);
    let own = predict(&truth, &recording, None).unwrap_or_else(|e| panic!("{e}"));
    // Rates differ a little: a recording is looked at from both sides, a simulation backwards only.
    let left = own.rms.m.expect("lengths");
    assert!(left < 2e-8, "{left:e}");
    let plain = CalibratedMachine::nominal(machine.clone()).with_deviations(truth.deviations().to_vec());
    let without = predict(&plain, &recording, None).unwrap_or_else(|e| panic!("{e}")).rms.m.expect("lengths");
    assert!(without > 1e-5, "{without:e}");
}

#[test]
fn effects_of_a_faults_file_are_those_of_a_calibrated_file() {
    let machine = common::machine("xyz_mill");
    let truth = erroneous(&machine, Vec::new());
    let text = truth.to_ron();
    let from = text.find("        effects: [").expect("effects");
    let to = from + text[from..].find("\n        ],").expect("their end");
    let faults = format!("Faults(units: (length: um, angle: urad),\n{}\n],\n)", &text[from..to]);
    let read = |text: &str| Faults::parse("faults.ron", text, &machine);
    let plain = CalibratedMachine::nominal(machine.clone()).with_deviations(truth.deviations().to_vec());
    let plant = Plant::new(&plain).with_faults(&read(&faults).unwrap_or_else(|e| panic!("{e}")));
    assert_eq!(plant.truth(&plain).effects(), truth.effects());
    let commands = path(300, [1.3, 2.2, 2.9]);
    let again = plant.truth(&plain);
    assert_eq!(
        predict(&again, &measured(&truth, &commands, 0.0), None).unwrap_or_else(|e| panic!("{e}")).rms.m,
        predict(&truth, &measured(&truth, &commands, 0.0), None).unwrap_or_else(|e| panic!("{e}")).rms.m
    );
    let error = read(&faults.replace("Before(\"x\")", "Before(\"q\")")).expect_err("no such frame");
    assert!(
        error.to_string().contains("no frame \"q\"") && error.to_string().contains("faults.ron:"),
        "{error}"
    );
}

#[test]
fn a_program_for_a_machine_with_play_and_a_cyclic_error_is_corrected_by_its_own_file_to_95_percent() {
    let machine = common::machine("xyz_mill");
    let truth = erroneous(&machine, Vec::new());
    let meant = path(600, [1.9, 2.6, 3.3]);
    let (sent, report) = compensated(&truth, &meant);
    let (before, after) = (error(&truth, &meant, &meant), error(&truth, &sent, &meant));
    assert!(after < 0.05 * before, "{before:e} {after:e}");
    assert!(report.reversals.count >= 3, "{}", report.reversals.count);
    // What the correction steps by at a reversal is the play.
    assert!((report.largest_reversal_m.value - 30e-6).abs() < 1e-6, "{:e}", report.largest_reversal_m.value);
    // The constant part alone leaves the play and the screw.
    let plain = CalibratedMachine::nominal(machine.clone()).with_deviations(truth.deviations().to_vec());
    let (sent, _) = compensated(&plain, &meant);
    assert!(error(&truth, &sent, &meant) > 10.0 * after);
}

#[test]
fn what_a_program_says_nothing_of_is_left_out_of_its_correction_and_told() {
    let machine = common::machine("xyz_mill");
    let truth = CalibratedMachine::nominal(machine.clone())
        .with_effects(
            vec![
                effect(&machine, "backlash", "x", &[30e-6], &[]),
                effect(&machine, "servo_lag", "y", &[1e-3], &[]),
                effect(&machine, "setup_slip", "z", &[1e-5], &[3.0]),
                effect(&machine, "sensor_drift", "measurement", &[1e-6], &[]),
            ],
            vec![1e-9; 3],
        )
        .unwrap_or_else(|e| panic!("{e}"));
    let clocked = truth.to_ron().replace("effects: [\n", "clock: (0.0, 60.0),\n        effects: [\n");
    let clocked = CalibratedMachine::parse("clocked.ron", &clocked).unwrap_or_else(|e| panic!("{e}"));
    let meant = path(60, [1.9, 2.6, 3.3]);
    let names = |list: &[kincal::LeftOut]| -> Vec<String> { list.iter().map(|l| l.effect.clone()).collect() };
    let (_, report) = compensated(&truth, &meant);
    assert_eq!(names(&report.left_out), ["servo_lag", "setup_slip", "sensor_drift"]);
    let (sent, report) = compensated(&clocked, &meant);
    assert_eq!(names(&report.left_out), ["servo_lag", "sensor_drift"]);
    assert_eq!(names(&report.held), ["setup_slip"]);
    // Play moves X, what has slipped moves X as well, the lag nothing.
    let gaps = |c: usize| sent.iter().zip(&meant).map(|(s, m)| (s[c] - m[c]).abs()).fold(0.0, f64::max);
    assert!((gaps(1) - 25e-6).abs() < 1e-6 && gaps(0) < 1e-9, "{:e} {:e}", gaps(0), gaps(1));
}

/// The library with these families alone.
fn only(kept: &[&str]) -> Library {
    let mut library = Library::standard();
    let names: Vec<String> = library.names().into_iter().map(String::from).collect();
    for name in names.iter().filter(|n| !kept.contains(&n.as_str())) {
        // Forms go with what they are forms of.
        if library.family(name).is_some() {
            library = library.without(name).unwrap_or_else(|e| panic!("{e}"));
        }
    }
    library
}

/// From a recording of so many samples.
fn a_mill_is_diagnosed_and_corrected(samples: usize) {
    let machine = common::machine("xyz_mill");
    let truth = erroneous(&machine, Vec::new());
    let recordings = [measured(&truth, &path(samples, LEARNT), 2e-7)];
    let library =
        only(&["backlash", "hysteresis", "cyclic_error", "scale_error", "positioning_error", "straightness"]);
    let request = DiagnoseOptions::default();
    let mut diagnosis =
        diagnose(&machine, &recordings, &library, &request, &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    let model =
        diagnosis.model(&machine, &recordings, request.options, &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    let mut names: Vec<&str> = diagnosis.findings.iter().map(|f| f.effect.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["backlash", "cyclic_error"]);
    // The file says of the recording what the diagnosis says of itself.
    let again = CalibratedMachine::parse("model.ron", &model.to_ron()).unwrap_or_else(|e| panic!("{e}"));
    let rms = predict(&again, &recordings[0], None).unwrap_or_else(|e| panic!("{e}")).rms.m.expect("lengths");
    let told = diagnosis.rms.m.expect("lengths").r#final;
    assert!((rms - told).abs() < 1e-12, "{rms:e} {told:e}");
    // Left-out stretches show the effects as well: what is left there is the noise, 0.2 um in each of three readings.
    let held = diagnosis.held_out_rms.m.expect("lengths");
    assert!(held.geometric > 5e-6 && (2e-7..5e-7).contains(&held.r#final), "{held:?}");
    for finding in &diagnosis.findings {
        let pair = finding.held_out_rms.m.expect("lengths");
        assert!(pair.before > 5.0 * pair.after && pair.after == held.r#final, "{pair:?}");
    }
    let meant = path(600, [1.9, 2.6, 3.3]);
    let (sent, _) = compensated(&again, &meant);
    let (before, after) = (error(&truth, &meant, &meant), error(&truth, &sent, &meant));
    println!("tip error {:.3} um, corrected {:.3} um", 1e6 * before, 1e6 * after);
    assert!(after < 0.05 * before, "{before:e} {after:e}");
}

#[test]
fn a_mill_is_measured_diagnosed_and_its_program_corrected_to_95_percent() {
    a_mill_is_diagnosed_and_corrected(600);
}

#[test]
#[ignore = "long: the diagnosis of 1500 samples"]
fn so_it_is_from_a_longer_recording() {
    a_mill_is_diagnosed_and_corrected(1500);
}

#[test]
fn what_has_no_name_is_modelled_and_corrected_all_the_same() {
    let machine = common::machine("xyz_mill");
    let play = vec![effect(&machine, "backlash", "x", &[30e-6], &[])];
    let truth = CalibratedMachine::nominal(machine.clone())
        .with_deviations(random_deviations(&machine, 0.3, 5))
        .with_effects(play, vec![1e-9; 3])
        .unwrap_or_else(|e| panic!("{e}"));
    let recordings = [measured(&truth, &path(600, LEARNT), 2e-7)];
    // Nobody has told the program of play, nor of anything that looks like it.
    let library = only(&["scale_error", "straightness", "gravity_compliance"]);
    let request = DiagnoseOptions::default();
    let mut diagnosis =
        diagnose(&machine, &recordings, &library, &request, &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    assert!(diagnosis.findings.is_empty(), "{:?}", diagnosis.findings);
    let unexplained = diagnosis.unexplained.as_ref().expect("play");
    assert_eq!(unexplained.at, "x", "{unexplained:?}");
    let part = &unexplained.parts[0];
    assert_eq!((part.at.as_str(), part.modelled), ("x", true), "{part:?}");
    assert!(part.depends_on.contains(&"direction of x".to_string()), "{part:?}");
    // Half of the play to either side.
    assert!(part.rms.m.is_some_and(|rms| (rms - 15e-6).abs() < 2e-6), "{part:?}");
    let pair = part.held_out_rms.m.expect("lengths");
    assert!(pair.after < 0.1 * pair.before, "{pair:?}");
    let model =
        diagnosis.model(&machine, &recordings, request.options, &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    let again = CalibratedMachine::parse("model.ron", &model.to_ron()).unwrap_or_else(|e| panic!("{e}"));
    let meant = path(600, [1.9, 2.6, 3.3]);
    let (sent, _) = compensated(&again, &meant);
    let (before, after) = (error(&truth, &meant, &meant), error(&truth, &sent, &meant));
    assert!(after < 0.1 * before, "{before:e} {after:e}");
}

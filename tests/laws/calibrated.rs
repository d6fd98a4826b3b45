//! The calibrated machine file: what is written comes back, and it predicts what it was told.

use crate::common;
use kincal::CalibratedMachine;
use kincal::identify::{CalibrateOptions, calibrate, reach};
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};

#[test]
fn calibrated_file_of_every_machine_comes_back_and_predicts_the_same() {
    for (name, machine) in common::machines() {
        let truth =
            CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 4));
        let instrument = Instrument::new(Sensor::Position, 1e-5, 0.0);
        let header = ["setup: here".to_string(), "tool_point: unknown ball".into()];
        let csv = recording(&truth, &instrument, &random_commands(&machine, 120, 5), &header, 6);
        let recordings = [Recording::from_bytes("r.csv", csv.into_bytes(), &machine)
            .unwrap_or_else(|e| panic!("{name}: {e}"))];
        let (calibrated, fit) = calibrate(&machine, &recordings, CalibrateOptions::default())
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        let text = calibrated.to_ron();
        let again = CalibratedMachine::parse("again.ron", &text).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(again.machine(), calibrated.machine(), "{name}");
        for (a, b) in again.deviations().iter().zip(calibrated.deviations()) {
            let gap = (*a - *b).to_array().into_iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            assert!(gap < 1e-15, "{name}: {gap:e}");
        }
        let rms = |c: &CalibratedMachine| {
            predict(c, &recordings[0], None).unwrap_or_else(|e| panic!("{name}: {e}")).rms.m.expect("lengths")
        };
        assert!((rms(&again) - rms(&calibrated)).abs() < 1e-12, "{name}");
        assert!((rms(&calibrated) - fit.rms.m.expect("lengths").geometric).abs() < 1e-12, "{name}");
        // A calibrated file is a machine file: whatever reads a machine reads it too.
        let as_machine = kincal::Machine::parse("again.ron", &text).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(&as_machine, calibrated.machine(), "{name}");
    }
}

#[test]
fn poses_beyond_what_was_seen_are_counted() {
    let machine = common::machine("six_r_arm");
    let truth = CalibratedMachine::nominal(machine.clone());
    let instrument = Instrument::new(Sensor::Position, 1e-5, 0.0);
    let commands = random_commands(&machine, 200, 5);
    let narrow: Vec<Vec<f64>> = commands.iter().map(|q| q.iter().map(|x| 0.5 * x).collect()).collect();
    let open = |commands: &[Vec<f64>]| {
        let csv = recording(&truth, &instrument, commands, &[], 6);
        Recording::from_bytes("r.csv", csv.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"))
    };
    let (calibrated, _) =
        calibrate(&machine, &[open(&narrow)], CalibrateOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let inside = predict(&calibrated, &open(&narrow), None).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(inside.extrapolated_samples, 0);
    let outside = predict(&calibrated, &open(&commands), None).unwrap_or_else(|e| panic!("{e}"));
    assert!(outside.extrapolated_samples > 150, "{outside:?}");
}

#[test]
fn reach_of_a_recording_is_its_rank() {
    let machine = common::machine("ac_table_tilting");
    let truth = CalibratedMachine::nominal(machine.clone());
    let instrument = Instrument::new(Sensor::Distance { absolute: true }, 1e-6, 0.0);
    let header = ["workpiece_point[m]: 0.03, 0.02, -0.25".to_string()];
    let general = random_commands(&machine, 200, 5);
    // Only C moves: uncertainty grows to what one rotary axis can show.
    let only_c: Vec<Vec<f64>> = general.iter().map(|q| vec![general[0][0], q[1], 0.0, 0.0, 0.1]).collect();
    let reach_of = |commands: &[Vec<f64>]| {
        let csv = recording(&truth, &instrument, commands, &header, 6);
        let recordings =
            [Recording::from_bytes("r.csv", csv.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"))];
        let reach = reach(&machine, &recordings).unwrap_or_else(|e| panic!("{e}"));
        (reach.rank, reach.rank_in_general, reach.unknowns)
    };
    assert_eq!(reach_of(&general), (14, 14, 42));
    assert_eq!(reach_of(&only_c), (3, 14, 42));
}

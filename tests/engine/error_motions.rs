//! Error motions that an identification has found: they come back from the file, and prediction, simulation and compensation have them.

use crate::common;
use crate::table::{Axes, Bar, Table, path, record};
use kincal::compensate::{CompensateOptions as Writing, Setup, compensate_text};
use kincal::identify::{CalibrateOptions, ErrorModel, calibrate_model};
use kincal::lie::Twist;
use kincal::predict::predict;
use kincal::simulate::{At, Plant, Sample};
use kincal::variation::{Directions, Varying};
use kincal::{CalibratedMachine, Chain, Machine};

/// On the paper's machine and path; the file as text.
fn calibrated(
    machine: &Machine,
    error_motions: f64,
) -> (CalibratedMachine, Vec<Vec<f64>>, kincal::recording::Recording) {
    let axes = Axes::of(machine);
    let table = Table::random(machine, 3);
    let path = path(machine, 0.1, Bar::Machine, None, 180);
    let recording = record(machine, &table, &path, "rec.csv", 8);
    let varying = Varying { directions: Some(Directions::new(vec![axes.a, axes.c])), terms: Vec::new() };
    let model = ErrorModel::default().with_varying(varying).with_error_motions(error_motions);
    let (found, _) = calibrate_model(
        machine,
        std::slice::from_ref(&recording),
        &model,
        CalibrateOptions::default(),
        &|_| {},
    )
    .unwrap_or_else(|e| panic!("{e}"));
    (found, path, recording)
}

/// The chain at the commands `q` under these directions of travel, by the equations (29) and (32).
fn chain(model: &CalibratedMachine, q: &[f64], directions: &[i8]) -> Chain<f64> {
    let variation = model.variation();
    let keyed = variation.varying.directions.as_ref().expect("pieces");
    let parts = variation.direction_part(keyed.piece(directions), model.deviations().len());
    let mut dh: Vec<Twist<f64>> = model.deviations().iter().zip(parts).map(|(a, b)| *a + b).collect();
    variation.motions.add(model.machine(), q, directions, &mut dh);
    Chain::new(model.machine(), &dh)
}

#[test]
fn error_motions_come_back_from_the_file_and_prediction_and_simulation_have_them() {
    let machine = common::machine("ac_table_tilting_paper");
    let (found, path, recording) = calibrated(&machine, 0.03);
    assert_eq!(found.variation().motions.joints.len(), 5);
    let again = CalibratedMachine::parse("again.ron", &found.to_ron()).unwrap_or_else(|e| panic!("{e}"));
    for (a, b) in again.variation().motions.joints.iter().zip(&found.variation().motions.joints) {
        assert!(a.dyad == b.dyad && (a.from - b.from).abs() < 1e-12 && (a.period - b.period).abs() < 1e-12);
        let gap = |a: &[Twist<f64>], b: &[Twist<f64>]| -> f64 {
            let parts = a.iter().zip(b).flat_map(|(a, b)| (*a - *b).to_array());
            parts.fold(0.0, |most: f64, x| most.max(x.abs()))
        };
        assert!(gap(&a.cosines, &b.cosines).max(gap(&a.sines, &b.sines)) < 1e-15);
        assert!(a.play.iter().zip(&b.play).all(|(a, b)| (a - b).abs() < 1e-15));
    }
    let rms = |model: &CalibratedMachine| {
        predict(model, &recording, None).unwrap_or_else(|e| panic!("{e}")).rms.m.expect("lengths")
    };
    // The RMS that the file tells is without them; with them it is that of the noise, 1 um.
    let told = again.rms().m.expect("lengths");
    println!("rms {:.3} um, without error motions {:.3} um", rms(&again) * 1e6, told * 1e6);
    assert!(rms(&again) < 1.05e-6 && rms(&again) < told);
    assert!((rms(&again) - rms(&found)).abs() < 1e-12);
    // The plant of a calibrated file is the same machine.
    let plant = Plant::new(&again);
    assert!(plant.varies());
    let sample = |(k, q): (usize, &Vec<f64>)| Sample {
        time: k as f64,
        q: q.clone(),
        directions: None,
        recorded: true,
        at: At::Pose(k + 1),
    };
    let first = plant.first_directions(path.iter().enumerate().map(sample).map(Ok)).expect("samples");
    let mut state = plant.start(first);
    let mut seen = 0.0f64;
    let residuals = path.iter().enumerate().map(|(k, q)| {
        plant.advance(&mut state, &sample((k, q)));
        state.chain().w_from_t(q).translation.norm()
    });
    let lengths: Vec<f64> = residuals.collect();
    let measured: Vec<f64> =
        recording.chunks().expect("opens").flat_map(|chunk| chunk.expect("reads").values).collect();
    for (length, measured) in lengths.iter().zip(&measured) {
        seen += (length - measured).powi(2);
    }
    assert!(((seen / lengths.len() as f64).sqrt() - rms(&again)).abs() < 1e-10);
}

#[test]
fn a_program_is_corrected_for_error_motions_at_the_ends_of_its_moves() {
    let machine = common::machine("ac_table_tilting_paper");
    let (found, ..) = calibrated(&machine, 0.03);
    let text = "G21 G90\nG0 X10.00000 Y20 Z30 A40.000000 C50\nG1 X60 A45 C55 F500\nY-40 A50 C70\n";
    let (out, report) = compensate_text(&found, "part.nc", text, &Setup::default(), &Writing::default())
        .unwrap_or_else(|e| panic!("{e}"));
    assert!(report.largest_left_m.value < 1e-7, "{report:?}");
    let read = |text: &str| -> Vec<Vec<f64>> {
        let words: Vec<_> = (0..5).map(|c| machine.command_joint(c).nc_word()).collect();
        let mut q = vec![0.0; 5];
        let mut all = Vec::new();
        for line in text.lines().skip(1) {
            for token in line.split_whitespace() {
                for (c, word) in words.iter().enumerate() {
                    if let Some(number) = token.strip_prefix(word.address.as_str()) {
                        let number: f64 = number.parse().expect("a number");
                        let rotary = ["A", "C"].contains(&word.address.as_str());
                        q[c] = f64::from(word.sign) * if rotary { number.to_radians() } else { number / 1e3 };
                    }
                }
            }
            all.push(q.clone());
        }
        all
    };
    let nominal = Chain::nominal(&machine);
    let axes = Axes::of(&machine);
    for (k, (meant, sent)) in read(text).iter().zip(&read(&out)).enumerate() {
        // A and C only ever go up, in the program's sense.
        let mut directions = vec![0; 5];
        for c in [axes.a, axes.c] {
            directions[c] = machine.command_joint(c).nc_word().sign;
        }
        let is = chain(&found, sent, &directions).w_from_t(sent).translation;
        let left = (is - nominal.w_from_t(meant).translation).norm();
        assert!(left < 1e-7, "block {k}: {left}");
    }
}

//! Simulate, calibrate, recover: what an identification calls identified lies within four standard errors of the truth.

use crate::common;
use kincal::identify::{CalibrateOptions, Fit, Loss, Solver, calibrate};
use kincal::lie::Vec3;
use kincal::machine::Tolerance;
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Machine};

/// Tolerances as a part of the file's. What the data do not see is known to a tolerance only, and its square (a centimetre times a
/// degree, where a tool is only roughly known) must stay below the noise for a linear comparison with the truth.
const SIZE: f64 = 0.004;

/// The machine with smaller tolerances.
fn tightened(machine: &Machine) -> Machine {
    let smaller = |t: Tolerance| Tolerance { translation: SIZE * t.translation, rotation: SIZE * t.rotation };
    let mut dyads: Vec<_> = machine.dyads().to_vec();
    for (j, dyad) in dyads.iter_mut().enumerate() {
        dyad.tolerance = Some(smaller(machine.tolerance(j)));
    }
    let tool = dyads.split_off(machine.workpiece_count());
    Machine::new(machine.name(), machine.units(), dyads, tool).expect("as sound as before")
}

/// Noise of lengths and angles: a twentieth of the machine's own tolerance.
fn noise(machine: &Machine) -> (f64, f64) {
    let tolerance = machine.tolerance(0);
    (0.05 * tolerance.translation, 0.05 * tolerance.rotation)
}

fn instrument(machine: &Machine, sensor: Sensor) -> (Instrument, Vec<String>) {
    let (m, rad) = noise(machine);
    let mut instrument = Instrument::new(sensor.clone(), m, rad);
    let mut header = Vec::new();
    if !matches!(sensor, Sensor::Joint { .. }) {
        instrument.state.tool_point_t = Vec3([0.04, -0.03, 0.02]);
        header.push("tool_point[m]: 0.04, -0.03, 0.02".to_string());
    }
    if let Sensor::Distance { absolute } = sensor {
        instrument.state.workpiece_point_w = Vec3([0.03, 0.05, -0.06]);
        header.push("workpiece_point[m]: 0.03, 0.05, -0.06".into());
        if !absolute {
            instrument.state.length = 0.25;
            header.push("nominal_length[m]: 0.25".into());
        }
    }
    (instrument, header)
}

/// Largest error of a combination that the data see, in standard errors, and how many there are.
fn worst(truth: &CalibratedMachine, fit: &Fit) -> (f64, usize) {
    let machine = truth.machine();
    let of = |frame: &str| machine.frame_index(frame).expect("a frame of the machine");
    let component =
        |name: &str| kincal::identify::COMPONENTS.iter().position(|c| *c == name).expect("a component");
    let miss: Vec<f64> = (fit.parameters.iter())
        .map(|p| {
            let true_value = truth.deviations()[of(&p.frame)].to_array()[component(&p.component)];
            (p.value - true_value) / p.tolerance
        })
        .collect();
    let information = &fit.information;
    let mut worst = (0.0f64, 0);
    for i in (0..information.strength.len()).filter(|i| information.share(*i) > 0.5) {
        let along: f64 = information.directions.column(i).iter().zip(&miss).map(|(d, m)| d * m).sum();
        let standard_error = (1.0 / (1.0 + information.strength[i])).sqrt();
        worst = (worst.0.max((along / standard_error).abs()), worst.1 + 1);
    }
    worst
}

#[test]
fn identified_combinations_lie_within_four_standard_errors_for_every_machine_and_measurement() {
    let direction_w = Vec3([0.48, 0.6, 0.64]);
    let mut too_far = Vec::new();
    for (n, (name, machine)) in common::machines().into_iter().enumerate() {
        let machine = tightened(&machine);
        let (joint, _) = machine.joints().next().expect("a joint");
        let sensors = [
            Sensor::Pose,
            Sensor::Position,
            Sensor::Distance { absolute: false },
            Sensor::Distance { absolute: true },
            Sensor::Displacement { direction_w },
            Sensor::Joint { dyad: joint },
        ];
        let seed = 100 + n as u64;
        let truth = CalibratedMachine::nominal(machine.clone())
            .with_deviations(random_deviations(&machine, 1.0, seed));
        for sensor in sensors {
            let (instrument, header) = instrument(&machine, sensor.clone());
            let count = 800 / sensor.reading_count();
            let commands = random_commands(&machine, count, seed + 10_000);
            let csv = recording(&truth, &instrument, &commands, &header, seed + 20_000);
            let recordings = [Recording::from_bytes("simulated.csv", csv.into_bytes(), &machine)
                .unwrap_or_else(|e| panic!("{name}: {e}"))];
            let (_, fit) = calibrate(&machine, &recordings, CalibrateOptions::default())
                .unwrap_or_else(|e| panic!("{name}: {e}"));
            let (worst, seen) = worst(&truth, &fit);
            println!(
                "{name:<26} {sensor:?}: rank {}, {seen} identified, worst {worst:.2} standard errors, {} after {} steps, loss {:.1}, sigma {:.2e}",
                fit.rank, fit.stop, fit.steps, fit.loss_value, fit.recordings[0].sigma
            );
            assert!(seen > 0, "{name} {sensor:?}: nothing identified");
            if worst > 4.0 {
                too_far.push(format!("{name} {sensor:?}: off by {worst:.2} standard errors"));
            }
            let left = fit.recordings[0].sigma;
            let (m, rad) = noise(&machine);
            let near = |true_noise: f64| (left / true_noise - 1.0).abs() < 0.15;
            assert!(near(m) || near(rad), "{name} {sensor:?}: noise {left:.2e}, put in {m:.2e}");
        }
    }
    assert!(too_far.is_empty(), "{too_far:#?}");
}

#[test]
fn predictions_at_new_poses_are_as_good_as_the_noise_allows_with_deviations_of_full_size() {
    for (n, (name, machine)) in common::machines().into_iter().enumerate() {
        let seed = 500 + 10 * n as u64;
        let truth = CalibratedMachine::nominal(machine.clone())
            .with_deviations(random_deviations(&machine, 1.0, seed));
        for sensor in [Sensor::Pose, Sensor::Position, Sensor::Distance { absolute: false }] {
            let (mut instrument, header) = instrument(&machine, sensor.clone());
            let record = |instrument: &Instrument, seed: u64| {
                let commands = random_commands(&machine, 600, seed);
                let csv = recording(&truth, instrument, &commands, &header, seed + 1);
                Recording::from_bytes("r.csv", csv.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"))
            };
            let learnt = [record(&instrument, seed + 2)];
            let (calibrated, fit) = calibrate(&machine, &learnt, CalibrateOptions::default())
                .unwrap_or_else(|e| panic!("{name}: {e}"));
            let noise = instrument.noise.m;
            (instrument.noise.m, instrument.noise.rad) = (0.0, 0.0);
            let new = record(&instrument, seed + 4);
            let error =
                predict(&calibrated, &new, None).unwrap_or_else(|e| panic!("{e}")).rms.m.expect("lengths");
            let values = if sensor == (Sensor::Distance { absolute: false }) { 1.0 } else { 3.0f64 };
            let expected = noise * values.sqrt() * (fit.information.used / fit.readings as f64).sqrt();
            println!("{name:<26} {sensor:?}: {:.2} of what the noise allows", error / expected);
            assert!(error < 2.0 * expected, "{name} {sensor:?}: {error:.2e} m, expected {expected:.2e} m");
        }
    }
}

#[test]
fn gross_outliers_are_told_and_do_not_bend_the_fit() {
    let machine = tightened(&common::machine("six_r_arm"));
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 5));
    let (instrument, header) = instrument(&machine, Sensor::Position);
    let csv = recording(&truth, &instrument, &random_commands(&machine, 300, 6), &header, 7);
    let head = csv.lines().take_while(|line| line.starts_with('#') || line.starts_with('t')).count() as u64;
    // Every fiftieth row reads 5 mm too much in x.
    let mut rows = 0;
    let spoilt: Vec<String> = csv
        .lines()
        .map(|line| {
            if line.starts_with('#') || line.starts_with('t') {
                return line.to_string();
            }
            rows += 1;
            let mut cells: Vec<String> = line.split(',').map(str::to_string).collect();
            if rows % 50 == 0 {
                let x: f64 = cells[7].parse().expect("a number");
                cells[7] = (x + 5e-3).to_string();
            }
            cells.join(",")
        })
        .collect();
    let bytes = spoilt.join("\n").into_bytes();
    let recordings = [Recording::from_bytes("spoilt.csv", bytes, &machine).unwrap_or_else(|e| panic!("{e}"))];
    for loss in [Loss::Huber { k: 1.345 }, Loss::Tukey { c: 4.685 }, Loss::default()] {
        let options = CalibrateOptions::default().with_loss(loss);
        let (_, fit) = calibrate(&machine, &recordings, options).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(fit.down_weighted, 6, "{loss:?}");
        assert_eq!(fit.suspects.len(), 6);
        assert!(fit.suspects.iter().all(|s| s.residual > 4e-3 && s.weight < 0.5));
        assert!(fit.suspects.iter().all(|s| (s.line - head).is_multiple_of(50)), "{:?}", fit.suspects);
        let (worst, _) = worst(&truth, &fit);
        assert!(worst < 6.0, "{loss:?}: off by {worst:.2} standard errors");
    }
}

#[test]
fn the_named_solvers_do_what_their_names_say() {
    let machine = common::machine("ac_table_tilting");
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 3));
    let (instrument, header) = instrument(&machine, Sensor::Distance { absolute: false });
    let csv = recording(&truth, &instrument, &random_commands(&machine, 600, 4), &header, 5);
    let recordings =
        [Recording::from_bytes("d.csv", csv.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"))];
    let run = |solver| {
        calibrate(
            &machine,
            &recordings,
            CalibrateOptions::default().with_solver(solver).with_loss(Loss::Squares).with_prior(false),
        )
    };
    let rms = |solver| run(solver).map(|(_, fit)| fit.rms.m.expect("lengths").geometric);
    let best = rms(Solver::LevenbergMarquardt).unwrap_or_else(|e| panic!("{e}"));
    // Damping only delays in these directions; truncation at 1e-9 cuts nothing that is seen.
    let truncated = rms(Solver::RankTruncation { cut: 1e-6 }).unwrap_or_else(|e| panic!("{e}"));
    assert!((truncated / best - 1.0).abs() < 1e-6);
    let damped = rms(Solver::FixedDamping { tau: 1e-3, steps: 200 }).unwrap_or_else(|e| panic!("{e}"));
    assert!((damped / best - 1.0).abs() < 1e-3);
    let error = run(Solver::GaussNewton).expect_err("28 of 42 directions are not seen");
    assert!(error.to_string().contains("singular"), "{error}");
}

#[test]
fn least_squares_is_weighed_with_the_noise_that_is_told() {
    let machine = common::machine("ac_table_tilting");
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 3));
    let (instrument, header) = instrument(&machine, Sensor::Distance { absolute: false });
    for stated in [None, Some("sigma[um]: 20"), Some("sigma[um]: 0.01")] {
        let header: Vec<String> = header.iter().cloned().chain(stated.map(String::from)).collect();
        let csv = recording(&truth, &instrument, &random_commands(&machine, 600, 4), &header, 5);
        let recordings =
            [Recording::from_bytes("d.csv", csv.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"))];
        let fixed = Solver::FixedDamping { tau: 1e-8, steps: 5 };
        for solver in [Solver::default(), fixed, Solver::RankTruncation { cut: 1e-6 }] {
            let options = CalibrateOptions::default().with_solver(solver).with_loss(Loss::Squares);
            let (_, fit) = calibrate(&machine, &recordings, options).unwrap_or_else(|e| panic!("{e}"));
            let (rms, sigma) = (fit.rms.m.expect("lengths").geometric, fit.recordings[0].sigma);
            let told = 0.5 * fit.samples as f64 * (rms / sigma).powi(2);
            assert!(
                (fit.loss_value / told - 1.0).abs() < 1e-12,
                "{stated:?} {solver:?}: {} {told}",
                fit.loss_value
            );
        }
    }
}

#[test]
fn noise_of_clean_data_is_found_the_same_under_every_loss() {
    let machine = tightened(&common::machine("six_r_arm"));
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 5));
    let losses = [
        Loss::Huber { k: 3.0 },
        Loss::Huber { k: 2.0 },
        Loss::Huber { k: 1.345 },
        Loss::Tukey { c: 6.0 },
        Loss::Tukey { c: 4.685 },
    ];
    for sensor in [Sensor::Distance { absolute: false }, Sensor::Position, Sensor::Pose] {
        let (instrument, header) = instrument(&machine, sensor.clone());
        let csv = recording(&truth, &instrument, &random_commands(&machine, 2000, 6), &header, 7);
        let recordings =
            [Recording::from_bytes("clean.csv", csv.into_bytes(), &machine)
                .unwrap_or_else(|e| panic!("{e}"))];
        let sigma = |loss: Loss| {
            let options = CalibrateOptions::default().with_loss(loss);
            calibrate(&machine, &recordings, options).unwrap_or_else(|e| panic!("{e}")).1.recordings[0].sigma
        };
        let squares = sigma(Loss::Squares);
        for loss in losses {
            let ratio = sigma(loss) / squares;
            println!("{sensor:?} {loss:?}: {ratio:.4} of the noise that least squares finds");
            assert!((ratio - 1.0).abs() < 0.02, "{sensor:?} {loss:?}: {ratio:.4}");
        }
    }
}

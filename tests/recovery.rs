//! Simulate, calibrate, recover: what an identification calls identified lies within four standard errors of the truth.

mod common;

use kincal::identify::{Fit, Loss, Options, Solver, calibrate};
use kincal::lie::Vec3;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Machine};

/// Deviations as a part of the tolerances: small enough that second-order terms stay below the noise.
const SIZE: f64 = 0.01;

/// Noise of lengths and angles: a hundredth of the machine's own tolerance.
fn noise(machine: &Machine) -> (f64, f64) {
    let tolerance = machine.tolerance(0);
    (0.001 * tolerance.translation, 0.001 * tolerance.rotation)
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
    for (n, (name, machine)) in common::machines().into_iter().enumerate() {
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
            .with_deviations(random_deviations(&machine, SIZE, seed));
        for sensor in sensors {
            let (instrument, header) = instrument(&machine, sensor.clone());
            let count = 800 / sensor.reading_count();
            let commands = random_commands(&machine, count, seed);
            let csv = recording(&truth, &instrument, &commands, &header, seed);
            let recordings = [Recording::from_bytes("simulated.csv", csv.into_bytes(), &machine)
                .unwrap_or_else(|e| panic!("{name}: {e}"))];
            let (_, fit) = calibrate(&machine, &recordings, Options::default())
                .unwrap_or_else(|e| panic!("{name}: {e}"));
            let (worst, seen) = worst(&truth, &fit);
            println!(
                "{name:<26} {sensor:?}: rank {}, {seen} identified, worst {worst:.2} standard errors",
                fit.rank
            );
            assert!(seen > 0, "{name} {sensor:?}: nothing identified");
            assert!(worst <= 4.0, "{name} {sensor:?}: off by {worst:.2} standard errors");
            let left = fit.recordings[0].sigma;
            let (m, rad) = noise(&machine);
            let near = |true_noise: f64| (left / true_noise - 1.0).abs() < 0.15;
            assert!(near(m) || near(rad), "{name} {sensor:?}: noise {left:.2e}, put in {m:.2e}");
        }
    }
}

#[test]
fn gross_outliers_are_told_and_do_not_bend_the_fit() {
    let machine = common::machine("six_r_arm");
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, SIZE, 5));
    let (instrument, header) = instrument(&machine, Sensor::Position);
    let csv = recording(&truth, &instrument, &random_commands(&machine, 300, 5), &header, 5);
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
        let options = Options { loss, ..Options::default() };
        let (_, fit) = calibrate(&machine, &recordings, options).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(fit.down_weighted, 6, "{loss:?}");
        assert_eq!(fit.suspects.len(), 6);
        assert!(fit.suspects.iter().all(|s| s.residual > 4e-3 && s.weight < 0.5));
        assert!(fit.suspects.iter().all(|s| (s.line - 5) % 50 == 0 || s.line > 0));
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
    let csv = recording(&truth, &instrument, &random_commands(&machine, 600, 3), &header, 3);
    let recordings =
        [Recording::from_bytes("d.csv", csv.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"))];
    let run =
        |solver| calibrate(&machine, &recordings, Options { solver, loss: Loss::Squares, prior: false });
    let rms = |solver| run(solver).map(|(_, fit)| fit.rms_m.expect("lengths").geometric);
    let best = rms(Solver::LevenbergMarquardt).unwrap_or_else(|e| panic!("{e}"));
    // Damping only delays in these directions; truncation at 1e-9 cuts nothing that is seen.
    let truncated = rms(Solver::RankTruncation { cut: 1e-6 }).unwrap_or_else(|e| panic!("{e}"));
    assert!((truncated / best - 1.0).abs() < 1e-6);
    let damped = rms(Solver::FixedDamping { tau: 1e-3, steps: 200 }).unwrap_or_else(|e| panic!("{e}"));
    assert!((damped / best - 1.0).abs() < 1e-3);
    let error = run(Solver::GaussNewton).expect_err("28 of 42 directions are not seen");
    assert!(error.to_string().contains("singular"), "{error}");
}

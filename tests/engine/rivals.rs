//! Rivals: schemes that must agree where they say the same, a filter that must end where least squares ends, and the harness.

use crate::common;
use kincal::identify::{CalibrateOptions, Loss, Solver, calibrate};
use kincal::lie::{Twist, Vec3};
use kincal::recording::Recording;
use kincal::rivals::{Arena, Form, Kalman, KalmanOptions, Rival, Scheme, Step, Tuning, against_truth, split};
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use kincal::units::ByQuantity;
use kincal::{CalibratedMachine, Error, Machine};

/// A machine with known deviations, and a recording of it.
fn measured(
    machine: &Machine,
    size: f64,
    sensor: Sensor,
    noise: (f64, f64),
    count: usize,
    head: &[&str],
) -> (CalibratedMachine, Recording) {
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(machine, size, 11));
    let mut instrument = Instrument::new(sensor, noise.0, noise.1);
    if let Sensor::Distance { absolute } = instrument.sensor {
        instrument.state.workpiece_point_w = Vec3([0.03, 0.05, -0.06]);
        instrument.state.length = if absolute { 0.0 } else { 0.4 };
    }
    let head: Vec<String> = head.iter().map(ToString::to_string).collect();
    let csv = recording(&truth, &instrument, &random_commands(machine, count, 12), &head, 13);
    let recording =
        Recording::from_bytes("made.csv", csv.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"));
    (truth, recording)
}

fn fit(rival: Rival, machine: &Machine, recordings: &[Recording]) -> CalibratedMachine {
    rival.fit(machine, recordings).unwrap_or_else(|e| panic!("{rival:?}: {e}")).calibrated
}

const MACHINES: [&str; 6] =
    ["ac_table_tilting", "bc_head_head_nutating", "six_r_arm", "scara", "ur10", "dlr_justin_left"];

#[test]
fn every_form_reaches_exact_poses_in_a_few_steps_on_machines_of_every_kind() {
    for name in MACHINES {
        let machine = common::machine(name);
        let (truth, recording) = measured(&machine, 1.0, Sensor::Pose, (0.0, 0.0), 60, &[]);
        for form in [Form::Local, Form::Factors, Form::Tangent, Form::Free] {
            let off = |steps| {
                let scheme = Scheme { form, step: Step::Truncated { cut: 1e-7, unit_m: 1.0 }, steps };
                let model = fit(Rival::Scheme(scheme), &machine, std::slice::from_ref(&recording));
                let seen = against_truth(&model, &truth, std::slice::from_ref(&recording));
                seen.unwrap_or_else(|e| panic!("{e}")).expect("poses see both frames")
            };
            let (first, last) = (off(1), off(6));
            println!(
                "{name} {form:?}: dp {:.1e} m after one step, {:.1e} m after six",
                first.dp_m, last.dp_m
            );
            // Quadratic: a wrong column or a step that does not belong to it would leave a part of the first error.
            assert!(last.dp_m < 1e-11 && last.dr_rad < 1e-11, "{name} {form:?}: {last:?}");
        }
    }
}

#[test]
fn the_local_scheme_is_the_fixed_damping_of_calibrate() {
    let machine = common::machine("ac_table_tilting");
    let (_, recording) = measured(
        &machine,
        1.0,
        Sensor::Distance { absolute: true },
        (1e-6, 0.0),
        80,
        &["workpiece_point[m]: 0.03, 0.05, -0.06"],
    );
    let recordings = [recording];
    let scheme = Scheme { form: Form::Local, step: Step::Damped { tau: 1e-3 }, steps: 12 };
    let ours = fit(Rival::Scheme(scheme), &machine, &recordings);
    let solver = Solver::FixedDamping { tau: 1e-3, steps: 12 };
    let options = CalibrateOptions::default().with_solver(solver).with_loss(Loss::Squares).with_prior(false);
    let theirs = fit(Rival::Local(options), &machine, &recordings);
    for (a, b) in ours.deviations().iter().zip(theirs.deviations()) {
        let d = *a - *b;
        // One adds to the pose, the other to its coordinates: the same to first order in the deviations.
        assert!(d.v.norm() < 1e-8 && d.w.norm() < 1e-8, "{d:?}");
        assert!(a.v.norm() < 1e-3);
    }
}

#[test]
fn gauss_newton_fails_where_the_data_do_not_see_everything_and_says_why() {
    let machine = common::machine("ac_table_tilting");
    let (_, recording) = measured(&machine, 1.0, Sensor::Position, (1e-6, 0.0), 60, &[]);
    let recordings = [recording];
    let arena =
        Arena { machine: &machine, fit_on: &recordings, judge_on: &[], truth: None, fit_setup: false };
    for form in [Form::Local, Form::Factors, Form::Tangent, Form::Free] {
        let rival = Rival::Scheme(Scheme { form, step: Step::GaussNewton, steps: 5 });
        let verdict = arena.judge("plain", &rival).unwrap_or_else(|e| panic!("{e}"));
        let why = verdict.failed.expect("it fails");
        assert!(why.contains("singular"), "{why}");
        assert!(verdict.judged.is_none());
    }
}

#[test]
fn a_scheme_refuses_readings_of_a_single_joint() {
    let machine = common::machine("linear_axis");
    let dyad = machine.frame_index("x").expect("a frame");
    let (_, recording) = measured(&machine, 1.0, Sensor::Joint { dyad }, (1e-6, 0.0), 20, &[]);
    let scheme = Scheme { form: Form::Tangent, step: Step::Damped { tau: 1e-3 }, steps: 2 };
    let error = Rival::Scheme(scheme).fit(&machine, &[recording]).expect_err("refused");
    assert!(matches!(error, Error::Undetermined { .. }), "{error}");
}

/// Largest difference of two machines' deviations in units of standard errors of the batch, and of those errors.
fn difference(machine: &Machine, recordings: &[Recording], options: KalmanOptions) -> (f64, f64) {
    let batch = CalibrateOptions::default().with_loss(Loss::Squares);
    let (_, report) = calibrate(machine, recordings, batch).unwrap_or_else(|e| panic!("{e}"));
    let declared = fit(Rival::Declared, machine, recordings);
    let mut filter = Kalman::new(machine, options).with_setups(&declared);
    for recording in recordings {
        filter.follow(recording).unwrap_or_else(|e| panic!("{e}"));
    }
    let (names, covariance, found) = (filter.names(), filter.covariance(), filter.calibrated());
    let (mut of_value, mut of_error) = (0.0f64, 0.0f64);
    let mut compared = 0;
    for p in report.parameters.iter().filter(|p| p.frame != "w") {
        let k = names.iter().position(|n| *n == format!("{}.{}", p.frame, p.component)).expect("a name");
        let j = machine.frame_index(&p.frame).expect("a frame");
        let component =
            kincal::identify::COMPONENTS.iter().position(|c| *c == p.component).expect("one of six");
        let value = found.deviations()[j].to_array()[component];
        of_value = of_value.max((value - p.value).abs() / p.std_error);
        // What a set-up leaves open is pinned by the batch and merely unknown to the filter: there the errors differ by intent.
        if p.share > 0.9 {
            of_error = of_error.max((covariance[(k, k)].sqrt() / p.std_error - 1.0).abs());
        }
        compared += 1;
    }
    assert_eq!(compared, 6 * (machine.dyads().len() - 1));
    (of_value, of_error)
}

#[test]
fn the_filter_ends_where_least_squares_with_the_same_prior_ends() {
    // The stated sigma is a little above the noise, so that least squares weights with it and not with what it sees.
    // What is left is of second order in the deviations: samples are linearised where the filter stood when they came. The arm is
    // given a tenth of its tolerances; at full size it is off by 0.3 standard errors.
    for (name, size, limit) in [
        ("ac_table_tilting", 1.0, 1e-3),
        ("bc_head_table", 1.0, 1e-3),
        ("scara", 1.0, 0.05),
        ("six_r_arm", 0.1, 0.1),
    ] {
        let machine = common::machine(name);
        for (sensor, noise, head) in [
            (Sensor::Position, (1e-5, 0.0), vec!["sigma[um]: 13"]),
            (
                Sensor::Distance { absolute: true },
                (1e-5, 0.0),
                vec!["sigma[um]: 13", "workpiece_point[m]: 0.03, 0.05, -0.06"],
            ),
        ] {
            let (_, recording) = measured(&machine, size, sensor.clone(), noise, 400, &head);
            let (value, error) = difference(&machine, &[recording], KalmanOptions::default());
            println!(
                "{name} {sensor:?}: values within {value:.1e} standard errors, errors within {error:.1e}"
            );
            assert!(value < limit, "{name} {sensor:?}: {value}");
            assert!(error < 0.01, "{name} {sensor:?}: {error}");
        }
    }
}

#[test]
fn the_filter_finds_unknown_set_ups_with_the_rest() {
    let machine = common::machine("ac_table_tilting");
    let head = ["sigma[um]: 6", "setup: hall", "workpiece_frame: unknown", "tool_point: unknown ball"];
    let (_, recording) = measured(&machine, 0.3, Sensor::Position, (5e-6, 0.0), 300, &head);
    let (value, error) = difference(&machine, &[recording], KalmanOptions::default());
    println!("values within {value:.1e} standard errors, errors within {error:.1e}");
    assert!(value < 0.05 && error < 0.02, "{value}, {error}");
}

#[test]
fn the_filter_finds_the_length_of_a_bar_and_the_zero_of_an_indicator() {
    let machine = common::machine("ac_table_tilting");
    let bar = ["sigma[um]: 2", "nominal_length: unknown", "workpiece_point[m]: 0.03, 0.05, -0.06"];
    let (_, recording) =
        measured(&machine, 0.3, Sensor::Distance { absolute: false }, (1e-6, 0.0), 300, &bar);
    let (value, error) = difference(&machine, &[recording], KalmanOptions::default());
    assert!(value < 0.05 && error < 0.02, "length: {value}, {error}");
    let direction_w = Vec3([0.6, 0.0, 0.8]);
    let dial = ["sigma[um]: 2", "zero: unknown"];
    let (_, recording) =
        measured(&machine, 0.3, Sensor::Displacement { direction_w }, (1e-6, 0.0), 300, &dial);
    let (value, error) = difference(&machine, &[recording], KalmanOptions::default());
    assert!(value < 0.05 && error < 0.02, "zero: {value}, {error}");
}

#[test]
fn the_covariance_shrinks_with_every_sample_and_stays_positive() {
    let machine = common::machine("six_r_arm");
    let (_, recording) = measured(&machine, 0.3, Sensor::Pose, (1e-5, 1e-5), 60, &[]);
    let options =
        KalmanOptions { noise: Some(ByQuantity { m: 1e-5, rad: 1e-5 }), ..KalmanOptions::default() };
    let mut filter = Kalman::new(&machine, options);
    let stream = filter.open(recording.header()).unwrap_or_else(|e| panic!("{e}"));
    let mut before = f64::INFINITY;
    let n = machine.commands().len();
    for chunk in recording.chunks().unwrap_or_else(|e| panic!("{e}")) {
        let chunk = chunk.unwrap_or_else(|e| panic!("{e}"));
        for k in 0..chunk.len {
            let update =
                filter.update(stream, &chunk.commands[k * n..(k + 1) * n], &chunk.values[6 * k..6 * k + 6]);
            let update = update.unwrap_or_else(|e| panic!("{e}"));
            assert!(update.surprise.is_finite() && update.weight == 1.0);
            let covariance = filter.covariance();
            let trace = covariance.trace();
            assert!(trace < before, "sample {k}: {trace} after {before}");
            before = trace;
            assert!(covariance.diagonal().min() > 0.0);
        }
    }
    assert_eq!(filter.samples(), 60);
    let smallest = filter.covariance().symmetric_eigenvalues().min();
    assert!(smallest > -1e-20, "{smallest}");
}

#[test]
fn the_filter_takes_little_from_a_sample_that_lies_far_off() {
    let machine = common::machine("ac_table_tilting");
    let (_, recording) = measured(&machine, 0.3, Sensor::Position, (1e-6, 0.0), 200, &["sigma[um]: 1"]);
    let run = |loss, glitch: f64| {
        let mut filter = Kalman::new(&machine, KalmanOptions { loss, ..KalmanOptions::default() });
        let stream = filter.open(recording.header()).unwrap_or_else(|e| panic!("{e}"));
        let chunk = recording.chunks().unwrap_or_else(|e| panic!("{e}")).next().expect("samples");
        let chunk = chunk.unwrap_or_else(|e| panic!("{e}"));
        for k in 0..chunk.len {
            let mut values = chunk.values[3 * k..3 * k + 3].to_vec();
            if k == 150 {
                values[1] += glitch;
            }
            let q = &chunk.commands[5 * k..5 * k + 5];
            filter.update(stream, q, &values).unwrap_or_else(|e| panic!("{e}"));
        }
        let model = filter.calibrated();
        kincal::rivals::residuals(&model, std::slice::from_ref(&recording))
            .unwrap_or_else(|e| panic!("{e}"))
            .mean
            .m
            .expect("lengths")
    };
    let clean = run(Loss::Squares, 0.0);
    let (squares, robust) = (run(Loss::Squares, 1e-3), run(Loss::Tukey { c: 4.685 }, 1e-3));
    println!(
        "mean residual: clean {clean:.2e} m, one glitch of 1 mm {squares:.2e} m, with Tukey {robust:.2e} m"
    );
    assert!(squares > 2.0 * clean, "the glitch must show: {squares:.2e} against {clean:.2e}");
    assert!(robust < 1.05 * clean, "{robust:.2e} against {clean:.2e}");
}

#[test]
fn a_filter_that_may_wander_follows_a_machine_that_changes() {
    let machine = common::machine("linear_axis");
    let head = ["sigma[um]: 1"];
    let (_, before) = measured(&machine, 0.0, Sensor::Position, (1e-6, 0.0), 300, &head);
    let mut changed = vec![Twist::zero(0.0); 3];
    changed[1].w = Vec3([0.0, 1e-6, 0.0]);
    let after = CalibratedMachine::nominal(machine.clone()).with_deviations(changed);
    let instrument = Instrument::new(Sensor::Position, 1e-6, 0.0);
    let head: Vec<String> = head.iter().map(ToString::to_string).collect();
    let csv = recording(&after, &instrument, &random_commands(&machine, 100, 5), &head, 6);
    let later =
        Recording::from_bytes("later.csv", csv.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"));
    let end = |walk| {
        let mut filter = Kalman::new(&machine, KalmanOptions { walk, ..KalmanOptions::default() });
        [&before, &later].into_iter().for_each(|r| filter.follow(r).unwrap_or_else(|e| panic!("{e}")));
        let judged = against_truth(&filter.calibrated(), &after, std::slice::from_ref(&later));
        judged.unwrap_or_else(|e| panic!("{e}")).expect("positions").dp_m
    };
    let (still, walking) = (end(0.0), end(1e-3));
    println!("dp after a change: {still:.2e} m without walk, {walking:.2e} m with");
    assert!(walking < 0.3 * still, "{walking:.2e} against {still:.2e}");
}

#[test]
fn a_filter_without_noise_or_start_says_what_it_needs() {
    let machine = common::machine("ac_table_tilting");
    let mut filter = Kalman::new(&machine, KalmanOptions::default());
    for (head, word) in
        [(vec![], "sigma"), (vec!["sigma[um]: 1", "workpiece_frame: unknown"], "calibration knows")]
    {
        let (_, recording) = measured(&machine, 0.1, Sensor::Position, (1e-6, 0.0), 10, &head);
        let error = filter.open(recording.header()).expect_err("refused");
        assert!(error.mend().contains(word), "{}", error.mend());
    }
    let (_, recording) = measured(&machine, 0.1, Sensor::Position, (1e-6, 0.0), 10, &["sigma[um]: 1"]);
    let stream = filter.open(recording.header()).unwrap_or_else(|e| panic!("{e}"));
    assert!(filter.update(stream, &[0.0; 4], &[0.0; 3]).is_err());
    assert!(filter.update(stream, &[0.0; 5], &[0.0; 2]).is_err());
    let missing = filter.update(stream, &[0.0; 5], &[0.0, f64::NAN, 0.0]).expect("a drop-out is no fault");
    assert_eq!((missing.weight, filter.samples()), (0.0, 0));
}

#[test]
fn a_bar_between_two_points_that_coincide_is_left_out_by_the_filter_and_told_by_the_schemes() {
    let machine = common::machine("linear_axis");
    let bar = "# measurement: distance\n# sigma[um]: 1\nx[m],r[m]\n0,0\n0.1,0.1\n0.2,0.2\n";
    let bar = Recording::from_bytes("bar.csv", bar.as_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"));
    let mut filter = Kalman::new(&machine, KalmanOptions::default());
    let stream = filter.open(bar.header()).unwrap_or_else(|e| panic!("{e}"));
    let nowhere = filter.update(stream, &[0.0], &[0.0]).expect("it says nothing, and is no fault");
    assert_eq!((nowhere.weight, filter.samples()), (0.0, 0));
    assert!(filter.covariance().iter().all(|x| x.is_finite()));
    filter.update(stream, &[0.1], &[0.1]).expect("this one says something");
    assert_eq!(filter.samples(), 1);
    for form in [Form::Local, Form::Factors, Form::Tangent, Form::Free] {
        let scheme = Scheme { form, step: Step::Truncated { cut: 1e-3, unit_m: 1.0 }, steps: 3 };
        let error = Rival::Scheme(scheme).fit(&machine, std::slice::from_ref(&bar)).expect_err("refused");
        assert!(error.to_string().contains("no direction"), "{error}");
    }
}

#[test]
fn a_split_recording_has_every_sample_once_and_the_picked_ones_evenly_spread() {
    let machine = common::machine("ac_table_tilting");
    let (_, recording) = measured(&machine, 0.1, Sensor::Position, (0.0, 0.0), 1001, &["sigma[um]: 1"]);
    let times = |r: &Recording| -> Vec<f64> {
        let chunks = r.chunks().unwrap_or_else(|e| panic!("{e}"));
        chunks.flat_map(|c| c.unwrap_or_else(|e| panic!("{e}")).time.expect("a time")).collect()
    };
    let all = times(&recording);
    for count in [2, 7, 100, 999, 1000] {
        let (picked, rest) = split(&recording, &machine, count).unwrap_or_else(|e| panic!("{e}"));
        let (picked, rest) = (picked.expect("a part"), rest.expect("a part"));
        assert_eq!(picked.header(), recording.header());
        let (picked, rest) = (times(&picked), times(&rest));
        assert_eq!(picked.len() as u64, count);
        let mut both: Vec<f64> = picked.iter().chain(&rest).copied().collect();
        both.sort_by(f64::total_cmp);
        assert_eq!(both, all);
        let gaps: Vec<f64> = picked.windows(2).map(|w| ((w[1] - w[0]) / 0.01).round()).collect();
        let (least, most) = gaps.iter().fold((f64::MAX, 0.0f64), |(l, m), g| (l.min(*g), m.max(*g)));
        assert!(most - least <= 1.0, "{count}: gaps {least} to {most}");
    }
    let (picked, rest) = split(&recording, &machine, 5000).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(times(&picked.expect("all")).len(), 1001);
    assert!(rest.is_none());
}

#[test]
fn every_named_rival_gives_a_verdict_on_the_same_data() {
    let machine = common::machine("ac_table_tilting");
    let head = ["sigma[um]: 1", "workpiece_point[m]: 0.03, 0.05, -0.06"];
    let (truth, recording) =
        measured(&machine, 1.0, Sensor::Distance { absolute: true }, (1e-6, 0.0), 400, &head);
    let (picked, rest) = split(&recording, &machine, 100).unwrap_or_else(|e| panic!("{e}"));
    let (fit_on, judge_on) = ([picked.expect("a part")], [rest.expect("a part")]);
    let arena = Arena {
        machine: &machine,
        fit_on: &fit_on,
        judge_on: &judge_on,
        truth: Some(&truth),
        fit_setup: false,
    };
    let mut declared = 0.0;
    for (name, rival) in Rival::named(Tuning::default()) {
        let verdict = arena.judge(name, &rival).unwrap_or_else(|e| panic!("{name}: {e}"));
        if name == "local-gauss-newton" {
            assert!(verdict.failed.expect("it fails").contains("singular"));
            continue;
        }
        assert!(verdict.failed.is_none(), "{name}: {:?}", verdict.failed);
        let judged = verdict.judged.expect("judged");
        assert_eq!(judged.samples, 300);
        let mean = judged.mean.m.expect("lengths");
        println!("{name}: {mean:.2e} m, {:?}", verdict.truth);
        if name == "declared" {
            declared = mean;
        } else {
            assert!(mean < 0.5 * declared, "{name}: {mean:.2e} against {declared:.2e} as declared");
        }
    }
}

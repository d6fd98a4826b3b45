//! Targets that are mounted anew, instruments that are moved, joints that are read too early.

use std::f64::consts::TAU;

use crate::common::random::Random;
use crate::common::{machine, machines};
use kincal::chain::Chain;
use kincal::identify::{CalibrateOptions, calibrate};
use kincal::lie::{Pose, Twist, Vec3};
use kincal::mistakes::{nonsense, odd};
use kincal::predict::predict;
use kincal::recording::{Arrays, Recording};
use kincal::simulate::{random_commands, random_deviations};
use kincal::{CalibratedMachine, Machine};

/// Noise of an instrument, m and rad.
const NOISE: (f64, f64) = (50e-6, 100e-6);

fn anywhere(random: &mut Random, reach: f64) -> Pose<f64> {
    let v = Vec3(std::array::from_fn(|_| reach * random.between(-1.0, 1.0)));
    let axis = Vec3(std::array::from_fn(|_| random.normal()));
    let turn = Pose::turn(axis.times(1.0 / axis.norm()), random.between(0.5, 3.0));
    Pose { rotation: turn.rotation, translation: v }
}

fn noisy(pose: Pose<f64>, random: &mut Random) -> Pose<f64> {
    let mut part = |size: f64| Vec3(std::array::from_fn(|_| size * random.normal()));
    let (v, w) = (part(NOISE.0), part(NOISE.1));
    let turned = Pose::exp(Twist::new(Vec3([0.0; 3]), w));
    Pose { rotation: (turned * pose).rotation, translation: pose.translation + v }
}

/// What is read of a target that sits at `t_from_target`, by an instrument that stands at `w_from_instrument(k)`.
fn read(
    machine: &Machine,
    commands: &[Vec<f64>],
    w_from_instrument: impl Fn(usize) -> Pose<f64>,
    t_from_target: Pose<f64>,
    random: &mut Random,
) -> Vec<Pose<f64>> {
    let chain = Chain::new(machine, &random_deviations(machine, 1.0, 5));
    let one = |(k, q): (usize, &Vec<f64>)| {
        noisy(w_from_instrument(k).inverse() * chain.w_from_t(q) * t_from_target, random)
    };
    commands.iter().enumerate().map(one).collect()
}

fn arrays(machine: &Machine, commands: &[Vec<f64>], poses: &[Pose<f64>]) -> Arrays {
    let column = |c: usize| commands.iter().map(|q| q[c]).collect::<Vec<_>>();
    let joints = machine.commands().iter().enumerate();
    joints.fold(Arrays::pose(poses), |arrays, (c, joint)| arrays.command(joint, &column(c)))
}

/// Set-ups of an arm, target and instrument each time elsewhere; `declared`: what their heads say of it.
fn set_ups(machine: &Machine, count: usize, declared: impl Fn(Arrays, &str) -> Arrays) -> Vec<Recording> {
    let mut random = Random::new(3);
    let one = |i: usize| {
        let commands = random_commands(machine, 50, 10 + i as u64);
        let (instrument, target) = (anywhere(&mut random, 2.0), anywhere(&mut random, 0.1));
        let poses = read(machine, &commands, |_| instrument, target, &mut random);
        let name = format!("s{i}");
        let head = arrays(machine, &commands, &poses).set_up(&name).unknown_workpiece_frame();
        declared(head, &name).recording(&format!("{name}.csv"), machine).expect("a recording")
    };
    (0..count).map(one).collect()
}

#[test]
fn targets_mounted_anew_leave_the_noise() {
    let machine = machine("ur10");
    let all = set_ups(&machine, 3, |head, name| head.unknown_tool_point(name).unknown_tool_rotation(name));
    let (calibrated, fit) = calibrate(&machine, &all, CalibrateOptions::default()).expect("a fit");
    let (m, rad) = (fit.rms.m.expect("m").geometric, fit.rms.rad.expect("rad").geometric);
    // Norms of three components, less what the fit has used up.
    assert!(m < 1.8 * NOISE.0 && rad < 1.8 * NOISE.1, "{m} m, {rad} rad");
    assert!(odd(&machine, &all, &|_| {}).expect("read").moved.is_none());
    // The file keeps them, and foretells with them.
    let again = CalibratedMachine::parse("c.ron", &calibrated.to_ron()).expect("a machine");
    for recording in &all {
        let left = predict(&again, recording, None).expect("a prediction").rms;
        assert!(left.m.expect("m") < 1.9 * NOISE.0 && left.rad.expect("rad") < 1.9 * NOISE.1, "{left:?}");
    }
}

#[test]
#[ignore = "long: every mistake is tried on the poses of two set-ups"]
fn a_target_that_is_turned_anew_in_every_set_up_is_named() {
    let machine = machine("ur10");
    let all = set_ups(&machine, 2, |head, _| head);
    let said = nonsense(&machine, &all, &|_| {}).expect("read").expect("nonsense");
    let told: Vec<&str> = said.mistakes.iter().map(|m| m.what.as_str()).collect();
    assert_eq!(told, ["place and rotation of the target unknown, one for each set-up,"]);
}

#[test]
fn a_set_up_that_contradicts_the_others_is_told_and_what_is_new_in_it() {
    let machine = machine("ur10");
    let all = set_ups(&machine, 2, |head, name| head.unknown_tool_rotation(name));
    let said = nonsense(&machine, &all, &|_| {}).expect("read").expect("nonsense");
    let apart = said.apart.expect("a set-up that contradicts the others");
    assert!(apart.alone < 2.0 * NOISE.0 && said.left.left > 1000.0 * apart.alone, "{apart:?}");
    assert!(said.left.recording.starts_with(&apart.setup));
    let told: Vec<&str> = said.mistakes.iter().map(|m| m.what.as_str()).collect();
    assert_eq!(told, ["the place of the target unknown, one for each set-up,"]);
}

#[test]
fn an_instrument_that_was_moved_is_told_with_its_line() {
    let machine = machine("ur10");
    let mut random = Random::new(4);
    let commands = random_commands(&machine, 120, 4);
    let before = anywhere(&mut random, 2.0);
    for (seed, way) in [(1, 0.001), (2, 0.05)] {
        let mut random = Random::new(seed);
        let after = before * Pose::translation(Vec3([way, 0.0, 0.3 * way]));
        let instrument = |k: usize| if k < 70 { before } else { after };
        let poses = read(&machine, &commands, instrument, Pose::identity(0.0), &mut random);
        let head = arrays(&machine, &commands, &poses).unknown_workpiece_frame();
        let recording = head.recording("r.csv", &machine).expect("a recording");
        let moved = odd(&machine, &[recording], &|_| {}).expect("read").moved.expect("moved");
        // Three lines stand above the first sample.
        assert!(moved.line.abs_diff(3 + 70 + 1) <= 1, "{moved:?}");
        assert!((moved.by_m - 1.044 * way).abs() < 0.2 * way && moved.then < 2.6 * NOISE.0, "{moved:?}");
    }
}

#[test]
fn an_instrument_that_creeps_was_not_moved() {
    let machine = machine("ur10");
    let mut random = Random::new(6);
    let commands = random_commands(&machine, 120, 6);
    let before = anywhere(&mut random, 2.0);
    // Evenly, and as something that gets warm.
    for course in [|s: f64| s, |s: f64| 1.0 - (-4.0 * s).exp()] {
        let instrument =
            |k: usize| before * Pose::translation(Vec3([0.003 * course(k as f64 / 120.0), 0.0, 0.0]));
        let poses = read(&machine, &commands, instrument, Pose::identity(0.0), &mut random);
        let head = arrays(&machine, &commands, &poses).unknown_workpiece_frame();
        let recording = head.recording("r.csv", &machine).expect("a recording");
        let moved = odd(&machine, &[recording], &|_| {}).expect("read").moved;
        assert!(moved.is_none(), "{moved:?}");
    }
}

#[test]
fn joints_that_were_read_before_the_arm_had_settled_are_told() {
    let machine = machine("ur10");
    let mut random = Random::new(8);
    let commands = random_commands(&machine, 120, 8);
    let poses = read(&machine, &commands, |_| Pose::identity(0.0), Pose::identity(0.0), &mut random);
    let mut early = commands.clone();
    for k in 1..early.len() {
        for (c, q) in early[k].iter_mut().enumerate() {
            *q -= 0.02 * (commands[k][c] - commands[k - 1][c]);
        }
    }
    let recording = arrays(&machine, &early, &poses).recording("r.csv", &machine).expect("a recording");
    let said = odd(&machine, &[recording], &|_| {}).expect("read");
    let early = said.unsettled.expect("read too early");
    assert!(early.parts.iter().all(|part| (part - 0.02).abs() < 0.002), "{early:?}");
    assert!(early.then < 0.1 * early.left.left && said.moved.is_none(), "{early:?}");
}

fn nothing_odd(draws: impl Iterator<Item = u64>) {
    let all = machines();
    for draw in draws {
        let (name, machine) = &all[draw as usize % all.len()];
        let recording = crate::common::planted::sound_recording(name, draw);
        let said = odd(machine, &[recording], &|_| {}).unwrap_or_else(|e| panic!("{e}"));
        assert!(said.moved.is_none() && said.unsettled.is_none(), "{name}, draw {draw}: {said:?}");
    }
}

#[test]
fn nothing_is_odd_in_sound_recordings() {
    nothing_odd([1, 11, 15].into_iter());
}

#[test]
#[ignore = "long: 200 recordings"]
fn nothing_is_odd_in_two_hundred_sound_recordings() {
    nothing_odd(0..200);
}

#[test]
fn whole_turns_are_no_extrapolation() {
    let machine = machine("ur10");
    let mut commands = random_commands(&machine, 60, 8);
    commands.iter_mut().for_each(|q| q[1] *= 0.1);
    let mut random = Random::new(9);
    let poses = read(&machine, &commands, |_| Pose::identity(0.0), Pose::identity(0.0), &mut random);
    let recording = arrays(&machine, &commands, &poses).recording("r.csv", &machine).expect("a recording");
    let (calibrated, _) = calibrate(&machine, &[recording], CalibrateOptions::default()).expect("a fit");
    let (from, to) = calibrated.seen(1).expect("a range");
    assert_eq!(calibrated.beyond(1, 0.5 * (from + to) + TAU), None);
    assert_eq!(calibrated.beyond(1, 0.5 * (from + to) - 3.0 * TAU), None);
    let by = calibrated.beyond(1, to + 0.3).expect("beyond");
    assert!((by - 0.3).abs() < 1e-12, "{by}");
    let by = calibrated.beyond(1, from - 0.3 - TAU).expect("beyond");
    assert!((by - 0.3).abs() < 1e-12, "{by}");
    let mut q = vec![0.0; 6];
    q[1] = to + 0.3;
    assert!(calibrated.extrapolates(&q));
}

#[test]
fn another_machine_and_exchanged_branches_are_named() {
    let arm = machine("ur10");
    let mut random = Random::new(12);
    let commands = random_commands(&arm, 60, 12);
    let poses = read(
        &arm,
        &commands,
        |_| Pose::identity(0.0),
        Pose::translation(Vec3([0.04, 0.03, 0.1])),
        &mut random,
    );
    let points: Vec<[f64; 3]> = poses.iter().map(|pose| pose.translation.0).collect();
    let told = |given: &Machine| -> Vec<String> {
        let columns = commands_by_joint(&arm, &commands);
        let all = columns.iter().fold(Arrays::position(&points), |all, (joint, q)| all.command(joint, q));
        let all = all.tool_point(Vec3([0.04, 0.03, 0.1])).recording("r.csv", given).expect("a recording");
        let said = nonsense(given, &[all], &|_| {}).expect("read").expect("nonsense");
        said.mistakes.iter().map(|m| m.what.clone()).collect()
    };
    assert_eq!(told(&machine("puma560")), ["machine ur10"]);
    let text =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/machines/ur10.ron")).expect("the file");
    let text = text
        .replace("\"ur10\"", "\"arm\"")
        .replace("\"w\"", "\"?\"")
        .replace("\"t\"", "\"w\"")
        .replace("\"?\"", "\"t\"");
    let text = text.replace("workpiece: [", "?").replace("tool: [", "workpiece: [").replace('?', "tool: [");
    let exchanged = Machine::parse("arm.ron", &text).unwrap_or_else(|e| panic!("{e}"));
    let mut named = told(&exchanged);
    named.sort();
    assert_eq!(named, ["machine ur10", "the branches exchanged"]);
}

fn commands_by_joint<'a>(machine: &'a Machine, commands: &[Vec<f64>]) -> Vec<(&'a str, Vec<f64>)> {
    let joints = machine.commands().iter().enumerate();
    joints.map(|(c, joint)| (joint.as_str(), commands.iter().map(|q| q[c]).collect())).collect()
}

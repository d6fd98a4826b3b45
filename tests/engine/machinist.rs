//! A machinist's round trip: an erroneous machine is measured, calibrated, its program corrected, and cut on the erroneous machine.
//!
//! `KINCAL_BLOCKS` says how many blocks the programs have; 600 without.

use std::fmt::Write;

use crate::common;
use kincal::compensate::{CompensateOptions, Setup, compensate_text};
use kincal::identify::{CalibrateOptions as Fitting, ErrorModel, calibrate, calibrate_model};
use kincal::inverse::{Goal, Inverse, Mode};
use kincal::lie::{Pose, Vec3};
use kincal::machine::JointKind;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{
    At, Claims, Faults, Instrument, Plant, RandomPoses, Run, Sample, Style, random_commands,
    random_deviations, recording, recordings,
};
use kincal::variation::{Directions, Varying};
use kincal::{CalibratedMachine, Chain, Machine};

mod play;

fn blocks() -> usize {
    std::env::var("KINCAL_BLOCKS").ok().and_then(|n| n.parse().ok()).unwrap_or(600)
}

fn five_axis() -> Vec<(String, Machine)> {
    let rotary = |m: &Machine| (0..5).filter(|c| m.command_joint(*c).kind == JointKind::Revolute).count();
    common::machines().into_iter().filter(|(_, m)| m.commands().len() == 5 && rotary(m) == 2).collect()
}

/// The tool that the measuring ball stood for, and a work offset with which the program's zero is that of frame `w` (tool centre
/// point function on) or of the joints (off).
fn setup(machine: &Machine, tcp: bool) -> Setup {
    let linear = |c: &usize| machine.command_joint(*c).kind == JointKind::Prismatic;
    let at_w = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: Pose::identity(0.0) };
    let free: Vec<bool> = (0..5).map(|c| tcp && linear(&c)).collect();
    let inverse = Inverse::new(machine).with_mode(Mode::Position);
    let q = inverse.solve(&Chain::nominal(machine), &at_w, &[0.0; 5], &free).commands;
    let offsets = (0..5).filter(linear).map(|c| {
        let word = machine.command_joint(c).nc_word();
        let length = if word.address == "Z" { 120.0 } else { 0.0 };
        format!("\"{}\": {}", word.address, f64::from(word.sign) * q[c] * 1e3 - length)
    });
    let offsets = offsets.collect::<Vec<_>>().join(", ");
    let text = format!(
        "Setup(tools: {{\"1\": 120}}, reference_length: 120, work_offsets: {{\"G54\": {{{offsets}}}}})"
    );
    Setup::parse("setup.ron", &text).unwrap_or_else(|e| panic!("{e}"))
}

/// Joint commands along a smooth path in the middle half of the travel, tilted enough that the tool axis can be corrected.
fn path(machine: &Machine, count: usize) -> Vec<Vec<f64>> {
    let (mut turn, mut slide) = (0, 0);
    let waves: Vec<(f64, f64, f64)> = (0..machine.commands().len())
        .map(|c| {
            let (low, high) = machine.travel(c);
            if machine.command_joint(c).kind == JointKind::Revolute {
                turn += 1;
                // The one with the shorter travel tilts.
                if high - low < 10.0 { (0.7, 0.45, 2.3) } else { (0.3, 2.5, 1.0 + 0.1 * f64::from(turn)) }
            } else {
                slide += 1;
                (0.5 * (low + high), 0.2 * (high - low).min(0.6), 1.7 + 0.9 * f64::from(slide))
            }
        })
        .collect();
    (0..count)
        .map(|k| {
            let s = 6.0 * k as f64 / count as f64;
            waves.iter().map(|(mid, by, rate)| mid + by * (rate * s + rate).sin()).collect()
        })
        .collect()
}

/// What the program means: the tip of each block in `w`, and the tool axis.
fn meant(machine: &Machine, q: &[f64]) -> Pose<f64> {
    Chain::nominal(machine).w_from_t(q)
}

/// A program that goes along the path; tool centre point function on or off. Words that do not change are left out.
fn program(machine: &Machine, path: &[Vec<f64>], tcp: bool) -> String {
    let mut text = String::from("%\n(path of five axes)\nG21 G90 G94 G17 G54\nT1 M6\n");
    text.push_str(if tcp { "G43.4 H1\n" } else { "G43 H1\n" });
    let mut last: Vec<String> = vec![String::new(); 5];
    for (k, q) in path.iter().enumerate() {
        let tip = meant(machine, q).translation.0;
        let mut words = Vec::new();
        for c in 0..5 {
            let joint = machine.command_joint(c);
            let word = joint.nc_word();
            let rotary = joint.kind == JointKind::Revolute;
            let value = match (rotary, ["X", "Y", "Z"].iter().position(|a| *a == word.address)) {
                (true, _) => f64::from(word.sign) * q[c].to_degrees(),
                (false, Some(i)) if tcp => tip[i] * 1e3,
                _ => f64::from(word.sign) * q[c] * 1e3,
            };
            let number = format!("{}{value:.6}", word.address);
            if number != last[c] {
                words.push(number.clone());
                last[c] = number;
            }
        }
        let _ = writeln!(text, "N{} G1 {} F2000", 10 * (k + 1), words.join(" "));
    }
    text.push_str("M30\n%\n");
    text
}

/// An executor that shares nothing with the compensator: splits words by letters, keeps what is modal, and sends the joints
/// where the control's nominal kinematics say.
fn execute(machine: &Machine, text: &str, tcp: bool) -> Vec<Vec<f64>> {
    let nominal = Chain::nominal(machine);
    let words: Vec<_> = (0..5).map(|c| machine.command_joint(c).nc_word()).collect();
    let mut value: Vec<f64> = vec![0.0; 5];
    let mut sent = Vec::new();
    let mut q = vec![0.0; 5];
    for line in text.lines().filter(|l| l.starts_with('N')) {
        for token in line.split_ascii_whitespace() {
            for c in 0..5 {
                let Some(number) = token.strip_prefix(words[c].address.as_str()) else { continue };
                value[c] = number.parse().expect("a number");
            }
        }
        let rotary = |c: usize| machine.command_joint(c).kind == JointKind::Revolute;
        for c in 0..5 {
            let sign = f64::from(words[c].sign);
            if rotary(c) {
                q[c] = sign * value[c].to_radians();
            } else if !tcp {
                q[c] = sign * value[c] / 1e3;
            }
        }
        if tcp {
            // Linear joints move the tip by constant vectors: solve three equations.
            let base: Vec<f64> = (0..5).map(|c| if rotary(c) { q[c] } else { 0.0 }).collect();
            let tip = |q: &[f64]| nalgebra::Vector3::from(nominal.w_from_t(q).translation);
            let linear: Vec<usize> = (0..5).filter(|c| !rotary(*c)).collect();
            let mut matrix = nalgebra::Matrix3::zeros();
            for (k, c) in linear.iter().enumerate() {
                let mut moved = base.clone();
                moved[*c] = 1.0;
                matrix.set_column(k, &(tip(&moved) - tip(&base)));
            }
            let mut wanted = nalgebra::Vector3::zeros();
            for c in &linear {
                let i = ["X", "Y", "Z"].iter().position(|a| *a == words[*c].address).expect("X, Y or Z");
                wanted[i] = value[*c] / 1e3;
            }
            let solved = matrix.lu().solve(&(wanted - tip(&base))).expect("three directions");
            linear.iter().zip(solved.iter()).for_each(|(c, x)| q[*c] = *x);
        }
        sent.push(q.clone());
    }
    sent
}

/// Root mean square errors of tip (m) and tool axis (rad) where these joints are sent.
fn errors(machine: &Machine, actual: &Chain<f64>, path: &[Vec<f64>], sent: &[Vec<f64>]) -> (f64, f64) {
    assert_eq!(path.len(), sent.len());
    let (mut m, mut rad) = (0.0, 0.0);
    for (q, sent) in path.iter().zip(sent) {
        let (wanted, is) = (meant(machine, q), actual.w_from_t(sent));
        m += (wanted.translation - is.translation).norm().powi(2);
        rad += wanted.rotation.column(2).cross(is.rotation.column(2)).norm().powi(2);
    }
    let count = path.len() as f64;
    ((m / count).sqrt(), (rad / count).sqrt())
}

/// Three balls in frame `t`, or the pose; on random poses of the whole travel.
fn measure(actual: &CalibratedMachine, by_points: bool) -> Vec<String> {
    let machine = actual.machine();
    let poses = random_commands(machine, 250, 77);
    let balls = [[0.0, 0.0, 0.0], [0.06, 0.0, 0.01], [0.0, 0.06, -0.05]];
    if !by_points {
        return vec![recording(actual, &Instrument::new(Sensor::Pose, 3e-7, 3e-6), &poses, &[], 1)];
    }
    let of = |(k, ball): (usize, &[f64; 3])| {
        let mut instrument = Instrument::new(Sensor::Position, 3e-7, 0.0);
        instrument.state.tool_point_t = Vec3(*ball);
        let header = format!("tool_point[m]: {}, {}, {}", ball[0], ball[1], ball[2]);
        recording(actual, &instrument, &poses, &[header], 10 + k as u64)
    };
    balls.iter().enumerate().map(of).collect()
}

fn calibrated_from(machine: &Machine, texts: &[String]) -> CalibratedMachine {
    let read = |(k, text): (usize, &String)| {
        Recording::from_bytes(&format!("rec_{k}.csv"), text.as_bytes(), machine)
            .unwrap_or_else(|e| panic!("{e}"))
    };
    let recordings: Vec<Recording> = texts.iter().enumerate().map(read).collect();
    let (found, _) = calibrate(machine, &recordings, Fitting::default()).unwrap_or_else(|e| panic!("{e}"));
    // As it comes back from its file.
    CalibratedMachine::parse("calibrated.ron", &found.to_ron()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_measured_machine_cuts_what_its_corrected_program_means() {
    for (k, (name, machine)) in five_axis().into_iter().enumerate() {
        let deviations = random_deviations(&machine, 1.0, 100 + k as u64);
        let actual = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations);
        let calibrated = calibrated_from(&machine, &measure(&actual, k % 2 == 1));
        let path = path(&machine, blocks());
        for tcp in [true, false] {
            let (text, setup) = (program(&machine, &path, tcp), setup(&machine, tcp));
            let start = std::time::Instant::now();
            let (corrected, report) =
                compensate_text(&calibrated, "path.nc", &text, &setup, &CompensateOptions::default())
                    .unwrap_or_else(|e| panic!("{name}: {e}"));
            let seconds = start.elapsed().as_secs_f64();
            let before = errors(&machine, &actual.chain(), &path, &execute(&machine, &text, tcp));
            let after = errors(&machine, &actual.chain(), &path, &execute(&machine, &corrected, tcp));
            println!(
                "{name} tcp {tcp}: tip {:.2} -> {:.3} um, axis {:.2} -> {:.3} urad, {} moves in {seconds:.2} s, singular {}",
                before.0 * 1e6,
                after.0 * 1e6,
                before.1 * 1e6,
                after.1 * 1e6,
                report.moves,
                report.singular.count
            );
            assert_eq!(report.moves as usize, path.len(), "{name}");
            let unseen = report.unseen.expect("the calibrated file says so");
            assert!(unseen.tip_m < 1e-6 && unseen.axis_rad < 5e-6, "{name}: {unseen:?}");
            assert_eq!(report.unreachable.count, 0, "{name}");
            assert!(after.0 < 0.05 * before.0, "{name} tcp {tcp}: tip {before:?} to {after:?}");
            assert!(after.1 < 0.1 * before.1, "{name} tcp {tcp}: axis {before:?} to {after:?}");
            assert_eq!(corrected.lines().count(), text.lines().count(), "{name}");
        }
    }
}

#[test]
fn the_executor_sends_an_uncorrected_program_where_it_means_to_go() {
    for (name, machine) in five_axis() {
        let path = path(&machine, 50);
        for tcp in [true, false] {
            let sent = execute(&machine, &program(&machine, &path, tcp), tcp);
            let (m, rad) = errors(&machine, &Chain::nominal(&machine), &path, &sent);
            assert!(m < 2e-9 && rad < 2e-8, "{name} tcp {tcp}: {m} m, {rad} rad");
        }
    }
}

#[test]
fn corrected_positions_are_those_of_the_inverse() {
    let (name, machine) = five_axis().remove(0);
    let actual =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 3));
    let path = path(&machine, 40);
    let (corrected, _) = compensate_text(
        &actual,
        "path.nc",
        program(&machine, &path, false),
        &setup(&machine, false),
        &CompensateOptions::default(),
    )
    .expect("a plain program");
    let inverse = Inverse::new(&machine).with_mode(Mode::PositionAndAxis);
    for (q, sent) in path.iter().zip(execute(&machine, &corrected, false)) {
        let goal = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: meant(&machine, q) };
        let solution = inverse.solve(&actual.chain(), &goal, q, &[true; 5]);
        for (a, b) in solution.commands.iter().zip(&sent) {
            assert!((a - b).abs() < 3e-8, "{name}: {a} {b}");
        }
    }
}

/// Joint commands with the tip on a sphere about the workpiece's zero, the rotary joints going to and fro.
fn on_a_sphere(machine: &Machine, radius: f64, count: usize, shift: f64) -> Vec<Vec<f64>> {
    let inverse = Inverse::new(machine).with_mode(Mode::Position);
    let nominal = Chain::nominal(machine);
    let free: Vec<bool> = (0..5).map(|c| machine.command_joint(c).kind == JointKind::Prismatic).collect();
    let mut q = vec![0.0; 5];
    (0..count)
        .map(|k| {
            let s = std::f64::consts::TAU * k as f64 / count as f64 + shift;
            let mut turn = 0.0;
            for c in (0..5).filter(|c| !free[*c]) {
                let (low, high) = machine.travel(c);
                turn += 1.0;
                q[c] = if high - low < 10.0 { 0.6 + 0.4 * (2.0 * s).sin() } else { 2.0 * (s + turn).sin() };
            }
            let (out, up) = ((3.0 * s).cos(), 0.9 + 0.5 * (2.0 * s + shift).sin());
            let n = [up.cos() * (s * 2.0).cos(), up.cos() * (s * 2.0).sin() * out.signum(), up.sin()];
            let w_from_tip = Pose::translation(Vec3(n).times(radius));
            let goal = Goal { t_from_tip: Pose::identity(0.0), w_from_tip };
            inverse.solve(&nominal, &goal, &q, &free).commands
        })
        .collect()
}

#[test]
fn one_ballbar_corrects_what_it_sees_and_the_report_says_what_it_does_not() {
    for (k, (name, machine)) in five_axis().into_iter().enumerate() {
        let actual = CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(
            &machine,
            1.0,
            300 + k as u64,
        ));
        let paths = [0.0, 1.3].map(|shift| on_a_sphere(&machine, 0.1, 300, shift));
        let bar = Instrument::new(Sensor::Distance { absolute: true }, 2e-7, 0.0);
        let texts: Vec<String> = paths
            .iter()
            .enumerate()
            .map(|(i, path)| recording(&actual, &bar, path, &[], 5 + i as u64))
            .collect();
        let calibrated = calibrated_from(&machine, &texts);
        let path = &paths[0];
        let text = program(&machine, path, true);
        let (corrected, report) = compensate_text(
            &calibrated,
            "path.nc",
            &text,
            &setup(&machine, true),
            &CompensateOptions::default(),
        )
        .unwrap_or_else(|e| panic!("{name}: {e}"));
        let along = |sent: Vec<Vec<f64>>| {
            let chain = actual.chain();
            let off = path.iter().zip(&sent).map(|(q, sent)| {
                let (wanted, is) = (meant(&machine, q).translation, chain.w_from_t(sent).translation);
                (is.norm() - wanted.norm()).powi(2)
            });
            (off.sum::<f64>() / path.len() as f64).sqrt()
        };
        let (before, after) =
            (along(execute(&machine, &text, true)), along(execute(&machine, &corrected, true)));
        let (tip, axis) = errors(&machine, &actual.chain(), path, &execute(&machine, &corrected, true));
        let unseen = report.unseen.expect("the calibrated file says so");
        println!(
            "{name}: along the bar {:.2} -> {:.3} um; left {:.1} um, {:.1} urad; told as unseen {:.1} um, {:.1} urad in {} patterns, first {:?}",
            before * 1e6,
            after * 1e6,
            tip * 1e6,
            axis * 1e6,
            unseen.tip_m * 1e6,
            unseen.axis_rad * 1e6,
            unseen.patterns.len(),
            unseen.patterns[0].mostly
        );
        assert!(after < 0.05 * before, "{name}: {before} to {after}");
        // A distance to one point leaves six combinations of a five-axis machine open, (22).
        assert!(unseen.patterns.len() >= 6, "{name}: {}", unseen.patterns.len());
        // What is left is of the size that was told.
        assert!(tip < 3.0 * unseen.tip_m && tip > unseen.tip_m / 5.0, "{name}: {tip} {unseen:?}");
        assert!(axis < 3.0 * unseen.axis_rad && axis > unseen.axis_rad / 5.0, "{name}: {axis} {unseen:?}");
    }
}

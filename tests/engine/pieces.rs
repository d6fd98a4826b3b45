//! Models keyed on directions of travel, and models with terms.

use std::fmt::Write;

use crate::common;
use kincal::feature::Feature;
use kincal::identify::{CalibrateOptions, ErrorModel, Loss, calibrate_model};
use kincal::lie::{Pose, Twist};
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_deviations, recording};
use kincal::variation::{Directions, Part, Slot, Term, Varying};
use kincal::{CalibratedMachine, Chain, Machine};

/// What a simulated machine does wrong at a moment: added to the deviations before the joints.
type Wrong<'a> = dyn Fn(&[f64], &[i8]) -> Vec<Twist<f64>> + 'a;

/// A path on which every axis goes to and fro several times, so that all patterns of directions occur.
fn path(machine: &Machine, count: usize) -> Vec<Vec<f64>> {
    let amplitude = |c: usize| {
        let (from, to) = machine.travel(c);
        let half = 0.5 * (to - from).min(1.5);
        (if from.is_finite() { 0.5 * (from + to) } else { 0.0 }, 0.8 * half)
    };
    (0..count)
        .map(|k| {
            let t = k as f64 / count as f64 * std::f64::consts::TAU;
            (0..machine.commands().len())
                .map(|c| {
                    let (middle, half) = amplitude(c);
                    middle + half * ((2.0 + c as f64) * t + 0.7 * c as f64).sin()
                })
                .collect()
        })
        .collect()
}

/// Positions of the tool in m, without noise.
fn record(machine: &Machine, commands: &[Vec<f64>], wrong: &Wrong) -> String {
    let names: Vec<String> = (machine.commands().iter().enumerate())
        .map(|(c, name)| {
            let prismatic = machine.command_joint(c).kind == kincal::machine::JointKind::Prismatic;
            format!("{name}[{}]", if prismatic { "m" } else { "rad" })
        })
        .collect();
    let mut text = format!(
        "# measurement: position\n# tool_point[mm]: 20,30,-90\n{},px[m],py[m],pz[m]\n",
        names.join(",")
    );
    let mut last = commands[0].clone();
    let mut directions: Vec<i8> = (0..last.len())
        .map(|c| {
            let first = commands.iter().map(|q| q[c] - last[c]).find(|d| *d != 0.0);
            first.map_or(0, |d| if d > 0.0 { 1 } else { -1 })
        })
        .collect();
    for q in commands {
        for c in 0..q.len() {
            if q[c] != last[c] {
                directions[c] = if q[c] > last[c] { 1 } else { -1 };
            }
        }
        last.clone_from(q);
        let chain = Chain::new(machine, &wrong(q, &directions));
        let p = chain.w_from_t(q).transform(kincal::lie::Vec3([0.02, 0.03, -0.09]));
        let numbers: Vec<String> = q.iter().chain(&p.0).map(|x| format!("{x:.17}")).collect();
        let _ = writeln!(text, "{}", numbers.join(","));
    }
    text
}

fn open(machine: &Machine, text: &str) -> [Recording; 1] {
    [Recording::from_bytes("rec.csv", text.as_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))]
}

fn exact() -> CalibrateOptions {
    CalibrateOptions::default().with_loss(Loss::Squares)
}

/// Adds to the deviation along a joint.
fn along(machine: &Machine, mut dh: Vec<Twist<f64>>, joint: &str, by: f64) -> Vec<Twist<f64>> {
    let (j, joint) = machine.joints().find(|(_, own)| own.name == joint).expect("a joint");
    dh[j] = dh[j] + joint.twist().times(by);
    dh
}

/// The joints that have a command of their own, two at most.
fn two_axes(machine: &Machine) -> Vec<usize> {
    let alone = |c: &usize| machine.joints().any(|(_, j)| j.name == machine.commands()[*c]);
    (0..machine.commands().len()).rev().filter(alone).take(2).collect()
}

#[test]
fn backlash_of_every_machine_is_described_by_pieces_to_the_rounding() {
    for (name, machine) in common::machines() {
        let mut axes = two_axes(&machine);
        // Four patterns of a long arm are many unknowns, and say no more than two.
        axes.truncate(if machine.commands().len() > 5 { 1 } else { 2 });
        let names: Vec<String> = axes.iter().map(|c| machine.commands()[*c].clone()).collect();
        let constant = random_deviations(&machine, 0.3, 5);
        let wrong = |_: &[f64], directions: &[i8]| {
            axes.iter().zip(&names).fold(constant.clone(), |dh, (c, joint)| {
                along(&machine, dh, joint, 2e-5 * f64::from(directions[*c]))
            })
        };
        let recordings = open(&machine, &record(&machine, &path(&machine, 120), &wrong));
        let varying = Varying { directions: Some(Directions::new(axes.clone())), terms: Vec::new() };
        // Dead bands of nothing: the path is exact.
        let model = ErrorModel::default()
            .with_varying(varying)
            .with_dead_bands(vec![Some(0.0); machine.commands().len()]);
        let (calibrated, fit) = calibrate_model(&machine, &recordings, &model, exact(), &|_| {})
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        let with = fit.rms.m.expect("lengths").geometric;
        assert!(with < 2e-8, "{name}: {with:e}");
        // The file says the same.
        let again =
            CalibratedMachine::parse("again.ron", &calibrated.to_ron()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(again.variation().varying, calibrated.variation().varying, "{name}");
        assert_eq!(again.variation().samples, calibrated.variation().samples, "{name}");
        let told = predict(&again, &recordings[0], None).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(
            (told.rms.m.expect("lengths") - with).abs() < 1e-3 * with + 1e-11,
            "{name}: {told:?} {with:e}"
        );
        assert_eq!(told.unseen_directions, 0);
        // So does its simulation, on a path of its own, but for the rounding of frame w: the file holds it as a frame of the
        // set-up and as a deviation.
        let mut instrument = Instrument::new(Sensor::Position, 0.0, 0.0);
        instrument.state.tool_point_t = kincal::lie::Vec3([0.02, 0.03, -0.09]);
        let point = ["tool_point[mm]: 20,30,-90".to_string()];
        let simulated = open(&machine, &recording(&again, &instrument, &path(&machine, 150), &point, 1));
        let told = predict(&again, &simulated[0], None).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(told.max.m.expect("lengths") < 2e-11, "{name}: {told:?}");
        let constant =
            CalibratedMachine::nominal(machine.clone()).with_deviations(again.deviations().to_vec());
        let told = predict(&constant, &simulated[0], None).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(told.rms.m.expect("lengths") > 5e-7, "{name}: {told:?}");
    }
}

#[test]
fn a_pattern_that_was_never_seen_is_told_and_predicted_from_single_directions() {
    let machine = common::machine("ac_table_tilting");
    let wrong = |_: &[f64], d: &[i8]| {
        let none = vec![Twist::zero(0.0); machine.dyads().len()];
        let a = along(
            &machine,
            none,
            "a",
            3e-5 * f64::from(d[machine.commands().iter().position(|c| c == "a").expect("a")]),
        );
        along(
            &machine,
            a,
            "c",
            -2e-5 * f64::from(d[machine.commands().iter().position(|c| c == "c").expect("c")]),
        )
    };
    let all = path(&machine, 1200);
    let axis = |name: &str| machine.commands().iter().position(|c| c == name).expect("an axis");
    let (a, c) = (axis("a"), axis("c"));
    // With the directions of approach stated, any selection of rows keeps them.
    let text = record(&machine, &all, &wrong);
    let both_forward = |k: usize| {
        let (from, to) = if k == 0 { (0, 1) } else { (k - 1, k) };
        [a, c].map(|axis| all[to][axis] > all[from][axis])
    };
    let stated = |keep: &dyn Fn([bool; 2]) -> bool| {
        let mut out = String::new();
        for (n, line) in text.lines().enumerate() {
            let forward = both_forward(n.saturating_sub(3));
            let [a, c] = forward.map(|f| if f { 1 } else { -1 });
            match n {
                0 | 1 => writeln!(out, "{line}"),
                2 => writeln!(out, "{line},a_direction[1],c_direction[1]"),
                _ if keep(forward) => writeln!(out, "{line},{a},{c}"),
                _ => Ok(()),
            }
            .expect("text");
        }
        out
    };
    let train = open(&machine, &stated(&|forward| forward != [true, true]));
    let judge = open(&machine, &stated(&|_| true));
    let model = ErrorModel::default()
        .with_varying(Varying { directions: Some(Directions::new(vec![a, c])), terms: Vec::new() });
    let (calibrated, fit) =
        calibrate_model(&machine, &train, &model, exact(), &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    let names: Vec<&str> = fit.pieces.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["ARCR", "ARCF", "AFCR"]);
    let told = predict(&calibrated, &judge[0], None).unwrap_or_else(|e| panic!("{e}"));
    assert!(told.unseen_directions > 100, "{told:?}");
    // The prior shares a little of it out to what goes with both axes; the play itself makes 6 um.
    assert!(told.max.m.expect("lengths") < 1e-6, "{told:?}");
}

#[test]
fn coefficients_of_terms_before_and_behind_the_joint_and_on_the_reading_are_recovered() {
    for (name, machine) in common::machines() {
        let axes = two_axes(&machine);
        let names: Vec<String> = axes.iter().map(|c| machine.commands()[*c].clone()).collect();
        let (j, joint) = machine.joints().find(|(_, own)| own.name == names[0]).expect("a joint");
        let behind = Twist::from_array([0.0, 0.0, 0.0, 0.6, 0.0, 0.8]);
        let (lost, tilt, drift) = (4.1e-5, 3.3e-5, 2.7e-6);
        let constant = random_deviations(&machine, 0.3, 6);
        let commands = path(&machine, 300);
        let square = |q: &[f64]| q[axes[0]] * q[axes[0]];
        // The carried deviation is simulated as one of the next frame: exp(e) M = M exp(Ad(M⁻¹) e).
        let next =
            (j + 1 < machine.dyads().len() && machine.branch(j + 1) == machine.branch(j)).then_some(j + 1);
        let Some(next) = next else { panic!("{name}: a joint has a frame behind it") };
        let previous_from_next: Pose<f64> = machine.dyads()[next].placement.pose();
        let wrong = |q: &[f64], directions: &[i8]| {
            let mut dh =
                along(&machine, constant.clone(), &names[0], 0.5 * lost * f64::from(directions[axes[0]]));
            let e = Pose::exp(behind.times(tilt * square(q)));
            let moved = previous_from_next.inverse() * e * previous_from_next * Pose::exp(dh[next]);
            dh[next] = moved.log();
            dh
        };
        let mut text = String::new();
        for (n, line) in record(&machine, &commands, &wrong).lines().enumerate() {
            // The second reading drifts with the second axis.
            let mut cells: Vec<String> = line.split(',').map(String::from).collect();
            if n >= 3 {
                let y = cells.len() - 2;
                let value: f64 = cells[y].parse().expect("a number");
                cells[y] = format!("{:.17}", value + drift * commands[n - 3][axes[axes.len() - 1]]);
            }
            let _ = writeln!(text, "{}", cells.join(","));
        }
        let recordings = open(&machine, &text);
        let last = machine.joints().find(|(_, own)| own.name == names[names.len() - 1]).expect("a joint").0;
        let part = |slot, direction, feature| Term {
            parts: vec![Part { slot, direction, feature }],
            scale: 1e-4,
            prior: false,
            of_setup: false,
        };
        let terms = vec![
            part(Slot::Before(j), joint.twist(), Feature::half_direction(j)),
            part(Slot::After(j), behind, Feature::position(j).times(Feature::position(j))),
            part(Slot::Reading, Twist::from_array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]), Feature::position(last)),
        ];
        let model = ErrorModel::default()
            .with_varying(Varying { directions: None, terms })
            .with_dead_bands(vec![Some(0.0); machine.commands().len()]);
        let (_, fit) = calibrate_model(&machine, &recordings, &model, exact(), &|_| {})
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        let rms = fit.rms.m.expect("lengths").geometric;
        assert!(rms < 2e-8, "{name}: {rms:e} {} {:?} {:?}", fit.stop, fit.coefficients, fit.recordings);
        let found: Vec<f64> = fit.coefficients.iter().map(|c| c.value).collect();
        // To half a percent: the prior holds the geometry, and the terms have to make up for that.
        assert!((found[0] - lost).abs() < 5e-3 * lost, "{name}: {found:?}");
    }
}

#[test]
fn samples_are_picked_evenly_from_every_piece_and_the_others_judge() {
    let machine = common::machine("ac_table_tilting");
    let none = |_: &[f64], _: &[i8]| vec![Twist::zero(0.0); machine.dyads().len()];
    let recordings = open(&machine, &record(&machine, &path(&machine, 1000), &none));
    let model = ErrorModel::default()
        .with_varying(Varying { directions: Some(Directions::new(vec![3, 4])), terms: Vec::new() })
        .with_samples(40);
    let (_, fit) =
        calibrate_model(&machine, &recordings, &model, exact(), &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(fit.pieces.len(), 4);
    assert!(fit.pieces.iter().all(|p| p.fit.samples == 40), "{:?}", fit.pieces);
    let out: u64 = fit.pieces.iter().map(|p| p.held_out.expect("held out").samples).sum();
    assert_eq!(out, 1000 - 160);
    assert_eq!(fit.held_out.expect("held out").model.samples, out);
}

//! Simulation: the paper's path, the laws of play, noise and tests, and what the command line says.

use std::f64::consts::{PI, TAU};

use crate::common;
use crate::common::paper::{paper_path, paper_plant};
use kincal::lie::{Pose, Twist, Vec3};
use kincal::machine::JointKind;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{
    At, Balls, Claims, Course, Family, Faults, Figure, Instrument, Leg, Pace, Plant, Pointing, RandomPoses,
    Rounding, Run, Sample, Scatter, Sense, Standard, Style, Turning, Turns, Wave, noise_of, plane_across,
    recordings, rest, usual_range,
};
use kincal::{CalibratedMachine, Chain, Machine};

mod plant;

const ORIGIN: Vec3<f64> = Vec3([0.0; 3]);

fn balls(length: f64) -> Balls {
    Balls { workpiece_point_w: ORIGIN, tool_point_t: ORIGIN, length }
}

fn turns(from: f64, to: f64, senses: &[Sense], step: f64) -> Vec<Leg> {
    let (senses, paces) = (senses.to_vec(), vec![Pace::Steps(step)]);
    Turns { from, to, senses, parts: 1, repeat: 1, overshoot: 0.0, dwell: 0.0, paces }.legs()
}

fn once(from: f64, to: f64) -> Vec<Leg> {
    turns(from, to, &[Sense::Positive], 0.05)
}

fn turning(machine: &Machine, figure: Figure, balls: Balls, legs: Vec<Leg>) -> kincal::Result<Turning> {
    Turning::new(machine, figure, balls, &rest(machine), legs, 100.0, Rounding::default())
}

fn samples(course: &dyn Course) -> Vec<Sample> {
    course.samples().expect("it starts").map(|s| s.unwrap_or_else(|e| panic!("{e}"))).collect()
}

fn plant(machine: &Machine, faults: &str) -> Plant {
    let faults = Faults::parse("faults.ron", faults, machine).unwrap_or_else(|e| panic!("{e}"));
    Plant::new(&CalibratedMachine::nominal(machine.clone())).with_faults(&faults)
}

mod data_sets {
    use super::*;

    #[test]
    #[ignore = "needs the data sets, see tests/real"]
    fn the_twelve_printed_rows_come_out_within_five_hundredths_of_a_micrometre_and_exactly_in_a_and_c() {
        let machine = common::machine("ac_table_tilting_paper");
        let column = |name: &str| machine.commands().iter().position(|c| c == name).expect("an axis");
        for (table, length) in [("table7", 0.1), ("table9", 0.15)] {
            let path = common::data(&format!("paper/{table}.csv"));
            let path_of_paper = paper_path(&machine, length, 0.1f64.to_radians()).expect("the paper ran it");
            let all = samples(&path_of_paper);
            assert_eq!(all.len(), 7204);
            let mut rows = csv::Reader::from_path(path).expect("a table");
            for (row, sample) in rows.deserialize::<[f64; 5]>().zip(&all) {
                let row = row.expect("five numbers");
                for (printed, axis) in row.iter().zip(["x", "y", "z", "a", "c"]) {
                    let q = sample.q[column(axis)];
                    let linear = ["x", "y", "z"].contains(&axis);
                    let (value, allowed) = if linear { (q * 1e3, 5e-5) } else { (q.to_degrees(), 1e-9) };
                    assert!((value - printed).abs() < allowed, "{table} {axis}: {value} for {printed}");
                }
            }
        }
    }

    #[test]
    #[ignore = "needs the data sets, see tests/real"]
    fn increments_of_chain_factors_move_the_tool_as_the_golden_file_has_it() {
        let (table, golden) = (common::data("paper/table6.csv"), common::data("paper/golden_fk.csv"));
        let machine = common::machine("ac_table_tilting_paper");
        let text = std::fs::read_to_string(table).expect("a table");
        let entries: Vec<String> = text
            .lines()
            .skip(1)
            .map(|line| {
                let f: Vec<&str> = line.split(',').collect();
                format!(
                    "(frame: \"{}\", v: ({}, {}, {}), w: ({}, {}, {}))",
                    f[0], f[1], f[2], f[3], f[4], f[5], f[6]
                )
            })
            .collect();
        let plant = plant(
            &machine,
            &format!("Faults(units: (length: um, angle: urad), factors: [{}])", entries.join(",\n")),
        );
        let actual = Chain::new(&machine, plant.constant());
        let column = |name: &str| machine.commands().iter().position(|c| c == name).expect("an axis");
        let mut rows = csv::Reader::from_path(golden).expect("a table");
        for row in rows.records() {
            let x: Vec<f64> = row.expect("a row").iter().map(|f| f.parse().expect("a number")).collect();
            let mut q = vec![0.0; 5];
            for (i, axis) in ["x", "y", "z", "a", "c"].into_iter().enumerate() {
                q[column(axis)] = x[1 + i];
            }
            let p = actual.w_from_t(&q).translation;
            let golden = Vec3([x[9], x[10], x[11]]);
            assert!((p - golden).norm() < 1e-12, "{:e} m off at {} deg", (p - golden).norm(), x[0]);
        }
    }
}

/// Every test that turns, by its name.
fn every_test(machine: &Machine) -> Vec<(String, kincal::Result<Turning>)> {
    let mut all = Vec::new();
    let rotary = |command: usize, pointing, turns| Figure::Rotary { command, pointing, turns };
    for family in [Family::Head, Family::Table, Family::Mixed] {
        for number in [1, 2, 4] {
            let test = Standard { family, number };
            let run = test.axis(machine).and_then(|axis| match axis {
                None => turning(machine, Figure::cone(), balls(0.1), once(0.0, TAU)),
                Some(c) => {
                    let (from, to) = usual_range(machine, c);
                    turning(machine, rotary(c, Pointing::Radial, true), balls(0.1), once(from, to))
                }
            });
            all.push((test.to_string(), run));
        }
    }
    for c in 0..machine.commands().len() {
        if machine.command_joint(c).kind == JointKind::Revolute {
            let (from, to) = usual_range(machine, c);
            for (pointing, turns) in
                [(Pointing::Tangential, true), (Pointing::Axial, true), (Pointing::Radial, false)]
            {
                let figure = rotary(c, pointing, turns);
                let name = format!("{} {pointing:?} {turns}", machine.commands()[c]);
                all.push((name, turning(machine, figure, balls(0.1), once(from, to))));
            }
        }
    }
    // An arm's circle lies where some pose of it is.
    let linear = (0..machine.commands().len())
        .filter(|c| machine.command_joint(*c).kind == JointKind::Prismatic)
        .count();
    let pose = Chain::nominal(machine).w_from_t(&kincal::simulate::random_commands(machine, 1, 7)[0]);
    let (centre, tool_axis_w) = if linear < 2 {
        (pose.translation, pose.rotation.column(2))
    } else {
        (ORIGIN, Vec3([0.0, 0.0, -1.0]))
    };
    for normal in [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]] {
        let figure = Figure::Circle { plane_w: plane_across(Vec3(normal)), tool_axis_w };
        let balls = Balls { workpiece_point_w: centre, ..balls(0.1) };
        all.push((format!("circle {normal:?}"), turning(machine, figure, balls, once(0.0, TAU))));
    }
    all
}

#[test]
fn every_test_keeps_the_distance_of_the_balls_on_every_machine_that_runs_it_and_others_are_refused_with_the_reason()
 {
    let mut lines = Vec::new();
    for (stem, machine) in common::machines() {
        let chain = Chain::nominal(&machine);
        let (mut runs, mut refusals) = (Vec::new(), Vec::<(String, Vec<String>)>::new());
        for (name, run) in every_test(&machine) {
            let run = match run {
                Ok(run) => run,
                Err(error) => {
                    assert!(!error.mend().is_empty(), "{error}");
                    let reason = error.to_string().trim_start_matches(&name).trim().to_string();
                    match refusals.iter_mut().find(|(known, _)| *known == reason) {
                        Some((_, names)) => names.push(name),
                        None => refusals.push((reason, vec![name])),
                    }
                    continue;
                }
            };
            let centre = run.balls().workpiece_point_w;
            for sample in &samples(&run) {
                let distance = (chain.w_from_t(&sample.q).translation - centre).norm();
                assert!((distance - 0.1).abs() < 1e-10, "{stem} {name} {}: {distance}", sample.at);
            }
            runs.push(name);
        }
        lines.push(format!("{stem}\n  runs: {}", runs.join(", ")));
        lines.extend(
            refusals.iter().map(|(reason, names)| format!("  refuses {}: {reason}", names.join(", "))),
        );
    }
    insta::assert_snapshot!(lines.join("\n"));
}

#[test]
fn an_arm_runs_a_circle_with_all_its_joints() {
    let machine = common::machine("six_r_arm");
    let chain = Chain::nominal(&machine);
    let (centre, axis) = (Vec3([0.45, 0.1, 0.3]), Vec3([0.0, 0.0, -1.0]));
    let figure = Figure::Circle { plane_w: plane_across(Vec3([0.0, 0.6, 0.8])), tool_axis_w: axis };
    let balls = Balls { workpiece_point_w: centre, tool_point_t: Vec3([0.0, 0.0, 0.05]), length: 0.1 };
    for sample in samples(&turning(&machine, figure, balls, once(0.0, TAU)).unwrap_or_else(|e| panic!("{e}")))
    {
        let w_from_t = chain.w_from_t(&sample.q);
        let bar = w_from_t.transform(Vec3([0.0, 0.0, 0.05])) - centre;
        assert!((bar.norm() - 0.1).abs() < 1e-9 && bar.dot(Vec3([0.0, 0.6, 0.8])).abs() < 1e-9, "{bar:?}");
        assert!((w_from_t.rotation.column(2) - axis).norm() < 1e-9);
    }
}

#[test]
fn on_a_cone_the_bar_keeps_its_angle_in_the_workpiece_and_without_the_function_its_direction_in_the_base() {
    for stem in ["ac_table_tilting", "bc_table_tilting", "bc_nutating_table", "bc_head_table", "ac_head_head"]
    {
        let machine = common::machine(stem);
        let chain = Chain::nominal(&machine);
        let (sin, cos) = 30f64.to_radians().sin_cos();
        let (e, n) = (Vec3([0.0, -sin, cos]), Vec3([0.0, cos, sin]));
        let half = 0.5f64.sqrt();
        for tool_centre_point in [true, false] {
            let Figure::Cone { half_apex, inclination, lead, reversed, .. } = Figure::cone() else {
                unreachable!()
            };
            let figure = Figure::Cone { half_apex, inclination, lead, reversed, tool_centre_point };
            let run = turning(&machine, figure, balls(0.1), once(0.0, TAU))
                .unwrap_or_else(|e| panic!("{stem}: {e}"));
            for sample in samples(&run) {
                let At::Turn(u) = sample.at else { panic!("a turn") };
                let sweep = chain.sweep(&sample.q);
                let m = n.times(u.cos()) + Vec3([u.sin(), 0.0, 0.0]);
                let (bar, tool) = ((e + m).times(0.1 * half), (e - m).times(half));
                let w_from_t = sweep.w_from_t();
                assert!((w_from_t.rotation.column(2) - tool).norm() < 1e-9, "{stem} {u}");
                // In the base the bar is what it is with all axes at zero.
                let b_from_w = sweep.b_from_w();
                let home = chain.sweep(&vec![0.0; sample.q.len()]).b_from_w();
                let off = match tool_centre_point {
                    true => w_from_t.translation - bar,
                    false => b_from_w.rotation * w_from_t.translation - home.rotation * bar,
                };
                assert!(off.norm() < 1e-9, "{stem} {u}: {off:?}");
            }
        }
    }
}

#[test]
fn rotary_axes_that_move_as_told_keep_the_distance_too() {
    let machine = common::machine("ac_table_tilting_paper");
    let chain = Chain::nominal(&machine);
    let wave = |command, offset: f64, turns, amplitude: f64, cycles| Wave {
        command,
        offset: offset.to_radians(),
        turns,
        amplitude: amplitude.to_radians(),
        cycles,
        phase: 0.0,
    };
    // A = 45 + 30 cos 2 phi, C = phi: a path that the paper did not train on.
    let waves = vec![wave(0, 45.0, 0.0, 30.0, 2.0), wave(1, 0.0, 1.0, 0.0, 0.0)];
    let (half_apex, inclination) = (PI / 4.0, PI / 6.0);
    let figure = Figure::Waves { waves, half_apex, inclination, tool_centre_point: false };
    for sample in
        samples(&turning(&machine, figure, balls(0.1), once(0.0, TAU)).unwrap_or_else(|e| panic!("{e}")))
    {
        let At::Turn(u) = sample.at else { panic!("a turn") };
        assert!(
            (sample.q[0].to_degrees() - (45.0 + 30.0 * (2.0 * u).cos())).abs() < 1e-9 && sample.q[1] == u
        );
        assert!((chain.w_from_t(&sample.q).translation.norm() - 0.1).abs() < 1e-12);
    }
}

#[test]
fn a_test_of_one_rotary_axis_turns_that_axis_alone_and_partial_turns_both_ways() {
    let machine = common::machine("bc_table_tilting");
    let tilts =
        Standard { family: Family::Table, number: 1 }.axis(&machine).expect("a table").expect("an axis");
    assert_eq!(machine.commands()[tilts], "b");
    let legs = turns(-PI / 6.0, PI / 3.0, &[Sense::Positive, Sense::Negative], 0.01);
    let figure = Figure::Rotary { command: tilts, pointing: Pointing::Radial, turns: true };
    let all = samples(&turning(&machine, figure, balls(0.1), legs).expect("it runs"));
    let c = machine.commands().iter().position(|c| c == "c").expect("the other");
    assert!(all.iter().all(|s| s.q[c] == 0.0));
    let ends = [all[0].q[tilts], all[all.len() / 2].q[tilts], all[all.len() - 1].q[tilts]];
    for (got, expected) in ends.into_iter().zip([-PI / 6.0, PI / 3.0, -PI / 6.0]) {
        assert!((got - expected).abs() < 1e-12);
    }
}

#[test]
fn a_circle_is_run_with_its_feed_and_within_its_acceleration() {
    let machine = common::machine("xyz_mill");
    let plane = kincal::simulate::plane_of_axes(&machine, ["x", "y"], &rest(&machine)).expect("two axes");
    let figure = Figure::Circle { plane_w: plane, tool_axis_w: Vec3([0.0, 0.0, -1.0]) };
    let pace =
        |feed: f64| Pace::Feed { speed: feed / 0.15, acceleration: 0.2 / 0.15, jerk: Some(2.0 / 0.15) };
    let legs = Turns {
        from: 0.0,
        to: TAU,
        senses: vec![Sense::Positive, Sense::Negative],
        parts: 1,
        repeat: 1,
        overshoot: 0.5,
        dwell: 0.2,
        paces: vec![pace(0.02), pace(0.05)],
    }
    .legs();
    let all = samples(&turning(&machine, figure, balls(0.15), legs).expect("it runs"));
    let chain = Chain::nominal(&machine);
    let p: Vec<Vec3<f64>> = all.iter().map(|s| chain.w_from_t(&s.q).translation).collect();
    let v: Vec<f64> = p.windows(2).map(|w| (w[1] - w[0]).norm() * 100.0).collect();
    let fastest = v.iter().copied().fold(0.0, f64::max);
    assert!((fastest - 0.05).abs() < 1e-4, "{fastest}");
    let a = v.windows(2).map(|w| (w[1] - w[0]).abs() * 100.0).fold(0.0, f64::max);
    assert!(a < 0.2 * 1.01, "{a}");
    // Both feeds in both senses, what lies beyond the turn not recorded.
    assert!(v.iter().filter(|v| (*v - 0.02).abs() < 1e-4).count() > 2 * 4000);
    let beyond = |s: &&Sample| matches!(s.at, At::Turn(u) if !(-1e-9..=TAU + 1e-9).contains(&u));
    assert!(all.iter().filter(beyond).count() > 100 && all.iter().filter(beyond).all(|s| !s.recorded));
    assert!(p.iter().all(|p| p.0[2].abs() < 1e-12));
}

fn distance_run(machine: &Machine, instrument: Instrument, count: u64) -> Run {
    let course = Box::new(RandomPoses { machine: machine.clone(), count, seed: 3, rate: 10.0 });
    Run { course, instrument, claims: Claims::default(), directions: true }
}

#[test]
fn every_measurement_is_read_back_as_the_chain_has_it() {
    let machine = common::machine("six_r_arm");
    let faults = "Faults(units: (length: um, angle: urad), deviations: [(frame: \"q3\", v: (100, 0, 50), w: (0, 300, 0))],
        displacements: [(joint: \"q2\", offset: 500)])";
    let plant = plant(&machine, faults);
    let chain = Chain::new(&machine, plant.constant());
    let q2 = machine.joints().find(|(_, j)| j.name == "q2").expect("a joint").0;
    let along = Vec3([0.6, 0.0, 0.8]);
    let point = Vec3([0.01, -0.02, 0.03]);
    for sensor in [
        Sensor::Distance { absolute: true },
        Sensor::Distance { absolute: false },
        Sensor::Position,
        Sensor::Pose,
        Sensor::Displacement { direction_w: along },
        Sensor::Joint { dyad: q2 },
    ] {
        let mut instrument = Instrument::new(sensor.clone(), 0.0, 0.0);
        instrument.state.tool_point_t = point;
        instrument.state.workpiece_point_w = Vec3([0.1, 0.2, 0.0]);
        instrument.state.length = 0.5;
        let runs = [distance_run(&machine, instrument, 50)];
        let mut style = Style::si();
        style.commands = common::machine("ac_table_tilting").units();
        let text = recordings(&plant, &runs, &style, 1).expect("it runs").remove(0);
        let recording =
            Recording::from_bytes("r.csv", text.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"));
        let mut samples = 0;
        for chunk in recording.chunks().expect("rows") {
            let chunk = chunk.expect("rows");
            for k in 0..chunk.len {
                let q = &chunk.commands[k * 6..(k + 1) * 6];
                let w_from_t = chain.w_from_t(q);
                let p = w_from_t.transform(point);
                let far = (p - Vec3([0.1, 0.2, 0.0])).norm();
                let expected = match &sensor {
                    Sensor::Distance { absolute: true } => vec![far],
                    Sensor::Distance { absolute: false } => vec![far - 0.5],
                    Sensor::Position => p.0.to_vec(),
                    Sensor::Pose => {
                        // The header's point is that of the position; the rotation is that of the frame.
                        p.0.into_iter().chain(w_from_t.rotation_vector().0).collect()
                    }
                    Sensor::Displacement { .. } => vec![along.dot(p)],
                    Sensor::Joint { .. } => vec![q[1] + 500e-6],
                    other => panic!("{other:?}"),
                };
                let got = &chunk.values[k * expected.len()..(k + 1) * expected.len()];
                for (a, b) in got.iter().zip(&expected) {
                    assert!((a - b).abs() < 2e-9, "{sensor:?}: {got:?} for {expected:?}");
                }
                samples += 1;
            }
        }
        assert_eq!(samples, 50);
    }
}

#[test]
fn equal_seeds_give_equal_bytes_and_recordings_of_a_call_share_a_clock() {
    let machine = common::machine("ac_table_tilting");
    let plant = paper_plant(&machine, 4);
    let run = |seed: u64| {
        let runs: Vec<Run> = (0..2)
            .map(|_| Run {
                course: Box::new(paper_path(&machine, 0.1, 0.05).expect("a path")),
                instrument: Instrument::new(Sensor::Distance { absolute: true }, 1e-6, 0.0),
                claims: Claims::default(),
                directions: false,
            })
            .collect();
        recordings(&plant, &runs, &Style::si(), seed).expect("it runs")
    };
    let texts = run(1);
    assert_eq!(texts, run(1));
    assert_ne!(texts, run(2));
    let times = |text: &str| -> Vec<f64> {
        let rows = text.lines().filter(|l| l.starts_with(|c: char| c.is_ascii_digit()));
        rows.map(|l| l.split(',').next().and_then(|t| t.parse().ok()).expect("a time")).collect()
    };
    let (a, b) = (times(&texts[0]), times(&texts[1]));
    assert!(a.windows(2).all(|w| w[0] < w[1]) && b[0] >= a[a.len() - 1] + 60.0);
}

#[test]
fn the_machine_of_the_experiments_errs_by_what_is_said_of_it() {
    let machine = common::machine("ac_table_tilting_paper");
    let course = paper_path(&machine, 0.1, 0.1f64.to_radians()).expect("a path");
    let all = samples(&course);
    let mut largest = Vec::new();
    for seed in 0..20 {
        let plant = paper_plant(&machine, seed);
        let mut state = plant.start(plant.first_directions(all.iter().cloned().map(Ok)).expect("samples"));
        let nominal = Chain::nominal(&machine);
        let mut variation: f64 = 0.0;
        for sample in &all {
            plant.advance(&mut state, sample);
            let far = |chain: &Chain<f64>| chain.w_from_t(&sample.q).translation.norm();
            variation = variation.max((far(state.chain()) - far(&nominal)).abs());
        }
        largest.push(variation * 1e6);
    }
    largest.sort_by(f64::total_cmp);
    // Deviations of 50 um in eight frames, five of which move the bar: some 100 um.
    assert!((50.0..300.0).contains(&largest[10]), "{largest:?}");
}

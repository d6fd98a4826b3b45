//! Simulation: the paper's path, the laws of play, noise and tests, and what the command line says.

mod common;

use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};

use kincal::lie::{Pose, Twist, Vec3};
use kincal::machine::JointKind;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{
    At, Balls, Claims, Course, Family, Faults, Figure, Instrument, Leg, Pace, Plant, Pointing, RandomPoses, Rounding, Run,
    Sample, Scatter, Sense, Standard, Style, Turning, Turns, noise_of, paper_path, plane_across, recordings, rest, usual_range,
};
use kincal::{CalibratedMachine, Chain, Machine};

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

/// What a joint with play does to `s` along positions of one command, the others at rest.
fn play(plant: &Plant, command: usize, path: &[f64], directions: Option<&[i8]>) -> Vec<f64> {
    let machine = plant.machine();
    let (j, joint) = machine.joints().find(|(_, joint)| joint.name == machine.commands()[command]).expect("a joint");
    let sample = |k: usize| {
        let mut q = rest(machine);
        q[command] = path[k];
        let directions = directions.map(|d| {
            let mut all = vec![0; q.len()];
            all[command] = d[k];
            all
        });
        Sample { time: k as f64, q, directions, recorded: true, at: At::Pose(k + 1) }
    };
    let all: Vec<Sample> = (0..path.len()).map(sample).collect();
    let first = plant.first_directions(all.iter().cloned().map(Ok)).expect("samples");
    let mut state = plant.start(first);
    let xi = joint.twist();
    let mut error = |sample: &Sample| {
        plant.advance(&mut state, sample);
        let dh = state.deviations()[j] - plant.constant()[j];
        xi.v.dot(dh.v) + xi.w.dot(dh.w)
    };
    all.iter().map(&mut error).collect()
}

#[test]
fn the_twelve_printed_rows_come_out_within_five_hundredths_of_a_micrometre_and_exactly_in_a_and_c() {
    let machine = common::machine("ac_table_tilting_paper");
    let column = |name: &str| machine.commands().iter().position(|c| c == name).expect("an axis");
    for (table, length) in [("table7", 0.1), ("table9", 0.15)] {
        let Some(path) = common::shared(&format!("paper/{table}.csv")) else { return };
        let path_of_paper = paper_path(&machine, length, 0.1f64.to_radians()).expect("the paper ran it");
        let all = samples(&path_of_paper);
        assert_eq!(all.len(), 7204);
        let mut rows = csv::Reader::from_path(path).expect("a table");
        for (row, sample) in rows.deserialize::<[f64; 5]>().zip(&all) {
            let row = row.expect("five numbers");
            for (printed, axis) in row.iter().zip(["x", "y", "z", "a", "c"]) {
                let q = sample.q[column(axis)];
                let linear = axis < "d" && axis > "c" || axis >= "x";
                let (value, allowed) = if linear { (q * 1e3, 5.05e-5) } else { (q.to_degrees(), 1e-9) };
                assert!((value - printed).abs() < allowed, "{table} {axis}: {value} for {printed}");
            }
        }
    }
}

#[test]
fn increments_of_chain_factors_move_the_tool_as_the_golden_file_has_it() {
    let (Some(table), Some(golden)) = (common::shared("paper/table6.csv"), common::shared("paper/golden_fk.csv")) else { return };
    let machine = common::machine("ac_table_tilting_paper");
    let text = std::fs::read_to_string(table).expect("a table");
    let entries: Vec<String> = text
        .lines()
        .skip(1)
        .map(|line| {
            let f: Vec<&str> = line.split(',').collect();
            format!("(frame: \"{}\", v: ({}, {}, {}), w: ({}, {}, {}))", f[0], f[1], f[2], f[3], f[4], f[5], f[6])
        })
        .collect();
    let plant = plant(&machine, &format!("Faults(units: (length: um, angle: urad), factors: [{}])", entries.join(",\n")));
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

//! A joint that stands still all through a recording, or before it first moves: nothing but the readings says from which side it came there.

use crate::common;
use crate::common::random::normals;
use kincal::diagnose::{DiagnoseOptions, diagnose};
use kincal::effects::{Identified, Library, RecordingFacts};
use kincal::identify::CalibrateOptions;
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::{CalibratedMachine, Machine};

/// Samples of a recording, ten milliseconds apart.
const COUNT: usize = 1500;

/// Positions of x, y and z, mm: to and fro on all axes, or with x at rest.
fn path(moves: bool) -> Vec<[f64; 3]> {
    let at = |k: usize| {
        let turn = k as f64 / COUNT as f64 * std::f64::consts::TAU;
        // Of one wave alone the acceleration is its position, and a drive that gives way stands in for what turns with it.
        let x = if moves { 100.0 * (2.0 * turn).sin() + 20.0 * (7.0 * turn).sin() } else { 40.0 };
        [x, 90.0 * (3.0 * turn).cos(), 70.0 * (5.0 * turn + 0.4).sin()]
    };
    (0..COUNT).map(at).collect()
}

/// A recording of the mill; `side`: from which x came, in a column of its own. Without points they are 0.
fn recording(name: &str, from: f64, moves: bool, side: Option<i8>, points: Option<&[[f64; 3]]>) -> Recording {
    let mut text = String::from("# machine: xyz_mill\n# measurement: position\n");
    text += "t[s],x[mm],y[mm],z[mm],px[m],py[m],pz[m]";
    text += if side.is_some() { ",x_direction[1]\n" } else { "\n" };
    for (k, [x, y, z]) in path(moves).into_iter().enumerate() {
        let [px, py, pz] = points.map_or([0.0; 3], |points| points[k]);
        text += &format!("{},{x},{y},{z},{px},{py},{pz}", from + 0.01 * k as f64);
        text += &side.map_or("\n".into(), |side| format!(",{side}\n"));
    }
    Recording::from_bytes(name, text.into_bytes(), &common::machine("xyz_mill"))
        .unwrap_or_else(|e| panic!("{e}"))
}

/// What an instrument with 1 um of noise reads there.
fn read(truth: &CalibratedMachine, at: &Recording, seed: u64) -> Vec<[f64; 3]> {
    let mut text = Vec::new();
    predict(truth, at, Some(&mut text)).unwrap_or_else(|e| panic!("{e}"));
    let text = String::from_utf8(text).expect("text");
    let mut rows = text.lines().filter(|line| !line.starts_with('#'));
    let head: Vec<&str> = rows.next().expect("a head").split(',').collect();
    let at = ["px_model[m]", "py_model[m]", "pz_model[m]"]
        .map(|name| head.iter().position(|cell| *cell == name).expect("a column"));
    let mut noise = normals(seed);
    let noisy = |row: &str| {
        let cells: Vec<&str> = row.split(',').collect();
        at.map(|i| cells[i].parse::<f64>().expect("a number") + 1e-6 * noise())
    };
    rows.map(noisy).collect()
}

/// A mill whose x has 20 um of play.
fn with_play(machine: &Machine, blank: &[Recording]) -> CalibratedMachine {
    let library = Library::standard();
    let facts = RecordingFacts::of(machine, blank).unwrap_or_else(|e| panic!("{e}"));
    let all = library.candidates(machine, &facts).all;
    let is_play = |c: &&kincal::effects::Candidate| c.effect == "backlash" && c.place.name(machine) == "x";
    let candidate = all.iter().find(is_play).expect("a candidate");
    let play = Identified {
        family: &library.families()[candidate.family],
        candidate,
        coefficients: vec![20e-6],
        parameters: Vec::new(),
        covariance: None,
    };
    CalibratedMachine::nominal(machine.clone())
        .with_effects(vec![play.stored(machine, &[])], vec![1e-9; 3])
        .unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn the_side_from_which_a_joint_came_that_stands_still_is_read_off_and_goes_into_the_model() {
    let machine = common::machine("xyz_mill");
    let library = Library::standard();
    let blank =
        [recording("moves.csv", 0.0, true, None, None), recording("rests.csv", 20.0, false, None, None)];
    // What follows its direction of travel without a name has its side too.
    let lost = ["backlash", "hysteresis", "direction_dependent_pose"];
    let nameless = lost
        .iter()
        .fold(library.clone(), |library, family| library.without(family).unwrap_or_else(|e| panic!("{e}")));
    let truth = with_play(&machine, &blank);
    for (side, library) in [(1, &library), (-1, &library), (-1, &nameless)] {
        let moved = read(&truth, &blank[0], 1);
        let rested = read(&truth, &recording("rests.csv", 20.0, false, Some(side), None), 2);
        let known = [
            recording("moves.csv", 0.0, true, None, Some(&moved)),
            recording("rests.csv", 20.0, false, None, Some(&rested)),
        ];
        let mut said = diagnose(&machine, &known, library, &DiagnoseOptions::default(), &|_| {})
            .unwrap_or_else(|e| panic!("{e}"));
        let names: Vec<(&str, &str)> =
            said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect();
        let parts: Vec<(&str, bool)> = said
            .unexplained
            .iter()
            .flat_map(|u| &u.parts)
            .map(|part| (part.at.as_str(), part.modelled))
            .collect();
        match library.family("backlash") {
            Some(_) => assert_eq!((&names[..], &parts[..]), (&[("backlash", "x")][..], &[][..])),
            None => assert_eq!((&names[..], &parts[..]), (&[][..], &[("x", true)][..])),
        }
        let still: Vec<(&str, &str, i8)> =
            said.stand_still.iter().map(|s| (s.recording.as_str(), s.at.as_str(), s.direction)).collect();
        assert_eq!(still, [("rests.csv", "x", side)]);

        // But for a sample or two in the dead band at each reversal the model is as good as the noise; what it foretells of that recording needs to be told the side.
        let model = said
            .model(&machine, &known, CalibrateOptions::default(), &|_| {})
            .unwrap_or_else(|e| panic!("{e}"));
        let noise = 3f64.sqrt() * 1e-6;
        let last = said.rms.m.expect("lengths").r#final;
        assert!((0.95 * noise..1.15 * noise).contains(&last), "{last}");
        let told = recording("rests.csv", 20.0, false, Some(side), Some(&rested));
        let rms = |of: &Recording| {
            predict(&model, of, None).unwrap_or_else(|e| panic!("{e}")).rms.m.expect("lengths")
        };
        assert!(
            rms(&told) < 1.1 * noise && rms(&known[1]) > 5.0 * noise,
            "{} {}",
            rms(&told),
            rms(&known[1])
        );
    }
}

/// Positions of x, y and z, mm, and the direction in which x travels: it rests at first where it has come rising, and moves down from there.
fn rests_first() -> Vec<([f64; 3], i8)> {
    let at = |k: usize| {
        let [_, y, z] = path(false)[k];
        let turn = k.saturating_sub(COUNT / 5) as f64 / COUNT as f64 * std::f64::consts::TAU;
        [40.0 - 60.0 * (1.0 - (2.0 * turn).cos()) - 10.0 * (1.0 - (7.0 * turn).cos()), y, z]
    };
    let all: Vec<[f64; 3]> = (0..COUNT).map(at).collect();
    let direction = |k: usize| if k == 0 || all[k][0] >= all[k - 1][0] { 1 } else { -1 };
    (0..COUNT).map(|k| (all[k], direction(k))).collect()
}

#[test]
fn a_joint_that_rests_first_may_have_come_from_the_other_side_and_the_model_knows() {
    let machine = common::machine("xyz_mill");
    let written = |points: Option<&[[f64; 3]]>| {
        let mut text = String::from("# measurement: position\nt[s],x[mm],y[mm],z[mm],px[m],py[m],pz[m]");
        text += if points.is_none() { ",x_direction[1]\n" } else { "\n" };
        for (k, ([x, y, z], side)) in rests_first().into_iter().enumerate() {
            let [px, py, pz] = points.map_or([0.0; 3], |points| points[k]);
            text += &format!("{},{x},{y},{z},{px},{py},{pz}", 0.01 * k as f64);
            text += &if points.is_none() { format!(",{side}\n") } else { "\n".into() };
        }
        Recording::from_bytes("rests.csv", text.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"))
    };
    let blank = written(None);
    let points = read(&with_play(&machine, std::slice::from_ref(&blank)), &blank, 3);
    let known = [written(Some(&points))];
    let mut said = diagnose(&machine, &known, &Library::standard(), &DiagnoseOptions::default(), &|_| {})
        .unwrap_or_else(|e| panic!("{e}"));
    let names: Vec<(&str, &str)> = said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect();
    assert_eq!(names, [("backlash", "x")]);
    // It moves later on.
    assert!(said.stand_still.is_empty(), "{:?}", said.stand_still);
    said.model(&machine, &known, CalibrateOptions::default(), &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    let (noise, last) = (3f64.sqrt() * 1e-6, said.rms.m.expect("lengths").r#final);
    assert!((0.95 * noise..1.15 * noise).contains(&last), "{last}");
}

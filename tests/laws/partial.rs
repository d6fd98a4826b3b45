//! Partial normal equations: what is merged from parts is what one identification of all recordings finds, to the last bit; parts that do
//! not belong together are refused.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::common;
use kincal::identify::{CalibrateOptions, Loss, Merged, PartialEquations, Round, calibrate, merge};
use kincal::lie::Vec3;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Machine};

/// What is read of a file that holds this text.
fn in_file<T>(
    text: &str,
    read: impl Fn(&std::path::Path) -> Result<T, kincal::Error>,
) -> Result<T, kincal::Error> {
    static NUMBER: AtomicUsize = AtomicUsize::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("kincal-partial-{}-{number}", std::process::id()));
    std::fs::write(&path, text).expect("a temporary file");
    let found = read(&path);
    std::fs::remove_file(&path).expect("just written");
    found
}

fn through_file<T>(text: &str, read: impl Fn(&std::path::Path) -> Result<T, kincal::Error>) -> T {
    in_file(text, read).unwrap_or_else(|e| panic!("{e}"))
}

/// A recording of a machine whose deviations are so many tolerances.
fn recorded(
    machine: &Machine,
    name: &str,
    size: f64,
    sensor: Sensor,
    header: &[&str],
    seed: u64,
) -> Recording {
    let deviations = random_deviations(machine, size, 3);
    let truth = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations);
    let mut instrument = Instrument::new(sensor, 1e-6, 0.0);
    instrument.state.tool_point_t = Vec3([0.02, -0.03, 0.05]);
    instrument.state.workpiece_point_w = Vec3([0.1, 0.05, -0.02]);
    let mut lines: Vec<String> = header.iter().map(|line| (*line).to_string()).collect();
    lines.push("workpiece_point[m]: 0.1,0.05,-0.02".into());
    let text = recording(&truth, &instrument, &random_commands(machine, 60, seed), &lines, seed + 1);
    // Every tenth reading is an outlier, which the loss holds down.
    let mut row = 0;
    let text: Vec<String> = text
        .lines()
        .map(|line| {
            let Some((rest, last)) = line.rsplit_once(',').filter(|_| !line.starts_with(['#', 't'])) else {
                return line.into();
            };
            row += 1;
            let last: f64 = last.parse().expect("a number");
            format!("{rest},{}", if row % 10 == 0 { last + 2e-5 } else { last })
        })
        .collect();
    Recording::from_bytes(name, text.join("\n").into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

fn of_several_kinds(machine: &Machine, size: f64) -> Vec<Recording> {
    let known = "tool_point[m]: 0.02,-0.03,0.05";
    let far = ["setup: far", "workpiece_frame: unknown", "tool_point: unknown ball", "sigma[um]: 1"];
    let absolute = Sensor::Distance { absolute: true };
    vec![
        recorded(machine, "near.csv", size, Sensor::Position, &["setup: near", known], 10),
        recorded(machine, "far_1.csv", size, Sensor::Position, &far, 20),
        recorded(machine, "far_2.csv", size, Sensor::Position, &far, 30),
        recorded(machine, "wire.csv", size, absolute, &["setup: near", known], 40),
    ]
}

/// Rounds over parts, each through its file, until the machine is found.
fn in_rounds(
    machine: &Machine,
    parts: &[&[Recording]],
    options: CalibrateOptions,
) -> (CalibratedMachine, kincal::identify::Fit, usize) {
    let read = |part: PartialEquations| -> PartialEquations {
        through_file(&part.text(), |path| PartialEquations::open(path))
    };
    let mut round: Option<Round> = None;
    for number in 0..100 {
        let sums: Vec<PartialEquations> = parts
            .iter()
            .map(|own| {
                read(PartialEquations::of(machine, own, round.as_ref()).unwrap_or_else(|e| panic!("{e}")))
            })
            .collect();
        assert!(sums.iter().all(|part| part.rounds() == number));
        match merge(&sums, options).unwrap_or_else(|e| panic!("{e}")) {
            Merged::Found(found) => return (found.0, found.1, number),
            Merged::Another(next) => {
                round = Some(through_file(&next.text(), |path| Round::open(path)));
            }
        }
    }
    panic!("no end")
}

/// Parts, cut at these recordings, against one identification.
fn law(size: f64, options: CalibrateOptions, cuts: [usize; 2]) {
    let machine = common::machine("ac_table_tilting");
    let all = of_several_kinds(&machine, size);
    let (whole, fit) = calibrate(&machine, &all, options).unwrap_or_else(|e| panic!("{e}"));
    let parts = [&all[..cuts[0]], &all[cuts[0]..cuts[1]], &all[cuts[1]..]];
    let parts: Vec<&[Recording]> = parts.into_iter().filter(|part| !part.is_empty()).collect();
    let (merged, of_parts, rounds) = in_rounds(&machine, &parts, options);
    assert!(rounds >= fit.steps, "{rounds} rounds");
    assert_eq!(merged.to_ron(), whole.to_ron(), "deviations of {size} tolerances");
    assert_eq!(of_parts.steps, fit.steps);
    for (a, b) in of_parts.parameters.iter().zip(&fit.parameters) {
        assert!((a.value - b.value).abs() <= 1e-12 * b.value.abs(), "{a:?} {b:?}");
        let alike = (a.std_error - b.std_error).abs() <= 1e-12 * b.std_error;
        assert!(alike || a.std_error == b.std_error, "{a:?} {b:?}");
    }
}

#[test]
fn parts_give_what_one_identification_gives() {
    let default = CalibrateOptions::default();
    law(1.0, default, [1, 2]);
    law(1.0, default.with_loss(Loss::Squares).with_prior(false), [0, 4]);
}

#[test]
#[ignore = "long: 70 rounds"]
fn parts_of_a_machine_far_off_give_what_one_identification_gives() {
    // Deviations of ten tolerances are found from afar, by fits without the prior.
    law(10.0, CalibrateOptions::default(), [2, 2]);
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let (machine, other) = (common::machine("ac_table_tilting"), common::machine("bc_table_tilting"));
    let all = of_several_kinds(&machine, 1.0);
    let options = CalibrateOptions::default();
    let part =
        |own: &[Recording], at: Option<&Round>| PartialEquations::of(&machine, own, at).expect("a part");
    let round = match merge(&[part(&all, None)], options).expect("a round") {
        Merged::Another(round) => *round,
        Merged::Found(_) => panic!("nothing has been summed"),
    };
    assert_eq!(round.number(), 1);
    let (first, second) = (part(&all[..2], Some(&round)), part(&all[2..], Some(&round)));
    let foreign = recorded(&other, "b.csv", 1.0, Sensor::Position, &["setup: near"], 50);
    let foreign = PartialEquations::of(&other, &[foreign], None).expect("a part");
    let refused = |parts: &[PartialEquations]| merge(parts, options).expect_err("refused").to_string();
    assert_eq!(refused(&[]), "no part is given");
    assert!(refused(&[part(&all, None), foreign]).starts_with("part 2 is of another machine"));
    assert!(refused(&[first.clone(), part(&all[2..], None)]).contains("1 round, another through 0 rounds"));
    assert_eq!(refused(std::slice::from_ref(&first)), "the parts hold 2 of 4 recordings");
    assert_eq!(refused(&[first.clone(), first.clone(), second]), "near.csv is in two parts");
    let error = PartialEquations::of(&other, &[], Some(&round)).expect_err("another machine").to_string();
    assert!(error.starts_with("the round is of another machine than \"bc_table_tilting\""), "{error}");
    let changed = recorded(&machine, "near.csv", 1.0, Sensor::Position, &["setup: elsewhere"], 10);
    let error = PartialEquations::of(&machine, &[changed], Some(&round)).expect_err("changed").to_string();
    assert!(error.starts_with("near.csv is none of the recordings of this round"), "{error}");
    for (text, what) in [(round.text(), "a part"), ("Part(".into(), "a part")] {
        let error = in_file(&text, |path| PartialEquations::open(path)).expect_err("no part").to_string();
        assert!(error.contains(&format!("this is not {what}")), "{error}");
    }
    assert!(in_file(&first.text(), |path| Round::open(path)).is_err());
}

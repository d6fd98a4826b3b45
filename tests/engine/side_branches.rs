//! What hangs on a machine beside the chain that is measured: it weighs, its joints are columns, and it is left out where they are not.

use crate::common;
use crate::common::random::Random;
use kincal::CalibratedMachine;
use kincal::Machine;
use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::effects::{Identified, Library, RecordingFacts};
use kincal::feature::{Binding, Expression, Feature, as_seen_in, samples_of};
use kincal::predict::predict;
use kincal::recording::{Recording, RecordingFault};

/// A post that leans about x, with an arm on either side; the right one is measured.
const POST: &str = r#"Machine(
    name: "post", units: (length: mm, angle: deg),
    workpiece: [(frame: "w")],
    tool: [
        (frame: "post", joint: Revolute(axis: "x", travel: (-40, 40))),
        (frame: "turn", at: (0, 0, 600), joint: Revolute(axis: "z", travel: (-90, 90))),
        (frame: "arm", at: (200, 0, 300), joint: Revolute(axis: "y", travel: (-90, 90))),
        (frame: "t", at: (500, 0, 0)),
    ],
    side_branches: [(on: "turn", dyads: [
        (frame: "left.arm", at: (-200, 0, 300), joint: Revolute(axis: "y")),
        (frame: "left.hand", at: (-700, 0, 0)),
    ])],
)"#;

fn post() -> Machine {
    Machine::parse("post.ron", POST).unwrap_or_else(|e| panic!("{e}"))
}

/// Uniform numbers of a fixed seed.
fn numbers(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut random = Random::new(seed);
    move |from, to| random.between(from, to)
}

fn recording(machine: &Machine, columns: &str, rows: &[Vec<f64>]) -> Recording {
    let mut text = format!("# machine: {}\n# measurement: position\n{columns}\n", machine.name());
    for row in rows {
        text += &(row.iter().map(|x| format!("{x}")).collect::<Vec<_>>().join(",") + "\n");
    }
    Recording::from_bytes("rec.csv", text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

/// A feature of the joint at a frame, over all samples.
fn over(machine: &Machine, recording: &Recording, frame: &str, text: &str) -> Vec<f64> {
    let options =
        ron::Options::default().with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
    let expression: Expression = options.from_str(text).unwrap_or_else(|e| panic!("{text}: {e}"));
    let binding = Binding {
        machine,
        own: machine.frame_index(frame),
        partner: None,
        travel: &vec![None; machine.dyads().len()],
        time: None,
        begins: &[],
        parameters: &[],
    };
    let feature = Feature::bind(&expression, &binding).unwrap_or_else(|e| panic!("{text}: {e}"));
    let samples = samples_of(recording, machine, &vec![1e-9; machine.dyads().len()]).expect("samples");
    feature.over(&samples, &[])
}

#[test]
fn an_arm_weighs_alike_on_the_torso_whichever_of_two_is_measured() {
    let (right, left) = (common::machine("dlr_justin_right"), common::machine("dlr_justin_left"));
    let mut number = numbers(7);
    let poses: Vec<Vec<f64>> = (0..20).map(|_| (0..17).map(|_| number(-1.5, 1.5)).collect()).collect();
    let columns = |own: &str, side: &str| {
        let arm = |of: &str| (1..=7).map(|k| format!("{of}q{k}[rad]")).collect::<Vec<_>>().join(",");
        format!("torso1[rad],torso2[rad],torso3[rad],px[mm],py[mm],pz[mm],{},{}", arm(own), arm(side))
    };
    let row = |q: &Vec<f64>, own: usize, side: usize| {
        [&q[..3], &[0.0; 3], &q[3 + 7 * own..10 + 7 * own], &q[3 + 7 * side..10 + 7 * side]].concat()
    };
    let of_right: Vec<Vec<f64>> = poses.iter().map(|q| row(q, 0, 1)).collect();
    let of_left: Vec<Vec<f64>> = poses.iter().map(|q| row(q, 1, 0)).collect();
    let by_right = recording(&right, &columns("", "left."), &of_right);
    let by_left = recording(&left, &columns("", "right."), &of_left);
    for (frame, joints) in [("torso2", 3), ("torso3", 2), ("torso4", 1)] {
        let mut weighing = 0;
        let mut same = |one: &str, other: &str| {
            let (a, b) = (over(&right, &by_right, frame, one), over(&left, &by_left, frame, other));
            let largest = a.iter().fold(0.0f64, |most, x| most.max(x.abs()));
            weighing += usize::from(largest > 0.1);
            for (a, b) in a.iter().zip(&b) {
                assert!((a - b).abs() < 1e-9 * largest.max(1.0), "{frame} {one} {other}: {a} {b}");
            }
        };
        for text in ["Gravity", "Moment(0)", "Moment(1)", "Shear(0)"] {
            same(text, text);
        }
        // The left arm's joints come last behind the right one's chain, and first behind their own.
        for k in 0..7 {
            for n in 0..2 {
                let (own, side) = (joints + k, joints + 7 + k);
                same(&format!("Lever({side}, {n})"), &format!("Lever({own}, {n})"));
            }
        }
        assert!(weighing > 14, "{frame}: hardly anything weighs");
    }
}

#[test]
fn a_joint_bears_only_the_side_branches_that_stand_on_what_it_moves() {
    let machine = post();
    let columns = "post[deg],turn[deg],arm[deg],left.arm[deg],px[mm],py[mm],pz[mm]";
    let rows = |side: f64| vec![vec![20.0, 30.0, 40.0, side, 0.0, 0.0, 0.0]; 2];
    let weight = |frame: &str, side: f64| {
        over(&machine, &recording(&machine, columns, &rows(side)), frame, "Gravity")[0]
    };
    assert!((weight("post", 0.0) - weight("post", 60.0)).abs() > 0.1);
    assert_eq!(weight("arm", 0.0), weight("arm", 60.0));
}

#[test]
fn a_side_branch_is_there_where_every_recording_has_its_columns() {
    let machine = post();
    let with = "post[deg],turn[deg],arm[deg],left.arm[deg],px[mm],py[mm],pz[mm]";
    let without = "post[deg],turn[deg],arm[deg],px[mm],py[mm],pz[mm]";
    let with = recording(&machine, with, &[vec![0.0; 7]]);
    let without = recording(&machine, without, &[vec![0.0; 6]]);
    assert_eq!(as_seen_in(&machine, std::slice::from_ref(&with)), machine);
    assert!(as_seen_in(&machine, &[with, without]).side_branches().is_empty());
}

#[test]
fn a_sample_without_the_number_of_a_side_joint_is_a_drop_out() {
    let machine = post();
    let text = "# measurement: position\npost[deg],turn[deg],arm[deg],left.arm[deg],px[mm],py[mm],pz[mm]\n0,0,0,,0,0,0\n0,0,0,1,0,0,0\n";
    let recording = Recording::from_bytes("rec.csv", text.as_bytes(), &machine).expect("a recording");
    let chunks: Vec<_> = recording.chunks().expect("rows").map(|c| c.expect("a chunk")).collect();
    assert_eq!((chunks[0].len, chunks[0].dropped), (1, 1));
}

#[test]
fn a_side_joint_in_the_unit_of_a_length_is_refused() {
    let text = "# measurement: position\npost[deg],turn[deg],arm[deg],left.arm[mm],px[mm],py[mm],pz[mm]\n";
    let error = Recording::from_bytes("rec.csv", text.as_bytes(), &post()).expect_err("an angle");
    assert!(error.fault::<RecordingFault>().is_some(), "{error}");
    assert!(error.to_string().contains("left.arm"), "{error}");
}

/// 150 poses of the post, whose drive twists under the weight of the left arm alone.
fn twisted(with_left: bool) -> (Machine, Recording) {
    let machine = post();
    let mut number = numbers(11);
    let mut rows: Vec<Vec<f64>> = (0..150)
        .map(|_| {
            let mut row = vec![number(-40.0, 40.0), number(-90.0, 90.0), number(-90.0, 90.0)];
            row.extend([number(-90.0, 90.0), 0.0, 0.0, 0.0]);
            row
        })
        .collect();
    let columns = "post[deg],turn[deg],arm[deg],left.arm[deg],px[mm],py[mm],pz[mm]";
    let known = recording(&machine, columns, &rows);
    let facts = RecordingFacts::of(&machine, std::slice::from_ref(&known)).expect("facts");
    let library = Library::standard();
    let candidates = library.candidates(&machine, &facts);
    let is_it = |c: &&kincal::effects::Candidate| {
        c.effect == "gravity_compliance" && c.place.name(&machine) == "post"
    };
    let candidate = candidates.all.iter().find(is_it).expect("it can give way");
    // Gravity, load, the levers of post, turn and arm, and then those of the left arm: 3 kg 0.4 m out, and 0.1 mrad/Nm.
    let levers = candidate.coefficients.len();
    let mut coefficients = vec![0.0; levers];
    (coefficients[levers - 2], coefficients[levers - 1]) = (1.2e-4, -0.7e-4);
    let family = &library.families()[candidate.family];
    let found = Identified { family, candidate, coefficients, parameters: Vec::new(), covariance: None };
    let truth = CalibratedMachine::nominal(machine.clone())
        .with_effects(vec![found.stored(&machine, &[])], vec![1e-9; machine.commands().len()])
        .unwrap_or_else(|e| panic!("{e}"));
    let mut text = Vec::new();
    predict(&truth, &known, Some(&mut text)).unwrap_or_else(|e| panic!("{e}"));
    let text = String::from_utf8(text).expect("text");
    let lines = text.lines().skip_while(|line| !line.starts_with("post")).skip(1);
    for (row, line) in rows.iter_mut().zip(lines) {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        for c in 0..3 {
            // Model columns follow the recording's own; noise of 5 um.
            row[4 + c] = cells[7 + 2 * c] + number(-0.0087, 0.0087);
        }
        if !with_left {
            row.remove(3);
        }
    }
    let columns = if with_left { columns.to_string() } else { columns.replace("left.arm[deg],", "") };
    let recording = recording(&machine, &columns, &rows);
    (machine, recording)
}

fn diagnosed(with_left: bool) -> Diagnosis {
    let (machine, recording) = twisted(with_left);
    let said = diagnose(&machine, &[recording], &Library::standard(), &DiagnoseOptions::default(), &|_| {});
    said.unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_drive_that_twists_under_the_arm_that_is_not_measured_is_named() {
    let said = diagnosed(true);
    let names: Vec<_> = said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect();
    assert_eq!(names, [("gravity_compliance", "post")]);
    let held_out = said.held_out_rms.m.expect("lengths");
    assert!(held_out.r#final < 0.1 * held_out.geometric, "{held_out:?}");
    assert!(said.unseen_side_branches.is_empty() && said.unexplained.is_none());
}

#[test]
fn where_nothing_says_how_the_other_arm_stood_that_is_told() {
    let said = diagnosed(false);
    assert_eq!(said.unseen_side_branches.len(), 1);
    assert_eq!(said.unseen_side_branches[0].columns, ["left.arm[rad]"]);
    let held_out = said.held_out_rms.m.expect("lengths");
    assert!(held_out.r#final > 0.5 * held_out.geometric, "{held_out:?}");
}

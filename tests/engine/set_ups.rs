//! What belongs to a set-up, and what happens within one: zeros that differ, ground that gives way, a slip that no clock dates.

use crate::common;
use crate::common::random::Random;
use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::effects::{Identified, Library, RecordingFacts};
use kincal::identify::{CalibrateOptions, Loss, fit_setup};
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::{CalibratedMachine, Machine};

/// Poses over half of every joint's travel, and the head of a recording for them.
fn poses(machine: &Machine, count: usize, random: &mut Random) -> Vec<Vec<f64>> {
    let one = |random: &mut Random, c: usize| {
        let (from, to) = machine.travel(c);
        let (from, to) = (from.max(-1.5), to.min(if from > -0.1 { 4.0 } else { 1.5 }));
        0.5 * (from + to) + 0.45 * (to - from) * random.between(-1.0, 1.0)
    };
    (0..count).map(|_| (0..machine.commands().len()).map(|c| one(random, c)).collect()).collect()
}

fn recording(
    machine: &Machine,
    name: &str,
    setup: &str,
    poses: &[Vec<f64>],
    points: &[[f64; 3]],
) -> Recording {
    let unit = |c: usize| match machine.command_joint(c).kind {
        kincal::machine::JointKind::Prismatic => "m",
        kincal::machine::JointKind::Revolute => "rad",
    };
    let mut text = format!(
        "# machine: {}\n# measurement: position\n# setup: {setup}\n# tool_point[mm]: 20,30,150\n",
        machine.name()
    );
    let head: Vec<String> =
        machine.commands().iter().enumerate().map(|(c, joint)| format!("{joint}[{}]", unit(c))).collect();
    text += &format!("{},px[m],py[m],pz[m]\n", head.join(","));
    for (pose, point) in poses.iter().zip(points) {
        let cells: Vec<String> = pose.iter().chain(point).map(f64::to_string).collect();
        text += &(cells.join(",") + "\n");
    }
    Recording::from_bytes(name, text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

/// What an instrument with 20 um of noise reads at these poses of a machine.
fn read(
    truth: &CalibratedMachine,
    name: &str,
    setup: &str,
    poses: &[Vec<f64>],
    random: &mut Random,
) -> Vec<[f64; 3]> {
    let blank = recording(truth.machine(), name, setup, poses, &vec![[0.0; 3]; poses.len()]);
    let mut text = Vec::new();
    predict(truth, &blank, Some(&mut text)).unwrap_or_else(|e| panic!("{e}"));
    let text = String::from_utf8(text).expect("text");
    let mut rows = text.lines().filter(|line| !line.starts_with('#'));
    let head: Vec<&str> = rows.next().expect("a head").split(',').collect();
    let at = ["px_model[m]", "py_model[m]", "pz_model[m]"]
        .map(|name| head.iter().position(|cell| *cell == name).expect("a column"));
    let point = |row: &str| {
        let cells: Vec<&str> = row.split(',').collect();
        at.map(|i| cells[i].parse::<f64>().expect("a number"))
    };
    rows.map(point).map(|p| p.map(|x| x + 20e-6 * random.normal())).collect()
}

fn said(machine: &Machine, recordings: &[Recording]) -> Diagnosis {
    diagnose(machine, recordings, &Library::standard(), &DiagnoseOptions::default(), &|_| {})
        .unwrap_or_else(|e| panic!("{e}"))
}

fn names(said: &Diagnosis) -> Vec<(&str, &str)> {
    said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect()
}

#[test]
fn a_slip_without_a_clock_is_dated_by_the_order_of_samples() {
    let machine = common::machine("six_r_arm");
    let nominal = CalibratedMachine::nominal(machine.clone());
    let mut random = Random::new(7);
    let all: Vec<_> = ["a.csv", "b.csv"]
        .into_iter()
        .enumerate()
        .map(|(i, name)| {
            let poses = poses(&machine, 60, &mut random);
            let mut slipped = poses.clone();
            // The third joint stands 0.3 mrad beyond its command from the tenth sample of the second recording on.
            slipped.iter_mut().skip(if i == 0 { 60 } else { 10 }).for_each(|pose| pose[2] += 3e-4);
            let points = read(&nominal, name, "one", &slipped, &mut random);
            recording(&machine, name, "one", &poses, &points)
        })
        .collect();
    let mut said = said(&machine, &all);
    assert_eq!(names(&said), [("setup_slip", machine.commands()[2].as_str())]);
    assert_eq!(said.findings[0].form.as_deref(), Some("coupling_slip"));
    let size = |name: &str| {
        said.findings[0].coefficients.iter().find(|c| c.name == name).unwrap_or_else(|| panic!("no {name}"))
    };
    let (height, at) = (size("height"), size("at_sample"));
    assert!((height.value - 3e-4).abs() < 4.0 * height.std_error, "{height:?}");
    assert!((69.0..=70.0).contains(&at.value), "{at:?}");

    // The model dates it in the same recordings; of one of them alone as well.
    let model = said
        .model(&machine, &all, CalibrateOptions::default(), &|_| {})
        .unwrap_or_else(|e| panic!("{e}"))
        .to_ron();
    let model = CalibratedMachine::parse("slipped.ron", &model).unwrap_or_else(|e| panic!("{e}"));
    for recording in &all {
        let rms = predict(&model, recording, None).unwrap_or_else(|e| panic!("{e}")).rms.m;
        assert!(rms.is_some_and(|rms| rms < 45e-6), "{}: {rms:?}", recording.name());
    }
}

/// Recordings of one arm in set-ups of their own; `zeros`: of each set-up, by how much each joint stands beyond its command, rad.
fn referenced_anew(machine: &Machine, zeros: &[[f64; 6]], random: &mut Random) -> Vec<Recording> {
    let nominal = CalibratedMachine::nominal(machine.clone());
    let one = |(i, zeros): (usize, &[f64; 6])| {
        let (name, setup) = (format!("{i}.csv"), format!("place {i}"));
        let poses = poses(machine, 60, random);
        let shifted = |pose: &Vec<f64>| pose.iter().zip(zeros).map(|(q, zero)| q + zero).collect();
        let shifted: Vec<Vec<f64>> = poses.iter().map(shifted).collect();
        let points = read(&nominal, &name, &setup, &shifted, random);
        recording(machine, &name, &setup, &poses, &points)
    };
    zeros.iter().enumerate().map(one).collect()
}

#[test]
fn zeros_of_one_axis_that_come_anew_bring_those_of_the_others_into_the_model() {
    let machine = common::machine("six_r_arm");
    let mut random = Random::new(4);
    let zeros = [3e-4, -2e-4, -1e-4, 2.5e-4].map(|large| {
        // The third joint's are a twentieth of the second's: too little for a name, and in half of all draws for the model as well.
        [0.0, large, 0.05 * 3e-4 * random.normal().signum(), 0.0, 0.0, 0.0]
    });
    let all = referenced_anew(&machine, &zeros, &mut random);
    let (known, new) = (&all[..3], &all[3..]);
    let mut said = said(&machine, known);
    let joint = |i: usize| machine.commands()[i].clone();
    assert_eq!(names(&said), [("homing_error", joint(1).as_str())]);
    let shared = said.shared.clone();
    let comes_along =
        |at: String| shared.iter().any(|c| c.effect == "homing_error" && c.at == at && c.of_set_up);
    assert!(comes_along(joint(2)) && !comes_along(joint(1)), "{shared:?}");

    // The file has them, and a new set-up finds all of them again.
    let model =
        said.model(&machine, known, CalibrateOptions::default(), &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(model.effects().len(), 1 + shared.len());
    let found = fit_setup(&model, new, Loss::Squares).unwrap_or_else(|e| panic!("{e}"));
    let rms = predict(&found, &new[0], None).unwrap_or_else(|e| panic!("{e}")).rms.m;
    // 20 um in each of three directions.
    assert!(rms.is_some_and(|rms| rms < 1.1 * 3f64.sqrt() * 20e-6), "{rms:?}");
}

#[test]
fn among_set_ups_without_a_clock_no_frame_stays_slipped_from_one_to_the_next() {
    let machine = common::machine("six_r_arm");
    let slips = |setups: [&str; 2]| {
        let mut random = Random::new(5);
        let one = |(name, setup)| {
            let poses = poses(&machine, 20, &mut random);
            let still = vec![[0.0; 3]; poses.len()];
            recording(&machine, name, setup, &poses, &still)
        };
        let all: Vec<Recording> = ["a.csv", "b.csv"].into_iter().zip(setups).map(one).collect();
        let facts = RecordingFacts::of(&machine, &all).unwrap_or_else(|e| panic!("{e}"));
        let candidates = Library::standard().candidates(&machine, &facts).all;
        let count = |effect: &str| candidates.iter().filter(|c| c.effect == effect).count();
        (count("setup_slip"), count("coupling_slip"))
    };
    // Of every frame, and of six joints in both forms: until the end of its recording, and from then on.
    assert_eq!(slips(["one", "one"]), (machine.dyads().len(), 12));
    assert_eq!(slips(["one", "two"]), (0, 12));
}

#[test]
fn ground_that_gives_way_belongs_to_its_set_up_and_is_found_again_in_a_new_one() {
    let machine = common::machine("hilti_jaibot");
    let library = Library::standard();
    let mut random = Random::new(11);
    let places = ["stone", "wood", "mud"];
    let files = places.map(|place| format!("{place}.csv"));
    let poses = places.map(|_| poses(&machine, 150, &mut random));
    let blank: Vec<Recording> = (0..3)
        .map(|i| recording(&machine, &files[i], places[i], &poses[i], &vec![[0.0; 3]; poses[i].len()]))
        .collect();
    let facts = RecordingFacts::of(&machine, &blank).unwrap_or_else(|e| panic!("{e}"));
    let candidates = library.candidates(&machine, &facts);
    let candidate = candidates.all.iter().find(|c| c.effect == "ground_compliance").expect("a candidate");
    // Tilts by up to 2, 4 and 8 urad for a newton metre.
    let tilt = |direction: &str| match direction.split_once('@') {
        Some((axis, place)) if axis == "wx" || axis == "wy" => {
            let place = places.iter().position(|p| *p == place).expect("a place");
            f64::from(1u8 << place) * 2e-6 * if axis == "wx" { 1.0 } else { -0.6 }
        }
        _ => 0.0,
    };
    let truth = Identified {
        family: &library.families()[candidate.family],
        candidate,
        coefficients: candidate.coefficients.iter().map(|c| tilt(&c.direction)).collect(),
        parameters: Vec::new(),
        covariance: None,
    };
    let truth = CalibratedMachine::nominal(machine.clone())
        .with_effects(vec![truth.stored(&machine, &[])], vec![1e-9; machine.commands().len()])
        .unwrap_or_else(|e| panic!("{e}"));
    let all: Vec<Recording> = (0..3)
        .map(|i| {
            let points = read(&truth, &files[i], places[i], &poses[i], &mut random);
            recording(&machine, &files[i], places[i], &poses[i], &points)
        })
        .collect();

    let (known, new) = (&all[..2], &all[2..]);
    let mut said = said(&machine, known);
    assert_eq!(names(&said), [("ground_compliance", "column")]);
    // What belongs to a set-up is found again in the one that was left out.
    for one in &said.set_ups_left_out {
        let rms = one.rms.m.expect("lengths");
        assert!(rms.r#final < 45e-6 && rms.geometric > 1.5 * rms.r#final, "{one:?}");
    }
    assert_eq!(said.set_ups_left_out.len(), 2);
    let model =
        said.model(&machine, known, CalibrateOptions::default(), &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    let model = CalibratedMachine::parse("ground.ron", &model.to_ron()).unwrap_or_else(|e| panic!("{e}"));
    let found = fit_setup(&model, new, Loss::Squares).unwrap_or_else(|e| panic!("{e}"));
    let again = CalibratedMachine::parse("again.ron", &found.to_ron()).unwrap_or_else(|e| panic!("{e}"));
    for found in [&found, &again] {
        let figures = predict(found, &new[0], None).unwrap_or_else(|e| panic!("{e}"));
        assert!(figures.left_out.is_empty(), "{:?}", figures.left_out);
        assert!(figures.rms.m.is_some_and(|rms| rms < 60e-6), "{:?}", figures.rms.m);
    }
    // The set-ups that were known are as they were.
    let before = predict(&model, &known[0], None).unwrap_or_else(|e| panic!("{e}")).rms.m;
    let after = predict(&found, &known[0], None).unwrap_or_else(|e| panic!("{e}")).rms.m;
    assert_eq!(before, after);
}

/// Bumps of either sign, drawn for every twentieth of the travel: no family has such a curve, and poses in no order show no course.
#[test]
fn what_is_right_holds_in_a_set_up_left_out_and_a_meaningless_cause_does_not() {
    let machine = common::machine("six_r_arm");
    let nominal = CalibratedMachine::nominal(machine.clone());
    let mut random = Random::new(5);
    let all = ["left", "right"].map(|place| {
        let poses = poses(&machine, 90, &mut random);
        let mut real = poses.clone();
        // 24 teeth on the second joint.
        real.iter_mut().for_each(|pose| pose[1] += 3e-4 * (24.0 * pose[1]).sin());
        let points = read(&nominal, place, place, &real, &mut random);
        recording(&machine, &format!("{place}.csv"), place, &poses, &points)
    });
    let said = said(&machine, &all);
    assert_eq!(names(&said), [("cyclic_error", machine.commands()[1].as_str())]);
    let meaningless = said.findings[0].placebo.as_ref().expect("other joints turn as well");
    assert!(meaningless.share < 0.3, "{meaningless:?}");
    let setups: Vec<&str> = said.set_ups_left_out.iter().map(|one| one.setup.as_str()).collect();
    assert_eq!(setups, ["left", "right"]);
    for one in &said.set_ups_left_out {
        let rms = one.rms.m.expect("lengths");
        assert!(rms.r#final < 45e-6 && rms.geometric > 2.0 * rms.r#final, "{one:?}");
        assert!(rms.placebo.is_some_and(|placebo| placebo > 0.8 * rms.geometric), "{one:?}");
    }
}

/// Bumps of random signs along a joint, drawn with each of these seeds.
fn bumps_are_unexplained_at_their_joint(seeds: &[u64]) {
    let machine = common::machine("six_r_arm");
    let nominal = CalibratedMachine::nominal(machine.clone());
    for &seed in seeds {
        let mut random = Random::new(seed);
        let poses = poses(&machine, 300, &mut random);
        let heights: Vec<f64> = (0..21).map(|_| 2e-4 * random.between(-1.0, 1.0).signum()).collect();
        let told = |bumps: f64, random: &mut Random| {
            let mut off = poses.clone();
            for pose in &mut off {
                let at = (pose[2] + 1.5) / 3.0 * 20.0;
                let (k, part) = (at as usize, at.fract());
                pose[2] += bumps * (heights[k] * (1.0 - part) + heights[k + 1] * part);
            }
            let points = read(&nominal, "arm.csv", "one", &off, random);
            said(&machine, &[recording(&machine, "arm.csv", "one", &poses, &points)])
        };
        let with = told(1.0, &mut random);
        assert_eq!(names(&with), [], "seed {seed}");
        let unexplained = with.unexplained.as_ref().unwrap_or_else(|| panic!("seed {seed}"));
        assert_eq!(unexplained.at, "q3", "seed {seed}");
        let part = unexplained.parts.first().unwrap_or_else(|| panic!("seed {seed}"));
        assert!(
            part.at == "q3" && part.depends_on == ["position of q3"] && part.modelled,
            "seed {seed}: {part:?}"
        );
        let without = told(0.0, &mut random);
        assert!(without.findings.is_empty() && without.unexplained.is_none(), "seed {seed}");
    }
}

#[test]
fn any_other_function_of_where_a_joint_stands_is_unexplained_at_that_joint() {
    bumps_are_unexplained_at_their_joint(&[3]);
}

#[test]
#[ignore = "long: four diagnoses of an arm"]
fn so_are_others_drawn_anew() {
    bumps_are_unexplained_at_their_joint(&[4, 5]);
}

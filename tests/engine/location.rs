//! ISO 230-1 location errors: values and signs against the motion of the tool seen from the workpiece, gauge, recovery from
//! recordings, and what each instrument identifies.

use std::fmt::Write;

use crate::common;
use kincal::describe::describe;
use kincal::identify::{COMPONENTS, CalibrateOptions, Fit, calibrate};
use kincal::lie::{Pose, Twist, Vec3};
use kincal::location::{LocationErrors, location_errors};
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, cone, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Chain, Machine};

const ORIGIN: Vec3<f64> = Vec3([0.0; 3]);

/// Machines with at least two linear axes.
fn machine_tools() -> Vec<(String, Machine)> {
    let spans = |m: &Machine| location_errors(m, &none(m), ORIGIN, None).reason.is_none();
    let found: Vec<_> = common::machines().into_iter().filter(|(_, m)| spans(m)).collect();
    assert!(found.len() >= 10, "{} machines", found.len());
    found
}

fn none(machine: &Machine) -> Vec<Twist<f64>> {
    vec![Twist::zero(0.0); machine.dyads().len()]
}

/// Deviations of some frames, the others zero.
fn deviated(machine: &Machine, parts: &[(&str, [f64; 6])]) -> Vec<Twist<f64>> {
    let mut deviations = none(machine);
    for (frame, twist) in parts {
        deviations[machine.frame_index(frame).expect("a frame")] = Twist::from_array(*twist);
    }
    deviations
}

fn value(found: &LocationErrors, name: &str) -> f64 {
    found
        .errors
        .iter()
        .find(|e| e.name == name)
        .unwrap_or_else(|| panic!("{name} among {:?}", names(found)))
        .value
}

fn names(found: &LocationErrors) -> Vec<&str> {
    found.errors.iter().map(|e| e.name.as_str()).collect()
}

/// All are zero but these.
fn assert_only(found: &LocationErrors, expected: &[(&str, f64)]) {
    for error in &found.errors {
        let wanted = expected.iter().find(|(name, _)| *name == error.name).map_or(0.0, |(_, x)| *x);
        // 15 nm are the 0.495 mm that C stands above A times 30 urad.
        assert!((error.value - wanted).abs() < 1.6e-8, "{}: {} instead of {wanted}", error.name, error.value);
    }
    expected.iter().for_each(|(name, _)| {
        value(found, name);
    });
}

#[test]
fn eleven_for_five_axes_three_for_three() {
    let list = |stem: &str| {
        let machine = common::machine(stem);
        let found = location_errors(&machine, &none(&machine), ORIGIN, None);
        names(&found).join(" ")
    };
    let linear = "EC0Y EA0Z EB0Z";
    assert_eq!(list("xyz_mill"), linear);
    assert_eq!(list("ac_table_tilting"), format!("{linear} EY0A EZ0A EB0A EC0A EX0C EY0C EA0C EB0C"));
    assert_eq!(list("bc_head_table"), format!("{linear} EX0B EZ0B EA0B EC0B EX0C EY0C EA0C EB0C"));
    // B about (0, 1, 1)/sqrt 2: square to it are x and the z direction that was turned with it.
    assert_eq!(list("bc_nutating_table"), format!("{linear} EX0B EZ'0B EA0B EC'0B EX0C EY0C EA0C EB0C"));
    assert_eq!(list("four_axis_horizontal"), format!("{linear} EX0B EZ0B EA0B EC0B"));
}

#[test]
fn parallel_axes_go_by_the_names_of_their_joints() {
    let machine = Machine::parse(
        "boring_mill.ron",
        r#"Machine(
            name: "boring_mill", units: (length: mm, angle: deg),
            workpiece: [(frame: "x", joint: Prismatic(axis: "-x")), (frame: "z", joint: Prismatic(axis: "-z")), (frame: "w")],
            tool: [(frame: "y", joint: Prismatic(axis: "y")), (frame: "q", joint: Prismatic(axis: "z")), (frame: "t")],
        )"#,
    )
    .expect("a machine");
    let found = location_errors(&machine, &none(&machine), ORIGIN, None);
    assert_eq!(names(&found), ["EC0Y", "EA0(z)", "EB0(z)", "EA0(q)", "EB0(q)"]);
}

#[test]
fn arms_have_none_and_say_why() {
    for (stem, machine) in common::machines() {
        let found = location_errors(&machine, &none(&machine), ORIGIN, None);
        let linear =
            machine.joints().filter(|(_, j)| j.kind == kincal::machine::JointKind::Prismatic).count();
        if linear < 2 {
            assert!(found.errors.is_empty(), "{stem}");
            assert!(found.reason.expect("a reason").contains("two linear axes"), "{stem}");
        }
    }
    let arm = common::machine("six_r_arm");
    let reason = location_errors(&arm, &none(&arm), ORIGIN, None).reason;
    assert!(reason.is_some_and(|r| r.ends_with("has none")));
}

#[test]
fn single_errors_come_out_by_name_and_sign() {
    // The table's y guideway turned by 50 urad about +z, x on it turned back: X and Y enclose 90 deg + 50 urad.
    let mill = common::machine("xyz_mill");
    let turn = |about: usize, by: f64| {
        let mut twist = [0.0; 6];
        twist[3 + about] = by;
        twist
    };
    let shift = |along: usize, by: f64| {
        let mut twist = [0.0; 6];
        twist[along] = by;
        twist
    };
    let of = |machine: &Machine, parts: &[(&str, [f64; 6])]| {
        location_errors(machine, &deviated(machine, parts), ORIGIN, None)
    };
    assert_only(&of(&mill, &[("y", turn(2, 50e-6)), ("x", turn(2, -50e-6))]), &[("EC0Y", 50e-6)]);
    // Turning both leaves them square: the whole table has turned.
    assert_only(&of(&mill, &[("y", turn(2, 50e-6))]), &[]);
    // The column turned about x and about y.
    assert_only(&of(&mill, &[("z", turn(0, 40e-6))]), &[("EA0Z", 40e-6)]);
    assert_only(&of(&mill, &[("z", turn(1, -40e-6))]), &[("EB0Z", -40e-6)]);

    let table = common::machine("ac_table_tilting");
    // A inclined about y and z, C on it inclined back.
    let a = |about: usize, by: f64| of(&table, &[("a", turn(about, by)), ("c", turn(about, -by))]);
    assert_only(&a(1, 30e-6), &[("EB0A", 30e-6)]);
    assert_only(&a(2, -30e-6), &[("EC0A", -30e-6)]);
    // A displaced, C displaced back; C displaced alone; the spindle displaced, so that both axes lie the other way.
    let back = |along: usize, by: f64| of(&table, &[("a", shift(along, by)), ("c", shift(along, -by))]);
    assert_only(&back(1, 20e-6), &[("EY0A", 20e-6)]);
    assert_only(&back(2, 20e-6), &[("EZ0A", 20e-6)]);
    assert_only(&of(&table, &[("c", shift(0, 20e-6))]), &[("EX0C", 20e-6)]);
    assert_only(&of(&table, &[("c", shift(1, -20e-6))]), &[("EY0C", -20e-6)]);
    assert_only(&of(&table, &[("c", turn(0, 15e-6))]), &[("EA0C", 15e-6)]);
    assert_only(&of(&table, &[("c", turn(1, 15e-6))]), &[("EB0C", 15e-6)]);
    assert_only(&of(&table, &[("t", shift(1, 10e-6))]), &[("EY0A", -10e-6), ("EY0C", -10e-6)]);
    // What frame w does is no matter of the machine.
    assert_only(&of(&table, &[("w", [1e-3, 2e-3, 3e-3, 1e-3, 2e-3, 3e-3])]), &[]);

    // An axis declared along -z names the same line with the same signs.
    let paper = common::machine("ac_table_tilting_paper");
    assert_only(&of(&paper, &[("c", shift(0, 20e-6))]), &[("EX0C", 20e-6)]);
    assert_only(&of(&paper, &[("c", turn(1, 15e-6))]), &[("EB0C", 15e-6)]);
}

/// Location errors from nothing but where the tool goes as the workpiece sees it, one axis moved at a time: for axes along
/// coordinate directions, machine coordinates X, Y.
fn from_motion(machine: &Machine, deviations: &[Twist<f64>], name: &str, joint: &str) -> f64 {
    let line = |deviations: &[Twist<f64>], joint: &str| -> (Vec3<f64>, Vec3<f64>) {
        let chain = Chain::new(machine, deviations);
        let (j, _) = machine.joints().find(|(_, own)| own.name == joint).expect("a joint");
        let command = machine.commands().iter().position(|c| c == joint).expect("a command");
        let mut q = vec![0.0; machine.commands().len()];
        let home = chain.w_from_t(&q);
        q[command] = 0.2;
        let moved: Twist<f64> = (chain.w_from_t(&q) * home.inverse()).log().times(1.0 / 0.2);
        let prismatic = machine.dyads()[j]
            .joint
            .as_ref()
            .is_some_and(|j| j.kind == kincal::machine::JointKind::Prismatic);
        if prismatic {
            return (moved.v, ORIGIN);
        }
        // v = point × w: the point of the line nearest to the origin is w × v.
        (moved.w, moved.w.cross(moved.v))
    };
    let letters = ["x", "y", "z"];
    let along = |k: usize| letters[k].to_string();
    let frame = |deviations: &[Twist<f64>]| {
        let upright = |v: Vec3<f64>| {
            let k = (0..3).max_by(|a, b| v.0[*a].abs().total_cmp(&v.0[*b].abs())).expect("three");
            v.times(v.0[k].signum())
        };
        let x = upright(line(deviations, &along(0)).0);
        let z = x.cross(upright(line(deviations, &along(1)).0));
        let z = z.times(1.0 / z.norm());
        [x, z.cross(x), z]
    };
    let seen = |deviations: &[Twist<f64>]| {
        let axes = frame(deviations);
        let (direction, point) = line(deviations, joint);
        let t: Pose<f64> = Chain::new(machine, deviations).w_from_t(&vec![0.0; machine.commands().len()]);
        let turned = |v: Vec3<f64>| Vec3(axes.map(|e| e.dot(v)));
        let direction = turned(direction);
        let k = (0..3).max_by(|a, b| direction.0[*a].abs().total_cmp(&direction.0[*b].abs())).expect("three");
        (direction.times(direction.0[k].signum()), turned(point - t.translation), k)
    };
    let ((u, p, k), (_, p0, _)) = (seen(deviations), seen(&none(machine)));
    let letter = name.as_bytes()[1];
    match letter {
        b'X' | b'Y' | b'Z' => {
            // At the height of the joint's declared origin.
            let origin = declared_height(machine, joint, k);
            let i = usize::from(letter - b'X');
            p.0[i] + u.0[i] / u.0[k] * (origin - p.0[k]) - p0.0[i]
        }
        _ => {
            let about = usize::from(letter - b'A');
            // (about, k, third) cyclic: a turn about `about` takes k towards third.
            let third = 3 - about - k;
            if (about + 1) % 3 == k { u.0[third] } else { -u.0[third] }
        }
    }
}

/// Coordinate k of the joint's declared origin seen from the declared tool frame (axes of the base).
fn declared_height(machine: &Machine, joint: &str, k: usize) -> f64 {
    let sweep = Chain::nominal(machine).sweep(&vec![0.0; machine.commands().len()]);
    let (j, _) = machine.joints().find(|(_, own)| own.name == joint).expect("a joint");
    (sweep.b_from_frame(j).translation - sweep.b_from_t().translation).0[k]
}

#[test]
fn random_deviations_agree_with_the_motion_of_the_tool_seen_from_the_workpiece() {
    let mut compared = 0;
    for (n, (stem, machine)) in machine_tools().into_iter().enumerate() {
        let deviations = random_deviations(&machine, 1.0, 40 + n as u64);
        let found = location_errors(&machine, &deviations, ORIGIN, None);
        for error in &found.errors {
            let oblique = machine
                .joints()
                .any(|(_, j)| j.name == error.axis && j.axis.0.iter().filter(|c| c.abs() > 1e-9).count() > 1);
            if oblique {
                continue;
            }
            let expected = from_motion(&machine, &deviations, &error.name, &error.axis);
            compared += 1;
            assert!(
                (error.value - expected).abs() < 1e-10,
                "{stem} {}: {} and {expected}",
                error.name,
                error.value
            );
        }
    }
    assert!(compared > 80, "{compared}");
}

#[test]
fn what_poses_do_not_see_changes_no_location_error() {
    for (stem, machine) in machine_tools() {
        let description = describe(&machine);
        let pose = description.identifiable.iter().find(|i| i.measurement == "pose").expect("poses");
        assert!(!pose.unseen.is_empty());
        for combination in &pose.unseen {
            let at = |size: f64| {
                let mut all = vec![[0.0; 6]; machine.dyads().len()];
                for (label, x) in combination {
                    let (frame, component) = label.rsplit_once('.').expect("frame.component");
                    let k = COMPONENTS.iter().position(|c| *c == component).expect("a component");
                    all[machine.frame_index(frame).expect("a frame")][k] = size * x;
                }
                let deviations: Vec<_> = all.into_iter().map(Twist::from_array).collect();
                location_errors(&machine, &deviations, ORIGIN, None)
            };
            let step = 1e-4;
            let largest = combination.iter().fold(0.0f64, |m, (_, x)| m.max(x.abs()));
            for (plus, minus) in at(step).errors.iter().zip(&at(-step).errors) {
                let slope = (plus.value - minus.value) / (2.0 * step * largest);
                assert!(slope.abs() < 1e-6, "{stem}: {} by {slope} along {combination:?}", plus.name);
            }
        }
    }
}

/// Instrument readings of a machine with random deviations, calibrated.
fn measured(
    machine: &Machine,
    truth: &[Twist<f64>],
    instrument: &Instrument,
    commands: &[Vec<f64>],
    header: &[&str],
    seed: u64,
) -> Fit {
    let truth = CalibratedMachine::nominal(machine.clone()).with_deviations(truth.to_vec());
    let header: Vec<String> = header.iter().map(|h| h.to_string()).collect();
    let csv = recording(&truth, instrument, commands, &header, seed);
    let recordings =
        [Recording::from_bytes("simulated.csv", csv.into_bytes(), machine).expect("a recording")];
    calibrate(machine, &recordings, CalibrateOptions::default()).expect("a fit").1
}

/// The same commands with every joint but these at zero.
fn hold(machine: &Machine, q: &[f64], moving: &[&str]) -> Vec<f64> {
    let moves = |c: &String| moving.contains(&c.as_str());
    q.iter().zip(machine.commands()).map(|(x, c)| if moves(c) { *x } else { 0.0 }).collect()
}

/// Largest miss of an identified location error in standard errors, and how many are identified.
fn miss(machine: &Machine, truth: &[Twist<f64>], fit: &Fit) -> (f64, usize) {
    let found = &fit.location_errors;
    let true_values = location_errors(machine, truth, Vec3(found.reference_t_m), None);
    let pairs = found.errors.iter().zip(&true_values.errors).filter(|(e, _)| e.identified);
    pairs.fold((0.0, 0), |(worst, count), (e, t)| {
        (f64::max(worst, ((e.value - t.value) / e.std_error).abs()), count + 1)
    })
}

#[test]
fn poses_identify_every_location_error_of_every_machine() {
    for (n, (stem, machine)) in machine_tools().into_iter().enumerate() {
        let truth = random_deviations(&machine, 1.0, 300 + n as u64);
        let commands = random_commands(&machine, 60, 400 + n as u64);
        let instrument = Instrument::new(Sensor::Pose, 1e-6, 3e-6);
        // Where the workpiece stands does not matter to the geometry of the machine.
        for header in [&[][..], &["workpiece_frame: unknown"][..]] {
            let fit = measured(&machine, &truth, &instrument, &commands, header, 500 + n as u64);
            let (worst, count) = miss(&machine, &truth, &fit);
            println!("{stem:<24} {header:?}: {count} identified, worst {worst:.2} standard errors");
            assert_eq!(
                count,
                fit.location_errors.errors.len(),
                "{stem} {header:?}: {:#?}",
                fit.location_errors
            );
            assert!(worst < 4.0, "{stem}: off by {worst} standard errors");
        }
    }
}

#[test]
fn a_slanted_axis_has_its_errors_along_and_about_the_directions_square_to_it() {
    let machine = common::machine("bc_nutating_table");
    let of = |parts: &[(&str, [f64; 6])]| location_errors(&machine, &deviated(&machine, parts), ORIGIN, None);
    let half = 0.5f64.sqrt();
    let about_x = of(&[("b", [0.0, 0.0, 0.0, 10e-6, 0.0, 0.0]), ("c", [0.0, 0.0, 0.0, -10e-6, 0.0, 0.0])]);
    assert_only(&about_x, &[("EA0B", 10e-6)]);
    // z' = (0, -1, 1)/sqrt 2.
    let (c, s) = (-half * 20e-6, half * 20e-6);
    let along = of(&[("b", [0.0, c, s, 0.0, 0.0, 0.0]), ("c", [0.0, -c, -s, 0.0, 0.0, 0.0])]);
    assert_only(&along, &[("EZ'0B", 20e-6)]);
    let about = of(&[("b", [0.0, 0.0, 0.0, 0.0, c, s]), ("c", [0.0, 0.0, 0.0, 0.0, -c, -s])]);
    assert_only(&about, &[("EC'0B", 20e-6)]);
    let error = about.errors.iter().find(|e| e.name == "EC'0B").expect("listed");
    assert!((Vec3(error.direction) - Vec3([0.0, -half, half])).norm() < 1e-12);
    // A slide along the axis itself is none.
    assert_only(&of(&[("b", [0.0, s, s, 0.0, 0.0, 0.0]), ("c", [0.0, -s, -s, 0.0, 0.0, 0.0])]), &[]);
}

/// A ballbar between a ball at `centre` in w and the tool frame's own point, reading against 150 mm.
fn ballbar(centre: Vec3<f64>) -> (Instrument, Vec<String>) {
    let mut instrument = Instrument::new(Sensor::Distance { absolute: false }, 0.5e-6, 0.0);
    instrument.state.workpiece_point_w = centre;
    instrument.state.length = 0.15;
    let [x, y, z] = centre.0;
    (instrument, vec![format!("workpiece_point[m]: {x}, {y}, {z}"), "nominal_length[m]: 0.15".into()])
}

#[test]
fn one_ballbar_centre_identifies_some_and_calls_nothing_identified_that_is_wrong() {
    let machine = common::machine("ac_table_tilting");
    let (instrument, header) = ballbar(ORIGIN);
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let general = random_commands(&machine, 600, 3);
    let path = cone(&machine, 0.15, 0.3, 300).expect("within reach");
    // Table and slides in one plane, the tilting axis at rest.
    let plane = general.iter().map(|q| hold(&machine, q, &["x", "y", "c"])).collect();
    for (what, commands) in [("cone", path), ("plane", plane), ("anywhere", general)] {
        let mut counts = Vec::new();
        for seed in 0..6 {
            let truth = random_deviations(&machine, 1.0, 700 + seed);
            let fit = measured(&machine, &truth, &instrument, &commands, &header, 800 + seed);
            let (worst, count) = miss(&machine, &truth, &fit);
            println!("{what} {seed}: {count} of 11, worst {worst:.2} standard errors");
            assert!(worst < 4.0, "{what} {seed}: {:#?}", fit.location_errors);
            counts.push(count);
        }
        match what {
            "plane" => assert!(counts.iter().all(|c| (1..11).contains(c)), "{counts:?}"),
            "anywhere" => assert!(counts.iter().all(|c| *c == 11), "{counts:?}"),
            // One path on one cone sees sums of many errors and none by itself.
            _ => assert!(counts.iter().all(|c| *c < 11), "{counts:?}"),
        }
    }
}

#[test]
fn what_each_instrument_identifies_on_the_reference_machine() {
    let machine = common::machine("ac_table_tilting");
    let truth = random_deviations(&machine, 1.0, 9);
    let joint = machine.frame_index("x").expect("a frame");
    let distance = Sensor::Distance { absolute: true };
    let laser = Sensor::Displacement { direction_w: Vec3([0.48, 0.6, 0.64]) };
    let off = Vec3([0.04, -0.03, 0.02]);
    let all = random_commands(&machine, 400, 10);
    let only = |moving: &[&str]| all.iter().map(|q| hold(&machine, q, moving)).collect::<Vec<_>>();
    let path = cone(&machine, 0.15, 0.3, 200).expect("within reach");
    type Case<'a> = (&'a str, Sensor, Vec<Vec<f64>>, Vec<&'a str>, Vec3<f64>);
    let cases: Vec<Case> = vec![
        ("pose", Sensor::Pose, all.clone(), vec![], ORIGIN),
        ("pose, frame unknown", Sensor::Pose, all.clone(), vec!["workpiece_frame: unknown"], ORIGIN),
        ("pose, tool point unknown", Sensor::Pose, all.clone(), vec!["tool_point: unknown ball"], off),
        ("pose, x y z move", Sensor::Pose, only(&["x", "y", "z"]), vec![], ORIGIN),
        ("pose, a c move", Sensor::Pose, only(&["a", "c"]), vec![], ORIGIN),
        ("position", Sensor::Position, all.clone(), vec![], ORIGIN),
        (
            "position, ball off t",
            Sensor::Position,
            all.clone(),
            vec!["tool_point[m]: 0.04, -0.03, 0.02"],
            off,
        ),
        ("position, ball unknown", Sensor::Position, all.clone(), vec!["tool_point: unknown ball"], off),
        ("position, c moves", Sensor::Position, only(&["c"]), vec![], ORIGIN),
        ("distance", distance.clone(), all.clone(), vec![], ORIGIN),
        (
            "distance, length unknown",
            Sensor::Distance { absolute: false },
            all.clone(),
            vec!["nominal_length: unknown"],
            ORIGIN,
        ),
        ("distance, x y c move", distance.clone(), only(&["x", "y", "c"]), vec![], ORIGIN),
        ("distance, cone", distance, path, vec![], ORIGIN),
        ("displacement", laser, all.clone(), vec!["zero: unknown"], ORIGIN),
        ("joint x", Sensor::Joint { dyad: joint }, all.clone(), vec![], ORIGIN),
    ];
    let mut table = String::new();
    for (n, (what, sensor, commands, header, point)) in cases.into_iter().enumerate() {
        let mut instrument = Instrument::new(sensor, 1e-6, 5e-6);
        instrument.state.tool_point_t = point;
        let fit = measured(&machine, &truth, &instrument, &commands, &header, 20 + n as u64);
        let found = &fit.location_errors;
        if n == 0 {
            let _ = writeln!(table, "{:<26}{}", "", names(found).join(" "));
        }
        let marks: Vec<&str> =
            found.errors.iter().map(|e| if e.identified { "yes " } else { "-   " }).collect();
        let _ = writeln!(table, "{what:<26}{}", marks.join(" ").trim_end());
        let (worst, _) = miss(&machine, &truth, &fit);
        assert!(worst < 4.0, "{what}: {:#?}", found);
    }
    println!("{table}");
    insta::assert_snapshot!(table);
}

#[test]
fn without_prior_an_unseen_error_has_no_standard_error() {
    let machine = common::machine("ac_table_tilting");
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 77));
    let commands: Vec<Vec<f64>> = random_commands(&machine, 100, 78)
        .into_iter()
        .map(|q| hold(&machine, &q, &["x", "y", "z", "c"]))
        .collect();
    let csv = recording(&truth, &Instrument::new(Sensor::Pose, 1e-6, 5e-6), &commands, &[], 79);
    let recordings = [Recording::from_bytes("r.csv", csv.into_bytes(), &machine).expect("a recording")];
    let options = CalibrateOptions::default().with_prior(false);
    let (_, fit) = calibrate(&machine, &recordings, options).expect("a fit");
    let of = |name: &str| fit.location_errors.errors.iter().find(|e| e.name == name).expect("listed");
    assert!(of("EC0Y").identified && of("EC0Y").std_error < 5e-6);
    assert!(!of("EB0A").identified && of("EB0A").std_error.is_infinite());
}

//! A recording from arrays is the recording that the same numbers make as a file, to the last bit; what cannot stand is refused.

use crate::common::machine;
use crate::common::random::Random;
use kincal::lie::{Pose, Twist, Vec3};
use kincal::machine::JointKind;
use kincal::recording::{Arrays, Chunk, Recording, RecordingFault};
use kincal::{Error, Machine};

const SAMPLES: usize = 40;
const MACHINES: [&str; 4] = ["ac_table_tilting", "linear_axis", "six_r_arm", "xyz_mill"];

/// Numbers of every size, with all their digits.
fn column(random: &mut Random) -> Vec<f64> {
    (0..SAMPLES).map(|_| random.normal() * 10f64.powf(random.between(-9.0, 0.0))).collect()
}

fn unit(machine: &Machine, joint: &str) -> &'static str {
    let kind = machine.joints().find(|(_, own)| own.name == joint).expect("a joint").1.kind;
    if kind == JointKind::Prismatic { "m" } else { "rad" }
}

/// The file that a person would write: `head` above, one column for each of `columns`, sixteen digits behind the point.
fn file(machine: &Machine, head: &[String], columns: &[(String, Vec<f64>)]) -> Recording {
    let mut text: String = head.iter().map(|line| format!("# {line}\n")).collect();
    text += &columns.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(",");
    for k in 0..SAMPLES {
        let cell = |x: f64| if x.is_nan() { String::new() } else { format!("{x:.16e}") };
        text += "\n";
        text += &columns.iter().map(|(_, values)| cell(values[k])).collect::<Vec<_>>().join(",");
    }
    Recording::from_bytes("rec.csv", text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

fn chunks(recording: &Recording) -> Vec<Chunk> {
    let chunks = recording.chunks().and_then(Iterator::collect::<Result<Vec<_>, _>>);
    chunks.unwrap_or_else(|e| panic!("{e}"))
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() }).collect()
}

fn are_the_same(arrays: &Recording, file: &Recording) {
    assert_eq!(arrays.header(), file.header());
    assert_eq!(arrays.value_count(), file.value_count());
    let names = |r: &Recording| r.extra_channels().iter().map(|c| format!("{c:?}")).collect::<Vec<_>>();
    assert_eq!(names(arrays).len(), names(file).len());
    let (found, expected) = (chunks(arrays), chunks(file));
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(&expected) {
        assert_eq!((found.len, found.dropped), (expected.len, expected.dropped));
        assert_eq!(bits(&found.commands), bits(&expected.commands));
        assert_eq!(bits(&found.values), bits(&expected.values));
        assert_eq!(found.time.as_deref().map(bits), expected.time.as_deref().map(bits));
        let directions = |c: &Chunk| c.directions.iter().map(|d| d.as_deref().map(bits)).collect::<Vec<_>>();
        assert_eq!(directions(found), directions(expected));
        let channels = |c: &Chunk| c.channels.iter().map(|c| bits(c)).collect::<Vec<_>>();
        assert_eq!(channels(found), channels(expected));
    }
    assert!(found.iter().map(|c| c.len).sum::<usize>() > 0, "nothing was compared");
}

/// A recording from arrays, the lines of its head, and its columns.
type Kind = (Arrays, Vec<String>, Vec<(String, Vec<f64>)>);

/// Every kind of measurement: the arrays, and the lines and columns of the same file.
fn kinds(machine: &Machine, random: &mut Random) -> Vec<Kind> {
    let columns = |names: &[&str], rows: &[Vec<f64>]| -> Vec<(String, Vec<f64>)> {
        names.iter().map(|name| name.to_string()).zip(rows.iter().cloned()).collect()
    };
    let head = |lines: &[&str]| lines.iter().map(|line| line.to_string()).collect::<Vec<_>>();
    let mut all = Vec::new();

    let mut p: Vec<Vec<f64>> = (0..3).map(|_| column(random)).collect();
    p[1][5] = f64::NAN;
    let rows: Vec<[f64; 3]> = (0..SAMPLES).map(|k| [p[0][k], p[1][k], p[2][k]]).collect();
    let position = ["px[m]", "py[m]", "pz[m]"];
    all.push((Arrays::position(&rows), head(&["measurement: position"]), columns(&position, &p)));

    let poses: Vec<Pose<f64>> = (0..SAMPLES)
        .map(|_| {
            Pose::exp(Twist::from_array([1.0, 2.0, 0.1, 0.7, 1.0, 1.5].map(|size| size * random.normal())))
        })
        .collect();
    let of = |k: usize| -> Vec<f64> {
        poses
            .iter()
            .map(|pose| if k < 3 { pose.translation.0[k] } else { pose.rotation_vector().0[k - 3] })
            .collect()
    };
    let names = ["px[m]", "py[m]", "pz[m]", "rx[rad]", "ry[rad]", "rz[rad]"];
    let rows: Vec<Vec<f64>> = (0..6).map(of).collect();
    all.push((Arrays::pose(&poses), head(&["measurement: pose"]), columns(&names, &rows)));

    let d = column(random);
    let of_distance = columns(&["d[m]"], std::slice::from_ref(&d));
    let known = head(&["measurement: distance", "nominal_length[m]: 0.1"]);
    all.push((Arrays::distance(&d, 0.1), known, of_distance.clone()));
    let unknown = head(&["measurement: distance", "nominal_length: unknown"]);
    all.push((Arrays::distance_of_unknown_length(&d), unknown, of_distance));

    let r: Vec<f64> = column(random).iter().map(|x| x.abs()).collect();
    all.push((
        Arrays::absolute_distance(&r),
        head(&["measurement: distance"]),
        columns(&["r[m]"], std::slice::from_ref(&r)),
    ));

    let s = column(random);
    let direction = head(&["measurement: displacement", "direction: 0,0.6,-0.8", "zero: unknown"]);
    let arrays = Arrays::displacement(&s, Vec3([0.0, 0.6, -0.8])).unknown_zero();
    all.push((arrays, direction, columns(&["s[m]"], &[s])));

    for joint in machine.commands() {
        let measured = column(random);
        let name = format!("{joint}_meas[{}]", unit(machine, joint));
        let columns = vec![(name, measured.clone())];
        all.push((Arrays::joint(joint, &measured), head(&["measurement: joint"]), columns));
    }
    all
}

#[test]
fn arrays_and_the_file_of_the_same_numbers_are_one_recording() {
    let mut random = Random::new(1);
    for stem in MACHINES {
        let machine = machine(stem);
        for (mut arrays, mut head, mut columns) in kinds(&machine, &mut random) {
            for (c, joint) in machine.commands().iter().enumerate() {
                let mut q = column(&mut random);
                if c == 0 {
                    q[17] = f64::NAN;
                }
                arrays = arrays.command(joint, &q);
                // In front of what was measured here, behind it there.
                columns.insert(0, (format!("{joint}[{}]", unit(&machine, joint)), q));
            }
            let time: Vec<f64> = (0..SAMPLES).map(|k| 1e3 + 0.1 * k as f64).collect();
            let sides: Vec<i8> = (0..SAMPLES).map(|k| (k % 3) as i8 - 1).collect();
            let mut warmth: Vec<f64> = column(&mut random).iter().map(|x| 20.0 + x).collect();
            warmth[3] = f64::NAN;
            let joint = &machine.commands()[0];
            arrays = arrays.time(&time).direction(joint, &sides).channel("head", "degC", &warmth);
            columns.push(("t[s]".into(), time));
            columns.push((format!("{joint}_direction[1]"), sides.iter().map(|s| f64::from(*s)).collect()));
            columns.push(("head[degC]".into(), warmth));
            // Whether it is an angle that was measured.
            let angle = columns.iter().any(|(name, _)| name.ends_with("_meas[rad]"));
            arrays = arrays.set_up("second clamping").sigma(3e-7).gravity(Vec3([0.0, -0.6, -0.8]));
            head.extend(["setup: second clamping".to_string(), "gravity[w]: 0,-0.6,-0.8".to_string()]);
            head.push(format!("sigma[{}]: 3e-7", if angle { "rad" } else { "m" }));
            let found = arrays.recording("rec.csv", &machine).unwrap_or_else(|e| panic!("{stem}: {e}"));
            assert_eq!(found.name(), "rec.csv");
            are_the_same(&found, &file(&machine, &head, &columns));
        }
    }
}

#[test]
fn points_and_frames_of_a_set_up_are_told() {
    let machine = machine("xyz_mill");
    let zero = vec![0.0; SAMPLES];
    let columns = |measured: &str| {
        let names = ["x[m]", "y[m]", "z[m]", measured].map(String::from);
        names.map(|name| (name, zero.clone())).to_vec()
    };
    let commands =
        |arrays: Arrays| ["x", "y", "z"].iter().fold(arrays, |arrays, joint| arrays.command(joint, &zero));
    let points = commands(Arrays::absolute_distance(&zero))
        .tool_point(Vec3([1e-3, -0.2, 0.1 + 0.2]))
        .workpiece_point(Vec3([0.1, 1.0 / 3.0, 0.0]));
    let head = [
        "measurement: distance".to_string(),
        "tool_point[m]: 1e-3, -2e-1, 0.30000000000000004".to_string(),
        format!("workpiece_point[m]: 0.1, {:.17}, 0", 1.0 / 3.0),
    ];
    are_the_same(&points.recording("r", &machine).expect("sound"), &file(&machine, &head, &columns("r[m]")));
    let unknown =
        commands(Arrays::absolute_distance(&zero)).unknown_tool_point("ball").unknown_workpiece_frame();
    let head =
        ["measurement: distance", "tool_point: unknown ball", "workpiece_frame: unknown"].map(String::from);
    are_the_same(&unknown.recording("r", &machine).expect("sound"), &file(&machine, &head, &columns("r[m]")));
}

/// The fault of arrays that cannot stand, with a mend and without a panic.
fn refused(arrays: &Arrays, machine: &Machine) -> Error {
    let read = arrays.recording("rec", machine).and_then(|recording| recording.scan());
    let error = read.expect_err("it cannot stand");
    assert!(error.to_string().starts_with("rec"), "{error}");
    assert!(!error.mend().is_empty(), "{error} has no mend");
    error
}

#[test]
fn arrays_that_cannot_stand_are_refused() {
    let machine = machine("linear_axis");
    let (x, measured) = (vec![0.0; SAMPLES], vec![[0.0; 3]; SAMPLES]);
    let fault = |error: Error| match error {
        Error::Input { fault, .. } => fault.to_string(),
        other => panic!("{other}"),
    };

    let error = refused(&Arrays::position(&measured).command("x", &x[..7]), &machine);
    match error.fault() {
        Some(RecordingFault::UnequalArrays { values, samples, .. }) => {
            assert_eq!((*values.min(samples), *values.max(samples)), (7, SAMPLES));
        }
        _ => panic!("{error}"),
    }
    let error = refused(&Arrays::position(&measured).command("x", &x).time(&[]), &machine);
    assert!(matches!(error.fault(), Some(RecordingFault::UnequalArrays { .. })), "{error}");
    let error = refused(&Arrays::position(&measured), &machine);
    assert!(matches!(error.fault(), Some(RecordingFault::MissingJoint { .. })), "{error}");
    for unknown in [
        Arrays::joint("u", &x).command("x", &x),
        Arrays::position(&measured).command("x", &x).command("u", &x),
    ] {
        let error = refused(&unknown, &machine);
        assert_eq!(error.mend(), "name one of: x");
        assert!(fault(error).contains("\"u\""));
    }
    let error = refused(&Arrays::position(&[]).command("x", &[]), &machine);
    assert!(matches!(error.fault(), Some(RecordingFault::NoRows)), "{error}");
    let none = vec![[f64::NAN; 3]; SAMPLES];
    let error = refused(&Arrays::position(&none).command("x", &x), &machine);
    assert!(matches!(error.fault(), Some(RecordingFault::AllDropped { .. })), "{error}");

    for wrong in [f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        let mut x = x.clone();
        x[9] = wrong;
        refused(&Arrays::position(&measured).command("x", &x), &machine);
    }
    refused(&Arrays::position(&measured).command("x", &x).sigma(-1.0), &machine);
    refused(&Arrays::position(&measured).command("x", &x).channel("head", "furlong", &x), &machine);
    refused(&Arrays::position(&measured).command("x", &x).direction("x", &[3; SAMPLES]), &machine);
    // A name cannot bring a line or a column of its own.
    for name in ["a\n# sigma[m]: 1", "a\r"] {
        let error = refused(&Arrays::position(&measured).command("x", &x).set_up(name), &machine);
        assert!(fault(error).contains("line break"));
    }
    for name in ["a[1],b", "a\nb", "\"a"] {
        let error = refused(&Arrays::position(&measured).command("x", &x).channel(name, "1", &x), &machine);
        assert!(fault(error).contains("comma"));
    }
}

/// Joints of what hangs on the machine beside its chain have units of their own kind.
#[test]
fn a_side_branch_has_commands_too() {
    let machine = machine("dlr_justin_left");
    let side =
        machine.side_branches().iter().flat_map(|side| side.columns()).map(|(name, _)| name.to_string());
    let side: Vec<String> = side.collect();
    assert!(!side.is_empty(), "this machine has a side branch");
    let q = [0.0, 0.1, 0.2];
    let arrays = machine
        .commands()
        .iter()
        .chain(&side)
        .fold(Arrays::position(&[[0.0; 3]; 3]), |arrays, joint| arrays.command(joint, &q));
    let recording = arrays.recording("rec", &machine).unwrap_or_else(|e| panic!("{e}"));
    let channels: Vec<&str> =
        recording.extra_channels().iter().map(|channel| channel.name.as_str()).collect();
    assert_eq!(channels, side);
}

//! Recordings: every measurement in several units, drop-outs, pauses; every fault with its place and mend; no input panics.

use std::path::{Path, PathBuf};

use crate::common::read_or_refused;
use kincal::identify::{CalibrateOptions, calibrate};
use kincal::recording::{
    Chunk, Measurement, Memory, NominalLength, Recording, RecordingFault, Role, ToolPoint,
};
use kincal::units::Quantity;
use kincal::{Error, Machine};
use proptest::prelude::*;

/// A turntable `c` and a slide `x` with a counterweight `m` that goes the other way.
fn rig() -> Machine {
    let text = r#"Machine(
        name: "rig", units: (length: mm, angle: deg),
        workpiece: [(frame: "c", joint: Revolute(axis: "z")), (frame: "w")],
        tool: [
            (frame: "x", joint: Prismatic(axis: "x", travel: (-500, 500))),
            (frame: "m", joint: Prismatic(axis: "x", follows: {"x": -1})),
            (frame: "t", at: (0, 0, 100)),
        ],
    )"#;
    Machine::parse("rig.ron", text).expect("a machine")
}

fn open(text: &str) -> Result<Recording, Error> {
    Recording::from_bytes("rec.csv", text.as_bytes(), &rig())
}

fn good(text: &str) -> Recording {
    open(text).unwrap_or_else(|e| panic!("{e}"))
}

/// All samples as one chunk.
fn all(recording: &Recording) -> Result<Chunk, Error> {
    let mut whole: Option<Chunk> = None;
    for chunk in recording.chunks()? {
        let chunk = chunk?;
        let Some(sum) = &mut whole else {
            whole = Some(chunk);
            continue;
        };
        sum.len += chunk.len;
        sum.dropped += chunk.dropped;
        sum.lines.extend(chunk.lines);
        sum.commands.extend(chunk.commands);
        sum.values.extend(chunk.values);
        if let (Some(sum), Some(time)) = (&mut sum.time, chunk.time) {
            sum.extend(time);
        }
    }
    Ok(whole.unwrap_or_default())
}

fn close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= 1e-15 * (1.0 + b.abs()), "{found:?} {expected:?}");
    }
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;

#[test]
fn a_ballbar_in_mixed_units() {
    let recording = good(
        "# machine: rig\n# measurement: distance\n# nominal_length[in]: 4\n# sigma[um]: 0.5\n# setup: socket 2\n\
         # tool_point: unknown ball\n# workpiece_point[mm]: 1, -2 ,3\n# gravity[w]: 0,3,-4\n# free words: yes\n\
         t[ms],d[um],c[arcsec],x[in],temperature[degC]\n0,1.5,3600,1,20\n5,-2,7200,2,\n",
    );
    let header = recording.header();
    assert_eq!(header.machine.as_deref(), Some("rig"));
    assert_eq!(header.measurement, Measurement::Distance { absolute: false });
    assert_eq!(header.nominal_length, NominalLength::Known(0.1016));
    assert_eq!(header.setup, "socket 2");
    assert_eq!(header.tool_point, ToolPoint::Unknown("ball".into()));
    close(&header.workpiece_point.0, &[1e-3, -2e-3, 3e-3]);
    close(&header.gravity_w.expect("given").0, &[0.0, 0.6, -0.8]);
    let sigma = header.sigma.expect("given");
    assert_eq!((sigma.value, sigma.quantity), (5e-7, Quantity::Length));
    assert_eq!(recording.warnings(), ["line 9: ignored header key `free words`"]);
    assert_eq!((recording.name(), recording.has_time(), recording.value_count()), ("rec.csv", true, 1));
    assert_eq!(recording.extra_channels()[0].name, "temperature");
    assert_eq!(recording.columns()[1].role, Role::Value(0));
    let chunk = all(&recording).expect("rows");
    assert_eq!((chunk.len, chunk.dropped), (2, 0));
    assert_eq!(chunk.lines, [11, 12]);
    assert_eq!(chunk.time, Some(vec![0.0, 0.005]));
    // Machine order: c before x.
    close(&chunk.commands, &[DEGREE, 0.0254, 2.0 * DEGREE, 0.0508]);
    close(&chunk.values, &[1.5e-6, -2e-6]);
    assert_eq!(chunk.channels[0][0], 293.15);
    assert!(chunk.channels[0][1].is_nan());
}

#[test]
fn a_draw_wire_without_nominal_length() {
    let recording = good("# measurement: distance\nx[m],c[rad],r[mm]\n0.25,1,812.5\n");
    assert_eq!(recording.header().measurement, Measurement::Distance { absolute: true });
    assert_eq!(recording.header().nominal_length, NominalLength::NotGiven);
    let chunk = all(&recording).expect("rows");
    close(&chunk.commands, &[1.0, 0.25]);
    close(&chunk.values, &[0.8125]);
    let unknown = good("# measurement: distance\n# nominal_length: unknown\nx[m],c[rad],d[mm]\n0,0,0\n");
    assert_eq!(unknown.header().nominal_length, NominalLength::Unknown);
}

#[test]
fn a_tracker_and_a_fixed_joint() {
    let recording = good(
        "# measurement: position\n# workpiece_frame: unknown\n# fixed c[deg]: 90\n pz [m] , \"x[mm]\",py[mm],px[um]\n3,10,2,1\n",
    );
    assert!(recording.header().workpiece_frame_unknown);
    assert_eq!(recording.fixed(), [Some(90.0 * DEGREE), None]);
    let chunk = all(&recording).expect("rows");
    close(&chunk.commands, &[90.0 * DEGREE, 0.01]);
    close(&chunk.values, &[1e-6, 2e-3, 3.0]);
}

#[test]
fn a_pose_as_rotation_vector_or_quaternion() {
    let vector = good(
        "# measurement: pose\nx[mm],c[deg],px[m],py[m],pz[m],rx[deg],ry[deg],rz[deg]\n0,0,1,2,3,0,0,90\n",
    );
    let half = (45.0 * DEGREE).sin();
    let quaternion = good(&format!(
        "# measurement: pose\nx[mm],c[deg],qx[1],qy[1],qz[1],qw[1],px[m],py[m],pz[m]\n0,0,0,0,-{half},-{half},1,2,3\n"
    ));
    assert_eq!(quaternion.value_count(), 6);
    for recording in [vector, quaternion] {
        close(&all(&recording).expect("rows").values, &[1.0, 2.0, 3.0, 0.0, 0.0, 90.0 * DEGREE]);
    }
}

#[test]
fn a_dial_gauge_and_a_reference_encoder() {
    let gauge =
        good("# measurement: displacement\n# zero: unknown\n# direction: 0,0,2\nx[mm],c[deg],s[um]\n1,0,7\n");
    assert!(gauge.header().zero_unknown);
    assert_eq!(gauge.header().direction_w.map(|d| d.0), Some([0.0, 0.0, 1.0]));
    close(&all(&gauge).expect("rows").values, &[7e-6]);
    let encoder = good(
        "# measurement: joint\n# sigma[arcsec]: 1\nx[mm],c[deg],c_meas[mrad],c_direction[1]\n1,0,7,-1\n1,0,7,0\n",
    );
    assert_eq!(encoder.header().measurement, Measurement::Joint { dyad: 0 });
    let chunk = all(&encoder).expect("rows");
    close(&chunk.values, &[7e-3, 7e-3]);
    assert_eq!(chunk.directions, [Some(vec![-1.0, 0.0]), None]);
    // The counterweight can be measured though it has no command.
    let follower = good("# measurement: joint\nx[mm],c[deg],m_meas[mm]\n1,0,-1\n");
    assert_eq!(follower.header().measurement, Measurement::Joint { dyad: 3 });
}

#[test]
fn a_joint_that_follows_is_compared_with_its_coupling() {
    let text = "# measurement: joint\nx[mm],c[deg],m[mm],x_meas[mm]\n1,0,-1,1\n2,0,-2.5,2\n3,0,,3\n";
    let summary = good(text).scan().expect("rows");
    assert_eq!(summary.samples, 3);
    assert_eq!(
        summary.warnings,
        [
            "column `m` differs by up to 0.5 mm from what the machine's couplings give (line 4); the couplings are used"
        ]
    );
    let right = good(&text.replace("-2.5", "-2")).scan().expect("rows");
    assert_eq!(right.warnings, [""; 0]);
}

#[test]
fn drop_outs_are_counted_and_pauses_found() {
    let mut text = "\u{feff}# measurement: distance\r\n\r\nt[s],x[mm],c[deg],r[mm]\r\n".to_string();
    for i in 0..100 {
        let t = 0.01 * f64::from(i) + if i < 60 { 0.0 } else { 2.0 };
        let r = if i % 10 == 3 { ["", "NaN", " nan "][i as usize / 10 % 3] } else { "5" };
        text += &format!("{t:.2}, {} ,0,{r}\r\n", 10 * i);
    }
    let recording = good(&text);
    assert!(recording.preamble().starts_with("# meas") && recording.preamble().ends_with("r[mm]\r\n"));
    let summary = recording.scan().expect("rows");
    assert_eq!((summary.rows, summary.samples, summary.dropped), (100, 90, 10));
    assert_eq!(summary.time, Some((0.0, 2.99)));
    assert_eq!(summary.pauses, 1);
    assert!((summary.step.expect("time") - 0.01).abs() < 2e-4);
    assert_eq!(summary.moving, [false, true]);
    close(&[summary.commands[1].0, summary.commands[1].1], &[0.0, 0.99]);
    assert_eq!(
        summary.warnings,
        [
            "joint \"x\" is commanded from 0 to 990 mm, beyond its travel from -500 to 500 mm",
            "`t` jumps by 2.01 s at line 64, and runs for 0.98 s in all the rest: a long pause, or a clock that was set"
        ]
    );
}

#[test]
fn rows_come_with_their_text() {
    let text = "# measurement: distance\nx[mm],c[deg],r[mm]\n1,0, 5\n# between\n2,0,\n\n\"3\",0,7";
    let recording = good(text);
    let mut found = Vec::new();
    for block in recording.rows_with_text().expect("memory") {
        let block = block.expect("rows");
        found.extend(
            block.rows().map(|r| (r.line, r.text.to_string(), r.sample.map(|s| block.chunk.values[s]))),
        );
    }
    let expected = [(3, "1,0, 5", Some(0.005)), (5, "2,0,", None), (7, "\"3\",0,7", Some(0.007))];
    assert_eq!(found, expected.map(|(line, text, value)| (line, text.to_string(), value)));
}

#[test]
fn chunks_hold_4096_samples_and_every_pass_starts_anew() {
    let mut text = "# measurement: distance\nx[mm],c[deg],r[mm]\n".to_string();
    for i in 0..10_000 {
        text += &format!("{i},0,{}\n", if i % 2 == 0 { "1" } else { "" });
    }
    let recording = good(&text);
    for _ in 0..2 {
        let chunks: Vec<Chunk> = recording.chunks().expect("memory").map(|c| c.expect("rows")).collect();
        assert_eq!(chunks.iter().map(|c| c.len).collect::<Vec<_>>(), [4096, 904]);
        assert_eq!(chunks.iter().map(|c| c.dropped).sum::<u64>(), 5000);
    }
    let blocks: Vec<_> = recording.rows_with_text().expect("memory").map(|b| b.expect("rows")).collect();
    assert_eq!(blocks.iter().map(|b| b.rows().count()).collect::<Vec<_>>(), [4096, 4096, 1808]);
}

#[test]
fn a_file_is_read_like_the_same_bytes() {
    let text = "# measurement: distance\nx[mm],c[deg],r[mm]\n1,0,5\n";
    let path = std::env::temp_dir().join(format!("kincal-recording-{}.csv", std::process::id()));
    std::fs::write(&path, text).expect("a temporary file");
    let recording = Recording::open(&path, &rig()).expect("a recording");
    let (from_file, name) = (all(&recording), recording.name().to_string());
    let again = all(&recording).expect("rows");
    std::fs::remove_file(&path).expect("just written");
    assert_eq!(from_file.expect("rows"), all(&good(text)).expect("rows"));
    assert_eq!(again.len, 1);
    assert!(name.starts_with("kincal-recording-"));
    // The file is gone: the next pass says so.
    assert!(matches!(recording.chunks().err(), Some(Error::File { .. })));
    assert!(matches!(Recording::open(&path, &rig()), Err(Error::File { .. })));
}

#[test]
fn where_samples_are_kept_changes_no_result() {
    let mut text = "# measurement: position\nx[mm],c[deg],px[mm],py[mm],pz[mm]\n".to_string();
    for i in 0..30_000 {
        let (x, c, off) = (0.01 * f64::from(i), f64::from(i % 360), 1e-3 * f64::from(i * 7919 % 101));
        let (sin, cos) = c.to_radians().sin_cos();
        text += &format!("{x},{c},{},{},{}\n", x * cos + off, -x * sin, 100.0 - off);
    }
    let recorded = |memory: usize| [good(&text).within(&Memory::of_megabytes(memory))];
    let found = |memory: usize| {
        let (calibrated, fit) =
            calibrate(&rig(), &recorded(memory), CalibrateOptions::default()).expect("a fit");
        (calibrated.to_ron(), fit.steps, fit.loss_value.to_bits())
    };
    let in_memory = found(1000);
    assert_eq!(found(0), in_memory);
    assert_eq!(found(1), in_memory);
}

#[test]
fn a_line_without_end_is_refused() {
    let long = "1".repeat(3 << 20);
    for text in [long.clone(), format!("# measurement: distance\nx[mm],c[deg],r[mm]\n1,1,1\n{long}")] {
        let error = open(&text).and_then(|r| r.scan()).expect_err("too long");
        let lines = text.lines().count();
        assert_eq!(error.to_string(), format!("rec.csv:{lines}: line is longer than 1048576 bytes"));
    }
    let comments = "# note\n".repeat(1 << 20);
    let error = open(&comments).expect_err("too long");
    assert!(error.to_string().contains("stand before the data"), "{error}");
}

#[test]
fn odd_but_harmless_headers_are_warned_of() {
    let recording = good(
        "#\n# a comment: with many words\n# zero unknown\n# operator: me\n# date: 2024-01-01\n# zero: unknown\n# direction: 1,0,0\n\
         # measurement: distance\nx[mm],c[deg],r[mm],wind_direction[deg]\n1,0,5,1\n",
    );
    insta::assert_snapshot!(recording.scan().expect("rows").warnings.join("\n"));
}

fn bad(name: &str) -> Error {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad/recordings").join(name);
    let found = Recording::open(&path, &rig()).and_then(|recording| recording.scan());
    found.err().unwrap_or_else(|| panic!("{name} is read without a fault"))
}

#[test]
fn every_bad_recording_has_a_message_and_a_mend() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad/recordings");
    let entries = std::fs::read_dir(&folder).expect("part of the project");
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("readable").path()).collect();
    files.sort();
    let lines = files.iter().map(|path| {
        let name = path.file_name().expect("a name").to_string_lossy();
        let error = bad(&name);
        assert!(error.place().is_some() && !error.mend().is_empty(), "{error}");
        format!("{} | {}", error.to_string().replace(&format!("{}/", folder.display()), ""), error.mend())
    });
    insta::assert_snapshot!(lines.collect::<Vec<_>>().join("\n"));
}

#[test]
fn faults_name_line_and_column() {
    for (name, line, column) in [
        ("empty.csv", 0, 0),
        ("wrong_machine.csv", 1, 12),
        ("misspelt_key.csv", 2, 3),
        ("length_wrong_unit.csv", 3, 18),
        ("column_without_unit.csv", 4, 2),
        ("missing_joint.csv", 4, 0),
        ("not_utf8_header.csv", 4, 0),
        ("not_utf8_row.csv", 6, 3),
        ("text_in_number.csv", 6, 4),
        ("row_too_short.csv", 8, 0),
        ("time_repeats.csv", 7, 1),
        ("quaternion_not_unit.csv", 5, 6),
        ("no_rows.csv", 0, 0),
    ] {
        let error = bad(name);
        let place = error.place().expect("a place");
        assert_eq!((place.line, place.column), (line, column), "{error}");
    }
    let error = bad("time_backwards.csv");
    assert_eq!(error.fault(), Some(&RecordingFault::TimeBackwards { from: 0.1, to: 0.05 }));
}

/// The same cases on every run.
fn fixed_cases() -> ProptestConfig {
    ProptestConfig {
        cases: 512,
        rng_seed: proptest::test_runner::RngSeed::Fixed(20_260_103),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Reads in every way there is.
fn read(bytes: &[u8], machine: &Machine) {
    let refused = Recording::from_bytes("any.csv", bytes, machine);
    let Some(recording) = read_or_refused(refused, "any.csv") else { return };
    let scanned = read_or_refused(recording.scan(), "any.csv");
    read_or_refused(all(&recording), "any.csv");
    let rows = recording.rows_with_text().expect("memory");
    let blocks = rows.map_while(|block| read_or_refused(block, "any.csv"));
    let counted: usize = blocks.map(|block| block.rows().count()).sum();
    if let Some(summary) = scanned {
        assert_eq!((summary.rows, summary.samples + summary.dropped), (counted as u64, counted as u64));
    }
}

proptest! {
    #![proptest_config(fixed_cases())]

    #[test]
    fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        read(&bytes, &rig());
    }

    #[test]
    fn any_text_of_tokens_is_read_or_refused(tokens in proptest::collection::vec(proptest::sample::select(vec![
        "# ", "measurement", "distance", "joint", ": ", "fixed c", "[deg]", "[", "]", "[mm]", "x", "c", "t", "d", "r", "x_meas",
        ",", "\n", "\r\n", "\"", "1", "-1e400", "NaN", "inf", "unknown", "tool_point", "gravity[w]", "0,0,1", "\u{feff}", "é", " ", "\0", ";",
    ]), 0..60)) {
        read(tokens.concat().as_bytes(), &rig());
        let start = "# measurement: distance\nx[mm],c[deg],r[mm]\n";
        read(format!("{start}{}", tokens.concat()).as_bytes(), &rig());
    }

    #[test]
    fn a_damaged_recording_is_read_or_refused(at in 0.0..1.0f64, len in 0usize..12, put in proptest::collection::vec(any::<u8>(), 0..4)) {
        let mut bytes = b"# machine: rig\n# measurement: pose\n# tool_point[mm]: 1,2,3\n# fixed c[deg]: 3\n# gravity[w]: 0,0,-1\n\
            t[s],x[mm],px[mm],py[mm],pz[mm],qw[1],qx[1],qy[1],qz[1]\n0,1,2,3,4,1,0,0,0\n1,2,3,4,5,0,0,-1,0\n".to_vec();
        let start = (at * bytes.len() as f64) as usize;
        let end = (start + len).min(bytes.len());
        bytes.splice(start..end, put);
        read(&bytes, &rig());
    }

    #[test]
    fn what_is_written_is_read_back(rows in proptest::collection::vec((-1e5..1e5f64, -1e5..1e5f64, -1e5..1e5f64), 1..50)) {
        let mut text = "# measurement: distance\nx[mm],c[rad],r[m]\n".to_string();
        for (x, c, r) in &rows {
            text += &format!("{x},{c:e}, {r} \n");
        }
        let chunk = all(&good(&text)).expect("rows");
        prop_assert_eq!(chunk.len, rows.len());
        for (i, (x, c, r)) in rows.into_iter().enumerate() {
            prop_assert_eq!(&chunk.commands[2 * i..2 * i + 2], &[c, x / 1e3][..]);
            prop_assert_eq!(chunk.values[i], r);
        }
    }
}

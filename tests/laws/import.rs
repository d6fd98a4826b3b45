//! A machine that was imported stands where a plain evaluator of its description says.

use std::path::Path;

use crate::common::folder::Folder;
use kincal::Chain;
use kincal::import::{Ends, open, read};
use nalgebra::{Isometry3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

fn arm() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/urdf/arm.urdf")
}

/// `xyz` and `rpy` as URDF means them, by nalgebra's own Euler angles.
fn origin(xyz: [f64; 3], [r, p, y]: [f64; 3]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_euler_angles(r, p, y));
    Isometry3::from_parts(Translation3::from(Vector3::from(xyz)), turn)
}

fn about(axis: [f64; 3], angle: f64) -> Isometry3<f64> {
    let axis = Unit::new_normalize(Vector3::from(axis));
    Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&axis, angle))
}

#[test]
fn an_imported_arm_stands_where_its_urdf_says() {
    let arm = open(arm(), &Ends::default().with_tip("finger")).expect("a sound file");
    assert_eq!(arm.machine.commands(), ["lift_1", "shoulder", "elbow"]);
    for [lift, shoulder, elbow] in [[0.0; 3], [0.3, -1.2, 0.7], [-0.1, 3.0, -2.0]] {
        let expected = origin([0.1, -0.2, 0.3], [0.3, -0.4, 1.5312])
            * origin([0.0, 0.0, lift], [0.0; 3])
            * origin([0.0, 0.2, 0.0], [-3.0, 0.1, 0.0])
            * about([1.0, 0.0, 0.0], shoulder)
            * origin([0.3, 0.0, 0.05], [0.0, 0.0, std::f64::consts::PI])
            * about([1.0, -2.0, 0.5], elbow)
            * origin([0.25, 0.0, 0.0], [0.0, 1.0, 0.0])
            * about([0.0, -1.0, 0.0], -0.5 * elbow + 0.2)
            * origin([0.0, 0.01, 0.12], [0.1, 0.2, 0.3]);
        let pose = Chain::nominal(&arm.machine).w_from_t(&[lift, shoulder, elbow]);
        let expected = expected.to_homogeneous();
        // Rounding of a dozen products of numbers of size 1.
        for i in 0..3 {
            assert!((pose.translation.0[i] - expected[(i, 3)]).abs() < 1e-14);
            for j in 0..3 {
                assert!((pose.rotation.0[i][j] - expected[(i, j)]).abs() < 1e-14);
            }
        }
    }
}

#[test]
fn a_chain_between_two_ends_is_the_one_from_the_root_seen_from_the_other() {
    let whole = |tip: &str| open(arm(), &Ends::default().with_tip(tip)).expect("sound").machine;
    let ends = Ends::default().with_base("weight").with_tip("finger");
    let between = open(arm(), &ends).expect("sound").machine;
    let b_from_weight = Chain::nominal(&whole("weight")).w_from_t(&[0.2]);
    let b_from_finger = Chain::nominal(&whole("finger")).w_from_t(&[0.2, 0.4, -0.3]);
    let expected = b_from_weight.inverse() * b_from_finger;
    let found = Chain::nominal(&between).w_from_t(&[0.4, -0.3]);
    for i in 0..3 {
        assert!((expected.translation.0[i] - found.translation.0[i]).abs() < 1e-14);
    }
}

#[test]
fn masses_that_are_bolted_together_weigh_as_one() {
    let arm = open(arm(), &Ends::default().with_tip("finger")).expect("a sound file");
    let lift = arm.machine.frame_index("lift_1").expect("a frame");
    let mass = arm.machine.dyads()[lift].mass.expect("a mass");
    assert_eq!(mass.mass, 4.0);
    for (is, expected) in mass.centre.0.iter().zip([0.2, 0.0, 0.1]) {
        assert!((is - expected).abs() < 1e-15);
    }
}

#[test]
fn the_file_of_an_imported_machine() {
    let arm = open(arm(), &Ends::default().with_tip("finger")).expect("a sound file");
    insta::assert_snapshot!(arm.text);
}

#[test]
fn a_prefix_that_nobody_declares_is_no_fault() {
    let text = std::fs::read_to_string(arm())
        .expect("a file")
        .replace("<link name=\"floor\"/>", "<link name=\"floor\"><sensor:camera a:b=\"1\"/></link>");
    let ends = Ends::default().with_tip("finger");
    assert_eq!(
        read("arm.urdf", &text, &ends).expect("sound").machine,
        open(arm(), &ends).expect("sound").machine
    );
}

/// Every file of `tests/bad/imports` with what is said of it.
#[test]
fn what_cannot_be_imported_is_told_with_its_place_and_mend() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad/imports");
    let mut names: Vec<String> = std::fs::read_dir(folder.clone())
        .expect("a folder")
        .map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    let mut said = String::new();
    for name in names {
        let text = std::fs::read_to_string(folder.join(&name)).expect("a text");
        let error = read(&name, &text, &Ends::default()).expect_err(&name);
        assert!(!error.mend().is_empty(), "{name}");
        said.push_str(&format!("{error}\n  = {}\n", error.mend()));
    }
    insta::assert_snapshot!(said);
}

#[test]
fn no_beginning_of_a_file_and_no_gap_in_it_makes_the_reader_panic() {
    let text = std::fs::read_to_string(arm()).expect("a file");
    let ends = Ends::default().with_tip("finger");
    let mut refused = 0;
    for at in 0..text.len() {
        refused += usize::from(read("arm.urdf", &text[..at], &ends).is_err());
        let gap = format!("{}{}", &text[..at], &text[(at + 9).min(text.len())..]);
        let _ = read("arm.urdf", &gap, &ends);
    }
    // All but the text whose last line break alone is missing.
    assert_eq!(refused, text.len() - 1);
}

#[test]
fn limits_the_wrong_way_round_are_told_and_left_out() {
    let text = std::fs::read_to_string(arm()).expect("a file");
    let limit = |lower: &str, upper: &str| {
        let own = "<limit lower=\"0\" upper=\"1\" effort=\"1\" velocity=\"1\"/>";
        let robot = format!(
            "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><joint name=\"j\" type=\"prismatic\"><parent link=\"a\"/><child link=\"b\"/>{own}</joint></robot>"
        );
        let robot = robot.replace("lower=\"0\" upper=\"1\"", &format!("lower=\"{lower}\" upper=\"{upper}\""));
        read("r.urdf", &robot, &Ends::default()).expect("a machine")
    };
    let is_told = |told: &[String]| told.iter().any(|line| line.contains("above the upper one"));
    assert!(is_told(&limit("0.5", "-0.5").told));
    assert!(!is_told(&limit("-0.5", "0.5").told) && !is_told(&limit("0", "0").told));
    assert!(!is_told(&read("arm.urdf", &text, &Ends::default().with_tip("finger")).expect("an arm").told));
}

#[test]
fn a_description_is_read_whatever_its_encoding() {
    let folder = Folder::new("encodings");
    let text = std::fs::read_to_string(arm()).expect("a file");
    let ends = Ends::default().with_tip("finger");
    let plain = read("arm.urdf", &text, &ends).expect("an arm").machine;
    let wide: Vec<u8> = [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let file = folder.path("wide.urdf");
    std::fs::write(&file, wide).expect("written");
    assert_eq!(open(&file, &ends).expect("an arm").machine, plain);
}

//! What is exported moves as the calibrated machine does.

use std::path::{Path, PathBuf};

use crate::common::random::Random;
use kincal::export::{BaseFile, ExportOptions, Format, export};
use kincal::import::{Ends, read};
use kincal::lie::{Pose, Twist};
use kincal::{CalibratedMachine, Chain, Machine};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Every machine that comes with the program, with deviations of some tenths of a millimetre and a milliradian.
fn machines() -> Vec<CalibratedMachine> {
    let mut rng = Random::new(7);
    let mut names: Vec<PathBuf> = std::fs::read_dir(folder("machines"))
        .expect("a folder")
        .map(|e| e.expect("readable").path())
        .collect();
    names.sort();
    let calibrated = |path: PathBuf| {
        let machine = Machine::open(path).expect("a machine");
        let deviations = deviations(machine.dyads().len(), &mut rng);
        CalibratedMachine::nominal(machine).with_deviations(deviations)
    };
    names.into_iter().map(calibrated).collect()
}

fn deviations(count: usize, rng: &mut Random) -> Vec<Twist<f64>> {
    (0..count).map(|_| Twist::from_array(std::array::from_fn(|_| rng.between(-1e-3, 1e-3)))).collect()
}

fn commands(machine: &Machine, rng: &mut Random) -> Vec<f64> {
    machine.commands().iter().map(|_| rng.between(-2.0, 2.0)).collect()
}

/// Largest difference of two poses, m and of rotation matrices.
fn gap(a: Pose<f64>, b: Pose<f64>) -> f64 {
    let rotation = a.rotation.0.iter().flatten().zip(b.rotation.0.iter().flatten());
    rotation.chain(a.translation.0.iter().zip(&b.translation.0)).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

#[test]
fn a_urdf_file_read_back_is_the_same_machine() {
    let mut rng = Random::new(3);
    let mut compared = 0;
    for calibrated in machines() {
        let machine = calibrated.machine();
        let Ok(exported) = export(&calibrated, Format::Urdf, &ExportOptions::default()) else {
            assert!(
                machine.name().contains("justin") || machine.name().contains("jaibot"),
                "{}",
                machine.name()
            );
            continue;
        };
        let ends = Ends::default().with_base("w").with_tip("t");
        let back = read("back.urdf", &exported.text, &ends).expect("sound").machine;
        assert_eq!(back.commands(), machine.commands());
        for _ in 0..20 {
            let q = commands(machine, &mut rng);
            let gap = gap(calibrated.chain().w_from_t(&q), Chain::nominal(&back).w_from_t(&q));
            assert!(gap < 1e-12, "{}: {gap:e}", machine.name());
        }
        compared += 1;
    }
    assert!(compared > 15, "{compared}");
}

#[test]
fn tags_of_a_base_file_that_say_where_a_switch_is_stay() {
    const TAG: &str = "<calibration rising=\"0.25\"/>";
    let text = std::fs::read_to_string(folder("tests/urdf/arm.urdf")).expect("a text");
    assert!(text.contains("</joint>") && !text.contains("<calibration"));
    let text = text.replace("</joint>", &format!("{TAG}</joint>"));
    let ends = Ends::default().with_tip("finger");
    let machine = read("arm.urdf", &text, &ends).expect("sound").machine;
    let deviations = deviations(machine.dyads().len(), &mut Random::new(8));
    let calibrated = CalibratedMachine::nominal(machine).with_deviations(deviations);
    let base = BaseFile::new("arm.urdf", text.clone(), ends);
    let exported =
        export(&calibrated, Format::Urdf, &ExportOptions::default().with_base_file(base)).expect("a file");
    assert_ne!(exported.text, text);
    assert_eq!(exported.text.matches(TAG).count(), text.matches(TAG).count());
    // And a new file has none.
    let new = export(&calibrated, Format::Urdf, &ExportOptions::default()).expect("a file");
    assert!(!new.text.contains("calibration rising"));
}

#[test]
fn a_base_file_keeps_every_byte_but_its_origins() {
    let path = folder("tests/urdf/arm.urdf");
    let ends = Ends::default().with_tip("finger");
    let text = std::fs::read_to_string(&path).expect("a text");
    let mut rng = Random::new(5);
    let mut before = String::new();
    // As it stands; with what stands before the first element, a prefix that nobody declares, and origins that are not there.
    for round in 0..3 {
        let text = match round {
            0 => text.clone(),
            1 => format!(
                "\u{feff}\n\n{}",
                text.replace("<link name=\"floor\"/>", "<link name=\"floor\"><x:y z:a=\"1\"/></link>")
            ),
            _ => text.replace("<origin xyz=\"0.3 0 0.05\"", "<origin").replace(" rpy=\"0.1 0.2 0.3\"", ""),
        };
        assert_ne!(text, before);
        before.clone_from(&text);
        let machine = read(&path, &text, &ends).expect("sound").machine;
        let deviations = deviations(machine.dyads().len(), &mut rng);
        let calibrated = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations);
        let mut options = ExportOptions::default();
        options.base_file = Some(BaseFile::new(path.clone(), text.clone(), ends.clone()));
        let exported = export(&calibrated, Format::Urdf, &options).expect("sound");
        let back = read(&path, &exported.text, &ends).expect("sound").machine;
        for _ in 0..20 {
            let q = commands(&machine, &mut rng);
            let gap = gap(calibrated.chain().w_from_t(&q), Chain::nominal(&back).w_from_t(&q));
            assert!(gap < 1e-12, "{gap:e}");
        }
        // Outside of quotes of origins nothing has changed.
        let bare = |text: &str| -> String {
            let mut parts = text.split("<origin");
            let first = parts.next().unwrap_or_default().to_string();
            parts.fold(first, |out, part| out + part.split_once('>').map_or("", |(_, rest)| rest))
        };
        assert_eq!(bare(&exported.text), bare(&text));
        // Without deviations every byte is as it was.
        let nominal = export(&CalibratedMachine::nominal(machine), Format::Urdf, &options).expect("sound");
        assert_eq!(nominal.text, text);
    }
}

/// Rows of a table with a head: what stands after `name` in a line of comments, and the rows.
fn numbers(text: &str) -> Vec<f64> {
    text.split(',').map(|cell| cell.trim().parse().expect("a number")).collect()
}

fn placed(text: &str, head: &str) -> Pose<f64> {
    let line = text.lines().find_map(|line| line.strip_prefix(head)).expect("in the file");
    let six = numbers(line);
    let turn = Pose::exp(Twist::from_array([0.0, 0.0, 0.0, six[3], six[4], six[5]]));
    Pose { rotation: turn.rotation, translation: kincal::lie::Vec3([six[0], six[1], six[2]]) }
}

#[test]
fn a_chain_rebuilt_from_its_dh_table_is_the_same_machine() {
    let mut rng = Random::new(11);
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(kincal::lie::Vec3);
    let mut second_turns = 0;
    for calibrated in machines() {
        let machine = calibrated.machine();
        for (format, modified) in [(Format::Dh, false), (Format::Mdh, true)] {
            let text = export(&calibrated, format, &ExportOptions::default()).expect("a table").text;
            let rows: Vec<Vec<&str>> = (text.lines().filter(|line| !line.starts_with('#')).skip(1))
                .map(|line| line.split(',').collect())
                .collect();
            assert_eq!(rows.len(), machine.joints().count());
            second_turns += rows.iter().filter(|row| row[7] != "0").count();
            for _ in 0..20 {
                let q = commands(machine, &mut rng);
                let displacements = machine.displacements(&q);
                let joints = rows.iter().map(|row| {
                    let n = |i: usize| row[i].parse::<f64>().expect("a number");
                    let (j, _) = machine.joints().find(|(_, joint)| joint.name == row[0]).expect("a joint");
                    let s = displacements[j];
                    let turns = row[1] == "revolute";
                    let (theta, d) = if turns { (n(3) + s, n(4)) } else { (n(3), n(4) + s) };
                    let own = Pose::turn(z, theta) * Pose::translation(z.times(d));
                    let link = Pose::translation(x.times(n(5))) * Pose::turn(x, n(6)) * Pose::turn(y, n(7));
                    if modified { link * own } else { own * link }
                });
                let chain = joints.fold(placed(&text, "# base[m,rad]: "), |pose, joint| pose * joint);
                let gap = gap(chain * placed(&text, "# tool[m,rad]: "), calibrated.chain().w_from_t(&q));
                assert!(gap < 1e-12, "{} {format}: {gap:e}", machine.name());
            }
        }
    }
    // Machine tools have axes that are nearly parallel.
    assert!(second_turns > 20, "{second_turns}");
}

#[test]
fn a_dh_table_read_back_is_the_same_machine() {
    let mut rng = Random::new(13);
    for calibrated in machines() {
        let machine = calibrated.machine();
        for format in [Format::Dh, Format::Mdh] {
            let text = export(&calibrated, format, &ExportOptions::default()).expect("a table").text;
            let back = read("back.csv", &text, &Ends::default()).expect("sound").machine;
            assert_eq!(back.name(), machine.name());
            for _ in 0..20 {
                let q = commands(machine, &mut rng);
                // Joints that carry the workpiece stand first, the outermost first: the order of commands differs.
                let of = |name: &String| {
                    q[machine.commands().iter().position(|own| own == name).expect("a command")]
                };
                let theirs: Vec<f64> = back.commands().iter().map(of).collect();
                assert_eq!(theirs.len(), q.len());
                let gap = gap(calibrated.chain().w_from_t(&q), Chain::nominal(&back).w_from_t(&theirs));
                assert!(gap < 1e-12, "{} {format}: {gap:e}", machine.name());
            }
            for (_, joint) in machine.joints() {
                let own = back.joints().find(|(_, own)| own.name == joint.name).expect("a joint").1;
                assert_eq!((own.kind, own.travel), (joint.kind, joint.travel));
            }
        }
    }
}

/// The displacement of every joint of a model that is named as one of the machine, for these commands.
fn displaced(machine: &Machine, back: &Machine, q: &[f64]) -> Vec<f64> {
    let all = machine.displacements(q);
    let of = |name: &String| machine.joints().find(|(_, joint)| joint.name == *name).map(|(j, _)| all[j]);
    back.commands().iter().map(|name| of(name).expect("a joint of the machine")).collect()
}

#[test]
fn a_model_of_mujoco_read_back_is_the_same_machine() {
    let mut rng = Random::new(17);
    for calibrated in machines() {
        let machine = calibrated.machine();
        let exported = export(&calibrated, Format::Mjcf, &ExportOptions::default()).expect("a model");
        let ends = Ends::default().with_base("w").with_tip("t");
        let back = read("back.xml", &exported.text, &ends).expect("sound").machine;
        assert_eq!(back.commands().len(), machine.joints().count(), "{}", machine.name());
        for _ in 0..20 {
            let q = commands(machine, &mut rng);
            let theirs = displaced(machine, &back, &q);
            let gap = gap(calibrated.chain().w_from_t(&q), Chain::nominal(&back).w_from_t(&theirs));
            assert!(gap < 1e-12, "{}: {gap:e}", machine.name());
        }
        // Tendons hold joints that follow others; each leader is there with its factor.
        for (_, joint) in machine.joints().filter(|(_, joint)| joint.follows.is_some()) {
            let own = joint.follows.as_ref().is_some_and(|leaders| leaders.contains_key(&joint.name));
            let drive = format!("<fixed name=\"drive of {}\">", joint.name);
            assert_eq!(exported.text.contains(&drive), !own, "{}", joint.name);
        }
    }
}

#[test]
fn play_is_a_coupling_of_its_width_and_what_mujoco_cannot_hold_is_listed() {
    let exported = export(&lift(), Format::Mjcf, &ExportOptions::default()).expect("a model");
    let number = exported.numbers.first().expect("play");
    assert_eq!((number.name.as_str(), number.unit.as_str()), ("play of z", "m"));
    assert!((number.value.expect("a width") - 6e-6).abs() < 1e-15, "{number:?}");
    assert!(
        exported.text.contains("<fixed name=\"play of z\" limited=\"true\" range=\"-3"),
        "{}",
        exported.text
    );
    assert_eq!(
        exported.left_out.iter().map(|left| left.what.as_str()).collect::<Vec<_>>(),
        ["scale_error at z"]
    );
}

/// A lift with a position error and play, as `diagnose` would write them.
fn lift() -> CalibratedMachine {
    CalibratedMachine::open(folder("tests/exports/lift.ron")).expect("sound")
}

#[test]
fn a_table_holds_the_position_error_of_either_direction() {
    let text = export(&lift(), Format::Table, &ExportOptions::default()).expect("curves").text;
    let mut rows = 0;
    for line in text.lines().filter(|line| line.starts_with("z,")) {
        let cell: Vec<&str> = line.split(',').collect();
        let n = |i: usize| cell[i].parse::<f64>().expect("a number");
        // 40 um a metre, and 6 um of play.
        let slope = 40.0 * n(1) / 1e3;
        assert!((n(3) - (slope - 3.0)).abs() < 1e-3 && (n(4) - (slope + 3.0)).abs() < 1e-3, "{line}");
        assert_eq!((cell[2], cell[5]), ("mm", "um"));
        rows += 1;
    }
    assert_eq!(rows, 21);
}

#[test]
fn compensation_files_have_the_signs_of_their_controls() {
    // Commanded position, then where the axis is.
    let comp = export(&lift(), Format::LinuxCncComp, &ExportOptions::default()).expect("one axis").text;
    let rows: Vec<Vec<f64>> =
        comp.lines().map(|l| l.split(' ').map(|c| c.parse().expect("a number")).collect()).collect();
    assert_eq!(rows.len(), 21);
    for row in &rows {
        let slope = 40e-6 * row[0];
        assert!(
            (row[1] - (row[0] + slope - 3e-3)).abs() < 2e-6
                && (row[2] - (row[0] + slope + 3e-3)).abs() < 2e-6
        );
    }
    assert!(rows.windows(2).all(|pair| pair[0][0] < pair[1][0]));
    // A positive value moves the axis in the negative direction: where the axis is too far, the value is positive.
    let siemens = export(&lift(), Format::EncComp, &ExportOptions::default()).expect("one axis").text;
    let value = |name: &str| -> f64 {
        let line = siemens.lines().find_map(|line| line.strip_prefix(name)).expect(name);
        line.trim_start_matches('=').parse().expect("a number")
    };
    let (min, step) = (value("$AA_ENC_COMP_MIN[0,Z1]"), value("$AA_ENC_COMP_STEP[0,Z1]"));
    for i in 0..21 {
        let at = min + step * f64::from(i);
        assert!((value(&format!("$AA_ENC_COMP[0,{i},Z1]")) - 40e-6 * at).abs() < 2e-6, "{i}");
    }
    assert!(siemens.ends_with("M17\n"));
}

/// Every call that is refused, with what is said of it.
#[test]
fn what_cannot_be_exported_is_told_with_its_mend() {
    let mut said = String::new();
    let mut refuse = |calibrated: &CalibratedMachine, format: Format, options: &ExportOptions| {
        let error = export(calibrated, format, options).expect_err(calibrated.machine().name());
        assert!(!error.mend().is_empty());
        said.push_str(&format!("--to {format}: {error}\n  = {}\n", error.mend()));
    };
    let none = ExportOptions::default();
    let shipped = |name: &str| CalibratedMachine::open(folder("machines").join(name)).expect("a machine");
    refuse(&shipped("six_r_arm.ron"), Format::Iso230, &none);
    refuse(&shipped("six_r_arm.ron"), Format::Siemens, &none);
    refuse(&shipped("bc_nutating_table.ron"), Format::Heidenhain, &none);
    refuse(&shipped("xyz_mill.ron"), Format::Table, &none);
    refuse(&shipped("xyz_mill.ron"), Format::EncComp, &none);
    refuse(&shipped("xyz_mill.ron"), Format::Fanuc, &none);
    refuse(&shipped("four_axis_horizontal.ron"), Format::LinuxCnc, &none);
    refuse(&shipped("dlr_justin_left.ron"), Format::Urdf, &none);
    let mut other = ExportOptions::default();
    other.axis = Some("w".into());
    refuse(&lift(), Format::LinuxCncComp, &other);
    let play = "(effect: \"scale_error\"";
    let text = std::fs::read_to_string(folder("tests/exports/lift.ron")).expect("a text");
    let text: String =
        text.lines().filter(|line| !line.contains(play)).flat_map(|line| [line, "\n"]).collect();
    refuse(&CalibratedMachine::parse("lift.ron", &text).expect("sound"), Format::EncComp, &none);
    // Base files that are not the machine's.
    let ends = Ends::default().with_tip("finger");
    let text = std::fs::read_to_string(folder("tests/urdf/arm.urdf")).expect("a text");
    let machine = read("arm.urdf", &text, &ends).expect("sound").machine;
    let arm = CalibratedMachine::nominal(machine);
    let based = |text: String, tip: &str| {
        let mut options = ExportOptions::default();
        let ends = Ends::default().with_tip(tip);
        options.base_file = Some(BaseFile::new("robot.urdf", text, ends));
        options
    };
    refuse(&arm, Format::Urdf, &based(text.clone(), "lower"));
    refuse(&arm, Format::Urdf, &based(text.replace("0.3 0 0.05", "0.3 0 0.06"), "finger"));
    refuse(&arm, Format::Urdf, &based(text.replace("1 -2 0.5", "1 -2 0.6"), "finger"));
    refuse(&arm, Format::Urdf, &based(text.replace("</robot>", ""), "finger"));
    let entity = text.replace("\"0.3 0 0.05\"", "\"&o;\"");
    let entity = entity.replace("<robot", "<!DOCTYPE robot [<!ENTITY o \"0.3 0 0.05\">]>\n<robot");
    let mut moved = Random::new(1);
    let deviations = deviations(arm.machine().dyads().len(), &mut moved);
    let arm = arm.with_deviations(deviations);
    let options = based(entity.clone(), "finger");
    let kept = export(&arm, Format::Urdf, &options).expect("the reference is replaced").text;
    assert!(kept.contains("<!ENTITY o \"0.3 0 0.05\">") && !kept.contains("&o;"), "{kept}");
    insta::assert_snapshot!(said);
}

//! A machine of LinuxCNC has the tool tip that its kinematics module has.

use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

use kincal::import::{Beside, Ends, Form, ImportOptions, Imported, open, open_with, read, read_with};
use kincal::lie::{Pose, Vec3};
use kincal::machine::JointKind;
use kincal::{Chain, Machine};

fn ini() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/linuxcnc/trunnion.ini")
}

/// What a module makes of joint positions: mm and deg, `ALPHA` in rad; of serial arms also roll, pitch and yaw.
struct Row {
    module: &'static str,
    pins: &'static [(&'static str, f64)],
    joints: &'static [(&'static str, f64)],
    world: [f64; 3],
    turned: Option<[f64; 3]>,
}

/// Computed by the modules of LinuxCNC 2.9 as installed. Those of maxkins had U, V and W, which move the head: they are taken into the other
/// joints and the pivot length.
const ROWS: [Row; 12] = [
    Row {
        module: "xyzac-trt-kins",
        pins: &[
            ("x-rot-point", 0.0),
            ("y-rot-point", 0.0),
            ("z-rot-point", 0.0),
            ("y-offset", 20.0),
            ("z-offset", 10.0),
            ("tool-offset", 0.0),
        ],
        joints: &[
            ("x", -38.764708),
            ("y", -85.808993),
            ("z", 294.889874),
            ("a", 76.973275),
            ("c", -213.124714),
        ],
        world: [182.03632150178018, -208.0425924465549, 177.30175060058696],
        turned: None,
    },
    Row {
        module: "xyzac-trt-kins",
        pins: &[
            ("x-rot-point", 13.8039),
            ("y-rot-point", -38.7102),
            ("z-rot-point", -22.6735),
            ("y-offset", -31.8068),
            ("z-offset", 6.8595),
            ("tool-offset", 93.1037),
        ],
        joints: &[
            ("x", 19.358704),
            ("y", 80.004266),
            ("z", -114.425456),
            ("a", 25.578208),
            ("c", -282.663434),
        ],
        world: [35.697437729446726, -39.48425348232084, -160.623217221264],
        turned: None,
    },
    Row {
        module: "xyzbc-trt-kins",
        pins: &[
            ("x-rot-point", 0.0),
            ("y-rot-point", 0.0),
            ("z-rot-point", 0.0),
            ("x-offset", 20.0),
            ("z-offset", 10.0),
            ("tool-offset", 0.0),
        ],
        joints: &[
            ("x", -224.837674),
            ("y", 195.985506),
            ("z", -97.292469),
            ("b", 107.879772),
            ("c", 155.956559),
        ],
        world: [-100.3138495021013, -259.35911790645196, -190.0717106420864],
        turned: None,
    },
    Row {
        module: "xyzbc-trt-kins",
        pins: &[
            ("x-rot-point", -31.951),
            ("y-rot-point", -24.8131),
            ("z-rot-point", -0.8498),
            ("x-offset", 35.2441),
            ("z-offset", 52.0764),
            ("tool-offset", 165.5842),
        ],
        joints: &[
            ("x", -238.510629),
            ("y", 110.041445),
            ("z", -23.628922),
            ("b", -106.893823),
            ("c", -165.222161),
        ],
        world: [54.08300543065011, -186.976514910468, 518.0510215458236],
        turned: None,
    },
    Row {
        module: "xyzab_tdr_kins",
        pins: &[
            ("x-rot-point", 0.0),
            ("y-rot-point", 0.0),
            ("z-rot-point", 0.0),
            ("x-offset", 20.0),
            ("z-offset", 10.0),
            ("tool-offset-z", 0.0),
        ],
        joints: &[
            ("x", -290.489389),
            ("y", 248.456072),
            ("z", 159.535593),
            ("a", 56.733246),
            ("b", 270.295448),
        ],
        world: [-161.03138560901218, 386.8433958945573, 53.364129743887],
        turned: None,
    },
    Row {
        module: "xyzab_tdr_kins",
        pins: &[
            ("x-rot-point", 15.914),
            ("y-rot-point", 50.2569),
            ("z-rot-point", -7.8851),
            ("x-offset", -5.8704),
            ("z-offset", 39.6147),
            ("tool-offset-z", 109.6511),
        ],
        joints: &[("x", -253.492257), ("y", -290.987), ("z", 153.707894), ("a", -0.909367), ("b", 99.085355)],
        world: [109.74501844745312, -287.48086186083503, 364.978744447277],
        turned: None,
    },
    Row {
        module: "5axiskins",
        pins: &[("pivot-length", 250.0)],
        joints: &[
            ("x", 87.490948),
            ("y", 255.901858),
            ("z", 119.876553),
            ("b", -62.37642),
            ("c", -237.255213),
            ("joint_w", -3.017259),
        ],
        world: [205.85558031849902, 71.84662281681241, 255.36035951785038],
        turned: None,
    },
    Row {
        module: "5axiskins",
        pins: &[("pivot-length", 187.3456)],
        joints: &[
            ("x", -170.831371),
            ("y", -85.904567),
            ("z", -176.126716),
            ("b", 49.683584),
            ("c", -171.853972),
            ("joint_w", -30.107632),
        ],
        world: [-289.51296074212866, -102.89274252110332, -90.51538126748139],
        turned: None,
    },
    Row {
        module: "maxkins",
        pins: &[("pivot-length", 267.012386)],
        joints: &[
            ("x", -444.4679189060387),
            ("y", -41.098673286930946),
            ("z", -113.34486287120019),
            ("b", 34.208335),
            ("c", 192.772273),
        ],
        world: [277.98329, 105.156203, -67.151399],
        turned: None,
    },
    Row {
        module: "maxkins",
        pins: &[("pivot-length", 190.515214)],
        joints: &[
            ("x", 67.93527915984092),
            ("y", 118.30955142954838),
            ("z", -74.9689398699329),
            ("b", 34.417823),
            ("c", -155.455519),
        ],
        world: [-110.60415, -180.571036, -41.616910999999995],
        turned: None,
    },
    Row {
        module: "genserkins",
        pins: &[
            ("A-0", 0.0),
            ("A-1", 0.0),
            ("A-2", 300.0),
            ("A-3", 50.0),
            ("A-4", 0.0),
            ("A-5", 0.0),
            ("ALPHA-0", 0.0),
            ("ALPHA-1", -FRAC_PI_2),
            ("ALPHA-2", 0.0),
            ("ALPHA-3", -FRAC_PI_2),
            ("ALPHA-4", FRAC_PI_2),
            ("ALPHA-5", -FRAC_PI_2),
            ("D-0", 0.0),
            ("D-1", 0.0),
            ("D-2", 70.0),
            ("D-3", 400.0),
            ("D-4", 0.0),
            ("D-5", 0.0),
        ],
        joints: &[
            ("j0", -47.962708),
            ("j1", -58.022775),
            ("j2", 70.889854),
            ("j3", -96.027995),
            ("j4", 103.448595),
            ("j5", 27.067559),
        ],
        world: [131.36777980286791, -41.17005623692093, -146.61262195382474],
        turned: Some([49.24788128027382, 71.79076044521545, -78.37096299570514]),
    },
    Row {
        module: "genserkins",
        pins: &[
            ("A-0", -4.657),
            ("A-1", -3.6201),
            ("A-2", 301.9786),
            ("A-3", 45.87),
            ("A-4", 3.4277),
            ("A-5", -0.6948),
            ("ALPHA-0", 0.0047516),
            ("ALPHA-1", -1.5730027),
            ("ALPHA-2", 0.0092691),
            ("ALPHA-3", -1.5721682),
            ("ALPHA-4", 1.5770282),
            ("ALPHA-5", -1.5739017),
            ("D-0", -4.1809),
            ("D-1", -1.3995),
            ("D-2", 67.1898),
            ("D-3", 395.3175),
            ("D-4", 0.1025),
            ("D-5", 3.8422),
        ],
        joints: &[
            ("j0", -82.891221),
            ("j1", -41.457088),
            ("j2", -100.758695),
            ("j3", 145.107758),
            ("j4", -98.719509),
            ("j5", -128.73419),
        ],
        world: [109.57858529046896, -424.67993551042827, 530.9888397536346],
        turned: Some([-151.73785820014015, -44.878276447706924, -165.47851137717578]),
    },
];

fn with(module: &str, pins: &[(&str, f64)]) -> kincal::Result<Imported> {
    let text = format!(
        "[EMC]\nMACHINE = test\n[KINS]\nKINEMATICS = {module}\n[TRAJ]\nLINEAR_UNITS = mm\nANGULAR_UNITS = degree\n[HAL]\nHALFILE = m.hal\n"
    );
    let hal: String = pins.iter().map(|(pin, value)| format!("setp {module}.{pin} {value:?}\n")).collect();
    let mut options = ImportOptions::default();
    options.beside = vec![Beside::new("m.hal", hal)];
    read_with("test.ini", &text, &options)
}

fn commands(machine: &Machine, joints: &[(&str, f64)]) -> Vec<f64> {
    let of = |(c, name): (usize, &String)| {
        let value = joints.iter().find(|(own, _)| own == name).map_or(0.0, |(_, value)| *value);
        match machine.command_joint(c).kind {
            JointKind::Prismatic => value * 1e-3,
            JointKind::Revolute => value.to_radians(),
        }
    };
    machine.commands().iter().enumerate().map(of).collect()
}

#[test]
fn an_imported_machine_has_the_tool_tip_of_its_module() {
    for row in &ROWS {
        let machine = with(row.module, row.pins).expect(row.module).machine;
        let pose = Chain::nominal(&machine).w_from_t(&commands(&machine, row.joints));
        let named = |name: &&(&str, f64)| machine.commands().iter().any(|own| own == name.0);
        assert_eq!(row.joints.iter().filter(named).count(), row.joints.len(), "{}", row.module);
        for k in 0..3 {
            let off = 1e3 * pose.translation.0[k] - row.world[k];
            assert!(off.abs() < 1e-9, "{}: {off:e} mm", row.module);
        }
        let Some([a, b, c]) = row.turned.map(|turned| turned.map(f64::to_radians)) else { continue };
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3);
        let turned = Pose::turn(z, c) * Pose::turn(y, b) * Pose::turn(x, a);
        for (is, expected) in pose.rotation.0.iter().flatten().zip(turned.rotation.0.iter().flatten()) {
            assert!((is - expected).abs() < 1e-12, "{}", row.module);
        }
    }
}

#[test]
fn a_module_that_counts_conventionally_turns_its_tables_the_other_way() {
    let row = &ROWS[0];
    let pins: Vec<_> = row.pins.iter().copied().chain([("conventional-directions", 1.0)]).collect();
    let (own, other) = (with(row.module, row.pins).expect("sound"), with(row.module, &pins).expect("sound"));
    let back: Vec<_> =
        row.joints.iter().map(|(name, x)| (*name, if ["a", "c"].contains(name) { -x } else { *x })).collect();
    let tip = |machine: &Machine, joints: &[(&str, f64)]| {
        Chain::nominal(machine).w_from_t(&commands(machine, joints)).translation
    };
    assert_eq!(tip(&own.machine, row.joints), tip(&other.machine, &back));
}

#[test]
fn the_file_of_a_machine_of_linuxcnc() {
    let imported = open(ini(), &Ends::default()).expect("sound");
    assert_eq!(imported.beside.len(), 1);
    assert_eq!(imported.machine.commands(), ["a", "c", "x", "y", "z"]);
    insta::assert_snapshot!(imported.text);
}

#[test]
fn the_tip_is_below_the_gauge_line_by_the_length_of_the_tool() {
    let mut options = ImportOptions::default();
    options.tool_length = 0.12;
    let (short, long) =
        (open(ini(), &Ends::default()).expect("sound"), open_with(ini(), &options).expect("sound"));
    let at = [0.3, -0.7, 0.1, 0.2, -0.05];
    let [short, long] = [short, long].map(|m| Chain::nominal(&m.machine).w_from_t(&at));
    // The part is set up where the tip is with all joints at zero, so that the frame goes down with it.
    let tip = short.transform(Vec3([0.0, 0.0, -0.12])) + Vec3([0.0, 0.0, 0.12]);
    assert!((tip - long.translation).norm() < 1e-15);
}

#[test]
fn trivial_kinematics_are_the_linear_axes() {
    let mill = with("trivkins coordinates=xyyz", &[]).expect("sound");
    assert_eq!(mill.machine.commands(), ["x", "y", "z"]);
    let with_a = with("trivkins coordinates=xyza", &[]).expect("sound");
    assert_eq!(with_a.machine.commands(), ["x", "y", "z"]);
    assert!(with_a.told.iter().any(|line| line.starts_with("left out: A;")), "{:?}", with_a.told);
}

/// What is refused for its HAL files, with what is said.
#[test]
fn pins_that_are_not_known_are_told_with_their_mend() {
    let mut said = String::new();
    let mut refuse = |hal: &str, options: &mut ImportOptions| {
        let text = "[KINS]\nKINEMATICS = 5axiskins\n[TRAJ]\nLINEAR_UNITS = mm\n[PIVOT]\nL = long\n";
        options.hal = vec!["m.hal".into()];
        options.beside = vec![Beside::new("m.hal", hal)];
        let error = read_with("m.ini", text, options).expect_err(hal);
        assert!(!error.mend().is_empty());
        said.push_str(&format!("{error}\n  = {}\n", error.mend()));
    };
    let none = || ImportOptions::default();
    refuse("# setp 5axiskins.pivot-length 250\n", &mut none());
    refuse("\nsetp 5axiskins.pivot-length long\n", &mut none());
    refuse("\nsetp 5axiskins.pivot-length\n", &mut none());
    refuse("setp 5axiskins.pivot-length [PIVOT]L\n", &mut none());
    refuse("setp 5axiskins.pivot-length [PIVOT]NONE\n", &mut none());
    refuse("net pivot => 5axiskins.pivot-length\n", &mut none());
    let mut with_ends = none();
    with_ends.ends.tip = Some("hand".into());
    refuse("setp 5axiskins.pivot-length 250\n", &mut with_ends);
    let mut options = none();
    options.hal = vec!["gone.hal".into()];
    let error = read_with("m.ini", "[KINS]\nKINEMATICS = trivkins\n", &options).expect_err("no file");
    said.push_str(&format!("{error}\n  = {}\n", error.mend()));
    insta::assert_snapshot!(said);
}

#[test]
fn a_pin_that_the_module_lacks_is_told() {
    let told = |pins: &[(&str, f64)]| with("xyzac-trt-kins", pins).expect("a machine").told.join("\n");
    let misspelt = told(&[("y-offst", 20.0)]);
    assert!(misspelt.contains("xyzac-trt-kins.y-offst") && misspelt.contains("z-rot-point"), "{misspelt}");
    assert!(!told(&[("y-offset", 20.0), ("tool-offset", 10.0)]).contains("is not read"));
}

#[test]
fn a_signal_that_is_set_sets_its_pins() {
    let text = "[KINS]\nKINEMATICS = maxkins\n[TRAJ]\nLINEAR_UNITS = inch\nCOORDINATES = X Y Z B C\n";
    let mut options = ImportOptions::default();
    options.form = Some(Form::LinuxCnc);
    options.hal = vec!["m.hal".into()];
    options.beside = vec![Beside::new("m.hal", "net p maxkins.pivot-length\nsets p 10\n")];
    let machine = read_with("m.ini", text, &options).expect("sound").machine;
    assert_eq!((machine.name(), machine.commands()), ("m", &["c", "x", "y", "z", "b"].map(String::from)[..]));
    let down = FRAC_PI_2;
    let tip = Chain::nominal(&machine).w_from_t(&[0.0, 0.0, 0.0, 0.0, down]).translation;
    assert!((tip - Vec3([0.254, 0.0, 0.254])).norm() < 1e-15, "{tip:?}");
}

#[test]
fn no_beginning_of_a_configuration_and_no_gap_in_it_makes_the_reader_panic() {
    let part = |path: PathBuf| std::fs::read_to_string(path).expect("a file");
    let (text, hal) = (part(ini()), part(ini().with_extension("hal")));
    let with = |text: &str, hal: &str| {
        let mut options = ImportOptions::default();
        options.form = Some(Form::LinuxCnc);
        options.beside = vec![Beside::new("trunnion.hal", hal)];
        read_with("trunnion.ini", text, &options)
    };
    assert!(with(&text, &hal).is_ok());
    let gap = |text: &str, at: usize| format!("{}{}", &text[..at], &text[(at + 5).min(text.len())..]);
    for at in 0..text.len() {
        let _ = with(&text[..at], &hal);
        let _ = with(&gap(&text, at), &hal);
        let _ = read("trunnion.ini", &text[at..], &Ends::default());
    }
    for at in 0..hal.len() {
        let _ = with(&text, &hal[..at]);
        let _ = with(&text, &gap(&hal, at));
    }
}

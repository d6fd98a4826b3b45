//! A machine from a table of Denavit-Hartenberg parameters stands where the table says.

use std::path::{Path, PathBuf};

use kincal::import::{Ends, Form, ImportOptions, open, open_with, read, read_with};
use kincal::lie::{Pose, Vec3};
use kincal::{Chain, Machine};

fn table(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/dh").join(name)
}

fn shipped(name: &str) -> Machine {
    Machine::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("machines").join(name)).expect("a machine")
}

fn as_dh() -> ImportOptions {
    let mut options = ImportOptions::default();
    options.form = Some(Form::Dh);
    options
}

fn same(a: Pose<f64>, b: Pose<f64>) {
    let rotation = a.rotation.0.iter().flatten().zip(b.rotation.0.iter().flatten());
    for (a, b) in rotation.chain(a.translation.0.iter().zip(&b.translation.0)) {
        assert!((a - b).abs() < 1e-14, "{a} {b}");
    }
}

#[test]
fn the_table_of_a_robot_is_the_machine_that_was_written_by_hand() {
    let puma = open_with(table("puma560.csv"), &as_dh()).expect("a table").machine;
    let hand = shipped("puma560.ron");
    assert_eq!((puma.name(), puma.commands()), ("puma560", hand.commands()));
    let panda = open(table("panda.csv"), &Ends::default()).expect("a table").machine;
    assert_eq!(panda.travel(5), (-0.0175, 3.7525));
    for q in [[0.0; 7], [0.4, -1.0, 0.8, -1.7, 0.3, 2.2, -0.6]] {
        same(Chain::nominal(&puma).w_from_t(&q[..6]), Chain::nominal(&hand).w_from_t(&q[..6]));
        let franka = shipped("franka_panda.ron");
        same(Chain::nominal(&panda).w_from_t(&q), Chain::nominal(&franka).w_from_t(&q));
    }
    for c in 0..6 {
        assert_eq!(puma.travel(c), hand.travel(c));
    }
}

#[test]
fn signs_and_offsets_are_those_of_the_joint() {
    let gantry = open(table("gantry.csv"), &Ends::default()).expect("a table").machine;
    let [x, z] = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3);
    let quarter = std::f64::consts::FRAC_PI_2;
    let slide = |by: Vec3<f64>| Pose::translation(by);
    for [lift, turn] in [[0.0, 0.0], [0.3, -1.1]] {
        let expected = slide(Vec3([0.1, 0.2, 0.3]))
            * Pose::turn(z, quarter)
            * slide(z.times(0.5 + 0.02 - lift))
            * slide(x.times(0.1))
            * Pose::turn(x, -quarter)
            * Pose::turn(z, (30.0 - 15.0_f64).to_radians() - turn)
            * slide(z.times(0.04));
        same(Chain::nominal(&gantry).w_from_t(&[lift, turn]), expected);
    }
}

#[test]
fn a_table_is_of_the_convention_that_it_states() {
    let error = open_with(table("panda.csv"), &as_dh()).expect_err("Craig");
    assert!(
        error.to_string().ends_with("panda.csv:1: the table says that it is of --mdh, not of --dh"),
        "{error}"
    );
    let mut options = as_dh();
    options.ends = Ends::default().with_tip("q6");
    let error = open_with(table("puma560.csv"), &options).expect_err("no links");
    assert!(error.mend().contains("# tool[m,rad]"), "{}", error.mend());
}

#[test]
fn what_the_table_does_not_say_is_told() {
    let text = "a_m,alpha_rad,d_m\n0,pi/2,1\n1,0,0\n";
    let imported = read_with("my arm.csv", text, &as_dh()).expect("a table");
    assert_eq!(
        (imported.machine.name(), imported.machine.commands()),
        ("my_arm", &["q1".into(), "q2".into()][..])
    );
    let told = imported.told.join("\n");
    assert!(told.contains("they are called q1, q2") && told.contains("all are taken as rotary"), "{told}");
    insta::assert_snapshot!(imported.text);
}

#[test]
fn no_beginning_of_a_table_and_no_gap_in_it_makes_the_reader_panic() {
    for name in ["puma560.csv", "panda.csv", "gantry.csv"] {
        let text = std::fs::read_to_string(table(name)).expect("a file");
        for at in (0..text.len()).filter(|at| text.is_char_boundary(*at)) {
            let _ = read(name, &text[..at], &Ends::default());
            let _ = read_with(name, &text[at..], &as_dh());
            let rest = (at + 5..=text.len()).find(|end| text.is_char_boundary(*end)).unwrap_or(text.len());
            let _ = read_with(name, &format!("{}{}", &text[..at], &text[rest..]), &as_dh());
        }
    }
}

#[test]
fn headings_as_textbooks_have_them_are_understood() {
    let rows = "1,-90,0,330,theta1\n2,0,440,0,theta2-90\n";
    let plain = format!("joint,alpha[deg],a[mm],d[mm],theta[deg]\n{rows}");
    let of_joint = format!("i,alpha_i (deg),a_i (mm),d_i (mm),theta_i (deg)\n{rows}");
    let before = format!("i,alpha_{{i-1}} (deg),a_{{i-1}} (mm),d_i (mm),theta_i (deg)\n{rows}");
    let mut as_mdh = ImportOptions::default();
    as_mdh.form = Some(Form::Mdh);
    let machine =
        |text: &str, options: &ImportOptions| read_with("arm.csv", text, options).expect("a table").machine;
    for options in [as_dh(), as_mdh.clone()] {
        assert_eq!(machine(&of_joint, &options), machine(&plain, &options));
    }
    // Parameters of the link before the joint are those of the modified convention.
    assert_eq!(machine(&before, &ImportOptions::default()), machine(&plain, &as_mdh));
    let error = read_with("arm.csv", &before, &as_dh()).expect_err("standard");
    assert!(error.to_string().contains("--mdh") && error.mend().contains("--mdh"), "{error}");
}

/// A table as the block `dh` of a machine file in mm and deg.
fn block(convention: &str, rest: &str, rows: &[&str]) -> Machine {
    let rows = rows.join("), (");
    let text = format!(
        "Machine(name: \"arm\", units: (length: mm, angle: deg), dh: (convention: {convention}, rows: [({rows})]{rest}))"
    );
    Machine::parse("arm.ron", &text).expect("a machine")
}

#[test]
fn a_block_in_a_machine_file_is_the_machine_of_the_table() {
    let pi = |angle: f64| (angle / std::f64::consts::PI * 180.0).to_string();
    let panda = [
        format!("d: 333, a: 0, alpha: 0, travel: (-{0}, {0})", pi(2.8973)),
        format!("a: 0, alpha: -90, travel: (-{0}, {0})", pi(1.7628)),
        format!("d: 316, a: 0, alpha: 90, travel: (-{0}, {0})", pi(2.8973)),
        format!("a: 82.5, alpha: 90, travel: (-{}, -{})", pi(3.0718), pi(0.0698)),
        format!("d: 384, a: -82.5, alpha: -90, travel: (-{0}, {0})", pi(2.8973)),
        format!("a: 0, alpha: 90, travel: (-{}, {})", pi(0.0175), pi(3.7525)),
        format!("a: 88, alpha: 90, travel: (-{0}, {0})", pi(2.8973)),
    ];
    let panda: Vec<&str> = panda.iter().map(String::as_str).collect();
    let puma = [
        "a: 0, alpha: 90, travel: (-160, 160)",
        "a: 431.8, alpha: 0, travel: (-45, 225)",
        "d: 150.05, a: 20.3, alpha: -90, travel: (-225, 45)",
        "d: 431.8, a: 0, alpha: 90, travel: (-110, 170)",
        "a: 0, alpha: -90, travel: (-100, 100)",
        "a: 0, alpha: 0, travel: (-266, 266)",
    ];
    let gantry = [
        r#"joint: "lift", kind: prismatic, sign: -1, offset: 20, d: 500, a: 100, alpha: -90"#,
        r#"joint: "turn", sign: -1, offset: 30, theta: -15, d: 40, a: 0, alpha: 0"#,
    ];
    let base = ", base: [Tx(100), Ty(200), Tz(300), Rz(90)]";
    let pairs = [
        (
            block("modified", ", tool: [Tz(240.4), Rz(-45)]", &panda),
            open(table("panda.csv"), &Ends::default()),
        ),
        (block("classic", "", &puma), open_with(table("puma560.csv"), &as_dh())),
        (block("standard", base, &gantry), open(table("gantry.csv"), &Ends::default())),
    ];
    for (machine, imported) in pairs {
        let imported = imported.expect("a table").machine;
        assert_eq!(machine.commands(), imported.commands());
        for (i, at) in [0.0, 0.4, -1.3].into_iter().enumerate() {
            let q: Vec<f64> =
                (0..machine.commands().len()).map(|c| at * (1.0 - 0.3 * c as f64) + 0.1 * i as f64).collect();
            same(Chain::nominal(&machine).w_from_t(&q), Chain::nominal(&imported).w_from_t(&q));
        }
        for c in 0..machine.commands().len() {
            let (own, of_table) = (machine.travel(c), imported.travel(c));
            let near = |a: f64, b: f64| a == b || (a - b).abs() < 1e-14;
            assert!(near(own.0, of_table.0) && near(own.1, of_table.1), "{own:?} {of_table:?}");
        }
        // Written and read again it stands where it stood, frame by frame.
        let again = Machine::parse("again.ron", &machine.to_ron()).expect("a machine");
        assert_eq!(again, machine);
    }
}

#[test]
fn a_block_may_stand_beside_what_carries_the_workpiece() {
    let text = r#"Machine(name: "cell", units: (length: mm, angle: deg),
        workpiece: [(frame: "table", at: (800, 0, 0), joint: Revolute(axis: "z")), (frame: "w", at: (0, 0, 30))],
        dh: (convention: modified, rows: [(a: 0, alpha: 0, d: 300), (a: 200, alpha: 0)]))"#;
    let machine = Machine::parse("cell.ron", text).expect("a machine");
    assert_eq!(machine.commands(), ["table", "q1", "q2"]);
    let pose = Chain::nominal(&machine).w_from_t(&[0.0, std::f64::consts::FRAC_PI_2, 0.3]);
    let expected = Vec3([-0.8, 0.2, 0.27]);
    assert!((pose.translation - expected).norm() < 1e-15, "{pose:?}");
}

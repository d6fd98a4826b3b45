//! A machine from a model of MuJoCo stands where MuJoCo says.

use std::path::{Path, PathBuf};

use kincal::Chain;
use kincal::import::{Beside, Ends, ImportOptions, Imported, open, read, read_with};

fn arm() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mjcf/arm.xml")
}

fn to(tip: &str) -> Ends {
    Ends::default().with_base("world").with_tip(tip)
}

/// Where MuJoCo's `mj_kinematics` has a body or a site of `tests/mjcf/arm.xml`, m; joints in rad and m.
struct Row {
    tip: &'static str,
    q: &'static [f64],
    at: [f64; 3],
    turned: [[f64; 3]; 3],
}

/// Written by MuJoCo 4.0.0.
const ROWS: [Row; 10] = [
    Row {
        tip: "carriage",
        q: &[0.0, 0.0],
        at: [0.12515821618868403, -0.15687749702220535, 0.2972588514937118],
        turned: [
            [-0.04378257253088641, -0.9923633650956601, 0.11531711910464448],
            [0.08879754947249718, -0.11883645763578277, -0.9889352312180297],
            [0.9950869718523385, -0.033058250900431796, 0.09332240083252796],
        ],
    },
    Row {
        tip: "upper",
        q: &[0.0, 0.0, 0.0, 0.0],
        at: [-0.1890191917729998, -0.3553977914066232, 0.42049999219740397],
        turned: [
            [0.35285572475245375, 0.6393269067323287, 0.6831939284255186],
            [-0.7967429834326277, 0.588144007249187, -0.1388785263737467],
            [-0.49060519347057047, -0.4953258857206437, 0.7169092069953933],
        ],
    },
    Row {
        tip: "grip",
        q: &[0.0, 0.0, 0.0, 0.0],
        at: [-0.12069979893044794, -0.3692856440439979, 0.4921909128969433],
        turned: [
            [-0.38557113219650174, -0.8375268071655819, 0.38714822651761344],
            [-0.8469447906888832, 0.4877403927366758, 0.21164553106086725],
            [-0.3660866339292806, -0.24628876663806404, -0.8973975818366292],
        ],
    },
    Row {
        tip: "tip",
        q: &[0.0, 0.0, 0.0, 0.0, 0.0],
        at: [0.1240474562883308, -0.7815449883976864, 0.3185792368611974],
        turned: [
            [0.35285572475245375, -0.6393269067323287, -0.6831939284255186],
            [-0.7967429834326277, -0.588144007249187, 0.1388785263737466],
            [-0.4906051934705704, 0.4953258857206438, -0.7169092069953933],
        ],
    },
    Row {
        tip: "site:hand",
        q: &[0.0, 0.0, 0.0, 0.0, 0.0],
        at: [-0.20114939978733404, -0.4609932676218606, 0.48134778144570944],
        turned: [
            [0.5038820528864855, -0.33727425046426446, 0.7952037202834685],
            [-0.04863110750956279, 0.9080797445969427, 0.41596417253790474],
            [-0.8624023957302609, -0.24826851879873746, 0.44116306555760826],
        ],
    },
    Row {
        tip: "carriage",
        q: &[0.3, -1.2],
        at: [-0.1993886517813728, -0.4048795810806855, 0.6285056339273938],
        turned: [
            [0.3348947854000546, -0.9008867853819543, -0.2761312779024135],
            [0.8404908017088449, 0.41808175273794845, -0.3446488941958004],
            [0.42593508302871047, -0.11666468168101869, 0.8972004553574369],
        ],
    },
    Row {
        tip: "upper",
        q: &[0.3, -1.2, 0.7, 0.4],
        at: [-0.49315491055071864, -0.22326712420377606, 0.7905536016651225],
        turned: [
            [-0.13026737223913937, 0.9845079761828126, 0.11736463079791688],
            [-0.9817586556933364, -0.14461813608061586, 0.12343231622140376],
            [0.1384931539864756, -0.0991445386745549, 0.9853882517819499],
        ],
    },
    Row {
        tip: "grip",
        q: &[0.3, -1.2, 0.7, 0.4],
        at: [-0.48141844747092694, -0.21092389258163569, 0.8890924268433175],
        turned: [
            [-0.696064191034507, -0.147085661407923, 0.7027520545453212],
            [-0.6741744009108321, 0.4705503734843926, -0.5692725385702513],
            [-0.2469484138762525, -0.870027674400011, -0.42669465272265905],
        ],
    },
    Row {
        tip: "tip",
        q: &[0.3, -1.2, 0.7, 0.4, -0.05],
        at: [-0.5736599009876154, -0.6603778486588175, 1.0689341503072005],
        turned: [
            [-0.13026737223913937, -0.9845079761828126, -0.117364630797917],
            [-0.9817586556933364, 0.14461813608061586, -0.12343231622140373],
            [0.13849315398647558, 0.09914453867455501, -0.9853882517819499],
        ],
    },
    Row {
        tip: "site:hand",
        q: &[0.3, -1.2, 0.7, 0.4, -0.05],
        at: [-0.6310950757179715, -0.22263948742196513, 0.8687184471134495],
        turned: [
            [0.5948565167741164, 0.4657398018436991, 0.6551581194108457],
            [-0.7651922177474091, 0.5777510119724699, 0.2840504146513209],
            [-0.24622468265826977, -0.6702911346149356, 0.7000594264106836],
        ],
    },
];

#[test]
fn an_imported_model_stands_where_mujoco_has_it() {
    for row in &ROWS {
        let arm = open(arm(), &to(row.tip)).expect("a sound model").machine;
        assert_eq!(arm.commands(), &["slide", "swivel", "elbow", "upper_joint_2", "push"][..row.q.len()]);
        let pose = Chain::nominal(&arm).w_from_t(row.q);
        // Rounding of a dozen products of numbers of size 1.
        for i in 0..3 {
            assert!((pose.translation.0[i] - row.at[i]).abs() < 1e-14, "{} {:?}", row.tip, pose.translation);
            for j in 0..3 {
                assert!((pose.rotation.0[i][j] - row.turned[i][j]).abs() < 1e-14, "{}", row.tip);
            }
        }
    }
}

#[test]
fn a_model_without_names_of_ends_has_those_that_there_is_but_one_of() {
    let text = r#"<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="j"/>
        <body name="b" pos="1 0 0"><site name="s" pos="0 1 0"/></body></body></worldbody></mujoco>"#;
    let imported = read("a.xml", text, &Ends::default()).expect("sound");
    assert_eq!(imported.told, ["base is the root, body \"world\"", "tip is the only end, body \"b\""]);
    let error = open(arm(), &Ends::default()).expect_err("two ends");
    assert!(error.mend().contains("hand, flag"), "{}", error.mend());
}

#[test]
fn a_chain_may_begin_behind_a_joint_that_is_free() {
    let ends = Ends::default().with_base("cart").with_tip("flag");
    let mast = open(arm(), &ends).expect("sound").machine;
    assert_eq!(mast.commands(), ["mast"]);
    let pose = Chain::nominal(&mast).w_from_t(&[std::f64::consts::FRAC_PI_2]);
    assert!((pose.translation.0[1] + 0.2).abs() < 1e-15 && (pose.translation.0[2] - 1.0).abs() < 1e-15);
    let error = open(arm(), &to("flag")).expect_err("free");
    assert!(error.to_string().contains("arm.xml:29: joint \"loose\" is of type free"), "{error}");
    assert!(error.mend().contains("--base cart"), "{}", error.mend());
}

#[test]
fn the_file_of_an_imported_model() {
    let imported = open(arm(), &to("tip")).expect("sound");
    let names: Vec<_> =
        imported.beside.iter().map(|file| file.strip_prefix(arm().parent().expect("a folder"))).collect();
    assert_eq!(names, [Ok(Path::new("parts/defaults.xml")), Ok(Path::new("parts/hand.xml"))]);
    insta::assert_snapshot!(imported.text);
}

fn beside(parts: &[(&str, &str)]) -> ImportOptions {
    let mut options = ImportOptions::default();
    options.beside = (parts.iter().map(|(file, text)| Beside::new(file, *text))).collect();
    options
}

fn with_parts(text: &str) -> kincal::Result<Imported> {
    let part = |name: &str| std::fs::read_to_string(arm().with_file_name(name)).expect("a part");
    let (defaults, hand) = (part("parts/defaults.xml"), part("parts/hand.xml"));
    let mut options = beside(&[("parts/defaults.xml", &defaults), ("parts/hand.xml", &hand)]);
    options.ends = to("tip");
    read_with("arm.xml", text, &options)
}

#[test]
fn what_is_at_fault_in_a_part_is_told_of_the_part() {
    let model = "<mujoco>\n<worldbody>\n<include file=\"a.xml\"/><body/>\n</worldbody></mujoco>";
    let said = |parts: &[(&str, &str)]| {
        let error = read_with("whole.xml", model, &beside(parts)).expect_err("at fault");
        assert!(!error.mend().is_empty());
        error.to_string()
    };
    let fault = said(&[("a.xml", "<mujoco>\n\n<body name=\"b\" pos=\"0 0\"/></mujoco>")]);
    assert_eq!(fault, "a.xml:3: `pos=\"0 0\"` of <body> is not 3 numbers");
    assert_eq!(said(&[("a.xml", "<mujoco>\n<body></mujoco>")]).split(": ").next(), Some("a.xml:2:7"));
    let fault = said(&[("a.xml", "<mujoco>\n<body/><include file=\"a.xml\"/></mujoco>")]);
    assert_eq!(fault, "a.xml:2: a.xml is included twice");
    let fault = said(&[("a.xml", "<mujoco>\n<include file=\"b.xml\"/></mujoco>"), ("b.xml", "<mujoco/>")]);
    assert_eq!(fault, "whole.xml: nothing moves behind body \"world\"".replace("whole.xml", "whole.xml:1"));
}

#[test]
fn no_beginning_of_a_model_and_no_gap_in_it_makes_the_reader_panic() {
    let text = std::fs::read_to_string(arm()).expect("a file");
    assert!(with_parts(&text).is_ok());
    let mut accepted = 0;
    let mut hold = |text: &str, whole: bool| match with_parts(text) {
        Ok(_) => {
            assert!(whole, "a beginning is a machine:\n{text}");
            accepted += 1;
        }
        Err(error) => assert!(!error.mend().is_empty(), "{error}"),
    };
    // What stands behind the last element is white space.
    for at in 0..text.trim_end().len() {
        hold(&text[..at], false);
        hold(&format!("{}{}", &text[..at], &text[(at + 9).min(text.len())..]), true);
    }
    assert!(accepted > 0, "gaps in names and comments leave a machine");
}

#[test]
fn a_model_may_be_nested_deeply() {
    let deep = 3000;
    let text = format!(
        "<mujoco><worldbody>{}{}</worldbody></mujoco>",
        "<body><joint/>".repeat(deep),
        "</body>".repeat(deep)
    );
    // No stack overflows.
    let imported = read("deep.xml", &text, &Ends::default()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(imported.machine.commands().len(), deep);
}

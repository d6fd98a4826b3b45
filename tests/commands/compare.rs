//! `kincal compare` as its users meet it.

use crate::common;
use crate::program::{Folder, said};
use kincal::CalibratedMachine;
use kincal::rivals::{Rival, Tuning};
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};

#[test]
fn the_command_prints_a_table_and_says_what_is_wrong_with_its_input() {
    let machine = common::machine("ac_table_tilting");
    let folder = Folder::new("compare");
    let head = ["sigma[um]: 1".to_string()];
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 1));
    let instrument = Instrument::new(Sensor::Position, 1e-6, 0.0);
    let csv = recording(&truth, &instrument, &random_commands(&machine, 200, 2), &head, 3);
    let (rec, true_ron) = (folder.write("rec.csv", &csv), folder.write("true.ron", &truth.to_ron()));
    let ron = "machines/ac_table_tilting.ron";

    let (status, out, err) = said(&["compare", ron, &rec, "--truth", &true_ron, "--samples", "50"]);
    assert_eq!((status, err.as_str()), (Some(0), ""));
    for (name, _) in Rival::named(Tuning::default()) {
        assert!(out.lines().any(|line| line.trim().starts_with(name)), "{name} in\n{out}");
    }
    assert!(out.contains("fitted to 50 samples, judged by the other samples"), "{out}");
    assert!(out.contains("local-gauss-newton failed: "), "{out}");

    let (status, out, _) =
        said(&["compare", ron, &rec, "--truth", &true_ron, "--rivals", "kalman,local", "--json", "-"]);
    let json: serde_json::Value = serde_json::from_str(&out).expect("JSON alone");
    assert_eq!((status, json["judged_by"].as_str()), (Some(0), Some("the same samples")));
    let rivals = json["rivals"].as_array().expect("a list");
    assert_eq!(
        rivals.iter().map(|r| r["rival"].as_str().expect("a name")).collect::<Vec<_>>(),
        ["kalman", "local"]
    );
    let dp = |i: usize| rivals[i]["truth"]["dp_m"].as_f64().expect("a length");
    assert!(dp(0) < 2e-6 && (dp(0) / dp(1) - 1.0).abs() < 1e-2, "{} {}", dp(0), dp(1));

    for (args, status, words) in [
        (vec!["--rivals", "nobody"], 1, "choose from: declared, local"),
        (vec!["--truth", "machines/scara.ron"], 1, "its frames and joints are not those of"),
        (vec!["--samples", "1"], 2, "--samples"),
        (vec!["--tau", "-1"], 2, "above zero"),
        (vec!["--judge", "nowhere.csv"], 1, "nothing is there"),
        (vec!["--json", rec.as_str()], 1, "would overwrite REC.csv"),
    ] {
        let all: Vec<&str> = ["compare", ron, &rec].into_iter().chain(args.iter().copied()).collect();
        let (got, out, err) = said(&all);
        assert_eq!((got, out.as_str()), (Some(status), ""), "{args:?}: {err}");
        assert!(err.contains(words), "{args:?}: {err}");
    }
}

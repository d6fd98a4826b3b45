//! Two recordings of the same moments beside each other; every fault with its place and mend.

use std::path::{Path, PathBuf};

use kincal::Machine;
use kincal::recording::{join, open_all};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad/joins")
}

/// A file of one's own with this text.
fn file(name: &str, text: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("kincal_join_{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a file");
    path
}

#[test]
fn columns_come_beside_each_other_and_everything_else_stays_as_it_was() {
    let other = "# machine: other\n\nt[ms], arm[deg] ,px[um]\n0,-5,100\n500,-6,\n1000, -7 ,120\n";
    let joined = join(&folder().join("good.csv"), &file("other.csv", other), "left").expect("they belong");
    assert_eq!((joined.rows, joined.shared, joined.added.len()), (3, vec!["t".to_string()], 2));
    insta::assert_snapshot!(joined.text, @r"
    # machine: post
    # measurement: position
    t[s],turn[deg],arm[deg],px[mm],py[mm],pz[mm],left.arm[deg],left.px[um]
    0.0,0,10,1,2,3,-5,100
    # a remark
    0.5,10,20,1,2,3,-6,
    1.0,20,,1,2,3,-7,120
    ");
}

#[test]
fn a_recording_beside_itself_brings_nothing() {
    let good = folder().join("good.csv");
    let joined = join(&good, &good, "again").expect("the same");
    assert!(joined.added.is_empty());
    assert_eq!(joined.text, std::fs::read_to_string(good).expect("text"));
}

#[test]
fn line_ends_of_other_systems_stay() {
    let text = std::fs::read_to_string(folder().join("good.csv")).expect("text").replace('\n', "\r\n");
    let joined = join(&file("crlf.csv", &text), &folder().join("good.csv"), "again").expect("the same");
    assert_eq!(joined.text, text);
}

#[test]
fn what_cannot_be_joined_has_a_message_and_a_mend() {
    let mut told = String::new();
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder()).expect("files").map(|e| e.expect("readable").path()).collect();
    files.sort();
    let good = folder().join("good.csv");
    let shown = |text: String| text.replace(&format!("{}/", folder().display()), "");
    for path in files.iter().filter(|path| **path != good) {
        let error = join(&good, path, "left").expect_err("it is broken");
        told += &shown(format!("{error} | {}\n", error.mend()));
    }
    let error = join(&good, &good, "3 left").expect_err("a name");
    told += &shown(format!("{error} | {}\n", error.mend()));
    let twice = file("twice.csv", "turn[deg],arm[deg],left.arm[deg]\n0,1,2\n10,1,2\n20,1,2\n");
    let error = join(&twice, &good, "left").expect_err("a name that is there");
    told += &format!("{} | {}\n", error.to_string().rsplit('/').next().unwrap_or(""), error.mend());
    insta::assert_snapshot!(told);
}

/// A post that leans, with an arm on either side that has recordings of its own.
const POST: &str = r#"Machine(
    name: "post", units: (length: mm, angle: deg),
    workpiece: [(frame: "w")],
    tool: [
        (frame: "turn", joint: Revolute(axis: "z")),
        (frame: "arm", at: (200, 0, 300), joint: Revolute(axis: "y")),
        (frame: "t", at: (500, 0, 0)),
    ],
    side_branches: [
        (on: "turn", recorded_as: "post_left", dyads: [(frame: "left.arm", joint: Revolute(axis: "y"))]),
        (on: "turn", recorded_as: "post_back", dyads: [(frame: "back.arm", joint: Revolute(axis: "y"))]),
    ],
)"#;

#[test]
fn recordings_of_what_hangs_on_the_machine_are_laid_beside_its_own() {
    let machine = Machine::parse("post.ron", POST).unwrap_or_else(|e| panic!("{e}"));
    let of = |name: &str, rows: &str| {
        let text = format!(
            "# machine: {name}\n# measurement: position\nturn[deg],arm[deg],px[mm],py[mm],pz[mm]\n{rows}"
        );
        file(&format!("{name}.csv"), &text)
    };
    let own = of("post", "0,10,1,2,3\n10,20,1,2,3\n30,20,1,2,3\n");
    let left = of("post_left", "0,-5,4,5,6\n10,-6,4,5,6\n30,-7,4,5,6\n");
    let back = of("post_back", "0,-8,7,8,9\n10,-9,7,8,9\n30,-9,7,8,9\n");
    let recordings = open_all(&[left.clone(), own.clone(), back], &machine).unwrap_or_else(|e| panic!("{e}"));
    let [joined] = &recordings[..] else { panic!("{} recordings", recordings.len()) };
    let rows = joined.scan().expect("rows").samples;
    assert_eq!((joined.name(), rows), ("post.csv", 3));
    let channels: Vec<&str> = joined.columns().iter().map(|c| c.name.as_str()).collect();
    for column in ["left.arm", "left.px", "back.arm"] {
        assert!(channels.contains(&column), "{channels:?}");
    }
    assert_eq!(joined.warnings().len(), 2);
    assert!(
        joined.warnings()[0]
            .contains("post_left.csv are laid beside it, row by row: both have the same turn")
    );
    // Of other moments it belongs to none of them, and alone it is of another machine.
    let short = of("post_left", "0,-5,4,5,6\n10,-6,4,5,6\n");
    let error = open_all(&[own, short.clone()], &machine).expect_err("other moments");
    assert!(error.to_string().contains("rows"), "{error}");
    let error = open_all(&[short], &machine).expect_err("another machine");
    assert!(error.to_string().contains("post_left"), "{error}");
}

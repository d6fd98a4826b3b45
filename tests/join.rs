//! Two recordings of the same moments beside each other; every fault with its place and mend.

use std::path::{Path, PathBuf};

use kincal::recording::join;

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

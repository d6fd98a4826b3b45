//! Bags of ROS 2: what other people's writers have written, and messages for what is at fault.
//!
//! `cargo test --features rosbag --test rosbag`; `make.py` wrote the files.

#[path = "../common/folder.rs"]
mod folder;

use std::path::{Path, PathBuf};
use std::process::Command;

use folder::Folder;
use kincal::convert::{Converted, Request, open, open_parts, read};
use kincal::{Error, Machine};

fn project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn scara() -> Machine {
    Machine::open(project("machines/scara.ron")).expect("a machine of the project")
}

/// Files of a folder that are no texts, by name.
fn files(folder: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(project(folder)).expect("a folder");
    let mut all: Vec<PathBuf> = entries.map(|entry| entry.expect("readable").path()).collect();
    all.retain(|path| {
        path.extension().is_some_and(|e| ["mcap", "bag", "db3"].contains(&&*e.to_string_lossy()))
    });
    all.sort();
    all
}

fn name(path: &Path) -> String {
    path.file_name().expect("a name").to_string_lossy().into_owned()
}

/// What is told besides of a bag.
fn request(path: &Path) -> Request {
    match &*name(path) {
        "frames.mcap" => Request::default().with_frames("tracker", "ball"),
        "two_links_move.mcap" => Request::default().with_frames("world", "ball"),
        _ => Request::default(),
    }
}

fn converted(path: &Path) -> Result<Converted, Error> {
    open(path, Some(&scara()), &request(path))
}

/// Lines of the head and names of columns, and rows as numbers.
fn parts(text: &str) -> (Vec<&str>, Vec<Vec<f64>>) {
    let at = text.lines().position(|line| line.starts_with("t[")).expect("a row of names") + 1;
    let numbers = |line: &str| line.split(',').map(|field| field.parse().expect("a number")).collect();
    (text.lines().take(at).collect(), text.lines().skip(at).map(numbers).collect())
}

/// Types, compressions, orders of bytes, chains of frames, senders: one motion, one recording.
#[test]
fn bags_of_other_writers_are_the_recording_of_their_motion() {
    let expected = std::fs::read_to_string(project("tests/rosbag/expected.csv")).expect("readable");
    let (head, rows) = parts(&expected);
    let all = files("tests/rosbag");
    assert_eq!(all.len(), 7);
    for path in all {
        let found = converted(&path).unwrap_or_else(|e| panic!("{e}\n  = {}", e.mend()));
        assert_eq!(found.recordings.len(), 1);
        let (own_head, own_rows) = parts(&found.recordings[0].text);
        assert_eq!(own_head, head, "{}", path.display());
        assert_eq!(own_rows.len(), rows.len(), "{}", path.display());
        for (own, row) in own_rows.iter().zip(&rows) {
            // Some roundings of numbers about one.
            let apart = own.iter().zip(row).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart < 2e-15, "{}: {apart} {own:?} {row:?}", path.display());
        }
        let bytes = std::fs::read(&path).expect("readable");
        let again = read(&path, &bytes, Some(&scara()), &request(&path)).expect("the same bag");
        assert_eq!(again, found);
    }
}

/// What was dropped, interpolated, guessed.
#[test]
fn what_becomes_of_a_bag_is_told() {
    let mut said = String::new();
    for path in files("tests/rosbag/told").iter().chain(&files("tests/rosbag")) {
        let found = converted(path).unwrap_or_else(|e| panic!("{e}\n  = {}", e.mend()));
        said.push_str(&format!("{}: {} rows\n", name(path), found.recordings[0].rows));
        found.told.iter().for_each(|line| said.push_str(&format!("  {line}\n")));
    }
    insta::assert_snapshot!(said);
}

#[test]
fn lines_between_joint_states_are_as_long_as_is_told() {
    let path = project("tests/rosbag/pose_zstd.mcap");
    let with = |gap: f64| open(&path, Some(&scara()), &Request::default().with_longest_gap(gap));
    let error = with(0.01).expect_err("no joint states are so near");
    assert!(error.to_string().contains("no pose lies between joint states"), "{error}");
    let rows = |gap: f64| with(gap).map_or(0, |found| found.recordings[0].rows);
    assert_eq!((rows(0.052), rows(10.0)), (15, 15));
    // A gap of half a second, where it is allowed.
    let gap = project("tests/rosbag/told/gap.mcap");
    let allowed = open(&gap, Some(&scara()), &Request::default().with_longest_gap(0.6)).expect("sound");
    let whole = with(0.6).expect("sound");
    let [(_, allowed), (_, whole)] = [&allowed, &whole].map(|found| parts(&found.recordings[0].text));
    assert_eq!(allowed.len(), whole.len());
    for (a, b) in allowed.iter().flatten().zip(whole.iter().flatten()) {
        assert!((a - b).abs() < 1e-14, "{a} {b}");
    }
}

/// Positions without the rotation; other names for joints; a map that was written is read again.
#[test]
fn flags_and_maps_of_tables_hold_for_bags() {
    let path = project("tests/rosbag/pose_zstd.mcap");
    let position =
        open(&path, Some(&scara()), &Request::default().with_measurement("position")).expect("sound");
    let text = &position.recordings[0].text;
    assert!(
        text.contains("# measurement: position\nt[s],q1[rad],q2[rad],q3[m],q4[rad],px[m],py[m],pz[m]\n"),
        "{text}"
    );
    let whole = converted(&path).expect("sound");
    let folder = Folder::new("map");
    let map = folder.0.join("map.ron");
    std::fs::write(&map, &whole.map).expect("written");
    let again = open(&path, Some(&scara()), &Request::default().with_map(&map)).expect("sound");
    assert_eq!(again.recordings, whole.recordings);
    let other = project("tests/bad/rosbags/names_of_other_joints.mcap");
    let pairs = [("q4", "a"), ("q1", "c"), ("q3", "d"), ("q2", "e")];
    let named = pairs.iter().fold(Request::default(), |request, (to, from)| request.with_column(*to, *from));
    let named = open(&other, Some(&scara()), &named).unwrap_or_else(|e| panic!("{e}"));
    let sorted = |text: &str| {
        let (head, rows) = parts(text);
        let names: Vec<String> = head[head.len() - 1].split(',').map(str::to_string).collect();
        let mut columns: Vec<(String, Vec<f64>)> = names
            .into_iter()
            .enumerate()
            .map(|(k, name)| (name, rows.iter().map(|row| row[k]).collect()))
            .collect();
        columns.sort_by(|a, b| a.0.cmp(&b.0));
        columns
    };
    assert_eq!(sorted(&named.recordings[0].text), sorted(&whole.recordings[0].text));
}

/// Every file of `tests/bad/rosbags` with what is said of it.
#[test]
fn bags_that_are_refused_are_told_with_their_place_and_mend() {
    let folder = format!("{}/", project("tests/bad/rosbags").display());
    let mut said = String::new();
    for path in files("tests/bad/rosbags") {
        let error = converted(&path).map(|found| found.told).expect_err(&name(&path));
        assert!(!error.mend().is_empty(), "{error}");
        said.push_str(&format!("{error}\n  = {}\n", error.mend()).replace(&folder, ""));
    }
    for (file, request) in [
        ("pose_zstd.mcap", Request::default().with_pose_topic("/tracker/other")),
        ("pose_zstd.mcap", Request::default().with_joint_topic("/tracker/pose")),
        ("pose_zstd.mcap", Request::default().with_frames("tracker", "ball")),
        ("frames.mcap", Request::default()),
        ("frames.mcap", Request::default().with_frames("world", "camera")),
        ("frames.mcap", Request::default().with_frames("ball", "island")),
        ("pose_zstd.mcap", Request::default().with_measurement("distance")),
        ("expected.csv", Request::default().with_pose_topic("/pose")),
    ] {
        let error = open(project("tests/rosbag").join(file), Some(&scara()), &request).expect_err(file);
        let folder = format!("{}/", project("tests/rosbag").display());
        said.push_str(&format!("{error}\n  = {}\n", error.mend()).replace(&folder, ""));
    }
    insta::assert_snapshot!(said);
}

/// A bag whose end is missing has the rows of what stands before, and says so; no damage makes the reader panic.
#[test]
fn what_is_whole_of_a_bag_is_read_and_damage_is_told() {
    let (mut read_on, mut refused) = (0, 0);
    let mut state = 20_261_126u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for path in files("tests/rosbag") {
        let bytes = std::fs::read(&path).expect("readable");
        let whole = converted(&path).expect("sound");
        let lines: Vec<&str> = whole.recordings[0].text.lines().collect();
        let mut outcome = |bytes: &[u8]| match read(&path, bytes, Some(&scara()), &request(&path)) {
            Ok(found) => {
                read_on += 1;
                Some(found)
            }
            Err(error) => {
                refused += 1;
                assert!(!error.mend().is_empty(), "{error}");
                None
            }
        };
        for end in (0..bytes.len()).step_by(53) {
            if let Some(found) = outcome(&bytes[..end]) {
                let own: Vec<&str> = found.recordings[0].text.lines().collect();
                // Where the first row is that of the whole bag, so are those behind it.
                assert!(own.iter().all(|line| lines.contains(line)), "{} {end}", path.display());
                let is_told = found.told.iter().any(|line| line.starts_with("the bag is cut off"));
                assert!(is_told || own.len() == lines.len(), "{} {end}", path.display());
            }
        }
        for _ in 0..60 {
            let mut bytes = bytes.clone();
            for _ in 0..=random(3) {
                let at = random(bytes.len());
                bytes[at] = [0xff, 0, bytes[at] ^ (1 << random(8))][random(3)];
            }
            outcome(&bytes);
        }
        // Room on the disk that the recorder had no time to fill.
        let cut = bytes.len() * 2 / 3;
        let zeros = [&bytes[..cut], &[0; 5000]].concat();
        outcome(&zeros);
    }
    println!("{read_on} read, {refused} refused");
    assert!(read_on > 100 && refused > 300, "{read_on} {refused}");
}

/// A bag that its recorder has split, as a folder with what changes in it.
struct Split {
    folder: Folder,
}

impl Split {
    fn new(name: &str) -> Split {
        let folder = Folder::new(name);
        let from = project("tests/rosbag/split/run");
        for entry in std::fs::read_dir(from).expect("a folder") {
            let path = entry.expect("readable").path();
            std::fs::copy(&path, folder.0.join(path.file_name().expect("a name"))).expect("copied");
        }
        Split { folder }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.0.join(name)
    }

    fn converted(&self) -> Result<Converted, Error> {
        open(&self.folder.0, Some(&scara()), &Request::default())
    }
}

/// Three files, each with its own numbers of topics, are the recording of their motion, in whatever order they are named.
#[test]
fn a_bag_that_was_split_is_one_recording() {
    let split = Split::new("split");
    let expected = std::fs::read_to_string(project("tests/rosbag/expected.csv")).expect("readable");
    let (head, rows) = parts(&expected);
    let whole = split.converted().unwrap_or_else(|e| panic!("{e}"));
    let (own_head, own_rows) = parts(&whole.recordings[0].text);
    assert_eq!((own_head, own_rows.len()), (head, rows.len()));
    for (a, b) in own_rows.iter().flatten().zip(rows.iter().flatten()) {
        // Some roundings of numbers about one.
        assert!((a - b).abs() < 2e-15, "{a} {b}");
    }
    let named = ["run_2.mcap", "run_0.mcap", "run_1.mcap"].map(|name| split.file(name));
    let again = open_parts(&named, Some(&scara()), &Request::default()).expect("the same bag");
    assert_eq!(again.recordings, whole.recordings);
}

/// What is missing of a split bag is told, and what cannot be one is refused.
#[test]
fn what_is_not_whole_of_a_split_bag_is_told() {
    let mut said = String::new();
    let mut tell = |case: &str, split: &Split| {
        let text = match split.converted() {
            Ok(found) => format!("{} rows\n  {}", found.recordings[0].rows, found.told.join("\n  ")),
            Err(error) => format!("{error}\n  = {}", error.mend()),
        };
        let folder = split.folder.0.display().to_string();
        said.push_str(&format!("{case}: {}\n", text.replace(&folder, "FOLDER")));
    };
    let without = |name: &str| {
        let split = Split::new("without");
        std::fs::remove_file(split.file(name)).expect("removed");
        split
    };
    tell("the middle is missing", &without("run_1.mcap"));
    tell("the end is missing", &without("run_2.mcap"));
    let split = Split::new("cut");
    let bytes = std::fs::read(split.file("run_2.mcap")).expect("readable");
    std::fs::write(split.file("run_2.mcap"), &bytes[..bytes.len() / 4]).expect("written");
    tell("the end is cut", &split);
    std::fs::write(split.file("run_2.mcap"), "").expect("written");
    tell("the end is empty", &split);
    std::fs::copy(split.file("run_0.mcap"), split.file("other_0.mcap")).expect("copied");
    tell("two bags", &split);
    let split = Split { folder: Folder::new("older") };
    tell("nothing", &split);
    std::fs::write(split.file("run_0.db3"), b"SQLite format 3\0").expect("written");
    tell("a database", &split);
    std::fs::remove_file(split.file("run_0.db3")).expect("removed");
    std::fs::write(split.file("run_0.mcap.zstd"), b"\x28\xb5\x2f\xfd").expect("written");
    tell("compressed as a whole", &split);
    let table = [project("tests/rosbag/split/run/run_0.mcap"), project("tests/rosbag/expected.csv")];
    let error = open_parts(&table, Some(&scara()), &Request::default()).expect_err("a table beside a bag");
    assert!(error.to_string().ends_with("of other files each is a recording of its own"), "{error}");
    insta::assert_snapshot!(said);
}

/// A bag in the place of a recording is told as such, with the command that makes one of it.
#[test]
fn a_bag_in_the_place_of_a_recording_ends_in_a_command_to_paste() {
    let split = Split::new("place");
    let machine = project("machines/scara.ron");
    let machine = machine.to_str().expect("UTF-8");
    let run = |words: &[&str]| {
        let output =
            Command::new(env!("CARGO_BIN_EXE_kincal")).current_dir(&split.folder.0).args(words).output();
        let output = output.expect("it runs");
        (output.status.code(), String::from_utf8(output.stderr).expect("UTF-8"))
    };
    for (named, says) in [(".", "a folder with a bag of ROS 2"), ("run_0.mcap", "a bag of ROS 2 (MCAP)")] {
        let (status, text) = run(&["calibrate", machine, named, "-o", "calibrated.ron"]);
        assert_eq!(status, Some(1), "{text}");
        assert!(text.starts_with(&format!("error: {named}: this is {says}, and no recording\n")), "{text}");
        let (_, command) =
            text.trim_end().split_once("it becomes a recording by: kincal ").expect("a command");
        let words: Vec<&str> = command.split_whitespace().chain(["--quiet"]).collect();
        assert_eq!(run(&words), (Some(0), String::new()));
        let output = words[words.len() - 2];
        let written = std::fs::read_to_string(split.file(output)).expect("written");
        assert!(written.contains("# measurement: pose"), "{written}");
    }
}

/// The command that a message shows runs as it is.
#[test]
fn a_message_about_topics_ends_in_a_command_to_paste() {
    let folder = Folder::new("paste");
    let bag = project("tests/bad/rosbags/several_poses.mcap");
    std::fs::copy(&bag, folder.0.join("a bag.mcap")).expect("copied");
    let machine = project("machines/scara.ron");
    let run = |words: &[String]| {
        let output = Command::new(env!("CARGO_BIN_EXE_kincal")).current_dir(&folder.0).args(words).output();
        let output = output.expect("it runs");
        (output.status.code(), String::from_utf8(output.stderr).expect("UTF-8"))
    };
    let words = [
        "convert",
        "a bag.mcap",
        "--machine",
        machine.to_str().expect("UTF-8"),
        "--head",
        "workpiece_frame: unknown",
        "-o",
        "rec.csv",
    ];
    let (status, says) = run(&words.map(String::from));
    assert_eq!(status, Some(1), "{says}");
    let (_, command) = says.trim_end().split_once("for example: kincal ").expect("a command");
    let words: Vec<String> = command
        .split('\'')
        .enumerate()
        .flat_map(|(i, part)| match i % 2 {
            0 => part.split_whitespace().map(String::from).collect(),
            _ => vec![part.to_string()],
        })
        .collect();
    let (status, says) = run(&[words, vec!["--quiet".into()]].concat());
    assert_eq!((status, &*says), (Some(0), ""));
    let text = std::fs::read_to_string(folder.0.join("rec.csv")).expect("written");
    assert!(text.contains("# workpiece_frame: unknown\n"), "{text}");
}

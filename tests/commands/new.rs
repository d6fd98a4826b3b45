//! `kincal new`: machine files to begin with.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use kincal::{Chain, Machine};

use crate::program::{Folder, PROGRAM, done, err, fails, out};

/// What a page shows: the text of the first block that begins with these words behind its fence.
fn block(kind: &str) -> String {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/machines.md");
    let page = std::fs::read_to_string(page).expect("part of the project");
    let begins = format!("```{kind}\n");
    let block = page.split(&begins).nth(1).and_then(|rest| rest.split("```").next());
    block.unwrap_or_else(|| panic!("no block {kind}")).to_string()
}

/// The program with these lines piped in.
fn answered(folder: &Folder, args: &[&str], answers: &str) -> (Option<i32>, String, String) {
    let mut child = Command::new(PROGRAM)
        .current_dir(&folder.0)
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    // A run that ends early leaves the pipe.
    let _ = child.stdin.take().expect("piped").write_all(answers.as_bytes());
    let output = child.wait_with_output().expect("it ends");
    (output.status.code(), out(&output), err(&output))
}

#[test]
fn a_copy_is_the_machine_it_is_like_with_comments_on_every_field() {
    let folder = Folder::new("like");
    let list = done(&["machines", "--json", "-"]);
    let list: Vec<serde_json::Value> = serde_json::from_str(&list).expect("a list");
    for name in list.iter().filter_map(|machine| machine["machine"].as_str()) {
        let path = folder.path("copy.ron");
        done(&["new", "--like", name, "--name", "mine", "-o", &path]);
        let text = folder.read("copy.ron");
        let shipped = Machine::parse("shipped.ron", &done(&["machines", name])).expect("sound");
        let copy = Machine::parse("copy.ron", &text).expect("sound");
        assert_eq!(
            (copy.name(), copy.dyads(), copy.units()),
            ("mine", shipped.dyads(), shipped.units()),
            "{name}"
        );
        assert_eq!(copy.side_branches(), shipped.side_branches(), "{name}");
        // A comment stands above each field of the machine.
        let lines: Vec<&str> = text.lines().collect();
        for (i, line) in lines.iter().enumerate() {
            let field =
                line.strip_prefix("    ").filter(|rest| rest.starts_with(|c: char| c.is_ascii_lowercase()));
            assert!(field.is_none() || lines[i - 1].trim_start().starts_with("//"), "{name}: {line}");
        }
        assert!(done(&["describe", &path]).contains("mine"), "{name}");
    }
}

#[test]
fn a_list_of_joints_arguments_and_answers_make_the_same_file() {
    let folder = Folder::new("joints");
    folder.write("joints.csv", &block("csv joints.csv"));
    let commands = block("sh");
    let run = |line: &str| {
        let parts = line.split('\'').enumerate();
        let words: Vec<String> = parts
            .flat_map(|(i, part)| match i % 2 {
                1 => vec![part.to_string()],
                _ => part.split_whitespace().map(str::to_string).collect(),
            })
            .skip(1)
            .collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        answered(&folder, &words, &block("text answers"))
    };
    let mut files = Vec::new();
    for line in commands.replace("\\\n", " ").lines() {
        let (status, _, message) = run(line);
        assert_eq!((status, message.as_str()), (Some(0), ""), "{line}");
        files.push(folder.read("mine.ron"));
        std::fs::remove_file(folder.0.join("mine.ron")).expect("written");
    }
    let [like, table, arguments, answers] = &files[..] else { panic!("{commands}") };
    assert!(like.contains("A copy of ac_table_tilting"));
    assert_eq!(table, answers);
    // Arguments state no travel.
    let machine = |text: &str| Machine::parse("mine.ron", text).expect("sound");
    let (table, arguments) = (machine(table), machine(arguments));
    assert_eq!(table.commands(), ["a", "c", "y", "x", "z"]);
    // The page writes the same machine by hand.
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/machines.md");
    let page = std::fs::read_to_string(page).expect("part of the project");
    let mut by_hand = page.split("```ron\n").skip(1).filter_map(|rest| rest.split("```").next());
    let by_hand = by_hand.find(|text| text.contains("\"my_ac_table\"")).map(machine).expect("a machine");
    for q in [[0.0; 5], [0.3, -0.7, 0.1, -0.2, 0.05]] {
        let [one, other] = [&table, &by_hand].map(|machine| Chain::nominal(machine).w_from_t(&q).translation);
        assert!((one - other).norm() < 1e-15, "{one:?} {other:?}");
    }
    for (one, other) in table.dyads().iter().zip(arguments.dyads()) {
        assert_eq!((&one.frame, one.placement), (&other.frame, other.placement));
        let axis = |dyad: &kincal::machine::Dyad| dyad.joint.as_ref().map(|joint| (joint.kind, joint.axis));
        assert_eq!(axis(one), axis(other));
    }
}

#[test]
fn the_file_of_a_list_of_joints() {
    let folder = Folder::new("sketch");
    let table = folder.write("joints.csv", &block("csv joints.csv"));
    let path = folder.path("mine.ron");
    done(&["new", "--joints", &table, "-o", &path]);
    insta::assert_snapshot!(folder.read("mine.ron"));
    assert!(done(&["describe", &path]).contains("workpiece"));
}

#[test]
fn what_cannot_be_made_is_told_with_its_mend() {
    let folder = Folder::new("refused");
    let mut said = String::new();
    let place = |text: String| text.replace(&folder.0.display().to_string(), "FOLDER");
    let mut tell = |message: String| {
        assert!(message.contains("\n  = "), "{message}");
        said.push_str(&place(message));
    };
    let path = folder.path("m.ron");
    tell(fails(1, &["new", "--like", "ac_tabel", "-o", &path]));
    tell(fails(1, &["new", "--like", "puma560", "--name", "my arm", "-o", &path]));
    tell(fails(1, &["new", "--joint", "x;prismatic;tool", "-o", &path]));
    tell(fails(1, &["new", "--joint", "x;prismatic;tool;x", "--joint", "x;revolute;tool;x", "-o", &path]));
    tell(fails(1, &["new", "--joint", "x;prismatic;tool;x", "--tip", "5", "-o", &path]));
    let head = "name,kind,carries,direction,point[mm]";
    for rows in [
        format!("{head}\n"),
        format!("{head},colour\nx,prismatic,tool,x,,red\n"),
        "name,kind,direction\nx,prismatic,x\n".to_string(),
        "name,kind,carries,direction,point\nx,prismatic,tool,x,\n".to_string(),
        format!("{head}\nx,screw,tool,x,\n"),
        format!("{head}\nx,prismatic,nothing,x,\n"),
        format!("{head}\nx,prismatic,tool,up,\n"),
        format!("{head}\nx,prismatic,tool,0 0 0,\n"),
        format!("{head}\nx,prismatic,tool,x,1 2\n"),
        format!("{head}\n1,prismatic,tool,x,\n"),
        format!("{head},lower[mm],upper[mm]\nx,prismatic,tool,x,,5,-5\n"),
        format!("{head},lower[mm],upper[mm]\nc,revolute,tool,x,,-5,5\n"),
    ] {
        let table = folder.write("joints.csv", &rows);
        tell(fails(1, &["new", "--joints", &table, "-o", &path]));
    }
    for answers in
        ["", "m\nmm\n\n", "m\nfurlong\n", "m\n\nx\nscrew\n", "m\n\nx\np\ntool\nx\n\n1 0\n", "my arm\n"]
    {
        let (status, out, message) = answered(&folder, &["new", "-o", "m.ron"], answers);
        assert_eq!((status, out.as_str()), (Some(1), ""), "{answers}");
        tell(message);
    }
    assert!(!Path::new(&path).exists());
    insta::assert_snapshot!(said);
}

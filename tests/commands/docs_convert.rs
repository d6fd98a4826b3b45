//! What `docs/convert.md` shows: its files are made, its commands run, and what they print and write is what the page says.

use std::path::Path;

use crate::program::{Folder, PROGRAM, err, fails, out};

/// Blocks of the page: the words behind the fence, and the text.
fn blocks() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("docs/convert.md")).expect("part of the project");
    let parts = page.split("```").skip(1).step_by(2);
    parts.filter_map(|part| part.split_once('\n')).map(|(a, b)| (a.to_string(), b.to_string())).collect()
}

/// A command line of a shell, cut into words; quotes keep blanks together.
fn words(line: &str) -> Vec<String> {
    let parts = line.split('\'').enumerate();
    let cut = |(i, part): (usize, &str)| -> Vec<String> {
        if i % 2 == 1 {
            vec![part.to_string()]
        } else {
            part.split_whitespace().map(str::to_string).collect()
        }
    };
    parts.flat_map(cut).collect()
}

/// Every number as `0`.
fn without_numbers(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        let digit = c.is_ascii_digit() || c == '.';
        if !(digit && out.ends_with('0')) {
            out.push(if digit { '0' } else { c });
        }
    }
    out
}

#[test]
fn every_command_of_the_page_on_tables_does_what_the_page_shows() {
    let folder = Folder::new("convert");
    let (mut run, mut compared) = (0, 0);
    let mut printed = String::new();
    for (kind, text) in blocks() {
        match kind.split_whitespace().collect::<Vec<_>>()[..] {
            // What a command has written is compared, all else is given.
            ["csv" | "ron", name] if folder.names().contains(&name.to_string()) => {
                assert_eq!(folder.read(name), text, "{name}");
                compared += 1;
            }
            ["csv" | "ron", name] => {
                folder.write(name, &text);
            }
            ["sh"] => {
                for line in text.lines() {
                    let line =
                        line.replace("machines/", &format!("{}/machines/", env!("CARGO_MANIFEST_DIR")));
                    let words = words(&line);
                    assert_eq!(words[0], "kincal");
                    let output = std::process::Command::new(PROGRAM)
                        .current_dir(&folder.0)
                        .args(&words[1..])
                        .output()
                        .expect("it runs");
                    printed = if output.status.success() { out(&output) } else { err(&output) };
                    run += 1;
                }
            }
            // Last digits hang on the processor.
            ["text", "alike"] => {
                assert_eq!(without_numbers(&printed), without_numbers(&text));
                compared += 1;
            }
            ["text"] => {
                assert_eq!(printed, text);
                compared += 1;
            }
            _ => panic!("a block that no test knows: {kind}"),
        }
    }
    assert!(run >= 3 && compared >= 2, "{run} {compared}");
    // The reversed axis: 90 deg less what the table has.
    assert!(
        folder.read("rec2.csv").contains("\n0,150.0,30.0,20.0,0.0,1.98669,"),
        "{}",
        folder.read("rec2.csv")
    );
}

#[test]
fn a_foreign_table_in_the_place_of_a_recording_is_told_how_to_convert_it() {
    let folder = Folder::new("foreign");
    let table =
        folder.write("log of hall.csv", "Time (s);X (mm);X_act (mm)\n0;1,5;1,501\n1;2,5;2,502\n2;4,5;4,5\n");
    let machine = "machines/linear_axis.ron";
    for command in [&["calibrate"][..], &["diagnose"], &["describe"], &["compare"]] {
        let message = fails(1, &[command, &[machine, &table]].concat());
        let paste =
            message.lines().last().expect("a line").split_once("kincal convert ").expect("a command").1;
        let all = words(paste);
        assert_eq!(all[..3], [table.clone(), "--machine".into(), machine.into()], "{message}");
        let all: Vec<&str> = ["convert"].into_iter().chain(all.iter().map(String::as_str)).collect();
        crate::program::done(&all);
        crate::program::done(&["describe", machine, &folder.path("log of hall_rec.csv")]);
    }
    // A recording that only lacks a unit is none.
    let own = folder.write("own.csv", "# measurement: joint\nx,x_meas[mm]\n0,1\n");
    assert!(!fails(1, &["calibrate", machine, &own]).contains("convert"));
}

//! What `docs/measure-well.md` shows: its files are made, its commands run, what they print is what the page says, and recordings see what
//! its tables say.

use std::path::Path;

use crate::documents::compare;
use crate::program::{Folder, PROGRAM, err, out};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// What a command of the page prints in this folder.
fn printed(folder: &Folder, line: &str) -> String {
    let line = line.replace("machines/", &format!("{ROOT}/machines/"));
    let words: Vec<&str> = line.split_whitespace().collect();
    assert_eq!(words[0], "kincal");
    let output = std::process::Command::new(PROGRAM)
        .current_dir(&folder.0)
        .args(&words[1..])
        .output()
        .expect("it runs");
    assert!(output.status.success(), "{line}\n{}", err(&output));
    out(&output)
}

/// How many combinations the recordings see, as `describe` counts them.
fn seen(folder: &Folder, machine: &str, recordings: &str) -> String {
    let text = printed(folder, &format!("kincal describe machines/{machine}.ron {recordings}"));
    let line = text.lines().find(|line| line.starts_with("these recordings")).expect("a count");
    let count = line.split(" see ").nth(1).and_then(|rest| rest.split(" combinations").next());
    count.expect("N of M").to_string()
}

#[test]
fn every_figure_of_the_page_on_measuring_is_what_its_command_gives() {
    let page =
        std::fs::read_to_string(Path::new(ROOT).join("docs/measure-well.md")).expect("part of the project");
    let folder = Folder::new("measure");
    let (mut last, mut rows, mut compared) = (String::new(), 0, 0);
    let mut machine = "";
    for (i, part) in page.split("```").enumerate() {
        if i % 2 == 1 {
            let (kind, text) = part.split_once('\n').expect("a block of lines");
            match kind.split_whitespace().collect::<Vec<_>>()[..] {
                ["ron", name] => drop(folder.write(name, text)),
                ["sh"] => last = text.lines().map(|line| printed(&folder, line)).collect(),
                ["text"] => {
                    let shown: Vec<String> = text.lines().map(str::to_string).collect();
                    let lines: Vec<&str> = last.lines().collect();
                    compare(&shown, &lines).unwrap_or_else(|e| panic!("{e}\n\n{last}"));
                    compared += 1;
                }
                _ => panic!("a block that no test knows: {kind}"),
            }
            continue;
        }
        for line in part.lines().filter(|line| line.starts_with('|')) {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            match cells[1] {
                "measured on the five-axis machine" => machine = "ac_table_tilting",
                "measured on the arm" => machine = "six_r_arm",
                "---" => {}
                _ => {
                    assert_eq!(seen(&folder, machine, cells[2].trim_matches('`')), cells[3], "{line}");
                    rows += 1;
                }
            }
        }
    }
    assert!(rows == 13 && compared == 4, "{rows} {compared}");
}

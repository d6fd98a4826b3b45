//! What documents show of the program's output is what it prints.

use std::path::Path;

use crate::program::{Folder, PROGRAM, done, err};

/// The lines of the README's block of this language that begins with these words.
pub fn block(begins: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    let text = std::fs::read_to_string(path).expect("part of the project");
    let mut blocks = text.split("```text\n").skip(1).map(|part| part.split("```").next().unwrap_or_default());
    let block = blocks.find(|block| block.starts_with(begins)).expect("a block that begins so");
    block.lines().map(str::to_string).collect()
}

/// Whether a line is that of the document. Words, counts and layout are the same; what is measured may differ by one in its
/// last place, as it does from processor to processor.
fn same(shown: &str, printed: &str) -> bool {
    let shape = |line: &str| line.replace(|c: char| c.is_ascii_digit(), "#");
    if shape(shown) != shape(printed) {
        return false;
    }
    let words = |line: &str| line.split_whitespace().map(str::to_string).collect::<Vec<_>>();
    let (shown, printed) = (words(shown), words(printed));
    (0..shown.len()).all(|i| {
        let beside = |j: Option<usize>, of: &[&str]| {
            let word = j.and_then(|j| shown.get(j)).map(|w| w.trim_end_matches([',', ';', '.']));
            word.is_some_and(|w| of.contains(&w))
        };
        let measured =
            beside(i.checked_sub(1), &["±"]) || beside(Some(i + 1), &["±", "%", "um", "mm", "urad", "um/m"]);
        match (measured, shown[i].parse::<f64>(), printed[i].parse::<f64>()) {
            (true, Ok(a), Ok(b)) => {
                let decimals = shown[i].split_once('.').map_or(0, |(_, behind)| behind.len() as i32);
                (a - b).abs() < 1.01 * 10f64.powi(-decimals)
            }
            _ => shown[i] == printed[i],
        }
    })
}

/// Says where `shown` is not in `printed`, line by line; a line `...` stands for any lines left out.
pub fn compare(shown: &[String], printed: &[&str]) -> Result<(), String> {
    let mut at = 0;
    for run in shown.split(|line| line.trim() == "...") {
        // Blank lines next to `...` belong to the document.
        let blank = |line: &&String| line.is_empty();
        let start = run.iter().take_while(blank).count();
        let end = run.len() - run[start..].iter().rev().take_while(blank).count();
        let run = &run[start..end];
        let Some(first) = run.first() else { continue };
        let found = printed[at..].iter().position(|line| same(first, line));
        at += found.ok_or_else(|| format!("not printed, or not in this order: {first}"))?;
        for line in run {
            match printed.get(at) {
                Some(there) if same(line, there) => at += 1,
                there => {
                    return Err(format!("shown:   {line}\nprinted: {}", there.unwrap_or(&"nothing more")));
                }
            }
        }
    }
    Ok(())
}

/// What a page shows as calls of the program: lines that begin with its name, lines that go on joined, and code within sentences.
fn calls(page: &str) -> Vec<String> {
    let mut found = Vec::new();
    for line in page.replace("\\\n", " ").lines() {
        let spans = || line.split('`').skip(1).step_by(2).filter(|code| code.starts_with("kincal "));
        match line.trim_start().strip_prefix("kincal ") {
            Some(_) => found.push(line.trim_start().to_string()),
            None => found.extend(spans().map(str::to_string)),
        }
    }
    // Several in a line, and what a shell does with one.
    let ends = |call: &str| call.split(" # ").next().unwrap_or_default().to_string();
    found
        .iter()
        .flat_map(|line| line.split("; "))
        .filter(|part| part.starts_with("kincal "))
        .map(ends)
        .collect()
}

#[test]
fn every_option_that_a_document_shows_is_one_of_its_command() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut help = std::collections::BTreeMap::new();
    let mut options = 0;
    let pages = std::fs::read_dir(root.join("docs")).expect("a folder").map(|e| e.expect("readable").path());
    for path in pages.filter(|path| path.extension().is_some_and(|e| e == "md")) {
        let page = std::fs::read_to_string(&path).expect("a text");
        for call in calls(&page) {
            // What is quoted belongs to another command.
            let bare: String = call.split('\'').step_by(2).collect::<Vec<_>>().join("''");
            let words: Vec<&str> =
                bare.split(|c: char| c.is_whitespace() || "[](){}|,".contains(c)).collect();
            let Some(command) = words.get(1).filter(|w| w.bytes().all(|b| b.is_ascii_lowercase())) else {
                continue;
            };
            let text = help.entry(command.to_string()).or_insert_with(|| done(&[command, "--help"]));
            for option in words.iter().filter_map(|word| word.strip_prefix("--")) {
                let option = option.split('=').next().unwrap_or_default();
                let ends = |behind: &str| !behind.starts_with(|c: char| c.is_ascii_lowercase() || c == '-');
                let is_there =
                    text.match_indices(&format!("--{option}")).any(|(at, own)| ends(&text[at + own.len()..]));
                assert!(option.is_empty() || is_there, "{}: --{option} in `{call}`", path.display());
                options += 1;
            }
        }
    }
    assert!(options > 300, "{options}");
}

#[test]
fn the_commands_of_the_page_on_reports_run() {
    let folder = Folder::new("page_on_reports");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("docs/read-a-report.md")).expect("part of the project");
    let block = page.split("```sh\n").nth(1).and_then(|part| part.split("```").next()).expect("commands");
    for line in block.lines() {
        let words = line.split(' ').skip(1).map(|word| match word.starts_with("machines/") {
            true => root.join(word).to_string_lossy().into_owned(),
            false => word.to_string(),
        });
        let run = std::process::Command::new(PROGRAM).args(words).current_dir(&folder.0).output();
        let run = run.expect("it runs");
        assert!(run.status.success() && err(&run).is_empty(), "{line}: {}", err(&run));
    }
    crate::report::assert_page(&folder.read("calibration.html"));
}

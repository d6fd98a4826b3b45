//! Every call that a document shows in a block of its own runs here, in another test that is named here, or has its reason.

use std::path::Path;
use std::process::Command;

use crate::program::{Folder, PROGRAM, err};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Pages whose calls a test of their own runs, beside what the page says of them: the file and the name of the test.
const ELSEWHERE: [(&str, &str, &str); 5] = [
    ("convert.md", "docs_convert.rs", "every_command_of_the_page_on_tables_does_what_the_page_shows"),
    ("import.md", "machines_in.rs", "the_commands_of_the_page_on_imports_run"),
    ("machines.md", "new.rs", "a_list_of_joints_arguments_and_answers_make_the_same_file"),
    ("measure-well.md", "docs_measure.rs", "every_figure_of_the_page_on_measuring_is_what_its_command_gives"),
    ("read-a-report.md", "documents.rs", "the_commands_of_the_page_on_reports_run"),
];

/// What is no call of kincal, by how its block begins, and why it does not run here.
const OUTSIDE: [(&str, &str); 5] = [
    (
        "cargo",
        "builds the project: .ci/run, or whoever renews a figure; names of examples and tests are looked up",
    ),
    (".ci/run", "runs this test"),
    ("pip", "fetches packages; what runs with them is looked up, and what needs no data is in .ci/run"),
    ("python", "needs packages; the script is looked up"),
    ("valgrind", "counts instructions, for minutes"),
];

/// Blocks that need what no test has, by a word in them.
const WITHOUT: [(&str, &str); 1] = [("mark_A.csv", "a recording of the data sets")];

/// What a page takes for granted, as a shell makes it. `$ROOT` is the project.
const GIVEN: [(&str, &str); 3] = [
    (
        "commands.md",
        // `man` is not everywhere, and pages what it gets: it is only there to read.
        "mkdir -p .local/share/bash-completion/completions .zfunc .config/fish/completions bin; export HOME=$PWD PATH=$PWD/bin:$PATH
         printf '#!/bin/sh\\ngrep -q kincal\\n' > bin/man; chmod +x bin/man",
    ),
    (
        "directions.md",
        "kincal simulate machines/ac_table_tilting.ron --test BK4 --length 100mm --random 1 --noise 0.5um --quiet -o rec.csv",
    ),
    ("export.md", "cp $ROOT/tests/exports/lift.ron .; cp $ROOT/tests/urdf/arm.urdf robot.urdf"),
];

/// Pages whose calls take longer than the quick tests may.
const LONG: [&str; 2] = ["paper.md", "diagnosis.md"];

/// A block of a page: where it stands, the name of the file that it is, and its text.
struct Block {
    line: usize,
    file: Option<String>,
    text: String,
}

/// Fenced blocks of a shell and of files with a name, and indented ones, in their order.
fn blocks(page: &str) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let (mut fence, mut indented): (Option<bool>, bool) = (None, false);
    for (i, line) in page.lines().enumerate() {
        let line_number = i + 1;
        if let Some(kind) = line.strip_prefix("```") {
            let words: Vec<&str> = kind.split_whitespace().collect();
            let is_kept = fence.is_none() && (words.first() == Some(&"sh") || words.len() == 2);
            if is_kept {
                let file = words.get(1).map(|name| name.to_string());
                blocks.push(Block { line: line_number, file, text: String::new() });
            }
            fence = if fence.is_some() { None } else { Some(is_kept) };
            indented = false;
        } else if let Some(is_kept) = fence {
            if is_kept && let Some(block) = blocks.last_mut() {
                block.text += &format!("{line}\n");
            }
        } else if let Some(code) = line.strip_prefix("    ") {
            let begins = ["kincal ", "cargo ", "pip ", "python "].iter().any(|word| code.starts_with(word));
            if !indented && begins {
                blocks.push(Block { line: line_number, file: None, text: String::new() });
                indented = true;
            }
            if indented && let Some(block) = blocks.last_mut() {
                block.text += &format!("{code}\n");
            }
        } else {
            indented = false;
        }
    }
    blocks
}

/// Why a block is no call of kincal, if it is none; variables before a command are passed over.
fn outside(text: &str) -> Option<&'static str> {
    let is_set = |word: &&str| {
        word.split_once('=').is_some_and(|(name, _)| name.chars().all(|c| c.is_ascii_uppercase() || c == '_'))
    };
    let first = text.split_whitespace().find(|word| !is_set(word))?;
    OUTSIDE.iter().find(|(begins, _)| *begins == first).map(|(_, reason)| *reason)
}

/// Whether a call is a form to be filled in: it has words in capitals, as `MACHINE.ron` or `DIR/left.csv`, or in brackets. Its options
/// are looked up by another test.
fn is_form(text: &str) -> bool {
    let capitals = |word: &str| {
        let name = word.split(['.', '/']).next().unwrap_or_default();
        word.starts_with('[') || name.len() >= 3 && name.chars().all(|c| c.is_ascii_uppercase())
    };
    text.lines().any(|line| line.starts_with("kincal ") && line.split_whitespace().any(capitals))
}

/// Whether what stands in the project is called by its name: examples, tests, scripts, sections of the benchmarks.
fn look_up(text: &str, at: &str) {
    let joined = text.replace("\\\n", " ");
    for line in joined.lines().map(|line| line.split(" # ").next().unwrap_or_default()) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let root = Path::new(ROOT);
        for pair in words.windows(2) {
            let places = match pair[0] {
                "--example" => {
                    vec![format!("examples/{}.rs", pair[1]), format!("examples/{}/main.rs", pair[1])]
                }
                "--test" => vec![format!("tests/{}/main.rs", pair[1])],
                _ => continue,
            };
            assert!(places.iter().any(|place| root.join(place).exists()), "{at}: {} {}", pair[0], pair[1]);
        }
        let scripts = words.iter().filter(|word| word.starts_with("tests/") || word.starts_with("./"));
        for script in scripts {
            assert!(root.join(script).exists(), "{at}: {script}");
        }
        if line.contains("--example benchmarks -- ") {
            let source =
                std::fs::read_to_string(root.join("examples/benchmarks/main.rs")).expect("its source");
            let rest = words.iter().skip_while(|word| **word != "--").skip(1);
            let mut value = false;
            for word in rest {
                let is_section = !value && !word.starts_with("--");
                value = ["--report", "--data"].contains(word);
                assert!(!is_section || source.contains(&format!("\"{word}\"")), "{at}: no section {word}");
            }
        }
    }
}

/// Runs what this page shows, block by block in one folder, and says how many blocks ran.
fn run(name: &str, page: &str) -> usize {
    let folder = Folder::new("calls");
    std::os::unix::fs::symlink(Path::new(ROOT).join("machines"), folder.0.join("machines")).expect("a link");
    let given = GIVEN.iter().find(|(page, _)| *page == name).map_or("", |(_, given)| *given);
    let path = Path::new(PROGRAM).parent().expect("a folder").display().to_string();
    let path = format!("{path}:{}", std::env::var("PATH").unwrap_or_default());
    let blocks = blocks(page);
    for block in &blocks {
        block.file.as_ref().map(|file| folder.write(file, &block.text));
    }
    let mut ran = 0;
    for block in blocks.iter().filter(|block| block.file.is_none()) {
        let is_without = WITHOUT.iter().any(|(word, _)| block.text.contains(word));
        if outside(&block.text).is_some() || is_without || is_form(&block.text) {
            continue;
        }
        let at = format!("docs/{name}:{}", block.line);
        let output = Command::new("bash")
            .args(["-euo", "pipefail", "-c", &format!("{given}\n{}", block.text)])
            .current_dir(&folder.0)
            .env("PATH", &path)
            .env("ROOT", ROOT)
            .output()
            .expect("a shell");
        assert!(output.status.success(), "{at}: {}\n{}", block.text, err(&output));
        ran += 1;
    }
    ran
}

/// All pages with their texts, those of the folder `docs` by their names there.
fn pages() -> Vec<(String, String)> {
    let docs = std::fs::read_dir(Path::new(ROOT).join("docs")).expect("a folder");
    let docs = docs
        .map(|entry| entry.expect("readable").path())
        .filter(|p| p.extension().is_some_and(|e| e == "md"));
    let others =
        ["README.md", "CONTRIBUTING.md", "tests/worlds/README.md"].map(|name| Path::new(ROOT).join(name));
    let mut pages: Vec<(String, String)> = docs
        .chain(others)
        .map(|path| {
            let name = path.strip_prefix(Path::new(ROOT).join("docs")).unwrap_or(&path);
            let name = name.strip_prefix(ROOT).unwrap_or(name).display().to_string();
            (name, std::fs::read_to_string(&path).expect("a text"))
        })
        .collect();
    pages.sort();
    pages
}

#[test]
fn every_call_of_every_document_runs_or_has_its_reason() {
    for (page, file, test) in ELSEWHERE {
        let source =
            std::fs::read_to_string(Path::new(ROOT).join("tests/commands").join(file)).expect("a test");
        assert!(
            source.contains(&format!("fn {test}()")) && source.contains(page),
            "{page}: {file} has no {test}"
        );
    }
    let (mut here, mut others, mut forms, mut without) = (0, 0, 0, 0);
    for (name, page) in pages() {
        let is_elsewhere = ELSEWHERE.iter().any(|(page, ..)| *page == name);
        for block in blocks(&page).iter().filter(|block| block.file.is_none()) {
            let at = format!("{name}:{}", block.line);
            if outside(&block.text).is_some() {
                look_up(&block.text, &at);
                others += 1;
            } else if WITHOUT.iter().any(|(word, _)| block.text.contains(word)) {
                without += 1;
            } else if is_form(&block.text) {
                forms += 1;
            }
        }
        if !is_elsewhere && !LONG.contains(&name.as_str()) {
            here += run(&name, &page);
        }
    }
    assert!(
        here >= 10 && others > 20 && forms > 15 && without == WITHOUT.len(),
        "{here} {others} {forms} {without}"
    );
}

#[test]
#[ignore = "long: the calls of pages that diagnose and of the page on the paper"]
fn the_long_calls_of_documents_run() {
    let ran: usize = pages()
        .iter()
        .filter(|(name, _)| LONG.contains(&name.as_str()))
        .map(|(name, page)| run(name, page))
        .sum();
    assert!(ran >= 6, "{ran}");
}

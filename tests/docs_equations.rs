//! The numbers under which the code cites `docs/model.md` are there, each once.

use std::fs;
use std::path::{Path, PathBuf};

/// Labels such as `(7)` or `(7a)` in a line.
fn labels(line: &str) -> Vec<String> {
    let label = |part: &str| {
        let inside = part.split_once(')')?.0;
        let digits = inside.trim_end_matches(['a', 'b']);
        let is_label = !digits.is_empty() && digits.len() <= 2 && digits.chars().all(|c| c.is_ascii_digit());
        (is_label && inside.len() <= digits.len() + 1).then(|| inside.to_string())
    };
    line.split('(').skip(1).filter_map(label).collect()
}

/// The equations of the model: indented lines that end in their label, apart from the formula by two spaces.
fn equations() -> Vec<String> {
    let model = fs::read_to_string(root().join("docs/model.md")).expect("docs/model.md");
    let tagged = |line: &&str| {
        line.starts_with("    ") && line.ends_with(')') && line.rfind("  (").is_some_and(|at| at > 4)
    };
    model.lines().filter(tagged).filter_map(|line| labels(&line[line.rfind("  (")?..]).pop()).collect()
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn equations_are_numbered_from_one_without_gap_or_repetition() {
    let mut numbers: Vec<u32> = equations().iter().filter_map(|label| label.parse().ok()).collect();
    numbers.sort_unstable();
    assert_eq!(numbers, (1..=31).collect::<Vec<_>>());
}

#[test]
fn every_equation_cited_in_the_code_exists() {
    let (known, mut files) = (equations(), Vec::new());
    rust_files(&root().join("src"), &mut files);
    let mut citations = 0;
    for file in files {
        let text = fs::read_to_string(&file).expect("a source file");
        for (n, line) in text.lines().enumerate() {
            let cited = match (line.split_once("docs/model.md"), line.split_once("// (")) {
                (Some((_, after)), _) => labels(after),
                (None, Some((_, after))) => labels(&format!("({after}")).into_iter().take(1).collect(),
                (None, None) => Vec::new(),
            };
            for label in cited {
                citations += 1;
                assert!(known.contains(&label), "{}:{}: no equation ({label})", file.display(), n + 1);
            }
        }
    }
    assert!(citations > 20, "only {citations} citations found");
}

#[test]
fn links_between_documents_lead_somewhere() {
    for document in ["README.md", "docs/notation.md", "docs/model.md"] {
        let path = root().join(document);
        let text = fs::read_to_string(&path).expect("a document");
        for target in text.split("](").skip(1).filter_map(|part| part.split_once(')')) {
            let file = target.0.split('#').next().unwrap_or_default();
            if !file.is_empty() && !file.contains("://") {
                let to = path.parent().expect("a folder").join(file);
                assert!(to.exists(), "{document}: no {file}");
            }
        }
    }
}

//! The numbers under which the code cites the equations of `docs/` are there, each once.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// An equation's label in its parts: `(7a)` is `("", 7, "a")`, `(C3)` is `("C", 3, "")`.
type Label = (String, u32, String);

/// The label that a text in parentheses is, if it is one.
fn label(inside: &str) -> Option<Label> {
    let digits = |c: char| c.is_ascii_digit();
    let (series, rest) = inside.split_at(inside.find(digits)?);
    let (number, variant) = rest.split_at(rest.find(|c| !digits(c)).unwrap_or(rest.len()));
    let is_label = number.len() <= 2
        && matches!(series.as_bytes(), [] | [b'A'..=b'Z'])
        && matches!(variant, "" | "a" | "b");
    is_label.then(|| Some((series.into(), number.parse().ok()?, variant.into())))?
}

/// Labels such as `(7)`, `(7a)` or `(C7)` in a line.
fn labels(line: &str) -> Vec<Label> {
    line.split('(').skip(1).filter_map(|part| label(part.split_once(')')?.0)).collect()
}

/// The equations of every document: indented lines that end in their label, apart from the formula by two spaces.
fn equations() -> BTreeMap<String, Vec<Label>> {
    let tagged = |line: &&str| {
        line.starts_with("    ") && line.ends_with(')') && line.rfind("  (").is_some_and(|at| at > 4)
    };
    let of = |text: &str| -> Vec<Label> {
        let labelled = text.lines().filter(tagged);
        labelled.filter_map(|line| labels(&line[line.rfind("  (")?..]).pop()).collect()
    };
    let documents = fs::read_dir(root().join("docs")).expect("docs/").map(|e| e.expect("an entry").path());
    documents
        .filter(|path| path.extension().is_some_and(|e| e == "md"))
        .map(|path| {
            let name = format!("docs/{}", path.file_name().expect("a name").to_string_lossy());
            (name, of(&fs::read_to_string(&path).expect("a document")))
        })
        .filter(|(_, labels)| !labels.is_empty())
        .collect()
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
fn equations_are_numbered_without_gap_and_no_two_documents_share_a_number() {
    let mut owner: BTreeMap<Label, String> = BTreeMap::new();
    for (document, labels) in equations() {
        let mut series: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
        for label @ (letter, number, variant) in &labels {
            let other = owner.insert(label.clone(), document.clone());
            assert_eq!(other, None, "{document}: {label:?}");
            if variant.is_empty() {
                series.entry(letter).or_default().push(*number);
            }
        }
        for (letter, mut numbers) in series {
            numbers.sort_unstable();
            let first = numbers[0];
            let expected: Vec<u32> = (first..).take(numbers.len()).collect();
            assert_eq!(numbers, expected, "{document}: series {letter:?}");
            // One document begins the plain numbers; with a letter every series is its own.
            assert!(first == 1 || (letter.is_empty() && document != "docs/model.md"), "{document}: {first}");
        }
    }
    assert!(owner.len() > 40, "only {} equations found", owner.len());
}

#[test]
fn every_equation_cited_in_the_code_exists() {
    let (known, mut files) = (equations(), Vec::new());
    rust_files(&root().join("src"), &mut files);
    let mut citations = 0;
    for file in files {
        let text = fs::read_to_string(&file).expect("a source file");
        for (n, line) in text.lines().enumerate() {
            let at = format!("{}:{}", file.display(), n + 1);
            let Some(comment) = line.trim_start().strip_prefix("//") else { continue };
            // Behind a document's name stand its own equations; a comment that begins with a label means any document's.
            let named = comment.split_once("docs/").and_then(|(_, rest)| {
                let (stem, after) = rest.split_once(".md")?;
                Some((format!("docs/{stem}.md"), after))
            });
            let (document, cited) = match named {
                Some((document, after)) => (Some(document), labels(after)),
                None => {
                    let begins = comment.trim_start_matches(['/', '!']).trim_start();
                    let first = if begins.starts_with('(') { labels(begins) } else { Vec::new() };
                    (None, first.into_iter().take(1).collect())
                }
            };
            for label in cited {
                citations += 1;
                let exists = match &document {
                    Some(document) => known.get(document).is_some_and(|own| own.contains(&label)),
                    None => known.values().any(|own| own.contains(&label)),
                };
                assert!(exists, "{at}: no equation {label:?} in {}", document.as_deref().unwrap_or("docs/"));
            }
        }
    }
    assert!(citations > 40, "only {citations} citations found");
}

#[test]
fn links_between_documents_lead_somewhere() {
    let pages = fs::read_dir(root().join("docs")).expect("docs/").map(|e| e.expect("an entry").path());
    // A folder of pictures has a page of its own.
    let pages = pages.map(|path| if path.is_dir() { path.join("README.md") } else { path });
    for path in pages.chain([root().join("README.md")]) {
        let document = path.display();
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

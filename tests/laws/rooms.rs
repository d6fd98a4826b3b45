//! Imports run one way, both between the rooms of the crate, as `src/lib.rs` lists them, and between the files of one room.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Every Rust file under a folder, sorted.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a folder of the sources") {
        let path = entry.expect("readable").path();
        match path.is_dir() {
            true => found.extend(files(&path)),
            false => found.extend(path.extension().is_some_and(|e| e == "rs").then_some(path)),
        }
    }
    found.sort();
    found
}

/// Modules that the lines `mod NAME;` of a text declare, in their order.
fn declared(text: &str) -> Vec<String> {
    let name = |line: &str| {
        let rest = line.trim_start_matches("pub(crate) ").trim_start_matches("pub ").strip_prefix("mod ")?;
        rest.strip_suffix(';').map(str::to_string)
    };
    text.lines().filter_map(name).collect()
}

/// Rooms in the order of the table in the crate's documentation: links to modules in its first column.
fn listed(text: &str) -> Vec<String> {
    let rows = text.lines().filter_map(|line| line.strip_prefix("//! | "));
    let names = rows.filter_map(|row| row.split(" | ").next()).filter(|cell| cell.contains('`'));
    names
        .flat_map(|cell| cell.split('`').skip(1).step_by(2).map(str::to_string).collect::<Vec<_>>())
        .collect()
}

/// First segments of all paths in a text that begin with `root::`, groups in braces taken apart; comments and tests left out.
fn imported(text: &str, root: &str) -> BTreeSet<String> {
    let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    let code: String =
        text.lines().filter(|line| !line.trim_start().starts_with("//")).flat_map(|l| [l, "\n"]).collect();
    let mut names = BTreeSet::new();
    let root = format!("{root}::");
    for (at, _) in code.match_indices(&root) {
        let before = code[..at].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
            continue;
        }
        let rest = &code[at + root.len()..];
        let word =
            |text: &str| text.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        let Some(group) = rest.strip_prefix('{') else {
            names.insert(word(rest));
            continue;
        };
        let (mut depth, mut item) = (0, String::new());
        for c in group.chars() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    names.insert(word(&std::mem::take(&mut item)));
                    continue;
                }
                _ => {}
            }
            item.push(c);
        }
        names.insert(word(&item));
    }
    names.remove("");
    names
}

/// Imports that run up: file, room that it is in, room that it names.
fn upward(rooms: &[String], sources: &[(String, String)]) -> Vec<String> {
    let place = |room: &str| rooms.iter().position(|r| r == room);
    let mut wrong = Vec::new();
    for (file, text) in sources {
        let own = file.split('/').next().unwrap_or_default().trim_end_matches(".rs");
        let Some(here) = place(own) else { continue };
        for name in imported(text, "crate") {
            match place(&name) {
                Some(there) if there <= here => {}
                Some(_) => wrong.push(format!("{file}: `{own}` imports `{name}`, which stands behind it")),
                None => wrong.push(format!("{file}: `crate::{name}` is no room; name the room it is in")),
            }
        }
    }
    wrong
}

fn sources() -> Vec<(String, String)> {
    let root = source();
    let name = |path: &Path| {
        path.strip_prefix(&root).expect("under src").to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/")
    };
    files(&root).iter().map(|path| (name(path), read(path))).collect()
}

#[test]
fn rooms_are_listed_once_and_all() {
    let text = read(&source().join("lib.rs"));
    let (listed, declared) = (listed(&text), declared(&text));
    let sorted = |list: &[String]| list.iter().cloned().collect::<BTreeSet<_>>();
    assert_eq!(sorted(&listed), sorted(&declared), "the table of rooms and the modules of src/lib.rs differ");
    assert_eq!(listed.len(), sorted(&listed).len(), "a room is listed twice");
}

#[test]
fn imports_run_one_way_between_rooms() {
    let rooms = listed(&read(&source().join("lib.rs")));
    let sources: Vec<_> =
        sources().into_iter().filter(|(file, _)| !["lib.rs", "main.rs"].contains(&file.as_str())).collect();
    let wrong = upward(&rooms, &sources);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn an_import_that_runs_up_is_found() {
    let rooms = ["lie", "machine", "chain"].map(String::from);
    let file = |text: &str| [("machine/dyad.rs".to_string(), text.to_string())];
    assert!(
        upward(
            &rooms,
            &file("use crate::lie::{Pose, Twist};\n/// See `crate::chain::Chain`.\n// crate::chain")
        )
        .is_empty()
    );
    assert_eq!(upward(&rooms, &file("use crate::{lie::Pose, chain::{Chain, Sweep}};")).len(), 1);
    assert_eq!(upward(&rooms, &file("fn f(chain: &crate::chain::Chain<f64>) {}")).len(), 1);
    assert_eq!(upward(&rooms, &file("use crate::Machine;")).len(), 1);
    assert!(upward(&rooms, &file("#[cfg(test)]\nmod tests { use crate::chain::Chain; }")).is_empty());
}

/// Files of one folder may not import each other in a circle; what a folder's head re-exports counts as the file that it comes from.
#[test]
fn imports_run_one_way_within_every_room() {
    let sources = sources();
    let mut folders: BTreeMap<String, Vec<(String, &str)>> = BTreeMap::new();
    for (file, text) in &sources {
        if let Some((folder, name)) = file.rsplit_once('/') {
            folders.entry(folder.to_string()).or_default().push((name.trim_end_matches(".rs").into(), text));
        }
    }
    let mut wrong = Vec::new();
    for (folder, files) in &folders {
        let names: BTreeSet<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
        let mut edges: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
        for (name, text) in files {
            let named = imported(text, "super").into_iter();
            edges.insert(name, named.filter(|n| names.contains(n.as_str()) && n != name).collect());
        }
        // Take away whatever imports nothing that is still there; what cannot be taken away is in a circle or above one.
        loop {
            let free = edges.iter().find(|(_, to)| to.iter().all(|t| !edges.contains_key(t.as_str())));
            match free.map(|(name, _)| *name) {
                Some(name) => edges.remove(name),
                None => break,
            };
        }
        wrong.extend((!edges.is_empty()).then(|| format!("{folder}: {edges:?}")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Paths of files and folders of the sources and tests that a text names in backquotes or links.
fn named_paths(text: &str) -> BTreeSet<&str> {
    let is_path = |c: char| c.is_alphanumeric() || matches!(c, '_' | '/' | '.' | '-');
    let starts = ["src/", "tests/", "examples/", "machines/", "docs/"];
    (text.split(|c: char| !is_path(c)))
        .map(|word| word.trim_end_matches('.').trim_start_matches("../"))
        .filter(|word| starts.iter().any(|start| word.starts_with(start)))
        .filter(|word| word.ends_with('/') || word.rsplit('/').next().is_some_and(|name| name.contains('.')))
        .collect()
}

#[test]
fn files_that_the_documents_name_are_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut documents: Vec<PathBuf> = ["README.md", "CONTRIBUTING.md"].map(|name| root.join(name)).into();
    let pages = std::fs::read_dir(root.join("docs")).expect("documents");
    // A folder of pictures has a page of its own.
    let page = |path: PathBuf| if path.is_dir() { path.join("README.md") } else { path };
    documents.extend(pages.map(|entry| page(entry.expect("readable").path())));
    let mut wrong = Vec::new();
    for document in &documents {
        let text = read(document);
        let missing = named_paths(&text).into_iter().filter(|path| !root.join(path).exists());
        wrong.extend(missing.map(|path| format!("{}: {path}", document.display())));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert_eq!(
        named_paths("as `src/lie.rs` and (../machines/a.ron), in `src/cli/`."),
        ["machines/a.ron", "src/cli/", "src/lie.rs"].into()
    );
}

/// Whoever has the package alone can follow every link of its first page; every page of the documents is in the list of pages.
#[test]
fn links_of_the_readme_are_in_the_package_and_all_pages_are_listed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest = read(&root.join("Cargo.toml"));
    let list = manifest.split("include = [").nth(1).and_then(|rest| rest.split(']').next()).expect("a list");
    let packed: Vec<&str> = list.split('"').filter_map(|entry| entry.strip_prefix('/')).collect();
    let within = |link: &str, entry: &str| match entry.strip_suffix('*') {
        Some(begin) => link.starts_with(begin),
        None => link == entry || link.strip_prefix(entry).is_some_and(|rest| rest.starts_with('/')),
    };
    let readme = read(&root.join("README.md"));
    let links = readme.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next());
    let local = links.filter(|link| !link.is_empty() && !link.contains("://"));
    let missing: BTreeSet<&str> =
        local.filter(|link| !packed.iter().any(|entry| within(link, entry))).collect();
    assert!(missing.is_empty(), "linked from README.md and not in the package: {missing:?}");

    let map = read(&root.join("docs/README.md"));
    let all = map.split("## All pages").nth(1).expect("the list of all pages");
    let pages = std::fs::read_dir(root.join("docs")).expect("documents");
    let names = pages.map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned());
    let unlisted: Vec<_> = names
        .filter(|name| name.ends_with(".md") && name != "README.md" && !all.contains(&format!("({name})")))
        .collect();
    assert!(unlisted.is_empty(), "not in the list of all pages: {unlisted:?}");
}

/// Where one setting differs, every crate is built once more: minutes of CI.
#[test]
fn crates_of_users_are_built_in_the_profile_of_the_tests() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let profile = |file: &str, name: &str| -> BTreeSet<String> {
        let text = read(&root.join(file));
        let table = text.split_once(&format!("[profile.{name}]\n")).expect("a profile").1;
        let settings = table.lines().take_while(|line| !line.starts_with('['));
        settings.filter(|line| line.contains(" = ")).map(str::to_string).collect()
    };
    let of_tests = profile("Cargo.toml", "test");
    for file in ["tests/outside/Cargo.toml", "tests/users/programmer.sh", "python/Cargo.toml"] {
        assert_eq!(profile(file, "dev"), of_tests, "{file}");
    }
}

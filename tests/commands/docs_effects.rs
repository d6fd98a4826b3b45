//! `docs/effects.md` says what the library has and what the code cites.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common;
use kincal::effects::{Library, RecordingFacts};
use kincal::recording::Recording;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn document() -> String {
    fs::read_to_string(root().join("docs/effects.md")).expect("docs/effects.md")
}

/// The table of families, as the document must have it.
fn table(library: &Library) -> String {
    let mut table = String::from(
        "| effect | symbol | sits on | directions | features | reported |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    for family in library.families() {
        let list = |items: Vec<String>| items.join(", ");
        let sits = list(family.sits.iter().map(|s| format!("{s:?}").to_lowercase()).collect());
        let sits = match family.partner {
            Some(partner) => format!(
                "{sits}, with each {} joint",
                format!("{partner:?}").to_lowercase().replace("joint", "other")
            ),
            None => sits,
        };
        let directions = list(family.directions.iter().map(|d| format!("{d:?}").to_lowercase()).collect());
        let features: Vec<String> = match &family.scatter {
            Some(scatter) => vec![format!("spread: {scatter}")],
            None => family.features.iter().map(|f| f.to_string()).collect(),
        };
        let features = match features.len() {
            0..=3 => features.join("; "),
            n => format!("{}; {}; ... {}", features[0], features[1], features[n - 1]),
        };
        let reported = family.coefficients.iter().map(|o| match &o.is {
            kincal::effects::Meaning::Components(_) => "vx ... wz".to_string(),
            kincal::effects::Meaning::Curve => "curve".to_string(),
            _ => o.name.clone(),
        });
        let symbol = family.symbol.as_deref().unwrap_or("");
        let cells = [
            match &family.form_of {
                Some(whole) => format!("`{}`, a form of `{whole}`", family.name),
                None => format!("`{}`", family.name),
            },
            symbol.into(),
            sits,
            directions,
            features,
            list(reported.collect()),
        ];
        table += &format!("| {} |\n", cells.map(|c| c.replace('|', "\\|")).join(" | "));
    }
    table
}

#[test]
fn the_table_of_families_is_the_librarys() {
    let expected = table(&Library::standard());
    let document = document();
    let found = document.split("## The families\n\n").nth(1).map(|rest| {
        rest.lines()
            .take_while(|line| line.starts_with('|'))
            .map(|line| format!("{line}\n"))
            .collect::<String>()
    });
    assert_eq!(found.as_deref(), Some(expected.as_str()), "docs/effects.md should have:\n{expected}");
}

#[test]
fn the_family_of_the_document_is_added_without_code() {
    let document = document();
    let text =
        document.split("```ron\n").nth(1).and_then(|part| part.split("```").next()).expect("an example");
    let standard = Library::standard();
    let count = standard.families().len();
    let library = standard.with_text("example.ron", text).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(library.families().len(), count + 1);
    let machine = common::machine("linear_axis");
    let csv = "# measurement: position\nt[s],x[mm],px[mm],py[mm],pz[mm]\n0,0,0,0,0\n1,1,1,0,0\n2,2,2,0,0\n3,3,3,0,0\n".replace(
        "x[mm],px",
        &format!("{}[mm],px", machine.commands()[0]),
    );
    let recordings: Vec<Recording> =
        vec![Recording::from_bytes("e.csv", csv.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"))];
    let mut facts = RecordingFacts::of(&machine, &recordings).expect("facts");
    // Four samples are far apart; a machine would not be sampled like this.
    facts.settled = false;
    let candidates = library.candidates(&machine, &facts);
    let own = candidates.all.iter().find(|c| c.effect == "collet_droop").expect("a candidate");
    assert_eq!(own.coefficients.len(), 3);
    let again = library.clone().with_text("example.ron", text).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(again.families().len(), count + 1, "a family of the same name is replaced");
}

#[test]
fn equations_go_on_from_forty_and_every_one_cited_exists() {
    let document = document();
    let numbers: Vec<u32> = document
        .lines()
        .filter(|line| line.starts_with("    ") && line.ends_with(')'))
        .filter_map(|line| line.rsplit_once("  (")?.1.trim_end_matches(')').parse().ok())
        .collect();
    assert_eq!(numbers, (40..=49).collect::<Vec<_>>());
    let mut files = vec![root().join("src")];
    let mut citations = 0;
    while let Some(path) = files.pop() {
        if path.is_dir() {
            files.extend(fs::read_dir(path).expect("a folder").map(|e| e.expect("an entry").path()));
            continue;
        }
        let text =
            if path.extension().is_some_and(|e| e == "rs") { fs::read_to_string(&path) } else { continue };
        for line in text.expect("a source file").lines() {
            let Some((_, after)) = line.split_once("docs/effects.md") else { continue };
            let cited =
                after.trim_start_matches('`').strip_prefix(" (").and_then(|rest| rest.split(')').next());
            let Some(number) = cited.and_then(|n| n.parse::<u32>().ok()) else { continue };
            assert!(numbers.contains(&number), "{}: no equation ({number})", path.display());
            citations += 1;
        }
    }
    assert!(citations >= 8, "{citations} citations");
}

#[test]
fn every_word_of_the_language_is_taught() {
    let source =
        fs::read_to_string(Path::new(&root()).join("src/feature/expression.rs")).expect("the language");
    let variants =
        source.split("pub enum Expression {").nth(1).and_then(|s| s.split("\n}").next()).expect("variants");
    let document = document();
    for line in variants.lines().map(str::trim).filter(|l| l.starts_with(char::is_uppercase)) {
        let word = line.split(['(', ',']).next().unwrap_or_default();
        assert!(
            document.contains(&format!("`{word}`")) || document.contains(&format!("`{word}(")),
            "{word} is not taught"
        );
    }
}

#[test]
fn every_family_says_what_is_at_fault_and_what_to_do() {
    for family in Library::standard().families() {
        assert!(!family.cause.is_empty() && !family.remedy.is_empty(), "{}", family.name);
        // They stand within sentences.
        assert!(!family.remedy.ends_with('.') && !family.cause.ends_with('.'), "{}", family.name);
    }
}

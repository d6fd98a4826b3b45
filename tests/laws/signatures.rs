//! The pictures of effects are those of the library.

use std::path::Path;

use kincal::effects::Library;

use crate::signatures_drawn::draw;

/// Words of a text, and its numbers apart.
fn taken_apart(text: &str) -> (String, Vec<f64>) {
    let (mut words, mut numbers, mut number) = (String::new(), Vec::new(), String::new());
    for letter in text.chars().chain([' ']) {
        let goes_on = letter.is_ascii_digit() || letter == '.';
        // A sign begins a number: `12-5` are two of them.
        if !goes_on && !number.is_empty() {
            match number.parse() {
                Ok(value) => numbers.push(value),
                Err(_) => words.push_str(&number),
            }
            number.clear();
        }
        if goes_on || letter == '-' {
            number.push(letter);
        } else if !letter.is_whitespace() {
            words.push(letter);
        }
    }
    (words, numbers)
}

#[test]
fn what_is_stored_is_what_the_library_draws() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/effects");
    let drawn = draw(&Library::standard());
    let again = "cargo run --release --features measure --example signatures";
    let mut files: Vec<String> = std::fs::read_dir(&folder)
        .expect("docs/effects")
        .map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned())
        .collect();
    let mut expected: Vec<String> = drawn.iter().map(|own| own.file.clone()).collect();
    files.sort();
    expected.sort();
    assert_eq!(files, expected, "{again}");
    for own in &drawn {
        let stored = std::fs::read_to_string(folder.join(&own.file)).expect("it is listed");
        // Rounding differs from processor to processor: a point may stand one step aside, and both ways to it and from it with it.
        let ((words, numbers), (own_words, own_numbers)) = (taken_apart(&stored), taken_apart(&own.text));
        assert!(words == own_words, "{}: {again}", own.file);
        assert_eq!(numbers.len(), own_numbers.len(), "{}: {again}", own.file);
        for (a, b) in numbers.iter().zip(&own_numbers) {
            assert!((a - b).abs() <= 2.0, "{}: {a} {b}: {again}", own.file);
        }
        // Small enough for a page with all of them.
        assert!(own.text.len() < 13_000 || own.file == "README.md", "{}: {} bytes", own.file, own.text.len());
    }
}

#[test]
fn every_family_has_its_picture() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/effects/README.md");
    let page = std::fs::read_to_string(page).expect("docs/effects/README.md");
    let library = Library::standard();
    for name in library.names() {
        assert!(
            page.contains(&format!("## {name}\n")) && page.contains(&format!("\"{name}.svg\"")),
            "{name}"
        );
    }
    // Links lead to what is there.
    for link in page.split("](#").skip(1).filter_map(|rest| rest.split(')').next()) {
        assert!(page.contains(&format!("## {link}\n")), "{link}");
    }
}

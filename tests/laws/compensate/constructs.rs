//! One unusual construct a file, between two ordinary moves: refused with its line, or followed.

use super::*;
use kincal::nc::Dialect;

/// What becomes of every file of a folder: the refusal, or what is written from the construct on.
fn outcomes(folder: &str, dialect: Dialect) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/nc").join(folder);
    let mut files: Vec<_> =
        std::fs::read_dir(path).expect("part of the project").map(|e| e.expect("readable").path()).collect();
    files.sort();
    let calibrated = erroneous("ac_table_tilting", 1.0);
    let setup = r#"Setup(tools: {"2": 100, "3": 100, "5": 100, "MILL_8": 100, "H1": 100}, work_offsets: {"G55": {"X": 1}, "G505": {"X": 1}})"#;
    let setup = Setup::parse("setup.ron", setup).unwrap_or_else(|e| panic!("{e}"));
    let options = CompensateOptions::default().with_dialect(dialect).with_arcs(5e-6);
    let told = files.into_iter().map(|path| {
        let text = std::fs::read(&path).expect("readable");
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        match compensate_text(&calibrated, &name, &text, &setup, &options) {
            Err(error) => {
                assert!(
                    error.place().is_some_and(|place| place.line > 0) && !error.mend().is_empty(),
                    "{error}"
                );
                format!("REFUSED {error} | {}", error.mend())
            }
            Ok((out, report)) => {
                let left = report.largest_left_m.value.max(report.largest_cycle_m.value);
                let how = VerifyOptions::default().with_tolerance(left + 1e-9).with_dialect(dialect);
                let found = verify_text(&calibrated, &text, &out, &setup, &how);
                let found = found.unwrap_or_else(|e| panic!("{name}: {e}\n{out}"));
                assert!(found.holds(), "{name}: {found:?}\n{out}");
                let lines: Vec<&str> = out.lines().skip(3).collect();
                format!("{name}: {}", lines.join(" | "))
            }
        }
    });
    told.collect::<Vec<_>>().join("\n")
}

#[test]
fn constructs_of_rs274_are_followed_or_refused() {
    insta::assert_snapshot!(outcomes("rs274", Dialect::Rs274));
}

#[test]
fn constructs_of_siemens_are_followed_or_refused() {
    insta::assert_snapshot!(outcomes("siemens", Dialect::Siemens));
}

#[test]
fn constructs_of_heidenhain_are_followed_or_refused() {
    insta::assert_snapshot!(outcomes("heidenhain", Dialect::Heidenhain));
}

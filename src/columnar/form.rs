//! Which kind of file it is.

use std::path::Path;

use crate::error::{Error, Place, Result};

/// A kind of file that holds a table in columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    Parquet,
    /// Arrow's file format, which is also Feather's second version.
    Arrow,
    /// Arrow's batches one after the other, without a list of them.
    Stream,
}

impl Form {
    /// What a file is that begins so.
    ///
    /// # Errors
    /// As [`Form::of`], and if only its name says that it is one.
    pub fn of_file(file: &Path, start: &[u8]) -> Result<Option<Form>> {
        match (Form::of(file, start)?, Form::named(file)) {
            (None, Some(form)) if !start.is_empty() => {
                let what = format!(
                    "file has the name of {}, and does not begin as one does ({})",
                    form.word(),
                    form.magic()
                );
                let mend = "copy it again, or write it anew; a table of text is named .csv";
                Err(Error::mistake(Place::file(file), what, mend))
            }
            (form, _) => Ok(form),
        }
    }

    /// What these bytes begin, whatever name messages give them.
    ///
    /// # Errors
    /// [`Error::Input`] if it is of a version or kind that nothing here reads.
    pub fn of(file: &Path, start: &[u8]) -> Result<Option<Form>> {
        let fault = |what: &str, mend: &str| Err(Error::mistake(Place::file(file), what, mend));
        match start {
            [b'P', b'A', b'R', b'1', ..] => Ok(Some(Form::Parquet)),
            [b'A', b'R', b'R', b'O', b'W', b'1', ..] => Ok(Some(Form::Arrow)),
            // A stream begins with a message that is longer than none.
            [0xff, 0xff, 0xff, 0xff, length @ ..] if length.iter().any(|byte| *byte != 0) => {
                Ok(Some(Form::Stream))
            }
            [b'P', b'A', b'R', b'E', ..] => {
                fault("this is a Parquet file whose footer is encrypted", "write it anew without encryption")
            }
            [b'F', b'E', b'A', b'1', ..] => fault(
                "this is a Feather file of version 1",
                "write it anew as version 2: `pyarrow.feather.write_feather(pyarrow.feather.read_table('OLD'), 'NEW.feather')`",
            ),
            _ => Ok(None),
        }
    }

    /// What a file of this name is to be.
    pub fn named(file: &Path) -> Option<Form> {
        let ending = file.extension()?.to_str()?.to_ascii_lowercase();
        match ending.as_str() {
            "parquet" | "pq" => Some(Form::Parquet),
            "arrow" | "feather" | "ipc" => Some(Form::Arrow),
            "arrows" => Some(Form::Stream),
            _ => None,
        }
    }

    /// For messages.
    pub fn word(self) -> &'static str {
        match self {
            Form::Parquet => "a Parquet file",
            Form::Arrow => "an Arrow file",
            Form::Stream => "an Arrow stream",
        }
    }

    fn magic(self) -> &'static str {
        match self {
            Form::Parquet => "`PAR1`",
            Form::Arrow => "`ARROW1`",
            Form::Stream => "four bytes ff",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_say_what_a_file_is_and_its_name_does_not() {
        let form =
            |name: &str, start: &[u8]| Form::of_file(Path::new(name), start).map_err(|e| e.to_string());
        for name in ["a.csv", "a.parquet", "a"] {
            assert_eq!(form(name, b"PAR1\x15\x04\x15\x10"), Ok(Some(Form::Parquet)));
            assert_eq!(form(name, b"ARROW1\0\0"), Ok(Some(Form::Arrow)));
            assert_eq!(form(name, b"\xff\xff\xff\xff\x10\x01\0\0"), Ok(Some(Form::Stream)));
            assert_eq!(form(name, b""), Ok(None));
            assert!(form(name, b"PARE").is_err() && form(name, b"FEA1").is_err());
        }
        assert_eq!(form("a.csv", b"# measur"), Ok(None));
        assert!(matches!(Form::of(Path::new("a.parquet"), b"# measur"), Ok(None)));
        let said = form("a.Feather", b"# measur").expect_err("no such file");
        assert_eq!(
            said,
            "a.Feather: file has the name of an Arrow file, and does not begin as one does (`ARROW1`)"
        );
    }
}

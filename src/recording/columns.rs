//! A recording as it is written, taken into a table in columns.

use std::io;
use std::path::{Path, PathBuf};

use super::text::{bare, number, shown, split};
use crate::columnar::{Form, Writer};
use crate::error::{Error, Place, Result};

/// The bytes of a file of this name that holds a recording. Where the name ends in `.parquet`, `.arrow` or `.feather` it is a table in
/// columns (feature `columnar`): numbers of eight bytes under their names with units, and the lines `# key: value` in the schema's metadata,
/// under the key `kincal`. [`Recording::open`](super::Recording::open) reads the same samples from it, to the last bit. Else it is the text.
///
/// # Errors
/// [`Error::Input`]: a table in columns in a build without the feature, or of what is no recording.
pub fn bytes_of(file: impl AsRef<Path>, text: &str) -> Result<Vec<u8>> {
    let file = file.as_ref();
    let Some(form) = Form::named(file) else { return Ok(text.as_bytes().to_vec()) };
    let mut columns = Columns::new(file, form)?;
    // Never fails: what is wrong is told at the end.
    let _ = io::Write::write(&mut columns, text.as_bytes());
    columns.finish()
}

/// Takes the text of a recording, and makes of it the bytes of a file in columns.
pub(crate) struct Columns {
    file: PathBuf,
    form: Form,
    /// A line whose end has not come.
    begun: Vec<u8>,
    head: String,
    names: Vec<String>,
    writer: Option<Writer>,
    row: Vec<f64>,
    lines: usize,
    failed: Option<Error>,
}

impl Columns {
    /// The file's name is for messages.
    ///
    /// # Errors
    /// In a build that writes no such files.
    pub fn new(file: &Path, form: Form) -> Result<Columns> {
        Writer::possible(file, form)?;
        Ok(Columns {
            file: file.to_path_buf(),
            form,
            begun: Vec::new(),
            head: String::new(),
            names: Vec::new(),
            writer: None,
            row: Vec::new(),
            lines: 0,
            failed: None,
        })
    }

    /// All of the file.
    ///
    /// # Errors
    /// What the text is no recording for: no header row, a field that is no number, a row that is not as long as the others.
    pub fn finish(mut self) -> Result<Vec<u8>> {
        let last = std::mem::take(&mut self.begun);
        self.line(&last)?;
        if let Some(error) = self.failed {
            return Err(error);
        }
        match self.writer {
            Some(writer) => writer.finish(),
            None => {
                Err(Error::mistake(Place::file(&self.file), "no row names the columns", "give a recording"))
            }
        }
    }

    fn line(&mut self, line: &[u8]) -> Result<()> {
        self.lines += 1;
        let line = line.trim_ascii();
        let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
        let Some(writer) = &mut self.writer else {
            if line.starts_with(b"#") {
                self.head.push_str(String::from_utf8_lossy(line).trim_end());
                self.head.push('\n');
            } else if !line.is_empty() {
                let names = &mut self.names;
                split(line, |field| names.push(String::from_utf8_lossy(bare(field)).into_owned()));
                self.writer = Some(Writer::begin(&self.file, self.form, &self.head, self.names.clone())?);
            }
            return Ok(());
        };
        if line.is_empty() || line.starts_with(b"#") {
            return Ok(());
        }
        self.row.clear();
        let (row, mut bad) = (&mut self.row, None);
        split(line, |field| match number(field) {
            Some(number) => row.push(number),
            None => bad = bad.take().or_else(|| Some((row.len(), shown(field)))),
        });
        let at = |column: usize, what: String, mend: &str| {
            Err(Error::mistake(Place::at(&self.file, self.lines, column), what, mend))
        };
        if let Some((k, text)) = bad {
            let what = format!("`{text}` in column `{}` is no number", self.names.get(k).map_or("", |n| n));
            return at(k + 1, what, "a table in columns holds numbers; name a file that ends in .csv");
        }
        if row.len() != self.names.len() {
            let what = format!("row has {} fields, header row has {}", row.len(), self.names.len());
            return at(0, what, "give every row as many fields");
        }
        writer.push(row)
    }
}

impl io::Write for Columns {
    /// What is wrong with it is told by [`Columns::finish`].
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut rest = bytes;
        while let (None, Some(end)) = (&self.failed, rest.iter().position(|byte| *byte == b'\n')) {
            let mut line = std::mem::take(&mut self.begun);
            line.extend_from_slice(&rest[..end]);
            rest = &rest[end + 1..];
            self.failed = self.line(&line).err();
            line.clear();
            self.begun = line;
        }
        if self.failed.is_none() {
            self.begun.extend_from_slice(rest);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

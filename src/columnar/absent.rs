//! What stands for readers and writers in a build without them.

use std::convert::Infallible;
use std::path::Path;

use super::{Form, Input, Named};
use crate::error::{Error, Place, Result};

/// A table that nothing opens.
pub(crate) struct Table(Infallible);

impl Table {
    /// # Errors
    /// Always: how to build a reader, or to do without.
    pub fn open(file: &Path, form: Form, _: Input) -> Result<Table> {
        let name = file.display();
        let python = match form {
            Form::Parquet => format!("pandas.read_parquet('{name}')"),
            Form::Arrow => format!("pandas.read_feather('{name}')"),
            Form::Stream => format!("pyarrow.ipc.open_stream('{name}').read_pandas()"),
        };
        let csv = file.with_extension("csv");
        let csv = csv.display();
        let duckdb = match form {
            Form::Parquet => format!("`duckdb -c \"COPY '{name}' TO '{csv}'\"`, or in Python "),
            _ => String::new(),
        };
        let mend =
            format!("{}, or write it as CSV: {duckdb}`{python}.to_csv('{csv}', index=False)`", build());
        Err(Error::mistake(
            Place::file(file),
            format!("this is {}, which this build of kincal does not read", form.word()),
            mend,
        ))
    }

    pub fn head(&self) -> Option<String> {
        match self.0 {}
    }

    pub fn columns(&self) -> Vec<Named> {
        match self.0 {}
    }

    pub fn batch(&mut self, _: impl FnMut(&[String])) -> Result<bool> {
        match self.0 {}
    }
}

/// A writer that nothing begins.
pub(crate) struct Writer(Infallible);

impl Writer {
    /// # Errors
    /// Always: how to build a writer, or to do without.
    pub fn possible(file: &Path, form: Form) -> Result<()> {
        let mend = format!("{}, or name a file that ends in .csv", build());
        Err(Error::mistake(
            Place::file(file),
            format!(
                "this build of kincal writes no {}",
                form.word().trim_start_matches("an ").trim_start_matches("a ")
            ),
            mend,
        ))
    }

    pub fn begin(file: &Path, form: Form, _: &str, _: Vec<String>) -> Result<Writer> {
        match Writer::possible(file, form) {
            Err(error) => Err(error),
            Ok(()) => Err(Error::mistake(Place::file(file), "nothing writes it", build())),
        }
    }

    pub fn push(&mut self, _: &[f64]) -> Result<()> {
        match self.0 {}
    }

    pub fn finish(self) -> Result<Vec<u8>> {
        match self.0 {}
    }
}

fn build() -> String {
    "build it with `--features columnar`".into()
}

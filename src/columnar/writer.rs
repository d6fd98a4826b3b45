//! A recording written as a table in columns.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use arrow_ipc::CompressionType;
use arrow_ipc::writer::{FileWriter, IpcWriteOptions, StreamWriter};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;

use super::{Form, KEY};
use crate::error::{Error, Result};

/// Rows that are handed over at once.
const ROWS: usize = 1 << 16;

/// Takes rows of numbers, and makes the bytes of a file of them.
pub(crate) struct Writer {
    file: PathBuf,
    schema: Arc<Schema>,
    /// By column, `None` for a drop-out.
    values: Vec<Vec<Option<f64>>>,
    inner: Inner,
}

enum Inner {
    Parquet(ArrowWriter<Vec<u8>>),
    Arrow(FileWriter<Vec<u8>>),
    Stream(StreamWriter<Vec<u8>>),
}

impl Writer {
    /// Whether a file of this form can be written.
    ///
    /// # Errors
    /// None in this build.
    pub fn possible(_: &Path, _: Form) -> Result<()> {
        Ok(())
    }

    /// A file with these columns of numbers; `head` are the lines `# key: value` of the recording.
    pub fn begin(file: &Path, form: Form, head: &str, names: Vec<String>) -> Result<Writer> {
        let fields: Vec<Field> = names.iter().map(|name| Field::new(name, DataType::Float64, true)).collect();
        let metadata = HashMap::from([(KEY.to_string(), head.to_string())]);
        let schema = Arc::new(Schema::new_with_metadata(fields, metadata));
        let failed = |says: String| Error::file(file, std::io::Error::other(says));
        let told = |e: arrow_schema::ArrowError| failed(e.to_string());
        let options = || IpcWriteOptions::default().try_with_compression(Some(CompressionType::LZ4_FRAME));
        let inner = match form {
            Form::Parquet => {
                // Beside the schema of Arrow, which not every reader looks at.
                let own = vec![KeyValue::new(KEY.to_string(), head.to_string())];
                let properties = WriterProperties::builder()
                    .set_compression(Compression::ZSTD(ZstdLevel::default()))
                    .set_key_value_metadata(Some(own))
                    .build();
                let writer = ArrowWriter::try_new(Vec::new(), schema.clone(), Some(properties));
                Inner::Parquet(writer.map_err(|e| failed(e.to_string()))?)
            }
            Form::Arrow => Inner::Arrow(
                FileWriter::try_new_with_options(Vec::new(), &schema, options().map_err(told)?)
                    .map_err(told)?,
            ),
            Form::Stream => Inner::Stream(
                StreamWriter::try_new_with_options(Vec::new(), &schema, options().map_err(told)?)
                    .map_err(told)?,
            ),
        };
        Ok(Writer { file: file.to_path_buf(), schema, values: vec![Vec::new(); names.len()], inner })
    }

    /// A row, as many numbers as there are columns; NaN for a drop-out.
    pub fn push(&mut self, row: &[f64]) -> Result<()> {
        for (column, value) in self.values.iter_mut().zip(row) {
            column.push((!value.is_nan()).then_some(*value));
        }
        if self.values.first().is_some_and(|column| column.len() >= ROWS) { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        let array = |column: &mut Vec<Option<f64>>| -> ArrayRef {
            Arc::new(Float64Array::from(std::mem::take(column)))
        };
        let arrays = self.values.iter_mut().map(array).collect();
        let batch = RecordBatch::try_new(self.schema.clone(), arrays).map_err(|e| self.failed(&e))?;
        match &mut self.inner {
            Inner::Parquet(writer) => writer.write(&batch).map_err(|e| e.to_string()),
            Inner::Arrow(writer) => writer.write(&batch).map_err(|e| e.to_string()),
            Inner::Stream(writer) => writer.write(&batch).map_err(|e| e.to_string()),
        }
        .map_err(|e| self.failed(&e))
    }

    /// All of the file.
    pub fn finish(mut self) -> Result<Vec<u8>> {
        self.flush()?;
        let file = self.file.clone();
        match self.inner {
            Inner::Parquet(writer) => writer.into_inner().map_err(|e| e.to_string()),
            Inner::Arrow(writer) => writer.into_inner().map_err(|e| e.to_string()),
            Inner::Stream(writer) => writer.into_inner().map_err(|e| e.to_string()),
        }
        .map_err(|e| Error::file(file, std::io::Error::other(e)))
    }

    fn failed(&self, says: &impl ToString) -> Error {
        Error::file(&self.file, std::io::Error::other(says.to_string()))
    }
}

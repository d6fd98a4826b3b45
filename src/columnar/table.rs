//! A table in columns, read batch by batch.

use std::io::{BufReader, Cursor, Read, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_ipc::reader::{FileReader, StreamReader};
use arrow_schema::{ArrowError, DataType, Schema};
use bytes::Bytes;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::Compression;
use parquet::file::metadata::ParquetMetaData;
use parquet::file::reader::ChunkReader;

use super::field::{self, Fields};
use super::messages::{self, Messages};
use super::{Form, Input, KEY, Named};
use crate::error::{Error, Place, Result};
use crate::wording::shown;

/// Rows of a batch of a Parquet file.
const ROWS: usize = 4096;

/// An opened table; rows are read as they are asked for.
pub(crate) struct Table {
    file: PathBuf,
    schema: Arc<Schema>,
    batches: Box<dyn Iterator<Item = std::result::Result<RecordBatch, ArrowError>> + Send>,
}

impl Table {
    /// # Errors
    /// [`Error::Input`]: a file that is not whole, a compression or a type of a column that is not read.
    pub fn open(file: &Path, form: Form, input: Input) -> Result<Table> {
        let (schema, batches) = whole(file, || match (form, input) {
            (Form::Parquet, Input::File(inner)) => parquet(file, inner),
            (Form::Parquet, Input::Bytes(bytes)) => parquet(file, Bytes::from_owner(bytes)),
            (_, Input::File(inner)) => arrow(form, BufReader::new(inner)),
            (_, Input::Bytes(bytes)) => arrow(form, Cursor::new(bytes)),
        })?;
        // Rows of nothing have no end that anything holds them to.
        if schema.fields().iter().all(|column| *column.data_type() == DataType::Null) {
            let mend = "give a table with one sample a row";
            return Err(Error::mistake(Place::file(file), "no column has anything in it", mend));
        }
        for (i, column) in schema.fields().iter().enumerate() {
            if !field::is_read(column.data_type()) {
                let what = format!("column `{}` holds {}", shown(column.name()), kind(column.data_type()));
                return Err(Error::mistake(Place::at(file, 0, i + 1), what, mend(column.data_type())));
            }
        }
        Ok(Table { file: file.to_path_buf(), schema, batches })
    }

    /// The lines `# key: value` of a recording, each with its line end, where the file has them.
    pub fn head(&self) -> Option<String> {
        let text = self.schema.metadata().get(KEY)?;
        let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
        Some(lines.map(|l| if l.starts_with('#') { format!("{l}\n") } else { format!("# {l}\n") }).collect())
    }

    pub fn columns(&self) -> Vec<Named> {
        let named =
            |f: &Arc<arrow_schema::Field>| Named { name: f.name().clone(), unit: field::unit(f.data_type()) };
        self.schema.fields().iter().map(named).collect()
    }

    /// Calls `take` with each row of the next batch; `false` behind the last one.
    ///
    /// # Errors
    /// [`Error::Input`]: a file that is not whole.
    pub fn batch(&mut self, mut take: impl FnMut(&[String])) -> Result<bool> {
        let Table { file, batches, .. } = self;
        let Some(batch) = whole(file, || batches.next().transpose().map_err(|e| e.to_string().into()))?
        else {
            return Ok(false);
        };
        let damaged = || Wrong::Damaged("a column is not of its type".into());
        let fields: Vec<Fields> = (batch.columns().iter())
            .map(|array| Fields::of(&**array))
            .collect::<Option<_>>()
            .ok_or_else(|| damaged().error(file))?;
        let mut row = vec![String::new(); fields.len()];
        for i in 0..batch.num_rows() {
            for (text, fields) in row.iter_mut().zip(&fields) {
                text.clear();
                fields.push(i, text);
            }
            take(&row);
        }
        Ok(true)
    }
}

/// Why a file is not read.
enum Wrong {
    Damaged(String),
    Told(Error),
}

impl From<String> for Wrong {
    fn from(text: String) -> Self {
        Wrong::Damaged(text)
    }
}

impl Wrong {
    fn error(self, file: &Path) -> Error {
        match self {
            Wrong::Told(error) => error,
            Wrong::Damaged(says) => {
                // `Parquet error: Invalid Parquet file. ...`
                let says = says.split_once("error: ").map_or(&*says, |(_, says)| says);
                let what = format!("file is cut short or damaged: {}", shown(says));
                Error::mistake(Place::file(file), what, "copy it again, or write it anew")
            }
        }
    }
}

/// What a reader of damaged bytes says. The readers check what they can, but some damage makes them panic, and a file that came by mail must
/// not end whoever reads it.
fn whole<T>(file: &Path, read: impl FnOnce() -> std::result::Result<T, Wrong>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(read))
        .unwrap_or_else(|_| Err(Wrong::Damaged("what it holds contradicts itself".into())))
        .map_err(|wrong| wrong.error(file))
}

type Opened = (Arc<Schema>, Box<dyn Iterator<Item = std::result::Result<RecordBatch, ArrowError>> + Send>);

fn arrow<R: Read + Seek + Send + 'static>(form: Form, mut input: R) -> std::result::Result<Opened, Wrong> {
    if form == Form::Stream {
        let messages = Messages::new(Box::new(input));
        let reader = StreamReader::try_new(messages, None).map_err(|e| e.to_string())?;
        return Ok((reader.schema(), Box::new(reader)));
    }
    messages::check_file(&mut input).map_err(|e| e.to_string())?;
    let reader = FileReader::try_new(input, None).map_err(|e| e.to_string())?;
    Ok((reader.schema(), Box::new(reader)))
}

fn parquet<R: ChunkReader + 'static>(file: &Path, input: R) -> std::result::Result<Opened, Wrong> {
    let length = input.len();
    let builder = ParquetRecordBatchReaderBuilder::try_new(input).map_err(|e| e.to_string())?;
    compressions(file, builder.metadata())?;
    let columns = || builder.metadata().row_groups().iter().flat_map(|group| group.columns());
    let is_within = |(from, size): (u64, u64)| from.checked_add(size).is_some_and(|to| to <= length);
    if !columns().all(|column| is_within(column.byte_range())) {
        return Err("a column lies beyond its end".to_string().into());
    }
    let schema = builder.schema().clone();
    let reader = builder.with_batch_size(ROWS).build().map_err(|e| e.to_string())?;
    Ok((schema, Box::new(reader)))
}

fn compressions(file: &Path, metadata: &ParquetMetaData) -> std::result::Result<(), Wrong> {
    use Compression::{GZIP, LZ4, LZ4_RAW, SNAPPY, UNCOMPRESSED, ZSTD};
    for column in metadata.row_groups().iter().flat_map(|group| group.columns()) {
        let by = column.compression();
        if !matches!(by, UNCOMPRESSED | SNAPPY | GZIP(_) | LZ4 | LZ4_RAW | ZSTD(_)) {
            let name = shown(&column.column_path().string());
            let by = by.to_string().to_lowercase();
            let by = by.split('(').next().unwrap_or_default();
            let what = format!("column `{name}` is compressed by {by}, which is not read");
            let mend = "write it anew with the compression snappy, zstd, gzip or lz4";
            return Err(Wrong::Told(Error::mistake(Place::file(file), what, mend)));
        }
    }
    Ok(())
}

/// What a column that is not read holds.
fn kind(kind: &DataType) -> &'static str {
    use DataType::*;
    match kind {
        Struct(_) => "several values a row",
        List(_) | LargeList(_) | FixedSizeList(..) | ListView(_) | LargeListView(_) => "a list in each row",
        Map(..) => "a map in each row",
        Union(..) => "values of different types",
        Date32 | Date64 => "dates without a time of day",
        Interval(_) => "calendar intervals",
        Binary | LargeBinary | FixedSizeBinary(_) | BinaryView => "bytes",
        _ => "values of a type that is not read",
    }
}

fn mend(kind: &DataType) -> &'static str {
    use DataType::*;
    match kind {
        Struct(_) | List(_) | LargeList(_) | FixedSizeList(..) | ListView(_) | LargeListView(_) | Map(..) => {
            "give every number a column of its own (`unnest` in DuckDB and polars), or leave the column out"
        }
        Date32 | Date64 => "make it a timestamp, or leave the column out",
        Interval(_) => "make it a duration or a number, or leave the column out",
        _ => "make it a column of numbers or text, or leave it out",
    }
}

//! Tables in columns: Parquet files, Arrow files and streams (also named Feather), read row by row as text, and written.
//!
//! What such a file holds becomes what the same table would be as CSV: numbers with the digits that their type has, moments as dates with a
//! time of day, an empty field where there is nothing. The schema's metadata may hold, under the key `kincal`, the lines `# key: value` of a
//! recording; a file with them is a recording by itself. The feature `columnar` brings the readers; without it such files are known and
//! refused with what to do.

#[cfg(not(feature = "columnar"))]
mod absent;
#[cfg(feature = "columnar")]
mod field;
mod form;
#[cfg(feature = "columnar")]
mod messages;
#[cfg(feature = "columnar")]
mod table;
mod text;
#[cfg(feature = "columnar")]
mod writer;

#[cfg(not(feature = "columnar"))]
pub(crate) use absent::{Table, Writer};
pub(crate) use form::Form;
#[cfg(feature = "columnar")]
pub(crate) use table::Table;
pub(crate) use text::Text;
#[cfg(feature = "columnar")]
pub(crate) use writer::Writer;

use std::fs::File;
use std::sync::Arc;

/// Where the bytes of such a file are.
#[derive(Debug)]
#[cfg_attr(not(feature = "columnar"), expect(dead_code))]
pub(crate) enum Input {
    File(File),
    Bytes(Arc<[u8]>),
}

/// Key of the schema's metadata under which the head of a recording stands.
#[cfg(feature = "columnar")]
const KEY: &str = "kincal";

/// A column's heading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Named {
    pub name: String,
    /// What its numbers count, where its type says so: durations.
    pub unit: Option<&'static str>,
}

//! A recording in columns as the text that it would be as CSV, in memory that does not grow with it.

use std::io::{self, Read};
use std::path::Path;

use super::{Form, Input, Table};
use crate::error::Result;

/// Lines `# key: value`, the names of the columns, and a line for each row.
pub(crate) struct Text {
    table: Table,
    lines: String,
    /// Bytes of these lines that have been read.
    read: usize,
    /// Whether it has such lines `# key: value`: without them it is a table, and no recording.
    pub has_head: bool,
}

impl Text {
    /// # Errors
    /// As [`Table::open`].
    pub fn open(file: &Path, form: Form, input: Input) -> Result<Text> {
        let table = Table::open(file, form, input)?;
        let head = table.head();
        let (has_head, mut lines) = (head.is_some(), head.unwrap_or_default());
        let names: Vec<String> = table.columns().into_iter().map(|column| column.name).collect();
        push_line(&names, &mut lines);
        Ok(Text { table, lines, read: 0, has_head })
    }
}

/// Fields as a line; what would be taken for more than one is put in quotes.
pub(super) fn push_line(fields: &[String], out: &mut String) {
    for (i, field) in fields.iter().enumerate() {
        if i > 0 {
            out.push(',');
        }
        if field.contains([',', '"', '\n', '\r']) {
            out.push('"');
            out.extend(field.chars().map(|c| if ['"', '\n', '\r'].contains(&c) { ' ' } else { c }));
            out.push('"');
        } else {
            out.push_str(field);
        }
    }
    out.push('\n');
}

impl Read for Text {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.read == self.lines.len() {
            (self.read, self.lines) = (0, std::mem::take(&mut self.lines));
            self.lines.clear();
            let Text { table, lines, .. } = self;
            // What is wrong comes out again as it is: `Error::file` knows it.
            if !table.batch(|fields| push_line(fields, lines)).map_err(io::Error::other)? {
                return Ok(0);
            }
        }
        let rest = &self.lines.as_bytes()[self.read..];
        let length = rest.len().min(buffer.len());
        buffer[..length].copy_from_slice(&rest[..length]);
        self.read += length;
        Ok(length)
    }
}

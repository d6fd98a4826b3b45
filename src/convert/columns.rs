//! Foreign tables in columns: Parquet and Arrow.

use std::path::Path;

use csv::StringRecord;

use super::heading::Heading;
use super::table::{Row, Table, Told};
use crate::columnar::{self, Form, Input};
use crate::error::{Error, Place, Result};

/// The table, and the same as CSV for those who look for a table within it.
pub(super) fn read(file: &Path, bytes: &[u8], form: Form, told: &Told) -> Result<(Table, Vec<u8>)> {
    let mut source = columnar::Table::open(file, form, Input::Bytes(bytes.into()))?;
    let columns = source.columns();
    let headings = columns.iter().map(|column| {
        let heading = Heading::read(&column.name);
        match column.unit {
            Some(unit) => heading.with_unit(unit),
            None => heading,
        }
    });
    let headings: Vec<Heading> = headings.collect();
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let mut text = csv::Writer::from_writer(Vec::new());
    // Into memory, and as many fields as names.
    let _ = text.write_record(names);
    let (mut rows, mut line) = (Vec::new(), 0);
    while source.batch(|fields| {
        line += 1;
        let fields: StringRecord = fields.iter().map(|field| field.trim()).collect();
        let _ = text.write_record(&fields);
        if fields.iter().any(|field| !field.is_empty()) {
            rows.push(Row { line, fields });
        }
    })? {}
    if rows.is_empty() {
        let mend = "give a table with one sample a row";
        return Err(Error::mistake(Place::file(file), "table has no row with anything in it", mend));
    }
    let table = Table {
        file: file.to_path_buf(),
        headings,
        line: 0,
        rows,
        separator: None,
        // Of numbers that are text.
        decimal_comma: told.decimal_comma.unwrap_or(false),
    };
    Ok((table.named(&told.names, columns.len())?, text.into_inner().unwrap_or_default()))
}

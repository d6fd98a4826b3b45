//! Arrays in the file format of NumPy, versions 1 to 3: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>.
//!
//! A header of Python's literals says type, order and shape: `{'descr': '<f8', 'fortran_order': False, 'shape': (100, 3), }`; numbers
//! follow. A structured array has a list of names and types as `descr`.

use std::path::Path;

use super::table::{Table, Told};
use crate::error::{Error, Place, Result};
use crate::wording::shown;

/// A type of number, as wide as it is written.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Number {
    kind: u8,
    bytes: usize,
    big_endian: bool,
}

impl Number {
    /// `<f8`, `>i4`, `|u1`.
    fn of(descr: &str) -> Option<Number> {
        let (order, rest) = (descr.chars().next()?, descr.get(1..)?);
        let kind = *rest.as_bytes().first()?;
        let bytes: usize = rest.get(1..)?.parse().ok()?;
        let known = matches!((kind, bytes), (b'f', 4 | 8) | (b'i' | b'u', 1 | 2 | 4 | 8) | (b'b', 1));
        (known && "<>|=".contains(order)).then_some(Number { kind, bytes, big_endian: order == '>' })
    }

    fn read(self, bytes: &[u8]) -> f64 {
        let mut wide = [0u8; 8];
        for (i, slot) in wide.iter_mut().take(self.bytes).enumerate() {
            let at = if self.big_endian { self.bytes - 1 - i } else { i };
            *slot = bytes.get(at).copied().unwrap_or(0);
        }
        let bits = u64::from_le_bytes(wide);
        match (self.kind, self.bytes) {
            (b'f', 8) => f64::from_bits(bits),
            (b'f', _) => f64::from(f32::from_bits(bits as u32)),
            (b'i', 1) => f64::from(bits as u8 as i8),
            (b'i', 2) => f64::from(bits as u16 as i16),
            (b'i', 4) => f64::from(bits as u32 as i32),
            (b'i', _) => bits as i64 as f64,
            _ => bits as f64,
        }
    }
}

/// Reads an array of one or two dimensions, or a structured one of one dimension.
pub(super) fn read(file: &Path, bytes: &[u8], told: &Told) -> Result<Table> {
    let fault = |what: String, mend: &str| Error::mistake(Place::file(file), what, mend);
    let short = || fault("array is cut short".into(), "save it anew with `numpy.save`");
    let version = *bytes.get(6).ok_or_else(short)?;
    let (from, length) = match version {
        1 => (10, bytes.get(8..10).map(|b| usize::from(b[0]) | usize::from(b[1]) << 8)),
        2 | 3 => (12, bytes.get(8..12).map(|b| b.iter().rev().fold(0, |n, b| n << 8 | usize::from(*b)))),
        _ => {
            let what = format!("version {version} of NumPy's file format is not known");
            return Err(fault(what, "save it with `numpy.save`"));
        }
    };
    let end = length.and_then(|n| n.checked_add(from)).filter(|end| *end <= bytes.len()).ok_or_else(short)?;
    let header = String::from_utf8_lossy(&bytes[from..end]).into_owned();
    let unread = |what: &str| {
        fault(
            format!("array has {what}: {}", shown(&header)),
            "save numbers of type float64, float32 or integers, in one or two dimensions, or a structured array of them",
        )
    };
    let value = |key: &str| header.split_once(&format!("'{key}':")).map(|(_, rest)| rest.trim_start());
    let by_columns = value("fortran_order").is_some_and(|rest| rest.starts_with("True"));
    let shape = value("shape").and_then(|rest| rest.strip_prefix('(')).and_then(|rest| rest.split_once(')'));
    let shape: Option<Vec<usize>> = shape.and_then(|(inner, _)| {
        inner.split(',').map(str::trim).filter(|n| !n.is_empty()).map(|n| n.parse().ok()).collect()
    });
    let shape = shape.ok_or_else(|| unread("no shape"))?;
    let descr = value("descr").ok_or_else(|| unread("no type"))?;
    let (names, numbers) = types(descr).ok_or_else(|| unread("numbers of a type that is not read"))?;
    let (rows, columns) = match (&shape[..], numbers.len()) {
        ([rows], fields) => (*rows, fields),
        ([rows, columns], 1) => (*rows, *columns),
        _ => return Err(unread("a shape that is no table")),
    };
    let width: usize = numbers.iter().map(|n| n.bytes).sum();
    let structured = numbers.len() > 1 || !names.is_empty();
    let need = if structured {
        rows.checked_mul(width)
    } else {
        rows.checked_mul(columns).and_then(|n| n.checked_mul(width))
    };
    let data = &bytes[end..];
    if rows == 0 {
        return Err(fault("array has no rows".into(), "save it with a row for each sample"));
    }
    if columns == 0 || need.is_none_or(|need| need > data.len()) {
        return Err(short());
    }
    let at = |row: usize, column: usize| -> f64 {
        let (offset, number) = if structured {
            let before: usize = numbers[..column].iter().map(|n| n.bytes).sum();
            (row * width + before, numbers[column])
        } else {
            let place = if by_columns { column * rows + row } else { row * columns + column };
            (place * width, numbers[0])
        };
        number.read(&data[offset..offset + number.bytes])
    };
    let values: Vec<f64> =
        (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))).map(|(i, j)| at(i, j)).collect();
    if let Some(k) = values.iter().position(|x| x.is_infinite()) {
        let what = format!("number {} of row {} is infinite", k % columns + 1, k / columns + 1);
        return Err(fault(what, "write NaN for a reading that is missing"));
    }
    Table::of_numbers(file, names, columns, &values, told)
}

/// Names of fields and their types: one type without a name, or a list of pairs.
fn types(descr: &str) -> Option<(Vec<String>, Vec<Number>)> {
    let quoted =
        |text: &str| text.split(['\'', '"']).skip(1).step_by(2).map(str::to_string).collect::<Vec<_>>();
    let Some(list) = descr.strip_prefix('[') else {
        return Some((Vec::new(), vec![Number::of(quoted(descr).first()?)?]));
    };
    let list = list.split_once(']')?.0;
    // A field with a shape of its own has a third entry.
    if list.contains("), (") && list.matches('(').count() != list.matches(')').count() {
        return None;
    }
    let words = quoted(list);
    let pairs: Vec<&[String]> = words.chunks(2).collect();
    if list.matches('(').count() != pairs.len() {
        return None;
    }
    let numbers = pairs.iter().map(|pair| Number::of(pair.get(1)?)).collect::<Option<Vec<_>>>()?;
    Some((pairs.iter().filter_map(|pair| pair.first().cloned()).collect(), numbers))
}

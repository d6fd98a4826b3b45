//! Homogeneous matrices in columns: 16 numbers, or 12 without the last row.

use super::draft::Draft;
use super::heading::Stated;
use super::table::Table;

/// Columns by element: row and column from 0, and the column of the table.
pub(super) struct Elements(pub Vec<(usize, usize, usize)>);

/// Columns that share a stem and are numbered.
struct Run {
    columns: Vec<usize>,
    /// Numbers of two digits, row and column; else counted through.
    pairs: Option<Vec<(usize, usize)>>,
}

/// The matrix of a table, if it has one; what cannot be known is asked.
pub(super) fn find(draft: &mut Draft) -> Option<Elements> {
    let run = run(draft)?;
    let last = |rows: bool| run.columns.len() == 16 && is_last(draft.table, &run, rows);
    let (by_rows, by_columns) = (last(true), last(false));
    let row_major = match draft.request.matrix.as_deref() {
        Some("row-major") => true,
        Some("column-major") => false,
        _ if by_rows != by_columns => {
            let order = if by_rows { "row" } else { "column" };
            draft.told.push(format!("matrix stands {order} by {order}: its last row is 0 0 0 1"));
            by_rows
        }
        // Two digits are row and column wherever nothing contradicts.
        _ if run.pairs.is_some() && run.columns.len() == 12 => true,
        _ => {
            let why = if by_rows { "its positions are all 0" } else { "no last row 0 0 0 1 tells it" };
            let what = format!("order of the matrix in {}: {why}", draft.named(&run.columns));
            draft.ask(what, "--matrix row-major|column-major");
            true
        }
    };
    Some(Elements(
        (0..run.columns.len())
            .map(|k| {
                let (i, j) = run.place(k, row_major);
                (i, j, run.columns[k])
            })
            .collect(),
    ))
}

impl Run {
    /// Row and column of the k-th column of the table.
    fn place(&self, k: usize, row_major: bool) -> (usize, usize) {
        match (&self.pairs, row_major) {
            (Some(pairs), true) => pairs[k],
            (Some(pairs), false) => (pairs[k].1, pairs[k].0),
            (None, true) => (k / 4, k % 4),
            // Without the last row a column has three numbers.
            (None, false) => (k % (self.columns.len() / 4), k / (self.columns.len() / 4)),
        }
    }
}

fn run(draft: &Draft) -> Option<Run> {
    let mut stems: Vec<(String, Vec<(usize, String)>)> = Vec::new();
    for column in draft.free(None) {
        let heading = &draft.table.headings[column];
        if matches!(heading.unit, Stated::Other(_)) {
            continue;
        }
        let is_number = |w: &&String| w.bytes().all(|b| b.is_ascii_digit());
        let numbers = heading.words.iter().rev().take_while(is_number).count();
        let (stem, number) = heading.words.split_at(heading.words.len() - numbers);
        if numbers == 0 {
            continue;
        }
        let stem = stem.concat();
        match stems.iter_mut().find(|(known, _)| *known == stem) {
            Some((_, all)) => all.push((column, number.concat())),
            None => stems.push((stem, vec![(column, number.concat())])),
        }
    }
    let (_, all) = stems.into_iter().find(|(_, all)| all.len() == 16 || all.len() == 12)?;
    let columns: Vec<usize> = all.iter().map(|(column, _)| *column).collect();
    let numbers: Vec<usize> = all.iter().map(|(_, n)| n.parse()).collect::<Result<_, _>>().ok()?;
    let first = *numbers.iter().min()?;
    if numbers.iter().enumerate().all(|(k, n)| *n == k + first) && first <= 1 {
        return Some(Run { columns, pairs: None });
    }
    let base = if first == 0 { 0 } else { 11 };
    let pair = |n: &usize| n.checked_sub(base).map(|n| (n / 10, n % 10)).filter(|(i, j)| *i < 4 && *j < 4);
    let pairs: Vec<(usize, usize)> = numbers.iter().map(pair).collect::<Option<_>>()?;
    let all_rows = (0..columns.len() / 4).all(|i| (0..4).all(|j| pairs.contains(&(i, j))));
    all_rows.then_some(Run { columns, pairs: Some(pairs) })
}

/// Whether the last row would be 0 0 0 1 everywhere.
fn is_last(table: &Table, run: &Run, row_major: bool) -> bool {
    let mut seen = false;
    let all = (0..16).all(|k| {
        let (i, j) = run.place(k, row_major);
        i < 3
            || table.rows.iter().all(|row| match table.number(row, run.columns[k]) {
                Ok(Some(value)) => {
                    seen = true;
                    value == if j == 3 { 1.0 } else { 0.0 }
                }
                Ok(None) => true,
                Err(_) => false,
            })
    });
    all && seen
}

//! Tables on a terminal: rows as columns of text. A table that is wider than the terminal breaks the words of its widest columns; where
//! that does not do, columns move below their row. No number is cut.

use super::width::{cut, len, parts, width};

/// What stands between two columns.
const GAP: usize = 2;
/// How much farther in the columns stand that have moved below their row.
const BELOW: usize = 2;

/// Rows as columns of text, each as wide as its widest cell, within the width of the terminal if standard output is one; `right` says which
/// columns stand to the right.
pub(crate) fn table(indent: &str, right: &[bool], rows: &[Vec<String>]) -> String {
    fitted(indent, right, rows, width())
}

/// A table of these columns, by number, that stand side by side.
struct Band {
    columns: Vec<usize>,
    widths: Vec<usize>,
    indent: usize,
}

/// Columns that take up so much room, with what is between them.
fn all_of(widths: &[usize]) -> usize {
    widths.iter().sum::<usize>() + GAP * widths.len().saturating_sub(1)
}

fn fitted(indent: &str, right: &[bool], rows: &[Vec<String>], width: Option<usize>) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let widest = |of: &dyn Fn(&str) -> usize, c: usize| {
        rows.iter().filter_map(|row| row.get(c)).map(|cell| of(cell)).max().unwrap_or(0)
    };
    let used: Vec<usize> = (0..columns).filter(|c| widest(&len, *c) > 0).collect();
    let natural: Vec<usize> = used.iter().map(|c| widest(&len, *c)).collect();
    let bands = match width {
        Some(width) if indent.len() + all_of(&natural) > width => {
            let least = |text: &str| parts(text).into_iter().map(len).max().unwrap_or(0);
            let least: Vec<usize> = used.iter().map(|c| widest(&least, *c)).collect();
            let mut bands = banded((&used, &natural, &least), indent.len(), width);
            for band in &mut bands {
                for (c, width) in band.columns.iter().zip(&mut band.widths) {
                    let room = *width;
                    let longest = |cell: &str| broken(cell, room).iter().map(|line| len(line)).max();
                    *width = widest(&|cell| longest(cell).unwrap_or(0), *c);
                }
            }
            bands
        }
        _ => vec![Band { columns: used, widths: natural, indent: indent.len() }],
    };
    let mut text = String::new();
    for row in rows {
        for (b, band) in bands.iter().enumerate() {
            let lines = lines(band, right, row);
            // Nothing is below a row that has nothing there.
            for line in lines.iter().filter(|line| b == 0 || !line.is_empty()) {
                text.push_str(line);
                text.push('\n');
            }
        }
    }
    text
}

/// Columns side by side as far as there is room for the parts that their cells cannot do without, the others below.
fn banded((used, natural, least): (&[usize], &[usize], &[usize]), indent: usize, width: usize) -> Vec<Band> {
    let mut bands = Vec::new();
    let mut from = 0;
    while from < used.len() {
        let indent = if from == 0 { indent } else { indent + BELOW };
        let room = width - indent;
        let fit = |to: &usize| all_of(&least[from..*to]) <= room;
        let to = (from + 1..=used.len()).take_while(fit).last().unwrap_or(from + 1);
        let mut widths = natural[from..to].to_vec();
        let least: Vec<usize> = least[from..to].iter().map(|least| *least.min(&room)).collect();
        while all_of(&widths) > room {
            // Of columns as wide the last one, which bears the text.
            let widest = (0..widths.len()).filter(|i| widths[*i] > least[*i]).max_by_key(|i| widths[*i]);
            let Some(widest) = widest else { break };
            widths[widest] -= 1;
        }
        bands.push(Band { columns: used[from..to].to_vec(), widths, indent });
        from = to;
    }
    bands
}

/// A cell in lines of this width.
fn broken(cell: &str, width: usize) -> Vec<String> {
    if len(cell) <= width {
        return vec![cell.to_string()];
    }
    let mut lines: Vec<String> = Vec::new();
    for part in parts(cell).into_iter().flat_map(|part| cut(part, width)) {
        match lines.last_mut() {
            Some(line) if len(line) + 1 + len(&part) <= width => {
                line.push(' ');
                line.push_str(&part);
            }
            _ => lines.push(part),
        }
    }
    lines
}

/// A row of these columns.
fn lines(band: &Band, right: &[bool], row: &[String]) -> Vec<String> {
    let cells: Vec<Vec<String>> = (band.columns.iter().zip(&band.widths))
        .map(|(c, width)| row.get(*c).map_or_else(Vec::new, |cell| broken(cell, *width)))
        .collect();
    let height = cells.iter().map(Vec::len).max().unwrap_or(0).max(1);
    let line = |k: usize| {
        let mut line = " ".repeat(band.indent);
        for ((i, cell), width) in cells.iter().enumerate().zip(&band.widths) {
            let text = cell.get(k).map_or("", String::as_str);
            let gap = " ".repeat(width - len(text));
            line.push_str(if i == 0 { "" } else { "  " });
            match right.get(band.columns[i]) {
                Some(true) => line.extend([&gap, text]),
                _ => line.extend([text, &gap]),
            }
        }
        line.trim_end().to_string()
    };
    (0..height).map(line).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn rows(rows: &[&[&str]]) -> Vec<Vec<String>> {
        rows.iter().map(|row| row.iter().map(|cell| cell.to_string()).collect()).collect()
    }

    fn residuals() -> Vec<Vec<String>> {
        rows(&[
            &["recording", "", "measurement", "samples", "as declared", "calibrated"],
            &["bk4_10deg.csv", "", "distance", "1802", "93.2 um", "2.80 um"],
        ])
    }

    const RIGHT: [bool; 6] = [false, false, false, true, true, true];

    #[test]
    fn a_table_with_room_is_as_wide_as_its_cells() {
        let expected = "  recording      measurement  samples  as declared  calibrated\n  \
                          bk4_10deg.csv  distance        1802      93.2 um     2.80 um\n";
        for width in [None, Some(63), Some(200)] {
            assert_eq!(fitted("  ", &RIGHT, &residuals(), width), expected);
        }
    }

    #[test]
    fn words_break_before_columns_move_below() {
        let lines = |width| -> Vec<String> {
            fitted("  ", &RIGHT, &residuals(), Some(width)).lines().map(String::from).collect()
        };
        assert_eq!(lines(60)[0], "  recording      measurement  samples        as  calibrated");
        assert_eq!(lines(60)[1], format!("{}declared", " ".repeat(39)));
        assert_eq!(lines(60)[2], "  bk4_10deg.csv  distance        1802   93.2 um     2.80 um");
        assert_eq!(lines(60).len(), 3);
        let below = [
            "  recording      measurement",
            "    samples        as  calibrated",
            "             declared",
            "  bk4_10deg.csv  distance",
            "       1802   93.2 um     2.80 um",
        ];
        assert_eq!(lines(33), below);
    }

    proptest! {
        /// Cells are what commands show: numbers with units, words, names of files.
        #[test]
        fn every_line_fits_and_every_number_is_kept(
            rows in proptest::collection::vec(proptest::collection::vec(
                "[a-z]{0,12}|[+-]?[0-9]{1,4}\\.[0-9]{1,5}|± [0-9]\\.[0-9]{3} (um|urad)|[0-9]{1,3} %|([a-z]{1,7} ){0,9}[a-z]{1,7}|[a-z_./0-9]{0,40}", 1..9), 1..7),
            right in proptest::collection::vec(any::<bool>(), 0..9),
            width in 20usize..120,
        ) {
            let text = fitted("  ", &right, &rows, Some(width));
            for line in text.lines() {
                prop_assert!(len(line) <= width, "{line:?} is wider than {width}");
            }
            let is_number = |cell: &&String| cell.starts_with(['±', '+', '-']) || cell.parse::<f64>().is_ok() || cell.ends_with('%');
            for cell in rows.iter().flatten().filter(is_number) {
                prop_assert!(text.lines().any(|line| line.contains(cell.as_str())), "{cell:?} is not in\n{text}");
            }
            // No character is lost or made up: those of the cells are those of the table.
            let sorted = |text: &str| {
                let mut all: Vec<char> = text.chars().filter(|c| !c.is_whitespace()).collect();
                all.sort_unstable();
                all
            };
            prop_assert_eq!(sorted(&text), sorted(&rows.concat().concat()));
        }
    }
}

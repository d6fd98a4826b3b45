//! The form of a table of text: what separates its columns, how it writes decimals, where its headings stand.

use super::cell::{self, Kind};

/// What stands between two columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Separator {
    Byte(u8),
    /// One blank or many.
    Blanks,
}

impl Separator {
    pub fn word(self) -> &'static str {
        match self {
            Separator::Byte(b';') => "semicolon",
            Separator::Byte(b'\t') => "tab",
            Separator::Byte(_) => "comma",
            Separator::Blanks => "blanks",
        }
    }

    pub fn named(word: &str) -> Option<Separator> {
        Some(match word {
            "comma" | "," => Separator::Byte(b','),
            "semicolon" | ";" => Separator::Byte(b';'),
            "tab" | "\t" | "\\t" => Separator::Byte(b'\t'),
            "blanks" | "blank" | "space" | " " => Separator::Blanks,
            _ => return None,
        })
    }

    /// Fields of one line.
    pub fn fields(self, line: &str) -> Vec<String> {
        match self {
            Separator::Byte(byte) => {
                let mut reader = csv::ReaderBuilder::new()
                    .delimiter(byte)
                    .has_headers(false)
                    .flexible(true)
                    .trim(csv::Trim::All)
                    .from_reader(line.as_bytes());
                let record = reader.records().next().and_then(Result::ok).unwrap_or_default();
                record.iter().map(str::to_string).collect()
            }
            Separator::Blanks => {
                let (mut fields, mut field, mut quoted, mut begun) =
                    (Vec::new(), String::new(), false, false);
                for c in line.chars() {
                    match c {
                        '"' => (quoted, begun) = (!quoted, true),
                        c if c.is_whitespace() && !quoted => {
                            if std::mem::take(&mut begun) {
                                fields.push(std::mem::take(&mut field));
                            }
                        }
                        c => {
                            field.push(c);
                            begun = true;
                        }
                    }
                }
                if begun {
                    fields.push(field);
                }
                fields
            }
        }
    }
}

/// How a table is written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Form {
    pub separator: Separator,
    pub decimal_comma: bool,
    /// Columns of a row.
    pub columns: usize,
    /// Index among the lines of the first row of numbers.
    pub first_row: usize,
    /// Index of the line with the headings, if there is one.
    pub headings: Option<usize>,
    /// Index of a line with units below the headings.
    pub units: Option<usize>,
}

/// So many lines show the form of a table.
const LOOKED_AT: usize = 200;

/// What a line holds when comment marks are left out; comments themselves hold nothing.
pub(super) fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with(['#', '%'])
}

/// Finds the form; what is told beforehand is not looked for.
pub(super) fn find(lines: &[&str], separator: Option<Separator>, comma: Option<bool>) -> Option<Form> {
    let content: Vec<usize> =
        (0..lines.len()).filter(|i| !lines[*i].trim().is_empty() && !is_comment(lines[*i])).collect();
    // Headings and preambles stand in the first half.
    let from = (content.len() / 2).min(1000);
    let sample: Vec<&str> = content[from..].iter().take(LOOKED_AT).map(|i| lines[*i]).collect();
    let separators = [b'\t', b';', b','].map(Separator::Byte).into_iter().chain([Separator::Blanks]);
    let (mut best, mut best_score) = (None, 0.0);
    for tried in separators.filter(|s| separator.is_none_or(|told| told == *s)) {
        for decimal in [false, true].into_iter().filter(|d| comma.is_none_or(|told| told == *d)) {
            let rows: Vec<Vec<String>> = sample.iter().map(|line| tried.fields(line)).collect();
            let Some(width) = usual(rows.iter().map(Vec::len)) else { continue };
            let numbers = |row: &Vec<String>| numbers_of(row, decimal);
            let score: f64 = rows
                .iter()
                .map(|row| (if row.len() == width { numbers(row) } else { 0 }, row.len()))
                .map(|(numbers, all)| numbers as f64 - 0.1 * (all - numbers) as f64)
                .sum();
            if score > best_score {
                let usual_numbers = usual(rows.iter().filter(|r| r.len() == width).map(numbers)).unwrap_or(1);
                (best, best_score) = (Some((tried, decimal, width, usual_numbers)), score);
            }
        }
    }
    let (separator, decimal_comma, columns, numbers) = best?;
    // Lines such as `SampleTime;1;1` have numbers too, but a word where all rows begin with a number.
    let begins =
        |fields: &[String]| fields.first().is_none_or(|f| cell::kind(f, decimal_comma) != Kind::Words);
    let last = &sample[2 * sample.len() / 3..];
    let begins_with_number = last.iter().all(|line| begins(&separator.fields(line)));
    let is_row = |i: &&usize| {
        let fields = separator.fields(lines[**i]);
        let found = numbers_of(&fields, decimal_comma);
        fields.len() == columns
            && found > 0
            && 2 * found > numbers
            && (!begins_with_number || begins(&fields))
    };
    let first_row = *content.iter().find(is_row)?;
    let mut form = Form { separator, decimal_comma, columns, first_row, headings: None, units: None };
    form.find_headings(lines);
    Some(form)
}

/// Numbers and moments among fields, and drop-outs, but only beside at least one number.
fn numbers_of(fields: &[String], comma: bool) -> usize {
    let kinds: Vec<Kind> = fields.iter().map(|field| cell::kind(field, comma)).collect();
    let of = |wanted: &[Kind]| kinds.iter().filter(|kind| wanted.contains(kind)).count();
    match of(&[Kind::Number]) {
        0 => 0,
        _ => of(&[Kind::Number, Kind::Moment, Kind::DropOut]),
    }
}

/// The number that comes most often; of several that come as often the first, so that what stands above makes the form.
fn usual(all: impl Iterator<Item = usize>) -> Option<usize> {
    let mut counts: Vec<(usize, usize)> = Vec::new();
    for n in all {
        match counts.iter_mut().find(|(own, _)| *own == n) {
            Some((_, times)) => *times += 1,
            None => counts.push((n, 1)),
        }
    }
    counts.into_iter().rev().max_by_key(|(_, times)| *times).map(|(n, _)| n)
}

impl Form {
    /// A line as headings: its fields without the mark of a comment.
    pub fn names(&self, line: &str) -> Vec<String> {
        let line = line.trim_start();
        let bare = line.strip_prefix(['#', '%']).unwrap_or(line);
        self.separator.fields(bare)
    }

    /// The nearest lines above the rows that have a name for each column: headings, and perhaps their units below them.
    fn find_headings(&mut self, lines: &[&str]) {
        let above: Vec<usize> =
            (0..self.first_row).rev().filter(|i| !lines[*i].trim().is_empty()).take(3).collect();
        let fits = |i: usize| {
            let names = self.names(lines[i]);
            let ends_blank =
                || self.separator.fields(lines[self.first_row]).last().is_some_and(String::is_empty);
            let enough = names.len() == self.columns || (names.len() + 1 == self.columns && ends_blank());
            let worded = names.iter().filter(|n| n.chars().any(char::is_alphabetic) && n.len() < 200).count();
            enough && 2 * worded >= self.columns
        };
        let Some(first) = above.first().copied().filter(|i| fits(*i)) else { return self.find_keys(lines) };
        let second = above.get(1).copied().filter(|i| fits(*i));
        self.headings = Some(first);
        let fields = self.names(lines[first]);
        let bare = |n: &String| n.trim().trim_matches(['[', ']', '(', ')']).trim().to_string();
        let is_unit =
            |n: &String| n.trim().is_empty() || bare(n) == "-" || super::unit::spelled(&bare(n)).is_some();
        if fields.iter().all(is_unit)
            && let Some(next) = second
        {
            (self.headings, self.units) = (Some(next), Some(first));
        }
    }
}

impl Form {
    /// Headings among lines of a preamble that begin with what they hold: `Name;...`, `Unit;...`, as exports of scopes have them.
    fn find_keys(&mut self, lines: &[&str]) {
        let find = |keys: &[&str]| {
            (0..self.first_row).rev().find(|i| {
                let fields = self.names(lines[*i]);
                let key = fields.first().map(|f| f.trim().trim_end_matches(':').to_ascii_lowercase());
                fields.len() == self.columns && key.is_some_and(|key| keys.contains(&key.as_str()))
            })
        };
        let headings =
            find(&["name", "names", "channel", "signal"]).or_else(|| find(&["symbolname", "symbol"]));
        (self.headings, self.units) = (headings, headings.and_then(|_| find(&["unit", "units"])));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn form(text: &str) -> Form {
        let lines: Vec<&str> = text.lines().collect();
        find(&lines, None, None).expect("a table")
    }

    #[test]
    fn separators_and_decimals_are_told_apart() {
        for (text, separator, comma) in [
            ("a;b\n1,5;2,5\n1,25;3\n", Separator::Byte(b';'), true),
            ("a,b\n1.5,2.5\n", Separator::Byte(b','), false),
            ("a\tb\n1,5\t-2,5\n", Separator::Byte(b'\t'), true),
            ("a  b\n 1.5   2.5\n", Separator::Blanks, false),
            ("a,b\n\"1,5\",\"2,5\"\n", Separator::Byte(b','), true),
            ("a;b\n1;2\n", Separator::Byte(b';'), false),
        ] {
            let found = form(text);
            assert_eq!((found.separator, found.decimal_comma), (separator, comma), "{text}");
            assert_eq!((found.columns, found.headings, found.first_row), (2, Some(0), 1), "{text}");
        }
    }

    #[test]
    fn headings_stand_below_a_preamble_and_above_units() {
        let found = form("Logger 7\nDate;2024-03-05\n\ntime;pos;label\ns;mm;\n0;1,5;a\n1;2,5;b\n2;-;c\n");
        assert_eq!((found.headings, found.units, found.first_row), (Some(3), Some(4), 5));
        let found = form("# my log\n# t x\n0 1\n1 2\n");
        assert_eq!((found.headings, found.first_row), (Some(1), 2));
        let found = form(
            "Name;Scope\n\nName;x;y\nUnit;mm;mm\nOffset;0;0\n0;1,5;2,5\n10;1,5;2,5\n20;1,5;2,5\n30;1;2\n",
        );
        assert_eq!((found.headings, found.units, found.first_row), (Some(2), Some(3), 5));
        let found = form("0,1\n1,2\n");
        assert_eq!((found.headings, found.first_row), (None, 0));
    }
}

//! Text that fits a terminal: how wide it is, where text may break, lines of prose. What is no terminal gets its text as it is.

use std::borrow::Cow;

use console::Term;

/// A narrower terminal is taken for as wide as this: numbers with their units have to stand somewhere.
const NARROWEST: usize = 20;
/// How much farther in the lines stand that go on with what one line has no room for.
const HANGING: usize = 2;

/// Columns of the terminal that standard output goes to, as [`width_of`] has them.
pub(super) fn width() -> Option<usize> {
    width_of(&Term::stdout())
}

/// Columns of a terminal: what `COLUMNS` says, else the terminal. None where it is no terminal, or one that does not know.
pub(super) fn width_of(stream: &Term) -> Option<usize> {
    if !stream.is_term() {
        return None;
    }
    let told = std::env::var("COLUMNS").ok().and_then(|text| text.trim().parse().ok());
    let own = || stream.size_checked().map(|(_, columns)| usize::from(columns));
    told.filter(|columns| *columns > 0).or_else(own).map(|columns| columns.max(NARROWEST))
}

/// How many columns a text takes up.
pub(super) fn len(text: &str) -> usize {
    shown(text).count()
}

/// The characters of a text but what makes letters bold: from an escape to its `m`.
pub(super) fn shown(text: &str) -> impl Iterator<Item = char> {
    let mut is_style = false;
    text.chars().filter(move |c| {
        is_style |= *c == '\u{1b}';
        let is_shown = !is_style;
        is_style &= *c != 'm';
        is_shown
    })
}

/// A text in parts between which a line may end. A number stays with what follows it, its unit, and a sign with its number; so does what
/// stands in backquotes, which is to be copied.
pub(super) fn parts(text: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let (mut from, mut quoted) = (0, false);
    for (at, _) in text.char_indices().filter(|(_, c)| *c == ' ') {
        let word = &text[from..at];
        let last = word.rsplit(' ').next().unwrap_or(word);
        quoted ^= last.matches('`').count() % 2 == 1;
        let is_bound =
            quoted || last.ends_with(|c: char| c.is_ascii_digit()) || !last.contains(char::is_alphanumeric);
        if !is_bound || last.is_empty() && !word.trim().is_empty() {
            parts.push(word);
            from = at + 1;
        }
    }
    parts.push(&text[from..]);
    parts
}

/// A part too long for a line in pieces that are not: cut behind a mark if there is one, else anywhere but within a number, and there only
/// where it is longer than a line itself.
pub(super) fn cut(part: &str, room: usize) -> Vec<String> {
    let mut rest: Vec<char> = part.chars().collect();
    let mut pieces = Vec::new();
    while rest.len() > room {
        let is_number = |c: char| c.is_ascii_digit() || ".+-eE".contains(c);
        let within = |at: &usize| is_number(rest[at - 1]) && is_number(rest[*at]) && *at > 0;
        let is_mark = |at: &usize| " /\\_,;:".contains(rest[at - 1]);
        let all = || (1..=room).rev();
        let at = all().find(|at| is_mark(at)).or_else(|| all().find(|at| !within(at))).unwrap_or(room);
        let behind = rest.split_off(at);
        pieces.push(rest.iter().collect::<String>().trim_end().to_string());
        rest = behind;
    }
    pieces.push(rest.iter().collect());
    pieces
}

/// The text for standard output: its lines broken between words where that is a terminal and they are too long for it.
pub(super) fn for_reading(text: &str) -> Cow<'_, str> {
    match width() {
        Some(width) if text.lines().any(|line| len(line) > width) => within(text, width).into(),
        _ => text.into(),
    }
}

/// The same for so many columns. A single part that is too long, such as a path, stays whole, to be copied.
fn within(text: &str, width: usize) -> String {
    let indent = |line: &str| len(line) - len(line.trim_start());
    folded(text, width, |line| Some(indent(line) + HANGING))
}

/// Text of lines no longer than this, as far as their parts allow. `hanging` says at which column a line goes on that is too long, and of
/// which line nothing is broken.
pub(super) fn folded(text: &str, width: usize, hanging: impl Fn(&str) -> Option<usize>) -> String {
    let mut fitted = String::with_capacity(text.len() + text.len() / 8);
    for line in text.split_inclusive('\n') {
        let (line, end) = line.strip_suffix('\n').map_or((line, ""), |line| (line, "\n"));
        let words = line.trim_start();
        let blanks = line.len() - words.len();
        match hanging(line).filter(|_| len(line) > width) {
            None => fitted.push_str(line),
            Some(hanging) => {
                let hanging = hanging.min(width / 2);
                fitted.push_str(&line[..blanks]);
                let mut column = blanks;
                for (i, part) in parts(words).into_iter().enumerate() {
                    if i > 0 && column + 1 + len(part) > width {
                        fitted.truncate(fitted.trim_end_matches(' ').len());
                        fitted.push('\n');
                        fitted.extend(std::iter::repeat_n(' ', hanging));
                        column = hanging;
                    } else if i > 0 {
                        fitted.push(' ');
                        column += 1;
                    }
                    fitted.push_str(part);
                    column += len(part);
                }
            }
        }
        fitted.push_str(end);
    }
    fitted
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_number_stays_with_its_unit_and_a_command_whole() {
        assert_eq!(
            parts("a is off by ± 9.7 um, 84 % of it"),
            ["a", "is", "off", "by", "± 9.7 um,", "84 % of", "it"]
        );
        assert_eq!(parts("see `kincal man x` or -> 3 mm"), ["see", "`kincal man x`", "or", "-> 3 mm"]);
        assert_eq!(parts("(1, 2, 3) mm"), ["(1,", "2,", "3)", "mm"]);
    }

    #[test]
    fn what_is_too_long_is_cut_behind_marks_and_outside_of_numbers() {
        assert_eq!(cut("ballbar_2026_bk4.csv", 13), ["ballbar_2026_", "bk4.csv"]);
        assert_eq!(cut("abc123.456", 8), ["abc", "123.456"]);
        assert_eq!(cut("abcdefgh", 3), ["abc", "def", "gh"]);
    }

    proptest! {
        #[test]
        fn lines_fit_and_say_what_they_said(
            words in proptest::collection::vec("[a-z]{1,9}|-?[0-9]{1,3}\\.[0-9]{1,4} (um|%)|note:|->", 1..40),
            indent in 0usize..6,
            width in NARROWEST..90,
        ) {
            let text = format!("{}{}\n", " ".repeat(indent), words.join(" "));
            let fitted = within(&text, width);
            let said = |text: &str| text.split_whitespace().map(String::from).collect::<Vec<_>>();
            prop_assert_eq!(said(&fitted), said(&text));
            for line in fitted.lines() {
                let is_one_part = parts(line.trim_start()).len() == 1;
                prop_assert!(len(line) <= width || is_one_part, "{line:?} in {width}");
            }
            // A number and its unit stand on one line.
            for number in words.iter().filter(|word| word.contains('.')) {
                prop_assert!(fitted.contains(number.as_str()), "{number} in {fitted}");
            }
            prop_assert_eq!(within(&text, 1000), text);
        }
    }
}

//! What a column's heading says: its name as words, and the unit that it names.

use super::unit::{Spelled, spelled};

/// A heading, taken apart.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Heading {
    /// As written.
    pub raw: String,
    /// Without its unit, as written.
    pub name: String,
    /// Words of the name in small letters; a change from small letters to capitals or to digits begins a word.
    pub words: Vec<String>,
    pub unit: Stated,
}

/// What a heading says of the unit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Stated {
    Nothing,
    Unit(Spelled),
    /// A unit that recordings do not have, such as `mm/s`.
    Other(String),
}

impl Heading {
    pub fn read(raw: &str) -> Heading {
        let raw = raw.trim();
        let (name, unit) = cut(raw);
        Heading { raw: raw.to_string(), name: name.to_string(), words: words(name), unit }
    }

    /// The same with the unit of a row below the headings.
    pub fn with_unit(mut self, text: &str) -> Heading {
        let text = text.trim().trim_matches(['[', ']', '(', ')']).trim();
        if !text.is_empty() && self.unit == Stated::Nothing {
            self.unit = of(text);
        }
        self
    }

    pub fn stated(&self) -> Option<Spelled> {
        match self.unit {
            Stated::Unit(unit) => Some(unit),
            _ => None,
        }
    }
}

fn of(text: &str) -> Stated {
    match text {
        // A dash in brackets is how lists of symbols write a pure number.
        "-" => spelled("1").map_or(Stated::Nothing, Stated::Unit),
        _ => spelled(text).map_or_else(|| Stated::Other(text.to_string()), Stated::Unit),
    }
}

/// Name and unit of a heading: `x [mm]`, `x (mm)`, `j1/deg`, `t, s`, `x_mm`, `posMm`.
fn cut(raw: &str) -> (&str, Stated) {
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>')] {
        if let Some(inner) = raw.strip_suffix(close)
            && let Some(at) = inner.rfind(open)
        {
            let (name, unit) = (inner[..at].trim_end(), inner[at + open.len_utf8()..].trim());
            match of(unit) {
                // `J1 (commanded)` names no unit; other words in square brackets claim to be one.
                Stated::Other(_) if open != '[' && !unit.contains('/') => break,
                stated => return (name, stated),
            }
        }
    }
    if let Some((name, unit)) = raw.rsplit_once(['/', ','])
        && let Some(unit) = spelled(unit)
    {
        return (name.trim_end(), Stated::Unit(unit));
    }
    ending(raw)
}

/// A unit as the last word of a name.
fn ending(raw: &str) -> (&str, Stated) {
    let Some((at, last)) = last_word(raw) else { return (raw, Stated::Nothing) };
    let name = raw[..at].trim_end_matches(['_', ' ', '-', '.']);
    if name.is_empty() {
        return (raw, Stated::Nothing);
    }
    // `x_mm_s`, `v_mm_s2` and `a_mps2` are speeds and accelerations, `mm_s` is no time.
    let plain = last.trim_end_matches('2');
    let per = matches!(plain, "s" | "sec" | "min");
    let before = last_word(name).is_some_and(|(_, word)| spelled(word).is_some() || word == "per");
    if (per && before) || ["mps", "mmps", "degps", "radps", "rps", "dps"].contains(&plain) {
        return (name, Stated::Other(if before { format!("...{last}") } else { last.to_string() }));
    }
    // `posMm`: the capital begins a word.
    let small = || {
        spelled(&last.to_lowercase()).filter(|_| last.len() > 1 && raw[..at].ends_with(char::is_lowercase))
    };
    let Some(unit) = spelled(last).or_else(small) else { return (raw, Stated::Nothing) };
    // One capital letter may be anything: `marker_A`, `axis N`.
    let about = |known: &[&str]| words(name).iter().any(|word| known.iter().any(|k| word.starts_with(k)));
    let trusted = match last {
        "A" => about(&["curr", "amp", "motorcurr"]),
        "V" => about(&["volt"]),
        "N" => about(&["force", "load"]),
        "K" => about(&["temp"]),
        "in" | "1" | "min" => false,
        _ => true,
    };
    if trusted { (name, Stated::Unit(unit)) } else { (raw, Stated::Nothing) }
}

/// Where the last word begins, and the word: behind `_`, a blank, `-`, a point, or where capitals follow small letters.
fn last_word(text: &str) -> Option<(usize, &str)> {
    let parted = text.rfind(['_', ' ', '-', '.']).map(|at| at + 1);
    let chars: Vec<(usize, char)> = text.char_indices().collect();
    let camel =
        chars.windows(2).rev().find(|p| p[0].1.is_lowercase() && p[1].1.is_uppercase()).map(|p| p[1].0);
    let at = parted.max(camel)?;
    let word = &text[at..];
    // `posMm`, `timeMs`: a unit that begins with a capital because a word does.
    (!word.is_empty()).then_some((at, word))
}

/// Words of a name.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let mut last: Option<char> = None;
    for c in name.chars() {
        if !c.is_alphanumeric() {
            last = None;
            continue;
        }
        let joins =
            last.is_some_and(|l| l.is_numeric() == c.is_numeric() && !(l.is_lowercase() && c.is_uppercase()));
        match out.last_mut() {
            Some(word) if joins => word.extend(c.to_lowercase()),
            _ => out.push(c.to_lowercase().collect()),
        }
        last = Some(c);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_found_wherever_headings_have_them() {
        let read = |raw: &str| {
            let heading = Heading::read(raw);
            let unit = match &heading.unit {
                Stated::Nothing => "none".to_string(),
                Stated::Unit(unit) => unit.unit.symbol.to_string(),
                Stated::Other(other) => format!("?{other}"),
            };
            (heading.name, unit)
        };
        for (raw, name, unit) in [
            ("x (mm)", "x", "mm"),
            ("X_mm", "X", "mm"),
            ("pos [m]", "pos", "m"),
            ("j1/deg", "j1", "deg"),
            ("q1_rad", "q1", "rad"),
            ("Axis 1 (°)", "Axis 1", "deg"),
            ("t, s", "t", "s"),
            ("x_cmd_mm_s", "x_cmd_mm", "?...s"),
            ("acc_base_x_mps2", "acc_base_x", "?mps2"),
            ("J1 (commanded)", "J1 (commanded)", "none"),
            ("F [furlong]", "F", "?furlong"),
            ("v (mm/s)", "v", "?mm/s"),
            ("marker_A", "marker_A", "none"),
            ("x_current_A", "x_current", "A"),
            ("mm", "mm", "none"),
            ("encoder_counts", "encoder_counts", "none"),
            ("time_s", "time", "s"),
            ("(mm)", "", "mm"),
            ("posMm", "pos", "mm"),
        ] {
            assert_eq!(read(raw), (name.to_string(), unit.to_string()), "{raw}");
        }
        assert_eq!(words("markerA_x"), ["marker", "a", "x"]);
        assert_eq!(words("Axis1"), ["axis", "1"]);
    }
}

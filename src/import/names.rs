//! Names of a description as names of a machine.

use std::collections::BTreeSet;

use crate::machine::is_usable_name;

/// Names that were given, so that none is given twice.
#[derive(Default)]
pub(super) struct Names(BTreeSet<String>);

impl Names {
    /// A usable name like this one. `w` and `t` are the ends of every machine.
    pub fn give(&mut self, name: &str) -> String {
        let plain = usable(name, "j_");
        let plain = if plain == "w" || plain == "t" { format!("joint_{plain}") } else { plain };
        let numbered = |n: usize| {
            let end = format!("_{n}");
            format!("{}{end}", &plain[..plain.len().min(64 - end.len())])
        };
        let given = std::iter::once(plain.clone()).chain((2..).map(numbered)).find(|n| !self.0.contains(n));
        let given = given.unwrap_or(plain);
        self.0.insert(given.clone());
        given
    }
}

/// The name with `_` for every letter that a machine file does not take; it begins with a letter, if need be those of `start`.
pub(super) fn usable(name: &str, start: &str) -> String {
    if is_usable_name(name) {
        return name.to_string();
    }
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    let mut plain: String = name.trim().chars().map(|c| if fits(c) { c } else { '_' }).collect();
    if !plain.starts_with(|c: char| c.is_ascii_alphabetic()) {
        plain.insert_str(0, start);
    }
    plain.truncate(64);
    plain
}

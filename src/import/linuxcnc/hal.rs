//! Pins of a kinematics module, as the HAL files of a machine set them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::ini::{Ini, number};
use crate::error::{Error, Place, Result};
use crate::wording::shown;

/// A pin as a HAL file sets it.
struct Set {
    file: PathBuf,
    line: usize,
    value: String,
}

#[derive(Default)]
pub(super) struct Pins {
    set: BTreeMap<String, Set>,
    /// Pins that a signal drives, with the signal.
    driven: BTreeMap<String, String>,
    signals: BTreeMap<String, Set>,
}

impl Pins {
    /// Takes in what a HAL file sets; later files come after earlier ones, and what is set last holds.
    pub fn read(&mut self, file: &Path, text: &str) {
        for (line, text) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            let text = text.split('#').next().unwrap_or_default();
            let mut words = text.split_whitespace();
            let set = |value: &str| Set { file: file.to_path_buf(), line, value: value.to_string() };
            match (words.next(), words.next()) {
                (Some("setp"), Some(pin)) => {
                    // The value may be written with `=` before it.
                    let value = words.find(|word| *word != "=").unwrap_or_default();
                    self.set.insert(pin.to_string(), set(value));
                }
                (Some("sets"), Some(signal)) => {
                    self.signals.insert(signal.to_string(), set(words.next().unwrap_or_default()));
                }
                (Some("net"), Some(signal)) => {
                    let pins = words.filter(|word| !matches!(*word, "=>" | "<=" | "<=>"));
                    self.driven.extend(pins.map(|pin| (pin.to_string(), signal.to_string())));
                }
                _ => {}
            }
        }
    }

    /// The value of a pin; nothing where no file sets it.
    ///
    /// # Errors
    /// Where a signal drives it that nothing sets, or its value is no number.
    pub fn value(&self, ini: &Ini, pin: &str) -> Result<Option<f64>> {
        let signal = self.driven.get(pin);
        let set = match signal {
            Some(signal) => self.signals.get(signal),
            None => self.set.get(pin),
        };
        let Some(set) = set else {
            let Some(signal) = signal else { return Ok(None) };
            let what = format!(
                "pin {pin} has the value of signal {}, which only the running control knows",
                shown(signal)
            );
            let mend = format!(
                "give a HAL file with the line `setp {pin} VALUE` in its place by --hal, without the `net`"
            );
            return Err(Error::mistake(Place::file(&ini.file), what, mend));
        };
        let value = match set.value.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
            Some((section, key)) => {
                let key = key.trim_start_matches('(').trim_end_matches(')');
                ini.number(section, key)?
            }
            None => number(&set.value),
        };
        value.filter(|x| x.abs() < 1e9).map(Some).ok_or_else(|| {
            let what = format!("pin {pin} is set to `{}`, no number", shown(&set.value));
            let mend = "write a number, or [SECTION]KEY of the INI file";
            Error::mistake(Place::at(&set.file, set.line, 0), what, mend)
        })
    }

    /// Pins of a module that are set, by their names without the module's, with the line.
    pub fn of(&self, module: &str) -> impl Iterator<Item = (&str, usize)> {
        let begins = format!("{module}.");
        self.set.iter().filter_map(move |(pin, set)| Some((pin.strip_prefix(&begins)?, set.line)))
    }

    /// Whether a signal drives a pin.
    pub fn is_driven(&self, pin: &str) -> bool {
        self.driven.contains_key(pin)
    }
}

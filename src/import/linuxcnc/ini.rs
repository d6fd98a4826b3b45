//! The INI file of a LinuxCNC machine: sections, and in them keys with values.

use std::path::{Path, PathBuf};

use crate::error::{Error, Place, Result};
use crate::wording::shown;

/// A value with the number of its line.
pub(super) struct Entry {
    pub line: usize,
    section: String,
    key: String,
    pub value: String,
}

pub(super) struct Ini {
    pub file: PathBuf,
    entries: Vec<Entry>,
}

impl Ini {
    pub fn read(file: &Path, text: &str) -> Result<Ini> {
        let mut ini = Ini { file: file.to_path_buf(), entries: Vec::new() };
        let mut section = String::new();
        for (line, text) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            let text = text.trim();
            if text.is_empty() || text.starts_with(['#', ';']) {
                continue;
            }
            if let Some(name) = text.strip_prefix('[') {
                let Some((name, _)) = name.split_once(']') else {
                    return Err(ini.fault(line, "a section has no closing bracket", "write it as [NAME]"));
                };
                section = name.trim().to_string();
                continue;
            }
            let Some((key, value)) = text.split_once('=') else {
                let what = format!("`{}` is neither a section nor `KEY = value`", shown(text));
                return Err(ini.fault(line, what, "name the INI file of the machine; HAL files go by --hal"));
            };
            let (key, value) = (key.trim().to_string(), value.trim().to_string());
            ini.entries.push(Entry { line, section: section.clone(), key, value });
        }
        Ok(ini)
    }

    /// All values of a key, in their order.
    pub fn all<'a>(&'a self, section: &'a str, key: &'a str) -> impl Iterator<Item = &'a Entry> {
        self.entries.iter().filter(move |e| e.section == section && e.key == key)
    }

    /// The first value of a key, which is the one that LinuxCNC takes.
    pub fn get(&self, section: &str, key: &str) -> Option<&Entry> {
        self.entries.iter().find(|e| e.section == section && e.key == key && !e.value.is_empty())
    }

    /// The number of a key.
    pub fn number(&self, section: &str, key: &str) -> Result<Option<f64>> {
        let Some(entry) = self.get(section, key) else { return Ok(None) };
        number(&entry.value).map(Some).ok_or_else(|| {
            let what = format!("{key} of [{section}] is `{}`, no number", shown(&entry.value));
            self.fault(entry.line, what, "write a number with a decimal point")
        })
    }

    pub fn fault(&self, line: usize, what: impl Into<String>, mend: impl Into<String>) -> Error {
        Error::mistake(Place::at(&self.file, line, 0), what, mend)
    }
}

/// A number, and what a comment behind it says left out.
pub(super) fn number(text: &str) -> Option<f64> {
    text.split(['#', ';']).next()?.trim().parse().ok().filter(|x: &f64| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_keys_and_comments_are_told_apart() {
        let text = "# machine\n[EMC]\nMACHINE = mill = two\n[KINS]\nJOINTS=3 # all\n;off\nEMPTY =\n[HAL]\nHALFILE = a.hal\nHALFILE = b.hal\n";
        let ini = Ini::read(Path::new("m.ini"), text).expect("sound");
        assert_eq!(ini.get("EMC", "MACHINE").map(|e| e.value.as_str()), Some("mill = two"));
        assert_eq!(ini.number("KINS", "JOINTS").expect("sound"), Some(3.0));
        assert!(ini.get("KINS", "EMPTY").is_none() && ini.number("EMC", "MACHINE").is_err());
        assert_eq!(ini.all("HAL", "HALFILE").map(|e| e.line).collect::<Vec<_>>(), [9, 10]);
    }
}

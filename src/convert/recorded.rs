//! Files that are recordings already, taken as they are.

use std::path::Path;

use super::text::decoded;
use super::write::Written;
use crate::columnar::{self, Form, Input, Text};
use crate::error::{Error, Result};
use crate::machine::Machine;
use crate::recording::Recording;

/// The recording that a file is, as text; `None` where it does not say what was measured.
pub(super) fn read(
    file: &Path,
    bytes: &[u8],
    form: Option<Form>,
    machine: Option<&Machine>,
) -> Result<Option<Written>> {
    let text = match form {
        Some(form) => {
            if columnar::Table::open(file, form, Input::Bytes(bytes.into()))?.head().is_none() {
                return Ok(None);
            }
            let mut text = String::new();
            let mut source = Text::open(file, form, Input::Bytes(bytes.into()))?;
            std::io::Read::read_to_string(&mut source, &mut text).map_err(|e| Error::file(file, e))?;
            text
        }
        None => decoded(bytes),
    };
    let mut lines = text.lines().skip_while(|line| line.trim().is_empty());
    let mut head = lines.by_ref().take_while(|line| line.trim_start().starts_with('#'));
    let says = |line: &str| {
        let key = line.trim_start_matches(['#', ' ', '\t']).split_once(':').map(|(key, _)| key.trim());
        key == Some("measurement")
    };
    if !head.any(says) {
        return Ok(None);
    }
    if let Some(machine) = machine {
        Recording::from_bytes(&file.to_string_lossy(), text.as_bytes(), machine)?.scan()?;
    }
    let is_row = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with('#');
    let (mut rows, mut with_gaps) = (0, 0);
    for line in text.lines().filter(is_row).skip(1) {
        rows += 1;
        with_gaps += u64::from(line.split(',').any(super::cell::is_drop_out));
    }
    Ok(Some(Written { marker: None, text, rows, with_gaps }))
}

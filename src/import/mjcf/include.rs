//! Models that are spread over several files, put together as one text that knows where each of its lines comes from.

use std::path::{Path, PathBuf};

use super::super::Reader;
use super::super::xml::Source;
use crate::error::{Error, Place, Result};
use crate::wording::shown;

pub(super) struct Whole {
    pub text: String,
    /// File and line of each line; empty where there is but one file.
    pub lines: Vec<(PathBuf, usize)>,
}

/// So large may a model become, bytes.
const LARGEST: usize = 64 << 20;

/// The text with all that it includes in the place of what names it.
pub(super) fn expanded(file: &Path, text: &str, files: Reader) -> Result<Whole> {
    let mut whole = Whole { text: text.to_string(), lines: Vec::new() };
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut included: Vec<PathBuf> = Vec::new();
    loop {
        let source = Source::of_pieces(file, &whole.text, whole.lines.clone())?;
        let document = source.document()?;
        let Some(node) = document.descendants().find(|n| n.has_tag_name("include")) else { return Ok(whole) };
        let name = node.attribute("file").map(str::trim).filter(|name| !name.is_empty());
        let name = name
            .ok_or_else(|| source.fault(node, "<include> names no file", "write <include file=\"...\"/>"))?;
        // Paths are those of the outermost file, wherever they stand.
        let path = folder.join(name);
        if included.contains(&path) {
            let what = format!("{} is included twice", shown(name));
            return Err(source.fault(node, what, "include a file once, and none in itself"));
        }
        let place = source.place(node);
        let text = files(&path).map_err(|error| match error {
            Error::File { source, .. } => {
                let what = format!("{} cannot be read: {source}", path.display());
                Error::mistake(place, what, "put the file where the model looks for it, beside the model")
            }
            other => other,
        })?;
        let part = Source::new(&path, &text)?;
        let part_document = part.document()?;
        let root = part_document.root_element();
        let (start, end) = match (root.first_child(), root.last_child()) {
            (Some(first), Some(last)) => {
                (part.original(first.range().start), part.original(last.range().end))
            }
            _ => (0, 0),
        };
        let Some(inner) = text.get(start..end) else {
            return Err(Error::mistake(
                Place::file(&path),
                "the file cannot be included",
                "write it without undeclared prefixes",
            ));
        };
        let range = source.original(node.range().start)..source.original(node.range().end);
        whole = whole.with(file, range, (&path, inner, text[..start].matches('\n').count() + 1));
        if whole.text.len() > LARGEST {
            return Err(Error::mistake(Place::file(file), "the model is too large", "include less"));
        }
        included.push(path);
    }
}

impl Whole {
    /// The same with a range of its bytes replaced by a part of a file, which begins in that line there; a line of its own before and behind.
    fn with(
        self,
        file: &Path,
        range: std::ops::Range<usize>,
        (path, inner, line): (&Path, &str, usize),
    ) -> Whole {
        let (before, behind) = (&self.text[..range.start], &self.text[range.end..]);
        let count = |text: &str| text.matches('\n').count();
        let lines = if self.lines.is_empty() {
            (1..=count(&self.text) + 1).map(|line| (file.to_path_buf(), line)).collect()
        } else {
            self.lines
        };
        // The lines in which the element begins and ends.
        let (first, last) = (count(before), count(&self.text[..range.end]));
        let mut all: Vec<(PathBuf, usize)> = lines.iter().take(first + 1).cloned().collect();
        all.extend((line..=line + count(inner)).map(|line| (path.to_path_buf(), line)));
        all.extend(lines.into_iter().skip(last));
        Whole { text: format!("{before}\n{inner}\n{behind}"), lines: all }
    }
}

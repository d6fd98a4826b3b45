//! XML with places: elements, attributes and the numbers in them.

use std::path::{Path, PathBuf};

use roxmltree::{Document, Error as XmlError, Node, ParsingOptions};

use crate::error::{Error, Place, Result};

/// Prefixes without a declaration that are forgiven; other readers of URDF know no namespaces at all.
const MOST_PREFIXES: usize = 16;

/// A text that XML readers take: without what may stand before the first element, prefixes declared.
pub(super) struct Source<'a> {
    pub file: &'a Path,
    text: String,
    /// Lines that were left out at the beginning.
    before: usize,
    /// Bytes that were left out there.
    cut: usize,
    /// Declarations that were put in: where, and how many bytes.
    put_in: (usize, usize),
    /// Files and lines by line, where the text was put together from several files.
    lines: Vec<(PathBuf, usize)>,
}

impl<'a> Source<'a> {
    pub fn new(file: &'a Path, text: &str) -> Result<Self> {
        Source::of_pieces(file, text, Vec::new())
    }

    /// A text that was put together from several files; `lines` says where each line comes from.
    pub fn of_pieces(file: &'a Path, text: &str, lines: Vec<(PathBuf, usize)>) -> Result<Self> {
        let start = text.trim_start_matches('\u{feff}').trim_start();
        let before = text[..text.len() - start.len()].matches('\n').count();
        let cut = text.len() - start.len();
        let mut source = Source { file, text: start.to_string(), before, cut, put_in: (0, 0), lines };
        for _ in 0..MOST_PREFIXES {
            let Err(XmlError::UnknownNamespace(prefix, _)) = source.parse() else { break };
            let Some(at) = source.after_root_name() else { break };
            let declaration = format!(" xmlns:{prefix}=\"undeclared:{prefix}\"");
            source.put_in = (at, source.put_in.1 + declaration.len());
            source.text.insert_str(at, &declaration);
        }
        if source.text.is_empty() {
            let mend = "name a URDF or MJCF file, or fetch it again";
            return Err(Error::mistake(Place::file(file), "the file is empty", mend));
        }
        source.parse().map_err(|e| {
            if matches!(e, XmlError::UnexpectedEndOfStream | XmlError::UnclosedRootNode) {
                let place = source.place_of(source.text.lines().count() + before, 0);
                return Error::mistake(
                    place,
                    "this is no XML: it ends too early",
                    "the file is cut off: export or fetch it again",
                );
            }
            let place = source.place_of(e.pos().row as usize + before, e.pos().col as usize);
            let why = e.to_string();
            let why = why.split(" at ").next().unwrap_or_default().to_string();
            Error::mistake(
                place,
                format!("this is no XML: {why}"),
                "mend the element that begins or ends here",
            )
        })?;
        Ok(source)
    }

    fn parse(&self) -> std::result::Result<Document<'_>, XmlError> {
        Document::parse_with_options(&self.text, ParsingOptions { allow_dtd: true, ..Default::default() })
    }

    /// The document, which [`Source::new`] has read once.
    pub fn document(&self) -> Result<Document<'_>> {
        self.parse().map_err(|e| Error::mistake(Place::file(self.file), e.to_string(), "mend the XML"))
    }

    /// Where the name of the first element ends: comments, declarations and instructions stand before it.
    fn after_root_name(&self) -> Option<usize> {
        let mut at = 0;
        loop {
            at += self.text.get(at..)?.find('<')?;
            let rest = &self.text[at..];
            let end = match () {
                () if rest.starts_with("<!--") => "-->",
                () if rest.starts_with("<?") => "?>",
                () if rest.starts_with("<!") => ">",
                () => {
                    let name = rest.find(|c: char| c.is_whitespace() || c == '>' || c == '/')?;
                    return Some(at + name);
                }
            };
            at += rest.find(end)? + end.len();
        }
    }

    /// A place in the parsed text as a place in the text that was given, both in bytes.
    pub fn original(&self, at: usize) -> usize {
        let (from, bytes) = self.put_in;
        self.cut + if at > from { at.saturating_sub(bytes).max(from) } else { at }
    }

    pub fn line(&self, node: Node) -> usize {
        node.document().text_pos_at(node.range().start).row as usize + self.before
    }

    pub fn fault(&self, node: Node, what: impl Into<String>, mend: impl Into<String>) -> Error {
        Error::mistake(self.place(node), what, mend)
    }

    pub fn place(&self, node: Node) -> Place {
        self.place_of(self.line(node), 0)
    }

    fn place_of(&self, line: usize, column: usize) -> Place {
        match line.checked_sub(1).and_then(|i| self.lines.get(i)) {
            Some((file, line)) => Place::at(file, *line, column),
            None => Place::at(self.file, line, column),
        }
    }

    /// Numbers of an attribute, as many as asked for; nothing where it is missing or empty.
    pub fn numbers<const N: usize>(&self, node: Node, name: &str) -> Result<Option<[f64; N]>> {
        let Some(text) = node.attribute(name).filter(|text| !text.trim().is_empty()) else { return Ok(None) };
        let element = node.tag_name().name();
        let no = || {
            let mend = if text.contains("${") || text.contains("$(") {
                "expand the file by xacro first: `xacro robot.urdf.xacro > robot.urdf`".to_string()
            } else if N == 1 {
                "write one number with a decimal point".to_string()
            } else {
                format!("write {N} numbers with decimal points, spaces between them")
            };
            self.fault(node, format!("`{name}=\"{text}\"` of <{element}> is not {}", count(N)), mend)
        };
        let mut out = [0.0; N];
        let mut words = text.split_whitespace();
        for slot in &mut out {
            *slot = words.next().and_then(|word| word.parse().ok()).ok_or_else(no)?;
        }
        if words.next().is_some() { Err(no()) } else { Ok(Some(out)) }
    }

    /// The same where each of them must be finite and of a size that a machine can have.
    pub fn finite<const N: usize>(&self, node: Node, name: &str) -> Result<Option<[f64; N]>> {
        let numbers = self.numbers::<N>(node, name)?;
        if numbers.is_some_and(|n| n.iter().any(|x| !(x.is_finite() && x.abs() < 1e9))) {
            let what = format!("`{name}` of <{}> is not finite, or beyond 1e9", node.tag_name().name());
            return Err(self.fault(node, what, "write lengths in m and angles in rad"));
        }
        Ok(numbers)
    }
}

/// Whether the first element of a text has this name, whatever follows.
pub(super) fn is_root(text: &str, name: &str) -> bool {
    let mut at = 0;
    while let Some(found) = text[at..].find('<') {
        at += found;
        let rest = &text[at..];
        let end = match () {
            () if rest.starts_with("<!--") => "-->",
            () if rest.starts_with("<?") || rest.starts_with("<!") => ">",
            () => {
                let behind = rest[1..].strip_prefix(name);
                return behind.is_some_and(|rest| {
                    rest.starts_with(|c: char| c.is_whitespace() || matches!(c, '>' | '/'))
                });
            }
        };
        let Some(found) = rest.find(end) else { return false };
        at += found + end.len();
    }
    false
}

fn count(n: usize) -> String {
    if n == 1 { "a number".into() } else { format!("{n} numbers") }
}

/// The first child element of this name.
pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|c| c.is_element() && c.tag_name().name() == name)
}

//! The families that are known: those that come with the crate, and those of a user's file.

use std::path::Path;

use serde::Deserialize;

use super::family::Family;
use super::soundness::{LibraryFault, check, fault};
use crate::document::Document;
use crate::error::{Error, Result};

/// The library that comes with the crate.
const STANDARD: &str = include_str!("library.ron");
const UNNAMED: &str = include_str!("unnamed.ron");
const PRIMITIVES: &str = include_str!("primitives.ron");
/// Where the form of a library is taught.
const GUIDE: &str = "docs/effects.md shows the form of a library of effects";

#[derive(Deserialize)]
#[serde(rename = "Effects", deny_unknown_fields)]
struct LibraryForm {
    families: Vec<Family>,
}

/// Families by name.
///
/// ```
/// use kincal::effects::Library;
///
/// let library = Library::standard();
/// assert!(library.families().iter().any(|family| family.name == "backlash"));
/// assert!(library.without("backlash")?.family("backlash").is_none());
/// # Ok::<(), kincal::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Library {
    families: Vec<Family>,
    /// So many of them, the last ones, are from files.
    added: usize,
}

impl Library {
    /// The library that comes with the crate.
    ///
    /// # Panics
    /// Never: a test reads it.
    pub fn standard() -> Self {
        let none = Library { families: Vec::new(), added: 0 };
        let read = none.with_text("library.ron", STANDARD).expect("a test reads the standard library");
        Library { added: 0, ..read }
    }

    /// Functions of what a place knows that stand for what has no name.
    pub(crate) fn unnamed() -> Self {
        let none = Library { families: Vec::new(), added: 0 };
        none.with_text("unnamed.ron", UNNAMED).expect("a test reads it")
    }

    /// Terms of which laws for that are put together.
    pub(crate) fn primitives() -> Self {
        let none = Library { families: Vec::new(), added: 0 };
        none.with_text("primitives.ron", PRIMITIVES).expect("a test reads it")
    }

    /// This library with the families of a file added; those whose name it has already are replaced.
    ///
    /// # Errors
    /// [`Error::File`], or [`Error::Input`] with line and column.
    pub fn with_file(self, path: impl AsRef<Path>) -> Result<Self> {
        self.with_document(Document::open(path)?)
    }

    /// The same from a text; `file` is only the name that messages use.
    ///
    /// # Errors
    /// As [`Library::with_file`].
    pub fn with_text(self, file: impl AsRef<Path>, text: &str) -> Result<Self> {
        self.with_document(Document::new(file, text.to_string())?)
    }

    fn with_document(mut self, document: Document) -> Result<Self> {
        let document = document.guided(GUIDE);
        let form: LibraryForm = document.read()?;
        let at = |(path, fault): (String, LibraryFault)| Error::input(document.place_of(&path), fault);
        if form.families.is_empty() {
            return Err(at((
                "families".into(),
                fault("there is no family", "write at least one family into the list"),
            )));
        }
        for (i, family) in form.families.iter().enumerate() {
            check(family).map_err(|(path, fault)| at((join(&format!("families[{i}]"), &path), fault)))?;
            for seat in &family.sits {
                let parameters = |f: &Family| f.parameters.iter().map(|p| p.name.clone()).collect::<Vec<_>>();
                let twice = |f: &Family| {
                    f.name == family.name
                        && f.clock == family.clock
                        && f.sits.contains(seat)
                        && parameters(f) == parameters(family)
                };
                if form.families[..i].iter().any(twice) {
                    let what = format!("\"{}\" on {seat:?} is there twice", family.name);
                    let fault = fault(
                        what,
                        "keep one of them, or give them different `sits`, `clock` or `parameters`",
                    );
                    return Err(at((format!("families[{i}].name"), fault)));
                }
            }
        }
        let own = self.families.len() - self.added;
        let is_replaced = |old: &Family| form.families.iter().any(|new| new.name == old.name);
        let replaced = self.families[own..].iter().filter(|old| is_replaced(old)).count();
        self.families.retain(|old| !is_replaced(old));
        self.added += form.families.len() - replaced;
        let kept = self.families.len();
        self.families.extend(form.families);
        for (i, family) in self.families[kept..].iter().enumerate() {
            if let Some(whole) = family.form_of.as_ref().filter(|whole| self.family(whole).is_none()) {
                let what = format!("\"{whole}\" is no family");
                let mend = "name a family of this file or of the standard library";
                return Err(at((format!("families[{i}].form_of"), fault(what, mend))));
            }
            for (k, of) in family.kind_of.iter().enumerate() {
                if *of == family.name || self.family(of).is_none() {
                    let what = format!("\"{of}\" is no other family");
                    let mend = "name a family of this file or of the standard library";
                    return Err(at((format!("families[{i}].kind_of[{k}]"), fault(what, mend))));
                }
            }
            for (k, other) in family.look_alikes.iter().enumerate() {
                if other.effect == family.name || self.family(&other.effect).is_none() {
                    let path = format!("families[{i}].look_alikes[{k}].effect");
                    let what = format!("\"{}\" is no other family", other.effect);
                    return Err(at((
                        path,
                        fault(what, "name a family of this file or of the standard library"),
                    )));
                }
            }
        }
        Ok(self)
    }

    /// This library without the families of this name, the forms and the kinds of it; what named them as look-alikes no longer does. Families that
    /// a file has added stay, unless there are no others of this name: what was left out can be put back by a file.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if there is none.
    pub fn without(mut self, name: &str) -> Result<Self> {
        if self.family(name).is_none() {
            return Err(Error::Undetermined {
                what: format!("there is no effect \"{name}\" to leave out"),
                mend: format!("name one of: {}", self.names().join(", ")),
            });
        }
        let meant = |family: &Family| {
            family.name == name || family.told_as() == name || family.kind_of.iter().any(|of| of == name)
        };
        let own = self.families.len() - self.added;
        let from_files = self.families.split_off(own);
        let is_own = self.families.iter().any(meant);
        self.families.retain(|family| !meant(family));
        let from_files = from_files.into_iter().filter(|family| is_own || !meant(family));
        let before = self.families.len();
        self.families.extend(from_files);
        self.added = self.families.len() - before;
        let kept: Vec<String> = self.families.iter().map(|family| family.name.clone()).collect();
        for family in &mut self.families {
            family.look_alikes.retain(|other| kept.contains(&other.effect));
        }
        Ok(self)
    }

    /// All families. Several may bear one name, on different seats.
    pub fn families(&self) -> &[Family] {
        &self.families
    }

    /// The first family of this name.
    pub fn family(&self, name: &str) -> Option<&Family> {
        self.families.iter().find(|family| family.name == name)
    }

    /// Names in the order of the library, each once.
    pub fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for family in &self.families {
            if !names.contains(&family.name.as_str()) {
                names.push(&family.name);
            }
        }
        names
    }
}

fn join(parent: &str, path: &str) -> String {
    if path.is_empty() || path.starts_with('[') {
        format!("{parent}{path}")
    } else {
        format!("{parent}.{path}")
    }
}

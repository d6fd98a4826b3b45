//! What a program does not say and its control knows: work offsets, tools, where the axes stand.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::document::Document;
use crate::error::{Error, Result};
use crate::machine::FileUnits;
use crate::units::Unit;

/// Where the form of such a file is taught.
const GUIDE: &str = "docs/compensate.md shows the form of a set-up file";

/// The set-up of a program, `docs/compensate.md`. Numbers in the file's units.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    form: Form,
    units: Option<FileUnits>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename = "Setup", deny_unknown_fields)]
struct Form {
    units: Option<UnitsForm>,
    #[serde(default)]
    zero: BTreeMap<String, f64>,
    #[serde(default)]
    work_offsets: BTreeMap<String, BTreeMap<String, f64>>,
    #[serde(default)]
    offset_at_start: Option<String>,
    #[serde(default)]
    tools: BTreeMap<String, f64>,
    #[serde(default)]
    tool_at_start: Option<String>,
    #[serde(default)]
    reference_length: f64,
    #[serde(default)]
    tool_axis: ToolAxis,
    #[serde(default)]
    start: BTreeMap<String, f64>,
    #[serde(default)]
    reference: BTreeMap<String, f64>,
    #[serde(default)]
    tcp_on: Vec<String>,
    #[serde(default)]
    tcp_off: Vec<String>,
    #[serde(default)]
    tcp_at_start: bool,
    #[serde(default)]
    calls: Vec<String>,
    #[serde(default)]
    m_codes: BTreeMap<String, Vec<String>>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename = "units", deny_unknown_fields)]
struct UnitsForm {
    length: Length,
    angle: Angle,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[allow(non_camel_case_types)]
enum Length {
    m,
    mm,
    um,
    r#in,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[allow(non_camel_case_types)]
enum Angle {
    rad,
    deg,
}

/// Which way of frame `t` leads from the tip into the spindle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub enum ToolAxis {
    /// Along +z of frame `t`, the rule for machine tools.
    #[default]
    Plus,
    /// Along -z.
    Minus,
}

impl TryFrom<String> for ToolAxis {
    type Error = String;

    fn try_from(word: String) -> Result<Self, String> {
        match word.as_str() {
            "z" => Ok(ToolAxis::Plus),
            "-z" => Ok(ToolAxis::Minus),
            _ => Err(format!("`tool_axis` is \"{word}\", expected \"z\" or \"-z\"")),
        }
    }
}

/// Work offsets and tools are called by upper-case names without blanks at the ends or quotes.
fn key(name: &str) -> String {
    name.trim().trim_matches('"').trim().to_ascii_uppercase()
}

fn keyed<T: Clone>(map: &BTreeMap<String, T>) -> BTreeMap<String, T> {
    map.iter().map(|(name, value)| (key(name), value.clone())).collect()
}

/// M codes and addresses of axes in upper case.
fn upper(codes: BTreeMap<String, Vec<String>>) -> BTreeMap<String, Vec<String>> {
    codes.into_iter().map(|(code, axes)| (key(&code), axes.iter().map(|axis| key(axis)).collect())).collect()
}

impl Setup {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::Input`] with line and column.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::from_document(&Document::open(path)?.guided(GUIDE))
    }

    /// Reads a text; `file` is only the name that messages use.
    ///
    /// # Errors
    /// As [`Setup::open`].
    pub fn parse(file: impl AsRef<Path>, text: &str) -> Result<Self> {
        Self::from_document(&Document::new(file, text.to_string())?.guided(GUIDE))
    }

    fn from_document(document: &Document) -> Result<Self> {
        let mut form: Form = document.read()?;
        let numbers = (form.zero.iter().map(|(k, v)| (format!("zero.{k}"), *v)))
            .chain(form.work_offsets.iter().flat_map(|(name, axes)| {
                axes.iter().map(move |(k, v)| (format!("work_offsets.{name}.{k}"), *v))
            }))
            .chain(form.tools.iter().map(|(k, v)| (format!("tools.{k}"), *v)))
            .chain(form.start.iter().map(|(k, v)| (format!("start.{k}"), *v)))
            .chain(form.reference.iter().map(|(k, v)| (format!("reference.{k}"), *v)))
            .chain([("reference_length".to_string(), form.reference_length)]);
        for (path, value) in numbers {
            if !(value.is_finite() && value.abs() < 1e9) {
                return Err(Error::mistake(
                    document.place_of(path.split('.').next().unwrap_or_default()),
                    format!("`{path}` is {value}"),
                    "write a number of ordinary size",
                ));
            }
        }
        let units = form.units.unwrap_or(UnitsForm { length: Length::mm, angle: Angle::deg });
        let named = |symbol| Unit::named(symbol).expect("a unit of the list");
        let units = FileUnits {
            length: named(match units.length {
                Length::m => "m",
                Length::mm => "mm",
                Length::um => "um",
                Length::r#in => "in",
            }),
            angle: named(match units.angle {
                Angle::rad => "rad",
                Angle::deg => "deg",
            }),
        };
        form.zero = keyed(&form.zero);
        form.start = keyed(&form.start);
        form.reference = keyed(&form.reference);
        form.tools = keyed(&form.tools);
        form.m_codes = upper(form.m_codes);
        form.work_offsets = keyed(&form.work_offsets).into_iter().map(|(k, v)| (k, keyed(&v))).collect();
        for list in [&mut form.tcp_on, &mut form.tcp_off, &mut form.calls] {
            list.iter_mut().for_each(|name| *name = key(name));
        }
        Ok(Setup { form, units: Some(units) })
    }

    /// The same with the axes that M codes move, from a file that is a map of codes to addresses: `{"M170": [], "M60": ["Z"]}`.
    ///
    /// # Errors
    /// As [`Setup::open`].
    pub fn with_m_codes(mut self, path: impl AsRef<Path>) -> Result<Self> {
        let document = Document::open(path)?.guided(GUIDE);
        let codes: BTreeMap<String, Vec<String>> = document.read()?;
        self.form.m_codes.extend(upper(codes));
        Ok(self)
    }

    fn si(&self, value: f64, rotary: bool) -> f64 {
        match self.units {
            Some(units) if rotary => units.angle.to_si(value),
            Some(units) => units.length.to_si(value),
            None => value,
        }
    }

    /// What the control shows for this axis in the machine's own frame where the joint stands at zero, m or
    /// rad.
    pub(super) fn zero(&self, address: &str, rotary: bool) -> f64 {
        self.form.zero.get(address).map_or(0.0, |value| self.si(*value, rotary))
    }

    /// Where the axis stands before the program starts, as the program would say it, m or rad.
    pub(super) fn start(&self, address: &str, rotary: bool) -> Option<f64> {
        self.form.start.get(address).map(|value| self.si(*value, rotary))
    }

    /// The work offset of that name for one axis, m or rad; `None` where the file has no such offset.
    pub(super) fn offset(&self, name: &str, address: &str, rotary: bool) -> Option<f64> {
        let axes = self.form.work_offsets.get(&key(name))?;
        Some(axes.get(address).map_or(0.0, |value| self.si(*value, rotary)))
    }

    /// Where `G28` takes the axis, in the machine's own frame, m or rad.
    pub(super) fn reference(&self, address: &str, rotary: bool) -> Option<f64> {
        self.form.reference.get(address).map(|value| self.si(*value, rotary))
    }

    /// The offset in force before the program names one.
    pub(super) fn offset_at_start(&self) -> Option<String> {
        self.form.offset_at_start.as_deref().map(key)
    }

    /// The tool in the spindle before the program names one.
    pub(super) fn tool_at_start(&self) -> Option<String> {
        self.form.tool_at_start.as_deref().map(key)
    }

    /// Length of a tool from the gauge line to the tip, m. Number 0 is no tool.
    pub(super) fn length(&self, name: &str) -> Option<f64> {
        let name = key(name);
        let plain = name.trim_start_matches('0');
        let found = self.form.tools.get(&name).or_else(|| self.form.tools.get(plain));
        match found {
            Some(length) => Some(self.si(*length, false)),
            None if !name.is_empty() && plain.is_empty() => Some(0.0),
            None => None,
        }
    }

    /// Length at which frame `t` is the tip, m.
    pub(super) fn reference_length(&self) -> f64 {
        self.si(self.form.reference_length, false)
    }

    pub(super) fn tool_axis(&self) -> ToolAxis {
        self.form.tool_axis
    }

    pub(super) fn tcp_at_start(&self) -> bool {
        self.form.tcp_at_start
    }

    /// Whether this word switches the tool centre point function on or off.
    pub(super) fn tcp_by(&self, word: &str) -> Option<bool> {
        let listed = |list: &[String]| list.iter().any(|name| name == word);
        if listed(&self.form.tcp_on) { Some(true) } else { listed(&self.form.tcp_off).then_some(false) }
    }

    /// Whether a call of this name is said not to cut.
    pub(super) fn leaves_alone(&self, call: &str) -> bool {
        self.form.calls.iter().any(|name| *name == key(call))
    }

    /// The axes that an M code of this machine moves, where the set-up says so.
    pub(super) fn moved_by(&self, code: &str) -> Option<&[String]> {
        let listed = self.form.m_codes.get(&key(code)).map(Vec::as_slice);
        listed.or_else(|| self.tcp_by(&key(code)).map(|_| &[][..]))
    }
}

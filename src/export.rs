//! Calibrated machines in the forms of others: ISO 230-1 tables, URDF, MJCF, DH tables, parameters of controls, compensation tables.
//!
//! Every form is a file that is written whole, with the numbers that stand in it and with what it cannot hold. A number that the
//! recordings did not determine is never among those to be entered; it is listed with the reason. `docs/export.md` has the conventions.

mod compensation;
mod control;
mod curve;
mod dh;
mod error_motions;
mod heidenhain;
mod iso230;
mod known;
mod lines;
mod linuxcnc;
mod mjcf;
mod numbers;
mod table;
mod travel;
mod urdf;
mod varying;
mod vectors;

use std::fmt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::calibration::CalibratedMachine;
use crate::error::{Error, Place, Result};
use crate::import::Ends;

/// The form of an exported file.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Location errors under their names of ISO 230-1, a CSV table.
    Iso230,
    /// Position errors of every joint over its travel, both directions, a CSV table.
    Table,
    /// The six error motions of every axis over its travel under their names of ISO 230-1, both directions, a CSV table.
    ErrorMotions,
    /// A robot description, m and rad: a new one, or the origins of [`ExportOptions::base_file`].
    Urdf,
    /// A model of MuJoCo, m and rad: the geometry, joints that follow others, play, friction, compliance, lag, and an actuator for the
    /// position and the rate of every command.
    Mjcf,
    /// Denavit-Hartenberg parameters, standard convention.
    Dh,
    /// The same, modified convention (Craig).
    Mdh,
    /// Pins of a LinuxCNC kinematics module, and INI lines.
    LinuxCnc,
    /// One axis as LinuxCNC's `COMP_FILE`.
    LinuxCncComp,
    /// SINUMERIK: vectors of the tool carrier and of the five-axis transformation.
    Siemens,
    /// SINUMERIK: a part program that fills the table of encoder compensation.
    EncComp,
    /// HEIDENHAIN: what the kinematics cycles should find.
    Heidenhain,
    /// FANUC: vectors of tool centre point control.
    Fanuc,
}

/// All formats with the word that names each.
pub const FORMATS: [(Format, &str); 13] = [
    (Format::Urdf, "urdf"),
    (Format::Mjcf, "mjcf"),
    (Format::Dh, "dh"),
    (Format::Mdh, "mdh"),
    (Format::LinuxCnc, "linuxcnc"),
    (Format::LinuxCncComp, "linuxcnc-comp"),
    (Format::Siemens, "siemens"),
    (Format::EncComp, "enc-comp"),
    (Format::Heidenhain, "heidenhain"),
    (Format::Fanuc, "fanuc"),
    (Format::Iso230, "iso230"),
    (Format::ErrorMotions, "error-motions"),
    (Format::Table, "table"),
];

impl Format {
    /// The format of this name.
    pub fn named(name: &str) -> Option<Format> {
        FORMATS.into_iter().find(|(_, own)| *own == name).map(|(format, _)| format)
    }

    /// Its name, as `--to` takes it.
    pub fn name(self) -> &'static str {
        FORMATS.into_iter().find(|(format, _)| *format == self).map_or("", |(_, name)| name)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What an export needs besides the calibrated machine.
#[non_exhaustive]
#[derive(Clone, Debug, Default)]
pub struct ExportOptions {
    /// Length of the tool that frame `t` is the tip of, from the gauge line of the spindle, m.
    pub tool_length: f64,
    /// The axis of [`Format::LinuxCncComp`]; the only one that has position errors where nothing is said.
    pub axis: Option<String>,
    /// The description that the machine was imported from, for [`Format::Urdf`].
    pub base_file: Option<BaseFile>,
}

impl ExportOptions {
    /// With a tool of this length from the gauge line of the spindle, m.
    #[must_use]
    pub fn with_tool_length(mut self, tool_length: f64) -> Self {
        self.tool_length = tool_length;
        self
    }

    /// Of this axis.
    #[must_use]
    pub fn with_axis(mut self, axis: impl Into<String>) -> Self {
        self.axis = Some(axis.into());
        self
    }

    /// Into this description.
    #[must_use]
    pub fn with_base_file(mut self, base_file: BaseFile) -> Self {
        self.base_file = Some(base_file);
        self
    }
}

/// A description whose origins are written anew.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BaseFile {
    /// Its path, or the name that messages use.
    pub file: PathBuf,
    /// Its text.
    pub text: String,
    /// The ends of the chain, as the machine was imported.
    pub ends: Ends,
}

impl BaseFile {
    /// A description by its text; `file` is the name that messages use.
    pub fn new(file: impl Into<PathBuf>, text: impl Into<String>, ends: Ends) -> BaseFile {
        BaseFile { file: file.into(), text: text.into(), ends }
    }

    /// Reads a description.
    ///
    /// # Errors
    /// [`Error::File`], or [`Error::Input`] where it is not UTF-8.
    pub fn open(path: impl AsRef<Path>, ends: Ends) -> Result<BaseFile> {
        let file = path.as_ref().to_path_buf();
        let bytes = std::fs::read(&file).map_err(|source| Error::file(&file, source))?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
            let line = valid.iter().filter(|b| **b == b'\n').count() + 1;
            Error::mistake(
                Place::at(&file, line, 0),
                "this line is not UTF-8",
                "save the file as UTF-8: its bytes are kept as they are",
            )
        })?;
        Ok(BaseFile { file, text, ends })
    }
}

/// A number as it stands in an exported file.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Number {
    /// Its name there.
    pub name: String,
    /// The calibrated value in `unit`; nothing where the recordings do not determine it.
    pub value: Option<f64>,
    /// What the machine file as declared would give, in `unit`.
    pub declared: f64,
    /// `mm`, `um`, `m`, `urad`, `rad`, `s`, `N`, `Nm`, `N/m`, `Nm/rad` or `1`.
    pub unit: String,
    /// Why there is no value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub because: Option<String>,
}

/// Something about the calibrated machine that the format cannot hold.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Remainder {
    /// What it is.
    pub what: String,
    /// Largest error that it leaves at the tool over the travel, m; nothing where that is not known.
    pub max_m: Option<f64>,
    /// Root mean square of the same, m.
    pub rms_m: Option<f64>,
    /// Why it stays out, or what takes it.
    pub because: String,
}

/// A calibrated machine in another form.
#[non_exhaustive]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Exported {
    /// The file.
    #[serde(skip)]
    pub text: String,
    /// The numbers in it.
    pub numbers: Vec<Number>,
    /// What it does not hold, with what that leaves at the tool.
    pub left_out: Vec<Remainder>,
    /// What was chosen or has to be known, one sentence each.
    pub told: Vec<String>,
}

impl Exported {
    /// What the file does not hold, as comments behind its first line, where the form has comments.
    fn say_in_file(&mut self, format: Format) {
        let mark = match format {
            Format::Urdf | Format::Mjcf | Format::LinuxCncComp => return,
            Format::Siemens | Format::EncComp => ";",
            _ => "#",
        };
        let um = |m: Option<f64>| m.map_or("size not known".to_string(), |m| format!("{:.1} um", 1e6 * m));
        let line = |left: &Remainder| {
            let sizes = match left.max_m {
                Some(_) => format!("up to {}, RMS {}, at the tool tip", um(left.max_m), um(left.rms_m)),
                None => um(None),
            };
            numbers::one_line(&format!("{mark} not in this file: {}: {sizes}; {}", left.what, left.because))
                + "\n"
        };
        let lines: String = self.left_out.iter().map(line).collect();
        let at = self.text.find('\n').map_or(self.text.len(), |at| at + 1);
        self.text.insert_str(at, &lines);
    }
}

/// Writes a calibrated machine in another form.
///
/// ```
/// use kincal::CalibratedMachine;
/// use kincal::export::{Format, ExportOptions, export};
///
/// let mill = CalibratedMachine::parse("mill.ron", r#"Machine(
///     name: "mill", units: (length: mm, angle: deg), workpiece: [(frame: "w")],
///     tool: [(frame: "x", joint: Prismatic(axis: "x", travel: (0, 500))), (frame: "y", joint: Prismatic(axis: "y", travel: (0, 300))), (frame: "t")],
///     calibration: (deviations: [(frame: "y", v: (0, 0, 0), w: (0, 0, 0.01))], unseen: []),
/// )"#)?;
/// let file = export(&mill, Format::Iso230, &ExportOptions::default())?;
/// assert!(file.text.contains("EC0Y,174.53292"));
/// # Ok::<(), kincal::Error>(())
/// ```
///
/// # Errors
/// [`Error::Undetermined`] where the machine holds nothing that the format could, or is of a kind that it does not know.
pub fn export(calibrated: &CalibratedMachine, format: Format, options: &ExportOptions) -> Result<Exported> {
    let machine = calibrated.machine();
    if machine.commands().is_empty() {
        let what = format!("nothing moves on machine \"{}\"", machine.name());
        return Err(refused(what, "give the file of a machine with a joint"));
    }
    let mut exported = match format {
        Format::Iso230 => iso230::write(calibrated),
        Format::ErrorMotions => error_motions::write(calibrated),
        Format::Table => table::write(calibrated),
        Format::Urdf => match &options.base_file {
            Some(base) => urdf::patched(calibrated, &base.file, &base.text, &base.ends),
            None => urdf::write(calibrated),
        },
        Format::Mjcf => mjcf::write(calibrated),
        Format::Dh => dh::write(calibrated, false),
        Format::Mdh => dh::write(calibrated, true),
        Format::LinuxCnc => linuxcnc::write(calibrated, options),
        Format::LinuxCncComp => compensation::comp_file(calibrated, options),
        Format::Siemens => vectors::siemens(calibrated, options),
        Format::EncComp => compensation::enc_comp(calibrated),
        Format::Heidenhain => heidenhain::write(calibrated, options),
        Format::Fanuc => vectors::fanuc(calibrated, options),
    }?;
    exported.say_in_file(format);
    Ok(exported)
}

/// The machine is of a kind that the format does not hold.
fn refused(what: impl Into<String>, mend: impl Into<String>) -> Error {
    Error::Undetermined { what: what.into(), mend: mend.into() }
}

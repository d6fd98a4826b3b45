//! Machines from files that describe them in other forms: URDF, MJCF, Denavit-Hartenberg tables, configurations of LinuxCNC.
//!
//! [`read`] makes a machine file of the chain between two links or bodies of a robot, or of all joints of a table or a control, in the
//! units of the description. Joints that are fixed become part of the next joint's initial pose. Frames and joints bear the joints' names.
//! `docs/import.md` says what is understood.

mod cell;
mod chain;
mod dh;
mod linuxcnc;
mod mjcf;
mod names;
mod origins;
mod position;
mod sheet;
mod sketch;
mod step;
mod urdf;
mod write;
mod xml;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::convert::decoded;
use crate::error::{Error, Place, Result};
use crate::machine::{FileUnits, Machine};

pub(crate) use origins::{Edit, Held, origins};
pub use sketch::{Sketch, SketchJoint};
#[cfg(feature = "cli")]
pub(crate) use sketch::{Wrong, branch, direction, limits, named_kind, point, usable_name};

/// The form of a description.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// URDF.
    Urdf,
    /// MJCF, the models of MuJoCo.
    Mjcf,
    /// A table of Denavit-Hartenberg parameters, standard convention.
    Dh,
    /// The same, modified convention (Craig).
    Mdh,
    /// The INI file of a machine that LinuxCNC runs.
    LinuxCnc,
}

/// Which part of a description becomes the machine.
#[non_exhaustive]
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ends {
    /// Link or body that carries the workpiece frame `w`; the root where nothing is said.
    pub base: Option<String>,
    /// Link, body or site that is the tool frame `t`; the only end of a chain where nothing is said.
    pub tip: Option<String>,
}

impl Ends {
    /// From this link or body.
    #[must_use]
    pub fn with_base(mut self, base: impl Into<String>) -> Self {
        self.base = Some(base.into());
        self
    }

    /// To this link, body or site.
    #[must_use]
    pub fn with_tip(mut self, tip: impl Into<String>) -> Self {
        self.tip = Some(tip.into());
        self
    }
}

/// What is known of a description besides what it says itself.
#[non_exhaustive]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// Its form; found from the text where nothing is said.
    pub form: Option<Form>,
    /// Which part of it becomes the machine, where its links have names.
    pub ends: Ends,
    /// HAL files of a [`Form::LinuxCnc`] machine, besides those that its INI file names.
    pub hal: Vec<PathBuf>,
    /// Length of the tool that frame `t` of such a machine is the tip of, from the gauge line of the spindle, m.
    pub tool_length: f64,
    /// Texts of files that the description names; [`open_with`] reads those that are not here.
    pub beside: Vec<Beside>,
}

impl ImportOptions {
    /// A description of this form.
    #[must_use]
    pub fn with_form(mut self, form: Form) -> Self {
        self.form = Some(form);
        self
    }

    /// This part of it.
    #[must_use]
    pub fn with_ends(mut self, ends: Ends) -> Self {
        self.ends = ends;
        self
    }

    /// With a HAL file besides.
    #[must_use]
    pub fn with_hal(mut self, file: impl Into<PathBuf>) -> Self {
        self.hal.push(file.into());
        self
    }

    /// With a tool of this length from the gauge line of the spindle, m.
    #[must_use]
    pub fn with_tool_length(mut self, tool_length: f64) -> Self {
        self.tool_length = tool_length;
        self
    }

    /// With the text of a file that the description names.
    #[must_use]
    pub fn with_beside(mut self, beside: Beside) -> Self {
        self.beside.push(beside);
        self
    }
}

/// A file beside a description.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Beside {
    /// Its path, as the description leads to it.
    pub file: PathBuf,
    /// Its text.
    pub text: String,
}

impl Beside {
    /// The file that the description calls so, with its text.
    pub fn new(file: impl Into<PathBuf>, text: impl Into<String>) -> Self {
        Beside { file: file.into(), text: text.into() }
    }
}

impl From<Ends> for ImportOptions {
    fn from(ends: Ends) -> Self {
        ImportOptions { ends, ..ImportOptions::default() }
    }
}

/// A machine that was read from a foreign description.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "ImportedForm", into = "ImportedForm")]
pub struct Imported {
    /// The machine.
    pub machine: Machine,
    /// Its file with comments that say where numbers come from; reads back as the same machine.
    pub text: String,
    /// What was guessed, mapped or left out, one sentence each.
    pub told: Vec<String>,
    /// Files that were read besides, as the description leads to them.
    pub beside: Vec<PathBuf>,
}

/// A machine stands in it as its file.
#[derive(Serialize, Deserialize)]
struct ImportedForm {
    text: String,
    told: Vec<String>,
    beside: Vec<PathBuf>,
}

impl From<Imported> for ImportedForm {
    fn from(Imported { machine: _, text, told, beside }: Imported) -> Self {
        ImportedForm { text, told, beside }
    }
}

impl TryFrom<ImportedForm> for Imported {
    type Error = Error;

    fn try_from(ImportedForm { text, told, beside }: ImportedForm) -> Result<Self> {
        Ok(Imported { machine: Machine::parse("imported", &text)?, text, told, beside })
    }
}

/// Reads the description at `path`, of whatever form it is.
///
/// # Errors
/// [`Error::File`], or [`Error::Input`] with the line at fault.
pub fn open(path: impl AsRef<Path>, ends: &Ends) -> Result<Imported> {
    open_with(path, &ends.clone().into())
}

/// The same with what is known of it besides.
///
/// # Errors
/// As [`open`].
pub fn open_with(path: impl AsRef<Path>, options: &ImportOptions) -> Result<Imported> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|source| Error::file(path, source))?;
    imported(path, &decoded(&bytes), options, &|file| {
        let bytes = std::fs::read(file).map_err(|source| Error::file(file, source))?;
        Ok(decoded(&bytes))
    })
}

/// Reads a description; `file` is only the name that messages use.
///
/// ```
/// use kincal::import::{Ends, read};
///
/// let arm = read("arm.urdf", r#"<robot name="arm">
///     <link name="floor"/> <link name="hand"/>
///     <joint name="lift" type="prismatic"> <parent link="floor"/> <child link="hand"/>
///         <origin xyz="0 0 0.4"/> <axis xyz="0 0 1"/> <limit lower="0" upper="0.3"/> </joint>
/// </robot>"#, &Ends::default())?;
/// assert_eq!(arm.machine.commands(), ["lift"]);
/// # Ok::<(), kincal::Error>(())
/// ```
///
/// # Errors
/// [`Error::Input`] with the line at fault.
pub fn read(file: impl AsRef<Path>, text: &str, ends: &Ends) -> Result<Imported> {
    read_with(file, text, &ends.clone().into())
}

/// The same with what is known of it besides.
///
/// ```
/// use kincal::import::{Form, ImportOptions, read_with};
///
/// let options = ImportOptions::default().with_form(Form::Dh);
/// let arm = read_with("scara.csv", "joint,kind,theta[deg],d[mm],a[mm],alpha[deg]\n\
///     shoulder,revolute,0,387,325,0\n\
///     elbow,revolute,0,0,275,180\n\
///     quill,prismatic,0,0,0,0\n", &options)?;
/// assert_eq!(arm.machine.commands(), ["shoulder", "elbow", "quill"]);
/// # Ok::<(), kincal::Error>(())
/// ```
///
/// # Errors
/// As [`read`].
pub fn read_with(file: impl AsRef<Path>, text: &str, options: &ImportOptions) -> Result<Imported> {
    imported(file.as_ref(), text, options, &|file| {
        Err(Error::file(file, std::io::Error::from(std::io::ErrorKind::NotFound)))
    })
}

/// Reads a file that a description names.
type Reader<'a> = &'a dyn Fn(&Path) -> Result<String>;

fn imported(file: &Path, text: &str, options: &ImportOptions, files: Reader) -> Result<Imported> {
    let given = |file: &Path| match options.beside.iter().find(|beside| beside.file == file) {
        Some(beside) => Ok(beside.text.clone()),
        None => files(file),
    };
    let has_ends = options.ends != Ends::default();
    let form = options.form.map_or_else(|| form_of(file, text), Ok)?;
    let read = std::cell::RefCell::new(Vec::new());
    let given = |beside: &Path| {
        read.borrow_mut().push(beside.to_path_buf());
        given(beside)
    };
    let chain = match form {
        Form::Urdf => chain::cut(&urdf::read(file, text)?, &options.ends)?,
        Form::Mjcf => chain::cut(&mjcf::read(file, text, &given)?, &options.ends)?,
        Form::Dh | Form::Mdh if has_ends => {
            let what = "--base and --tip name links, which a DH table has not";
            let mend = "write `# base[m,rad]: x,y,z,rx,ry,rz` and `# tool[m,rad]: ...` into the table";
            return Err(Error::mistake(Place::file(file), what, mend));
        }
        Form::LinuxCnc if has_ends => {
            let what = "--base and --tip name links, which a machine of LinuxCNC has not";
            let mend = "leave them out; --tool-length says where the tip is";
            return Err(Error::mistake(Place::file(file), what, mend));
        }
        Form::LinuxCnc => linuxcnc::read(file, text, &options.hal, options.tool_length, &given)?,
        Form::Dh | Form::Mdh => dh::read(file, text, options.form)?,
    };
    Ok(Imported { beside: read.take(), ..machine_of(file, chain)? })
}

/// The form that a text looks like.
fn form_of(file: &Path, text: &str) -> Result<Form> {
    let start = text.trim_start_matches('\u{feff}').trim_start();
    if start.is_empty() || start.starts_with('<') {
        let is_model = ["mujoco", "mujocoinclude"].into_iter().any(|name| xml::is_root(start, name));
        Ok(if is_model { Form::Mjcf } else { Form::Urdf })
    } else if linuxcnc::is_ini(text) {
        Ok(Form::LinuxCnc)
    } else if dh::is_table(text) {
        // Either convention: the table says which.
        Ok(Form::Dh)
    } else {
        let what =
            "this is neither XML, nor a table with a column `alpha`, nor an INI file with a section [KINS]";
        let mend = "name a URDF or MJCF file, a table of Denavit-Hartenberg parameters, or the INI file of a LinuxCNC machine";
        Err(Error::mistake(Place::file(file), what, mend))
    }
}

/// The machine that a chain is.
fn machine_of(file: &Path, chain: chain::Chain) -> Result<Imported> {
    let name = file.file_name().map_or_else(String::new, |n| chain::one_line(&n.to_string_lossy()));
    let same = if chain.units == FileUnits::si() { "; m and rad as there" } else { "" };
    let made =
        format!("// Made by `kincal import` from {name}{same}. Each frame bears the name of its joint.");
    machine_as(file, &made, chain)
}

/// The same with a first line of the file that says where it comes from.
fn machine_as(file: &Path, made: &str, chain: chain::Chain) -> Result<Imported> {
    let text = write::ron(made, &chain);
    // What a machine file cannot hold is told by the reader of machine files, of the place in the robot's file.
    let machine = Machine::parse(file, &text).map_err(|error| {
        let why = match &error {
            Error::Input { fault, .. } => fault.to_string(),
            other => other.to_string(),
        };
        let mend = format!("mend the description, or choose other ends of the chain ({})", error.mend());
        Error::mistake(Place::file(file), format!("the chain makes no machine: {why}"), mend)
    })?;
    Ok(Imported { machine, text, told: chain.told, beside: Vec::new() })
}

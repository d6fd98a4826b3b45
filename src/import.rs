//! Machines from files that describe robots in other forms: URDF.
//!
//! [`read`] makes a machine file of the chain between two links, in m and rad as URDF has them. Joints that are fixed become part of the
//! next joint's initial pose. Frames and joints bear the joints' names. `docs/import.md` says what is understood.

mod chain;
mod names;
mod origins;
mod step;
mod urdf;
mod write;
mod xml;

use std::path::Path;

use crate::error::{Error, Place, Result};
use crate::machine::Machine;

pub(crate) use origins::{Edit, Held, origins};

/// Which part of a description becomes the machine.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ends {
    /// Link that carries the workpiece frame `w`; the root where nothing is said.
    pub base: Option<String>,
    /// Link that is the tool frame `t`; the only end of a chain where nothing is said.
    pub tip: Option<String>,
}

/// A machine that was read from a foreign description.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The machine.
    pub machine: Machine,
    /// Its file with comments that say where numbers come from; reads back as the same machine.
    pub text: String,
    /// What was guessed, mapped or left out, one sentence each.
    pub told: Vec<String>,
}

/// Reads the URDF file at `path`.
///
/// # Errors
/// [`Error::File`], or [`Error::Input`] with the line at fault.
pub fn open(path: impl AsRef<Path>, ends: &Ends) -> Result<Imported> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|source| Error::file(path, source))?;
    // Descriptions in old encodings have their odd letters in comments; a name that has one is mapped and told.
    read(path, &String::from_utf8_lossy(&bytes), ends)
}

/// Reads a URDF text; `file` is only the name that messages use.
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
    let file = file.as_ref();
    let robot = urdf::read(file, text)?;
    machine_of(file, chain::cut(&robot, ends)?)
}

/// The machine that a chain is.
fn machine_of(file: &Path, chain: chain::Chain) -> Result<Imported> {
    let text = write::ron(file, &chain);
    // What a machine file cannot hold is told by the reader of machine files, of the place in the robot's file.
    let machine = Machine::parse(file, &text).map_err(|error| {
        let why = match &error {
            Error::Input { fault, .. } => fault.to_string(),
            other => other.to_string(),
        };
        let mend =
            format!("choose other links by --base and --tip, or mend the description ({})", error.mend());
        Error::mistake(Place::file(file), format!("the chain makes no machine: {why}"), mend)
    })?;
    Ok(Imported { machine, text, told: chain.told })
}

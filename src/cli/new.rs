//! `kincal new`

mod questions;

use std::path::PathBuf;

use serde_json::json;

use super::Common;
use super::files::Output;
use super::output::{Failure, Outcome, count, write_whole};
use crate::error::Error;
use crate::import::{Sketch, Wrong, point};
use crate::machine::{Machine, explained, is_usable_name, shipped};
use crate::units::{Quantity, Unit};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// A copy of a machine that comes with the program; `kincal machines` lists them
    #[arg(long, value_name = "NAME", group = "from")]
    like: Option<String>,
    /// A table of joints: name, kind, carries, direction, point[mm], and limits as lower[mm], upper[mm], lower[deg], upper[deg]; in rows `t` and `w` the points of the tool tip and of the workpiece's origin
    #[arg(long, value_name = "JOINTS.csv", group = "from")]
    joints: Option<PathBuf>,
    /// A joint, from the base outwards; once for each: name, kind, carries, direction and a point of its axis in mm, with semicolons between
    #[arg(long, value_name = "NAME;KIND;CARRIES;DIRECTION;POINT", group = "from")]
    joint: Vec<String>,
    /// With --joint: the tool tip with all joints at zero, in mm
    #[arg(long, value_name = "POINT", allow_hyphen_values = true, requires = "joint")]
    tip: Option<String>,
    /// With --joint: the origin of the workpiece, in mm
    #[arg(long, value_name = "POINT", allow_hyphen_values = true, requires = "joint")]
    origin: Option<String>,
    /// Name of the machine; that of its file where nothing is said
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Where to write the machine file
    #[arg(short, long, value_name = "MACHINE.ron")]
    output: Output,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let stem = args.output.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let name = args.name.clone().unwrap_or(stem);
    if !is_usable_name(&name) {
        return Err(Failure::Told {
            what: format!("`{}` is no name of a machine", crate::wording::shown(&name)),
            mend: "give one by --name: letters, digits, `_ - .`, begins with a letter, 64 at most".into(),
        });
    }
    let (machine, text) = match (&args.like, &args.joints) {
        (Some(like), _) => copy(like, &name)?,
        (None, Some(file)) => {
            let bytes = std::fs::read(file).map_err(|source| Error::file(file, source))?;
            made(&Sketch::read(&name, file, &String::from_utf8_lossy(&bytes))?)?
        }
        (None, None) if !args.joint.is_empty() => made(&listed(args, &name)?)?,
        (None, None) => made(&questions::ask(&args.common, &name)?)?,
    };
    write_whole(&args.output, |out| {
        // Watched: an error here is told of the output.
        let _ = out.write_all(text.as_bytes());
        Ok(())
    })?;
    let commands = machine.commands();
    let joints = count(commands.len() as u64, "joint", "joints");
    let file = args.output.display();
    args.common.say(&format!(
        "{}: {joints}: {}\nwritten to {file}; `kincal describe {file}` says what it is\n",
        machine.name(),
        commands.join(", ")
    ))?;
    args.common.write_json(&json!({"machine": machine.name(), "joints": commands}))
}

/// A sketch as a machine and its file.
fn made(sketch: &Sketch) -> Result<(Machine, String), Failure> {
    let imported = sketch.machine()?;
    Ok((imported.machine, imported.text))
}

/// The file of a machine that comes with the program, under another name and with comments.
fn copy(like: &str, name: &str) -> Result<(Machine, String), Failure> {
    let text = shipped(like).ok_or_else(|| super::machines::unknown(like))?;
    let own = format!("    name: \"{like}\",");
    let named = text.replacen(&own, &format!("    name: \"{name}\","), 1);
    let text = explained(&format!(
        "// A copy of {like}, which comes with kincal: change what differs on yours.\n{named}"
    ));
    let machine = Machine::parse(format!("--name {name}"), &text)?;
    Ok((machine, text))
}

/// The machine of `--joint`, `--tip` and `--origin`, read as the table that they are.
fn listed(args: &Args, name: &str) -> Result<Sketch, Failure> {
    let mut table = "name;kind;carries;direction;point[mm]\n".to_string();
    for joint in &args.joint {
        let missing = 4usize.saturating_sub(joint.matches(';').count());
        table.push_str(&format!("{}{}\n", joint.replace(['\n', '\r'], " "), ";".repeat(missing)));
    }
    let mut sketch = Sketch::read(name, "--joint", &table).map_err(|error| of_argument(args, error))?;
    let unit =
        Unit::named("mm").filter(|unit| unit.quantity == Quantity::Length).unwrap_or(sketch.units.length);
    let place = |option: &str, text: &Option<String>| {
        let told =
            |(what, mend): Wrong| Failure::Told { what: format!("{option}: {what}"), mend: mend.into() };
        text.as_deref().map_or(Ok(None), |text| point(text, unit)).map_err(told)
    };
    sketch.tip = place("--tip", &args.tip)?.unwrap_or(sketch.tip);
    sketch.origin = place("--origin", &args.origin)?.unwrap_or(sketch.origin);
    Ok(sketch)
}

/// A fault in a row, told of the argument that it comes from.
fn of_argument(args: &Args, error: Error) -> Failure {
    let row = error.place().and_then(|place| args.joint.get(place.line.checked_sub(2)?));
    match (&error, row) {
        (Error::Input { fault, .. }, Some(joint)) => {
            Failure::Told { what: format!("--joint '{joint}': {fault}"), mend: error.mend() }
        }
        _ => error.into(),
    }
}

//! `kincal import`

use std::path::PathBuf;

use crate::import::{Ends, Form, ImportOptions, open_with};
use crate::units::{Quantity, amount};
use serde_json::json;

use super::Common;
use super::files::{Files, Output};
use super::output::{Outcome, count, write_whole};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Description of a machine: URDF (xacro is expanded first), MJCF, a DH table, an INI file of LinuxCNC
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// FILE is a model of MuJoCo
    #[arg(long, group = "form")]
    mjcf: bool,
    /// FILE is a table of Denavit-Hartenberg parameters, standard convention
    #[arg(long, group = "form")]
    dh: bool,
    /// The same, modified convention (Craig)
    #[arg(long, group = "form")]
    mdh: bool,
    /// FILE is the INI file of a machine that LinuxCNC runs
    #[arg(long, group = "form")]
    linuxcnc: bool,
    /// linuxcnc: HAL files that set pins of the kinematics module, besides those that the INI file names
    #[arg(long, value_name = "FILE", num_args = 1..)]
    hal: Vec<PathBuf>,
    /// linuxcnc: length of the tool that frame t is the tip of, as the control's tool table has it, such as 120mm
    #[arg(long, value_name = "LENGTH", default_value = "0mm", value_parser = |text: &str| amount(text, Quantity::Length))]
    tool_length: f64,
    /// Link or body that carries the workpiece; the root where nothing is said
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// Link, body or site that is the tool; the only end where nothing is said
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Where to write the machine file
    #[arg(short, long, value_name = "MACHINE.ron")]
    output: Output,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args, files: &Files) -> Outcome {
    let mut options = ImportOptions::from(Ends { base: args.base.clone(), tip: args.tip.clone() });
    options.hal.clone_from(&args.hal);
    options.tool_length = args.tool_length;
    let forms = [
        (args.linuxcnc, Form::LinuxCnc),
        (args.mjcf, Form::Mjcf),
        (args.dh, Form::Dh),
        (args.mdh, Form::Mdh),
    ];
    options.form = forms.into_iter().find(|(asked, _)| *asked).map(|(_, form)| form);
    let imported = open_with(&args.file, &options)?;
    files.with_inputs("FILE", &imported.beside).check()?;
    write_whole(&args.output, |out| {
        // Watched: an error here is told of the output.
        let _ = out.write_all(imported.text.as_bytes());
        Ok(())
    })?;
    let machine = &imported.machine;
    let commands = machine.commands();
    let mut text: String = imported.told.iter().map(|line| format!("{line}\n")).collect();
    let joints = count(commands.len() as u64, "joint", "joints");
    text.push_str(&format!("{}: {joints}: {}\n", machine.name(), commands.join(", ")));
    text.push_str(&format!("written to {}\n", args.output.display()));
    args.common.say(&text)?;
    args.common.write_json(&json!({"machine": machine.name(), "joints": commands, "told": imported.told}))
}

//! `kincal import`

use std::path::PathBuf;

use crate::import::{Ends, open};
use serde_json::json;

use super::Common;
use super::files::Output;
use super::output::{Outcome, count, write_whole};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// URDF file; xacro is expanded first
    #[arg(value_name = "ROBOT.urdf")]
    file: PathBuf,
    /// Link that carries the workpiece; the root where nothing is said
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// Link that is the tool; the only end where nothing is said
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Where to write the machine file
    #[arg(short, long, value_name = "MACHINE.ron")]
    output: Output,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let imported = open(&args.file, &Ends { base: args.base.clone(), tip: args.tip.clone() })?;
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

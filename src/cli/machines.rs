//! `kincal machines`

use serde_json::json;

use super::Common;
use super::output::{Failure, Outcome, print};
use super::table::table;
use crate::machine::{Machine, SHIPPED, shipped};
use crate::wording::{nearly, shown};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine to print; a list of all where nothing is said
    #[arg(value_name = "NAME")]
    name: Option<String>,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let Some(name) = &args.name else { return list(args) };
    let text = shipped(name).ok_or_else(|| unknown(name))?;
    args.common.write_json(&json!({"machine": name, "text": text}))?;
    if args.common.json.is_some() { Ok(()) } else { print(text) }
}

/// No such machine comes with the program, but perhaps one of nearly the same name.
pub(super) fn unknown(name: &str) -> Failure {
    let near = SHIPPED
        .iter()
        .map(|(own, _)| *own)
        .filter(|own| nearly(name, own) || name.len() > 2 && own.contains(&name.to_lowercase()));
    let near: Vec<&str> = near.collect();
    let mend = match near.is_empty() {
        true => "`kincal machines` lists them".into(),
        false => format!("write {}; `kincal machines` lists all", near.join(" or ")),
    };
    Failure::Told { what: format!("no machine \"{}\" comes with the program", shown(name)), mend }
}

fn list(args: &Args) -> Outcome {
    let mut rows = Vec::new();
    let mut data = Vec::new();
    for (name, text) in SHIPPED {
        let machine = Machine::parse(format!("{name}.ron"), text)?;
        let about = machine.about().unwrap_or_default();
        data.push(json!({"machine": name, "about": about, "joints": machine.commands()}));
        rows.push(vec![name.to_string(), about.to_string()]);
    }
    args.common.say(&table("", &[], &rows))?;
    args.common.say("\n`kincal machines NAME > my.ron` gives a file to start from\n")?;
    args.common.write_json(&data)
}

//! `kincal machines`

use serde_json::json;

use super::Common;
use super::output::{Failure, Outcome, print};
use super::table::table;
use crate::machine::{Machine, SHIPPED, shipped};

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
    let Some(text) = shipped(name) else {
        return Err(Failure::Told {
            what: format!("no machine \"{name}\" comes with the program"),
            mend: "`kincal machines` lists them".into(),
        });
    };
    args.common.write_json(&json!({"machine": name, "text": text}))?;
    if args.common.json.is_some() { Ok(()) } else { print(text) }
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

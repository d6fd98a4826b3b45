//! `kincal machines`

use serde_json::json;

use super::Common;
use super::output::{Failure, Outcome, print, table};
use crate::machine::Machine;

/// A list of the files of `machines/` with their texts, which the program carries.
macro_rules! shipped {
    ($($name:literal)+) => {
        [$(($name, include_str!(concat!("../../machines/", $name, ".ron")))),+]
    };
}

/// The machines that come with the program.
const SHIPPED: [(&str, &str); 23] = shipped! {
    "ac_head_head"
    "ac_table_tilting"
    "ac_table_tilting_paper"
    "bc_head_head"
    "bc_head_head_nutating"
    "bc_head_table"
    "bc_nutating_table"
    "bc_table_tilting"
    "dlr_justin_left"
    "dlr_justin_right"
    "fanuc_r2000ic_165f"
    "four_axis_horizontal"
    "franka_panda"
    "hilti_jaibot"
    "kinova_gen3_lite"
    "kuka_iiwa14"
    "linear_axis"
    "puma560"
    "rotary_axis"
    "scara"
    "six_r_arm"
    "ur10"
    "xyz_mill"
};

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
    let Some((_, text)) = SHIPPED.iter().find(|(own, _)| own == name) else {
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

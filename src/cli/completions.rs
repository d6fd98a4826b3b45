//! `kincal completions`

use clap_complete::{Shell, generate};

use super::output::{Outcome, print};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The shell that is to complete
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

pub(crate) fn run(args: &Args, mut known: clap::Command) -> Outcome {
    let name = known.get_name().to_string();
    let mut text = Vec::new();
    generate(args.shell, &mut known, name, &mut text);
    print(&String::from_utf8_lossy(&text))
}

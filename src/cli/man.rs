//! `kincal man`

use clap_mangen::Man;

use super::output::{Failure, Outcome, print};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Command to tell of; the program as a whole where nothing is said
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
}

pub(crate) fn run(args: &Args, mut known: clap::Command) -> Outcome {
    // Usage lines of commands bear the program's name once it is built.
    known.build();
    let page = match &args.command {
        None => known,
        Some(name) => match known.find_subcommand(name) {
            Some(command) => command.clone().version(env!("CARGO_PKG_VERSION")),
            None => {
                return Err(Failure::Told {
                    what: format!("kincal has no command \"{name}\""),
                    mend: "`kincal --help` lists them".into(),
                });
            }
        },
    };
    let mut text = Vec::new();
    Man::new(page).render(&mut text).map_err(|error| Failure::Answer(error.to_string()))?;
    print(&String::from_utf8_lossy(&text))
}

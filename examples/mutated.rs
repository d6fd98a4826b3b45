//! Damages inputs at random and counts what becomes of them: accepted, refused with a mend, or a fault of the program.
//!
//! ```text
//! cargo run --release --features measure --example mutated -- --cases 100000 --seed 1
//! cargo run --release --features measure --example mutated -- --cases 1000000 --seed 1 --report docs/reliability.md
//! cargo run --release --features measure --example mutated -- --only recording --from 4711 --cases 1 --seed 1 --save DIR
//! ```

#[path = "benchmarks/page.rs"]
#[allow(dead_code)]
mod page;

#[path = "../tests/mutated/mod.rs"]
mod mutated;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;

use mutated::drive::{Task, run};
use mutated::input::{Input, Kind};
use mutated::table::table;

/// Mutated inputs: machine, calibrated machine, effects, recording, set-up, faults, NC programs in three dialects.
#[derive(Parser)]
struct Arguments {
    /// Cases of each kind of input.
    #[arg(long, default_value_t = 10_000)]
    cases: u64,
    /// The number of the first one, to have a case again.
    #[arg(long, default_value_t = 0)]
    from: u64,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Kinds whose names contain this.
    #[arg(long, value_name = "KIND")]
    only: Option<String>,
    /// What lasts longer is over-long, seconds.
    #[arg(long, default_value_t = 1.0)]
    limit: f64,
    /// Writes the text of every finding into this folder.
    #[arg(long, value_name = "DIR")]
    save: Option<PathBuf>,
    /// Writes the table to this page.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match measured(&arguments) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

/// Whether every case kept its promises.
fn measured(arguments: &Arguments) -> Result<bool, String> {
    let Arguments { cases, from, seed, .. } = *arguments;
    let limit = Duration::try_from_secs_f64(arguments.limit).map_err(|e| format!("--limit: {e}"))?;
    let task = Task { from, cases, seed, limit };
    let mut tallies = Vec::new();
    let wanted = |kind: &Kind| arguments.only.as_ref().is_none_or(|only| kind.name().contains(only.as_str()));
    for kind in Kind::ALL.into_iter().filter(wanted) {
        let (tally, findings) = run(Input::new(kind).subdividing(), task);
        for finding in &findings {
            eprintln!("{} {} of seed {seed}: {}", finding.input, finding.number, finding.says);
            if let Some(folder) = &arguments.save {
                let file =
                    folder.join(format!("{}_{}", finding.input.replace([' ', ','], "_"), finding.number));
                std::fs::write(&file, &finding.text).map_err(|e| format!("{}: {e}", file.display()))?;
            }
        }
        eprintln!("{}: {} cases, {} broken", kind.name(), tally.cases, tally.broken());
        tallies.push((kind.name(), tally));
    }
    let text = table(&tallies);
    println!("{text}");
    if let Some(file) = &arguments.report {
        let command = format!(
            "cargo run --release --features measure --example mutated -- --cases {cases} --seed {seed} --report {}",
            file.display()
        );
        page::Page::new(file)
            .put("mutated-inputs", &command, &text)
            .map_err(|e| format!("{}: {e}", file.display()))?;
    }
    Ok(tallies.iter().all(|(_, tally)| tally.broken() == 0))
}

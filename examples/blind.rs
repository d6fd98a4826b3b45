//! The blind harness as a command: writes cases whose effects nobody knows but `answers.json`, and judges the engine on them.
//!
//! ```text
//! cargo run --release --example blind -- --write DIR --kind standard --count 40 --seed 1
//! ```

#[path = "../tests/blind/mod.rs"]
mod harness;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use rayon::prelude::*;

use harness::case::{Kind, Mode};

/// Blind cases: write them, judge the engine on them.
#[derive(Parser)]
struct Arguments {
    /// Writes cases into this folder.
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
    /// Textbook shapes and white noise, or neither.
    #[arg(long, value_enum, default_value = "standard")]
    kind: Kinds,
    /// How many cases.
    #[arg(long, default_value_t = 40)]
    count: usize,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only cases that conceal this much.
    #[arg(long, value_enum)]
    only: Option<Modes>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Kinds {
    Standard,
    Hard,
}

#[derive(Clone, Copy, ValueEnum)]
enum Modes {
    Clean,
    One,
    Two,
    Odd,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome = match &arguments.write {
        Some(folder) => write(&arguments, folder),
        None => Err("nothing to do: give --write DIR".to_string()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn write(arguments: &Arguments, folder: &Path) -> Result<(), String> {
    let kind = match arguments.kind {
        Kinds::Standard => Kind::Standard,
        Kinds::Hard => Kind::Hard,
    };
    let mode = arguments.only.map(|mode| match mode {
        Modes::Clean => Mode::Clean,
        Modes::One => Mode::One,
        Modes::Two => Mode::Two,
        Modes::Odd => Mode::Odd,
    });
    let machines = harness::machines();
    let answers: Vec<serde_json::Value> = (0..arguments.count)
        .into_par_iter()
        .map(|number| harness::case::draw(&machines, kind, mode, arguments.seed, number).write(folder))
        .collect::<Result<_, _>>()
        .map_err(|e| format!("{}: {e}", folder.display()))?;
    let text = serde_json::to_string_pretty(&answers).map_err(|e| e.to_string())?;
    std::fs::write(folder.join("answers.json"), text).map_err(|e| format!("{}: {e}", folder.display()))
}

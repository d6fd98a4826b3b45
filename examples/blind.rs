//! The blind harness as a command: writes cases whose effects nobody knows but `answers.json`, and judges the engine on them.
//!
//! ```text
//! cargo run --release --features measure --example blind -- --write DIR --kind standard --count 40 --seed 1
//! cargo run --release --features measure --example blind -- --judge DIR --kind standard
//! cargo run --release --features measure --example blind -- --report docs/benchmarks.md --count 200 --seed 1
//! cargo run --release --features measure --example blind -- --ablate docs/benchmarks.md --count 100 --seed 1
//! ```

#[path = "../tests/blind/mod.rs"]
mod harness;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, ValueEnum};

use harness::ablation::Ablation;
use harness::baseline::Baseline;
use harness::case::{Kind, Mode};
use harness::table;
use harness::verdict::{Diagnoser, Engine};

/// Blind cases: write them, judge the engine on them.
#[derive(Parser)]
struct Arguments {
    /// Writes cases into this folder.
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
    /// Diagnoses the answered cases of this folder and prints the table.
    #[arg(long, value_name = "DIR")]
    judge: Option<PathBuf>,
    /// Draws `--count` cases of each kind, diagnoses them and writes the tables to this file.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Draws `--count` cases of each kind, diagnoses them with every rule of `policy.rs` and again without each that was asked, and writes
    /// what that does to this file. Takes a `kincal` built with `--features measure`.
    #[arg(long, value_name = "FILE")]
    ablate: Option<PathBuf>,
    /// With `--ablate`: only these rules.
    #[arg(long, value_name = "NAME")]
    rule: Vec<String>,
    /// Judges a baseline in place of the engine.
    #[arg(long, value_enum)]
    baseline: Option<Baselines>,
    /// The `kincal` binary to judge; by default the one built beside this example.
    #[arg(long, value_name = "FILE")]
    binary: Option<PathBuf>,
    /// Passes `--without NAME` to `kincal diagnose`.
    #[arg(long, value_name = "NAME")]
    without: Vec<String>,
    /// With `--judge`: diagnoses cases of a single effect with its family left out of the library.
    #[arg(long)]
    left_out: bool,
    /// With `--judge`: cases of a single effect with its family and all that looks like it left out, and the family that is proposed in
    /// their place tried on the judge's path; clean ones as they are.
    #[arg(long, conflicts_with = "left_out")]
    proposals: bool,
    /// Machines of this folder (*.ron) in place of those shipped.
    #[arg(long, value_name = "DIR")]
    machines: Option<PathBuf>,
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

#[derive(Clone, Copy, ValueEnum)]
enum Baselines {
    /// One effect at a time, ranked by share.
    Ranked,
    /// Forward by BIC.
    Stepwise,
    Lasso,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome = run(&arguments);
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), String> {
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
    let machines = machine_folder(arguments);
    if let Some(folder) = &arguments.write {
        let all = harness::machines_in(&machines)?;
        harness::write(folder, &all, kind, mode, arguments.seed, arguments.count)?;
    }
    if let Some(folder) = arguments.judge.as_ref().filter(|_| arguments.left_out) {
        let said = harness::left_out::judge(folder, &engine(arguments)?, &machines)?;
        said.broken.iter().chain(&said.told).for_each(|line| println!("{line}"));
        println!("\n{}", table::left_out(&said));
    } else if let Some(folder) = arguments.judge.as_ref().filter(|_| arguments.proposals) {
        let said = harness::proposed::judge(folder, &engine(arguments)?, &machines)?;
        said.broken.iter().chain(&said.told).for_each(|line| println!("{line}"));
        println!("\n{}", table::proposed(&said));
    } else if let Some(folder) = &arguments.judge {
        let score = match arguments.baseline {
            Some(Baselines::Ranked) => harness::judge(folder, &machines, &Baseline::Ranked)?,
            Some(Baselines::Stepwise) => harness::judge(folder, &machines, &Baseline::Stepwise)?,
            Some(Baselines::Lasso) => harness::judge(folder, &machines, &Baseline::Lasso)?,
            None => harness::judge(folder, &machines, &engine(arguments)?)?,
        };
        println!("{}", table::terminal(&score, kind));
    }
    if let Some(file) = &arguments.report {
        put(file, ["<!-- blind cases -->", "<!-- end of blind cases -->"], &report(arguments)?)?;
    }
    if let Some(file) = &arguments.ablate {
        put(file, ["<!-- ablation -->", "<!-- end of ablation -->"], &ablation(arguments)?)?;
    }
    let files = [&arguments.write, &arguments.judge, &arguments.report, &arguments.ablate];
    if files.iter().all(|file| file.is_none()) {
        return Err("nothing to do: give --write DIR, --judge DIR, --report FILE or --ablate FILE".into());
    }
    Ok(())
}

fn machine_folder(arguments: &Arguments) -> PathBuf {
    arguments.machines.clone().unwrap_or_else(harness::machine_folder)
}

fn engine(arguments: &Arguments) -> Result<Engine, String> {
    let beside = || -> Option<PathBuf> {
        let own = std::env::current_exe().ok()?;
        Some(own.parent()?.parent()?.join(format!("kincal{}", std::env::consts::EXE_SUFFIX)))
    };
    let binary = arguments.binary.clone().or_else(beside).filter(|b| b.exists());
    let binary = binary
        .ok_or("no kincal binary beside this example: cargo build --release first, or give --binary FILE")?;
    let mut engine = Engine::new(binary);
    for name in &arguments.without {
        engine.extra.extend(["--without".to_string(), name.clone()]);
    }
    Ok(engine)
}

/// Writes new tables into a file, between two lines that mark where they stand; at its end where it has none.
fn put(file: &Path, [open, close]: [&str; 2], tables: &str) -> Result<(), String> {
    let old = if file.exists() {
        std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?
    } else {
        String::new()
    };
    let (before, after) = match (old.split_once(open), old.split_once(close)) {
        (Some((before, _)), Some((_, after))) => (before.to_string(), after.to_string()),
        _ => (format!("{old}\n"), "\n".to_string()),
    };
    let text = format!("{before}{open}\n\n{}\n{close}{after}", tables.trim_end());
    std::fs::write(file, text).map_err(|e| format!("{}: {e}", file.display()))
}

/// Draws both kinds into a folder of its own, and leaves out one rule after the other.
fn ablation(arguments: &Arguments) -> Result<String, String> {
    let folder = std::env::temp_dir().join(format!("kincal-blind-ablation-{}", std::process::id()));
    let (engine, machines) = (engine(arguments)?, machine_folder(arguments));
    let (count, seed) = (arguments.count, arguments.seed);
    let mut all = Ablation::default();
    let mut take = || -> Result<(), String> {
        for (kind, word) in [(Kind::Standard, "standard"), (Kind::Hard, "hard")] {
            let own = folder.join(word);
            harness::write(&own, &harness::machines_in(&machines)?, kind, None, seed, count)?;
            all.take(&own, &engine, &machines, &arguments.rule)?;
        }
        Ok(())
    };
    let taken = take();
    let _ = std::fs::remove_dir_all(&folder);
    taken?;
    all.broken.iter().chain(&all.told).for_each(|line| println!("{line}"));
    Ok(format!(
        "Written by `cargo run --release --features measure --example blind -- --ablate docs/benchmarks.md --count {count} --seed {seed}`.\n\n{}",
        all.markdown()
    ))
}

/// Draws both kinds into a folder of its own, judges, and renders what came out.
fn report(arguments: &Arguments) -> Result<String, String> {
    let folder = std::env::temp_dir().join(format!("kincal-blind-report-{}", std::process::id()));
    let engine = engine(arguments)?;
    let (count, seed) = (arguments.count, arguments.seed);
    let mut out = String::new();
    let _ = writeln!(
        out,
        "Written by `cargo run --release --features measure --example blind -- --report docs/benchmarks.md --count {count} --seed {seed}`.\n"
    );
    let made = both(&folder, &machine_folder(arguments), &engine, count, seed, &mut out);
    let _ = std::fs::remove_dir_all(&folder);
    made.map(|()| out)
}

fn both(
    folder: &Path,
    machines: &Path,
    engine: &Engine,
    count: usize,
    seed: u64,
    out: &mut String,
) -> Result<(), String> {
    let all = harness::machines_in(machines)?;
    for (kind, word) in [(Kind::Standard, "standard"), (Kind::Hard, "hard")] {
        let own = folder.join(word);
        harness::write(&own, &all, kind, None, seed, count)?;
        let score = harness::judge(&own, machines, engine)?;
        let _ = writeln!(out, "### {word}: {} cases\n\n{}", score.cases, table::markdown(&score, kind));
        let _ = writeln!(out, "{}\n{}", table::confusion(&score), table::calibration(&score));
        let left_out = harness::left_out::judge(&own, engine, machines)?;
        let _ = writeln!(out, "{}", table::left_out(&left_out));
        let methods = [Baseline::Ranked, Baseline::Stepwise, Baseline::Lasso];
        let mut others = Vec::new();
        for method in methods {
            others.push((method.name(), harness::judge(&own, machines, &method)?));
        }
        let _ = writeln!(
            out,
            "#### What other methods say of the same cases\n\nThey are given the generator's own textbook, which the engine does not know.\n\n{}",
            table::side_by_side(&others, kind)
        );
        if !score.broken.is_empty() {
            let _ = writeln!(
                out,
                "{} cases could not be diagnosed: {}\n",
                score.broken.len(),
                score.broken.join("; ")
            );
        }
    }
    Ok(())
}

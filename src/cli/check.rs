//! `kincal check`

use std::fmt::Write;
use std::path::PathBuf;

use crate::check::{PASS, check};
use crate::machine::Machine;
use serde_json::json;

use super::Common;
use super::output::{Failure, Outcome, count, open_machine};
use super::table::table;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine file
    #[arg(value_name = "MACHINE.ron")]
    machine: PathBuf,
    /// Random poses per kind of measurement and size of deviation
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    poses: u32,
    /// Seed of the random poses
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let machine = open_machine(&args.machine, |path| Machine::open(path))?;
    let progress = args.common.progress();
    progress.say("checking Jacobians");
    let checks = check(&machine, args.poses as usize, args.seed);
    drop(progress);
    let worst = checks.iter().map(|c| c.worst).fold(0.0, f64::max);
    let passes = checks.iter().all(|c| c.passes());
    let mut text = format!(
        "{}: analytic Jacobians against forward-mode autodiff, {} each\n",
        machine.name(),
        count(args.poses.into(), "random pose", "random poses")
    );
    let mut rows = vec![
        ["measurement", "by", "deviations", "worst difference relative to its block"]
            .map(String::from)
            .to_vec(),
    ];
    for c in &checks {
        let mark = if c.passes() { "" } else { "  FAILS" };
        rows.push(vec![
            c.measurement.to_string(),
            c.by.to_string(),
            c.deviations.to_string(),
            format!("{:.1e}{mark}", c.worst),
        ]);
    }
    text.push_str(&table("  ", &[], &rows));
    let verdict = if passes { "all agree" } else { "there are differences" };
    let _ = writeln!(text, "worst {worst:.1e}, limit {PASS:.0e}: {verdict}");
    args.common.say(&text)?;
    let result =
        json!({"machine": machine.name(), "limit": PASS, "worst": worst, "passes": passes, "checks": checks});
    args.common.write_json(&result)?;
    if passes { Ok(()) } else { Err(Failure::Answer("a Jacobian differs from its derivative".into())) }
}

//! `kincal check`

use std::fmt::Write;
use std::path::PathBuf;

use kincal::Machine;
use kincal::check::{PASS, check};
use serde_json::json;

use super::Common;
use super::output::{Failure, Outcome};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine file
    machine: PathBuf,
    /// Random poses per kind of measurement and size of deviation
    #[arg(long, default_value_t = 20)]
    poses: usize,
    /// Seed of the random poses
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let machine = Machine::open(&args.machine)?;
    let checks = check(&machine, args.poses, args.seed);
    let worst = checks.iter().map(|c| c.worst).fold(0.0, f64::max);
    let passes = checks.iter().all(|c| c.passes());
    let mut text = format!(
        "{}: analytic Jacobians against forward-mode autodiff, {} random poses each\n",
        machine.name(),
        args.poses
    );
    let _ = writeln!(
        text,
        "{:<14}{:<12}{:<12}worst difference relative to its block",
        "measurement", "by", "deviations"
    );
    for c in &checks {
        let mark = if c.passes() { "" } else { "  FAILS" };
        let _ = writeln!(text, "{:<14}{:<12}{:<12}{:.1e}{mark}", c.measurement, c.by, c.deviations, c.worst);
    }
    let verdict = if passes { "all agree" } else { "there are differences" };
    let _ = writeln!(text, "worst {worst:.1e}, limit {PASS:.0e}: {verdict}");
    args.common.say(&text);
    let result =
        json!({"machine": machine.name(), "limit": PASS, "worst": worst, "passes": passes, "checks": checks});
    args.common.write_json(&result)?;
    if passes { Ok(()) } else { Err(Failure::Answer("error: a Jacobian differs from its derivative".into())) }
}

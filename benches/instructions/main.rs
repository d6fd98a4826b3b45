//! Instructions a sample of the workloads W1 to W4, which fail where one needs a fifth more than it did:
//!
//! ```text
//! cargo test --bench instructions               compares with benches/instructions/counts.csv
//! cargo test --bench instructions -- --renew    writes that file anew
//! cargo bench --bench instructions              tells the counts of a release build
//! ```
//!
//! Valgrind counts; times of a machine that does other work say less. What is compared is built as tests are, so that it takes seconds
//! beside them, and with the lanes of AVX2, which Valgrind knows. Each workload goes over its samples in two runs, in one of them more often,
//! and their difference leaves out what is no sample.

mod counts;
mod work;

use std::process::{Command, ExitCode};

use counts::Counts;
use work::{NAMES, Work};

/// What a count may grow by.
const MOST: f64 = 1.2;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [name, times] = &arguments[..]
        && let (Some(work), Ok(times)) = (Work::named(name), times.parse())
    {
        work.run(times);
        return ExitCode::SUCCESS;
    }
    let has = |wanted: &str| arguments.iter().any(|argument| argument == wanted);
    // Cargo says so where it builds for a release.
    match told(has("--renew"), has("--bench")) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(what) => {
            println!("{what}");
            ExitCode::FAILURE
        }
    }
}

/// Counts, tells and compares; whether none has grown by more than may be.
fn told(renew: bool, is_release: bool) -> Result<bool, String> {
    let counted: Result<Vec<(String, f64)>, String> = NAMES
        .iter()
        .map(|name| {
            let work = Work::named(name).ok_or("a workload without name")?;
            let [few, many] = work.times().map(|times| instructions(name, times));
            Ok((name.to_string(), (many? - few?) / work.samples()))
        })
        .collect();
    let counted = Counts(counted?);
    // What a release runs is other code, with other counts.
    if renew && !is_release {
        counted.write()?;
        println!("{} written", counts::FILE);
    }
    let kept = if is_release { Counts(Vec::new()) } else { Counts::read()? };
    let mut holds = true;
    for (name, count) in &counted.0 {
        let before = kept.0.iter().find(|(other, _)| other == name).map(|(_, before)| *before);
        let ratio =
            before.map_or_else(String::new, |before| format!(", {:.2} times {before:.0}", count / before));
        println!("{name}: {count:.0} instructions a sample{ratio}");
        if before.is_some_and(|before| *count > MOST * before) {
            println!(
                "{name} has lost more than a fifth: mend it, or renew the counts where it is worth that"
            );
            holds = false;
        }
    }
    Ok(holds)
}

/// Instructions of a run of its own.
fn instructions(name: &str, times: usize) -> Result<f64, String> {
    let own = std::env::current_exe().map_err(|e| format!("this program's own file: {e}"))?;
    let run = Command::new("valgrind")
        .args(["--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"])
        .arg(own)
        .args([name, &times.to_string()])
        .env("RAYON_NUM_THREADS", "1")
        .output()
        .map_err(|e| format!("valgrind: {e}; install it with the system's packages"))?;
    let text = String::from_utf8_lossy(&run.stderr);
    // `==PID== I   refs:      37,663,055`
    let counted =
        text.lines().filter_map(|line| line.split_once("refs:")).find(|(what, _)| what.contains("= I "));
    let digits = counted.map(|(_, count)| count.chars().filter(char::is_ascii_digit).collect::<String>());
    match digits.and_then(|digits| digits.parse().ok()) {
        Some(count) if run.status.success() => Ok(count),
        _ => Err(format!("valgrind has not counted {name}:\n{text}")),
    }
}

//! Measures what the documents speak of, and writes it to `docs/benchmarks.md`, a section at a time.
//!
//! ```text
//! cargo run --release --features measure --example benchmarks -- --list
//! cargo run --release --features measure --example benchmarks -- --report docs/benchmarks.md
//! cargo run --release --features measure --example benchmarks -- --report docs/benchmarks.md --data DIR real-geometry real-axes
//! ```
//!
//! Without names every section runs that takes minutes at most. Real recordings are other people's: `docs/real-recordings.md` says where
//! they are, and how they stand in DIR. A section whose recordings are missing stays as it stands.

mod concealed;
mod cross_validation;
mod directions;
mod findings;
mod geometry;
mod given;
mod outcome;
mod page;
mod physics;
mod rivals;
mod sets;
mod simulated;
mod table;
mod tilting_table;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;

use outcome::{Failure, Outcome};
use page::Page;

/// Measures, and writes sections of a page.
#[derive(Parser)]
struct Arguments {
    /// Replaces the sections of this page; without it they are printed.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Folder with real recordings, as docs/real-recordings.md lays it out.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Lists the sections.
    #[arg(long)]
    list: bool,
    /// Sections to measure; without names all but the long ones.
    #[arg(value_name = "SECTION")]
    sections: Vec<String>,
}

/// A part of the page.
struct Section {
    name: &'static str,
    what: &'static str,
    /// Whether it needs `--data`.
    needs_data: bool,
    /// Whether it takes so long that it runs by name only.
    long: bool,
    measure: fn(&sets::Data) -> Outcome<String>,
}

const fn section(
    name: &'static str,
    what: &'static str,
    measure: fn(&sets::Data) -> Outcome<String>,
) -> Section {
    Section { name, what, needs_data: false, long: false, measure }
}

const fn real(section: Section) -> Section {
    Section { needs_data: true, ..section }
}

const fn long(section: Section) -> Section {
    Section { long: true, ..section }
}

/// Every section, in the order of the page.
const SECTIONS: [Section; 19] = [
    section("truth", "simulated machines: is the truth found?", simulated::truth),
    section("new-poses", "simulated machines: predictions at new poses", simulated::new_poses),
    section("jacobians", "analytic Jacobians against automatic differentiation", simulated::jacobians),
    real(section("real-geometry", "real machines: geometry alone", geometry::geometry)),
    real(section("losses", "real machines: robust losses", geometry::losses)),
    long(real(section("tolerances", "real machines: tolerances as priors", geometry::tolerances))),
    long(real(section("real-arms", "real arms: effects that are given", physics::arms))),
    real(section("real-axes", "real single axes: effects that are given", physics::axes)),
    real(section("axis-findings", "real single axes: what diagnose says", findings::axes)),
    long(real(section("arm-findings", "real arms: what diagnose says", findings::arms))),
    long(real(section("trials-left-out", "Hilti JaiBot: a trial that took no part", findings::trials))),
    long(real(section("rows-left-out", "Agile Justin: rows that took no part", findings::rows))),
    long(real(section("concealed", "effects concealed in real recordings", concealed::concealed))),
    real(section("rivals", "rivals on real recordings", rivals::real)),
    section("filter", "Kalman filter against least squares", rivals::filter),
    section("directions", "pieces by direction of travel on the measured path", directions::measured_path),
    section("unseen-paths", "pieces by direction of travel on other paths", directions::unseen_paths),
    long(section("plans", "which paths to measure", directions::plans)),
    long(section("three-of-five", "every three of five paths", directions::three_of_five)),
];

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::FAILURE
        }
    }
}

/// Whether every section that was asked for by name has been measured.
fn run(arguments: &Arguments) -> Outcome<bool> {
    if arguments.list {
        for section in &SECTIONS {
            let needs = if section.needs_data { "  --data" } else { "" };
            let by_name = if section.long { "  by name only" } else { "" };
            println!("{:<16} {}{needs}{by_name}", section.name, section.what);
        }
        return Ok(true);
    }
    let page = arguments.report.as_deref().map(Page::new);
    let data = sets::Data::new(arguments.data.as_deref());
    let mut left: Vec<String> = Vec::new();
    for section in chosen(&arguments.sections)? {
        let start = Instant::now();
        eprintln!("{}: {}", section.name, section.what);
        match (section.measure)(&data) {
            Ok(body) => {
                let body = format!("## {}\n\n    {}\n\n{body}", title(section.what), command(section));
                match &page {
                    Some(page) => page.put(section.name, &command(section), &body)?,
                    None => println!("{body}\n"),
                }
                eprintln!("{}: {:.0} s", section.name, start.elapsed().as_secs_f64());
            }
            Err(Failure::Missing(what)) => left.push(format!("{} ({what})", section.name)),
            Err(failure) => return Err(failure),
        }
    }
    if !left.is_empty() {
        eprintln!("left as they stand, for want of data: {}", left.join("; "));
    }
    Ok(left.is_empty() || arguments.sections.is_empty())
}

fn chosen(names: &[String]) -> Outcome<Vec<&'static Section>> {
    if names.is_empty() {
        return Ok(SECTIONS.iter().filter(|s| !s.long).collect());
    }
    let find = |name: &String| {
        let found = SECTIONS.iter().find(|s| s.name == name);
        found.ok_or_else(|| Failure::Broken(format!("section `{name}` is not known; --list names them")))
    };
    names.iter().map(find).collect()
}

/// The command that writes a section, with the reader's folder as DIR.
fn command(section: &Section) -> String {
    let data = if section.needs_data { " --data DIR" } else { "" };
    format!(
        "cargo run --release --features measure --example benchmarks -- --report docs/benchmarks.md{data} {}",
        section.name
    )
}

fn title(what: &str) -> String {
    let mut letters = what.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

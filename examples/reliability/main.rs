//! Planted mistakes, sound recordings, and deviations far beyond the tolerances: the tables of `docs/reliability.md`.
//!
//! ```text
//! cargo run --features measure --example reliability -- docs/reliability.md
//! ```
//!
//! With `--drawn 10000` so many machines are drawn instead, and found from afar.
//!
//! Each table takes the place of what stands between its marks, `<!-- mistakes -->` and `<!-- /mistakes -->`; without a file they are printed.

#[path = "../../tests/common/mod.rs"]
mod common;

use std::fmt::Write;
use std::path::PathBuf;

use common::machines;
use common::planted::{PLANTED, drawn, far, is_named, said_of, sound};
use kincal::mistakes::Nonsense;
use kincal::sensor::Sensor;
use rayon::prelude::*;

/// Sound recordings.
const SOUND: u64 = 200;
/// Sizes of deviations, tolerances.
const SIZES: [f64; 4] = [1.0, 3.0, 10.0, 30.0];

fn main() -> std::io::Result<()> {
    let mut args = std::env::args().skip(1);
    if args.next().as_deref() == Some("--drawn") {
        return drawn_ones(args.next().and_then(|n| n.parse().ok()).unwrap_or(10_000));
    }
    let parts = [("mistakes", mistakes()), ("sound", sound_ones()), ("afar", afar())];
    let Some(path) = std::env::args_os().nth(1).map(PathBuf::from) else {
        parts.iter().for_each(|(_, body)| println!("{body}"));
        return Ok(());
    };
    let mut page = std::fs::read_to_string(&path)?;
    for (name, body) in parts {
        let (begin, end) = (format!("<!-- {name} -->"), format!("<!-- /{name} -->"));
        let between = page.find(&begin).zip(page.find(&end)).filter(|(from, to)| from < to);
        let Some((from, to)) = between else {
            return Err(std::io::Error::other(format!("{}: no marks {begin} ... {end}", path.display())));
        };
        page = format!("{}\n\n{}\n\n{}", &page[..from + begin.len()], body.trim(), &page[to..]);
    }
    std::fs::write(path, page)
}

/// Machines that are drawn, one after the other.
fn drawn_ones(count: u64) -> std::io::Result<()> {
    let missed: Vec<String> = (0..count).into_par_iter().filter_map(|draw| drawn(draw).err()).collect();
    missed.iter().for_each(|missed| println!("{missed}"));
    println!("{} of {count} reach the noise", count - missed.len() as u64);
    Ok(())
}

fn shown(said: &Nonsense, si: f64) -> String {
    match said.left.of_angles {
        true if si < 1e-3 => format!("{:.0} urad", 1e6 * si),
        true => format!("{:.0} deg", si.to_degrees()),
        false if si < 1e-3 => format!("{:.1} um", 1e6 * si),
        false => format!("{:.0} mm", 1e3 * si),
    }
}

fn mistakes() -> String {
    let mut text = "| machine | measured | mistake | left | excess | named | left then |\n|---|---|---|--:|--:|---|--:|\n".to_string();
    let mut named = 0;
    for planted in &PLANTED {
        let said = said_of(planted);
        named += usize::from(is_named(planted, &said));
        let _ = write!(text, "| `{}` | {} | {} |", planted.machine, planted.measured.name(), planted.what);
        let _ = match &said {
            None => writeln!(text, " | | not refused | |"),
            Some(said) => {
                let told: Vec<&str> = said.mistakes.iter().map(|m| m.what.as_str()).collect();
                let then = said.mistakes.first().map_or_else(String::new, |m| shown(said, m.left));
                let (left, excess) = (shown(said, said.left.left), said.left.excess());
                let told = if told.is_empty() { "none".to_string() } else { told.join(" or ") };
                writeln!(text, " {left} | {excess:.1} | {told} | {then} |")
            }
        };
    }
    let _ = writeln!(text, "\n{named} of {} are named.", PLANTED.len());
    text
}

fn sound_ones() -> String {
    let names: Vec<String> = machines().into_iter().map(|(name, _)| name).collect();
    let (mut refused, mut largest) = (0, 0.0f64);
    for draw in 0..SOUND {
        let (said, excess) = sound(&names[draw as usize % names.len()], draw);
        refused += usize::from(said.is_some());
        largest = largest.max(excess);
    }
    format!("{refused} of {SOUND} sound recordings are refused; the largest excess is {largest:.2}.")
}

fn afar() -> String {
    let mut text =
        "| deviations, tolerances | noise reached | without a note of frames that lie far off |\n|--:|--:|--:|\n".to_string();
    for size in SIZES {
        let (mut all, mut reached, mut silent) = (0, 0, 0);
        for (_, machine) in machines() {
            for sensor in [Sensor::Position, Sensor::Pose] {
                let (left, warnings) = far(&machine, sensor, size);
                all += 1;
                reached += usize::from(left < 3e-6);
                silent += usize::from(!warnings.iter().any(|w| w.contains("tolerances from")));
            }
        }
        let _ = writeln!(text, "| {size} | {reached} of {all} | {silent} |");
    }
    text
}

//! The path of `kincal convert --path`, in the words of `kincal simulate --test`.

use std::path::{Path, PathBuf};

use clap::{Parser, ValueEnum};

use super::args::{Args, Measure, Sort, Test};
use super::build::{Built, build, usage};
use crate::calibration::CalibratedMachine;
use crate::cli::output::Outcome;
use crate::convert::Nominal;
use crate::machine::{FileUnits, Machine};
use crate::simulate::{Recorder, Style};
use crate::units::Unit;

/// Commands of the path a second, where nothing is said.
const RATE: f64 = 500.0;
/// More commands than these are not held.
const MOST: usize = 4_000_000;
const FORM: &str = "write a test with its options as `kincal simulate` has them, 'circle --plane x,y --length 150mm --feed 1000mm/min', \
                    or an NC program with its options, 'part.nc --feed 500mm/min --length 100mm'";

#[derive(Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
struct Line {
    #[command(flatten)]
    args: Args,
}

/// The path that a machine runs, and the head of a recording of it.
pub(crate) fn path(machine: &Machine, text: &str) -> Outcome<Nominal> {
    let args = read(text)?;
    if args.test.sort() == Sort::Poses || args.step.is_some() {
        return Err(usage(
            "--path: poses one by one are no path over time",
            "give a test that moves by a feed, or positions beside the readings",
        ));
    }
    if let Some(option) = args.useless() {
        let what = format!("--path: `{option}` means nothing to the test `{}`", args.test.word());
        return Err(usage(what, "leave it out, or name another test"));
    }
    let rate = args.rate.unwrap_or(RATE);
    let Built { runs, .. } = build(&args, &CalibratedMachine::nominal(machine.clone()))?;
    let [run] = &runs[..] else {
        return Err(usage(format!("--path: {} paths", runs.len()), "name one length and one height"));
    };
    let unit = |symbol| Unit::named(symbol).unwrap_or(FileUnits::si().length);
    let mut style = Style::si();
    style.commands = FileUnits { length: unit("mm"), ..FileUnits::si() };
    let head = Recorder::new(machine, &run.instrument, &style, false).head(&run.claims);
    let lines = head.lines().filter_map(|line| line.strip_prefix("# "));
    let own = lines.filter(|line| !line.starts_with("machine:") && !line.starts_with("measurement:"));
    let own = own.map(str::to_string).collect();
    let mut commands = Vec::new();
    for sample in run.course.samples()? {
        let sample = sample?;
        if commands.is_empty() && args.without_approach && !sample.recorded {
            continue;
        }
        commands.push(sample.q);
        if commands.len() > MOST {
            let what = format!("--path: the path takes more than {MOST} samples");
            return Err(usage(what, "give the part of it that was measured, or a lower `--rate`"));
        }
    }
    Ok(Nominal::new(rate.recip(), commands, own)?)
}

/// The file that a path names.
pub(crate) fn input_of(text: &str) -> Option<PathBuf> {
    read(text).ok()?.input
}

fn read(text: &str) -> Outcome<Args> {
    let words = words(text);
    let Some((first, rest)) = words.split_first() else { return Err(usage("--path: nothing is said", FORM)) };
    let mut line: Vec<String> = ["MACHINE", "--output", "OUTPUT"].map(String::from).to_vec();
    match Test::from_str(first, true) {
        Ok(_) => line.extend(["--test".into(), first.clone()]),
        Err(_) if Path::new(first).exists() => {
            line.extend(["--test", "program", "--input"].map(String::from));
            line.push(first.clone());
        }
        Err(_) => {
            return Err(usage(format!("--path: `{first}` is no test, and no file"), FORM));
        }
    }
    line.extend(rest.iter().cloned());
    let mut args = match Line::try_parse_from(line) {
        Ok(line) => line.args,
        Err(error) => {
            let all = error.to_string();
            let first = all.lines().next().unwrap_or_default();
            let what = first.trim_start_matches("error: ").to_string();
            return Err(usage(format!("--path: {what}"), FORM));
        }
    };
    // A bar's length says that a bar was read.
    if args.measure.is_none() && !args.length.is_empty() {
        args.measure = Some(Measure::Distance);
    }
    args.rate = args.rate.or(Some(RATE));
    Ok(args)
}

/// Words between blanks; quotes keep blanks together.
fn words(text: &str) -> Vec<String> {
    let (mut words, mut word, mut quote, mut begun) = (Vec::new(), String::new(), None, false);
    for c in text.chars() {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (None, '\'' | '"') => (quote, begun) = (Some(c), true),
            (None, c) if c.is_whitespace() => {
                if std::mem::take(&mut begun) {
                    words.push(std::mem::take(&mut word));
                }
            }
            _ => {
                word.push(c);
                begun = true;
            }
        }
    }
    if begun {
        words.push(word);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::words;

    #[test]
    fn quotes_keep_blanks_together() {
        assert_eq!(
            words(" circle --plane x,y 'my file.nc' \"\""),
            ["circle", "--plane", "x,y", "my file.nc", ""]
        );
    }
}

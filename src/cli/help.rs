//! `--help` that fits the terminal: what is too long for a line goes on below where it began. The library that reads the arguments decides
//! what stands in columns, and would itself also fold the calls of [`examples`](super::examples), which are to be pasted.

use std::iter::once;

use clap::Command;
use clap::error::{Error, ErrorKind};
use console::Term;

use super::examples::is_call;
use super::width::{folded, len, shown, width_of};

/// The same command line, laid out for the terminal if standard output is one.
pub(super) fn laid_out(command: Command) -> Command {
    match width_of(&Term::stdout()) {
        Some(width) => command.term_width(width),
        None => command,
    }
}

/// The same, with lines that fit if it is help on a terminal.
pub(super) fn fitted(error: Error) -> Error {
    let to = if error.use_stderr() { Term::stderr() } else { Term::stdout() };
    let asked = match error.kind() {
        ErrorKind::DisplayHelp => Some("--help"),
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => None,
        _ => return error,
    };
    let Some(width) = width_of(&to) else { return error };
    let text = within(&error.render().ansi().to_string(), width);
    // Who prints it knows of colours and streams; it is asked the same of a command that has this help.
    let telling = Command::new("kincal").arg_required_else_help(true).override_help(text);
    telling.try_get_matches_from(once("kincal").chain(asked)).err().unwrap_or(error)
}

/// Help of so many columns.
fn within(help: &str, width: usize) -> String {
    folded(help, width, |line| (!is_call(line)).then(|| hanging(line)))
}

/// Where a line goes on: in its second column, or below what its first begins with.
fn hanging(line: &str) -> usize {
    let line: String = shown(line).collect();
    let words = line.trim_start();
    let mark = ["- ", "Usage: "].into_iter().find(|mark| words.starts_with(mark));
    let begins = match (mark, words.find("  ")) {
        (Some(mark), _) => &words[mark.len()..],
        (None, Some(gap)) => words[gap..].trim_start(),
        (None, None) => words,
    };
    len(&line) - len(begins)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What `-h` and `--help` of the program and of each command show in a terminal of so many columns.
    fn all(width: usize) -> Vec<String> {
        let own = crate::cli::command().term_width(width);
        let names: Vec<String> = own.get_subcommands().map(|own| own.get_name().to_string()).collect();
        let calls = names.iter().map(|name| vec![name.as_str()]).chain([vec![]]);
        let asked = |call: Vec<&str>| {
            ["-h", "--help"].map(|asked| {
                let words = once("kincal").chain(call.clone()).chain([asked]);
                let error = own.clone().try_get_matches_from(words).expect_err("help is no call");
                assert_eq!(error.kind(), ErrorKind::DisplayHelp);
                error.render().ansi().to_string()
            })
        };
        calls.flat_map(asked).collect()
    }

    fn words(text: &str) -> Vec<&str> {
        text.split_whitespace().collect()
    }

    #[test]
    fn no_line_of_help_is_longer_than_the_terminal_is_wide_but_calls() {
        let mut calls = 0;
        for width in [60, 80, 120] {
            for help in all(width) {
                let fitted = within(&help, width);
                assert_eq!(words(&fitted), words(&help));
                for line in fitted.lines() {
                    assert!(is_call(line) || len(line) <= width, "{line:?} is wider than {width}");
                }
                let in_help: Vec<&str> = help.lines().filter(|line| is_call(line)).collect();
                assert!(in_help.iter().all(|call| fitted.lines().any(|line| line == *call)), "{fitted}");
                calls += in_help.len();
            }
        }
        assert!(calls > 100, "help has lost its examples: {calls} are left");
    }

    #[test]
    fn a_line_goes_on_in_its_second_column() {
        let line = "  \u{1b}[1m--memory\u{1b}[0m <MB>  Keep so much of recordings in memory\n";
        let told = "  \u{1b}[1m--memory\u{1b}[0m <MB>  Keep so much of\n                 recordings in\n                 memory\n";
        assert_eq!(within(line, 35), told);
        assert_eq!(within("- huber: Quadratic, then linear\n", 24), "- huber: Quadratic, then\n  linear\n");
    }
}

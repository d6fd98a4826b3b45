//! Tallies as a table of a document.

use std::fmt::Write as _;

use super::tally::Tally;

/// One row for each kind of input, and their sum.
pub fn table(tallies: &[(&'static str, Tally)]) -> String {
    let mut text = String::from(
        "| input | cases | accepted | refused | panics | over-long | other faults | slowest |\n\
         | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    let mut all = Tally::default();
    for (name, tally) in tallies {
        all.add(tally);
        text.push_str(&row(name, tally));
    }
    text.push_str(&row("**all**", &all));
    text
}

fn row(name: &str, t: &Tally) -> String {
    let mut row = format!("| {name} |");
    for n in [t.cases, t.accepted, t.refused, t.panics, t.over_long, t.other] {
        let _ = write!(row, " {} |", grouped(n));
    }
    let _ = writeln!(row, " {:.2} s |", t.slowest.as_secs_f64());
    row
}

/// `1 234 567`.
fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

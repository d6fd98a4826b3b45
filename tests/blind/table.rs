//! The table of figures as text: every count with its bounds beside what it must reach.

use std::fmt::Write as _;

use super::case::Kind;
use super::left_out::LeftOut;
use super::proposed::Proposed;
use super::score::{Count, Score, median};

fn percent(count: Count) -> String {
    if count.of == 0 {
        return "-".into();
    }
    let (low, high) = count.bounds();
    let as_percent = |x: f64| 100.0 * x;
    format!(
        "{:.1} % ({:.1}-{:.1}), {} of {}",
        as_percent(count.share()),
        as_percent(low),
        as_percent(high),
        count.hits,
        count.of
    )
}

fn number(value: f64, digits: usize) -> String {
    if value.is_nan() { "-".into() } else { format!("{value:.digits$}") }
}

/// Rows of the table: figure, what it must be, what it is.
pub fn rows(score: &Score, kind: Kind) -> Vec<(String, String, String)> {
    let hard = kind == Kind::Hard;
    let must =
        |standard: &str, hard_one: &str| if hard { hard_one.to_string() } else { standard.to_string() };
    let (stated, right) = score.calibration();
    let in_all = |values: &[f64], f: fn(f64, f64) -> f64| values.iter().copied().fold(f64::NAN, f);
    vec![
        (
            "one concealed effect: name and place first".into(),
            must(">= 98 %", ">= 95 %"),
            percent(score.first),
        ),
        (
            "the same, or among what it may be confused with".into(),
            String::new(),
            percent(score.first_or_confusable),
        ),
        (
            "findings beyond it, per case".into(),
            must("<= 0.05", "<= 0.15"),
            number(score.needless_one as f64 / score.first.of as f64, 3),
        ),
        ("clean: no finding".into(), must(">= 99 %", ">= 98 %"), percent(score.clean_silent)),
        (
            "two concealed effects: F1 of (name, place)".into(),
            must(">= 0.95", ">= 0.90"),
            format!(
                "{} ({} right of {} said, {} true)",
                number(score.f1(), 3),
                score.two_right,
                score.two_said,
                score.two_true
            ),
        ),
        (
            "outside every vocabulary: `unexplained` given".into(),
            must(">= 95 %", ">= 90 %"),
            percent(score.odd_unexplained),
        ),
        ("of these, at a place it has to do with".into(), String::new(), percent(score.odd_at_right_place)),
        (
            "outside every vocabulary: a wrong name with probability > 0.5".into(),
            must("<= 5 %", "<= 10 %"),
            percent(score.odd_wrong),
        ),
        (
            "`unexplained` where nothing is unexplained (clean, one effect)".into(),
            must("<= 3 %", "<= 8 %"),
            percent(score.unexplained_needlessly),
        ),
        (
            "names per finding (itself + `confusable_with`), mean".into(),
            must("<= 1.5", ""),
            number(score.names as f64 / score.findings as f64, 2),
        ),
        (
            "error on the judge's path against plain calibration: worse by > 10 %".into(),
            "<= 5 %".into(),
            percent(score.judged_worse),
        ),
        (
            "outside every vocabulary, on the path of a machine that is rid of it: worse by > 10 %".into(),
            String::new(),
            percent(score.rid_worse),
        ),
        (
            "the same error, ratio to that of plain calibration, median".into(),
            String::new(),
            number(median(&score.judge_ratios), 3),
        ),
        (
            "held-out RMS / noise after modelling, median".into(),
            must("1.03", ""),
            number(median(&score.held_out_ratios), 3),
        ),
        (
            "stated 95 % intervals of the size contain the truth".into(),
            "93-97 %".into(),
            percent(score.sizes_covered),
        ),
        ("the same of times, periods and decays".into(), String::new(), percent(score.courses_covered)),
        (
            "mean stated probability - share right".into(),
            must("within 0.03", "within 0.05"),
            format!("{} - {} = {}", number(stated, 3), number(right, 3), number(stated - right, 3)),
        ),
        (
            "time a case, one core: median, longest".into(),
            String::new(),
            format!(
                "{} s, {} s",
                number(median(&score.seconds), 2),
                number(in_all(&score.seconds, f64::max), 2)
            ),
        ),
        (
            "time for 7000 samples, one core, median".into(),
            "2 s".into(),
            format!("{} s", number(median(&score.seconds_of_7000), 2)),
        ),
    ]
}

/// The table in Markdown.
pub fn markdown(score: &Score, kind: Kind) -> String {
    let mut out =
        String::from("| figure (counts with their 95 % bounds) | must be | is |\n| --- | --- | --- |\n");
    for (figure, must, is) in rows(score, kind) {
        let _ = writeln!(out, "| {figure} | {must} | {is} |");
    }
    out
}

/// What was said first, by true name, in Markdown; the most frequent first.
pub fn confusion(score: &Score) -> String {
    let mut out = String::from("| concealed | cases | said first |\n| --- | --- | --- |\n");
    for (truth, said) in &score.confusion {
        let mut said: Vec<(&String, &usize)> = said.iter().collect();
        said.sort_by(|a, b| b.1.cmp(a.1).then(a.0.cmp(b.0)));
        let total: usize = said.iter().map(|s| s.1).sum();
        let words: Vec<String> = said.iter().map(|(name, n)| format!("{name} {n}")).collect();
        let _ = writeln!(out, "| {truth} | {total} | {} |", words.join(", "));
    }
    out
}

/// Stated probabilities in bins against the share right, in Markdown.
pub fn calibration(score: &Score) -> String {
    let mut out = String::from("| stated probability | findings | right |\n| --- | --- | --- |\n");
    let edges = [0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0 + 1e-12];
    for pair in edges.windows(2) {
        let mut count = Count::default();
        score.stated.iter().filter(|s| s.0 >= pair[0] && s.0 < pair[1]).for_each(|s| count.add(s.1));
        let _ =
            writeln!(out, "| {:.2}-{:.2} | {} | {} |", pair[0], pair[1].min(1.0), count.of, percent(count));
    }
    out
}

/// Everything for the terminal.
pub fn terminal(score: &Score, kind: Kind) -> String {
    let mut out = String::new();
    for (figure, must, is) in rows(score, kind) {
        let _ = writeln!(out, "{figure:<72} {must:<12} {is}");
    }
    out.push('\n');
    out.push_str(&confusion(score));
    out.push('\n');
    out.push_str(&calibration(score));
    let _ = writeln!(out, "\n{} cases, {} failed:", score.cases, score.failures.len() + score.broken.len());
    for line in score.broken.iter().chain(&score.failures) {
        let _ = writeln!(out, "  {line}");
    }
    out
}

/// What is said with the true family left out, in Markdown.
pub fn proposed(all: &Proposed) -> String {
    let rows = [
        ("a family proposed", all.given),
        ("as good on the judge's path as the family, within 5 %", all.as_good),
        ("nothing concealed: a family proposed", all.on_clean),
    ];
    let mut out = String::from("| one effect, its family and its relatives left out | is |\n| --- | --- |\n");
    for (figure, count) in rows {
        let _ = writeln!(out, "| {figure} | {} |", percent(count));
    }
    out
}

pub fn left_out(all: &LeftOut) -> String {
    let rows = [
        ("`unexplained` given", all.unexplained),
        ("of these, at the effect's joint or frame", all.at_its_place),
        ("another name with probability > 0.5", all.misnamed),
        ("nothing said", all.silent),
    ];
    let mut out = String::from("| one effect, its family left out (`--without`) | is |\n| --- | --- |\n");
    for (figure, count) in rows {
        let _ = writeln!(out, "| {figure} | {} |", percent(count));
    }
    out
}

/// The figures of several methods side by side, in Markdown; only those that all of them have.
pub fn side_by_side(all: &[(String, Score)], kind: Kind) -> String {
    let columns: Vec<_> = all.iter().map(|(_, score)| rows(score, kind)).collect();
    let mut out = String::from("| figure |");
    all.iter().for_each(|(name, _)| {
        let _ = write!(out, " {name} |");
    });
    let _ = writeln!(out, "\n| --- |{}", " --- |".repeat(all.len()));
    let Some(first) = columns.first() else { return out };
    for (i, (figure, ..)) in first.iter().enumerate() {
        if columns.iter().all(|c| c[i].2 != "-" && !c[i].2.starts_with("- ")) {
            let figures: Vec<&str> = columns.iter().map(|c| c[i].2.as_str()).collect();
            let _ = writeln!(out, "| {figure} | {} |", figures.join(" | "));
        }
    }
    out
}

//! What rules are worth that decide beside the evidence: cases where one was asked, diagnosed again without it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use rayon::prelude::*;

use super::answer::{self, Answer};
use super::verdict::{CaseFiles, Diagnoser, Engine, Verdict};

/// Errors on the judge's path that differ by less than this part are the same.
const SAME: f64 = 0.1;

/// What leaving one rule out does.
#[derive(Clone, Copy, Debug, Default)]
pub struct Row {
    /// Cases in which it was asked.
    asked: usize,
    /// Of these, those of which anything else is said without it, or another error is made on the judge's path.
    changed: usize,
    /// Concealed effects that are named without it, less those that are named with it.
    right: isize,
    /// The same of names for what is not there.
    wrong: isize,
    /// Cases whose error on the judge's path is larger without it by more than [`SAME`].
    worse: usize,
    /// The same, smaller.
    better: usize,
}

/// The rules by name, as they come out of the answered cases of some folders.
#[derive(Clone, Debug, Default)]
pub struct Ablation {
    cases: usize,
    rows: BTreeMap<String, Row>,
    /// Cases that could not be diagnosed, with the reason.
    pub broken: Vec<String>,
    /// Every change, in a line.
    pub told: Vec<String>,
}

impl Ablation {
    /// Takes in the cases of a folder, whose machines are in the folder `machines`; `only`: rules that are asked for, all where there are none.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn take(
        &mut self,
        folder: &Path,
        engine: &Engine,
        machines: &Path,
        only: &[String],
    ) -> Result<(), String> {
        let cases = answer::open(folder, machines)?;
        self.cases += cases.len();
        let each: Vec<_> =
            cases.into_par_iter().map(|(files, answer)| ablated(&files, &answer, engine, only)).collect();
        for case in each {
            match case {
                Ok(changes) => changes.into_iter().for_each(|change| self.count(change)),
                Err(message) => self.broken.push(message),
            }
        }
        Ok(())
    }

    fn count(&mut self, change: Change) {
        let row = self.rows.entry(change.rule).or_default();
        row.asked += 1;
        row.changed += usize::from(change.told.is_some());
        row.right += change.right;
        row.wrong += change.wrong;
        row.worse += usize::from(change.error > 1.0 + SAME);
        row.better += usize::from(change.error < 1.0 / (1.0 + SAME));
        self.told.extend(change.told);
    }

    /// The table in Markdown.
    pub fn markdown(&self) -> String {
        let mut out = format!(
            "| rule, {} cases | asked in | changes | right names | wrong names | error larger, smaller by 10 % |\n| --- | --- | --- | --- | --- | --- |\n",
            self.cases
        );
        for (rule, row) in &self.rows {
            let Row { asked, changed, right, wrong, worse, better } = row;
            let _ = writeln!(
                out,
                "| `{rule}` | {asked} | {changed} | {right:+} | {wrong:+} | {worse}, {better} |"
            );
        }
        out
    }
}

/// What leaving a rule out does to one case.
struct Change {
    rule: String,
    right: isize,
    wrong: isize,
    /// The error on the judge's path over that with the rule.
    error: f64,
    /// What is said with it and without, if that is not the same.
    told: Option<String>,
}

fn ablated(
    files: &CaseFiles,
    answer: &Answer,
    engine: &Engine,
    only: &[String],
) -> Result<Vec<Change>, String> {
    let told = |message: String| format!("{}: {message}", answer.label);
    let with = engine.ablated("None", &files.label).diagnose(files).map_err(told)?;
    let is_asked = |rule: &&String| only.is_empty() || only.contains(rule);
    let rules: Vec<&String> = with.asked.iter().filter(is_asked).collect();
    let change = |rule: &String| {
        let without = engine.ablated(rule, &files.label).diagnose(files).map_err(told)?;
        let error = |verdict: &Verdict| verdict.judged.map_or(1.0, |(_, error)| error);
        let (before, after) = (said(&with), said(&without));
        let error = error(&without) / error(&with);
        let is_change = before != after || (error - 1.0).abs() > 1e-3;
        Ok(Change {
            rule: rule.clone(),
            right: right(answer, &without) as isize - right(answer, &with) as isize,
            wrong: wrong(answer, &without) as isize - wrong(answer, &with) as isize,
            error,
            told: is_change
                .then(|| format!("{rule} {}: {before} -> {after}, error x {error:.2}", answer.label)),
        })
    };
    rules.into_iter().map(change).collect()
}

/// How many of the concealed effects are named.
fn right(answer: &Answer, verdict: &Verdict) -> usize {
    answer.effects.iter().filter(|truth| verdict.findings.iter().any(|finding| truth.is(finding))).count()
}

/// How many names are of nothing that is there, each likelier than not.
fn wrong(answer: &Answer, verdict: &Verdict) -> usize {
    let is_wrong = |finding: &&super::verdict::Finding| {
        finding.probability > 0.5 && !answer.effects.iter().any(|truth| truth.is(finding))
    };
    verdict.findings.iter().filter(is_wrong).count()
}

fn said(verdict: &Verdict) -> String {
    let names = verdict.findings.iter().map(|f| format!("{} {} {:.2}", f.effect, f.at, f.probability));
    let rest = verdict.unexplained.iter().map(|at| format!("unexplained {at}"));
    names.chain(rest).collect::<Vec<_>>().join(", ")
}

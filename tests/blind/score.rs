//! The scorer: verdicts against answers.

use std::collections::BTreeMap;

use statrs::distribution::{Beta, ContinuousCDF};

use super::answer::{Answer, Truth};
use super::verdict::{Finding, Verdict};

/// So many of so many, with the bounds of Clopper and Pearson.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Count {
    pub hits: usize,
    pub of: usize,
}

impl Count {
    pub fn add(&mut self, hit: bool) {
        self.hits += usize::from(hit);
        self.of += 1;
    }

    pub fn share(self) -> f64 {
        self.hits as f64 / self.of as f64
    }

    /// Exact 95 % bounds of the share.
    pub fn bounds(self) -> (f64, f64) {
        let (k, n) = (self.hits as f64, self.of as f64);
        let quantile = |a: f64, b: f64, p: f64| Beta::new(a, b).map_or(f64::NAN, |d| d.inverse_cdf(p));
        let low = if self.hits == 0 { 0.0 } else { quantile(k, n - k + 1.0, 0.025) };
        let high = if self.hits == self.of { 1.0 } else { quantile(k + 1.0, n - k, 0.975) };
        (low, high)
    }
}

/// Coefficients that say how large an effect is; `peak` is not among them, because geometry takes its part of a curve.
const SIZES: [&str; 8] = ["width", "slope", "lag", "gain", "height", "amplitude", "delay", "rate"];
/// Coefficients that say how it goes.
const COURSES: [&str; 6] = ["take_up", "decay", "period", "frequency", "at_time", "time_constant"];

/// All figures over the cases of one folder.
#[derive(Clone, Debug, Default)]
pub struct Score {
    pub cases: usize,
    pub broken: Vec<String>,
    pub first: Count,
    /// The same, where a finding's `confusable_with` may hold the truth.
    pub first_or_confusable: Count,
    pub needless_one: usize,
    pub clean_silent: Count,
    pub two_right: usize,
    pub two_said: usize,
    pub two_true: usize,
    pub odd_unexplained: Count,
    /// Of those, at a joint or frame that the effect has to do with.
    pub odd_at_right_place: Count,
    pub odd_wrong: Count,
    pub unexplained_needlessly: Count,
    pub findings: usize,
    pub names: usize,
    pub judged_worse: Count,
    /// The same where the machine is rid of what is outside every vocabulary.
    pub rid_worse: Count,
    pub judge_ratios: Vec<f64>,
    pub held_out_ratios: Vec<f64>,
    pub sizes_covered: Count,
    pub courses_covered: Count,
    /// Stated probability, and whether the finding was right.
    pub stated: Vec<(f64, bool)>,
    pub seconds: Vec<f64>,
    pub seconds_of_7000: Vec<f64>,
    /// True name, then what was said first, and how often.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
    pub failures: Vec<String>,
}

impl Score {
    pub fn of(results: &[(Answer, Result<Verdict, String>)]) -> Self {
        let mut score = Score::default();
        for (answer, verdict) in results {
            score.cases += 1;
            match verdict {
                Ok(verdict) => score.take(answer, verdict),
                Err(message) => score.broken.push(format!("{}: {message}", answer.label)),
            }
        }
        score
    }

    fn take(&mut self, answer: &Answer, verdict: &Verdict) {
        // Outliers that are really there may be named; they are neither right nor needless.
        let is_idle = |f: &&Finding| !(f.effect == "outliers" && answer.outliers);
        let findings: Vec<&Finding> = verdict.findings.iter().filter(is_idle).collect();
        let matched = pair(&answer.effects, &findings);
        let right = matched.iter().filter(|m| m.is_some()).count();
        let needless = findings.len() - right;
        let unexplained = verdict.unexplained.is_some();
        for finding in &findings {
            self.findings += 1;
            self.names += 1 + finding.confusable.len();
        }
        for (i, finding) in findings.iter().enumerate() {
            self.stated.push((finding.probability, matched.contains(&Some(i))));
        }
        let mut failed;
        match (answer.mode.as_str(), answer.effects.as_slice()) {
            ("clean", _) => {
                self.clean_silent.add(findings.is_empty());
                failed = !findings.is_empty();
                self.confuse("(clean)", &first_said(&findings, unexplained));
            }
            ("one", [truth]) => {
                let hit = findings.first().is_some_and(|f| truth.is(f));
                self.first.add(hit);
                let confusable = |f: &&&Finding| f.confusable.iter().any(|(e, a)| truth.is_named(e, a));
                self.first_or_confusable.add(hit || findings.first().as_ref().is_some_and(confusable));
                self.needless_one += needless;
                failed = !hit || needless > 0;
                self.confuse(&truth.effect, &said_of(truth, &findings, unexplained));
            }
            ("odd", truths) => {
                self.odd_unexplained.add(unexplained);
                if let Some(at) = &verdict.unexplained {
                    self.odd_at_right_place.add(truths.iter().any(|t| t.concerns.contains(at)));
                }
                let wrong = findings.iter().any(|f| f.probability > 0.5);
                self.odd_wrong.add(wrong);
                failed = wrong || !unexplained;
                let name = truths.first().map_or("odd", |t| t.effect.as_str());
                self.confuse(name, &first_said(&findings, unexplained));
            }
            (_, truths) => {
                self.two_right += right;
                self.two_said += findings.len();
                self.two_true += truths.len();
                failed = right < truths.len() || needless > 0;
            }
        }
        if matches!(answer.mode.as_str(), "clean" | "one") {
            self.unexplained_needlessly.add(unexplained);
            failed |= unexplained;
        }
        for (truth, m) in answer.effects.iter().zip(&matched) {
            if let Some(i) = m {
                self.cover(truth, findings[*i]);
            }
        }
        let is_worse = |(plain, diagnosed): (f64, f64)| diagnosed > 1.1 * plain;
        if let Some(errors) = verdict.rid {
            self.rid_worse.add(is_worse(errors));
        }
        if let Some((plain, diagnosed)) = verdict.judged {
            let worse = is_worse((plain, diagnosed));
            self.judged_worse.add(worse);
            failed |= worse;
            self.judge_ratios.push(diagnosed / plain);
        }
        if let (Some(held), true) = (verdict.held_out, answer.mode != "odd") {
            self.held_out_ratios.push(held / answer.noise);
        }
        self.seconds.push(verdict.seconds);
        if verdict.samples > 0.0 {
            self.seconds_of_7000.push(verdict.seconds * 7000.0 / verdict.samples);
        }
        if failed {
            self.failures.push(told(answer, verdict));
        }
    }

    fn confuse(&mut self, truth: &str, said: &str) {
        *self.confusion.entry(truth.into()).or_default().entry(said.into()).or_default() += 1;
    }

    fn cover(&mut self, truth: &Truth, finding: &Finding) {
        if !truth.exactly(&finding.effect, &finding.at) {
            return;
        }
        for (name, true_value) in &truth.coefficients {
            let stated = finding.coefficients.iter().find(|(n, _, e)| n == name && *e > 0.0);
            let Some((_, value, error)) = stated else { continue };
            let inside = |off: f64| off.abs() <= 1.959_964 * error;
            if SIZES.contains(&name.as_str()) {
                self.sizes_covered.add(inside(value.abs() - true_value.abs()));
            } else if COURSES.contains(&name.as_str()) {
                self.courses_covered.add(inside(value - true_value));
            }
        }
    }

    /// F1 over (name, place) of cases that conceal two.
    pub fn f1(&self) -> f64 {
        2.0 * self.two_right as f64 / (self.two_said + self.two_true) as f64
    }

    /// Mean stated probability and share right.
    pub fn calibration(&self) -> (f64, f64) {
        let n = self.stated.len() as f64;
        let right = self.stated.iter().filter(|s| s.1).count() as f64;
        (self.stated.iter().map(|s| s.0).sum::<f64>() / n, right / n)
    }
}

/// For each truth the finding that says it; each finding serves once, exact names first.
fn pair(truths: &[Truth], findings: &[&Finding]) -> Vec<Option<usize>> {
    let mut taken = vec![false; findings.len()];
    let mut matched = vec![None; truths.len()];
    for exactly in [true, false] {
        for (truth, slot) in truths.iter().zip(&mut matched) {
            if slot.is_none() {
                let fits = |f: &Finding| if exactly { truth.exactly(&f.effect, &f.at) } else { truth.is(f) };
                *slot = (0..findings.len()).find(|i| !taken[*i] && fits(findings[*i]));
                if let Some(i) = *slot {
                    taken[i] = true;
                }
            }
        }
    }
    matched
}

fn first_said(findings: &[&Finding], unexplained: bool) -> String {
    match findings.first() {
        Some(f) => f.effect.clone(),
        None if unexplained => "unexplained".into(),
        None => "nothing".into(),
    }
}

fn said_of(truth: &Truth, findings: &[&Finding], unexplained: bool) -> String {
    match findings.first() {
        Some(f) if truth.exactly(&f.effect, &f.at) => "itself".into(),
        Some(f) if truth.is(f) => format!("{} (the same here)", f.effect),
        Some(f) if f.effect == truth.effect => "itself elsewhere".into(),
        _ => first_said(findings, unexplained),
    }
}

/// A case that failed, in one line: what is concealed, what was said, how long it took, and how the unseen path fares.
fn told(answer: &Answer, verdict: &Verdict) -> String {
    let truths: Vec<String> =
        answer.effects.iter().map(|t| format!("{} {} (snr {:.1})", t.effect, t.at, t.snr)).collect();
    let mut said: Vec<String> = verdict
        .findings
        .iter()
        .map(|f| {
            let others: Vec<_> = f.confusable.iter().map(|(e, a)| format!(" or {e} {a}")).collect();
            format!("{} {}{} p={:.2}", f.effect, f.at, others.concat(), f.probability)
        })
        .collect();
    said.extend(verdict.unexplained.iter().map(|at| format!("unexplained {at}")));
    let path =
        verdict.judged.map_or(String::new(), |(plain, own)| format!(", path {:.2} of plain", own / plain));
    let list = |all: &[String]| if all.is_empty() { "nothing".to_string() } else { all.join(", ") };
    let (label, machine) = (&answer.label, &answer.machine);
    format!(
        "{label} {machine} {} {}: {} | said {} | {:.0} s{path}",
        answer.measurement,
        answer.mode,
        list(&truths),
        list(&said),
        verdict.seconds
    )
}

/// Median, NaN of none.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => (sorted[n / 2 - 1] + sorted[n / 2]) / 2.0,
    }
}

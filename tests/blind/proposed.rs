//! Cases of one effect whose family is left out with all that looks like it: whether the law that is proposed foretells the judge's path as
//! well as the family.

use std::collections::BTreeSet;
use std::path::Path;

use rayon::prelude::*;

use super::answer::{self, Answer};
use super::score::Count;
use super::verdict::{CaseFiles, Engine};

/// A law may be worse than the family by this part of its error on the judge's path.
const WORSE: f64 = 0.05;

/// What was proposed for one case.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Error on the judge's path, m or rad: with the whole library, without the family and its relatives, with the proposal in their place.
    pub family: f64,
    pub without: f64,
    pub proposed: Option<f64>,
    /// At, law; what was named without them.
    pub laws: Vec<String>,
    pub named: Vec<String>,
}

/// Figures over the cases of one folder that conceal a single effect, or none.
#[derive(Clone, Debug, Default)]
pub struct Proposed {
    /// Of one effect: a proposal, and one as good as the family.
    pub given: Count,
    pub as_good: Count,
    /// Of none: a proposal.
    pub on_clean: Count,
    /// One line each.
    pub told: Vec<String>,
    pub broken: Vec<String>,
}

/// Tries every case of a single effect, and every clean one.
///
/// # Errors
/// If the folder cannot be read.
pub fn judge(folder: &Path, engine: &Engine, machines: &Path) -> Result<Proposed, String> {
    let mut cases = answer::open(folder, machines)?;
    cases.retain(|(_, answer)| matches!(answer.mode.as_str(), "one" | "clean"));
    let trial = |(files, answer): (CaseFiles, Answer)| {
        let left_out = answer.effects.iter().flat_map(|truth| relatives(&truth.effect));
        let left_out: BTreeSet<String> = left_out.collect();
        let trial = engine.proposed(&left_out, &files);
        (answer, trial)
    };
    let trials: Vec<(Answer, Result<Trial, String>)> = cases.into_par_iter().map(trial).collect();
    let mut all = Proposed::default();
    for (answer, trial) in trials {
        match trial {
            Ok(trial) => all.take(&answer, &trial),
            Err(message) => all.broken.push(format!("{}: {message}", answer.label)),
        }
    }
    Ok(all)
}

impl Proposed {
    fn take(&mut self, answer: &Answer, trial: &Trial) {
        let Some(truth) = answer.effects.first() else {
            self.on_clean.add(trial.proposed.is_some());
            return;
        };
        let as_good = trial.proposed.is_some_and(|proposed| proposed <= (1.0 + WORSE) * trial.family);
        self.given.add(trial.proposed.is_some());
        self.as_good.add(as_good);
        let um = |x: f64| format!("{:.3}", 1e6 * x);
        self.told.push(format!(
            "{} {} {}: {} {} | {} {} -> {} | {}{}",
            answer.label,
            answer.machine,
            answer.measurement,
            truth.effect,
            truth.at,
            um(trial.family),
            um(trial.without),
            trial.proposed.map_or("nothing".into(), um),
            if as_good { "" } else { "NOT AS GOOD " },
            if trial.laws.is_empty() { trial.named.join(", ") } else { trial.laws.join("; ") },
        ));
    }
}

/// A family and all that the library takes for its like: its look-alikes, those whose look-alike it is, and what is a form or kind of it.
fn relatives(effect: &str) -> BTreeSet<String> {
    let library = include_str!("../../src/effects/library.ron");
    let mut all = BTreeSet::from([effect.to_string()]);
    let mut family = "";
    for line in library.lines().map(str::trim) {
        let quoted: Vec<&str> = line.split('"').skip(1).step_by(2).collect();
        if line.starts_with("name: ") {
            family = quoted[0];
        }
        let is_kin = line.starts_with("name: ") && (line.contains("form_of") || line.contains("kind_of"));
        let is_alike = line.contains("(effect: ");
        for other in quoted.iter().filter(|_| is_kin || is_alike) {
            // A symbol or a sentence is no family, and is not left out.
            let is_name = other.chars().all(|c| c.is_ascii_lowercase() || c == '_');
            if is_name && family == effect {
                all.insert(other.to_string());
            } else if *other == effect {
                all.insert(family.to_string());
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relatives_are_look_alikes_either_way() {
        let of = |effect: &str| relatives(effect).into_iter().collect::<Vec<_>>().join(" ");
        assert!(of("sensor_drift").contains("thermal_drift"));
        assert!(of("thermal_drift").contains("sensor_drift"));
        assert!(of("straightness").contains("cyclic_straightness"));
        assert!(!of("straightness").contains("backlash"));
    }
}

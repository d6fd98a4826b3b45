//! Cases of one effect whose family is left out of the library: what is said of them then.

use std::path::Path;

use rayon::prelude::*;

use super::answer::{self, Answer, Truth};
use super::score::Count;
use super::verdict::{Diagnoser, Engine, Verdict};

/// Figures over the cases of one folder that conceal a single effect.
#[derive(Clone, Debug, Default)]
pub struct LeftOut {
    pub unexplained: Count,
    /// Of those, at the effect's joint or frame.
    pub at_its_place: Count,
    /// Another name with a probability above one half.
    pub misnamed: Count,
    /// Nothing at all.
    pub silent: Count,
    /// One line each.
    pub told: Vec<String>,
    pub broken: Vec<String>,
}

/// Diagnoses every case of a single effect with its family left out, and those that its recordings cannot tell from it.
///
/// # Errors
/// If the folder cannot be read.
pub fn judge(folder: &Path, engine: &Engine, machines: &Path) -> Result<LeftOut, String> {
    let mut cases = answer::open(folder, machines)?;
    cases.retain(|(_, answer)| answer.mode == "one");
    let results: Vec<(Answer, Result<Verdict, String>)> = cases
        .into_par_iter()
        .map(|(files, answer)| {
            let mut names: Vec<&String> = answer.effects.iter().flat_map(names).collect();
            names.sort();
            names.dedup();
            let verdict = engine.without(&names, &files.label).diagnose(&files);
            (answer, verdict)
        })
        .collect();
    let mut all = LeftOut::default();
    for (answer, verdict) in results {
        match verdict {
            Ok(verdict) => all.take(&answer, &verdict),
            Err(message) => all.broken.push(format!("{}: {message}", answer.label)),
        }
    }
    Ok(all)
}

fn names(truth: &Truth) -> impl Iterator<Item = &String> {
    std::iter::once(&truth.effect).chain(truth.also.iter().map(|(effect, _)| effect))
}

impl LeftOut {
    fn take(&mut self, answer: &Answer, verdict: &Verdict) {
        let Some(truth) = answer.effects.first() else { return };
        self.unexplained.add(verdict.unexplained.is_some());
        if let Some(at) = &verdict.unexplained {
            self.at_its_place.add(truth.concerns.contains(at));
        }
        let misnamed = verdict.findings.iter().any(|f| f.probability > 0.5);
        self.misnamed.add(misnamed);
        let silent = verdict.findings.is_empty() && verdict.unexplained.is_none();
        self.silent.add(silent);
        let mut said: Vec<String> = (verdict.findings.iter())
            .map(|f| format!("{} {} p={:.2}", f.effect, f.at, f.probability))
            .collect();
        said.extend(verdict.unexplained.iter().map(|at| format!("unexplained {at}")));
        let shape = verdict.shape_share.map_or(String::new(), |share| format!(", shapes {share:.3}"));
        self.told.push(format!(
            "{} {} {}: {} {} (snr {:.1}) | said {}{shape}",
            answer.label,
            answer.machine,
            answer.measurement,
            truth.effect,
            truth.at,
            truth.snr,
            if said.is_empty() { "nothing".to_string() } else { said.join(", ") }
        ));
    }
}

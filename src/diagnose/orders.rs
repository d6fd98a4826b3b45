//! Orders of one error motion: found one by one, told as one finding.

use super::diagnosis::Diagnosis;
use super::finding::{Confusable, Finding, Size};
use super::search::Search;
use super::terms::ModelTerm;

/// Makes one finding of those that are orders of one error motion, where the first of them stands. Shares, held-out figures and curves
/// are those of all its orders already.
pub(super) fn join(search: &Search, told: &[ModelTerm], diagnosis: &mut Diagnosis) {
    let first_of = |i: usize| (0..i).find(|k| search.is_one(told[*k].candidate, told[i].candidate));
    let firsts: Vec<Option<usize>> = (0..told.len()).map(first_of).collect();
    for (i, first) in firsts.iter().enumerate() {
        let Some(first) = *first else { continue };
        let order = 2 + firsts[..i].iter().filter(|other| **other == Some(first)).count();
        let further = diagnosis.findings[i].clone();
        diagnosis.findings[first].take_in(further, order);
    }
    for i in (0..told.len()).rev().filter(|i| firsts[*i].is_some()) {
        diagnosis.findings.remove(i);
        diagnosis.traces.findings.remove(i);
    }
}

impl Finding {
    /// Takes in what was found of it with another order, the second or a later one.
    fn take_in(&mut self, further: Finding, order: usize) {
        self.explanation += &format!("; {}", further.explanation);
        let named = |size: Size| Size { name: format!("{}_{order}", size.name), ..size };
        self.coefficients.extend(further.coefficients.into_iter().map(named));
        self.probability = self.probability.max(further.probability);
        self.delta_bic += further.delta_bic;
        for other in further.confusable_with {
            let is_known = |c: &Confusable| (&c.effect, &c.at) == (&other.effect, &other.at);
            if !self.confusable_with.iter().any(is_known) {
                self.confusable_with.push(other);
            }
        }
    }
}

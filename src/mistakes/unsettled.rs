//! Joints that were read before the machine had settled: each is short of where it came to rest by a part of its move.

use nalgebra::{Cholesky, DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::change::Change;
use super::rows::Rows;
use super::thinned::Thinned;
use super::undone::without;
use crate::error::Result;
use crate::identify::{CalibrateOptions, Plausibility, calibrate};
use crate::machine::Machine;

/// Neighbours on a path are far less than this part of the range apart, poses one by one more: a tenth lies between. On a path it would be
/// a lag, which `diagnose` tells from its like.
const APART: f64 = 0.1;
/// It must leave less than this part of what is left: three quarters of it were due to this.
const MOSTLY: f64 = 0.5;

/// Joints that were read too early.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unsettled {
    /// By command, what was missing of the move that led to each sample, as a part of that move.
    pub parts: Vec<f64>,
    /// What is left.
    pub left: Plausibility,
    /// What would be left of the same readings without it, m or rad.
    pub then: f64,
    /// In words, as the part of a sentence that follows "with".
    pub what: String,
    /// What to do about it.
    pub mend: String,
}

/// Looks for joints that were read before the machine had settled.
pub(super) fn unsettled(machine: &Machine, rows: &Rows) -> Result<Option<Unsettled>> {
    let commands = machine.commands().len();
    let before: Vec<_> = rows.thinned.iter().map(Thinned::commands_before).collect();
    let moved = |recording: usize, place: usize, c: usize| {
        rows.thinned[recording].samples[place].commands[c] - before[recording][place][c]
    };
    let all = |c: usize| rows.thinned.iter().flat_map(move |t| t.samples.iter().map(move |s| s.commands[c]));
    let used: Vec<usize> = (0..commands)
        .filter(|c| {
            let range = all(*c).fold(f64::NEG_INFINITY, f64::max) - all(*c).fold(f64::INFINITY, f64::min);
            let mut steps: Vec<f64> =
                (rows.seen.iter().map(|s| moved(s.recording, s.place, *c).abs())).collect();
            steps.sort_by(f64::total_cmp);
            steps.get(steps.len() / 2).is_some_and(|step| *step > APART * range && range > 0.0)
        })
        .collect();
    if used.is_empty() {
        return Ok(None);
    }
    let (mut matrix, mut gradient) = (DMatrix::zeros(used.len(), used.len()), DVector::zeros(used.len()));
    let mut squares = 0.0;
    for seen in &rows.seen {
        for (row, residual) in seen.by_command.iter().zip(&seen.residuals) {
            let row = DVector::from_iterator(
                used.len(),
                used.iter().map(|c| row[*c] * moved(seen.recording, seen.place, *c)),
            );
            matrix.ger(1.0, &row, &row, 1.0);
            gradient.axpy(*residual, &row, 1.0);
            squares += residual * residual;
        }
    }
    let Some(solved) = Cholesky::new(matrix).map(|c| c.solve(&gradient)) else { return Ok(None) };
    let gain = solved.dot(&gradient);
    if squares - gain > MOSTLY * MOSTLY * squares {
        return Ok(None);
    }
    let mut parts = vec![0.0; commands];
    used.iter().zip(solved.iter()).for_each(|(c, part)| parts[*c] = *part);
    let change = Change::Unsettled(parts.clone());
    let mended = without(machine, &rows.thinned, &[&change])?;
    let Ok((_, fit)) = calibrate(machine, &mended, CalibrateOptions::default()) else { return Ok(None) };
    let pairs = rows.plausibility.iter().zip(&fit.plausibility);
    let best = pairs.min_by(|a, b| (a.1.left / a.0.left).total_cmp(&(b.1.left / b.0.left)));
    Ok(best.filter(|(left, then)| then.left < MOSTLY * left.left).map(|(left, then)| Unsettled {
        parts,
        left: left.clone(),
        then: then.left,
        what: change.in_words(machine),
        mend: change.mend(machine),
    }))
}

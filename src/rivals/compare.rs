//! The harness: every rival fitted on the same samples and judged on others.

use serde::{Deserialize, Serialize};

use super::judge::{AgainstTruth, Residuals, against_truth, residuals};
use super::{Fitted, Rival};
use crate::calibration::CalibratedMachine;
use crate::error::{Error, Result};
use crate::identify::{Loss, Stop, fit_setup};
use crate::machine::Machine;
use crate::recording::Recording;

/// How one rival did.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Verdict {
    /// Name of the rival.
    pub rival: String,
    /// Steps taken; of a filter, samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// Why it stopped.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<Stop>,
    /// Why it failed, if it did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
    /// Residuals on what it was fitted to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fitted: Option<Residuals>,
    /// Residuals on what it is judged by.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub judged: Option<Residuals>,
    /// Against the true machine at the samples it is judged by.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<AgainstTruth>,
}

/// What rivals are compared on.
pub struct Arena<'a> {
    /// The machine as declared.
    pub machine: &'a Machine,
    /// What every rival is fitted to.
    pub fit_on: &'a [Recording],
    /// What every rival is judged by; where it is empty, by what it was fitted to.
    pub judge_on: &'a [Recording],
    /// The true machine, where it is known.
    pub truth: Option<&'a CalibratedMachine>,
    /// Whether the set-ups of [`Arena::judge_on`] are found again from those recordings, the machine held.
    pub fit_setup: bool,
}

impl Arena<'_> {
    /// Fits and judges one rival. That a scheme fails on the data is a verdict, not an error.
    ///
    /// # Errors
    /// If a recording cannot be read, or a recording to judge by belongs to a set-up that only [`Arena::fit_setup`] could find.
    pub fn judge(&self, name: &str, rival: &Rival) -> Result<Verdict> {
        let mut verdict = Verdict {
            rival: name.to_string(),
            steps: None,
            stop: None,
            failed: None,
            fitted: None,
            judged: None,
            truth: None,
        };
        let Fitted { calibrated, steps, stop } = match rival.fit(self.machine, self.fit_on) {
            Ok(fitted) => fitted,
            Err(Error::Undetermined { what, .. }) => {
                verdict.failed = Some(what);
                return Ok(verdict);
            }
            Err(error) => return Err(error),
        };
        (verdict.steps, verdict.stop) = (Some(steps), Some(stop));
        verdict.fitted = Some(residuals(&calibrated, self.fit_on)?);
        let judge_on = if self.judge_on.is_empty() { self.fit_on } else { self.judge_on };
        let placed =
            if self.fit_setup { fit_setup(&calibrated, judge_on, Loss::default())? } else { calibrated };
        verdict.judged = Some(residuals(&placed, judge_on)?);
        if let Some(truth) = self.truth {
            verdict.truth = against_truth(&placed, truth, judge_on)?;
        }
        Ok(verdict)
    }
}

/// A recording as `count` evenly spread samples, and the rest; `None` in place of a part without samples.
///
/// # Errors
/// If the recording cannot be read.
pub fn split(
    recording: &Recording,
    machine: &Machine,
    count: u64,
) -> Result<(Option<Recording>, Option<Recording>)> {
    let samples = recording.scan()?.samples;
    let head = recording.preamble();
    let end = if head.ends_with('\n') { "" } else { "\n" };
    let (mut picked, mut rest) = (format!("{head}{end}"), format!("{head}{end}"));
    let (mut seen, mut taken) = (0, 0);
    let mut lengths = [0u64; 2];
    for block in recording.rows_with_text()? {
        let block = block?;
        for row in block.rows().filter(|row| row.sample.is_some()) {
            let next = if count >= samples {
                taken
            } else {
                (taken as u128 * samples as u128 / count as u128) as u64
            };
            let pick = taken < count && seen == next;
            let part = if pick { &mut picked } else { &mut rest };
            part.push_str(row.text);
            part.push('\n');
            lengths[usize::from(!pick)] += 1;
            taken += u64::from(pick);
            seen += 1;
        }
    }
    let read = |text: String, length: u64| -> Result<Option<Recording>> {
        if length == 0 {
            return Ok(None);
        }
        Recording::from_bytes(&recording.path().to_string_lossy(), text.into_bytes(), machine).map(Some)
    };
    Ok((read(picked, lengths[0])?, read(rest, lengths[1])?))
}

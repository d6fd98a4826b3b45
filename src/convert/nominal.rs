//! The path that a machine was told to run, over time, where a table has only what was read meanwhile.

use crate::error::{Error, Result};

/// Commands over time, and what the head of a recording says of the points that were measured.
#[non_exhaustive]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nominal {
    /// Even steps of this, s.
    pub(super) step: f64,
    /// Commands of each moment, m or rad, machine order.
    pub(super) commands: Vec<Vec<f64>>,
    /// Lines `key: value` for the head, where the table's user says nothing of that key.
    pub(super) head: Vec<String>,
}

impl Nominal {
    /// Commands every `step` seconds, m or rad, machine order: what an interpolator of your own has made of a program.
    ///
    /// # Errors
    /// [`Error::Motion`] where nothing moves, or rows differ in length.
    pub fn new(step: f64, commands: Vec<Vec<f64>>, head: Vec<String>) -> Result<Nominal> {
        let fault = |what: String, mend: &str| Err(Error::Motion { what, mend: mend.into() });
        if !(step.is_finite() && step > 0.0) {
            return fault(format!("commands follow each other by {step:?} s"), "give a time above zero");
        }
        let count = commands.first().map_or(0, Vec::len);
        let sound = |q: &Vec<f64>| q.len() == count && q.iter().all(|x| x.is_finite());
        if let Some(k) = commands.iter().position(|q| !sound(q)) {
            return fault(
                format!("moment {} of the path has not {count} finite commands", k + 1),
                "give one for each joint",
            );
        }
        if !commands.windows(2).any(|pair| pair[0] != pair[1]) {
            return fault(
                "the path does not move".into(),
                "give the path that ran while the instrument was read",
            );
        }
        Ok(Nominal { step, commands, head })
    }

    /// How long the path takes, s.
    pub fn duration(&self) -> f64 {
        self.step * (self.commands.len() - 1) as f64
    }

    /// Commands at a time from the start of the path; it stands still before and behind.
    pub fn at(&self, time: f64) -> Vec<f64> {
        let (k, part) = self.place(time);
        let (a, b) = (&self.commands[k], &self.commands[(k + 1).min(self.commands.len() - 1)]);
        a.iter().zip(b).map(|(a, b)| a + (b - a) * part).collect()
    }

    /// The moment before a time, and the part of a step that has gone since.
    pub(super) fn place(&self, time: f64) -> (usize, f64) {
        let last = (self.commands.len() - 1) as f64;
        let steps = (time / self.step).clamp(0.0, last);
        let k = steps.floor().min(last - 1.0);
        (k as usize, steps - k)
    }
}

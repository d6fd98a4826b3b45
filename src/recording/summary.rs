//! What a full pass tells of a recording.

use serde::{Deserialize, Serialize};

/// What a recording holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Rows of the file, `samples + dropped`.
    pub rows: u64,
    /// Rows that can be used.
    pub samples: u64,
    /// Rows left out because a command, time, direction or measured number is missing.
    pub dropped: u64,
    /// Least and greatest value of every command over the samples, m or rad; both the same where the header fixes it.
    pub commands: Vec<(f64, f64)>,
    /// Per command whether it moves at all.
    pub moving: Vec<bool>,
    /// First and last time, s.
    pub time: Option<(f64, f64)>,
    /// Median time from a sample to the next, s, to 2 %; `None` without time or with a single sample.
    pub step: Option<f64>,
    /// A longer time between two samples is a pause, s: five median steps, rounded up to the next of 32 steps per octave.
    pub pause_after: Option<f64>,
    /// How many pauses there are.
    pub pauses: u64,
    /// What is odd, but no fault: ignored header keys, couplings that do not hold, travel that is left.
    pub warnings: Vec<String>,
}

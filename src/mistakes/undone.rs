//! Recordings as they would be: without mistakes, or in parts.

use super::change::Change;
use super::thinned::Thinned;
use crate::error::Result;
use crate::machine::Machine;
use crate::recording::Recording;

/// The recordings without these mistakes.
pub(super) fn without(
    machine: &Machine,
    thinned: &[Thinned],
    mistakes: &[&Change],
) -> Result<Vec<Recording>> {
    let one = |thinned: &Thinned| {
        let mut other = thinned.clone();
        for change in mistakes {
            (other.samples, other.head) = (change.applied(&other), change.head(&other));
        }
        other.recording(machine)
    };
    thinned.iter().map(one).collect()
}

impl Thinned {
    /// The samples of some places as a recording of its own, in a set-up whose frame `w` is unknown.
    pub fn part(&self, from: usize, to: usize, setup: &str) -> Thinned {
        let mut part = Change::Frame.applied_to_head(self);
        part.head.retain(|line| !line.trim_start_matches('#').trim_start().starts_with("setup"));
        part.head.push(format!("# setup: {setup}"));
        part.path = format!("{} {}", self.path, setup.replace(['/', '\\'], " "));
        part.header.setup = setup.into();
        (part.samples, part.windows) = (self.samples[from..to].to_vec(), self.windows[from..to].to_vec());
        part
    }
}

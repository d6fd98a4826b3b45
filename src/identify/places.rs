//! Where constant parameters stand when every dyad and every set-up has its six.

use super::source::Sources;
use crate::machine::Machine;

/// Six per dyad in machine order (those of `w` are the first set-up's), six per further set-up, then tool points, zeros, lengths and tool rotations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Places {
    dyads: usize,
    w: usize,
    set_ups: usize,
    tool_points: usize,
    zeros: usize,
    lengths: usize,
    tool_rotations: usize,
}

impl Places {
    pub fn new(machine: &Machine, sources: &Sources) -> Self {
        Places {
            dyads: machine.dyads().len(),
            w: machine.w_index(),
            set_ups: sources.setups.len(),
            tool_points: sources.tool_points.len(),
            zeros: sources.zeros.len(),
            lengths: sources.lengths.len(),
            tool_rotations: sources.tool_rotations.len(),
        }
    }

    /// Frame `w` of a set-up.
    pub fn frame_w(&self, set_up: usize) -> usize {
        if set_up == 0 { 6 * self.w } else { 6 * (self.dyads + set_up - 1) }
    }

    fn behind_frames(&self) -> usize {
        6 * (self.dyads + self.set_ups - 1)
    }

    pub fn tool_point(&self, i: usize) -> usize {
        self.behind_frames() + 3 * i
    }

    pub fn zero(&self, i: usize) -> usize {
        self.tool_point(self.tool_points) + i
    }

    pub fn length(&self, i: usize) -> usize {
        self.zero(self.zeros) + i
    }

    pub fn tool_rotation(&self, i: usize) -> usize {
        self.length(self.lengths) + 3 * i
    }

    pub fn len(&self) -> usize {
        self.tool_rotation(self.tool_rotations)
    }

    /// Whether parameter `k` is a translation rather than a turn.
    pub fn is_translation(&self, k: usize) -> bool {
        let frames = self.behind_frames();
        (frames..self.tool_rotation(0)).contains(&k) || (k < frames && k % 6 < 3)
    }
}

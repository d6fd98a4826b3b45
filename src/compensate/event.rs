//! What a block makes happen, in the order in which it does.

use smallvec::SmallVec;

use crate::few::Few;
use crate::nc::{Motion, MotionKind};

/// What a block makes happen, seldom more than one thing.
pub(super) type Events = SmallVec<[Event; 1]>;

/// One thing that a block makes happen.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "nearly every event is a move")]
pub(super) enum Event {
    /// Lengths are written in another unit from here on.
    Units,
    /// The machine goes to a place of its own, a reference point or one in its own frame.
    Sent {
        /// Joint commands there, m or rad.
        q: Few<f64>,
        /// By command: whether its way there is known.
        ways: Few<bool>,
        /// The motion that the block puts into force, if it does.
        kind: Option<MotionKind>,
    },
    /// A drilling cycle is called that leaves the axes of its plane where they are.
    Drilled,
    /// A move to program coordinates. Whoever follows it tells the interpreter where it ends.
    Move {
        motion: Motion,
        /// Where it ends, by axis, m or rad.
        target: Few<f64>,
        /// Whether a cycle runs there.
        drills: bool,
    },
    /// Numbers for the place where the machine stands: word, axis, and by how much the machine stands elsewhere than meant, m or rad.
    Preset { words: Vec<(usize, usize, f64)> },
}

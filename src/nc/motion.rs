//! What one block does: where it moves, and what else it sets going.

use super::modes::MotionKind;
use super::unfollowed::Unfollowed;
use crate::few::Few;

/// A block that moves. Lists are in the order of the addresses given to [`State::new`](super::State::new).
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Its line, from 1.
    pub line: usize,
    /// How it moves.
    pub kind: MotionKind,
    /// Where it ends, absolute, programmed units, with the axes that the block does not name; `None` where that is not known.
    pub target: Few<Option<f64>>,
    /// Which of [`Block::words`](super::Block::words) gave which axis.
    pub words: Few<Option<usize>>,
    /// Whether `target` is meant in the machine's own frame (`G53`, `SUPA`) for the axes named.
    pub machine_frame: bool,
}

/// What one block did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Step {
    /// Where it moves, if it does.
    pub motion: Option<Motion>,
    /// Coordinates mean something else behind this block: `TRANS`, `AROT`, `G92`, `G52`, `G68`, `G10`, `CYCLE800`, `PLANE`.
    pub changes_frame: bool,
    /// It calls a sub-program, macro or cycle that may move.
    pub calls: bool,
    /// The next block need not be the next line: `IF`, `GOTO`, `WHILE`, `FN 9`. State is followed in the order of lines.
    pub jumps: bool,
    /// Another tool comes, for which the axes may go elsewhere.
    pub changes_tool: bool,
    /// What else stands in it and is not followed.
    pub unfollowed: Option<Unfollowed>,
    /// Its M codes that the dialect does not have: indices of words. What they do is a matter of the machine.
    pub unknown_functions: Vec<usize>,
}

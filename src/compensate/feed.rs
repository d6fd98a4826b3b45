//! The feed of a block that turns rotary axes alone and gets linear words by its correction, `docs/compensate.md` (C15).
//!
//! Controls take `F` as degrees per minute where only rotary axes move, and as the speed of the tip where a linear one moves with them: by
//! a correction of some micrometres the rotary axis would go as fast as it can. The time of the block is written instead.

use super::fault::CompensateFault;
use super::interpreter::Interpreter;
use super::motion_word::{first_of, motion_word};
use super::position::Position;
use super::refusal::refuse;
use crate::error::Result;
use crate::nc::{Block, Dialect, Feed, Motion, MotionKind};

/// Where a block starts and ends.
pub(super) struct Way<'a> {
    pub from: &'a Position,
    pub to: &'a Position,
}

impl Way<'_> {
    /// How far each axis goes, m or rad.
    fn by(&self, axis: usize) -> f64 {
        self.to.program()[axis] - self.from.program()[axis]
    }
}

/// Whether the meaning of `F` depends on the correction: only rotary axes are meant to move, and linear ones do.
pub(super) fn is_upset(program: &Interpreter, motion: &Motion, meant: &Way, written: &Way) -> bool {
    let axes = program.control().axes();
    let linear = |way: &Way| (0..axes.len()).any(|i| !axes[i].is_rotary() && way.by(i).abs() > 1e-9);
    let turns = (0..axes.len()).any(|i| axes[i].is_rotary() && meant.by(i) != 0.0);
    motion.kind != MotionKind::Rapid
        && program.modes().feed != Some(Feed::InverseTime)
        && turns
        && !linear(meant)
        && linear(written)
}

/// Writes the time of the block in the place of its feed. What stands behind the block then: the line that brings the feed back.
///
/// # Errors
/// [`CompensateFault::RotaryFeed`] where the time is not known, or the control has no words for it.
pub(super) fn keep_time(
    program: &Interpreter,
    block: &mut Block,
    motion: &Motion,
    meant: &Way,
) -> Result<String> {
    let axes = program.control().axes();
    let refused = |block: &Block| refuse(block, 0, CompensateFault::RotaryFeed);
    let degrees = (0..axes.len())
        .filter(|i| axes[*i].is_rotary())
        .map(|i| meant.by(i).to_degrees().powi(2))
        .sum::<f64>()
        .sqrt();
    let per_minute = !matches!(program.modes().feed, Some(Feed::PerRevolution | Feed::InverseTime));
    let Some((feed, text)) = program.feed().filter(|(feed, _)| *feed > 0.0) else { return refused(block) };
    if program.dialect() == Dialect::Heidenhain || !per_minute {
        return refused(block);
    }
    let inverse = format!("{:.6}", feed / degrees);
    match block.words().iter().position(|w| w.address == "F") {
        Some(word) => block.replace(word, &inverse)?,
        None => block.insert(block.words().len().saturating_sub(1), "F", &inverse)?,
    }
    let word = |code: f64| block.words().iter().position(|w| w.address == "G" && w.number() == Some(code));
    match (word(94.0), motion_word(block)) {
        (Some(per_minute), _) => block.replace(per_minute, "93")?,
        (None, Some(moves)) => block.insert(moves, "G", "93")?,
        (None, None) => block.insert_before(first_of(block, motion), "G", "93")?,
    }
    Ok(format!("G94 F{text}"))
}

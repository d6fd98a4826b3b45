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

/// The least feed that LinuxCNC takes a block under inverse time to have, in units of length a minute: a slower one is raised to it
/// (`inverse_time_rate_straight` of its interpreter), and the rotary axes with it.
const LEAST_FEED: f64 = 0.1;

/// Whether the linear part of a block that turns rotary axes alone is too short for its time to be kept by inverse time.
pub(super) fn is_too_short(program: &Interpreter, block: &Block, meant: &Way, written: &Way) -> bool {
    let (control, axes) = (program.control(), program.control().axes());
    if program.dialect() != Dialect::Rs274 {
        return false;
    }
    let linear = |way: &Way| {
        let by = (0..axes.len()).filter(|i| !axes[*i].is_rotary());
        by.map(|i| control.programmed(i, way.by(i)).powi(2)).sum::<f64>().sqrt()
    };
    let inverse = match program.modes().feed {
        Some(Feed::InverseTime) => feed_of(block),
        Some(Feed::PerRevolution) => None,
        _ => program.feed().map(|(feed, _)| feed / degrees(program, meant)),
    };
    inverse.is_some_and(|inverse| inverse * linear(written) < LEAST_FEED)
}

fn feed_of(block: &Block) -> Option<f64> {
    block.words().iter().find(|w| w.address == "F").and_then(|w| w.number())
}

/// The rotary way, deg.
fn degrees(program: &Interpreter, way: &Way) -> f64 {
    let axes = program.control().axes();
    let turned = (0..axes.len()).filter(|i| axes[*i].is_rotary()).map(|i| way.by(i).to_degrees().powi(2));
    turned.sum::<f64>().sqrt()
}

/// Whether a block turns rotary axes alone at a feed, and its correction moves linear ones.
pub(super) fn turns_alone(program: &Interpreter, motion: &Motion, meant: &Way, written: &Way) -> bool {
    let axes = program.control().axes();
    let linear = |way: &Way| (0..axes.len()).any(|i| !axes[i].is_rotary() && way.by(i).abs() > 1e-9);
    let turns = (0..axes.len()).any(|i| axes[i].is_rotary() && meant.by(i) != 0.0);
    motion.kind != MotionKind::Rapid && turns && !linear(meant) && linear(written)
}

/// Whether the meaning of `F` depends on the correction: only rotary axes are meant to move, and linear ones do.
pub(super) fn is_upset(program: &Interpreter, motion: &Motion, meant: &Way, written: &Way) -> bool {
    program.modes().feed != Some(Feed::InverseTime) && turns_alone(program, motion, meant, written)
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
    let refused = |block: &Block| refuse(block, 0, CompensateFault::RotaryFeed);
    let degrees = degrees(program, meant);
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

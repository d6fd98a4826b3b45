//! A straight move: whole, or subdivided where it would leave too much between its ends.

use std::io::Write;

use super::code::acts_behind;
use super::fault::CompensateFault;
use super::feed::{self, Way};
use super::lines;
use super::looks::mid_line;
use super::output::{put, put_bytes};
use super::pass::Pass;
use super::position::Position;
use super::refusal::refuse;
use super::turned;
use crate::error::Result;
use crate::few::Few;
use crate::nc::{Block, Dialect, Motion, MotionKind};

/// Most parts of a straight move.
const MOST_PARTS: usize = 4096;

/// Corrects a straight move to `target` (program coordinates, m or rad) and writes it.
pub(super) fn write(
    pass: &mut Pass,
    block: &mut Block,
    motion: &Motion,
    target: Few<f64>,
    out: &mut dyn Write,
) -> Result<()> {
    let (meant, written) = (pass.program().meant().clone(), pass.program().written().clone());
    let known = !pass.program().places().any_parked() && pass.corrector().has_last();
    let q = pass.program().joints(block, &target)?;
    let end = Position::new(q, target);
    pass.advance(block, end.q())?;
    pass.need_places(block, motion, end.q(), &|_| true)?;
    let feeds = motion.kind != MotionKind::Rapid;
    if let Some(tolerance) = pass.options().split
        && feeds
        && known
        && pass.program().dialect() != Dialect::Heidenhain
    {
        let at = |s: f64| -> Few<f64> {
            meant.program().iter().zip(end.program()).map(|(a, b)| a + (b - a) * s).collect()
        };
        // What leads out of travel is refused before it is subdivided.
        let there = pass.correct(block, end.q(), None)?;
        let mut count = 1;
        while count < MOST_PARTS && unsplit(pass, &at, count) > tolerance {
            count *= 2;
        }
        if count > 1 {
            let ways = [Way { from: &meant, to: &end }, Way { from: &written, to: there.written() }];
            if feed::is_upset(pass.program(), motion, &ways[0], &ways[1]) {
                return refuse(block, 0, CompensateFault::RotaryFeed);
            }
            pass.report().split_moves += 1;
            return lines::write(pass, (block, motion), count, &at, None, out);
        }
    }
    let correction = pass.correct(block, end.q(), Some(&motion.words))?;
    let ways = [Way { from: &meant, to: &end }, Way { from: &written, to: correction.written() }];
    if feed::turns_alone(pass.program(), motion, &ways[0], &ways[1])
        && feed::is_too_short(pass.program(), block, &ways[0], &ways[1])
        && !acts_behind(block)
    {
        let written = (&written, correction.written());
        return turned::write(pass, (block, motion), (&meant, &end), written, out);
    }
    pass.restate(block, motion)?;
    pass.put_words(block, motion, &correction)?;
    let goes = |from, to| Way { from, to };
    let meant_way = goes(&meant, &end);
    let restored =
        if feed::is_upset(pass.program(), motion, &meant_way, &goes(&written, correction.written())) {
            Some(feed::keep_time(pass.program(), block, motion, &meant_way)?)
        } else {
            None
        };
    let starts = (feeds && known).then_some([&meant, &written]);
    pass.arrive_straight(block, starts, end, correction)?;
    put(block, out)?;
    match restored {
        Some(line) => {
            let ending = if block.bytes().ends_with(b"\r\n") { "\r\n" } else { "\n" };
            let before = if block.bytes().ends_with(b"\n") { "" } else { ending };
            put_bytes(format!("{before}{line}{ending}").as_bytes(), out)
        }
        None => Ok(()),
    }
}

/// Largest error of the tip, m, that a straight move leaves in `count` equal parts, rounding aside.
fn unsplit(pass: &Pass, at: &dyn Fn(f64) -> Few<f64>, count: usize) -> f64 {
    let (program, corrector) = (pass.program(), pass.corrector());
    let control = program.control();
    let corrected = |s: f64| -> Option<(Position, Position)> {
        let coordinates = at(s);
        let q = control.joints(&coordinates, program.meant().q())?;
        let sent = corrector.sent(program, &q);
        let written = control.program(&sent, &coordinates);
        Some((Position::new(q, coordinates), Position::new(sent, written)))
    };
    let mut worst = 0.0f64;
    let Some(mut from) = corrected(0.0) else { return worst };
    for k in 1..=count {
        let Some(to) = corrected(k as f64 / count as f64) else { return worst };
        worst = worst.max(mid_line(control, corrector, (&from.0, &to.0), (&from.1, &to.1)));
        from = to;
    }
    worst
}

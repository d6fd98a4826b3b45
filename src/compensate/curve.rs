//! A move along an arc: as it is where the errors do not show in it, else as lines.

use std::io::Write;

use super::arc::Arc;
use super::fault::CompensateFault;
use super::lines::{self, not_held};
use super::motion_word::motion_byte;
use super::output::put;
use super::pass::Pass;
use super::position::Position;
use super::refusal::refuse;
use super::tip_error::TipError;
use crate::error::Result;
use crate::few::Few;
use crate::nc::{Block, Dialect, Motion};

/// Lines are not made shorter than by this factor where the correction bends.
const MOST_FINER: usize = 16;
/// Most lines that take the place of one arc.
const MOST_LINES: usize = 100_000;

/// Corrects an arc to `target` (program coordinates, m or rad) and writes it.
pub(super) fn write(
    pass: &mut Pass,
    block: &mut Block,
    motion: &Motion,
    target: Few<f64>,
    out: &mut dyn Write,
) -> Result<()> {
    let line = block.line();
    if pass.program().dialect() == Dialect::Heidenhain {
        let what = "an arc".to_string();
        return refuse(block, 0, CompensateFault::OtherMotion { what });
    }
    let arc = match Arc::of(pass.program(), block, motion, &target) {
        Ok(arc) => arc,
        Err(what) => return refuse(block, 0, CompensateFault::ArcGeometry { what }),
    };
    if !matters(pass, block, &arc)? {
        for s in arc.stations() {
            let q = pass.program().joints(block, &arc.at(s))?;
            pass.tell(line, &q);
        }
        let q = pass.program().joints(block, &target)?;
        let end = Position::new(q, target);
        pass.advance(block, end.q())?;
        let correction = pass.correct(block, end.q(), Some(&motion.words))?;
        // An axis beside the plane may come back from where it stood before.
        if correction.numbers().iter().all(|n| motion.words[n.axis()].is_none()) {
            pass.restate(block, motion)?;
            pass.put_words(block, motion, &correction)?;
            pass.arrive(block, end, correction)?;
            return put(block, out);
        }
    }
    let Some(tolerance) = pass.options().arcs else {
        return refuse(block, motion_byte(block), CompensateFault::Arc);
    };
    let count = chords(pass, block, &arc, tolerance)?;
    // Where the correction itself bends, as near a singular pose, chords of the arc are too long. What no more lines mend is told.
    let mut finer = count;
    while bends(pass, block, &arc, finer)? > tolerance {
        finer *= 2;
        if finer > MOST_LINES.min(MOST_FINER * count) {
            finer = count;
            break;
        }
    }
    let count = finer;
    pass.report().split_arcs += 1;
    pass.report().arc_lines += count as u64;
    lines::write(pass, (block, motion), count, &|s| arc.at(s), Some(&arc), out)
}

/// How many lines stay within a tolerance of the arc, m, rounding included.
fn chords(pass: &Pass, block: &Block, arc: &Arc, tolerance: f64) -> Result<usize> {
    let control = pass.program().control();
    let linear = (0..control.axes().len()).filter(|i| !control.axes()[*i].is_rotary());
    let decimals = linear.map(|i| pass.style().places(control, i)).max().unwrap_or(3);
    // Three coordinates, each off by half a digit.
    let rounding = 0.87 * control.length_si(10f64.powi(-(decimals as i32)));
    let room = 0.95 * tolerance - rounding;
    if room < 0.1 * tolerance {
        let fault = CompensateFault::ArcTolerance { tolerance_um: tolerance * 1e6, decimals };
        return refuse(block, 0, fault);
    }
    let count = arc.chords(room);
    if count > MOST_LINES {
        let what = format!("{count} lines would take its place");
        return refuse(block, 0, CompensateFault::ArcGeometry { what });
    }
    Ok(count)
}

/// Largest distance of the middle of a line from the arc, m, with so many lines in its place.
fn bends(pass: &Pass, block: &Block, arc: &Arc, count: usize) -> Result<f64> {
    let (program, control) = (pass.program(), pass.program().control());
    let (free, ways) = (program.free(), program.open_ways());
    let mut model = pass.corrector().model().ahead();
    let (mut from, mut worst) = (program.written().clone(), 0.0f64);
    let mut piece = model.piece();
    for k in 1..=count {
        let at = |s: f64| -> Result<(Few<f64>, Few<f64>)> {
            let coordinates = arc.at(s / count as f64);
            Ok((program.joints(block, &coordinates)?, coordinates))
        };
        let (q, coordinates) = at(k as f64)?;
        model.advance(&q, &ways);
        let sent = pass.corrector().solve_with(&model.chain_at(&q), program, &q, &free).commands;
        let to = Position::new(Few::from_slice(&sent), control.program(&sent, &coordinates));
        // Across a reversal the correction steps, and no line is short enough.
        let steps = std::mem::replace(&mut piece, model.piece()) != model.piece();
        if let Some(sent) = control.between(&from, &to, 0.5).filter(|_| !steps) {
            let goal = control.goal(&at(k as f64 - 0.5)?.0);
            let there = model.chain_at(&q).tool_pose(&sent) * goal.t_from_tip;
            worst = worst.max(TipError::between(there, goal.w_from_tip).m());
        }
        from = to;
    }
    Ok(worst)
}

/// Whether the correction shows in the written digits anywhere along an arc.
fn matters(pass: &Pass, block: &Block, arc: &Arc) -> Result<bool> {
    let (program, control) = (pass.program(), pass.program().control());
    let (free, ways) = (program.free(), program.open_ways());
    let mut model = pass.corrector().model().ahead();
    for s in arc.stations() {
        let coordinates = arc.at(s);
        let q = program.joints(block, &coordinates)?;
        model.advance(&q, &ways);
        let solution = pass.corrector().solve_with(model.chain(), program, &q, &free);
        if let Some(tolerance) = pass.options().arcs
            && solution.position_left_m > tolerance
        {
            return not_held(pass, block, model.chain(), &q, (solution.position_left_m, tolerance));
        }
        let written = control.program(&solution.commands, &coordinates);
        let slip = control.slip();
        for i in 0..coordinates.len() {
            let half = 0.5 * 10f64.powi(-(pass.style().places(control, i) as i32));
            let by = control.programmed(i, written[i] - slip[i]) - control.programmed(i, coordinates[i]);
            if program.places().is_placed(i) && by.abs() > half {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

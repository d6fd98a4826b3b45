//! A drilling cycle: its place is corrected in the plane, its depths and its angles stay.

use std::io::Write;

use super::fault::CompensateFault;
use super::output::put;
use super::pass::Pass;
use super::position::Position;
use super::refusal::{line_text, refuse};
use crate::error::Result;
use crate::few::Few;
use crate::nc::{Block, Distance, Motion};

/// Corrects the place of a cycle, `target` (program coordinates, m or rad), and writes it.
pub(super) fn write(
    pass: &mut Pass,
    block: &mut Block,
    motion: &Motion,
    mut target: Few<f64>,
    out: &mut dyn Write,
) -> Result<()> {
    let line = block.line();
    let repeated = block.words().iter().any(|w| matches!(w.address.as_str(), "L" | "K"));
    if pass.program().modes().distance == Some(Distance::Incremental) || repeated {
        let what = format!("the cycle `{}`", line_text(block));
        return refuse(block, 0, CompensateFault::OtherMotion { what });
    }
    let in_plane = pass.program().control().in_plane();
    let beside: Vec<usize> = (0..target.len()).filter(|i| !in_plane[*i]).collect();
    for i in &beside {
        target[*i] = pass.program().meant().program()[*i];
    }
    let q = pass.program().joints(block, &target)?;
    pass.advance(block, &q)?;
    pass.need_places(block, motion, &q, &|i| in_plane[i])?;
    let mut correction = pass.correct(block, &q, Some(&motion.words))?;
    correction.keep(&in_plane);
    let mut coordinates = Few::from_slice(correction.written().program());
    for i in &beside {
        coordinates[*i] = pass.program().written().program()[*i];
    }
    let written = Position::new(pass.program().joints(block, &coordinates)?, coordinates);
    pass.put_words(block, motion, &correction)?;
    let left = pass.corrector().distance(pass.program().control(), written.q(), &q);
    pass.report().largest_cycle_m.take(left, line);
    pass.report().cycles += 1;
    pass.put_in_force(motion.kind);
    pass.arrive_behind_cycle(Position::new(q, target), written);
    put(block, out)
}

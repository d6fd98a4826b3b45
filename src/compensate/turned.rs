//! A block that turns rotary axes alone, where its correction moves linear ones by so little that no control keeps its time in one block:
//! lines that turn, each followed by one that makes up for the tip, `docs/compensate.md` (C15).

use std::io::Write;

use super::corrector::Correction;
use super::output::put_bytes;
use super::pass::Pass;
use super::position::Position;
use super::style::{model_of, plain};
use super::words;
use crate::error::Result;
use crate::few::Few;
use crate::nc::{Block, Distance, Feed, Motion, Value};

/// How far the tip may be off before a line makes up for it, m: as far as an arc usually is.
const APART: f64 = 5e-6;
/// Most lines that turn.
const MOST: usize = 64;
/// A line that makes up takes this part of the time of one that turns, under inverse time.
const SHARE: f64 = 1e-3;

/// Writes the block. `meant`: from and to, `written`: from and to if it were one block.
pub(super) fn write(
    pass: &mut Pass,
    (block, motion): (&mut Block, &Motion),
    meant: (&Position, &Position),
    written: (&Position, &Position),
    out: &mut dyn Write,
) -> Result<()> {
    let rotary: Few<bool> = pass.program().control().axes().iter().map(|axis| axis.is_rotary()).collect();
    let linear: Few<bool> = rotary.iter().map(|rotary| !rotary).collect();
    let by = |i: usize| written.1.program()[i] - written.0.program()[i];
    let apart = (0..linear.len()).filter(|i| linear[*i]).map(|i| by(i).powi(2)).sum::<f64>().sqrt();
    let count = ((apart / APART).ceil() as usize).clamp(1, MOST);
    let inverse = match pass.program().modes().feed {
        Some(Feed::InverseTime) => block.words().iter().find(|w| w.address == "F").and_then(|w| w.number()),
        _ => None,
    };
    let ending = if block.bytes().ends_with(b"\r\n") { "\r\n" } else { "\n" };
    let model = model_of(block, &motion.words);
    let separator = motion.words.iter().flatten().next().map_or(" ", |w| block.separator(*w));
    if count > 1 {
        pass.report().split_moves += 1;
    }
    for k in 1..=count {
        let s = k as f64 / count as f64;
        let at: Few<f64> =
            meant.0.program().iter().zip(meant.1.program()).map(|(a, b)| a + (b - a) * s).collect();
        let point = match k == count {
            true => meant.1.clone(),
            false => Position::new(pass.program().joints(block, &at)?, at),
        };
        let correction = pass.correct(block, point.q(), (k == 1).then_some(&motion.words[..]))?;
        note(pass, block, &point, &correction, &rotary);
        let habits = (pass.style(), pass.program().control());
        let line = |axes: &[bool], feed: Option<f64>| {
            let text = words::line_of(correction.numbers(), axes, model, separator, habits);
            let feed = feed.map_or(String::new(), |feed| format!("{separator}F{feed:.4}"));
            if text.is_empty() { text } else { format!("{text}{feed}{ending}") }
        };
        let turning = inverse.map(|inverse| inverse * count as f64);
        let making_up = line(&linear, turning.map(|inverse| inverse / SHARE));
        if k > 1 {
            put_bytes(line(&rotary, turning).as_bytes(), out)?;
        } else {
            pass.restate(block, motion)?;
            if count > 1
                && let (Some(feed), Some(word)) = (turning, feed_word(block))
            {
                block.replace(word, &format!("{feed:.4}"))?;
            }
            stay(pass, block, motion, &linear)?;
            let mut turn = correction.clone();
            turn.keep(&rotary);
            pass.put_words(block, motion, &turn)?;
            let mut bytes = block.output();
            if !bytes.ends_with(b"\n") {
                bytes.extend_from_slice(ending.as_bytes());
            }
            put_bytes(&bytes, out)?;
        }
        pass.report().inserted_words += making_up.split_whitespace().count() as u64;
        put_bytes(making_up.as_bytes(), out)?;
        pass.arrive(block, point, correction)?;
    }
    Ok(())
}

fn feed_word(block: &Block) -> Option<usize> {
    block.words().iter().position(|w| w.address == "F")
}

/// Linear axes that the block names keep the place that is written for them.
fn stay(pass: &Pass, block: &mut Block, motion: &Motion, linear: &[bool]) -> Result<()> {
    let (program, control) = (pass.program(), pass.program().control());
    if program.modes().distance == Some(Distance::Incremental) {
        return Ok(());
    }
    let slip = control.slip();
    for i in (0..linear.len()).filter(|i| linear[*i]) {
        let Some(word) = motion.words[i] else { continue };
        let Some(number) = plain(&block.words()[word]) else { continue };
        let now = control.programmed(i, program.written().program()[i] - slip[i]);
        let places = pass.style().places(control, i).max(number.decimals);
        if matches!(block.words()[word].value, Value::Number(_)) && (now - number.value).abs() > 1e-9 {
            let text = number.write_like(now, Some(places));
            block.replace(word, &pass.style().pointed(&text))?;
        }
    }
    Ok(())
}

/// Notes how far the tip is off before the linear axes follow.
fn note(pass: &mut Pass, block: &Block, point: &Position, correction: &Correction, rotary: &[bool]) {
    let (program, control) = (pass.program(), pass.program().control());
    let choose = |i: usize| if rotary[i] { correction.written() } else { program.written() }.program()[i];
    let turned: Few<f64> = (0..rotary.len()).map(choose).collect();
    if let Some(q) = control.joints(&turned, correction.written().q()) {
        let left = pass.corrector().distance(control, &q, point.q());
        pass.report().largest_mid_line_m.take(left, block.line());
    }
}

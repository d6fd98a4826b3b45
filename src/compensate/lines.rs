//! Several lines in the place of one block.

use std::io::Write;

use super::arc::Arc;
use super::code::acts_behind;
use super::corrector::Correction;
use super::fault::CompensateFault;
use super::motion_word::{motion_byte, motion_word, straighten};
use super::output::put_bytes;
use super::pass::Pass;
use super::position::Position;
use super::refusal::refuse;
use super::style::{model_of, plain};
use super::words;
use crate::chain::Chain;
use crate::error::Result;
use crate::few::Few;
use crate::nc::{Block, Feed, Motion, MotionKind, Number, Word};

/// How the lines look beside their axis words.
struct Form {
    /// How new numbers are written.
    model: Option<Number>,
    separator: &'static str,
    /// Line end, and whether the block has it.
    ending: &'static str,
    ends: bool,
    /// Whether the block does something at its end, so that lines stand before it.
    last: bool,
    /// Feed that every line has for itself: the word in the block, and its number.
    feed: Option<(usize, String)>,
    /// What the first of the lines that stand before the block takes over from it: its modes, `G90`, before all else, and its feed
    /// behind.
    modes: Vec<String>,
    carried: Option<String>,
}

impl Form {
    fn of(block: &Block, motion: &Motion, count: usize, inverse_time: bool) -> Form {
        let word = block.words().iter().find(|w| w.address == "F");
        let moves = motion_word(block);
        let is_mode = |(i, w): &(usize, &Word)| w.address == "G" && Some(*i) != moves;
        let modes = block.words().iter().enumerate().filter(is_mode).map(|(_, w)| block.text(&w.span));
        Form {
            modes: modes.collect(),
            model: model_of(block, &motion.words),
            separator: motion.words.iter().flatten().next().map_or(" ", |w| block.separator(*w)),
            ending: if block.bytes().ends_with(b"\r\n") { "\r\n" } else { "\n" },
            ends: block.bytes().ends_with(b"\n"),
            last: acts_behind(block),
            feed: if inverse_time { shared_feed(block, count) } else { None },
            carried: word.filter(|_| !inverse_time).map(|w| block.text(&w.span)),
        }
    }

    /// A line with these axis words; `k`: its number from 1, of `count`.
    fn line(&self, mut text: String, k: usize, count: usize) -> String {
        if self.last && k == 1 {
            let words =
                self.modes.iter().cloned().chain(["G1".to_string(), text]).chain(self.carried.clone());
            text = words.collect::<Vec<_>>().join(self.separator);
        }
        if let Some((_, number)) = &self.feed {
            text = format!("{text}{}F{number}", self.separator);
        }
        if k < count || self.ends {
            text.push_str(self.ending);
        }
        text
    }
}

/// Under inverse time every line has its own F: that of the block times their number.
fn shared_feed(block: &Block, count: usize) -> Option<(usize, String)> {
    let word = block.words().iter().position(|w| w.address == "F")?;
    let number = plain(&block.words()[word])?;
    let text = number.write_like(number.value * count as f64, Some(number.decimals.max(4)));
    Some((word, text))
}

/// `count` lines in the place of one block: the block itself to the first point and lines behind it, or,
/// where it does something at its end, lines before it. `at`: program coordinates at a part of the move. `arc`: the arc
/// whose place they take, where it is one.
pub(super) fn write(
    pass: &mut Pass,
    (block, motion): (&mut Block, &Motion),
    count: usize,
    at: &dyn Fn(f64) -> Few<f64>,
    arc: Option<&Arc>,
    out: &mut dyn Write,
) -> Result<()> {
    let inverse_time = pass.program().modes().feed == Some(Feed::InverseTime);
    let form = Form::of(block, motion, count, inverse_time);
    let own = if form.last { count } else { 1 };
    for k in 1..=count {
        let s = k as f64 / count as f64;
        let program = if k == count { at(1.0) } else { at(s) };
        let q = pass.program().joints(block, &program)?;
        let point = Position::new(q, program);
        // Of a straight move the model knows the end already, and its direction is one all along.
        if arc.is_some() {
            pass.advance(block, point.q())?;
        }
        let correction = pass.correct(block, point.q(), (k == own).then_some(&motion.words[..]))?;
        if let (Some(_), Some(tolerance)) = (arc, pass.options().arcs) {
            let left =
                pass.corrector().distance(pass.program().control(), correction.written().q(), point.q());
            if left > tolerance {
                return not_held(pass, block, pass.corrector().model().chain(), point.q(), (left, tolerance));
            }
        }
        look_between(pass, block, &at(s - 0.5 / count as f64), &correction, arc.is_some())?;
        if k == own {
            if arc.is_some() {
                straighten(block, motion)?;
            }
            if let Some((word, text)) = &form.feed {
                block.replace(*word, text)?;
            }
            pass.put_words(block, motion, &correction)?;
            let mut bytes = block.output();
            if k < count && !form.ends {
                bytes.extend_from_slice(form.ending.as_bytes());
            }
            put_bytes(&bytes, out)?;
        } else {
            let habits = (pass.style(), pass.program().control());
            let text = words::line(correction.numbers(), form.model, form.separator, habits);
            if !text.is_empty() {
                put_bytes(form.line(text, k, count).as_bytes(), out)?;
            }
        }
        pass.arrive(block, point, correction)?;
    }
    pass.put_in_force(MotionKind::Linear);
    Ok(())
}

/// Notes what is left in the middle of a line, where the program means to be at `middle`.
fn look_between(
    pass: &mut Pass,
    block: &Block,
    middle: &[f64],
    correction: &Correction,
    is_arc: bool,
) -> Result<()> {
    let (program, control) = (pass.program(), pass.program().control());
    if let Some(sent) = control.between(program.written(), correction.written(), 0.5) {
        let wanted = program.joints(block, middle)?;
        let left = pass.corrector().distance(control, &sent, &wanted);
        let report = pass.report();
        let worst = if is_arc { &mut report.largest_arc_m } else { &mut report.largest_mid_line_m };
        worst.take(left, block.line());
    }
    Ok(())
}

/// Refuses an arc that leaves more than its tolerance, m; names the axes that could mend it, were they placed.
pub(super) fn not_held<T>(
    pass: &Pass,
    block: &Block,
    chain: &Chain<f64>,
    q: &[f64],
    (left, tolerance): (f64, f64),
) -> Result<T> {
    let (program, axes) = (pass.program(), pass.program().control().axes());
    let left_by = |axis: usize| {
        let mut free = program.free();
        axes[axis].command().into_iter().for_each(|(c, _)| free[c] = true);
        pass.corrector().solve_with(chain, program, q, &free).position_left_m
    };
    let absent: Vec<usize> =
        (0..axes.len()).filter(|i| !program.places().is_placed(*i) && axes[*i].command().is_some()).collect();
    let mending: Vec<usize> = absent.iter().copied().filter(|i| left_by(*i) < 0.5 * left).collect();
    // Where none mends it alone, it takes several.
    let named = if mending.is_empty() { absent } else { mending };
    let fault = CompensateFault::ArcNotHeld {
        left_um: left * 1e6,
        tolerance_um: tolerance * 1e6,
        axes: named.into_iter().map(|i| axes[i].address().to_string()).collect(),
    };
    refuse(block, motion_byte(block), fault)
}

//! One position corrected, `docs/compensate.md` (C9) to (C11), and the numbers that say so in the block.

use super::follower::{Follower, Position, Status};
use super::report::{OutOfTravel, Reversal, SingularBlock, Unreached, Unseen, UnseenPattern, UnseenPiece};
use crate::error::Result;
use crate::identify::COMPONENTS;
use crate::inverse::{Goal, Outcome};
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::Machine;
use crate::nc::{Block, Dialect, Distance, How, Number, Word};

/// A number to write for an axis.
pub(super) struct Written {
    pub axis: usize,
    pub text: String,
}

/// What a position needs: numbers that differ from what stands there, and where the machine goes by them.
pub(super) struct Correction {
    pub numbers: Vec<Written>,
    pub written: Position,
}

/// Errors of tip and axis, m and rad.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Left {
    pub m: f64,
    pub rad: f64,
}

impl Left {
    pub fn between(w_from_a: Pose<f64>, w_from_b: Pose<f64>) -> Left {
        let (a, b) = (w_from_a.rotation.column(2), w_from_b.rotation.column(2));
        let rad = a.cross(b).norm().atan2(a.dot(b));
        Left { m: (w_from_a.translation - w_from_b.translation).norm(), rad }
    }
}

impl Follower<'_> {
    pub fn goal(&self, q: &[f64]) -> Goal {
        let t_from_tip = self.control.tip();
        Goal { t_from_tip, w_from_tip: self.control.nominal.w_from_t(q) * t_from_tip }
    }

    /// What the model says is wrong where the program means `meant` and the joints are sent to `sent`.
    pub fn error(&self, sent: &[f64], meant: &[f64]) -> Left {
        let goal = self.goal(meant);
        Left::between(self.model.chain_at(meant).w_from_t(sent) * goal.t_from_tip, goal.w_from_tip)
    }

    /// Tells the model where the program goes; where that changes the piece, the step of the correction is
    /// told.
    pub fn advance(&mut self, line: usize, q: &[f64]) {
        self.tell(Some(line), q);
        if self.extrapolated != line && self.model.extrapolates(q) {
            self.extrapolated = line;
            self.report.extrapolated_moves += 1;
        }
        if let Some(piece) = self.model.unseen_piece() {
            self.report.unseen_directions.push_once(UnseenPiece { line, piece }, line);
        }
        let Some((meant, sent, piece)) = self.last.take() else { return };
        if piece != self.model.piece() {
            let free = self.free();
            let goal = self.goal(&meant);
            let again = self.inverse.solve(&self.model.chain_at(&meant), &goal, &meant, &free);
            let at = |q: &[f64]| self.control.nominal.w_from_t(q) * goal.t_from_tip;
            let step = Left::between(at(&sent), at(&again.commands));
            self.report.largest_reversal_m.take(step.m, line);
            self.report.reversals.push(Reversal { line, step_m: step.m, step_rad: step.rad });
        }
    }

    /// The joint commands that bring tip and axis of the actual machine where the program means them, and the
    /// words that say so. `q`: as meant; the model stands there already. `words`: of the block that will
    /// carry them, by axis.
    pub fn correct(
        &mut self,
        line: usize,
        q: &[f64],
        block: Option<&Block>,
        words: &[Option<usize>],
    ) -> Correction {
        let free = self.free();
        let goal = self.goal(q);
        let chain = self.model.chain_at(q).into_owned();
        let solution = self.inverse.solve(&chain, &goal, q, &free);
        let all_free = free.iter().all(|f| *f);
        match solution.outcome {
            Outcome::OutOfTravel { command, by } => {
                let joint = self.machine.commands()[command].clone();
                self.report.out_of_travel.push_once(OutOfTravel { line, joint, by }, line);
            }
            Outcome::Singular { lost_w } => {
                let lost_w = lost_w.to_array();
                let left_rad = solution.angle_left_rad;
                self.report.singular.push_once(SingularBlock { line, lost_w, left_rad }, line);
            }
            Outcome::Unreachable if all_free && solution.position_left_m > 1e-9 => {
                let (left_m, left_rad) = (solution.position_left_m, solution.angle_left_rad);
                self.report.unreachable.push_once(Unreached { line, left_m, left_rad }, line);
            }
            _ => {}
        }
        self.last = Some((q.to_vec(), solution.commands.clone(), self.model.piece()));

        let mut exact = solution.commands;
        let mut numbers = Vec::new();
        let mut program = self.written.program.clone();
        let word = |i: usize| block.zip(words.get(i).copied().flatten()).map(|(b, w)| &b.words()[w]);
        // Angles first; lengths then make up for what rounding does to them.
        let turned = self.control.program(&exact, &program);
        for i in (0..program.len()).filter(|i| self.control.axes[*i].rotary) {
            program[i] = self.number(i, turned[i], word(i), &mut numbers);
        }
        if self.control.axes.iter().any(|a| a.rotary) {
            let mut rounded = turned.clone();
            for (i, axis) in self.control.axes.iter().enumerate() {
                if axis.rotary {
                    rounded[i] = program[i];
                }
            }
            if let Some(there) = self.control.joints(&rounded, &exact) {
                let slides: Vec<bool> = (0..free.len()).map(|c| free[c] && self.is_prismatic(c)).collect();
                if slides.iter().filter(|s| **s).count() == 3 {
                    let again = self.slides.solve(&chain, &goal, &there, &slides);
                    exact = again.commands;
                } else {
                    exact = there;
                }
            }
        }
        let moved = self.control.program(&exact, &program);
        for i in (0..program.len()).filter(|i| !self.control.axes[*i].rotary) {
            program[i] = self.number(i, moved[i], word(i), &mut numbers);
        }
        let q = self.control.joints(&program, &exact).unwrap_or(exact);
        Correction { numbers, written: Position { q, program } }
    }

    /// The number to write for an axis that should stand at `wanted` (program coordinates, m or rad), if
    /// another one than there is; returns where it then stands.
    fn number(&self, axis: usize, wanted: f64, word: Option<&Word>, numbers: &mut Vec<Written>) -> f64 {
        let now = self.written.program[axis];
        let places = self.places(axis);
        let modal = if self.state.modes().distance == Some(Distance::Incremental) {
            How::Incremental
        } else {
            How::Absolute
        };
        let how = word.map_or(modal, |w| self.how(w.how));
        let mut value = self.control.programmed(axis, wanted);
        let from = self.control.programmed(axis, now);
        match how {
            How::Incremental => value -= from,
            How::Shortest | How::Positive | How::Negative => value = value.rem_euclid(360.0),
            _ => {}
        }
        let places = places.max(word.and_then(plain).map_or(0, |n| n.decimals));
        let half = 0.500_001 * 10f64.powi(-(places as i32));
        let stands = |number: f64| match how {
            How::Incremental => self.control.si(axis, from + number),
            How::Shortest | How::Positive | How::Negative => wanted + self.control.si(axis, number - value),
            _ => self.control.si(axis, number),
        };
        match word.and_then(plain) {
            Some(number) => {
                if (value - number.value).abs() <= half {
                    return stands(number.value);
                }
                let text = number.write_like(value, Some(places));
                let Some(written) = Number::parse(text.as_bytes(), Dialect::Heidenhain) else { return now };
                numbers.push(Written { axis, text });
                stands(written.value)
            }
            None => {
                let same = match how {
                    How::Incremental => value.abs() <= half,
                    _ => (value - from).abs() <= half,
                };
                if same || self.status[axis] != Status::Placed || self.control.axes[axis].command.is_none() {
                    return now;
                }
                let text = format!("{value:.places$}");
                let Some(written) = Number::parse(text.as_bytes(), Dialect::Rs274) else { return now };
                numbers.push(Written { axis, text });
                stands(written.value)
            }
        }
    }

    /// Puts numbers into a block: in the place of those that stand there, as new words for axes that it does
    /// not name.
    pub fn apply(&mut self, block: &mut Block, words: &[Option<usize>], numbers: &[Written]) -> Result<()> {
        let style = words.iter().flatten().next().and_then(|w| plain(&block.words()[*w]));
        for Written { axis, text } in numbers {
            let pointed = |text: String| if self.comma { text.replace('.', ",") } else { text };
            if let Some(word) = words[*axis] {
                block.replace(word, &pointed(text.clone()))?;
                self.report.corrected_words += 1;
                continue;
            }
            let address = self.control.axes[*axis].address.clone();
            let text = pointed(self.restyle(text, style, *axis));
            // Behind the nearest axis before it, else before the first one, else at the end.
            let before = words[..*axis].iter().rev().flatten().next().copied();
            let behind = words[*axis..].iter().flatten().next().copied();
            match (before, behind) {
                (Some(word), _) => block.insert(word, &address, &text)?,
                (None, Some(word)) => block.insert_before(word, &address, &text)?,
                (None, None) => match block.words().len().checked_sub(1) {
                    Some(last) => block.insert(last, &address, &text)?,
                    None => continue,
                },
            }
            self.report.inserted_words += 1;
        }
        Ok(())
    }

    /// A number as its neighbour is written.
    fn restyle(&self, text: &str, style: Option<Number>, axis: usize) -> String {
        match (style, text.parse::<f64>()) {
            (Some(style), Ok(value)) => {
                let places = self.places(axis);
                style.write_like(value, Some(places))
            }
            _ => text.to_string(),
        }
    }

    /// The words of a line of its own.
    pub fn line(&self, numbers: &[Written], style: Option<Number>, separator: &str) -> String {
        let mut sorted: Vec<&Written> = numbers.iter().collect();
        sorted.sort_by_key(|n| n.axis);
        let words = sorted.into_iter().map(|Written { axis, text }| {
            let address = &self.control.axes[*axis].address;
            let equals = if address.len() > 1 { "=" } else { "" };
            format!("{address}{equals}{}", self.restyle(text, style, *axis))
        });
        words.collect::<Vec<_>>().join(separator)
    }

    /// Takes a corrected position as reached.
    pub fn arrive(&mut self, line: usize, meant: Position, written: Position) {
        // Where an axis stands at a place of the machine, the tip is nowhere that matters.
        if self.status.iter().all(|s| *s != Status::Parked) {
            let left = self.error(&written.q, &meant.q);
            self.report.largest_left_m.take(left.m, line);
            self.report.largest_left_rad.take(left.rad, line);
        }
        let t_from_tip = self.control.tip();
        let at = |q: &[f64]| self.control.nominal.w_from_t(q) * t_from_tip;
        let correction = Left::between(at(&written.q), at(&meant.q));
        self.report.largest_correction_m.take(correction.m, line);
        self.report.largest_correction_rad.take(correction.rad, line);
        self.look_at_unseen(&written.q);
        (self.meant, self.written) = (meant, written);
    }

    /// (C13): what each unseen pattern would do to tip and axis here.
    fn look_at_unseen(&mut self, q: &[f64]) {
        let Some(patterns) = self.model.unseen().filter(|p| !p.is_empty()) else { return };
        let sweep = self.control.nominal.sweep(q);
        let w_from_tip = sweep.w_from_t() * self.control.tip();
        let axis = w_from_tip.rotation.column(2);
        self.unseen.resize(patterns.len(), Left::default());
        self.unseen_moves += 1;
        for (sum, pattern) in self.unseen.iter_mut().zip(patterns) {
            // (1): the error twist of the tool, seen from the workpiece.
            let zero = Vec3([0.0; 3]);
            let mut twist = Twist::new(zero, zero);
            for (j, dh) in pattern.iter().enumerate() {
                let w_from_frame = sweep.b_from_w().inverse() * sweep.b_from_frame(j);
                twist = twist + w_from_frame.carry_twist(*dh).times(self.machine.branch(j).sign());
            }
            let tip = twist.v + twist.w.cross(w_from_tip.translation);
            sum.m += tip.dot(tip);
            sum.rad += twist.w.cross(axis).norm().powi(2);
        }
    }

    /// What the patterns did over all moves, largest first.
    pub fn unseen_report(&self) -> Option<Unseen> {
        let patterns = self.model.unseen()?;
        let mean = |sum: f64| (sum / self.unseen_moves.max(1) as f64).sqrt();
        let total = |of: fn(&Left) -> f64| mean(self.unseen.iter().map(of).sum());
        let mut listed: Vec<UnseenPattern> = (self.unseen.iter().zip(patterns))
            .map(|(sum, pattern)| UnseenPattern {
                mostly: mostly(self.machine, pattern),
                tip_m: mean(sum.m),
                axis_rad: mean(sum.rad),
            })
            .collect();
        // A turn counts with a lever of 0.1 m.
        let size = |p: &UnseenPattern| p.tip_m.hypot(0.1 * p.axis_rad);
        listed.sort_by(|a, b| size(b).total_cmp(&size(a)));
        Some(Unseen { tip_m: total(|l| l.m), axis_rad: total(|l| l.rad), patterns: listed })
    }

    /// The joints at a part `s` of a straight move, as the control moves them.
    pub fn between(&self, a: &Position, b: &Position, s: f64) -> Option<Vec<f64>> {
        let mix =
            |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a + (b - a) * s).collect() };
        let q = mix(&a.q, &b.q);
        if !self.control.tcp {
            return Some(q);
        }
        self.control.joints(&mix(&a.program, &b.program), &q)
    }
}

/// The largest components of a pattern, in units of their tolerances.
fn mostly(machine: &Machine, pattern: &[Twist<f64>]) -> Vec<String> {
    let mut parts: Vec<(f64, String)> = Vec::new();
    for (j, twist) in pattern.iter().enumerate() {
        let sizes = twist.to_array().into_iter().zip(machine.tolerance(j).to_array());
        for (name, (value, tolerance)) in COMPONENTS.iter().zip(sizes) {
            parts.push(((value / tolerance).abs(), format!("{}.{name}", machine.dyads()[j].frame)));
        }
    }
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let least = 0.5 * parts.first().map_or(0.0, |p| p.0);
    parts.into_iter().take(3).filter(|p| p.0 > least).map(|p| p.1).collect()
}

/// The number of a word.
pub(super) fn plain(word: &Word) -> Option<Number> {
    match word.value {
        crate::nc::Value::Number(number) => Some(number),
        crate::nc::Value::Expression => None,
    }
}

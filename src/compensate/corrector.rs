//! The corrector: from a meant position to corrected joint commands, and to the numbers that say so,
//! `docs/compensate.md` (C9) to (C11).

use std::borrow::Cow;
use std::collections::VecDeque;

use super::control::Control;
use super::interpreter::Interpreter;
use super::model::Model;
use super::position::Position;
use super::style::{Style, plain};
use super::tip_error::TipError;
use crate::calibration::LeftOut;
use crate::chain::Chain;
use crate::decimal::{self, Text, fixed};
use crate::few::Few;
use crate::inverse::{Foreseen, Goal, Inverse, Mode, Solution, foresee};
use crate::lie::{Twist, Vec3};
use crate::machine::{JointKind, Machine};
use crate::nc::{Block, Dialect, How, Number, Word};

/// A number to write for an axis.
#[derive(Clone)]
pub(super) struct AxisNumber {
    axis: usize,
    text: Text,
}

impl AxisNumber {
    /// Index of the axis.
    pub fn axis(&self) -> usize {
        self.axis
    }

    /// Programmed units, with a decimal point.
    pub fn text(&self) -> &str {
        std::str::from_utf8(self.ascii()).unwrap_or_default()
    }

    /// As [`AxisNumber::text`].
    pub fn ascii(&self) -> &[u8] {
        &self.text
    }
}

/// What a position needs.
#[derive(Clone)]
pub(super) struct Correction {
    goal: Goal,
    numbers: Vec<AxisNumber>,
    written: Position,
    solution: Solution,
}

impl Correction {
    /// Where tip and tool axis should be.
    pub fn goal(&self) -> &Goal {
        &self.goal
    }

    /// Numbers that differ from what stands there.
    pub fn numbers(&self) -> &[AxisNumber] {
        &self.numbers
    }

    /// Where the control takes the machine by them.
    pub fn written(&self) -> &Position {
        &self.written
    }

    /// How the inverse came out, before rounding.
    pub fn solution(&self) -> &Solution {
        &self.solution
    }

    /// Only the numbers of these axes, by axis.
    pub fn keep(&mut self, axes: &[bool]) {
        self.numbers.retain(|n| axes[n.axis]);
    }

    /// Where the control takes the machine, when nothing else is asked.
    pub fn into_written(self) -> Position {
        self.written
    }
}

/// A position corrected, before rounding.
#[derive(Clone, PartialEq)]
pub(super) struct Corrected {
    meant: Few<f64>,
    sent: Few<f64>,
    /// The piece that it belongs to.
    piece: usize,
}

/// Positions that may have been foreseen and are left out.
const FORESEEN: usize = 4;

/// Each time the correction is found anew, what is still wrong with it shrinks by the slope of the errors, which is a few percent for the
/// steepest waves of gears; twice makes nothing of a micrometre.
const SETTLING: usize = 2;

/// What finds joint commands.
#[derive(Clone)]
pub(super) struct Solvers<'a> {
    machine: &'a Machine,
    inverse: Inverse<'a>,
    /// For the linear joints alone.
    slides: Inverse<'a>,
}

impl<'a> Solvers<'a> {
    /// `mode`: what counts, where it is not what the machine has joints for.
    pub fn new(machine: &'a Machine, mode: Option<Mode>) -> Self {
        let inverse = Inverse::new(machine);
        let inverse = mode.map_or(inverse.clone(), |mode| inverse.with_mode(mode));
        let slides = inverse.with_mode(Mode::Position);
        Solvers { machine, inverse, slides }
    }
}

/// A machine with its errors, and the inverse of it.
pub(super) struct Corrector<'a, 'm> {
    machine: &'a Machine,
    model: &'m mut dyn Model,
    solvers: &'m Solvers<'a>,
    last: Option<Corrected>,
    /// Positions that lie ahead, looked at beforehand, in the order in which they come.
    foreseen: VecDeque<Foreseen>,
}

impl<'a, 'm> Corrector<'a, 'm> {
    /// Behind a position that was corrected, if one was; the model stands there.
    pub fn behind(last: Option<Corrected>, model: &'m mut dyn Model, solvers: &'m Solvers<'a>) -> Self {
        Corrector { machine: solvers.machine, model, solvers, last, foreseen: VecDeque::new() }
    }

    /// Looks at positions that lie ahead, as the program means them; whether a position is one of them shows when it comes.
    pub fn foresee(&mut self, control: &Control, meant: &[Few<f64>]) {
        let Some(first) = meant.first() else { return };
        let found = match self.model.chain_at(first) {
            Cow::Borrowed(chain) => {
                foresee(&self.solvers.inverse, (control.nominal(), chain), control.tip(), meant)
            }
            // Errors that bend from place to place are looked at there.
            Cow::Owned(_) => return,
        };
        self.foreseen = found.into();
    }

    /// What was foreseen of a position, if it was; told once.
    fn foreseen(&mut self, control: &Control, meant: &[f64], free: &[bool]) -> Option<(Goal, Solution)> {
        let is_same = |a: &[f64]| a.iter().zip(meant).all(|(a, b)| a.to_bits() == b.to_bits());
        let at = self.foreseen.iter().take(FORESEEN).position(|next| is_same(&next.meant))?;
        (0..at).for_each(|_| drop(self.foreseen.pop_front()));
        let is_wanted =
            |next: &Foreseen| next.goal.t_from_tip == control.tip() && free.iter().all(|free| *free);
        if !self.foreseen.front().is_some_and(is_wanted) {
            return None;
        }
        self.foreseen.pop_front().map(|next| (next.goal, next.solution))
    }

    /// The position that was corrected last.
    pub fn into_last(self) -> Option<Corrected> {
        self.last
    }

    pub fn machine(&self) -> &'a Machine {
        self.machine
    }

    /// The machine's errors where it stands.
    pub fn model(&self) -> &dyn Model {
        &*self.model
    }

    /// Whether a position has been corrected since the machine was told to go on.
    pub fn has_last(&self) -> bool {
        self.last.is_some()
    }

    /// Tells the model where the machine goes, and by which ways.
    pub fn advance(&mut self, q: &[f64], ways: &[bool]) {
        self.model.advance(q, ways);
    }

    /// By how much the last position would be corrected otherwise by what holds now; `None` where the piece is the same.
    pub fn step(&mut self, program: &Interpreter) -> Option<TipError> {
        let last = self.last.take()?;
        if last.piece == self.model.piece() {
            return None;
        }
        let control = program.control();
        let (_, again) = self.settle(&control.goal(&last.meant), &last.meant, &program.free());
        Some(TipError::between(control.tip_pose(&last.sent), control.tip_pose(&again.commands)))
    }

    /// How far the tip is off by the model, m, where the program means `meant` and the joints are sent to `sent`.
    pub fn distance(&self, control: &Control, sent: &[f64], meant: &[f64]) -> f64 {
        let tip_t = control.tip().translation;
        let there = self.model.chain_at(sent).tool_point(sent, tip_t);
        (there - control.nominal().tool_point(meant, tip_t)).norm()
    }

    /// Where the tip is by the model in frame `w`, m, where the joints are sent to each of `sent`.
    pub fn tips_w<const N: usize>(&self, control: &Control, sent: &[Few<f64>; N]) -> [Vec3<f64>; N] {
        let tip_t = control.tip().translation;
        let chains: [_; N] = std::array::from_fn(|k| self.model.chain_at(&sent[k]));
        let chain = self.model.chain();
        let is_same =
            |other: &Cow<Chain<f64>>| matches!(other, Cow::Borrowed(other) if std::ptr::eq(*other, chain));
        if chains.iter().all(is_same) {
            return chain.tool_points(sent, tip_t);
        }
        std::array::from_fn(|k| chains[k].tool_point(&sent[k], tip_t))
    }

    /// What the model says is wrong where the joints are sent to `sent`.
    pub fn error(&self, goal: &Goal, sent: &[f64]) -> TipError {
        TipError::between(self.model.chain_at(sent).tool_pose(sent) * goal.t_from_tip, goal.w_from_tip)
    }

    /// The chain that holds where the joints are sent so that tip and axis are where `meant` has them, and those joint commands. Errors
    /// belong to the position that is sent, which the correction itself moves a little.
    fn settle(&self, goal: &Goal, meant: &[f64], free: &[bool]) -> (Cow<'_, Chain<f64>>, Solution) {
        let mut chain = self.model.chain_at(meant);
        let mut solution = self.solvers.inverse.solve(&chain, goal, meant, free);
        for _ in 0..SETTLING {
            let there = self.model.chain_at(&solution.commands);
            if matches!(there, Cow::Borrowed(_)) {
                break;
            }
            chain = there;
            solution = self.solvers.inverse.solve(&chain, goal, meant, free);
        }
        (chain, solution)
    }

    /// The joint commands that bring tip and axis of the actual machine where `meant` has them.
    pub fn sent(&self, program: &Interpreter, meant: &[f64]) -> Few<f64> {
        self.settle(&program.control().goal(meant), meant, &program.free()).1.commands.into()
    }

    /// The joint commands that bring tip and axis of a machine with this chain where `meant` has them, with these commands free.
    pub fn solve_with(
        &self,
        chain: &Chain<f64>,
        program: &Interpreter,
        meant: &[f64],
        free: &[bool],
    ) -> Solution {
        self.solvers.inverse.solve(chain, &program.control().goal(meant), meant, free)
    }

    /// The joint commands that bring tip and axis of the actual machine where the program means them, and the
    /// words that say so. `q`: as meant; the model stands there already. `block` will carry them in its `words`, by axis.
    pub fn correct(
        &mut self,
        program: &Interpreter,
        style: &Style,
        q: &[f64],
        block: Option<&Block>,
        words: &[Option<usize>],
    ) -> Correction {
        let control = program.control();
        let free = program.free();
        let foreseen = self.foreseen(control, q, &free);
        let (goal, chain, solution) = match foreseen {
            Some((goal, solution)) => (goal, self.model.chain_at(q), solution),
            None => {
                let goal = control.goal(q);
                let (chain, solution) = self.settle(&goal, q, &free);
                (goal, chain, solution)
            }
        };
        let mut exact: Few<f64> = Few::from_slice(&solution.commands);
        let (slip, mut numbers) = (control.slip(), Vec::with_capacity(control.axes().len()));
        let mut coordinates = Few::from_slice(program.written().program());
        let word = |i: usize| block.zip(words.get(i).copied().flatten()).map(|(b, w)| &b.words()[w]);
        let rotary = |i: usize| control.axes()[i].is_rotary();
        // Angles first; lengths then make up for what rounding does to them.
        let turned = control.angles(&exact, &coordinates);
        for i in (0..coordinates.len()).filter(|i| rotary(*i)) {
            coordinates[i] = number((program, style), (i, slip[i]), turned[i], word(i), &mut numbers);
        }
        if (0..coordinates.len()).any(rotary) {
            let mut slides = Few::from_slice(&free);
            slides.iter_mut().enumerate().for_each(|(c, free)| *free &= self.is_prismatic(c));
            if slides.iter().filter(|s| **s).count() == 3 {
                let there = control.turned(&exact, &coordinates);
                let slid = self.solvers.slides.slide(&chain, &goal, &there, &slides);
                exact = slid.unwrap_or_else(|| {
                    self.solvers.slides.solve(&chain, &goal, &there, &slides).commands.into()
                });
            } else {
                let mut rounded = control.program(&exact, &coordinates);
                for i in (0..coordinates.len()).filter(|i| rotary(*i)) {
                    rounded[i] = coordinates[i];
                }
                exact = control.joints(&rounded, &exact).unwrap_or(exact);
            }
        }
        let moved = control.program(&exact, &coordinates);
        for i in (0..coordinates.len()).filter(|i| !rotary(*i)) {
            coordinates[i] = number((program, style), (i, slip[i]), moved[i], word(i), &mut numbers);
        }
        drop(chain);
        let (meant, sent) = (Few::from_slice(q), Few::from_slice(&solution.commands));
        self.last = Some(Corrected { meant, sent, piece: self.model.piece() });
        let q = control.joints(&coordinates, &exact).unwrap_or(exact);
        Correction { goal, numbers, written: Position::new(q, coordinates), solution }
    }

    /// Axes that the correction of `q` would move if it were known where they stand; only those asked of by `is_asked`.
    pub fn wants(
        &self,
        program: &Interpreter,
        style: &Style,
        q: &[f64],
        is_asked: &dyn Fn(usize) -> bool,
    ) -> Vec<usize> {
        let (control, places) = (program.control(), program.places());
        let asked =
            |i: &usize| !places.is_placed(*i) && control.axes()[*i].command().is_some() && is_asked(*i);
        let unplaced: Vec<usize> = (0..places.len()).filter(asked).collect();
        if unplaced.is_empty() {
            return unplaced;
        }
        let mut free = program.free();
        // Where a rotary axis stands decides on the correction of all others.
        let (mut wanted, slides): (Vec<usize>, Vec<usize>) =
            unplaced.into_iter().partition(|i| control.axes()[*i].is_rotary());
        wanted.retain(|i| places.is_parked(*i) && !places.is_sure(*i));
        for command in slides.iter().filter_map(|i| control.axes()[*i].command()) {
            free[command.0] = true;
        }
        // Where they are unknown, what matters is by how much they would be moved.
        let stands = control.program(q, program.written().program());
        let moved = control.program(&self.settle(&control.goal(q), q, &free).1.commands, &stands);
        let half = |i: usize| 0.5 * control.si(i, 10f64.powi(-(style.places(control, i) as i32))).abs();
        wanted.extend(slides.into_iter().filter(|i| (moved[*i] - stands[*i]).abs() > half(*i)));
        wanted.sort_unstable();
        wanted
    }

    fn is_prismatic(&self, command: usize) -> bool {
        self.machine.command_joint(command).kind == JointKind::Prismatic
    }

    /// Deviations that no recording has shown, as [`Model::unseen`].
    pub fn unseen(&self) -> Option<&[Vec<Twist<f64>>]> {
        self.model.unseen()
    }

    /// Effects that are not corrected, and those that are corrected in one state.
    pub fn reservations(&self) -> (&[LeftOut], &[LeftOut]) {
        (self.model.left_out(), self.model.held())
    }
}

/// The number to write for an axis that should stand at `wanted` (program coordinates, m or rad), if
/// another one than there is; returns where it then stands. `slip`: of the axis, as [`Control::slip`].
fn number(
    (program, style): (&Interpreter, &Style),
    (axis, slip): (usize, f64),
    wanted: f64,
    word: Option<&Word>,
    numbers: &mut Vec<AxisNumber>,
) -> f64 {
    let control = program.control();
    let now = program.written().program()[axis];
    let how = program.meaning(word.map_or(How::Modal, |w| w.how));
    let mut value = control.programmed(axis, wanted - slip);
    let from = control.programmed(axis, now - slip);
    match how {
        How::Incremental => value -= from,
        How::Shortest | How::Positive | How::Negative => value = value.rem_euclid(360.0),
        _ => {}
    }
    let places = style.places(control, axis).max(word.and_then(plain).map_or(0, |n| n.decimals));
    let half = 0.500_001 * decimal::unit(places);
    let stands = |number: f64| match how {
        How::Incremental => slip + control.si(axis, from + number),
        How::Shortest | How::Positive | How::Negative => wanted + control.si(axis, number - value),
        _ => slip + control.si(axis, number),
    };
    let text = match word.and_then(plain) {
        Some(number) => {
            if (value - number.value).abs() <= half {
                return stands(number.value);
            }
            if let Some((text, written)) = number.rounded_like(value, Some(places)) {
                numbers.push(AxisNumber { axis, text });
                return stands(written);
            }
            number.write_like(value, Some(places))
        }
        None => {
            let same = match how {
                How::Incremental => value.abs() <= half,
                _ => (value - from).abs() <= half,
            };
            if same || !program.places().is_placed(axis) || control.axes()[axis].command().is_none() {
                return now;
            }
            fixed(value, places)
        }
    };
    // With the comma of those that write one.
    let Some(written) = Number::parse(text.as_bytes(), Dialect::Heidenhain) else { return now };
    numbers.push(AxisNumber { axis, text: Text::from_slice(text.as_bytes()) });
    stands(written.value)
}

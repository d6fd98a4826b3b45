//! What stays in force from block to block, and where a block moves.

use std::collections::BTreeSet;

use super::axes::{Axes, is_linear};
use super::block::Block;
use super::dialect::Dialect;
use super::dialects::vocabulary;
use super::effects::{Effects, Purpose, Reading};
use super::fault::NcFault;
use super::modes::{Coordinate, Modes, MotionKind, Why};
use super::motion::{Motion, Step};
use super::token::Kind;
use super::unfollowed::{Known, unknown_functions};
use super::vocabulary::Action;
use crate::error::Result;
use crate::few::Few;

/// Modal state of a program, followed block by block.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    dialect: Dialect,
    axes: Axes,
    modes: Modes,
    /// Names that the program has declared as variables.
    declared: BTreeSet<String>,
}

impl State {
    /// Nothing programmed yet. `addresses`: of the axes to follow, `X`, `C1`; those that begin with A, B or C are rotary.
    pub fn new(dialect: Dialect, addresses: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let addresses: Vec<String> =
            addresses.into_iter().map(|a| Into::<String>::into(a).to_ascii_uppercase()).collect();
        State { dialect, axes: Axes::new(addresses), modes: Modes::default(), declared: BTreeSet::new() }
    }

    /// The addresses that are followed.
    pub fn addresses(&self) -> &[String] {
        self.axes.addresses()
    }

    /// What is in force.
    pub fn modes(&self) -> &Modes {
        &self.modes
    }

    /// The programmed position of each address.
    pub fn coordinates(&self) -> &[Coordinate] {
        self.axes.coordinates()
    }

    /// The programmed position of each address, programmed units, where it is known.
    pub fn target(&self) -> Vec<Option<f64>> {
        self.axes.target().into_vec()
    }

    /// Takes one block into account.
    ///
    /// What may move the machine or shift its frame makes coordinates [`Coordinate::Lost`] rather than wrong. Work offsets
    /// that are named for the first time, rotations and tool changes leave rotary axes known.
    ///
    /// # Errors
    /// [`NcFault::TwiceInBlock`] with line and column; the state then stands as before the block.
    pub fn apply(&mut self, block: &Block) -> Result<Step> {
        let words = self.axis_words(block);
        // Only a block that names an axis twice may have to be taken back.
        let double =
            twice(&words).map(|double| (double, self.modes.clone(), self.axes.coordinates().to_vec()));
        let mut effects = Effects::new(self.dialect, &mut self.modes, &mut self.axes);
        effects.names(block);
        effects.codes(block, words.iter().any(|named| named.first.is_some()));
        let mut reading = effects.finish();
        if reading.purpose == Purpose::Target
            && let Some(((axis, first, second), modes, coordinates)) = double
        {
            self.modes = modes;
            self.axes.restore(coordinates);
            let (first, at) =
                (block.column(block.words()[first].span.start), block.words()[second].span.start);
            let address = self.axes.addresses()[axis].clone();
            return Err(block.fault(at, NcFault::TwiceInBlock { address, first }));
        }
        self.declare(block);
        let known = Known {
            dialect: self.dialect,
            vocabulary: vocabulary(self.dialect),
            axes: self.axes.addresses(),
            declared: &self.declared,
            targets: reading.purpose != Purpose::Nothing,
        };
        reading.step.unfollowed = known.first_unfollowed(block);
        reading.step.unknown_functions = unknown_functions(block, known.vocabulary);
        self.place(block, &words, &mut reading);
        Ok(reading.step)
    }

    /// The short way through [`State::apply`] for a block that can change no more than where axes are, the motion and the feed, and where
    /// none is called behind blocks that move: how it moves, if it does. `None`, and nothing changed, where it takes the long way to tell.
    pub(crate) fn apply_plain(&mut self, block: &Block) -> Option<Option<Motion>> {
        let vocabulary = vocabulary(self.dialect);
        let (mut words, mut stated) = (Few::from_elem(None, self.axes.addresses().len()), None);
        let mut moves = false;
        for (index, word) in block.words().iter().enumerate() {
            if word.address == "F" {
                continue;
            }
            if word.address == "G" {
                let Some(Action::Motion(kind)) = vocabulary.g(word.number()?) else { return None };
                stated = Some(kind);
                continue;
            }
            let axis = self.axes.addresses().iter().position(|address| word.address == *address)?;
            if words[axis].replace(index).is_some() {
                return None;
            }
            moves = true;
        }
        let kind = stated.or(self.modes.motion).unwrap_or(MotionKind::Unstated);
        if kind == MotionKind::Cycle {
            return None;
        }
        self.modes.motion = stated.or(self.modes.motion);
        let line = block.line();
        for (axis, word) in words.iter().enumerate() {
            if let Some(word) = *word {
                self.axes.go(axis, &block.words()[word], &self.modes, line);
            }
        }
        Some(moves.then(|| Motion { line, kind, target: self.axes.target(), words, machine_frame: false }))
    }

    /// Takes up what a declaration names.
    fn declare(&mut self, block: &Block) {
        let mut tokens = block.tokens().iter();
        let declares = |name: &str| matches!(name, "DEF" | "REDEF" | "PROC" | "DECLARE");
        if !tokens.any(|t| t.kind == Kind::Name && declares(&block.name(t))) {
            return;
        }
        for token in tokens.filter(|t| t.kind == Kind::Other) {
            let text = block.text(&token.span).to_ascii_uppercase();
            let names =
                text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').filter(|name| name.len() > 1);
            self.declared.extend(names.map(String::from));
        }
    }

    /// The words of the block that name axis after axis.
    fn axis_words(&self, block: &Block) -> Few<Named> {
        let of = |address: &String| {
            let mut named = (0..block.words().len()).filter(|i| block.words()[*i].address == *address);
            Named { first: named.next(), second: named.next() }
        };
        self.axes.addresses().iter().map(of).collect()
    }

    /// Moves, or gives the axis words their other meaning.
    fn place(&mut self, block: &Block, words: &[Named], reading: &mut Reading) {
        let line = block.line();
        if let Some(kind) = reading.kind {
            self.modes.motion = Some(kind);
        }
        let kind = self.modes.motion.unwrap_or(MotionKind::Unstated);
        let named = |axis: usize| words[axis].first;
        match reading.purpose {
            Purpose::Nothing => return,
            Purpose::Reference => {
                let all = words.iter().all(|named| named.first.is_none());
                for axis in 0..words.len() {
                    if all || named(axis).is_some() {
                        self.axes.lose_one(axis, line, Why::Reference);
                    }
                }
                return;
            }
            Purpose::Preset => {
                for axis in 0..words.len() {
                    if let Some(word) = named(axis) {
                        self.axes.preset(axis, block.words()[word].number(), line);
                    }
                }
                return;
            }
            Purpose::Target => {}
        }
        let polar: &[&str] = if self.dialect == Dialect::Heidenhain { &["PR", "PA"] } else { &["AP", "RP"] };
        let by_polar = self.dialect != Dialect::Rs274 && polar.iter().any(|a| block.has_word(a));
        let direction = ["A2", "B2", "C2", "A3", "B3", "C3", "LEAD", "TILT", "TX", "TY", "TZ"];
        let by_direction = self.dialect != Dialect::Rs274
            && direction.iter().any(|a| block.has_word(a) && !self.axes.addresses().iter().any(|o| o == a));
        let is_arc = matches!(kind, MotionKind::ArcCw | MotionKind::ArcCcw);
        let by_centre = is_arc && ["I", "J", "K", "R", "CR", "AR", "TURN"].iter().any(|a| block.has_word(a));
        if !(words.iter().any(|named| named.first.is_some()) || by_polar || by_direction || by_centre) {
            return;
        }
        for axis in 0..words.len() {
            if let Some(word) = named(axis) {
                self.axes.go(axis, &block.words()[word], &self.modes, line);
            }
        }
        if by_polar {
            self.axes.lose(line, Why::OtherWords, is_linear);
        }
        if by_direction {
            self.axes.lose(line, Why::OtherWords, |a| !is_linear(a));
        }
        let target = self.axes.target();
        // What is known of the place behind the block.
        for axis in 0..words.len() {
            if named(axis).is_none() {
                continue;
            }
            if reading.machine_frame {
                self.axes.lose_one(axis, line, Why::MachineFrame);
            } else if reading.probes {
                self.axes.lose_one(axis, line, Why::Reference);
            }
        }
        if self.modes.modal_call {
            reading.step.calls = true;
        }
        if kind == MotionKind::Cycle || self.modes.modal_call {
            let normal = self.modes.normal();
            self.axes.lose(line, Why::Call, |a| a.starts_with(normal));
        }
        let words = words.iter().map(|named| named.first).collect();
        let machine_frame = reading.machine_frame;
        reading.step.motion = Some(Motion { line, kind, target, words, machine_frame });
    }
}

/// The words of a block that name one axis.
#[derive(Clone, Copy)]
struct Named {
    first: Option<usize>,
    second: Option<usize>,
}

/// The axis that two words name, and these words.
fn twice(words: &[Named]) -> Option<(usize, usize, usize)> {
    words.iter().enumerate().find_map(|(axis, named)| Some((axis, named.first?, named.second?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_short_way_is_as_the_long_one() {
        let program = "G21 G90\nG1 X1 Y2 F100\nX3 A-4\nF20\nG0\nG91\nX1 Z.5\nG90 X5\nX#1\nX2\nX1 X2\nW3\nG81 X1 R2 Z-3\nX4\nG80\nZ1\nG2 X1 Y1 R5\nX2\nQ1\n";
        for dialect in [Dialect::Rs274, Dialect::Siemens, Dialect::Heidenhain] {
            let mut long = State::new(dialect, ["X", "Y", "Z", "A"]);
            let mut taken = 0;
            for (line, text) in program.lines().enumerate() {
                let block = Block::new(line + 1, text.as_bytes(), dialect);
                let (before, mut short) = (long.clone(), long.clone());
                let step = long.apply(&block);
                if !block.is_plain_motion() || before.modes.modal_call {
                    continue;
                }
                match short.apply_plain(&block) {
                    Some(motion) => {
                        taken += 1;
                        assert_eq!(
                            Ok(Step { motion, ..Step::default() }),
                            step.map_err(|e| e.to_string()),
                            "{text}"
                        );
                        assert_eq!(short, long, "{text}");
                    }
                    None => assert_eq!(short, before, "{text}"),
                }
            }
            assert!(taken > 5, "{dialect:?}: {taken}");
        }
    }
}

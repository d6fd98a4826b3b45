//! What stays in force from block to block, and where a block moves.

use super::{Block, Coordinate, Dialect, Distance, How, Modes, MotionKind, NcFault, Why, Word};
use crate::error::Result;

/// A block that moves. Lists are in the order of the addresses given to [`State::new`].
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Its line, from 1.
    pub line: usize,
    /// How it moves.
    pub kind: MotionKind,
    /// Where it starts, programmed units; `None` where that is not known.
    pub start: Vec<Option<f64>>,
    /// Where it ends, absolute, programmed units, with the axes that the block does not name; `None` where that is not known.
    pub target: Vec<Option<f64>>,
    /// Which of [`Block::words`] gave which axis.
    pub words: Vec<Option<usize>>,
    /// Whether `target` is meant in the machine's own frame (`G53`, `SUPA`) for the axes named.
    pub machine_frame: bool,
}

/// What one block did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Step {
    /// Where it moves, if it does.
    pub motion: Option<Motion>,
    /// Coordinates mean something else behind this block: `TRANS`, `AROT`, `G92`, `G52`, `G68`, `G10`, `CYCLE800`, `PLANE`.
    pub changes_frame: bool,
    /// It calls a sub-program, macro or cycle that may move.
    pub calls: bool,
    /// The next block need not be the next line: `IF`, `GOTO`, `WHILE`, `FN 9`. State is followed in the order of lines.
    pub jumps: bool,
}

/// What the numbers of axis words in a block are for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    Target,
    /// `G92`: the present place gets these numbers.
    Preset,
    /// Frames, dwell, arguments.
    Nothing,
    /// `G28`: the axes named end elsewhere.
    Reference,
}

/// Modal state of a program, followed block by block.
#[derive(Clone, Debug)]
pub struct State {
    pub(super) dialect: Dialect,
    addresses: Vec<String>,
    coordinates: Vec<Coordinate>,
    pub(super) modes: Modes,
}

/// What is gathered from one block.
pub(super) struct Reading {
    pub step: Step,
    pub purpose: Purpose,
    pub kind: Option<MotionKind>,
    pub probes: bool,
    pub machine_frame: bool,
}

impl State {
    /// Nothing programmed yet. `addresses`: of the axes to follow, `X`, `C1`; those that begin with A, B or C are rotary.
    pub fn new(dialect: Dialect, addresses: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let addresses: Vec<String> =
            addresses.into_iter().map(|a| Into::<String>::into(a).to_ascii_uppercase()).collect();
        let coordinates = vec![Coordinate::Unprogrammed; addresses.len()];
        State { dialect, addresses, coordinates, modes: Modes::default() }
    }

    /// The addresses that are followed.
    pub fn addresses(&self) -> &[String] {
        &self.addresses
    }

    /// What is in force.
    pub fn modes(&self) -> &Modes {
        &self.modes
    }

    /// The programmed position of each address.
    pub fn coordinates(&self) -> &[Coordinate] {
        &self.coordinates
    }

    /// The programmed position of each address, programmed units, where it is known.
    pub fn target(&self) -> Vec<Option<f64>> {
        self.coordinates.iter().map(|c| c.value()).collect()
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
        let mut reading = Reading {
            step: Step::default(),
            purpose: Purpose::Target,
            kind: None,
            probes: false,
            machine_frame: false,
        };
        let before = self.clone();
        self.names(block, &mut reading);
        self.codes(block, &words, &mut reading);
        if reading.purpose == Purpose::Target
            && let Some((axis, first, second)) = twice(&words)
        {
            *self = before;
            let (first, at) =
                (block.column(block.words()[first].span.start), block.words()[second].span.start);
            let address = self.addresses[axis].clone();
            return Err(block.fault(at, NcFault::TwiceInBlock { address, first }));
        }
        self.place(block, &words, &mut reading);
        Ok(reading.step)
    }

    /// The words of the block that name axis after axis.
    fn axis_words(&self, block: &Block) -> Vec<Vec<usize>> {
        let of = |address: &String| {
            let named = |(i, w): (usize, &Word)| (w.address == *address).then_some(i);
            block.words().iter().enumerate().filter_map(named).collect()
        };
        self.addresses.iter().map(of).collect()
    }

    /// Moves, or gives the axis words their other meaning.
    fn place(&mut self, block: &Block, words: &[Vec<usize>], reading: &mut Reading) {
        let line = block.line();
        if let Some(kind) = reading.kind {
            self.modes.motion = Some(kind);
        }
        let kind = self.modes.motion.unwrap_or(MotionKind::Unstated);
        let named = |axis: usize| words[axis].first().copied();
        match reading.purpose {
            Purpose::Nothing => return,
            Purpose::Reference => {
                let all = words.iter().all(|w| w.is_empty());
                for axis in 0..words.len() {
                    if all || named(axis).is_some() {
                        self.lose_one(axis, line, Why::Reference);
                    }
                }
                return;
            }
            Purpose::Preset => {
                for axis in 0..words.len() {
                    if let Some(word) = named(axis) {
                        self.coordinates[axis] = match block.words()[word].number() {
                            Some(value) => Coordinate::Known(value),
                            None => self.lost(axis, line, Why::Expression),
                        };
                    }
                }
                return;
            }
            Purpose::Target => {}
        }
        let polar: &[&str] = if self.dialect == Dialect::Heidenhain { &["PR", "PA"] } else { &["AP", "RP"] };
        let by_polar = polar.iter().any(|a| has_word(block, a)) && self.dialect != Dialect::Rs274;
        let direction = ["A2", "B2", "C2", "A3", "B3", "C3", "LEAD", "TILT", "TX", "TY", "TZ"];
        let by_direction = self.dialect != Dialect::Rs274
            && direction.iter().any(|a| has_word(block, a) && !self.addresses.iter().any(|o| o == a));
        let is_arc = matches!(kind, MotionKind::ArcCw | MotionKind::ArcCcw);
        let by_centre = is_arc && ["I", "J", "K", "R", "CR", "AR", "TURN"].iter().any(|a| has_word(block, a));
        if !(words.iter().any(|w| !w.is_empty()) || by_polar || by_direction || by_centre) {
            return;
        }
        let start = self.target();
        for axis in 0..words.len() {
            if let Some(word) = named(axis) {
                let next = self.next_coordinate(axis, &block.words()[word], line);
                self.coordinates[axis] = next;
            }
        }
        if by_polar {
            self.lose(line, Why::OtherWords, is_linear);
        }
        if by_direction {
            self.lose(line, Why::OtherWords, |a| !is_linear(a));
        }
        let target = self.target();
        // What is known of the place behind the block.
        for axis in 0..words.len() {
            if named(axis).is_none() {
                continue;
            }
            if reading.machine_frame {
                self.lose_one(axis, line, Why::MachineFrame);
            } else if reading.probes {
                self.lose_one(axis, line, Why::Reference);
            }
        }
        if self.modes.modal_call {
            reading.step.calls = true;
        }
        if kind == MotionKind::Cycle || self.modes.modal_call {
            let normal = self.normal();
            self.lose(line, Why::Call, |a| a.starts_with(normal));
        }
        let words = words.iter().map(|w| w.first().copied()).collect();
        let machine_frame = reading.machine_frame;
        reading.step.motion = Some(Motion { line, kind, start, target, words, machine_frame });
    }

    /// Where a word takes its axis.
    fn next_coordinate(&self, axis: usize, word: &Word, line: usize) -> Coordinate {
        let incremental = match word.how {
            How::Modal => self.modes.distance == Some(Distance::Incremental),
            how => how == How::Incremental,
        };
        match (word.number(), incremental, self.coordinates[axis]) {
            (Some(value), false, _) => Coordinate::Known(value),
            (Some(by), true, Coordinate::Known(from)) => Coordinate::Known(from + by),
            // An increment upon something lost: it stays lost since then.
            (Some(_), true, lost @ Coordinate::Lost { .. }) => lost,
            _ => self.lost(axis, line, Why::Expression),
        }
    }

    pub(super) fn lose(&mut self, line: usize, why: Why, which: impl Fn(&str) -> bool) {
        for axis in 0..self.coordinates.len() {
            if which(&self.addresses[axis]) {
                self.lose_one(axis, line, why);
            }
        }
    }

    /// What was never programmed, or is lost already, stays as it is.
    pub(super) fn lose_one(&mut self, axis: usize, line: usize, why: Why) {
        if let Coordinate::Known(_) = self.coordinates[axis] {
            self.coordinates[axis] = self.lost(axis, line, why);
        }
    }

    pub(super) fn lost(&self, axis: usize, line: usize, why: Why) -> Coordinate {
        let last = match self.coordinates[axis] {
            Coordinate::Unprogrammed => None,
            Coordinate::Known(value) => Some(value),
            Coordinate::Lost { last, .. } => last,
        };
        Coordinate::Lost { line, why, last }
    }
}

pub(super) fn is_linear(address: &str) -> bool {
    !address.starts_with(['A', 'B', 'C'])
}

pub(super) fn has_word(block: &Block, address: &str) -> bool {
    block.words().iter().any(|w| w.address == address)
}

pub(super) fn word_text(block: &Block, address: &str) -> Option<String> {
    block.words().iter().find(|w| w.address == address).map(|w| block.text(&w.value_span))
}

/// The axis that two words name, and these words.
fn twice(words: &[Vec<usize>]) -> Option<(usize, usize, usize)> {
    words.iter().enumerate().find_map(|(axis, named)| match named[..] {
        [first, second, ..] => Some((axis, first, second)),
        _ => None,
    })
}

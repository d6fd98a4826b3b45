//! What stays in force from block to block, and where a block moves.

use super::codes::{by_name, frame, harmless_call, interpolation, jumps, modal_name, other_transformation};
use super::{Block, Dialect, How, Kind, NcFault, Value, Word};
use crate::error::Result;

/// How a block moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionKind {
    /// `G0`, `L ... FMAX`.
    Rapid,
    /// `G1`, `L`.
    Linear,
    /// `G2`.
    ArcCw,
    /// `G3`.
    ArcCcw,
    /// A canned cycle of RS-274 at this position, `G73`, `G81` ...
    Cycle,
    /// Another interpolation: splines, threads, probing, `CIP`, Heidenhain's path functions other than `L`.
    Other,
    /// The program has not said how, or has cancelled it with `G80`.
    Unstated,
}

/// What numbers of axis words mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distance {
    /// `G90`.
    Absolute,
    /// `G91`.
    Incremental,
}

/// Unit of lengths in the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Units {
    /// `G21`, `G71`, `G710`.
    Millimetre,
    /// `G20`, `G70`, `G700`.
    Inch,
}

/// What the `F` word means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feed {
    /// `G93`: one over the time of the block.
    InverseTime,
    /// `G94`: per minute.
    PerMinute,
    /// `G95`: per revolution of the spindle.
    PerRevolution,
}

/// Plane of arcs; its normal is the direction of the tool length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// `G17`.
    Xy,
    /// `G18`.
    Zx,
    /// `G19`.
    Yz,
}

/// What is in force; `None` until the program says it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Modes {
    /// The motion of blocks that name axes only.
    pub motion: Option<MotionKind>,
    /// Absolute or incremental; absolute is taken until the program says it.
    pub distance: Option<Distance>,
    /// Unit of lengths.
    pub units: Option<Units>,
    /// Meaning of `F`.
    pub feed: Option<Feed>,
    /// Plane of arcs.
    pub plane: Option<Plane>,
    /// Whether coordinates are those of the tool centre point: `G43.4`, `G43.5`, `G234`, `TRAORI`, `M128`, `FUNCTION TCPM`.
    pub tool_centre_point: Option<bool>,
    /// Whether tool length counts: `G43`, `G49`.
    pub tool_length: Option<bool>,
    /// The `H` word in RS-274, the `D` word in Siemens programs.
    pub length_offset: Option<f64>,
    /// The `T` word's value as written, or the first value behind `TOOL CALL`.
    pub tool: Option<String>,
    /// Whether a cycle or macro is called behind every block that moves: `MCALL`, `G66`.
    pub modal_call: bool,
    /// The work offset: `G54`, `G54.1 P3`, `G500`.
    pub work_offset: Option<String>,
}

/// Why a coordinate is not known any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// Its value is an expression, or an increment upon something unknown.
    Expression,
    /// The frame changed: `TRANS`, `ROT`, `G92`, `G52`, `G68`, `CYCLE800`.
    Frame,
    /// Another work offset.
    WorkOffset,
    /// It was programmed in the machine's frame: `G53`, `SUPA`.
    MachineFrame,
    /// Tool centre point mode or another transformation was switched.
    Transformation,
    /// Another tool or tool length.
    Tool,
    /// The unit changed.
    Units,
    /// A sub-program, macro or cycle may have moved it.
    Call,
    /// It went to a reference point, or stopped where a probe touched.
    Reference,
    /// It was given by polar coordinates or by a tool direction.
    OtherWords,
}

/// The programmed position of one axis, programmed units, in the frame in force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coordinate {
    /// Not programmed so far.
    Unprogrammed,
    /// Programmed, absolute.
    Known(f64),
    /// Once programmed, not known now.
    Lost {
        /// Line since which it is not known.
        line: usize,
        /// What happened there.
        why: Why,
        /// The value before that, if one was known.
        last: Option<f64>,
    },
}

impl Coordinate {
    /// The value where it is known.
    pub fn value(self) -> Option<f64> {
        match self {
            Coordinate::Known(value) => Some(value),
            _ => None,
        }
    }
}

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
enum Purpose {
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
    dialect: Dialect,
    addresses: Vec<String>,
    coordinates: Vec<Coordinate>,
    modes: Modes,
}

/// What is gathered from one block.
struct Reading {
    step: Step,
    purpose: Purpose,
    kind: Option<MotionKind>,
    probes: bool,
    machine_frame: bool,
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

    /// Names and calls.
    fn names(&mut self, block: &Block, reading: &mut Reading) {
        let line = block.line();
        let mut tokens = block
            .tokens()
            .iter()
            .filter(|t| !matches!(t.kind, Kind::BlockNumber | Kind::Skip | Kind::Comment | Kind::Percent))
            .enumerate()
            .peekable();
        while let Some((index, token)) = tokens.next() {
            let next = tokens.peek().map(|(_, t)| block.text(&t.span).to_ascii_uppercase());
            let name = match token.kind {
                Kind::Name | Kind::Call => block.name(token),
                Kind::Other => {
                    self.positioned_aside(&block.text(&token.span), line);
                    continue;
                }
                _ => continue,
            };
            if self.dialect == Dialect::Heidenhain {
                self.heidenhain(&name, next.unwrap_or_default(), block, reading);
                continue;
            }
            let called = token.kind == Kind::Call;
            match name.as_str() {
                "TRAORI" => self.transform(true, line),
                "TRAFOOF" => self.transform(false, line),
                "SUPA" => reading.machine_frame = true,
                "CYCLE800" => {
                    reading.step.changes_frame = true;
                    self.lose(line, Why::Frame, |_| true);
                }
                name if frame(name) => {
                    reading.step.changes_frame = true;
                    reading.purpose = Purpose::Nothing;
                    self.frame_moved(block, line);
                }
                name if other_transformation(name) => {
                    reading.step.changes_frame = true;
                    self.modes.tool_centre_point = Some(false);
                    self.lose(line, Why::Transformation, |_| true);
                }
                name if interpolation(name) && !called => reading.kind = Some(MotionKind::Other),
                name if jumps(name) => reading.step.jumps = true,
                name if by_name(name) => self.called(line, reading),
                "MCALL" => self.modes.modal_call = next.is_some(),
                name if called && !harmless_call(name) => self.called(line, reading),
                // Alone in its block: a program of the user.
                name if self.dialect == Dialect::Siemens
                    && !called
                    && index == 0
                    && name.len() > 1
                    && next.is_none()
                    && !modal_name(name) =>
                {
                    self.called(line, reading);
                }
                _ => {}
            }
        }
    }

    /// Heidenhain's statements.
    fn heidenhain(&mut self, name: &str, next: String, block: &Block, reading: &mut Reading) {
        let line = block.line();
        match name {
            "L" | "LN" => {
                let rapid = block.tokens().iter().any(|t| t.kind == Kind::Name && block.name(t) == "FMAX");
                reading.kind = Some(if rapid { MotionKind::Rapid } else { MotionKind::Linear });
            }
            "C" | "CR" | "CT" | "LP" | "CP" | "CTP" | "RND" | "CHF" | "APPR" | "DEP" => {
                reading.kind = Some(MotionKind::Other);
                if matches!(name, "LP" | "CP" | "CTP" | "DEP") {
                    self.lose(line, Why::OtherWords, is_linear);
                }
            }
            "CC" => reading.purpose = Purpose::Nothing,
            "FUNCTION" if next.starts_with("TCPM") => self.transform(true, line),
            "FUNCTION" if next.starts_with("RESET TCPM") => self.transform(false, line),
            "TOOL" if next.starts_with("CALL") => {
                self.modes.tool = next["CALL".len()..].split_ascii_whitespace().next().map(String::from);
                self.tool_changed(line);
            }
            "PLANE" | "TRANS" => {
                reading.step.changes_frame = true;
                self.lose(line, Why::Frame, |_| true);
            }
            "CYCL" => {
                let words: Vec<&str> = next.split_ascii_whitespace().collect();
                let number = words.get(1).and_then(|n| n.split('.').next()).and_then(|n| n.parse().ok());
                if words.first() == Some(&"CALL") {
                    self.called(line, reading);
                } else if matches!(number, Some(7 | 8 | 10 | 11 | 19 | 26 | 247)) {
                    reading.step.changes_frame = true;
                    self.lose(line, Why::Frame, |_| true);
                }
            }
            "CALL" | "PATTERN" | "TCH" | "SEL" => self.called(line, reading),
            "FN" => reading.step.jumps = matches!(next.trim_start().split(':').next(), Some("9" | "10" | "11" | "12")),
            _ => {}
        }
    }

    /// `POS[X]=10`: positions an axis outside the words.
    fn positioned_aside(&mut self, text: &str, line: usize) {
        let text = text.to_ascii_uppercase();
        let inner = text.strip_prefix("POSA[").or_else(|| text.strip_prefix("POS["));
        if let Some(axis) = inner.and_then(|t| t.split(']').next()) {
            let axis = axis.trim().to_string();
            self.lose(line, Why::Expression, |address| address == axis);
        }
    }

    /// G, M, T, D and H words.
    fn codes(&mut self, block: &Block, words: &[Vec<usize>], reading: &mut Reading) {
        let line = block.line();
        let names_axis = words.iter().any(|w| !w.is_empty());
        for word in block.words() {
            let Value::Number(number) = word.value else {
                match word.address.as_str() {
                    "G" | "M" => self.called(line, reading),
                    "T" => self.modes.tool = Some(block.text(&word.value_span)),
                    "D" | "H" => {
                        self.modes.length_offset = None;
                        self.length_changed(line);
                    }
                    _ => {}
                }
                continue;
            };
            let tenths = (number.value * 10.0).round();
            let code = if (0.0..1e6).contains(&tenths) { tenths as u32 } else { u32::MAX };
            match word.address.as_str() {
                "G" => self.g_code(code, names_axis, block, reading),
                "M" => self.m_code(code, line, reading),
                "T" => self.modes.tool = Some(block.text(&word.value_span)),
                "D" if self.dialect == Dialect::Siemens => self.offset_number(number.value, line),
                "H" if self.dialect == Dialect::Rs274 => self.offset_number(number.value, line),
                "L" if self.dialect == Dialect::Siemens => self.called(line, reading),
                _ => {}
            }
        }
    }

    fn g_code(&mut self, code: u32, names_axis: bool, block: &Block, reading: &mut Reading) {
        use MotionKind::*;
        let line = block.line();
        let (rs274, siemens) = (self.dialect == Dialect::Rs274, self.dialect == Dialect::Siemens);
        match code {
            // DIN/ISO at Heidenhain: datum shift, mirror, scale, rotation, tilted plane; call of a cycle.
            280 | 530 | 540 | 720 | 730 | 800 if !rs274 && !siemens => {
                reading.purpose = Purpose::Nothing;
                reading.step.changes_frame = true;
                self.lose(line, Why::Frame, |_| true);
            }
            790 if !rs274 && !siemens => self.called(line, reading),
            0 => reading.kind = Some(Rapid),
            10 => reading.kind = Some(Linear),
            20 => reading.kind = Some(ArcCw),
            30 => reading.kind = Some(ArcCcw),
            22 | 32 | 50..=53 | 62 if names_axis && !siemens => reading.kind = Some(Other),
            330..=349 | 3310 | 3320 => reading.kind = Some(Other),
            40 => reading.purpose = Purpose::Nothing,
            730 | 740 | 760 | 810..=890 if rs274 => {
                reading.kind = Some(if code == 760 && !names_axis { Other } else { Cycle })
            }
            800 if rs274 => reading.kind = Some(Unstated),
            310..=319 | 380..=385 if rs274 => {
                reading.kind = Some(Other);
                reading.probes = true;
            }
            170 => self.modes.plane = Some(Plane::Xy),
            180 => self.modes.plane = Some(Plane::Zx),
            190 => self.modes.plane = Some(Plane::Yz),
            200 | 7000 => self.measured_in(Units::Inch, line),
            210 | 7100 => self.measured_in(Units::Millimetre, line),
            // G70 and G71 with P and Q are cycles of lathes.
            700 | 710 if !has_word(block, "P") => {
                self.measured_in(if code == 700 { Units::Inch } else { Units::Millimetre }, line)
            }
            900 => self.modes.distance = Some(Distance::Absolute),
            910 => self.modes.distance = Some(Distance::Incremental),
            930 => self.modes.feed = Some(Feed::InverseTime),
            940 => self.modes.feed = Some(Feed::PerMinute),
            950 => self.modes.feed = Some(Feed::PerRevolution),
            430 | 440 => {
                self.modes.tool_length = Some(true);
                self.length_changed(line);
            }
            434 | 435 | 2340 if !siemens => {
                self.modes.tool_length = Some(true);
                self.transform(true, line);
            }
            490 if !siemens => {
                if self.modes.tool_centre_point == Some(true) {
                    self.transform(false, line);
                }
                self.modes.tool_centre_point = Some(false);
                if self.modes.tool_length.replace(false) != Some(false) {
                    self.length_changed(line);
                }
            }
            530 | 1530 => reading.machine_frame = true,
            531 | 536 if rs274 => self.lose(line, Why::Frame, |_| true),
            580 | 590 if siemens => {
                reading.step.changes_frame = true;
                reading.purpose = Purpose::Nothing;
                self.frame_moved(block, line);
            }
            540..=593 if code % 10 == 0 || rs274 => {
                let place = (rs274 && code == 541).then(|| word_text(block, "P")).flatten();
                let name = if code % 10 == 0 {
                    format!("G{}", code / 10)
                } else {
                    format!("G{}.{}", code / 10, code % 10)
                };
                self.offset_named(place.map_or(name.clone(), |p| format!("{name} P{p}")), line);
            }
            5000 | 5050..=5990 if siemens && code % 10 == 0 => {
                self.offset_named(format!("G{}", code / 10), line)
            }
            280..=309 if rs274 => reading.purpose = Purpose::Reference,
            740 | 750 | 7510 if siemens => reading.purpose = Purpose::Reference,
            250 | 260 if siemens => reading.purpose = Purpose::Nothing,
            1100..=1120 if siemens => reading.purpose = Purpose::Nothing,
            100 if rs274 => {
                reading.purpose = Purpose::Nothing;
                reading.step.changes_frame = true;
                self.frame_moved(block, line);
            }
            650..=669 | 670 if rs274 => {
                reading.purpose = Purpose::Nothing;
                // G66 calls behind every block that moves, until G67.
                self.modes.modal_call = code / 10 == 66;
                if code != 670 {
                    self.called(line, reading);
                }
            }
            920 if names_axis && !siemens => {
                reading.purpose = Purpose::Preset;
                reading.step.changes_frame = true;
            }
            921..=923 if !siemens => {
                reading.step.changes_frame = true;
                self.lose(line, Why::Frame, |_| true);
            }
            520 if rs274 => {
                reading.purpose = Purpose::Nothing;
                reading.step.changes_frame = true;
                self.frame_moved(block, line);
            }
            500 | 501 | 510 | 511 | 680..=694 | 2540 | 2550 if rs274 => {
                // Without axis words G50 is a limit of the spindle, G51 nothing.
                if names_axis || code >= 680 || code == 500 {
                    reading.purpose = Purpose::Nothing;
                    reading.step.changes_frame = true;
                    self.frame_moved(block, line);
                }
            }
            _ => {}
        }
    }

    fn m_code(&mut self, code: u32, line: usize, reading: &mut Reading) {
        match code {
            60 => self.tool_changed(line),
            970 | 980 if self.dialect == Dialect::Rs274 => {
                reading.purpose = Purpose::Nothing;
                self.called(line, reading);
            }
            990 if self.dialect == Dialect::Rs274 => reading.step.jumps = true,
            1280 if self.dialect == Dialect::Heidenhain => self.transform(true, line),
            1290 if self.dialect == Dialect::Heidenhain => self.transform(false, line),
            910 | 920 if self.dialect == Dialect::Heidenhain => reading.machine_frame = true,
            890 | 990 if self.dialect == Dialect::Heidenhain => self.called(line, reading),
            _ => {}
        }
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
        let polar: &[&str] =
            if self.dialect == Dialect::Heidenhain { &["PR", "PA"] } else { &["AP", "RP"] };
        let by_polar = polar.iter().any(|a| has_word(block, a)) && self.dialect != Dialect::Rs274;
        let direction = ["A2", "B2", "C2", "A3", "B3", "C3", "LEAD", "TILT", "TX", "TY", "TZ"];
        let by_direction = self.dialect != Dialect::Rs274
            && direction.iter().any(|a| has_word(block, a) && !self.addresses.iter().any(|o| o == a));
        let is_arc = matches!(kind, MotionKind::ArcCw | MotionKind::ArcCcw);
        let by_centre =
            is_arc && ["I", "J", "K", "R", "CR", "AR", "TURN"].iter().any(|a| has_word(block, a));
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

    fn transform(&mut self, on: bool, line: usize) {
        if self.modes.tool_centre_point.replace(on) != Some(on) {
            self.lose(line, Why::Transformation, is_linear);
        }
    }

    fn measured_in(&mut self, units: Units, line: usize) {
        if self.modes.units.replace(units).is_some_and(|before| before != units) {
            self.lose(line, Why::Units, is_linear);
        }
    }

    fn offset_named(&mut self, name: String, line: usize) {
        match self.modes.work_offset.replace(name.clone()) {
            Some(before) if before == name => {}
            Some(_) => self.lose(line, Why::WorkOffset, |_| true),
            None => self.lose(line, Why::WorkOffset, is_linear),
        }
    }

    fn offset_number(&mut self, number: f64, line: usize) {
        if self.modes.length_offset.replace(number) != Some(number) {
            self.length_changed(line);
        }
    }

    /// The tool length acts along the normal of the plane.
    fn length_changed(&mut self, line: usize) {
        let normal = self.normal();
        self.lose(line, Why::Tool, |address| address.starts_with(normal));
    }

    fn normal(&self) -> char {
        match self.modes.plane {
            None | Some(Plane::Xy) => 'Z',
            Some(Plane::Zx) => 'Y',
            Some(Plane::Yz) => 'X',
        }
    }

    fn tool_changed(&mut self, line: usize) {
        self.lose(line, Why::Tool, is_linear);
    }

    fn called(&mut self, line: usize, reading: &mut Reading) {
        reading.step.calls = true;
        self.lose(line, Why::Call, |_| true);
    }

    /// Lengths mean something else now; an angle does only where the block names its axis.
    fn frame_moved(&mut self, block: &Block, line: usize) {
        let named: Vec<String> = block.words().iter().map(|w| w.address.clone()).collect();
        self.lose(line, Why::Frame, |address| is_linear(address) || named.iter().any(|n| n == address));
    }

    fn lose(&mut self, line: usize, why: Why, which: impl Fn(&str) -> bool) {
        for axis in 0..self.coordinates.len() {
            if which(&self.addresses[axis]) {
                self.lose_one(axis, line, why);
            }
        }
    }

    /// What was never programmed, or is lost already, stays as it is.
    fn lose_one(&mut self, axis: usize, line: usize, why: Why) {
        if let Coordinate::Known(_) = self.coordinates[axis] {
            self.coordinates[axis] = self.lost(axis, line, why);
        }
    }

    fn lost(&self, axis: usize, line: usize, why: Why) -> Coordinate {
        let last = match self.coordinates[axis] {
            Coordinate::Unprogrammed => None,
            Coordinate::Known(value) => Some(value),
            Coordinate::Lost { last, .. } => last,
        };
        Coordinate::Lost { line, why, last }
    }
}

fn is_linear(address: &str) -> bool {
    !address.starts_with(['A', 'B', 'C'])
}

fn has_word(block: &Block, address: &str) -> bool {
    block.words().iter().any(|w| w.address == address)
}

fn word_text(block: &Block, address: &str) -> Option<String> {
    block.words().iter().find(|w| w.address == address).map(|w| block.text(&w.value_span))
}

/// The axis that two words name, and these words.
fn twice(words: &[Vec<usize>]) -> Option<(usize, usize, usize)> {
    words.iter().enumerate().find_map(|(axis, named)| match named[..] {
        [first, second, ..] => Some((axis, first, second)),
        _ => None,
    })
}

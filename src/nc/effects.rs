//! What names and codes of a block change, before its axis words are looked at.

use super::axes::{Axes, is_linear};
use super::block::Block;
use super::codes::{by_name, frame, interpolation, jumps, other_transformation, structures};
use super::dialect::Dialect;
use super::dialects::vocabulary;
use super::modes::{Modes, MotionKind, Units, Why};
use super::motion::Step;
use super::token::Kind;
use super::vocabulary::{Action, Vocabulary};
use super::words::Value;

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

/// What is gathered from one block.
pub(super) struct Reading {
    pub step: Step,
    pub purpose: Purpose,
    pub kind: Option<MotionKind>,
    pub probes: bool,
    pub machine_frame: bool,
}

/// The effects of one block on what is in force.
pub(super) struct Effects<'a> {
    dialect: Dialect,
    vocabulary: &'static Vocabulary,
    modes: &'a mut Modes,
    axes: &'a mut Axes,
    reading: Reading,
}

impl<'a> Effects<'a> {
    /// Nothing has been read.
    pub fn new(dialect: Dialect, modes: &'a mut Modes, axes: &'a mut Axes) -> Self {
        let reading = Reading {
            step: Step::default(),
            purpose: Purpose::Target,
            kind: None,
            probes: false,
            machine_frame: false,
        };
        Effects { dialect, vocabulary: vocabulary(dialect), modes, axes, reading }
    }

    /// What the block says beside its axis words.
    pub fn finish(self) -> Reading {
        self.reading
    }

    /// Names and calls.
    pub fn names(&mut self, block: &Block) {
        let line = block.line();
        let mut tokens = block
            .tokens()
            .iter()
            .filter(|t| !matches!(t.kind, Kind::BlockNumber | Kind::Skip | Kind::Comment | Kind::Percent))
            .enumerate()
            .peekable();
        while let Some((index, token)) = tokens.next() {
            let name = match token.kind {
                Kind::Name | Kind::Call => block.name(token),
                Kind::Other => {
                    self.positioned_aside(&block.text(&token.span), line);
                    continue;
                }
                _ => continue,
            };
            let next = tokens.peek().map(|(_, t)| block.text(&t.span).to_ascii_uppercase());
            if self.dialect == Dialect::Heidenhain {
                self.heidenhain(&name, next.unwrap_or_default(), block);
                continue;
            }
            let called = token.kind == Kind::Call;
            match name.as_str() {
                "TRAORI" => self.transform(true, line),
                "TRAFOOF" => self.transform(false, line),
                "SUPA" => self.reading.machine_frame = true,
                "CYCLE800" => {
                    self.reading.step.changes_frame = true;
                    self.axes.lose(line, Why::Frame, |_| true);
                }
                name if frame(name) => {
                    self.reading.step.changes_frame = true;
                    self.reading.purpose = Purpose::Nothing;
                    self.frame_moved(block, line);
                }
                name if other_transformation(name) => {
                    self.reading.step.changes_frame = true;
                    self.modes.tool_centre_point = Some(false);
                    self.axes.lose(line, Why::Transformation, |_| true);
                }
                name if interpolation(name) && !called => self.reading.kind = Some(MotionKind::Other),
                name if jumps(name) => self.reading.step.jumps = true,
                name if by_name(name) => self.called(line),
                "MCALL" => self.modes.modal_call = next.is_some(),
                name if called && !self.vocabulary.has_call(name) => self.called(line),
                // Alone in its block: a program of the user.
                name if self.dialect == Dialect::Siemens
                    && !called
                    && index == 0
                    && name.len() > 1
                    && next.is_none()
                    && !structures(name)
                    && !self.vocabulary.has_name(name) =>
                {
                    self.called(line);
                }
                _ => {}
            }
        }
    }

    /// Heidenhain's statements.
    fn heidenhain(&mut self, name: &str, next: String, block: &Block) {
        let line = block.line();
        match name {
            "L" | "LN" => {
                let rapid = block.tokens().iter().any(|t| t.kind == Kind::Name && block.name(t) == "FMAX");
                self.reading.kind = Some(if rapid { MotionKind::Rapid } else { MotionKind::Linear });
            }
            "C" | "CR" | "CT" | "LP" | "CP" | "CTP" | "RND" | "CHF" | "APPR" | "DEP" => {
                self.reading.kind = Some(MotionKind::Other);
                if matches!(name, "LP" | "CP" | "CTP" | "DEP") {
                    self.axes.lose(line, Why::OtherWords, is_linear);
                }
            }
            "BEGIN" if next.ends_with(" INCH") => self.measured_in(Units::Inch, line),
            "BEGIN" if next.ends_with(" MM") => self.measured_in(Units::Millimetre, line),
            "CC" => self.reading.purpose = Purpose::Nothing,
            "FUNCTION" if next.starts_with("TCPM") => self.transform(true, line),
            "FUNCTION" if next.starts_with("RESET TCPM") => self.transform(false, line),
            "TOOL" if next.starts_with("CALL") => {
                self.modes.tool = next["CALL".len()..].split_ascii_whitespace().next().map(String::from);
                self.tool_changed(line);
            }
            "PLANE" | "TRANS" => {
                self.reading.step.changes_frame = true;
                self.axes.lose(line, Why::Frame, |_| true);
            }
            "CYCL" => {
                let words: Vec<&str> = next.split_ascii_whitespace().collect();
                let number = words.get(1).and_then(|n| n.split('.').next()).and_then(|n| n.parse().ok());
                if words.first() == Some(&"CALL") {
                    self.called(line);
                } else if matches!(number, Some(7 | 8 | 10 | 11 | 19 | 26 | 247)) {
                    self.reading.step.changes_frame = true;
                    self.axes.lose(line, Why::Frame, |_| true);
                }
            }
            "CALL" | "PATTERN" | "TCH" | "SEL" => self.called(line),
            "FN" => {
                self.reading.step.jumps =
                    matches!(next.trim_start().split(':').next(), Some("9" | "10" | "11" | "12"))
            }
            _ => {}
        }
    }

    /// `POS[X]=10`: positions an axis outside the words.
    fn positioned_aside(&mut self, text: &str, line: usize) {
        let text = text.to_ascii_uppercase();
        let inner = text.strip_prefix("POSA[").or_else(|| text.strip_prefix("POS["));
        if let Some(axis) = inner.and_then(|t| t.split(']').next()) {
            let axis = axis.trim().to_string();
            self.axes.lose(line, Why::Expression, |address| address == axis);
        }
    }

    /// G, M, T, D and H words.
    /// `names_axis`: whether the block has words of axes that are followed.
    pub fn codes(&mut self, block: &Block, names_axis: bool) {
        let line = block.line();
        for word in block.words() {
            let Value::Number(number) = word.value else {
                match word.address.as_str() {
                    "G" | "M" => self.called(line),
                    "T" => self.modes.tool = Some(block.text(&word.value_span)),
                    "D" | "H" => {
                        self.modes.length_offset = None;
                        self.length_changed(line);
                    }
                    _ => {}
                }
                continue;
            };
            match word.address.as_str() {
                "G" => {
                    if let Some(action) = self.vocabulary.g(number.value) {
                        self.act(action, number.value, names_axis, block);
                    }
                }
                "M" => {
                    if let Some(action) = self.vocabulary.m(number.value) {
                        self.act(action, number.value, names_axis, block);
                    }
                }
                "T" => self.modes.tool = Some(block.text(&word.value_span)),
                "D" if self.dialect == Dialect::Siemens => self.offset_number(number.value, line),
                "H" if self.dialect == Dialect::Rs274 => self.offset_number(number.value, line),
                "L" if self.dialect == Dialect::Siemens => self.called(line),
                _ => {}
            }
        }
    }

    /// What the code of this number does.
    fn act(&mut self, action: Action, code: f64, names_axis: bool, block: &Block) {
        use MotionKind::Other;
        let line = block.line();
        match action {
            Action::Nothing | Action::NotFollowed => {}
            Action::Motion(kind) => self.reading.kind = Some(kind),
            Action::MotionOfAxes(kind) => {
                if names_axis {
                    self.reading.kind = Some(kind);
                }
            }
            // Threads of LinuxCNC name no axis.
            Action::Cycle if code == 76.0 && !names_axis => self.reading.kind = Some(Other),
            Action::Cycle => self.reading.kind = Some(MotionKind::Cycle),
            Action::Probe => {
                self.reading.kind = Some(Other);
                self.reading.probes = true;
            }
            Action::NoTargets => self.reading.purpose = Purpose::Nothing,
            Action::Plane(plane) => self.modes.plane = Some(plane),
            Action::Units(units) => self.measured_in(units, line),
            Action::UnitsUnlessP(units) => {
                if !block.has_word("P") {
                    self.measured_in(units, line);
                }
            }
            Action::Distance(distance) => self.modes.distance = Some(distance),
            Action::Feed(feed) => self.modes.feed = Some(feed),
            Action::Length => {
                self.modes.tool_length = Some(true);
                self.length_changed(line);
            }
            Action::TcpWithLength => {
                self.modes.tool_length = Some(true);
                self.transform(true, line);
            }
            Action::NoLength => {
                if self.modes.tool_centre_point == Some(true) {
                    self.transform(false, line);
                }
                self.modes.tool_centre_point = Some(false);
                if self.modes.tool_length.replace(false) != Some(false) {
                    self.length_changed(line);
                }
            }
            Action::Tcp(on) => self.transform(on, line),
            Action::MachineFrame => self.reading.machine_frame = true,
            Action::Offset => self.offset_named(format!("G{code}"), line),
            Action::OffsetByP => {
                let place = block.word_text("P").map_or(String::new(), |p| format!(" P{p}"));
                self.offset_named(format!("G{code}{place}"), line);
            }
            Action::Reference => self.reading.purpose = Purpose::Reference,
            Action::Preset if !names_axis => {}
            Action::Preset => {
                self.reading.purpose = Purpose::Preset;
                self.reading.step.changes_frame = true;
            }
            Action::FrameUnlessS if block.has_word("S") => {}
            Action::Frame | Action::FrameUnlessS => {
                self.reading.purpose = Purpose::Nothing;
                self.reading.step.changes_frame = true;
                self.frame_moved(block, line);
            }
            Action::FrameOfAll => {
                self.reading.purpose = Purpose::Nothing;
                self.reading.step.changes_frame = true;
                self.axes.lose(line, Why::Frame, |_| true);
            }
            Action::Call => {
                self.reading.purpose = Purpose::Nothing;
                self.called(line);
            }
            Action::ModalCall(on) => {
                self.reading.purpose = Purpose::Nothing;
                self.modes.modal_call = on;
                if on {
                    self.called(line);
                }
            }
            Action::Jump => self.reading.step.jumps = true,
            Action::ToolChange => self.tool_changed(line),
        }
    }

    fn transform(&mut self, on: bool, line: usize) {
        if self.modes.tool_centre_point.replace(on) != Some(on) {
            self.axes.lose(line, Why::Transformation, is_linear);
        }
    }

    fn measured_in(&mut self, units: Units, line: usize) {
        if self.modes.units.replace(units).is_some_and(|before| before != units) {
            self.axes.lose(line, Why::Units, is_linear);
        }
    }

    fn offset_named(&mut self, name: String, line: usize) {
        match self.modes.work_offset.replace(name.clone()) {
            Some(before) if before == name => {}
            Some(_) => self.axes.lose(line, Why::WorkOffset, |_| true),
            None => self.axes.lose(line, Why::WorkOffset, is_linear),
        }
    }

    fn offset_number(&mut self, number: f64, line: usize) {
        if self.modes.length_offset.replace(number) != Some(number) {
            self.length_changed(line);
        }
    }

    /// The tool length acts along the normal of the plane.
    fn length_changed(&mut self, line: usize) {
        let normal = self.modes.normal();
        self.axes.lose(line, Why::Tool, |address| address.starts_with(normal));
    }

    fn tool_changed(&mut self, line: usize) {
        self.reading.step.changes_tool = true;
        self.axes.lose(line, Why::Tool, is_linear);
    }

    fn called(&mut self, line: usize) {
        self.reading.step.calls = true;
        self.axes.lose(line, Why::Call, |_| true);
    }

    /// Lengths mean something else now; an angle does only where the block names its axis.
    fn frame_moved(&mut self, block: &Block, line: usize) {
        let named = |address: &str| block.words().iter().any(|w| w.address == *address);
        self.axes.lose(line, Why::Frame, |address| is_linear(address) || named(address));
    }
}

//! Follows a program block by block as its control would, twice over: where the program means to be, and where what has been
//! written brings the machine.

use std::io::Write;

use super::control::Control;
use super::correct::Left;
use super::fault::CompensateFault;
use super::frame::{self, Change, has_g};
use super::model::Model;
use super::report::Report;
use super::setup::Setup;
use super::{Options, named};
use crate::error::{Error, Result};
use crate::inverse::{Inverse, Mode};
use crate::machine::{JointKind, Machine};
use crate::nc::{Block, Dialect, Feed, How, Kind, Modes, Motion, MotionKind, State, Units, Value};

/// What is known of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Status {
    /// The program has not named it yet: it stands where it stands and is never written.
    Never,
    /// It stands at a place of the machine, or at one that is not known, until the program names it.
    Parked,
    /// The program has placed it.
    Placed,
}

/// A position, as joints and as program coordinates in the frame in force; m or rad.
#[derive(Clone, Debug)]
pub(super) struct Position {
    pub q: Vec<f64>,
    pub program: Vec<f64>,
}

/// A program being followed.
pub(super) struct Follower<'a> {
    pub machine: &'a Machine,
    pub control: Control<'a>,
    pub model: &'a mut dyn Model,
    pub options: &'a Options,
    pub inverse: Inverse<'a>,
    pub slides: Inverse<'a>,
    pub state: State,
    pub dialect: Dialect,
    /// Where the program means to be.
    pub meant: Position,
    /// Where the control takes the machine by what has been written.
    pub written: Position,
    pub status: Vec<Status>,
    /// Most digits behind the point so far, of lengths and of angles.
    pub decimals: [usize; 2],
    /// The last corrected position before rounding: as meant, as corrected; and the piece that it belongs to.
    pub last: Option<(Vec<f64>, Vec<f64>, usize)>,
    /// Motion in force by what has been written.
    pub written_motion: Option<MotionKind>,
    pub report: Report,
    /// Sums of squares over moves of what the unseen patterns would do.
    pub unseen: Vec<Left>,
    pub unseen_moves: u64,
    /// Whether the program writes decimal commas.
    pub comma: bool,
    /// The last line that went beyond what the calibration has seen.
    pub extrapolated: usize,
    /// The cycle that a Siemens program calls behind every block that moves.
    modal_cycle: Option<String>,
    /// `G90.1`: centres of arcs are absolute.
    pub absolute_centre: bool,
    tool: Tool,
    /// Why the next motion cannot be corrected.
    tool_fault: Option<CompensateFault>,
    offset_fault: Option<CompensateFault>,
    /// Behind M2 or M30.
    pub ended: bool,
}

/// Which tool is in the spindle, and which one the control counts with.
#[derive(Clone, Debug, Default)]
struct Tool {
    in_spindle: Option<String>,
    called: Option<String>,
    by_m6: bool,
    /// RS-274: the name of the length in force, `None` without.
    counted: Option<String>,
}

/// A refusal at a byte of a block.
pub(super) fn refuse<T>(block: &Block, byte: usize, fault: CompensateFault) -> Result<T> {
    Err(Error::Compensate { place: block.place(byte), fault: Box::new(fault) })
}

/// The block without its end and blanks around.
pub(super) fn line_text(block: &Block) -> String {
    let text: String = String::from_utf8_lossy(block.bytes()).trim().chars().take(60).collect();
    text
}

impl<'a> Follower<'a> {
    pub fn new(
        machine: &'a Machine,
        model: &'a mut dyn Model,
        setup: &'a Setup,
        options: &'a Options,
        dialect: Dialect,
    ) -> Self {
        let control = Control::new(machine, setup);
        let inverse = Inverse::new(machine);
        let inverse = options.mode.map_or(inverse.clone(), |mode| inverse.with_mode(mode));
        let state = State::new(dialect, control.axes.iter().map(|a| a.address.clone()));
        let count = control.axes.len();
        let start = Position { q: vec![0.0; machine.commands().len()], program: vec![0.0; count] };
        let slides = inverse.with_mode(Mode::Position);
        model.restart();
        let mut follower = Follower {
            machine,
            control,
            model,
            options,
            inverse,
            slides,
            state,
            dialect,
            meant: start.clone(),
            written: start,
            status: vec![Status::Never; count],
            decimals: [0, 0],
            last: None,
            written_motion: None,
            report: Report { machine: machine.name().to_string(), ..Report::default() },
            unseen: Vec::new(),
            unseen_moves: 0,
            comma: false,
            extrapolated: 0,
            modal_cycle: None,
            absolute_centre: false,
            tool: Tool::default(),
            tool_fault: None,
            offset_fault: None,
            ended: false,
        };
        follower.begin(setup);
        follower
    }

    /// Takes up what the set-up says of the start.
    fn begin(&mut self, setup: &Setup) {
        self.tool.in_spindle = setup.tool_at_start();
        if let Some(name) = setup.offset_at_start()
            && !self.control.set_offset(Some(&name))
        {
            self.offset_fault = Some(CompensateFault::UnknownOffset { name });
        }
        let none = Modes::default();
        self.lengths(&none);
        let tcp = std::mem::replace(&mut self.control.tcp, false);
        let mut program = vec![0.0; self.status.len()];
        for (i, axis) in self.control.axes.iter().enumerate() {
            if let Some(value) = setup.start(&axis.address, axis.rotary) {
                program[i] = value;
                self.status[i] = Status::Placed;
            }
        }
        if let Some(q) = self.control.joints(&program, &self.meant.q.clone()) {
            self.meant = Position { q, program };
            self.written = self.meant.clone();
        }
        self.control.tcp = tcp;
        self.refresh();
    }

    /// Follows one block and writes it, with what stands in its place.
    ///
    /// # Errors
    /// [`Error::Compensate`] where it cannot be corrected, [`Error::Nc`] where it cannot be read.
    pub fn block(&mut self, block: &mut Block, out: &mut dyn Write) -> Result<()> {
        if self.ended {
            return put(block, out);
        }
        if has_g(block, 90.1) || has_g(block, 91.1) {
            self.absolute_centre = has_g(block, 90.1);
        }
        let before = self.state.modes().clone();
        let step = self.state.apply(block)?;
        self.modes(block, &before)?;
        if step.jumps {
            return refuse(block, 0, CompensateFault::Jump { what: line_text(block) });
        }
        if step.changes_frame {
            self.frame(block)?;
        }
        self.modal_cycle(block);
        let drills = self.state.modes().modal_call && self.modal_cycle.as_deref().is_some_and(is_drilling);
        if step.calls && !(drills && step.motion.is_some()) {
            self.called(block)?;
        }
        let to_reference = [28.0, 28.1, 30.0, 30.1, 27.0, 29.0];
        let at_siemens = [74.0, 75.0];
        let refers = match self.dialect {
            Dialect::Rs274 => to_reference.iter().any(|g| has_g(block, *g)),
            Dialect::Siemens => at_siemens.iter().any(|g| has_g(block, *g)),
            Dialect::Heidenhain => false,
        };
        if refers {
            self.park(block);
            self.report.machine_moves += 1;
        }
        if let Some(motion) = step.motion {
            self.check(block)?;
            if motion.machine_frame {
                self.machine_move(block, &motion);
            } else {
                return self.motion(block, &motion, out).and_then(|()| self.end(block));
            }
        }
        put(block, out)?;
        self.end(block)
    }

    fn end(&mut self, block: &Block) -> Result<()> {
        self.ended = block
            .words()
            .iter()
            .any(|w| w.address == "M" && matches!(w.number(), Some(n) if n == 2.0 || n == 30.0));
        Ok(())
    }

    /// What may not stand in a block that moves.
    fn check(&self, block: &Block) -> Result<()> {
        let skipped = block.tokens().iter().find(|t| t.kind == Kind::Skip);
        if let Some(token) = skipped {
            return refuse(block, token.span.start, CompensateFault::Skipped);
        }
        for token in block.tokens().iter().filter(|t| t.kind == Kind::Other) {
            let text = block.text(&token.span).to_ascii_uppercase();
            if ["POS[", "POSA[", "POSP[", "MOV["].iter().any(|start| text.starts_with(start)) {
                let what = format!("positioning by `{text}`");
                return refuse(block, token.span.start, CompensateFault::OtherMotion { what });
            }
        }
        Ok(())
    }

    /// Modes that this block has changed.
    fn modes(&mut self, block: &Block, before: &Modes) -> Result<()> {
        let now = self.state.modes().clone();
        let mut changed = false;
        if let Some(units) = now.units
            && units != self.control.units
        {
            self.control.units = units;
            self.decimals[0] = 0;
            changed = true;
        }
        if now.tool_centre_point != before.tool_centre_point {
            self.control.tcp = now.tool_centre_point == Some(true);
            changed = true;
        }
        for word in block.words().iter().filter(|w| matches!(w.address.as_str(), "M" | "G")) {
            let text = block.text(&word.span).to_ascii_uppercase();
            if let Some(on) = self.control.setup.tcp_by(&text) {
                self.control.tcp = on;
                changed = true;
            }
        }
        if now.plane != before.plane {
            self.control.set_plane(now.plane, self.dialect == Dialect::Siemens);
            changed = true;
        }
        if now.work_offset != before.work_offset
            && let Some(name) = now.work_offset.clone()
        {
            let known = self.control.set_offset(Some(&name));
            self.offset_fault = (!known).then_some(CompensateFault::UnknownOffset { name });
            changed = true;
        }
        changed |= self.tools(block, before);
        if changed {
            self.refresh();
        }
        Ok(())
    }

    /// T, M6, G43, H, D; whether the length that counts may have changed.
    fn tools(&mut self, block: &Block, before: &Modes) -> bool {
        let modes = self.state.modes().clone();
        let word = |address: &str| block.words().iter().find(|w| w.address == address);
        let m6 = block.words().iter().any(|w| w.address == "M" && w.number() == Some(6.0));
        let called = modes.tool != before.tool || word("T").is_some();
        if called {
            self.tool.called = modes.tool.clone();
        }
        if m6 || (called && !self.tool.by_m6) {
            self.tool.by_m6 |= m6;
            self.tool.in_spindle = self.tool.called.clone();
        }
        let counts = block.words().iter().filter(|w| w.address == "G").find_map(|w| match w.number() {
            Some(43.0 | 43.4 | 43.5) => Some(true),
            Some(49.0) => Some(false),
            _ => None,
        });
        if self.dialect == Dialect::Rs274 {
            let h = word("H").map(|w| block.text(&w.value_span));
            match (counts, h) {
                (Some(true), Some(h)) => self.tool.counted = Some(h),
                (Some(true), None) => {
                    let known = self.tool.counted.take();
                    self.tool.counted = self.tool.in_spindle.clone().or(known).or(Some("H".into()));
                }
                (Some(false), _) => self.tool.counted = None,
                (None, Some(h)) if self.tool.counted.is_some() => self.tool.counted = Some(h),
                _ => {}
            }
        }
        let touched = called || m6 || counts.is_some() || word("H").is_some() || word("D").is_some();
        if touched {
            self.lengths(&modes);
        }
        touched
    }

    /// Lengths of the tool that is there and of the one that the control counts with.
    fn lengths(&mut self, modes: &Modes) {
        let setup = self.control.setup;
        self.tool_fault = None;
        let unknown = |tool: &str| Some(CompensateFault::UnknownTool { tool: named(tool) });
        let mut length_of = |tool: &str, edge: Option<f64>| {
            let by_edge =
                edge.filter(|d| *d > 1.0).and_then(|d| setup.length(&format!("{} D{d}", named(tool))));
            by_edge.or_else(|| setup.length(tool)).unwrap_or_else(|| {
                self.tool_fault = unknown(tool);
                0.0
            })
        };
        let tool = self.tool.in_spindle.as_deref();
        match self.dialect {
            Dialect::Rs274 => {
                let counted = self.tool.counted.as_deref();
                self.control.length = counted.map_or(0.0, |h| length_of(h, None));
                self.control.tip_length = match (tool, counted) {
                    (Some(tool), Some(_)) => setup.length(tool).unwrap_or(self.control.length),
                    (Some(tool), None) => length_of(tool, None),
                    (None, Some(_)) => self.control.length,
                    (None, None) => setup.reference_length(),
                };
            }
            Dialect::Siemens => {
                let there = tool.map(|tool| length_of(tool, modes.length_offset));
                self.control.tip_length = there.unwrap_or(setup.reference_length());
                let counts = modes.length_offset != Some(0.0);
                self.control.length = there.filter(|_| counts).unwrap_or(0.0);
            }
            Dialect::Heidenhain => {
                let there = tool.map(|tool| length_of(tool, None));
                self.control.tip_length = there.unwrap_or(setup.reference_length());
                self.control.length = there.unwrap_or(0.0);
            }
        }
    }

    /// Coordinates mean something else now; the machine has not moved.
    fn refresh(&mut self) {
        for position in [&mut self.meant, &mut self.written] {
            position.program = self.control.program(&position.q, &position.program);
        }
    }

    fn frame(&mut self, block: &Block) -> Result<()> {
        let place: Vec<Option<f64>> = (self.status.iter().zip(&self.meant.program))
            .map(|(status, at)| (*status == Status::Placed).then_some(*at))
            .collect();
        let plane = self.state.modes().plane;
        match frame::change(&mut self.control, block, self.dialect, plane, &place) {
            Change::Followed => {
                self.refresh();
                Ok(())
            }
            Change::Unknown(what) => {
                let what = what.chars().take(60).collect();
                refuse(block, 0, CompensateFault::Frame { what })
            }
            Change::Unplaced(axis) => {
                let address = self.control.axes[axis].address.clone();
                refuse(block, 0, CompensateFault::UnknownStart { address })
            }
        }
    }

    /// `MCALL CYCLE81(...)`.
    fn modal_cycle(&mut self, block: &Block) {
        let mut tokens = block.tokens().iter();
        if tokens.any(|t| t.kind == Kind::Name && block.name(t) == "MCALL") {
            let called = tokens.next().map(|t| block.text(&t.span).to_ascii_uppercase());
            self.modal_cycle =
                called.map(|text| text.split('(').next().unwrap_or_default().trim().to_string());
        }
    }

    /// A call that is left alone leaves every axis somewhere.
    fn called(&mut self, block: &Block) -> Result<()> {
        let name = super::calls::name_of(block);
        if self.dialect == Dialect::Siemens && is_drilling(&name) {
            self.leave_normal();
            self.report.cycles += 1;
            return Ok(());
        }
        if !self.control.setup.leaves_alone(&name) {
            return refuse(block, 0, CompensateFault::Call { what: name });
        }
        self.status.iter_mut().filter(|s| **s == Status::Placed).for_each(|s| *s = Status::Parked);
        Ok(())
    }

    /// The axis of the tool length is behind a cycle wherever the cycle leaves it.
    pub fn leave_normal(&mut self) {
        let normal = self.control.normal;
        for (axis, status) in self.control.axes.iter().zip(&mut self.status) {
            if axis.tip == Some(normal) && *status == Status::Placed {
                *status = Status::Parked;
            }
        }
    }

    /// Axes named (all, if none is) stand at a reference point.
    fn park(&mut self, block: &Block) {
        let is_named = |address: &str| block.words().iter().any(|w| w.address == address);
        let none = !self.control.axes.iter().any(|a| is_named(&a.address));
        for (axis, status) in self.control.axes.iter().zip(&mut self.status) {
            if none || is_named(&axis.address) {
                *status = Status::Parked;
            }
        }
    }

    /// `G53`, `SUPA`: the numbers are places of the machine, and stay.
    fn machine_move(&mut self, block: &Block, motion: &Motion) {
        for i in 0..motion.words.len() {
            let Some(word) = motion.words[i] else { continue };
            self.status[i] = Status::Parked;
            if let Some(value) = block.words()[word].number()
                && let Some((c, q)) = self.control.machine_joint(i, self.control.si(i, value))
            {
                (self.meant.q[c], self.written.q[c]) = (q, q);
            }
        }
        self.refresh();
        self.written_motion = Some(motion.kind);
        self.report.machine_moves += 1;
    }

    fn motion(&mut self, block: &mut Block, motion: &Motion, out: &mut dyn Write) -> Result<()> {
        let target = self.target(block, motion)?;
        self.report.moves += 1;
        if let Some(fault) = self.offset_fault.as_ref().or(self.tool_fault.as_ref()) {
            return refuse(block, 0, fault.clone());
        }
        if self.control.tcp && !self.control.can_tcp() {
            return refuse(block, 0, CompensateFault::NoTcp);
        }
        let tilted = !self.control.frame.is_straight() && !self.control.frame.keeps(self.control.length_axis);
        if !self.control.tcp && tilted && self.control.length != 0.0 {
            let what = "a tilted frame without tool centre point function".to_string();
            return refuse(block, 0, CompensateFault::Frame { what });
        }
        if motion.kind == MotionKind::Cycle || self.state.modes().modal_call {
            return self.cycle(block, motion, target, out);
        }
        match motion.kind {
            MotionKind::Rapid | MotionKind::Linear | MotionKind::Unstated => {
                self.straight(block, motion, target, out)
            }
            MotionKind::ArcCw | MotionKind::ArcCcw => self.arc(block, motion, target, out),
            MotionKind::Cycle | MotionKind::Other => {
                let what = format!("the motion `{}`", line_text(block));
                refuse(block, 0, CompensateFault::OtherMotion { what })
            }
        }
    }

    /// Program coordinates at the end of the block, m or rad.
    fn target(&mut self, block: &Block, motion: &Motion) -> Result<Vec<f64>> {
        for word in block.words() {
            self.comma |= self.dialect == Dialect::Heidenhain && block.text(&word.value_span).contains(',');
            let address = word.address.as_str();
            let followed = self.control.axes.iter().any(|a| a.address == address);
            let polar = match self.dialect {
                Dialect::Siemens => matches!(address, "AP" | "RP"),
                Dialect::Heidenhain => matches!(address, "PR" | "PA"),
                Dialect::Rs274 => false,
            };
            if polar {
                let what = format!("polar coordinates (`{address}`)");
                return refuse(block, word.span.start, CompensateFault::OtherMotion { what });
            }
            let vector = matches!(
                address,
                "A2" | "B2" | "C2" | "A3" | "B3" | "C3" | "LEAD" | "TILT" | "TX" | "TY" | "TZ"
            );
            let straight =
                matches!(motion.kind, MotionKind::Rapid | MotionKind::Linear | MotionKind::Unstated);
            let by_ijk = self.dialect == Dialect::Rs274
                && self.control.tcp
                && straight
                && matches!(address, "I" | "J" | "K");
            if !followed && ((vector && self.dialect != Dialect::Rs274) || by_ijk) {
                let address = address.to_string();
                return refuse(block, word.span.start, CompensateFault::ToolVector { address });
            }
        }
        let mut target = self.meant.program.clone();
        for (i, index) in motion.words.iter().enumerate() {
            let Some(index) = *index else { continue };
            let word = &block.words()[index];
            let address = word.address.clone();
            let Value::Number(number) = word.value else {
                let text = block.text(&word.value_span).chars().take(40).collect();
                return refuse(block, word.span.start, CompensateFault::Expression { address, text });
            };
            let rotary = self.control.axes[i].rotary;
            let seen = &mut self.decimals[usize::from(rotary)];
            *seen = (*seen).max(number.decimals.min(6));
            let value = self.control.si(i, number.value);
            let now = target[i];
            let turn = std::f64::consts::TAU;
            let upward = (value - now).rem_euclid(turn);
            target[i] = match self.how(word.how) {
                How::Incremental if self.status[i] != Status::Placed => {
                    return refuse(block, word.span.start, CompensateFault::UnknownStart { address });
                }
                How::Incremental => now + value,
                // Within a turn, the way that the word says.
                How::Shortest if upward > 0.5 * turn => now + upward - turn,
                How::Shortest | How::Positive => now + upward,
                How::Negative if upward > 0.0 => now + upward - turn,
                How::Negative => now,
                _ => value,
            };
            self.status[i] = Status::Placed;
        }
        Ok(target)
    }

    /// What a word means, modes included.
    pub fn how(&self, how: How) -> How {
        match how {
            How::Modal if self.state.modes().distance == Some(crate::nc::Distance::Incremental) => {
                How::Incremental
            }
            How::Modal => How::Absolute,
            how => how,
        }
    }

    /// Digits behind the point for an axis.
    pub fn places(&self, axis: usize) -> usize {
        let rotary = self.control.axes[axis].rotary;
        let least = if !rotary && self.control.units == Units::Inch { 4 } else { 3 };
        self.options.decimals.unwrap_or_else(|| self.decimals[usize::from(rotary)].max(least))
    }

    /// Commands that may be written: their axis has a place in the program. Where the tip is programmed the three linear ones go
    /// together.
    pub fn free(&self) -> Vec<bool> {
        let mut free = vec![false; self.machine.commands().len()];
        for (axis, status) in self.control.axes.iter().zip(&self.status) {
            if let Some((c, _)) = axis.command {
                free[c] = *status == Status::Placed || (self.control.tcp && axis.tip.is_some());
            }
        }
        free
    }

    pub fn is_prismatic(&self, command: usize) -> bool {
        self.machine.command_joint(command).kind == JointKind::Prismatic
    }

    pub fn inverse_time(&self) -> bool {
        self.state.modes().feed == Some(Feed::InverseTime)
    }

    /// The report of what was followed.
    pub fn finish(self) -> Report {
        let unseen = self.unseen_report();
        let mut report = self.report;
        report.unseen = unseen;
        let never = self.control.axes.iter().zip(&self.status);
        report.never_programmed = never
            .filter(|(axis, status)| axis.command.is_some() && **status == Status::Never)
            .map(|(axis, _)| axis.address.clone())
            .collect();
        if report.moves == 0 {
            report.never_programmed.clear();
        }
        report
    }
}

/// Drilling cycles of Siemens: what they do lies on the tool axis at the place of the block.
fn is_drilling(name: &str) -> bool {
    let number = name.strip_prefix("CYCLE").and_then(|n| n.parse::<u32>().ok());
    matches!(number, Some(81..=89 | 840))
}

/// A block that cannot be written is told by whoever owns the output.
pub(super) fn put(block: &Block, out: &mut dyn Write) -> Result<()> {
    put_bytes(&block.output(), out)
}

pub(super) fn put_bytes(bytes: &[u8], out: &mut dyn Write) -> Result<()> {
    out.write_all(bytes).map_err(|e| Error::file("output", e))
}

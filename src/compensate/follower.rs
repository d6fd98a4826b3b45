//! Follows a program block by block as its control would, twice over: where the program means to be, and
//! where what has been written brings the machine.

use std::io::Write;

use super::Options;
use super::control::Control;
use super::correct::Left;
use super::fault::CompensateFault;
use super::frame::{self, Change, has_g};
use super::gaps::Gaps;
use super::model::Model;
use super::report::Report;
use super::setup::Setup;
use super::tool::Tool;
use super::ways::Ways;
use crate::error::{Error, Result};
use crate::inverse::{Inverse, Mode};
use crate::machine::{JointKind, Machine};
use crate::nc::{Block, Dialect, Feed, Kind, Modes, Motion, MotionKind, State};

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
    pub ways: Ways,
    /// Only looks where the program goes; nothing is corrected.
    pub scouting: bool,
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
    pub tool: Tool,
    /// Why the next motion cannot be corrected.
    pub tool_fault: Option<CompensateFault>,
    offset_fault: Option<CompensateFault>,
    /// Only looks what the set-up does not say; nothing is corrected.
    pub gaps: Option<Gaps>,
    /// Behind M2 or M30.
    pub ended: bool,
}

/// A refusal at a byte of a block.
pub(super) fn refuse<T>(block: &Block, byte: usize, fault: CompensateFault) -> Result<T> {
    Err(Error::input(block.place(byte), fault))
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
        first: &[i8],
    ) -> Self {
        let control = Control::new(machine, setup);
        let inverse = Inverse::new(machine);
        let inverse = options.mode.map_or(inverse.clone(), |mode| inverse.with_mode(mode));
        let state = State::new(dialect, control.axes.iter().map(|a| a.address.clone()));
        let count = control.axes.len();
        let start = Position { q: vec![0.0; machine.commands().len()], program: vec![0.0; count] };
        let slides = inverse.with_mode(Mode::Position);
        model.restart(first);
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
            ways: Ways::new(count, machine.commands().len()),
            scouting: false,
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
            gaps: None,
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
                self.ways.sure[i] = true;
            }
        }
        if let Some(q) = self.control.joints(&program, &self.meant.q.clone()) {
            self.meant = Position { q, program };
            self.written = self.meant.clone();
        }
        self.control.tcp = tcp;
        self.refresh();
        let q = self.meant.q.clone();
        self.tell(None, &q);
    }

    /// Follows one block and writes it, with what stands in its place.
    ///
    /// # Errors
    /// [`Error::Input`] where it cannot be read or corrected.
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
            let first = has_g(block, 28.0) || has_g(block, 74.0);
            self.park(block, first);
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

    /// Coordinates mean something else now; the machine has not moved.
    pub fn refresh(&mut self) {
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
        self.ways.sure.fill(false);
        Ok(())
    }

    /// The axis of the tool length is behind a cycle wherever the cycle leaves it.
    pub fn leave_normal(&mut self) {
        let normal = self.control.normal;
        for i in (0..self.status.len()).filter(|i| self.control.axes[*i].tip == Some(normal)) {
            self.ways.sure[i] = false;
            if self.status[i] == Status::Placed {
                self.status[i] = Status::Parked;
            }
        }
    }

    /// Axes named (all, if none is) stand at a reference point; `first`: at the one that the set-up may say.
    fn park(&mut self, block: &Block, first: bool) {
        let is_named = |address: &str| block.words().iter().any(|w| w.address == address);
        let none = !self.control.axes.iter().any(|a| is_named(&a.address));
        let mut told = Vec::new();
        for (i, axis) in self.control.axes.iter().enumerate() {
            if none || is_named(&axis.address) {
                self.status[i] = Status::Parked;
                self.ways.sure[i] = false;
                let place = self.control.setup.reference(&axis.address, axis.rotary).filter(|_| first);
                told.extend(place.map(|place| (i, place)));
            }
        }
        self.refer(&told);
    }

    /// `G53`, `SUPA`: the numbers are places of the machine, and stay.
    fn machine_move(&mut self, block: &Block, motion: &Motion) {
        for i in 0..motion.words.len() {
            let Some(word) = motion.words[i] else { continue };
            self.status[i] = Status::Parked;
            self.ways.sure[i] = false;
            if let Some(value) = block.words()[word].number()
                && let Some((c, q)) = self.control.machine_joint(i, self.control.si(i, value))
            {
                (self.meant.q[c], self.written.q[c]) = (q, q);
                self.ways.sure[i] = true;
            }
        }
        let q = self.meant.q.clone();
        self.tell(None, &q);
        self.refresh();
        self.written_motion = Some(motion.kind);
        self.report.machine_moves += 1;
    }

    fn motion(&mut self, block: &mut Block, motion: &Motion, out: &mut dyn Write) -> Result<()> {
        if let Some(gaps) = &mut self.gaps {
            gaps.keep(block.line(), self.offset_fault.iter().chain(&self.tool_fault));
            return Ok(());
        }
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
        if self.scouting {
            return self.scout(block, motion, target);
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

    /// Commands that may be written: their axis has a place in the program. Where the tip is programmed the
    /// three linear ones go together.
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
        (report.left_out, report.held) = (self.model.left_out().to_vec(), self.model.held().to_vec());
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

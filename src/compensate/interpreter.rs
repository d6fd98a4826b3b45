//! The interpreter: what a control knows behind each block of a program, and where the block goes.
//!
//! It knows nothing of the machine's errors. Whoever corrects the program tells it where each move ends, as meant and as
//! written; where nothing is corrected both are one.

use super::call::{self, is_drilling};
use super::code::{ends, has_g, refers};
use super::control::Control;
use super::event::{Event, Events};
use super::fault::CompensateFault;
use super::frame::Change;
use super::places::Places;
use super::position::Position;
use super::refusal::{line_text, refuse};
use super::setup::Setup;
use super::target;
use super::tool::Tool;
use super::ways::Ways;
use crate::error::Result;
use crate::few::Few;
use crate::machine::Machine;
use crate::nc::{Block, Dialect, How, Kind, Modes, Motion, MotionKind, State, Step};

/// The state of a program that is followed block by block.
#[derive(Clone)]
pub(super) struct Interpreter<'a> {
    control: Control<'a>,
    state: State,
    dialect: Dialect,
    /// Where the program means to be.
    meant: Position,
    /// Where the control takes the machine by what has been written.
    written: Position,
    places: Places,
    ways: Ways,
    tool: Tool,
    /// Why the next motion cannot be followed.
    tool_fault: Option<CompensateFault>,
    offset_fault: Option<CompensateFault>,
    /// The cycle that a Siemens program calls behind every block that moves.
    modal_cycle: Option<String>,
    /// `G90.1`: centres of arcs are absolute.
    absolute_centre: bool,
    /// The feed in force, and how it is written.
    feed: Option<(f64, String)>,
    /// Behind M2 or M30.
    ended: bool,
}

impl<'a> Interpreter<'a> {
    /// At the start of a program, with what the set-up says of it.
    pub fn new(machine: &'a Machine, setup: &'a Setup, dialect: Dialect) -> Self {
        let control = Control::new(machine, setup);
        let state = State::new(dialect, control.axes().iter().map(|a| a.address()));
        let (axes, commands) = (control.axes().len(), machine.commands().len());
        let start = Position::new(Few::from_elem(0.0, commands), Few::from_elem(0.0, axes));
        let mut interpreter = Interpreter {
            control,
            state,
            dialect,
            meant: start.clone(),
            written: start,
            places: Places::new(axes),
            ways: Ways::new(axes, commands),
            tool: Tool::new(setup.tool_at_start()),
            tool_fault: None,
            offset_fault: None,
            modal_cycle: None,
            absolute_centre: false,
            feed: None,
            ended: false,
        };
        interpreter.begin(setup);
        interpreter
    }

    /// Takes up what the set-up says of the start.
    fn begin(&mut self, setup: &Setup) {
        if let Some(name) = setup.offset_at_start() {
            self.take_offset(name);
        }
        self.take_lengths();
        // Where axes stand is said joint by joint.
        let tcp = self.control.tcp();
        self.control.set_tcp(false);
        let mut program = Few::from_elem(0.0, self.places.len());
        for (i, axis) in self.control.axes().iter().enumerate() {
            if let Some(value) = setup.start(axis.address(), axis.is_rotary()) {
                program[i] = value;
                self.places.place(i);
            }
        }
        if let Some(q) = self.control.joints(&program, self.meant.q()) {
            self.meant = Position::new(q, program);
            self.written = self.meant.clone();
        }
        self.control.set_tcp(tcp);
        self.rename();
    }

    /// Whether both stand alike, to the last bit where they are: of one machine and set-up.
    pub fn is_as(&self, other: &Interpreter) -> bool {
        self.meant.is_as(&other.meant)
            && self.written.is_as(&other.written)
            && self.control.is_as(&other.control)
            && self.state == other.state
            && self.places == other.places
            && self.ways == other.ways
            && self.tool == other.tool
            // What is missing follows from the tool and the offset.
            && self.missing().count() == other.missing().count()
            && self.modal_cycle == other.modal_cycle
            && self.absolute_centre == other.absolute_centre
            && self.feed == other.feed
            && self.ended == other.ended
    }

    /// What moves need of the set-up and it does not say.
    pub fn missing(&self) -> impl Iterator<Item = &CompensateFault> {
        self.offset_fault.iter().chain(&self.tool_fault)
    }

    /// Follows one block; what it makes happen.
    ///
    /// # Errors
    /// [`Error::Input`](crate::error::Error::Input) where it cannot be read or followed.
    pub fn block(&mut self, block: &Block) -> Result<Events> {
        let mut events = Events::new();
        if self.ended {
            return Ok(events);
        }
        if block.is_plain_motion() && !self.state.modes().modal_call {
            events.extend(self.plain_motion(block)?);
            return Ok(events);
        }
        if has_g(block, 90.1) || has_g(block, 91.1) {
            self.absolute_centre = has_g(block, 90.1);
        }
        let before = self.state.modes().clone();
        let step = self.state.apply(block)?;
        if let Some(mark) = block.tokens().iter().find(|t| t.kind == Kind::Skip)
            && (changes(&step)
                || *self.state.modes() != before
                || has_g(block, 90.1)
                || has_g(block, 91.1)
                || ends(block)
                || refers(block, self.dialect))
        {
            return refuse(block, mark.span.start, CompensateFault::Skipped);
        }
        self.change_modes(block, &before, &mut events);
        if self.state.modes().feed != before.feed && before.feed.is_some() {
            self.feed = None;
        }
        if let Some(word) = block.words().iter().find(|w| w.address == "F") {
            self.feed = word.number().map(|feed| (feed, block.text(&word.value_span)));
        }
        if step.jumps {
            return refuse(block, 0, CompensateFault::Jump { what: line_text(block) });
        }
        if let Some(piece) = &step.unfollowed {
            let text = block.text(&piece.span).chars().take(60).collect();
            return refuse(block, piece.span.start, CompensateFault::NotFollowed { what: piece.what, text });
        }
        if step.changes_frame {
            events.extend(self.preset(block));
            self.change_frame(block)?;
        }
        if let Some(cycle) = call::modal_of(block) {
            self.modal_cycle = cycle;
        }
        let drills = self.state.modes().modal_call && self.modal_cycle.as_deref().is_some_and(is_drilling);
        if step.calls && !(drills && step.motion.is_some()) {
            self.call(block, &mut events)?;
        }
        self.run_functions(block, &step)?;
        if refers(block, self.dialect) {
            self.refer(block, &mut events);
        }
        if let Some(motion) = step.motion {
            check(block)?;
            if motion.machine_frame {
                self.machine_move(block, &motion, &mut events);
            } else {
                events.push(self.motion(block, motion)?);
            }
        }
        self.ended = ends(block);
        Ok(events)
    }

    /// The short way through [`Interpreter::block`] for a block that can change no more than where axes are, the motion and the feed.
    fn plain_motion(&mut self, block: &Block) -> Result<Option<Event>> {
        let (motion, unfollowed) = match self.state.apply_plain(block) {
            Some(motion) => (motion, None),
            None => {
                let step = self.state.apply(block)?;
                (step.motion, step.unfollowed)
            }
        };
        if let Some(word) = block.words().iter().find(|w| w.address == "F") {
            self.feed = word.number().map(|feed| (feed, block.text(&word.value_span)));
        }
        if let Some(piece) = &unfollowed {
            let text = block.text(&piece.span).chars().take(60).collect();
            return refuse(block, piece.span.start, CompensateFault::NotFollowed { what: piece.what, text });
        }
        motion.map(|motion| self.motion(block, motion)).transpose()
    }

    /// M codes, tools and positions beside the words of the block, which send axes elsewhere.
    fn run_functions(&mut self, block: &Block, step: &Step) -> Result<()> {
        for &index in &step.unknown_functions {
            let span = &block.words()[index].span;
            let code = block.text(span).to_ascii_uppercase();
            match self.control.setup().moved_by(&code) {
                Some(axes) => self.lose_named(axes),
                None if step.motion.is_some() || step.changes_tool => {
                    return refuse(block, span.start, CompensateFault::UnknownFunction { code });
                }
                None => self.places.lose_all(),
            }
        }
        if step.changes_tool {
            self.leave_for_tool();
        }
        for axis in positioned(block) {
            let which = self.control.axes().iter().position(|a| a.address() == axis);
            match which {
                Some(axis) => self.places.lose(axis),
                None => self.places.lose_all(),
            }
        }
        Ok(())
    }

    /// Modes that this block has changed.
    fn change_modes(&mut self, block: &Block, before: &Modes, events: &mut Events) {
        let now = self.state.modes();
        let mut changed = false;
        if let Some(units) = now.units
            && units != self.control.units()
        {
            self.control.set_units(units);
            events.push(Event::Units);
            changed = true;
        }
        if now.tool_centre_point != before.tool_centre_point {
            self.control.set_tcp(now.tool_centre_point == Some(true));
            changed = true;
        }
        for word in block.words().iter().filter(|w| matches!(w.address.as_str(), "M" | "G")) {
            let text = block.text(&word.span).to_ascii_uppercase();
            if let Some(on) = self.control.setup().tcp_by(&text) {
                self.control.set_tcp(on);
                changed = true;
            }
        }
        if now.plane != before.plane {
            self.control.set_plane(now.plane, self.dialect == Dialect::Siemens);
            changed = true;
        }
        let in_spindle = self.tool.in_spindle().map(String::from);
        let tool = self.tool.change(block, self.dialect, before, now);
        let offset = now.work_offset.clone().filter(|_| now.work_offset != before.work_offset);
        if let Some(name) = offset {
            self.take_offset(name);
            changed = true;
        }
        if tool {
            self.take_lengths();
            if self.tool.in_spindle() != in_spindle.as_deref() {
                self.leave_for_tool();
            } else {
                // Some controls go by the new length at once.
                self.leave_along(self.control.length_axis());
            }
        }
        if changed || tool {
            self.rename();
        }
    }

    fn take_offset(&mut self, name: String) {
        let known = self.control.set_offset(Some(&name));
        self.offset_fault = (!known).then_some(CompensateFault::UnknownOffset { name });
    }

    fn take_lengths(&mut self) {
        let lengths = self.tool.lengths(self.control.setup(), self.dialect, self.state.modes());
        self.control.set_lengths(lengths.counted(), lengths.tip());
        self.tool_fault = lengths.fault();
    }

    /// Coordinates mean something else now; the machine has not moved.
    fn rename(&mut self) {
        self.control.rename(&mut self.meant);
        self.control.rename(&mut self.written);
    }

    fn change_frame(&mut self, block: &Block) -> Result<()> {
        let place: Vec<Option<f64>> = (self.meant.program().iter().enumerate())
            .map(|(i, at)| self.places.is_placed(i).then_some(*at))
            .collect();
        let plane = self.state.modes().plane;
        match self.control.change_frame(block, self.dialect, plane, &place) {
            Change::Followed => {
                self.rename();
                Ok(())
            }
            Change::Unknown(what) => {
                let what = what.chars().take(60).collect();
                refuse(block, 0, CompensateFault::Frame { what })
            }
            Change::Unplaced(axis) => {
                let address = self.control.axes()[axis].address().to_string();
                refuse(block, 0, CompensateFault::UnknownStart { address })
            }
        }
    }

    /// `G92`: the control gives its numbers to the place where it has been sent, not to the one that is meant; by how much each
    /// number has to differ for that.
    fn preset(&self, block: &Block) -> Option<Event> {
        if self.dialect == Dialect::Siemens || !has_g(block, 92.0) {
            return None;
        }
        let by = |(i, axis): (usize, &super::axis::Axis)| {
            let word = block.words().iter().position(|w| w.address == axis.address())?;
            Some((word, i, self.written.program()[i] - self.meant.program()[i]))
        };
        Some(Event::Preset { words: self.control.axes().iter().enumerate().filter_map(by).collect() })
    }

    /// A call that is left alone leaves every axis somewhere.
    fn call(&mut self, block: &Block, events: &mut Events) -> Result<()> {
        let name = call::name_of(block);
        if self.dialect == Dialect::Siemens && is_drilling(&name) {
            self.leave_normal();
            events.push(Event::Drilled);
            return Ok(());
        }
        if !self.control.setup().leaves_alone(&name) {
            return refuse(block, 0, CompensateFault::Call { what: name });
        }
        self.places.lose_all();
        Ok(())
    }

    /// A tool is changed where the machine does that; the linear axes are there then, or those that the set-up says.
    fn leave_for_tool(&mut self) {
        match self.control.setup().moved_by("M6") {
            Some(axes) => self.lose_named(axes),
            None => {
                let linear = |i: &usize| !self.control.axes()[*i].is_rotary();
                (0..self.places.len()).filter(linear).for_each(|i| self.places.lose(i));
            }
        }
    }

    fn lose_named(&mut self, axes: &[String]) {
        let named = |i: &usize| axes.iter().any(|axis| axis == self.control.axes()[*i].address());
        (0..self.places.len()).filter(named).for_each(|i| self.places.lose(i));
    }

    /// The axis of the tool length is behind a cycle wherever the cycle leaves it.
    pub fn leave_normal(&mut self) {
        self.leave_along(self.control.normal());
    }

    /// The axis of this component of the tip is somewhere else.
    fn leave_along(&mut self, component: usize) {
        for (i, _) in self.control.axes().iter().enumerate().filter(|(_, a)| a.tip() == Some(component)) {
            self.places.lose(i);
        }
    }

    /// Axes named (all, if none is) stand at a reference point; at the first one the set-up may say where that is.
    fn refer(&mut self, block: &Block, events: &mut Events) {
        let first = has_g(block, 28.0) || has_g(block, 74.0);
        let is_named = |address: &str| block.words().iter().any(|w| w.address == address);
        let none = !self.control.axes().iter().any(|a| is_named(a.address()));
        let mut told = Vec::new();
        for (i, axis) in self.control.axes().iter().enumerate() {
            if none || is_named(axis.address()) {
                self.places.park(i);
                let place = self.control.setup().reference(axis.address(), axis.is_rotary());
                told.extend(place.filter(|_| first).map(|place| (i, place)));
            }
        }
        for (i, place) in &told {
            self.stand(*i, *place);
        }
        events.push(self.sent(None));
        // Known is where they stand, but not on which way they went there.
        told.iter().for_each(|(i, _)| self.places.assure(*i));
        self.ways.assure(told.iter().map(|(i, _)| *i), &self.control, &self.places);
        self.rename();
    }

    /// `G53`, `SUPA`: the numbers are places of the machine, and stay.
    fn machine_move(&mut self, block: &Block, motion: &Motion, events: &mut Events) {
        for (i, word) in motion.words.iter().enumerate() {
            let Some(word) = *word else { continue };
            self.places.park(i);
            if let Some(value) = block.words()[word].number()
                && self.stand(i, self.control.si(i, value))
            {
                self.places.assure(i);
            }
        }
        events.push(self.sent(Some(motion.kind)));
        self.rename();
    }

    /// The axis stands at a place in the machine's own frame, m or rad; whether it has a joint there.
    fn stand(&mut self, axis: usize, place: f64) -> bool {
        let joint = self.control.machine_joint(axis, place);
        if let Some((c, q)) = joint {
            self.meant.set_joint(c, q);
            self.written.set_joint(c, q);
        }
        joint.is_some()
    }

    fn sent(&mut self, kind: Option<MotionKind>) -> Event {
        Event::Sent { q: Few::from_slice(self.meant.q()), ways: self.take_way(), kind }
    }

    /// A move under program coordinates.
    fn motion(&mut self, block: &Block, motion: Motion) -> Result<Event> {
        let modes = self.state.modes();
        target::check(block, &motion, &self.control, self.dialect)?;
        let target = target::of(block, &motion, &self.control, modes, &self.places, self.meant.program())?;
        let drills = motion.kind == MotionKind::Cycle || modes.modal_call;
        for (i, _) in motion.words.iter().enumerate().filter(|(_, word)| word.is_some()) {
            self.places.place(i);
        }
        if let Some(fault) = self.missing().next() {
            return refuse(block, 0, fault.clone());
        }
        if self.control.tcp() && !self.control.can_tcp() {
            return refuse(block, 0, CompensateFault::NoTcp);
        }
        if self.control.tilts_length() {
            let what = "a tilted frame without tool centre point function".to_string();
            return refuse(block, 0, CompensateFault::Frame { what });
        }
        Ok(Event::Move { motion, target, drills })
    }

    /// The number of a preset has been written smaller by so much, m or rad, than the place that it names.
    pub fn set_slip(&mut self, axis: usize, slip: f64) {
        self.control.set_slip(axis, slip);
    }

    /// Takes a position as reached.
    pub fn arrive(&mut self, meant: Position, written: Position) {
        (self.meant, self.written) = (meant, written);
    }

    /// Joint commands of program coordinates; a place that the linear axes cannot bring about is refused.
    pub fn joints(&self, block: &Block, program: &[f64]) -> Result<Few<f64>> {
        match self.control.joints(program, self.meant.q()) {
            Some(q) => Ok(q),
            None => refuse(block, 0, CompensateFault::NoTcp),
        }
    }

    /// Commands that may be written: their axis has a place in the program. Where the tip is programmed the
    /// three linear ones go together.
    pub fn free(&self) -> Few<bool> {
        let mut free = Few::from_elem(false, self.control.machine().commands().len());
        for (i, axis) in self.control.axes().iter().enumerate() {
            if let Some((c, _)) = axis.command() {
                free[c] = self.places.is_placed(i) || (self.control.tcp() && axis.tip().is_some());
            }
        }
        free
    }

    /// By command: whether the way from the position last told to the one in force is known.
    pub fn open_ways(&self) -> Few<bool> {
        self.ways.open(&self.control, &self.places)
    }

    /// Goes to a position in force; by command whether its way there is known.
    pub fn take_way(&mut self) -> Few<bool> {
        self.ways.take(&self.control, &self.places)
    }

    /// What a word means, modes included.
    pub fn meaning(&self, how: How) -> How {
        target::meaning(how, self.state.modes())
    }

    pub fn control(&self) -> &Control<'a> {
        &self.control
    }

    pub fn modes(&self) -> &Modes {
        self.state.modes()
    }

    pub fn dialect(&self) -> Dialect {
        self.dialect
    }

    pub fn places(&self) -> &Places {
        &self.places
    }

    /// Where the program means to be.
    pub fn meant(&self) -> &Position {
        &self.meant
    }

    /// Where the control takes the machine by what has been written.
    pub fn written(&self) -> &Position {
        &self.written
    }

    /// The feed in force, if one is, and how it is written.
    pub fn feed(&self) -> Option<(f64, &str)> {
        self.feed.as_ref().map(|(feed, text)| (*feed, text.as_str()))
    }

    /// Whether centres of arcs are absolute.
    pub fn absolute_centre(&self) -> bool {
        self.absolute_centre
    }

    /// Whether the program has ended.
    pub fn ended(&self) -> bool {
        self.ended
    }
}

/// Whether a step leaves anything otherwise than it was, modes aside.
fn changes(step: &Step) -> bool {
    step.motion.is_some()
        || step.changes_frame
        || step.calls
        || step.jumps
        || step.changes_tool
        || !step.unknown_functions.is_empty()
}

/// Axes that the block positions beside its words, `POS[X]=10`.
fn positioned(block: &Block) -> Vec<String> {
    let of = |text: String| {
        let inner = ["POS[", "POSA[", "POSP[", "MOV["].iter().find_map(|start| text.strip_prefix(start))?;
        inner.split([']', ',']).next().map(|axis| axis.trim().to_string())
    };
    let others = block.tokens().iter().filter(|t| t.kind == Kind::Other);
    others.filter_map(|t| of(block.text(&t.span).to_ascii_uppercase())).collect()
}

/// What may not stand in a block that moves.
fn check(block: &Block) -> Result<()> {
    for token in block.tokens().iter().filter(|t| t.kind == Kind::Other) {
        let text = block.text(&token.span).to_ascii_uppercase();
        if ["POS[", "POSA[", "POSP[", "MOV["].iter().any(|start| text.starts_with(start)) {
            let what = format!("positioning by `{text}`");
            return refuse(block, token.span.start, CompensateFault::OtherMotion { what });
        }
    }
    Ok(())
}

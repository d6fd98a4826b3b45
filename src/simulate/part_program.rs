//! The motion of an NC program: lines, arcs and rapid motion along a path with real acceleration.

use std::collections::VecDeque;
use std::io::BufRead;
use std::path::{Path, PathBuf};

use super::course::{At, Course, Sample, Samples};
use super::follow::{commands_of, follow};
use super::profile::Profile;
use super::segment::{Arc, Segment};
use crate::chain::Chain;
use crate::error::{Error, Place, Result};
use crate::lie::Vec3;
use crate::machine::{JointKind, Machine};
use crate::nc::{
    Block, Coordinate, Feed, How, Kind, Motion, MotionKind, Plane, Program, State, Step, Token, Units, Why,
};

/// Blocks that the speed is planned ahead for; the path can stop behind them.
const AHEAD: usize = 256;
/// Coordinates beyond this are mistakes, m or rad.
const FURTHEST: f64 = 1e4;

/// How a program is run.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Whether coordinates are those of the tool centre point; `None`: as the program says.
    pub tool_centre_point: Option<bool>,
    /// Point of frame `t` that the coordinates of the tool centre point mean, m.
    pub tool_point_t: Vec3<f64>,
    /// Feed where the program states none, m/s.
    pub feed: f64,
    /// Speed of rapid motion, m/s.
    pub rapid: f64,
    /// Largest speed of rotary axes, rad/s.
    pub rapid_rotary: f64,
    /// Acceleration along the path, m/s².
    pub acceleration: f64,
    /// Acceleration where only rotary axes move, rad/s².
    pub rotary_acceleration: f64,
    /// Corners sharper than this stop the path, rad.
    pub corner: f64,
    /// Samples a second.
    pub rate: f64,
    /// Leaves out the samples of the approach: the rapid motion at the start or, without any, the first block that moves.
    pub without_approach: bool,
}

/// An NC program as a course. Variables, sub-programs, cycles and frames are not evaluated: a program that needs them is refused with
/// the line.
#[derive(Clone, Debug)]
pub struct PartProgram {
    path: PathBuf,
    machine: Machine,
    chain: Chain<f64>,
    drive: Drive,
    start: Vec<f64>,
    linear: Vec<usize>,
    /// Commands whose NC addresses are X, Y and Z.
    xyz: [Option<usize>; 3],
}

impl PartProgram {
    /// The program in a file; `start`: commands before its first block, m or rad.
    pub fn new(path: impl AsRef<Path>, machine: &Machine, drive: Drive, start: Vec<f64>) -> PartProgram {
        let address = |letter: &str| {
            (0..machine.commands().len()).find(|c| machine.command_joint(*c).nc_word().address == letter)
        };
        PartProgram {
            path: path.as_ref().to_path_buf(),
            chain: Chain::nominal(machine),
            linear: commands_of(machine, JointKind::Prismatic),
            xyz: ["X", "Y", "Z"].map(address),
            machine: machine.clone(),
            drive,
            start,
        }
    }

    fn signs(&self) -> Vec<f64> {
        (0..self.machine.commands().len())
            .map(|c| f64::from(self.machine.command_joint(c).nc_word().sign))
            .collect()
    }

    /// Commands for programmed coordinates, near `q`.
    fn commands(&self, point: &[f64], tip: bool, q: &mut [f64], line: usize) -> Result<()> {
        for (c, sign) in self.signs().into_iter().enumerate() {
            if !(tip && self.linear.contains(&c)) {
                q[c] = sign * point[c];
            }
        }
        if tip {
            let mut target = [0.0; 3];
            for (value, c) in target.iter_mut().zip(self.xyz) {
                let Some(c) = c else {
                    return Err(self.wrong(
                        line,
                        "the tool centre point needs axes X, Y and Z",
                        "give the joints these NC addresses, `nc:`, or run with --tcp off",
                    ));
                };
                *value = point[c];
            }
            let left =
                follow(&self.chain, &self.machine, &self.linear, self.drive.tool_point_t, Vec3(target), q);
            if left > 1e-9 {
                return Err(self.wrong(
                    line,
                    format!("the linear axes miss the tool centre point by {:.3} mm", left * 1e3),
                    "run with --tcp off, or on a machine whose linear axes reach every point",
                ));
            }
        }
        Ok(())
    }

    /// Programmed coordinates of commands.
    fn coordinates(&self, q: &[f64], tip: bool) -> Vec<f64> {
        let mut point: Vec<f64> = self.signs().iter().zip(q).map(|(sign, q)| sign * q).collect();
        if tip {
            let p_w = self.chain.w_from_t(q).transform(self.drive.tool_point_t);
            for (value, c) in p_w.0.into_iter().zip(self.xyz) {
                c.into_iter().for_each(|c| point[c] = value);
            }
        }
        point
    }

    fn wrong(&self, line: usize, message: impl Into<String>, mend: impl Into<String>) -> Error {
        Error::mistake(Place::at(&self.path, line, 0), message.into(), mend.into())
    }
}

impl Course for PartProgram {
    fn samples(&self) -> Result<Samples<'_>> {
        let program = Program::open(&self.path)?;
        let addresses =
            (0..self.machine.commands().len()).map(|c| self.machine.command_joint(c).nc_word().address);
        let state = State::new(program.dialect(), addresses);
        Ok(Box::new(Running {
            reader: Reader {
                source: self,
                program,
                state,
                now: self.coordinates(&self.start, false),
                tip: false,
                q: self.start.clone(),
                feed: None,
                approach: Approach::Before,
                ended: false,
            },
            queue: VecDeque::new(),
            current: None,
            entry: 0.0,
            begins: 0.0,
            next: 0,
            q: self.start.clone(),
            finished: false,
        }))
    }
}

/// Blocks into segments.
struct Reader<'a, R> {
    source: &'a PartProgram,
    program: Program<R>,
    state: State,
    /// Programmed coordinates where the last segment ended, m and rad.
    now: Vec<f64>,
    tip: bool,
    /// Commands there.
    q: Vec<f64>,
    /// The last `F`, in programmed units.
    feed: Option<f64>,
    approach: Approach,
    ended: bool,
}

/// How far the program has come in its approach.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Approach {
    /// Nothing has moved.
    Before,
    /// Rapid motion only.
    Rapid,
    Over,
}

impl<R: BufRead> Reader<'_, R> {
    /// The next block that moves or dwells.
    fn next_segment(&mut self) -> Result<Option<Segment>> {
        while !self.ended {
            let Some(block) = self.program.next_block()? else { break };
            let step = self.state.apply(&block)?;
            self.check(&block, &step)?;
            if let Some(word) = block.words().iter().find(|w| w.address == "F") {
                self.feed = word.number();
            }
            let tip =
                self.source.drive.tool_centre_point.or(self.state.modes().tool_centre_point) == Some(true);
            if tip != self.tip {
                self.now = self.source.coordinates(&self.q, tip);
                self.tip = tip;
            }
            if let Some(seconds) = dwell(&block) {
                return Ok(Some(self.standing(block.line(), seconds)));
            }
            if let Some(motion) = step.motion {
                let segment = self.segment(&block, &motion)?;
                self.now = segment.end.clone();
                self.source.commands(&self.now, tip, &mut self.q, motion.line)?;
                return Ok(Some(segment));
            }
        }
        self.ended = true;
        Ok(None)
    }

    /// Refuses what moves the machine in ways that are not evaluated here.
    fn check(&self, block: &Block, step: &Step) -> Result<()> {
        let told = |what: &str, mend: &str| Err(self.source.wrong(block.line(), what, mend));
        if step.jumps {
            return told(
                "the program jumps here",
                "unroll loops and conditions first; they are not evaluated",
            );
        }
        if step.calls {
            return told(
                "a sub-program, macro or cycle is called here",
                "write its motion out; it is not evaluated",
            );
        }
        // A block without numbers takes a frame back.
        if step.changes_frame && has_numbers(block) {
            return told(
                "the frame of the coordinates changes here",
                "write the program in one frame; shifts and rotations are not followed",
            );
        }
        if self.state.modes().feed == Some(Feed::PerRevolution) {
            return told(
                "feed per revolution (G95) needs the spindle's speed",
                "write feeds per minute, G94",
            );
        }
        Ok(())
    }

    fn standing(&self, line: usize, seconds: f64) -> Segment {
        Segment {
            start: self.now.clone(),
            end: self.now.clone(),
            arc: None,
            length: 0.0,
            linear: false,
            speed: 1.0,
            dwell: seconds,
            approach: self.approach != Approach::Over,
            line,
            tip: self.tip,
            tangents: None,
        }
    }

    /// m or rad of one programmed unit of a command.
    fn unit(&self, c: usize) -> f64 {
        match self.source.machine.command_joint(c).kind {
            JointKind::Revolute => 1f64.to_radians(),
            JointKind::Prismatic => self.length_unit(),
        }
    }

    fn length_unit(&self) -> f64 {
        if self.state.modes().units == Some(Units::Inch) { 0.0254 } else { 1e-3 }
    }

    fn segment(&mut self, block: &Block, motion: &Motion) -> Result<Segment> {
        let source = self.source;
        let mut end = self.now.clone();
        for (c, value) in end.iter_mut().enumerate() {
            let named = motion.words[c].is_some();
            match (motion.target[c], self.state.coordinates()[c]) {
                (Some(target), _) if (target * self.unit(c)).abs() <= FURTHEST => {
                    *value = target * self.unit(c)
                }
                (Some(target), _) => {
                    let address = &self.state.addresses()[c];
                    let what = format!("{address} goes to {target}, which no machine reaches");
                    return Err(source.wrong(motion.line, what, "correct the number"));
                }
                // What the control does not know by number has not moved since; what it cannot know here has.
                (None, Coordinate::Lost { line, why, .. }) if named || !stands(why) => {
                    let address = &self.state.addresses()[c];
                    return Err(source.wrong(
                        motion.line,
                        format!("where {address} stands is not known since line {line}"),
                        "expressions, frames, cycles and calls are not evaluated: write coordinates as numbers",
                    ));
                }
                _ => {}
            }
        }
        let mut segment = self.standing(motion.line, 0.0);
        segment.end = end;
        let rapid = match motion.kind {
            MotionKind::Rapid => true,
            MotionKind::Linear | MotionKind::Unstated => false,
            MotionKind::ArcCw | MotionKind::ArcCcw => {
                segment.arc = Some(self.arc(block, motion, &segment)?);
                false
            }
            MotionKind::Cycle | MotionKind::Other => {
                return Err(source.wrong(
                    motion.line,
                    "this block is no line and no arc",
                    "cycles, splines and probing are not evaluated: write lines or arcs",
                ));
            }
        };
        segment.approach = self.approach == Approach::Before || (self.approach == Approach::Rapid && rapid);
        if self.approach != Approach::Over {
            self.approach = if rapid { Approach::Rapid } else { Approach::Over };
        }
        segment.measure(&source.linear);
        segment.speed = self.speed(&segment, rapid);
        Ok(segment)
    }

    fn speed(&self, segment: &Segment, rapid: bool) -> f64 {
        let drive = &self.source.drive;
        let rotary = (0..segment.end.len()).filter(|c| !self.source.linear.contains(c));
        let turned = rotary.map(|c| (segment.end[c] - segment.start[c]).abs()).fold(0.0, f64::max);
        let per_minute = self.feed.filter(|f| *f > 0.0);
        let wanted = match (rapid, self.state.modes().feed, per_minute) {
            (true, ..) if segment.linear => drive.rapid,
            (true, ..) => drive.rapid_rotary,
            (_, Some(Feed::InverseTime), Some(f)) => segment.length * f / 60.0,
            (_, _, Some(f)) if segment.linear => f * self.length_unit() / 60.0,
            (_, _, Some(f)) => f.to_radians() / 60.0,
            (_, _, None) if segment.linear => drive.feed,
            _ => drive.rapid_rotary,
        };
        // Rotary axes that cannot keep up slow the path down.
        let slow = if turned > 0.0 { segment.length * drive.rapid_rotary / turned } else { f64::INFINITY };
        wanted.min(slow).max(1e-9)
    }

    fn arc(&self, block: &Block, motion: &Motion, segment: &Segment) -> Result<Arc> {
        let source = self.source;
        let told = |what: &str, mend: &str| Err(source.wrong(motion.line, what, mend));
        let (axes, offsets) = match self.state.modes().plane {
            None | Some(Plane::Xy) => ([0, 1], ["I", "J"]),
            Some(Plane::Zx) => ([2, 0], ["K", "I"]),
            Some(Plane::Yz) => ([1, 2], ["J", "K"]),
        };
        let (Some(first), Some(second)) = (source.xyz[axes[0]], source.xyz[axes[1]]) else {
            return told(
                "an arc needs the axes of its plane",
                "this machine has no joints with these NC addresses",
            );
        };
        if block.words().iter().any(|w| matches!(w.address.as_str(), "P" | "TURN" | "AR" | "AP" | "RP")) {
            return told(
                "this arc is not given by end and centre or radius",
                "write it with I, J, K or R; several turns as several blocks",
            );
        }
        let ccw = motion.kind == MotionKind::ArcCcw;
        let ends = [[segment.start[first], segment.start[second]], [segment.end[first], segment.end[second]]];
        let word = |names: &[&str]| block.words().iter().find(|w| names.contains(&w.address.as_str()));
        let unit = self.length_unit();
        let centre = match word(&["R", "CR"]).map(|w| w.number()) {
            Some(Some(radius)) => match Arc::centre_of(ends, radius * unit, ccw) {
                Some(centre) => centre,
                None => {
                    return told(
                        "no arc of this radius joins the two points",
                        "correct the radius or the end point",
                    );
                }
            },
            Some(None) => return told("the radius is an expression", "write a number"),
            None => {
                let mut centre = ends[0];
                for (value, name) in centre.iter_mut().zip(offsets) {
                    match word(&[name]).map(|w| (w.how, w.number())) {
                        None => {}
                        Some((How::Absolute, Some(at))) => *value = at * unit,
                        Some((_, Some(by))) => *value += by * unit,
                        Some((_, None)) => return told("the centre is an expression", "write a number"),
                    }
                }
                centre
            }
        };
        let arc = Arc::new([first, second], ends, centre, ccw);
        let off = (arc.radius - arc.end_radius).abs();
        if arc.radius < 1e-9 || off > (5e-3 * arc.radius).max(2e-5) {
            return told(
                &format!(
                    "the arc's radius is {:.4} mm at the start and {:.4} mm at the end",
                    arc.radius * 1e3,
                    arc.end_radius * 1e3
                ),
                "correct the centre or the end point",
            );
        }
        Ok(arc)
    }
}

/// Whether a block has numbers besides its codes: in words, or as arguments of a call.
fn has_numbers(block: &Block) -> bool {
    let codes = |address: &str| matches!(address, "G" | "N" | "M");
    let arguments = |token: &Token| {
        let text = block.text(&token.span);
        let behind = text.split_once('(').map_or("", |(_, arguments)| arguments);
        token.kind == Kind::Call && behind.contains(|c: char| c.is_ascii_digit())
    };
    block.words().iter().any(|w| !codes(&w.address)) || block.tokens().iter().any(arguments)
}

/// Whether the machine has not moved where a coordinate's number was lost for this reason.
fn stands(why: Why) -> bool {
    matches!(why, Why::Transformation | Why::Tool | Why::WorkOffset | Why::Units | Why::MachineFrame)
}

/// Seconds of a dwell, `G4 P1` or `G4 F1`.
fn dwell(block: &Block) -> Option<f64> {
    let g4 = block.words().iter().any(|w| w.address == "G" && w.number() == Some(4.0));
    let seconds = block.words().iter().find(|w| matches!(w.address.as_str(), "P" | "F" | "X" | "U"));
    g4.then(|| seconds.and_then(|w| w.number()).filter(|s| (0.0..1e6).contains(s)).unwrap_or(0.0))
}

/// Segments into samples.
struct Running<'a, R> {
    reader: Reader<'a, R>,
    queue: VecDeque<Segment>,
    current: Option<(Segment, Profile)>,
    /// Speed at which the next segment is entered.
    entry: f64,
    /// When the current segment begins, s.
    begins: f64,
    /// Number of the next sample.
    next: u64,
    q: Vec<f64>,
    finished: bool,
}

impl<R: BufRead> Running<'_, R> {
    fn fill(&mut self) -> Result<()> {
        while self.queue.len() < AHEAD {
            match self.reader.next_segment()? {
                Some(segment) => self.queue.push_back(segment),
                None => break,
            }
        }
        Ok(())
    }

    fn acceleration(&self, segment: &Segment) -> f64 {
        let drive = &self.reader.source.drive;
        if segment.linear { drive.acceleration } else { drive.rotary_acceleration }
    }

    /// Takes the next segment, with the speed at its end that the blocks behind it allow.
    fn advance(&mut self) -> Result<bool> {
        self.fill()?;
        let Some(segment) = self.queue.pop_front() else { return Ok(false) };
        let cosine = self.reader.source.drive.corner.cos();
        // From the last known block, at whose end the path stops, back to the end of this one.
        let mut allowed = 0.0f64;
        for i in (0..self.queue.len()).rev() {
            let behind = &self.queue[i];
            let reach = (allowed * allowed + 2.0 * self.acceleration(behind) * behind.length).sqrt();
            let before = if i == 0 { &segment } else { &self.queue[i - 1] };
            let passes = before.passes_into(behind, cosine);
            allowed = if passes { reach.min(before.speed).min(behind.speed) } else { 0.0 };
        }
        let acceleration = self.acceleration(&segment);
        let exit = allowed.min((self.entry * self.entry + 2.0 * acceleration * segment.length).sqrt());
        let profile = Profile::between(segment.length, self.entry, exit, segment.speed, acceleration);
        self.entry = exit;
        self.current = Some((segment, profile));
        Ok(true)
    }

    fn step(&mut self) -> Result<Option<Sample>> {
        let source = self.reader.source;
        let time = self.next as f64 / source.drive.rate;
        loop {
            if let Some((segment, profile)) = &self.current {
                let lasts = profile.duration() + segment.dwell;
                let since = time - self.begins;
                if since < lasts || (self.finished && since < lasts + 1.0 / source.drive.rate) {
                    let part = if segment.length > 0.0 { profile.at(since) / segment.length } else { 1.0 };
                    let (point, line, tip) = (segment.at(part), segment.line, segment.tip);
                    let recorded = !(source.drive.without_approach && segment.approach);
                    source.commands(&point, tip, &mut self.q, line)?;
                    self.next += 1;
                    return Ok(Some(Sample {
                        time,
                        q: self.q.clone(),
                        directions: None,
                        recorded,
                        at: At::Line(line),
                    }));
                }
                if self.finished {
                    return Ok(None);
                }
                self.begins += lasts;
            } else if self.finished {
                return Ok(None);
            }
            let last = self.current.take();
            if !self.advance()? {
                // One sample more, at the end of the last block.
                self.finished = true;
                if let Some((segment, profile)) = last {
                    self.begins -= profile.duration() + segment.dwell;
                    self.current = Some((segment, profile));
                }
            }
        }
    }
}

impl<R: BufRead> Iterator for Running<'_, R> {
    type Item = Result<Sample>;

    fn next(&mut self) -> Option<Result<Sample>> {
        let sample = self.step();
        if sample.is_err() {
            self.finished = true;
            self.current = None;
            self.queue.clear();
            self.reader.ended = true;
        }
        sample.transpose()
    }
}

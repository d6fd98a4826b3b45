//! LinuxCNC's interpreter as a client: what it makes of a program, as moves of the axes.

use std::path::PathBuf;
use std::process::Command;

/// Numbers of the axes X Y Z A B C, mm and deg.
pub type Axes = [f64; 6];

pub const LETTERS: [&str; 6] = ["X", "Y", "Z", "A", "B", "C"];
/// The names of work offsets, in LinuxCNC's order.
pub const OFFSETS: [&str; 9] = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];

/// What the control has beside the program.
#[derive(Clone, Debug, Default)]
pub struct Tables {
    pub offsets: [Axes; 9],
    /// Lengths of T1, T2, ..., mm.
    pub tools: Vec<f64>,
    /// Where G28 leads, in the machine's own frame.
    pub reference: Axes,
}

/// An arc in program coordinates, mm.
#[derive(Clone, Copy, Debug)]
pub struct Round {
    /// First and second axis of its plane.
    pub plane: [usize; 2],
    pub centre: [f64; 2],
    /// Counterclockwise if positive; further turns beyond the first in its size.
    pub turns: i32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sort {
    Traverse,
    Feed,
}

/// One move, program coordinates and the machine's own frame.
#[derive(Clone, Debug)]
pub struct Sent {
    pub sort: Sort,
    pub round: Option<Round>,
    /// From and to, in program coordinates.
    pub from: Axes,
    pub to: Axes,
    /// What the machine's own frame adds to them.
    pub shift: Axes,
    /// The feed in force as it is said, per minute, and the unit of its lengths, mm.
    pub rate: f64,
    pub unit: f64,
    /// Whether one of its ends is known in inch alone.
    pub in_inch: bool,
    /// Whether an axis stands so near zero that its parameter says zero, and in inch, so that its call has too few digits.
    pub vague: bool,
    /// Length of the tool that is in the spindle, mm; none before the first.
    pub tool: Option<f64>,
}

impl Sent {
    /// In the machine's own frame at a part of the way.
    pub fn at(&self, s: f64) -> Axes {
        let mut p: Axes = std::array::from_fn(|i| self.from[i] + (self.to[i] - self.from[i]) * s);
        if let Some(round) = &self.round
            && s < 1.0
        {
            let [first, second] = round.plane;
            let polar = |p: &Axes| {
                let (x, y) = (p[first] - round.centre[0], p[second] - round.centre[1]);
                (x.hypot(y), y.atan2(x))
            };
            let ((r0, from), (r1, _)) = (polar(&self.from), polar(&self.to));
            let (r, angle) = (r0 + (r1 - r0) * s, from + self.sweep() * s);
            p[first] = round.centre[0] + r * angle.cos();
            p[second] = round.centre[1] + r * angle.sin();
        }
        std::array::from_fn(|i| p[i] + self.shift[i])
    }

    /// The angle of an arc, rad.
    pub fn sweep(&self) -> f64 {
        use std::f64::consts::TAU;
        let Some(round) = &self.round else { return 0.0 };
        let [first, second] = round.plane;
        let angle = |p: &Axes| (p[second] - round.centre[1]).atan2(p[first] - round.centre[0]);
        let sign = f64::from(round.turns.signum());
        let mut once = (sign * (angle(&self.to) - angle(&self.from))).rem_euclid(TAU);
        if self.is_closed() {
            once = TAU;
        }
        sign * (once + TAU * f64::from(round.turns.abs() - 1))
    }

    /// Way of the linear axes, mm, and of the rotary ones, deg.
    pub fn ways(&self) -> (f64, f64) {
        let by: Axes = std::array::from_fn(|i| self.to[i] - self.from[i]);
        let norm = |by: &[f64]| by.iter().map(|b| b * b).sum::<f64>().sqrt();
        match &self.round {
            None => (norm(&by[..3]), norm(&by[3..])),
            Some(round) => {
                let [first, second] = round.plane;
                let r = (self.from[first] - round.centre[0]).hypot(self.from[second] - round.centre[1]);
                ((r * self.sweep()).hypot(by[3 - first - second]), norm(&by[3..]))
            }
        }
    }

    /// Whether it is a full circle: how long one is under inverse time is a matter of rounding to the interpreter.
    pub fn is_closed(&self) -> bool {
        let Some(Round { plane: [first, second], .. }) = self.round else { return false };
        (self.to[first] - self.from[first]).hypot(self.to[second] - self.from[second]) < 1e-4
    }

    /// Whether the interpreter has raised the feed of a block under G93 to the least that it knows, a tenth of a unit a minute.
    pub fn is_least(&self) -> bool {
        self.rate == 0.1
    }

    /// Minutes that it takes and what half a digit of the feed leaves of that open: a control counts the linear way where there is one.
    pub fn time(&self) -> (f64, f64) {
        let (linear, turned) = self.ways();
        // Rounding in inch is no way.
        let least = if self.in_inch { 5e-5 } else { 2e-6 };
        let way = if linear > least { linear / self.unit } else { turned };
        let time = if way > 0.0 { way / self.rate } else { 0.0 };
        (time, time * 5.1e-5 / self.rate)
    }
}

/// What the interpreter makes of a program: its moves between the marks in it, or why it stops.
pub fn moves(text: &str, tables: &Tables) -> Result<Vec<Vec<Sent>>, String> {
    let told = interpret(&reporting(text), tables)?;
    let mut control = Follower::new(tables);
    for line in told.lines() {
        control.line(line)?;
    }
    Ok(control.marked)
}

/// A mark in a program; the interpreter says it where it comes to it.
pub const MARK: &str = "(@)";

/// The program with a line behind each that says where the axes stand, to more digits than the canonical calls.
fn reporting(text: &str) -> String {
    let report = "(debug,@ #5420 #5421 #5422 #5423 #5424 #5425 #5211 #5212 #5213 #5214 #5215 #5216)";
    let mut out = String::new();
    for line in text.lines() {
        out.push_str(line);
        out.push('\n');
        if line.trim() != "%" && line.trim() != MARK {
            out.push_str(report);
            out.push('\n');
        }
    }
    out
}

/// All that the interpreter says of a program.
pub fn interpret(text: &str, tables: &Tables) -> Result<String, String> {
    static NUMBER: std::sync::atomic::AtomicUsize = std::sync::atomic::AtomicUsize::new(0);
    let number = NUMBER.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("kincal_client_{}_{number}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for a moment");
    let write = |name: &str, text: &str| -> PathBuf {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("writable");
        path
    };
    let (program, tools) = (write("part.ngc", text), write("tool.tbl", &tool_table(tables)));
    let variables = write("rs274ngc.var", &parameters(tables));
    let out = Command::new("rs274")
        .args(["-g", "-v"])
        .arg(&variables)
        .arg("-t")
        .arg(&tools)
        .arg(&program)
        .current_dir(&folder)
        // Where it shares its tools with other processes.
        .env("HOME", &folder)
        .output();
    let _ = std::fs::remove_dir_all(&folder);
    let out = out.unwrap_or_else(|e| panic!("rs274, the interpreter of LinuxCNC, does not start: {e}"));
    let text = String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
    if out.status.success() && text.contains("PROGRAM_END") {
        return Ok(text);
    }
    let said = text.lines().filter(|l| call_of(l).is_none() && !l.starts_with("executing"));
    Err(said.take(2).collect::<Vec<_>>().join(": "))
}

/// Without a configuration the interpreter's own unit is the inch.
const INCH: f64 = 25.4;

fn tool_table(tables: &Tables) -> String {
    let line = |(k, length): (usize, &f64)| format!("T{0} P{0} Z{1:.10} D0.2\n", k + 1, length / INCH);
    tables.tools.iter().enumerate().map(line).collect()
}

fn parameters(tables: &Tables) -> String {
    let own = |i: usize, value: f64| if i < 3 { value / INCH } else { value };
    let mut lines = Vec::new();
    let mut block = |first: usize, axes: &Axes| {
        (0..9).for_each(|i| lines.push((first + i, axes.get(i).map_or(0.0, |value| own(i, *value)))));
    };
    block(5161, &tables.reference);
    block(5181, &[0.0; 6]);
    block(5211, &[0.0; 6]);
    for (k, offset) in tables.offsets.iter().enumerate() {
        block(5221 + 20 * k, offset);
    }
    lines.push((5210, 0.0));
    lines.push((5220, 1.0));
    lines.extend((0..9).map(|k| (5230 + 20 * k, 0.0)));
    lines.sort_by_key(|line| line.0);
    lines.iter().map(|(number, value)| format!("{number}\t{value:.12}\n")).collect()
}

/// What has been said so far.
struct Follower<'a> {
    tables: &'a Tables,
    unit: f64,
    at: Axes,
    /// The unit in which that has been said.
    stood_in: f64,
    offset: Axes,
    preset: Axes,
    counted: f64,
    chosen: Option<f64>,
    tool: Option<f64>,
    rate: f64,
    plane: [usize; 2],
    marked: Vec<Vec<Sent>>,
    /// Whether the last move has only the digits of its canonical call.
    coarse: bool,
}

/// The canonical call in a line such as `   12 N.....  STRAIGHT_FEED(...)`; in the place of the points the number of the block.
fn call_of(line: &str) -> Option<&str> {
    let (number, rest) = line.trim_start().split_once(' ')?;
    let (block, call) = rest.trim_start().split_once(' ')?;
    (number.parse::<u64>().is_ok() && block.starts_with('N')).then_some(call.trim_start())
}

fn numbers(text: &str) -> Vec<f64> {
    text.split([',', ' ', '(', ')', '"', '@']).filter_map(|word| word.parse().ok()).collect()
}

impl<'a> Follower<'a> {
    fn new(tables: &'a Tables) -> Self {
        Follower {
            tables,
            unit: 1.0,
            at: [0.0; 6],
            stood_in: 1.0,
            offset: [0.0; 6],
            preset: [0.0; 6],
            counted: 0.0,
            chosen: None,
            tool: None,
            rate: 0.0,
            plane: [0, 1],
            marked: vec![Vec::new()],
            coarse: false,
        }
    }

    fn scale(&self, axes: &[f64]) -> Axes {
        std::array::from_fn(|i| if i < 3 { axes[i] * self.unit } else { axes[i] })
    }

    /// Half a digit of a canonical call and some noise of its printing.
    fn digit(&self, i: usize) -> f64 {
        5.1e-5 * if i < 3 { self.unit } else { 1.0 }
    }

    fn line(&mut self, line: &str) -> Result<(), String> {
        let Some(call) = call_of(line) else { return Ok(()) };
        let (name, arguments) = call.split_once('(').unwrap_or((call, ""));
        let n = numbers(arguments);
        match name {
            "USE_LENGTH_UNITS" => {
                self.unit = match arguments {
                    a if a.contains("MM") => 1.0,
                    a if a.contains("INCHES") => INCH,
                    _ => return Err(format!("units of {line}")),
                };
            }
            "SET_G5X_OFFSET" => {
                let offset = self.tables.offsets[n[0] as usize - 1];
                let said = self.scale(&n[1..]);
                if (0..6).any(|i| (said[i] - offset[i]).abs() > 2.0 * self.digit(i)) {
                    return Err(format!("work offset {offset:?}, said {said:?}"));
                }
                self.offset = offset;
            }
            "SET_G92_OFFSET" => self.preset = self.scale(&n),
            "SET_XY_ROTATION" if n[0] != 0.0 => return Err("the plane is turned".into()),
            "USE_TOOL_LENGTH_OFFSET" => {
                let lengths = self.tables.tools.iter().chain(&[0.0]);
                let near = |length: &&f64| (n[2] * self.unit - **length).abs() < 2e-3;
                self.counted = *lengths.into_iter().find(near).ok_or(format!("no such length: {line}"))?;
            }
            "SELECT_TOOL" => self.chosen = self.tables.tools.get(n[0] as usize - 1).copied(),
            "CHANGE_TOOL" => self.tool = self.chosen,
            "SELECT_PLANE" => {
                self.plane = match arguments {
                    a if a.contains("XY") => [0, 1],
                    a if a.contains("XZ") => [2, 0],
                    _ => [1, 2],
                };
            }
            "SET_FEED_RATE" => self.rate = n[0],
            "STRAIGHT_TRAVERSE" => self.go(Sort::Traverse, self.scale(&n), None),
            "STRAIGHT_FEED" => self.go(Sort::Feed, self.scale(&n), None),
            "ARC_FEED" => {
                let [first, second] = self.plane;
                let mut to = [0.0, 0.0, 0.0, n[6], n[7], n[8]];
                (to[first], to[second], to[3 - first - second]) = (n[0], n[1], n[5]);
                let centre = [n[2] * self.unit, n[3] * self.unit];
                let round = Round { plane: self.plane, centre, turns: n[4] as i32 };
                self.go(Sort::Feed, self.scale(&to), Some(round));
            }
            "COMMENT" if arguments.starts_with("\"@") => self.marked.push(Vec::new()),
            "MESSAGE" if arguments.starts_with("\"@") => self.stand(&n)?,
            _ => {}
        }
        Ok(())
    }

    fn go(&mut self, sort: Sort, to: Axes, round: Option<Round>) {
        let (offset, preset) = (self.offset, self.preset);
        let shift = std::array::from_fn(|i| offset[i] + preset[i] + if i == 2 { self.counted } else { 0.0 });
        let (from, rate, unit, tool) = (self.at, self.rate, self.unit, self.tool);
        let in_inch = unit.max(self.stood_in) > 1.0;
        let moved = Sent { sort, round, from, to, shift, rate, unit, in_inch, vague: false, tool };
        self.marked.last_mut().expect("one at least").push(moved);
        self.at = to;
        self.coarse = true;
    }

    /// Where the axes stand in program coordinates, and what G92 adds, with all digits.
    fn stand(&mut self, n: &[f64]) -> Result<(), String> {
        let mut at = self.scale(n);
        let mut vague = false;
        for i in (0..6).filter(|i| self.coarse && n[*i] == 0.0 && self.at[*i] != 0.0) {
            at[i] = self.at[i];
            vague |= i < 3 && self.unit > 1.0;
        }
        if self.coarse && (0..6).any(|i| (at[i] - self.at[i]).abs() > self.digit(i)) {
            return Err(format!("the last call has {:?}, the axes stand at {at:?}", self.at));
        }
        let own: Axes = std::array::from_fn(|i| n[6 + i] * if i < 3 { INCH } else { 1.0 });
        for (preset, own) in self.preset.iter_mut().zip(own) {
            if (own - *preset).abs() < 3e-3 {
                *preset = own;
            }
        }
        let last = self.marked.last_mut().and_then(|moves| moves.last_mut());
        if let Some(moved) = last.filter(|_| self.coarse) {
            moved.to = at;
            moved.vague = vague;
        }
        self.at = at;
        self.stood_in = self.unit;
        self.coarse = false;
        Ok(())
    }
}

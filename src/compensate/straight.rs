//! Straight moves, whole or subdivided, and arcs as lines.

use std::io::Write;

use super::arc::Arc;
use super::correct::plain;
use super::fault::CompensateFault;
use super::follower::{Follower, Position, Status, line_text, put, put_bytes, refuse};
use crate::chain::Chain;
use crate::error::Result;
use crate::nc::{Block, Dialect, Distance, Motion, MotionKind};

/// Parts of a straight move at which it is looked at.
const LOOKS: [f64; 3] = [0.25, 0.5, 0.75];
/// Most parts of a straight move.
const MOST_PARTS: usize = 4096;
/// Most lines that take the place of one arc.
const MOST_LINES: usize = 100_000;

/// Whether an M word acts when the block's motion is over.
fn acts_behind(code: f64) -> bool {
    [0.0, 1.0, 2.0, 5.0, 9.0, 30.0, 60.0].contains(&code)
}

impl Follower<'_> {
    /// Joint commands of program coordinates; a place that the linear axes cannot bring about is refused.
    pub fn joints(&self, block: &Block, program: &[f64]) -> Result<Vec<f64>> {
        match self.control.joints(program, &self.meant.q) {
            Some(q) => Ok(q),
            None => refuse(block, 0, CompensateFault::NoTcp),
        }
    }

    pub fn straight(
        &mut self,
        block: &mut Block,
        motion: &Motion,
        target: Vec<f64>,
        out: &mut dyn Write,
    ) -> Result<()> {
        let line = block.line();
        let (meant, written) = (self.meant.clone(), self.written.clone());
        let known = self.status.iter().all(|s| *s != Status::Parked) && self.last.is_some();
        let q = self.joints(block, &target)?;
        let end = Position { q, program: target };
        self.advance(line, &end.q);
        let feeds = motion.kind != MotionKind::Rapid;
        if let Some(tolerance) = self.options.split
            && feeds
            && known
            && self.dialect != Dialect::Heidenhain
        {
            let (from, to) = (meant.program.clone(), end.program.clone());
            let at = |s: f64| -> Vec<f64> { from.iter().zip(&to).map(|(a, b)| a + (b - a) * s).collect() };
            let mut count = 1;
            while count < MOST_PARTS && self.unsplit(&at, count) > tolerance {
                count *= 2;
            }
            if count > 1 {
                self.report.split_moves += 1;
                return self.lines(block, motion, count, &at, None, out);
            }
        }
        let correction = self.correct(line, &end.q, Some(block), &motion.words);
        self.restate(block, motion)?;
        self.apply(block, &motion.words, &correction.numbers)?;
        if feeds && known {
            let left = self.mid_line((&meant, &end), (&written, &correction.written));
            self.report.largest_mid_line_m.take(left, line);
        }
        self.arrive(line, end, correction.written);
        put(block, out)
    }

    /// A drilling cycle at the place of the block: its place is corrected in the plane, its depths and its
    /// angles stay.
    pub fn cycle(
        &mut self,
        block: &mut Block,
        motion: &Motion,
        mut target: Vec<f64>,
        out: &mut dyn Write,
    ) -> Result<()> {
        let line = block.line();
        let repeated = block.words().iter().any(|w| matches!(w.address.as_str(), "L" | "K"));
        if self.state.modes().distance == Some(Distance::Incremental) || repeated {
            let what = format!("the cycle `{}`", line_text(block));
            return refuse(block, 0, CompensateFault::OtherMotion { what });
        }
        let normal = self.control.normal;
        let in_plane: Vec<bool> =
            self.control.axes.iter().map(|a| a.tip.is_some_and(|k| k != normal)).collect();
        for i in (0..target.len()).filter(|i| !in_plane[*i]) {
            target[i] = self.meant.program[i];
        }
        let q = self.joints(block, &target)?;
        self.advance(line, &q);
        let before = self.written.program.clone();
        let mut correction = self.correct(line, &q, Some(block), &motion.words);
        correction.numbers.retain(|n| in_plane[n.axis]);
        for i in (0..before.len()).filter(|i| !in_plane[*i]) {
            correction.written.program[i] = before[i];
        }
        correction.written.q = self.joints(block, &correction.written.program)?;
        self.apply(block, &motion.words, &correction.numbers)?;
        let left = self.error(&correction.written.q, &q);
        self.report.largest_cycle_m.take(left.m, line);
        self.report.cycles += 1;
        self.meant = Position { q, program: target };
        self.written = correction.written;
        self.written_motion = Some(motion.kind);
        self.leave_normal();
        put(block, out)
    }

    /// Largest error of the tip, m, that a straight move leaves in `count` equal parts, rounding aside.
    fn unsplit(&self, at: &dyn Fn(f64) -> Vec<f64>, count: usize) -> f64 {
        let free = self.free();
        let corrected = |s: f64| -> Option<(Position, Position)> {
            let program = at(s);
            let q = self.control.joints(&program, &self.meant.q)?;
            let sent = self.inverse.solve(&self.model.chain_at(&q), &self.goal(&q), &q, &free).commands;
            let written = Position { program: self.control.program(&sent, &program), q: sent };
            Some((Position { q, program }, written))
        };
        let mut worst = 0.0f64;
        let Some(mut from) = corrected(0.0) else { return worst };
        for k in 1..=count {
            let Some(to) = corrected(k as f64 / count as f64) else { return worst };
            worst = worst.max(self.mid_line((&from.0, &to.0), (&from.1, &to.1)));
            from = to;
        }
        worst
    }

    /// Largest error of the tip between the ends of a straight move, m.
    fn mid_line(&self, meant: (&Position, &Position), written: (&Position, &Position)) -> f64 {
        let at = |s: f64| {
            let there = self.between(meant.0, meant.1, s).zip(self.between(written.0, written.1, s));
            there.map_or(0.0, |(meant, sent)| self.error(&sent, &meant).m)
        };
        LOOKS.into_iter().map(at).fold(0.0, f64::max)
    }

    /// Writes the block's motion word where what was written before has put another one into force.
    fn restate(&mut self, block: &mut Block, motion: &Motion) -> Result<()> {
        let code = match motion.kind {
            MotionKind::ArcCw => "2",
            MotionKind::ArcCcw => "3",
            _ => "1",
        };
        let stated = motion_word(block).is_some();
        let differs = self.written_motion.is_some_and(|in_force| in_force != motion.kind);
        if !stated && differs && matches!(motion.kind, MotionKind::ArcCw | MotionKind::ArcCcw) {
            block.insert_before(first_of(block, motion), "G", code)?;
        }
        self.written_motion = Some(motion.kind);
        Ok(())
    }

    pub fn arc(
        &mut self,
        block: &mut Block,
        motion: &Motion,
        target: Vec<f64>,
        out: &mut dyn Write,
    ) -> Result<()> {
        let line = block.line();
        if self.dialect == Dialect::Heidenhain {
            let what = "an arc".to_string();
            return refuse(block, 0, CompensateFault::OtherMotion { what });
        }
        let arc = match Arc::of(self, block, motion, &self.meant.program, &target) {
            Ok(arc) => arc,
            Err(what) => return refuse(block, 0, CompensateFault::ArcGeometry { what }),
        };
        if !self.matters(block, &arc)? {
            for s in arc.stations() {
                let q = self.joints(block, &arc.at(s))?;
                self.tell(Some(line), &q);
            }
            let q = self.joints(block, &target)?;
            let end = Position { q: q.clone(), program: target };
            self.advance(line, &q);
            let correction = self.correct(line, &q, Some(block), &motion.words);
            // An axis beside the plane may come back from where it stood before.
            if correction.numbers.iter().all(|n| motion.words[n.axis].is_none()) {
                self.restate(block, motion)?;
                self.apply(block, &motion.words, &correction.numbers)?;
                self.arrive(line, end, correction.written);
                return put(block, out);
            }
        }
        let Some(tolerance) = self.options.arcs else {
            let byte = motion_word(block).map_or(0, |w| block.words()[w].span.start);
            return refuse(block, byte, CompensateFault::Arc);
        };
        let places = (0..self.status.len())
            .filter(|i| !self.control.axes[*i].rotary)
            .map(|i| self.places(i))
            .max()
            .unwrap_or(3);
        // Three coordinates, each off by half a digit.
        let rounding = 0.87 * self.control.length_si(10f64.powi(-(places as i32)));
        let room = 0.95 * tolerance - rounding;
        if room < 0.1 * tolerance {
            let fault = CompensateFault::ArcTolerance { tolerance_um: tolerance * 1e6, decimals: places };
            return refuse(block, 0, fault);
        }
        let count = arc.chords(room);
        if count > MOST_LINES {
            let what = format!("{count} lines would take its place");
            return refuse(block, 0, CompensateFault::ArcGeometry { what });
        }
        self.report.split_arcs += 1;
        self.report.arc_lines += count as u64;
        let at = |s: f64| arc.at(s);
        self.lines(block, motion, count, &at, Some(&arc), out)
    }

    /// Whether the correction shows in the written digits anywhere along an arc.
    fn matters(&self, block: &Block, arc: &Arc) -> Result<bool> {
        let (free, ways) = (self.free(), self.ways());
        let mut model = self.model.ahead();
        for s in arc.stations() {
            let program = arc.at(s);
            let q = self.joints(block, &program)?;
            model.advance(&q, &ways);
            let solution = self.inverse.solve(model.chain(), &self.goal(&q), &q, &free);
            if let Some(tolerance) = self.options.arcs
                && solution.position_left_m > tolerance
            {
                return self.not_held(block, model.chain(), &q, tolerance, solution.position_left_m);
            }
            let sent = solution.commands;
            let written = self.control.program(&sent, &program);
            for i in 0..program.len() {
                let half = 0.5 * 10f64.powi(-(self.places(i) as i32));
                let by = self.control.programmed(i, written[i]) - self.control.programmed(i, program[i]);
                if self.status[i] == Status::Placed && by.abs() > half {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Refuses an arc that leaves more than its tolerance; names the axes that could mend it, were they placed.
    fn not_held<T>(
        &self,
        block: &Block,
        chain: &Chain<f64>,
        q: &[f64],
        tolerance: f64,
        left: f64,
    ) -> Result<T> {
        let left_by = |axis: usize| {
            let mut free = self.free();
            self.control.axes[axis].command.into_iter().for_each(|(c, _)| free[c] = true);
            self.inverse.solve(chain, &self.goal(q), q, &free).position_left_m
        };
        let absent: Vec<usize> = (0..self.status.len())
            .filter(|i| self.status[*i] != Status::Placed && self.control.axes[*i].command.is_some())
            .collect();
        let mending: Vec<usize> = absent.iter().copied().filter(|i| left_by(*i) < 0.5 * left).collect();
        // Where none mends it alone, it takes several.
        let axes = if mending.is_empty() { absent } else { mending };
        let name = |i: usize| self.control.axes[i].address.clone();
        let fault = CompensateFault::ArcNotHeld {
            left_um: left * 1e6,
            tolerance_um: tolerance * 1e6,
            axes: axes.into_iter().map(name).collect(),
        };
        refuse(block, motion_word(block).map_or(0, |w| block.words()[w].span.start), fault)
    }

    /// `count` lines in the place of one block: the block itself to the first point and lines behind it, or,
    /// where it does something at its end, lines before it.
    fn lines(
        &mut self,
        block: &mut Block,
        motion: &Motion,
        count: usize,
        at: &dyn Fn(f64) -> Vec<f64>,
        arc: Option<&Arc>,
        out: &mut dyn Write,
    ) -> Result<()> {
        let line = block.line();
        let last = block.words().iter().any(|w| w.address == "M" && w.number().is_some_and(acts_behind));
        let own = if last { count } else { 1 };
        let style = motion.words.iter().flatten().next().and_then(|w| plain(&block.words()[*w]));
        let separator = motion.words.iter().flatten().next().map_or(" ", |w| block.separator(*w));
        let ending = match block.bytes() {
            bytes if bytes.ends_with(b"\r\n") => "\r\n",
            _ => "\n",
        };
        let ends = block.bytes().ends_with(b"\n");
        let feed = self.feed(block, count);
        let mut written = self.written.clone();
        for k in 1..=count {
            let s = k as f64 / count as f64;
            let program = if k == count { at(1.0) } else { at(s) };
            let q = self.joints(block, &program)?;
            let point = Position { q, program };
            // Of a straight move the model knows the end already, and its direction is one all along.
            if arc.is_some() {
                self.advance(line, &point.q);
            }
            let words: &[Option<usize>] = if k == own { &motion.words } else { &[] };
            let correction = self.correct(line, &point.q, (k == own).then_some(&*block), words);
            if let (Some(_), Some(tolerance)) = (arc, self.options.arcs) {
                let left = self.error(&correction.written.q, &point.q).m;
                if left > tolerance {
                    return self.not_held(block, self.model.chain(), &point.q, tolerance, left);
                }
            }
            let middle = at(s - 0.5 / count as f64);
            if let Some(sent) = self.between(&written, &correction.written, 0.5) {
                let wanted = self.joints(block, &middle)?;
                let left = self.error(&sent, &wanted).m;
                let worst = if arc.is_some() {
                    &mut self.report.largest_arc_m
                } else {
                    &mut self.report.largest_mid_line_m
                };
                worst.take(left, line);
            }
            if k == own {
                if arc.is_some() {
                    straighten(block, motion)?;
                }
                if let Some((word, text)) = &feed {
                    block.replace(*word, text)?;
                }
                self.apply(block, &motion.words, &correction.numbers)?;
                let mut bytes = block.output();
                if k < count && !ends {
                    bytes.extend_from_slice(ending.as_bytes());
                }
                put_bytes(&bytes, out)?;
            } else {
                let mut text = self.line(&correction.numbers, style, separator);
                if !text.is_empty() {
                    if last && k == 1 {
                        let feed = block.words().iter().find(|w| w.address == "F");
                        let feed = feed.filter(|_| !self.inverse_time()).map(|w| block.text(&w.span));
                        let words = ["G1".to_string(), text].into_iter().chain(feed);
                        text = words.collect::<Vec<_>>().join(separator);
                    }
                    if let Some((_, number)) = &feed {
                        text = format!("{text}{separator}F{number}");
                    }
                    let no_end = k == count && !ends;
                    text.push_str(if no_end { "" } else { ending });
                    put_bytes(text.as_bytes(), out)?;
                }
            }
            written = correction.written.clone();
            self.arrive(line, point, correction.written);
        }
        self.written_motion = Some(MotionKind::Linear);
        Ok(())
    }

    /// Under inverse time every line has its own F: that of the block times their number.
    fn feed(&self, block: &Block, count: usize) -> Option<(usize, String)> {
        if !self.inverse_time() {
            return None;
        }
        let word = block.words().iter().position(|w| w.address == "F")?;
        let number = plain(&block.words()[word])?;
        let text = number.write_like(number.value * count as f64, Some(number.decimals.max(4)));
        Some((word, text))
    }
}

/// The word that says how the block moves.
fn motion_word(block: &Block) -> Option<usize> {
    block
        .words()
        .iter()
        .position(|w| w.address == "G" && matches!(w.number(), Some(n) if [0.0, 1.0, 2.0, 3.0].contains(&n)))
}

/// The word before which a motion word may stand: the first axis, else the first word.
fn first_of(block: &Block, motion: &Motion) -> usize {
    let centre = ["I", "J", "K", "R", "CR", "AR", "TURN"];
    let of_arc = block.words().iter().position(|w| centre.contains(&w.address.as_str()));
    motion.words.iter().flatten().copied().chain(of_arc).min().unwrap_or(0)
}

/// Makes a line of an arc's block: `G1`, without centre, radius and turns.
fn straighten(block: &mut Block, motion: &Motion) -> Result<()> {
    match motion_word(block) {
        Some(word) => {
            let text = block.words()[word].write_like(1.0, None);
            block.replace(word, &text)?;
        }
        None => block.insert_before(first_of(block, motion), "G", "1")?,
    }
    let of_arc = ["I", "J", "K", "R", "CR", "AR", "TURN", "P"];
    let found: Vec<usize> =
        (0..block.words().len()).filter(|w| of_arc.contains(&block.words()[*w].address.as_str())).collect();
    found.into_iter().try_for_each(|word| block.remove(word))
}

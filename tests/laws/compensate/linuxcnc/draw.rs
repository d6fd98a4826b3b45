//! The words and blocks of programs drawn at random.

use super::client::{LETTERS, MARK, OFFSETS, Tables};
use super::drawn::{AxisOf, Kind, Planned, Sort};
use crate::common::random::Random;

/// Where a program stands while it is drawn.
pub struct Draw<'a> {
    pub random: &'a mut Random,
    pub axes: &'a [AxisOf],
    pub kind: Kind,
    pub tables: Tables,
    pub zero: Vec<f64>,
    /// Joints, mm and deg.
    pub at: Vec<f64>,
    pub lost: Vec<bool>,
    pub preset: Vec<f64>,
    pub local: bool,
    pub offset: usize,
    pub counted: f64,
    pub inch: bool,
    pub incremental: bool,
    pub absolute_centre: bool,
    pub inverse_time: bool,
    pub feed: bool,
    pub plane: usize,
    pub motion: Option<u8>,
    pub decimals: (usize, usize),
    pub lower_case: bool,
    pub blanks: bool,
    pub numbered: bool,
    pub block: usize,
    pub subs: usize,
    pub lines: Vec<String>,
    pub sub_lines: Vec<String>,
    pub inside: bool,
    pub planned: Vec<(bool, Planned)>,
}

const INCH: f64 = 25.4;

impl Draw<'_> {
    fn chance(&mut self, share: f64) -> bool {
        self.random.between(0.0, 1.0) < share
    }

    fn index(&mut self, count: usize) -> usize {
        (self.random.between(0.0, count as f64) as usize).min(count - 1)
    }

    fn one_of<'t>(&mut self, texts: &[&'t str]) -> &'t str {
        texts[self.index(texts.len())]
    }

    fn unit(&self) -> f64 {
        if self.inch { INCH } else { 1.0 }
    }

    fn axis(&self, index: usize) -> usize {
        self.axes.iter().position(|a| a.index == index).expect("X, Y and Z")
    }

    /// What is added to the program's coordinate for the joint.
    fn shift(&self, c: usize) -> f64 {
        let i = self.axes[c].index;
        let counted = if i == 2 { self.counted } else { 0.0 };
        self.tables.offsets[self.offset][i] + self.preset[c] + counted - self.zero[c]
    }

    /// A number near `value` (mm or deg) as it may be written, and what it means.
    fn number(&mut self, value: f64, rotary: bool) -> (String, f64) {
        let unit = if rotary { 1.0 } else { self.unit() };
        let most = if rotary { self.decimals.1 } else { self.decimals.0 + usize::from(self.inch) };
        let least = if rotary || self.kind.arcs { most } else { 0 };
        let decimals = least + self.index(most - least + 1);
        // Whole inches would lead out of reach.
        let decimals = if self.inch && !rotary { decimals.max(2) } else { decimals };
        let mut text = format!("{:.decimals$}", value / unit);
        let written: f64 = text.parse().expect("a number");
        if decimals > 0 && self.chance(0.4) {
            text = text.trim_end_matches('0').to_string();
            if self.chance(0.5) {
                text = text.trim_end_matches('.').to_string();
            }
        } else if decimals == 0 && self.chance(0.5) {
            text.push('.');
        }
        let (sign, digits) = match text.strip_prefix('-') {
            Some(digits) => ("-", digits.to_string()),
            None => (if self.chance(0.1) { "+" } else { "" }, text.clone()),
        };
        let digits = match digits.strip_prefix("0.") {
            Some(behind) if !behind.is_empty() && self.chance(0.4) => format!(".{behind}"),
            _ if self.chance(0.05) => format!("00{digits}"),
            _ => digits,
        };
        (format!("{sign}{digits}"), written * unit)
    }

    fn word(&mut self, letter: &str, value: f64, rotary: bool) -> (String, f64) {
        let (text, meant) = self.number(value, rotary);
        let blank = if self.blanks && self.chance(0.2) { " " } else { "" };
        (format!("{letter}{blank}{text}"), meant)
    }

    /// The word that brings a joint near `joint`; it stands there then.
    fn axis_word(&mut self, c: usize, joint: f64) -> String {
        let (letter, rotary) = (self.axes[c].letter, self.axes[c].rotary);
        let from = if self.incremental { self.at[c] } else { self.shift(c) };
        let (text, meant) = self.word(letter, joint - from, rotary);
        self.at[c] = from + meant;
        self.lost[c] = false;
        text
    }

    /// A place within range near where a joint stands.
    fn near(&mut self, c: usize, step: f64) -> f64 {
        let (low, high) = self.axes[c].range;
        let at = self.at[c].clamp(low, high);
        self.random.between((at - step).max(low), (at + step).min(high))
    }

    fn g(&mut self, code: &str) -> String {
        let (whole, rest) = code.split_once('.').unwrap_or((code, ""));
        let whole =
            if whole.len() == 1 && self.chance(0.3) { format!("0{whole}") } else { whole.to_string() };
        if rest.is_empty() { format!("G{whole}") } else { format!("G{whole}.{rest}") }
    }

    /// Puts the words of a block into a line.
    pub fn put(&mut self, mut words: Vec<String>) {
        if self.chance(0.08) && !words[0].starts_with('/') {
            let at = self.index(words.len() + 1);
            let note = self.one_of(&["(on)", "(X1 Y2)", "( a, b )"]);
            words.insert(at, note.to_string());
        }
        let separator = if self.blanks || self.chance(0.8) { " " } else { "" };
        let mut text = words.join(separator);
        if self.numbered && self.chance(0.7) && !text.starts_with('/') {
            self.block += 10;
            text = format!("N{} {text}", self.block);
        }
        if self.chance(0.05) {
            text.push_str(self.one_of(&[" ; X5", ";", "  "]));
        }
        if self.lower_case {
            text = text.to_lowercase();
        }
        self.line(text);
    }

    fn line(&mut self, text: String) {
        if self.inside { self.sub_lines.push(text) } else { self.lines.push(text) }
    }

    fn plan(&mut self, sort: Sort) {
        let line = if self.inside { self.sub_lines.len() } else { self.lines.len() };
        let known = !self.lost.iter().any(|lost| *lost);
        let (unit, inverse_time) = (self.unit(), self.inverse_time);
        let moves = Planned { line, sort, known, unit, inverse_time: inverse_time && self.motion != Some(0) };
        self.planned.push((self.inside, moves));
        if self.kind.marked {
            self.line(MARK.to_string());
        }
    }

    /// Modal words that may stand before a move.
    fn modal(&mut self, words: &mut Vec<String>) {
        let any_lost = self.lost.iter().any(|lost| *lost);
        if any_lost && self.incremental || !any_lost && self.chance(0.06) {
            self.incremental = !self.incremental;
            let code = if self.incremental { "91" } else { "90" };
            words.push(self.g(code));
        }
        if self.chance(0.03) {
            self.inch = !self.inch;
            self.feed = false;
            words.push(if self.inch { "G20" } else { "G21" }.to_string());
        }
        if self.chance(0.04) {
            self.plane = self.index(3);
            words.push(["G17", "G18", "G19"][self.plane].to_string());
        }
        if self.chance(0.05) {
            self.inverse_time = !self.inverse_time;
            self.feed = false;
            words.push(if self.inverse_time { "G93" } else { "G94" }.to_string());
        }
    }

    fn put_motion(&mut self, words: &mut Vec<String>, code: u8) {
        if self.motion != Some(code) || self.chance(0.3) {
            let text = code.to_string();
            words.push(self.g(&text));
        }
        self.motion = Some(code);
    }

    fn put_feed(&mut self, words: &mut Vec<String>) {
        if self.inverse_time {
            words.push(format!("F{:.1}", self.random.between(2.0, 40.0)));
        } else if !self.feed || self.chance(0.2) {
            let feed = self.random.between(200.0, 3000.0);
            let text = match self.index(3) {
                0 => format!("{feed:.0}"),
                1 => format!("{feed:.0}."),
                _ => format!("{feed:.2}"),
            };
            words.push(format!("F{text}"));
            self.feed = true;
        }
    }

    fn straight(&mut self, rapid: bool) {
        let mut words = Vec::new();
        self.modal(&mut words);
        let any_lost = self.lost.iter().any(|lost| *lost);
        let rapid = rapid || any_lost || self.chance(0.25);
        let turns_alone = !any_lost && self.chance(0.2);
        let mut named: Vec<usize> = Vec::new();
        while named.is_empty() {
            for c in 0..5 {
                let share = if self.lost[c] { 0.97 } else { 0.45 };
                if (!turns_alone || self.axes[c].rotary) && self.chance(share) {
                    named.push(c);
                }
            }
        }
        let stood = self.at.clone();
        let step = if self.chance(0.2) { 400.0 } else { 30.0 };
        let mut axis_words = Vec::new();
        for c in named {
            let to = self.near(c, step);
            axis_words.push(self.axis_word(c, to));
        }
        if turns_alone && self.kind.marked && self.chance(0.15) {
            // A linear axis that is named and stays.
            let c = self.axis(0);
            let stays = if self.incremental { Some("X0".to_string()) } else { None };
            axis_words.extend(stays.inspect(|_| self.lost[c] = false));
        }
        // A rotary axis alone may take several lines, and only marks tell whose they are.
        let stays = (0..3).all(|i| self.at[self.axis(i)] == stood[self.axis(i)]);
        let rapid = rapid || !self.kind.marked && stays;
        self.put_motion(&mut words, if rapid { 0 } else { 1 });
        self.shuffle(&mut axis_words);
        words.extend(axis_words);
        if !rapid {
            self.put_feed(&mut words);
        }
        if self.chance(0.1) {
            self.shuffle(&mut words);
        }
        self.put(words);
        self.plan(Sort::Straight);
    }

    /// Axes as people write them, or in any order.
    fn shuffle(&mut self, words: &mut [String]) {
        words.sort_by_key(|word| LETTERS.iter().position(|l| word.starts_with(l)).unwrap_or(0));
        if self.chance(0.2) {
            for k in (1..words.len()).rev() {
                let with = self.index(k + 1);
                words.swap(k, with);
            }
        }
    }

    fn arc(&mut self) {
        use std::f64::consts::TAU;
        let mut words = Vec::new();
        self.modal(&mut words);
        if self.chance(0.1) {
            self.absolute_centre = !self.absolute_centre;
            words.push(if self.absolute_centre { "G90.1" } else { "G91.1" }.into());
        }
        let plane = [[0, 1], [2, 0], [1, 2]][self.plane];
        let [first, second] = plane.map(|i| self.axis(i));
        let (r, from) = (self.random.between(4.0, 35.0), self.random.between(0.0, TAU));
        let place = |angle: f64| (r * angle.cos(), r * angle.sin());
        let by = place(from);
        let centre = [self.at[first] - by.0, self.at[second] - by.1];
        let fits = |c: usize, at: f64| at - r > self.axes[c].range.0 && at + r < self.axes[c].range.1;
        if !fits(first, centre[0]) || !fits(second, centre[1]) {
            if !words.is_empty() {
                self.put(words);
            }
            return;
        }
        let clockwise = self.chance(0.5);
        self.put_motion(&mut words, if clockwise { 2 } else { 3 });
        let radius = self.chance(0.4);
        let closed = !radius && self.chance(0.1);
        let mut sweep = self.random.between(0.1, TAU - 0.1);
        if radius && (sweep - 0.5 * TAU).abs() < 0.2 {
            sweep = 0.3 * TAU;
        }
        let to = place(if clockwise { from - sweep } else { from + sweep });
        let mut axis_words = Vec::new();
        let start = [self.at[first], self.at[second]];
        if !closed {
            axis_words.push(self.axis_word(first, centre[0] + to.0));
            axis_words.push(self.axis_word(second, centre[1] + to.1));
        } else if !self.incremental && self.chance(0.5) {
            axis_words.push(self.axis_word(first, start[0]));
            if self.at[first] != start[0] {
                self.at[first] = start[0];
                axis_words.clear();
            }
        }
        if self.chance(0.3) {
            let other = self.axis(3 - plane[0] - plane[1]);
            let to = self.near(other, 15.0);
            axis_words.push(self.axis_word(other, to));
        }
        if self.chance(0.2) {
            let c = (0..5).rfind(|c| self.axes[*c].rotary).expect("two are");
            let to = self.near(c, 10.0);
            axis_words.push(self.axis_word(c, to));
        }
        self.shuffle(&mut axis_words);
        words.extend(axis_words);
        if radius {
            let r = if sweep > 0.5 * TAU { -r } else { r };
            words.push(self.word("R", r, false).0);
        } else {
            let letters = plane.map(|i| ["I", "J", "K"][i]);
            for (k, c) in [first, second].into_iter().enumerate() {
                let base = if self.absolute_centre { self.shift(c) } else { start[k] };
                let text = self.word(letters[k], centre[k] - base, false).0;
                words.push(text);
            }
        }
        if !radius && self.chance(0.15) {
            words.push(format!("P{}", 1 + self.index(3)));
        }
        self.put_feed(&mut words);
        self.put(words);
        self.plan(Sort::Arc);
    }

    fn drill(&mut self) {
        if self.inverse_time || self.incremental || self.plane != 0 {
            self.put(vec!["G17 G90 G94".into()]);
            (self.inverse_time, self.incremental, self.plane, self.feed) = (false, false, 0, false);
        }
        let code = self.one_of(&["G81", "G82", "G83", "G73", "G85", "G89"]);
        let (x, y, z) = (self.axis(0), self.axis(1), self.axis(2));
        let top = self.at[z].min(self.axes[z].range.1) - self.shift(z);
        let (retract, depth) = (top - self.random.between(2.0, 9.0), top - self.random.between(12.0, 25.0));
        let side = self.one_of(&["G98 ", "G99 ", ""]);
        for k in 0..1 + self.index(3) {
            let (px, py) = (self.near(x, 30.0), self.near(y, 30.0));
            let mut words = vec![self.axis_word(x, px), self.axis_word(y, py)];
            if k == 0 {
                words.insert(0, format!("{side}{code}"));
                words.push(self.word("Z", depth, false).0);
                words.push(self.word("R", retract, false).0);
                match code {
                    "G82" | "G89" => words.push("P0.2".into()),
                    "G83" | "G73" => words.push(format!("Q{:.3}", 4.0 / self.unit())),
                    _ => {}
                }
                words.push(format!("F{:.0}", self.random.between(50.0, 300.0)));
                self.feed = true;
            }
            self.put(words);
            self.motion = None;
            self.lost[z] = true;
            self.plan(Sort::Cycle);
        }
        self.put(vec!["G80".into()]);
    }

    /// What is no move.
    fn other(&mut self) {
        let quiet = self.kind.known_ways || self.inside;
        match self.index(if quiet { 9 } else { 16 }) {
            0 => {
                let text =
                    self.one_of(&["M8", "M9", "S1200 M3", "G4 P.5", "M5", "G64 P.01", "G61", "G40", "/M8"]);
                self.put(vec![text.to_string()]);
            }
            1 => self.put(vec!["(tool path 3: G1 X5)".into()]),
            2 => self.line(String::new()),
            3 => {
                let mut words = Vec::new();
                self.modal(&mut words);
                if !words.is_empty() {
                    self.put(words);
                }
            }
            4 if self.feed && !self.inverse_time => self.put(vec!["F750".into()]),
            5 => {
                self.put(vec!["G80".into()]);
                self.motion = None;
            }
            6 | 7 if !self.inside => {
                self.offset = self.index(OFFSETS.len());
                self.put(vec![OFFSETS[self.offset].into()]);
            }
            8 | 9 if !self.inside && !self.local => self.preset(),
            10 if !self.inside => {
                if self.local {
                    let words = self.axes.iter().map(|axis| format!("{}0", axis.letter)).collect::<Vec<_>>();
                    self.put(vec![format!("G52 {}", words.join(" "))]);
                } else {
                    let code = self.one_of(&["G92.1", "G92.2"]);
                    self.put(vec![code.into()]);
                }
                self.preset.fill(0.0);
                self.local = false;
            }
            11 if !self.local && self.preset.iter().all(|by| *by == 0.0) && !self.inside => {
                self.local_shift()
            }
            11 | 12 => self.change_tool(),
            13 => {
                self.counted = 0.0;
                self.put(vec!["G49".into()]);
                let z = self.axis(2);
                self.lost[z] = true;
            }
            14 => self.machine_place(),
            15 if self.kind.marked => self.home(),
            _ => {}
        }
    }

    fn preset(&mut self) {
        let mut words = vec![self.g("92")];
        for c in 0..5 {
            if !self.lost[c] && self.chance(0.4) {
                let value = self.random.between(-40.0, 40.0);
                let (text, meant) = self.word(self.axes[c].letter, value, self.axes[c].rotary);
                words.push(text);
                self.preset[c] += self.at[c] - self.shift(c) - meant;
            }
        }
        if words.len() > 1 {
            self.put(words);
        }
    }

    fn local_shift(&mut self) {
        let mut words = vec!["G52".to_string()];
        for c in 0..5 {
            if self.chance(0.4) {
                let value = self.random.between(-30.0, 30.0);
                let (text, meant) = self.word(self.axes[c].letter, value, self.axes[c].rotary);
                words.push(text);
                self.preset[c] = meant;
            }
        }
        if words.len() > 1 {
            self.put(words);
            self.local = true;
            // At the first feed behind it the interpreter itself is wrong under inverse time.
            self.straight(true);
        }
    }

    fn change_tool(&mut self) {
        let tool = self.index(self.tables.tools.len());
        if self.chance(0.5) {
            self.put(vec![format!("T{} M6", tool + 1)]);
        } else {
            self.put(vec![format!("T{}", tool + 1)]);
            self.put(vec!["M6".into()]);
        }
        let by = if self.chance(0.15) { self.index(self.tables.tools.len()) } else { tool };
        let h = if by != tool || self.chance(0.7) { format!("G43 H{}", by + 1) } else { "G43".into() };
        self.put(vec![h]);
        self.counted = self.tables.tools[by];
        (0..5).filter(|c| !self.axes[*c].rotary).for_each(|c| self.lost[c] = true);
    }

    fn machine_place(&mut self) {
        let mut words = vec!["G90 G53 G0".to_string()];
        (self.incremental, self.motion) = (false, Some(0));
        let c = self.index(5);
        let joint = self.near(c, 60.0);
        let (text, meant) = self.word(self.axes[c].letter, joint + self.zero[c], self.axes[c].rotary);
        self.at[c] = meant - self.zero[c];
        self.lost[c] = true;
        words.push(text);
        self.put(words);
        self.plan(Sort::Machine);
    }

    fn home(&mut self) {
        let z = self.axis(2);
        let back = if self.incremental { "" } else { " G90" };
        self.put(vec!["G91 G28 Z0".into()]);
        self.at[z] = self.tables.reference[2] - self.zero[z];
        self.lost[z] = true;
        self.plan(Sort::Machine);
        if !back.is_empty() {
            self.put(vec!["G90".into()]);
        }
    }

    /// Every axis by name.
    pub fn begin(&mut self) {
        (self.inch, self.incremental, self.inverse_time, self.feed) = (false, false, false, false);
        (self.plane, self.motion, self.absolute_centre) = (0, Some(0), false);
        let mut words = vec!["G21 G90 G94 G17 G91.1 G0".to_string()];
        for c in 0..5 {
            let (low, high) = self.axes[c].range;
            let to = self.random.between(low, high);
            words.push(self.axis_word(c, to));
        }
        self.put(words);
        self.plan(Sort::Straight);
    }

    pub fn body(&mut self, moves: usize) {
        let before = self.planned.len();
        while self.planned.len() < before + moves {
            let any_lost = self.lost.iter().any(|lost| *lost);
            match self.index(100) {
                _ if any_lost => self.straight(true),
                0..25 if self.kind.arcs => self.arc(),
                25..28 if self.kind.marked && !self.kind.known_ways && !self.inside => self.drill(),
                28..30 if !self.inside => self.sub_program(),
                30..48 => self.other(),
                _ => self.straight(false),
            }
        }
    }

    fn sub_program(&mut self) {
        self.subs += 1;
        let name =
            if self.chance(0.5) { format!("o{}", 100 + self.subs) } else { format!("o<s{}>", self.subs) };
        let first = self.planned.len();
        self.sub_lines.push(format!("{name} sub"));
        self.inside = true;
        self.begin();
        let moves = 1 + self.index(5);
        self.body(moves);
        self.inside = false;
        self.sub_lines.push(format!("{name} endsub"));
        let moves = self.planned[first..].to_vec();
        self.lines.push(format!("{name} call"));
        if self.chance(0.3) {
            self.lines.push(format!("{name} call"));
            self.planned.extend(moves);
        }
    }
}

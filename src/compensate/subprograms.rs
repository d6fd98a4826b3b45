//! Sub-programs that stand in the same file, `docs/compensate.md`: each line of them is written once, so
//! every call must need the same.

use std::collections::{BTreeMap, HashMap};
use std::io::Write;

use super::fault::CompensateFault;
use super::interpreter::Interpreter;
use super::output::{put, put_bytes};
use super::refusal::refuse;
use crate::error::Result;
use crate::nc::{Block, Dialect};

/// Most levels of calls.
const DEEPEST: usize = 10;
/// Most times that one call repeats its sub-program.
const MOST_TIMES: f64 = 10_000.0;

/// Whatever follows a program, block by block in the order in which they run.
pub(super) trait Follow<'a> {
    /// What is known of the program behind the last block.
    fn program(&self) -> &Interpreter<'a>;

    /// Follows a block and writes what comes of it.
    ///
    /// # Errors
    /// [`Error::Input`](crate::error::Error::Input) where it cannot be read or followed.
    fn block(&mut self, block: &mut Block, out: &mut dyn Write) -> Result<()>;
}

/// Sub-programs of a file: their lines, and what they say once corrected.
#[derive(Default)]
pub(super) struct SubPrograms {
    bodies: BTreeMap<String, Vec<(usize, Vec<u8>)>>,
    /// Of lines of sub-programs.
    written: HashMap<usize, Vec<u8>>,
    /// Addresses whose numbers without a point count least increments.
    increments: &'static [&'static str],
    /// Whether what is written is being found, and not yet put out.
    collecting: bool,
}

/// What a line is for sub-programs.
#[derive(Clone, Debug, PartialEq)]
enum Mark {
    /// Nothing.
    Line,
    /// A sub-program begins, `O1000` or `o100 sub`; ends, `M99` or `o100 endsub`.
    Begin(String),
    End,
    /// It is run so many times.
    Call(String, usize),
}

/// `O100`, `o<name>` and the word behind it.
fn o_word(text: &str) -> Option<(String, String)> {
    let text = text.trim_start();
    let text = text
        .strip_prefix(|c: char| c == 'N' || c == 'n')
        .map_or(text, |rest| rest.trim_start_matches(|c: char| c.is_ascii_digit()).trim_start());
    let rest = text.strip_prefix(['O', 'o', ':'])?.trim_start();
    let (name, rest) = if let Some(inner) = rest.strip_prefix('<') {
        let (name, rest) = inner.split_once('>')?;
        (name.to_ascii_lowercase(), rest)
    } else {
        let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
        (rest[..digits].trim_start_matches('0').to_string(), &rest[digits..])
    };
    if name.is_empty() {
        return None;
    }
    let word: String = rest.trim_start().chars().take_while(char::is_ascii_alphabetic).collect();
    Some((name, word.to_ascii_uppercase()))
}

/// Whether a line may bear the name of a program: a look at all of it, which takes many bytes at a time.
fn may_name(bytes: &[u8]) -> bool {
    bytes.iter().fold(false, |found, b| found | matches!(b, b'O' | b'o' | b':'))
}

/// What a line is for sub-programs.
fn mark(block: &Block, dialect: Dialect) -> Mark {
    if dialect != Dialect::Rs274 {
        return Mark::Line;
    }
    let text = String::from_utf8_lossy(block.bytes());
    if let Some((name, word)) = o_word(&text) {
        return match word.as_str() {
            "" | "SUB" => Mark::Begin(name),
            "ENDSUB" => Mark::End,
            "CALL" if !text.contains('[') => Mark::Call(name, 1),
            _ => Mark::Line,
        };
    }
    let number = |address: &str| block.words().iter().find(|w| w.address == address).and_then(|w| w.number());
    match number("M") {
        Some(98.0) => {
            let times = number("L").or(number("K")).unwrap_or(1.0);
            match number("P") {
                Some(p) if times.fract() == 0.0 && (0.0..MOST_TIMES).contains(&times) => {
                    Mark::Call(format!("{p}"), times as usize)
                }
                _ => Mark::Line,
            }
        }
        Some(99.0) => Mark::End,
        _ => Mark::Line,
    }
}

/// Which lines belong to sub-programs: told line by line, in the order of the file.
#[derive(Default)]
pub(super) struct Bounds {
    inside: Option<String>,
    ended: bool,
}

impl Bounds {
    /// Whether the last line belongs to a sub-program that has not ended.
    pub fn is_inside(&self) -> bool {
        self.inside.is_some()
    }

    /// The sub-program that this line belongs to, its first and last line included.
    pub fn of(&mut self, block: &Block, dialect: Dialect) -> Option<String> {
        let text = String::from_utf8_lossy(block.bytes());
        match mark(block, dialect) {
            // A bare `O1000` at the start names the program itself; LinuxCNC writes `sub`.
            Mark::Begin(name) if self.ended || o_word(&text).is_some_and(|(_, w)| w == "SUB") => {
                self.inside = Some(name);
                self.inside.clone()
            }
            Mark::End => {
                self.ended = true;
                self.inside.take()
            }
            _ => {
                let stops = |w: &crate::nc::Word| w.address == "M" && matches!(w.number(), Some(2.0 | 30.0));
                self.ended |= self.inside.is_none() && block.words().iter().any(stops);
                self.inside.clone()
            }
        }
    }
}

impl SubPrograms {
    /// No sub-programs yet; numbers without a point at these addresses count least increments.
    pub fn counting(increments: &'static [&'static str]) -> Self {
        SubPrograms { increments, ..SubPrograms::default() }
    }

    /// A line of the sub-program `name`.
    pub fn add(&mut self, name: &str, block: &Block) {
        self.bodies.entry(name.to_string()).or_default().push((block.line(), block.bytes().to_vec()));
    }

    /// From here on what is written is found, and not yet put out; or the other way round.
    pub fn collect(&mut self, collecting: bool) {
        self.collecting = collecting;
    }

    /// Whether the file has no sub-programs.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// A line of a sub-program as it goes out.
    pub fn write(&self, block: &Block, out: &mut dyn Write) -> Result<()> {
        match self.written.get(&block.line()) {
            Some(bytes) => put_bytes(bytes, out),
            None => put(block, out),
        }
    }

    /// Follows a block; where it calls a sub-program of the file, its blocks as well.
    pub fn block<'a>(
        &mut self,
        follower: &mut dyn Follow<'a>,
        block: &mut Block,
        deep: usize,
        out: &mut dyn Write,
    ) -> Result<()> {
        let dialect = follower.program().dialect();
        // Without sub-programs only the name of the program itself is no block.
        if self.bodies.is_empty() && !may_name(block.bytes()) {
            return follower.block(block, out);
        }
        let (name, times) = match mark(block, dialect) {
            Mark::Call(name, times) if self.bodies.contains_key(&name) && !follower.program().ended() => {
                (name, times)
            }
            Mark::Begin(_) | Mark::End if deep > 0 || !self.bodies.is_empty() => return put(block, out),
            Mark::Begin(name) if !name.is_empty() => {
                let text = String::from_utf8_lossy(block.bytes()).into_owned();
                if o_word(&text).is_some_and(|(_, w)| w.is_empty()) {
                    return put(block, out);
                }
                return follower.block(block, out);
            }
            _ => return follower.block(block, out),
        };
        if deep >= DEEPEST {
            return refuse(block, 0, CompensateFault::TooDeep { limit: DEEPEST });
        }
        put(block, out)?;
        let body = self.bodies[&name].clone();
        for _ in 0..times {
            for (line, bytes) in &body {
                let mut inner = Block::of_file(block.file(), *line, bytes.clone(), dialect);
                inner.count_increments(self.increments);
                let mut written = Vec::new();
                self.block(follower, &mut inner, deep + 1, &mut written)?;
                if !self.collecting {
                    continue;
                }
                match self.written.get(line) {
                    Some(before) if *before != written => {
                        return refuse(&inner, 0, CompensateFault::Contexts);
                    }
                    _ => {
                        self.written.insert(*line, written);
                    }
                }
            }
        }
        Ok(())
    }
}

//! A passage over a whole program, and what a look over it finds beforehand.

use std::io::{BufRead, Write};

use super::fault::CompensateFault;
use super::mark::{Fingerprint, Foot, Mark, Origin};
use super::options::IntegerUnit;
use super::refusal::refuse;
use super::subprograms::{Bounds, Follow, SubPrograms};
use crate::error::Result;
use crate::nc::{Block, Dialect, Program, Value, Word};

/// What is known of a program before it is followed.
pub(super) struct Survey {
    /// Its sub-programs.
    pub calls: SubPrograms,
    pub fingerprint: Fingerprint,
    /// The mark that it bears, with its block.
    pub mark: Option<(Block, Mark)>,
    /// Where a mark may be put.
    pub foot: Foot,
}

impl Survey {
    /// Reads a program to its end.
    ///
    /// # Errors
    /// As [`Program::next_block`].
    pub fn of<R: BufRead>(mut program: Program<R>) -> Result<Self> {
        let (dialect, mut bounds) = (program.dialect(), Bounds::default());
        let mut survey = Survey {
            calls: SubPrograms::counting(program.increments()),
            fingerprint: Fingerprint::default(),
            mark: None,
            foot: Foot::default(),
        };
        let mut bytes = Vec::new();
        while program.next_line(&mut bytes)? {
            survey.fingerprint.take(&bytes);
            survey.foot.look(program.line(), &bytes);
            // Most lines are motions alone, and need no closer look.
            if program.increments().is_empty() && !bounds.is_inside() && !may_tell(&bytes) {
                continue;
            }
            let block = program.block_of(std::mem::take(&mut bytes));
            if !program.increments().is_empty()
                && (dialect != Dialect::Rs274 || block.words().iter().any(is_inch))
            {
                let what = if dialect == Dialect::Rs274 {
                    "in inches they do not"
                } else {
                    "this control never does"
                };
                return refuse(&block, 0, CompensateFault::Increments { what });
            }
            if let Some(name) = bounds.of(&block, dialect) {
                survey.calls.add(&name, &block);
            }
            if let Some(mark) = Mark::of_line(block.bytes()) {
                survey.mark = Some((block, mark));
            }
        }
        Ok(survey)
    }

    /// Refuses a program that bears a mark; `origin`: for what it is to be written now, where that is known.
    ///
    /// # Errors
    /// [`CompensateFault::Compensated`] with the line of the mark.
    pub fn refuse_marked(&self, origin: Option<Origin>) -> Result<()> {
        match &self.mark {
            None => Ok(()),
            Some((block, mark)) => {
                let how =
                    origin.map_or_else(String::new, |origin| format!(", {}", mark.origin.beside(origin)));
                refuse(block, 0, CompensateFault::Compensated { how })
            }
        }
    }

    /// Refuses a program whose mark says that it was written from anything but this; one without a mark says nothing.
    ///
    /// # Errors
    /// [`CompensateFault::Foreign`] with the line of the mark.
    pub fn refuse_foreign(&self, expected: Mark) -> Result<()> {
        let Some((block, mark)) = self.mark.as_ref().filter(|(_, mark)| *mark != expected) else {
            return Ok(());
        };
        let from = if mark.origin == expected.origin {
            "from another program, or from this one before it was changed"
        } else {
            mark.origin.beside(expected.origin)
        };
        refuse(block, 0, CompensateFault::Foreign { from })
    }
}

/// Whether a line may begin, end, or stop before a sub-program, or bear a mark.
fn may_tell(bytes: &[u8]) -> bool {
    bytes.iter().fold(false, |found, b| found | matches!(b, b'O' | b'o' | b':' | b'M' | b'm' | b'K'))
}

/// Addresses of RS-274 whose numbers may count least increments.
const COUNTED: &[&str] = &["X", "Y", "Z", "A", "B", "C", "U", "V", "W", "I", "J", "K", "R", "Q"];

/// Has a program read in this dialect, where it is not to be taken from its first lines, and its numbers without a point so.
pub(super) fn read_as<R: BufRead>(
    program: &mut Program<R>,
    dialect: Option<Dialect>,
    unit: Option<IntegerUnit>,
) {
    if let Some(dialect) = dialect {
        program.set_dialect(dialect);
    }
    if unit == Some(IntegerUnit::Um) {
        program.count_increments(COUNTED);
    }
}

fn is_ambiguous(word: &Word) -> bool {
    matches!(word.value, Value::Number(number) if !number.has_point && number.value != 0.0)
        && matches!(word.address.letter(), Some(b'X'..=b'Z' | b'A'..=b'C' | b'U'..=b'W'))
}

/// Numbers of axes in a block that are not zero and have no point.
pub(super) fn without_point(block: &Block) -> u64 {
    block.words().iter().filter(|word| is_ambiguous(word)).count() as u64
}

fn is_inch(word: &Word) -> bool {
    word.address == "G" && word.number() == Some(20.0)
}

/// A program on its way through a follower.
pub(super) struct Passage<'c, R> {
    program: Program<R>,
    calls: &'c mut SubPrograms,
    bounds: Bounds,
    dialect: Dialect,
    /// Lines passed.
    passed: usize,
    /// Numbers of axes that are not zero and have no point.
    without_point: u64,
}

impl<'c, R: BufRead> Passage<'c, R> {
    /// From the start of `program`, whose sub-programs are known.
    pub fn new(program: Program<R>, calls: &'c mut SubPrograms) -> Self {
        let dialect = program.dialect();
        Passage { program, calls, bounds: Bounds::default(), dialect, passed: 0, without_point: 0 }
    }

    /// Lines passed so far; the sub-programs that they call do not count.
    pub fn passed(&self) -> usize {
        self.passed
    }

    /// Numbers of axes passed so far that are not zero and have no point.
    pub fn without_point(&self) -> u64 {
        self.without_point
    }

    /// Leads the follower over one line; whether there was one.
    ///
    /// # Errors
    /// As [`Follow::block`].
    pub fn step<'a>(&mut self, follower: &mut dyn Follow<'a>, out: &mut dyn Write) -> Result<bool> {
        let Some(mut block) = self.program.next_block()? else { return Ok(false) };
        self.passed += 1;
        self.without_point += without_point(&block);
        if !self.calls.is_empty() && self.bounds.of(&block, self.dialect).is_some() {
            self.calls.write(&block, out)?;
        } else {
            self.calls.block(follower, &mut block, 0, out)?;
        }
        Ok(true)
    }

    /// Leads the follower to the end, of which nothing is written.
    ///
    /// # Errors
    /// As [`Follow::block`].
    pub fn finish<'a>(mut self, follower: &mut dyn Follow<'a>) -> Result<()> {
        while self.step(follower, &mut std::io::sink())? {}
        Ok(())
    }
}

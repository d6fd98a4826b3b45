//! A program corrected in batches of lines, side by side, where the machine's errors have no history.
//!
//! What was written before a batch decides little of what is written in it: where axes stand that it does not name, and those that it
//! names soon stand where its own words put them. So a batch is begun where the program means to be, some lines before its first one, and
//! corrected as if all were known. Where what stood before it turns out to be the same to the last bit, it is what would have been
//! written one line after the other; where not, it is written anew.

use std::io::{BufRead, Write};

use rayon::prelude::*;

use super::ahead::Ahead;
use super::corrector::Solvers;
use super::mark::Foot;
use super::model::Model;
use super::options::CompensateOptions;
use super::output::put_bytes;
use super::part::Part;
use super::passage::without_point;
use super::standing::Standing;
use super::subprograms::{Follow, SubPrograms};
use super::writer::Writer;
use crate::error::{Error, Result};
use crate::few::Few;
use crate::nc::{Block, Program};

/// Lines of a batch, and lines before it from which it is begun.
const LINES: usize = 512;
const LEAD: usize = 4;
/// Batches that are corrected side by side, each as soon as a thread is free. Most of the memory that all takes is that of two groups.
const GROUP: usize = 8;

/// Whether a batch ends behind so many lines: one does before the line that a mark is written before.
pub(super) fn ends_batch(passed: usize, foot: &Foot) -> bool {
    passed.is_multiple_of(LINES) || foot.is_before(passed + 1)
}

/// Some lines of a program.
struct Batch<'a> {
    /// Its first line, from 1.
    first: usize,
    blocks: Vec<Block>,
    /// Joint commands that its straight moves mean, m or rad, as far as they are known.
    meant: Vec<Few<f64>>,
    /// From where it is begun, if that is known.
    lead: Option<Lead<'a>>,
}

/// The last lines before a batch.
struct Lead<'a> {
    /// Where the program means to be before them.
    start: Ahead<'a>,
    blocks: Vec<Block>,
    /// As those of the batch.
    meant: Vec<Few<f64>>,
}

/// A batch corrected from where it was begun.
struct Done<'a> {
    /// What was there before its first line.
    start: Standing<'a>,
    written: Written<'a>,
}

/// What became of the lines of a batch.
struct Written<'a> {
    bytes: Vec<u8>,
    part: Part,
    end: Standing<'a>,
    /// What stopped it.
    error: Option<Error>,
}

/// A program that is read and followed ahead of those who correct it.
struct Reader<'a, 'f, R> {
    program: Program<R>,
    foot: &'f Foot,
    none: SubPrograms,
    /// Where the program means to be; `None` where it is not followed any more.
    ahead: Option<Ahead<'a>>,
    /// From where the next batch is begun.
    lead: Option<Lead<'a>>,
    /// Blocks that are done with: the next ones stand in their memory.
    spent: Vec<Block>,
    passed: usize,
    without_point: u64,
}

/// Makes a model of the machine's errors for another thread.
pub(super) type Make<'f, 'm> = &'f (dyn Fn() -> Box<dyn Model + 'm> + Sync);

/// How batches are corrected.
#[derive(Clone, Copy)]
pub(super) struct How<'f, 'm, 'a> {
    pub make: Make<'f, 'm>,
    pub solvers: &'f Solvers<'a>,
    pub options: &'f CompensateOptions,
}

/// What the lines of a program came to.
pub(super) struct All<'a> {
    pub part: Part,
    pub end: Standing<'a>,
    pub lines: usize,
    pub without_point: u64,
}

/// Corrects a program without sub-programs from `start` on. `sign` is called before the line of the foot with what has been written so far.
///
/// # Errors
/// As one line after the other would.
pub(super) fn correct<'a, R: BufRead + Send>(
    program: Program<R>,
    start: Standing<'a>,
    how: How<'_, '_, 'a>,
    foot: &Foot,
    out: &mut dyn Write,
    sign: &mut dyn FnMut(&Part, &mut dyn Write) -> Result<()>,
) -> Result<All<'a>> {
    let ahead = Some(start.ahead());
    let mut reader = Reader {
        program,
        foot,
        none: SubPrograms::default(),
        ahead,
        lead: None,
        spent: Vec::new(),
        passed: 0,
        without_point: 0,
    };
    let (mut standing, mut part) = (start, Part::default());
    let (mut group, mut stop) = reader.next_group();
    while !group.is_empty() {
        let present = std::mem::take(&mut group);
        let stopped = stop.is_some();
        let (next, done) = rayon::join(
            || if stopped { (Vec::new(), None) } else { reader.next_group() },
            || present.into_par_iter().with_max_len(1).map(|batch| how.begin(batch)).collect::<Vec<_>>(),
        );
        let (mut count, mut missed) = (0, 0);
        for (mut batch, done) in done {
            if foot.is_before(batch.first) {
                sign(&part, out)?;
            }
            count += 1;
            let written = match done {
                Some(done) if done.start.is_as(&standing) => done.written,
                _ => {
                    missed += 1;
                    batch.blocks.iter_mut().for_each(Block::restore);
                    how.write(&mut batch.blocks, standing, &batch.meant)
                }
            };
            put_bytes(&written.bytes, out)?;
            part.absorb(written.part);
            standing = written.end;
            if let Some(error) = written.error {
                return Err(error);
            }
            reader.spent.append(&mut batch.blocks);
        }
        // A program whose lines hang together that much is better written one after the other.
        if 2 * missed > count + 1 {
            reader.ahead = None;
        }
        group = next.0;
        stop = stop.or(next.1);
    }
    match stop {
        Some(error) => Err(error),
        None => Ok(All { part, end: standing, lines: reader.passed, without_point: reader.without_point }),
    }
}

impl<'a> How<'_, '_, 'a> {
    /// Corrects a batch from where it was begun.
    fn begin(self, mut batch: Batch<'a>) -> (Batch<'a>, Option<Done<'a>>) {
        let Some(mut lead) = batch.lead.take() else { return (batch, None) };
        let before = self.write(&mut lead.blocks, Standing::of(lead.start), &lead.meant);
        if before.error.is_some() {
            return (batch, None);
        }
        let start = before.end;
        let written = self.write(&mut batch.blocks, start.clone(), &batch.meant);
        (batch, Some(Done { start, written }))
    }

    /// Corrects lines behind what stands; `meant`: where they lead.
    fn write(self, blocks: &mut [Block], start: Standing<'a>, meant: &[Few<f64>]) -> Written<'a> {
        let mut model = (self.make)();
        let mut writer = Writer::behind(start, &mut *model, self.solvers, self.options);
        writer.foresee(meant);
        let (mut bytes, mut none) = (Vec::new(), SubPrograms::default());
        bytes.reserve(blocks.iter().map(|block| block.bytes().len() + 8).sum());
        let all = blocks.iter_mut().try_for_each(|block| none.block(&mut writer, block, 0, &mut bytes));
        let all = all.and_then(|()| writer.look());
        let (part, end) = writer.stop();
        Written { bytes, part, end, error: all.err() }
    }
}

impl<'a> Lead<'a> {
    /// No lines behind where the program means to be.
    fn none(ahead: &Ahead<'a>) -> Self {
        Lead { start: ahead.apart(), blocks: Vec::with_capacity(LEAD), meant: Vec::new() }
    }
}

impl<'a, R: BufRead> Reader<'a, '_, R> {
    /// The next batches, and what stopped the reading.
    fn next_group(&mut self) -> (Vec<Batch<'a>>, Option<Error>) {
        let mut group = Vec::with_capacity(GROUP);
        while group.len() < GROUP {
            let (batch, stop) = self.next_batch();
            let is_last = batch.blocks.is_empty();
            group.extend(Some(batch).filter(|_| !is_last));
            if is_last || stop.is_some() {
                return (group, stop);
            }
        }
        (group, None)
    }

    fn next_batch(&mut self) -> (Batch<'a>, Option<Error>) {
        let first = self.passed + 1;
        let lead = match self.lead.take() {
            Some(lead) if lead.blocks.len() == LEAD => Some(lead),
            _ if first == 1 => self.ahead.as_ref().map(Lead::none),
            _ => None,
        };
        let mut batch = Batch { first, blocks: Vec::with_capacity(LINES), meant: Vec::new(), lead };
        let stop = self.fill(&mut batch);
        batch.meant = self.ahead.as_mut().map_or_else(Vec::new, |ahead| std::mem::take(&mut ahead.meant));
        (batch, stop)
    }

    fn next_block(&mut self) -> Result<Option<Block>> {
        match self.spent.pop() {
            Some(spent) => self.program.next_block_over(spent),
            None => self.program.next_block(),
        }
    }

    /// Reads the lines of a batch; what stopped the reading.
    fn fill(&mut self, batch: &mut Batch<'a>) -> Option<Error> {
        loop {
            let mut block = match self.next_block() {
                Ok(Some(block)) => block,
                Ok(None) => return None,
                Err(error) => return Some(error),
            };
            if self.passed % LINES == LINES - LEAD {
                self.lead = self.ahead.as_ref().map(Lead::none);
            }
            if let Some(lead) = &mut self.lead {
                lead.blocks.push(block.clone());
            }
            self.passed += 1;
            self.without_point += without_point(&block);
            if let Some(ahead) = &mut self.ahead {
                let known = ahead.meant.len();
                let follower: &mut dyn Follow<'a> = ahead;
                // Whoever corrects the block tells what is wrong with it.
                if self.none.block(follower, &mut block, 0, &mut std::io::sink()).is_err() {
                    (self.ahead, self.lead) = (None, None);
                } else if let Some(lead) = &mut self.lead {
                    lead.meant.extend_from_slice(&ahead.meant[known..]);
                }
            }
            batch.blocks.push(block);
            if ends_batch(self.passed, self.foot) {
                return None;
            }
        }
    }
}

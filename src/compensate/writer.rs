//! The writer: a program goes in block by block and comes out corrected.

use std::io::Write;

use super::corrector::Solvers;
use super::curve;
use super::cycle;
use super::fault::CompensateFault;
use super::interpreter::Interpreter;
use super::model::Model;
use super::options::CompensateOptions;
use super::part::Part;
use super::pass::Pass;
use super::refusal::{line_text, refuse};
use super::report::Report;
use super::standing::Standing;
use super::straight;
use super::subprograms::Follow;
use crate::error::Result;
use crate::few::Few;
use crate::nc::{Block, MotionKind};

/// A program that is written as its errors ask for.
pub(super) struct Writer<'a, 'm> {
    pass: Pass<'a, 'm>,
}

impl<'a, 'm> Writer<'a, 'm> {
    /// From the start of `program`; `first` as for [`Pass::new`].
    pub fn new(
        program: Interpreter<'a>,
        model: &'m mut dyn Model,
        solvers: &'m Solvers<'a>,
        options: &'m CompensateOptions,
        first: &[i8],
    ) -> Self {
        Writer { pass: Pass::new(program, model, solvers, options, first) }
    }

    /// Behind some lines, as [`Pass::behind`].
    pub fn behind(
        start: Standing<'a>,
        model: &'m mut dyn Model,
        solvers: &'m Solvers<'a>,
        options: &'m CompensateOptions,
    ) -> Self {
        Writer { pass: Pass::behind(start, model, solvers, options) }
    }

    /// As [`Pass::stop`].
    pub fn stop(self) -> (Part, Standing<'a>) {
        self.pass.stop()
    }

    /// As [`Pass::end_batch`].
    ///
    /// # Errors
    /// As [`Pass::end_batch`].
    pub fn end_batch(&mut self) -> Result<()> {
        self.pass.end_batch()
    }

    /// As [`Pass::look`].
    ///
    /// # Errors
    /// As [`Pass::look`].
    pub fn look(&mut self) -> Result<()> {
        self.pass.look()
    }

    /// As [`Pass::foresee`].
    pub fn foresee(&mut self, meant: &[Few<f64>]) {
        self.pass.foresee(meant);
    }

    /// As [`Pass::absorb`].
    pub fn absorb(&mut self, before: Part) {
        self.pass.absorb(before);
    }

    /// Whether anything is written otherwise than it was.
    pub fn has_corrected(&self) -> bool {
        self.pass.has_corrected()
    }

    /// The report of what was written.
    ///
    /// # Errors
    /// As [`Pass::finish`].
    pub fn finish(self) -> Result<Report> {
        self.pass.finish()
    }
}

impl<'a> Follow<'a> for Writer<'a, '_> {
    fn program(&self) -> &Interpreter<'a> {
        self.pass.program()
    }

    fn block(&mut self, block: &mut Block, out: &mut dyn Write) -> Result<()> {
        let done = write(&mut self.pass, block, out);
        // What is wrong with lines before comes first.
        if done.is_err() { self.pass.look().and(done) } else { done }
    }
}

fn write(pass: &mut Pass, block: &mut Block, out: &mut dyn Write) -> Result<()> {
    let Some((motion, target, drills)) = pass.begin(block, out)? else { return Ok(()) };
    if drills {
        return cycle::write(pass, block, &motion, target, out);
    }
    match motion.kind {
        MotionKind::Rapid | MotionKind::Linear | MotionKind::Unstated => {
            straight::write(pass, block, &motion, target, out)
        }
        MotionKind::ArcCw | MotionKind::ArcCcw => curve::write(pass, block, &motion, target, out),
        MotionKind::Cycle | MotionKind::Other => {
            let what = format!("the motion `{}`", line_text(block));
            refuse(block, 0, CompensateFault::OtherMotion { what })
        }
    }
}

//! What a program needs of the set-up and the set-up does not say: all of it at once, since one at a time would cost a run each.

use std::io::Write;

use super::fault::CompensateFault;
use super::interpreter::Interpreter;
use super::subprograms::Follow;
use crate::error::Result;
use crate::nc::Block;

/// A program that is only followed, for tools and work offsets that its moves depend on, each with the first line that does.
pub(super) struct Gaps<'a> {
    program: Interpreter<'a>,
    tools: Vec<(String, usize)>,
    offsets: Vec<(String, usize)>,
}

impl<'a> Gaps<'a> {
    /// From the start of `program`.
    pub fn new(program: Interpreter<'a>) -> Self {
        Gaps { program, tools: Vec::new(), offsets: Vec::new() }
    }

    /// All of it as one fault, where there is more than one thing.
    pub fn together(self) -> Option<CompensateFault> {
        let Gaps { tools, offsets, .. } = self;
        (tools.len() + offsets.len() > 1).then_some(CompensateFault::UnknownSetup { tools, offsets })
    }
}

/// Whether this is the want of something that a set-up would say.
pub(super) fn is_gap(fault: &CompensateFault) -> bool {
    matches!(fault, CompensateFault::UnknownTool { .. } | CompensateFault::UnknownOffset { .. })
}

impl<'a> Follow<'a> for Gaps<'a> {
    fn program(&self) -> &Interpreter<'a> {
        &self.program
    }

    /// Whatever else is wrong with a block is told once the set-up is complete.
    fn block(&mut self, block: &mut Block, _: &mut dyn Write) -> Result<()> {
        if !self.program.block(block).is_err_and(|error| error.fault().is_some_and(is_gap)) {
            return Ok(());
        }
        for fault in self.program.missing() {
            let (known, name) = match fault {
                CompensateFault::UnknownTool { tool } => (&mut self.tools, tool),
                CompensateFault::UnknownOffset { name } => (&mut self.offsets, name),
                _ => continue,
            };
            if known.iter().all(|(other, _)| other != name) {
                known.push((name.clone(), block.line()));
            }
        }
        Ok(())
    }
}

//! The one that goes ahead: follows a program by what it means alone, so that others can begin to correct it farther behind.

use std::io::Write;

use super::event::Event;
use super::interpreter::Interpreter;
use super::position::Position;
use super::style::Style;
use super::subprograms::Follow;
use crate::error::Result;
use crate::few::Few;
use crate::nc::{Block, Motion};

/// A program as it stands without corrections. What has been written is taken for what is meant, until a few blocks have been corrected.
pub(super) struct Ahead<'a> {
    pub program: Interpreter<'a>,
    pub style: Style,
    /// Joint commands of the straight moves that were followed, m or rad.
    pub meant: Vec<Few<f64>>,
}

impl<'a> Ahead<'a> {
    /// From the start of `program`, which has taken its first way.
    pub fn new(program: Interpreter<'a>, style: Style) -> Self {
        Ahead { program, style, meant: Vec::new() }
    }

    /// The same without the moves so far.
    pub fn apart(&self) -> Self {
        Ahead::new(self.program.clone(), self.style.clone())
    }

    fn go(&mut self, block: &Block, mut target: Few<f64>, drills: bool) -> Result<()> {
        if drills {
            let in_plane = self.program.control().in_plane();
            for i in (0..target.len()).filter(|i| !in_plane[*i]) {
                target[i] = self.program.meant().program()[i];
            }
        }
        let q = self.program.joints(block, &target)?;
        self.program.take_way();
        if !drills {
            self.meant.push(Few::from_slice(&q));
        }
        let end = Position::new(q, target);
        self.program.arrive(end.clone(), end);
        if drills {
            self.program.leave_normal();
        }
        Ok(())
    }

    fn read(&mut self, block: &Block, motion: &Motion) {
        self.style.read(block, motion, self.program.control(), self.program.dialect());
    }
}

impl<'a> Follow<'a> for Ahead<'a> {
    fn program(&self) -> &Interpreter<'a> {
        &self.program
    }

    fn block(&mut self, block: &mut Block, _: &mut dyn Write) -> Result<()> {
        for event in self.program.block(block)? {
            match event {
                Event::Units => self.style.forget_lengths(),
                Event::Preset { .. } | Event::Drilled | Event::Sent { .. } => {}
                Event::Move { motion, target, drills } => {
                    self.read(block, &motion);
                    self.go(block, target, drills)?;
                }
            }
        }
        Ok(())
    }
}

//! The scout: goes where a program goes before it is corrected, to find in which direction each axis first travels.

use std::io::Write;

use super::arc::Arc;
use super::event::Event;
use super::interpreter::Interpreter;
use super::model::Model;
use super::position::Position;
use super::subprograms::Follow;
use crate::error::Result;
use crate::few::Few;
use crate::nc::{Block, Motion, MotionKind};

/// A program that is followed as far as its first motions.
pub(super) struct Scout<'a> {
    program: Interpreter<'a>,
    model: &'a mut dyn Model,
    /// By command: direction of its first motion on a known way; 0 as long as there is none.
    first: Vec<i8>,
}

impl<'a> Scout<'a> {
    /// From the start of `program`.
    pub fn new(mut program: Interpreter<'a>, model: &'a mut dyn Model) -> Self {
        let first = vec![0; program.control().machine().commands().len()];
        model.restart(&first);
        let ways = program.take_way();
        let mut scout = Scout { program, model, first };
        let q = scout.program.meant().q().to_vec();
        scout.tell(&q, &ways);
        scout
    }

    /// Whether every direction that counts has been found.
    pub fn has_found(&self) -> bool {
        self.model.keyed().iter().all(|c| self.first[*c] != 0)
    }

    /// The directions found.
    pub fn finish(self) -> Vec<i8> {
        self.first
    }

    fn tell(&mut self, q: &[f64], ways: &[bool]) {
        self.model.advance(q, ways);
        let directions = self.model.directions();
        for c in self.model.keyed() {
            if self.first[*c] == 0 {
                self.first[*c] = directions[*c];
            }
        }
    }

    fn pass(&mut self, q: &[f64]) {
        let ways = self.program.take_way();
        self.tell(q, &ways);
    }

    fn go(&mut self, block: &Block, motion: &Motion, mut target: Few<f64>, drills: bool) -> Result<()> {
        if drills {
            let in_plane = self.program.control().in_plane();
            for i in (0..target.len()).filter(|i| !in_plane[*i]) {
                target[i] = self.program.meant().program()[i];
            }
        }
        // What is no arc is refused when it is corrected.
        let arc = match motion.kind {
            MotionKind::ArcCw | MotionKind::ArcCcw if !drills => {
                Arc::of(&self.program, block, motion, &target).ok()
            }
            _ => None,
        };
        if let Some(arc) = arc {
            for s in arc.stations() {
                let q = self.program.joints(block, &arc.at(s))?;
                self.pass(&q);
            }
        }
        let q = self.program.joints(block, &target)?;
        self.pass(&q);
        let end = Position::new(q, target);
        self.program.arrive(end.clone(), end);
        if drills {
            self.program.leave_normal();
        }
        Ok(())
    }
}

impl<'a> Follow<'a> for Scout<'a> {
    fn program(&self) -> &Interpreter<'a> {
        &self.program
    }

    fn block(&mut self, block: &mut Block, _: &mut dyn Write) -> Result<()> {
        for event in self.program.block(block)? {
            match event {
                Event::Units | Event::Preset { .. } | Event::Drilled => {}
                Event::Sent { q, ways, .. } => self.tell(&q, &ways),
                Event::Move { motion, target, drills } => self.go(block, &motion, target, drills)?,
            }
        }
        Ok(())
    }
}

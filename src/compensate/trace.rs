//! The trace of a program: where it takes the tip, move by move.

use std::io::Write;

use super::arc::Arc;
use super::event::Event;
use super::fault::CompensateFault;
use super::interpreter::Interpreter;
use super::position::Position;
use super::refusal::refuse;
use super::subprograms::Follow;
use crate::error::Result;
use crate::few::Few;
use crate::lie::Pose;
use crate::nc::{Block, Motion, MotionKind};

/// Most places at which one move is looked at.
const MOST_PLACES: usize = 256;

/// Where a machine has its tip.
pub(super) trait Machine {
    /// The joints are sent to `q` by ways of which it is said whether they are known.
    fn send(&mut self, q: &[f64], ways: &[bool]);

    /// Frame `t` in frame `w` where the machine passes `q` on the way to the place last sent to.
    fn w_from_t(&self, q: &[f64]) -> Pose<f64>;
}

/// What a move is for a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sort {
    /// To a place of the machine's own.
    Sent,
    /// A line or a rapid move.
    Straight,
    /// An arc.
    Arc,
    /// The place of a drilling cycle, whose depth is its own.
    Cycle,
}

/// One move.
#[derive(Clone, Debug)]
pub(super) struct Leg {
    pub line: usize,
    pub sort: Sort,
    /// Whether the place of every axis is known at its end.
    pub known: bool,
    /// The tip along the move, behind its start up to its end; of a tool axis along z.
    pub tips: Vec<Pose<f64>>,
}

/// A program that is followed for its moves.
pub(super) struct Trace<'a, M> {
    program: Interpreter<'a>,
    machine: M,
    /// Distance of places along a move, m.
    chord: f64,
    legs: Vec<Leg>,
}

impl<'a, M: Machine> Trace<'a, M> {
    /// From the start of `program`.
    pub fn new(mut program: Interpreter<'a>, mut machine: M, chord: f64) -> Self {
        let ways = program.take_way();
        machine.send(program.meant().q(), &ways);
        Trace { program, machine, chord, legs: Vec::new() }
    }

    /// The moves since this was asked last.
    pub fn take(&mut self) -> impl Iterator<Item = Leg> {
        self.legs.drain(..)
    }

    fn go(&mut self, block: &Block, motion: &Motion, mut target: Few<f64>, drills: bool) -> Result<()> {
        let control = self.program.control();
        if drills {
            let in_plane = control.in_plane();
            for i in (0..target.len()).filter(|i| !in_plane[*i]) {
                target[i] = self.program.meant().program()[i];
            }
        }
        let arc = match motion.kind {
            MotionKind::ArcCw | MotionKind::ArcCcw if !drills => {
                match Arc::of(&self.program, block, motion, &target) {
                    Ok(arc) => Some(arc),
                    Err(what) => return refuse(block, 0, CompensateFault::ArcGeometry { what }),
                }
            }
            _ => None,
        };
        let start = self.program.meant().clone();
        let end = Position::new(self.program.joints(block, &target)?, target);
        let mut tips = Vec::new();
        let ways = self.program.take_way();
        match &arc {
            Some(arc) => {
                for s in arc.stations().into_iter().skip(1) {
                    let q = self.program.joints(block, &arc.at(s))?;
                    self.machine.send(&q, &ways);
                    tips.push(self.tip(&q));
                }
            }
            None => {
                self.machine.send(end.q(), &ways);
                let control = self.program.control();
                let tip_t = control.tip().translation;
                let tip_w = |q: &[f64]| control.nominal().tool_point(q, tip_t);
                let way = (tip_w(end.q()) - tip_w(start.q())).norm();
                let turn: f64 = start.q().iter().zip(end.q()).map(|(a, b)| (a - b).abs()).sum();
                // A turn is looked at every few degrees.
                let places =
                    (way / self.chord).max(turn / 0.1).ceil().clamp(1.0, MOST_PLACES as f64) as usize;
                for k in 1..places {
                    if let Some(q) = control.between(&start, &end, k as f64 / places as f64) {
                        tips.push(self.tip(&q));
                    }
                }
                tips.push(self.tip(end.q()));
            }
        }
        let sort = match (&arc, drills) {
            (_, true) => Sort::Cycle,
            (Some(_), _) => Sort::Arc,
            (None, _) => Sort::Straight,
        };
        let known = !self.program.places().any_parked();
        self.legs.push(Leg { line: block.line(), sort, known, tips });
        self.program.arrive(end.clone(), end);
        if drills {
            self.program.leave_normal();
        }
        Ok(())
    }

    fn tip(&self, q: &[f64]) -> Pose<f64> {
        self.machine.w_from_t(q) * self.program.control().tip()
    }
}

impl<'a, M: Machine> Follow<'a> for Trace<'a, M> {
    fn program(&self) -> &Interpreter<'a> {
        &self.program
    }

    fn block(&mut self, block: &mut Block, _: &mut dyn Write) -> Result<()> {
        for event in self.program.block(block)? {
            match event {
                Event::Units | Event::Preset { .. } | Event::Drilled => {}
                Event::Sent { q, ways, .. } => {
                    self.machine.send(&q, &ways);
                    self.legs.push(Leg {
                        line: block.line(),
                        sort: Sort::Sent,
                        known: false,
                        tips: Vec::new(),
                    });
                }
                Event::Move { motion, target, drills } => {
                    if matches!(motion.kind, MotionKind::Other) {
                        let what = "this motion".to_string();
                        return refuse(block, 0, CompensateFault::OtherMotion { what });
                    }
                    self.go(block, &motion, target, drills)?;
                }
            }
        }
        Ok(())
    }
}

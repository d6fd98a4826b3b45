//! From where each axis comes: only a way between two known places gives a direction of travel.

use super::arc::Arc;
use super::follower::{Follower, Position, Status};
use super::model::Model;
use super::report::UnknownWay;
use crate::error::Result;
use crate::nc::{Block, Motion, MotionKind};

/// What is known of the ways so far.
pub(super) struct Ways {
    /// By axis: whether the program, or the set-up, has said where it stands.
    pub sure: Vec<bool>,
    /// The same at the position last told.
    before: Vec<bool>,
    /// By command: whether its position last told is known.
    known: Vec<bool>,
    /// By command: direction of its first motion on a known way; 0 as long as there is none.
    pub first: Vec<i8>,
}

impl Ways {
    pub fn new(axes: usize, commands: usize) -> Self {
        Ways {
            sure: vec![false; axes],
            before: vec![false; axes],
            known: vec![false; commands],
            first: vec![0; commands],
        }
    }

    /// Whether every direction that counts has been found.
    pub fn found(&self, model: &dyn Model) -> bool {
        model.keyed().iter().all(|c| self.first[*c] != 0)
    }
}

impl Follower<'_> {
    /// By command: whether its position is known, and whether its way there from the position last told is.
    fn known(&self) -> (Vec<bool>, Vec<bool>) {
        let axes = || self.control.axes.iter().zip(&self.status).enumerate();
        let sure = &self.ways.sure;
        // Where the tip is programmed, the places of the linear joints follow from all of its words. A rotary axis that the program has not named is
        // taken as standing at zero until it does.
        let tip = axes().all(|(i, (axis, status))| match (axis.tip, axis.rotary) {
            (Some(_), _) => sure[i],
            (None, true) => sure[i] || *status != Status::Parked,
            (None, false) => true,
        });
        let turned = axes().any(|(i, (axis, _))| axis.rotary && sure[i] && !self.ways.before[i]);
        let mut known = vec![false; self.machine.commands().len()];
        let mut ways = known.clone();
        for (i, (axis, _)) in axes() {
            let Some((c, _)) = axis.command else { continue };
            let by_tip = self.control.tcp && axis.tip.is_some();
            known[c] = if by_tip { tip } else { sure[i] };
            ways[c] = known[c] && self.ways.known[c] && !(by_tip && turned);
        }
        (known, ways)
    }

    /// By command: whether the way from the position last told to the one in force is known.
    pub fn ways(&self) -> Vec<bool> {
        self.known().1
    }

    /// Tells the model where the machine goes. `line`: of the block whose end is corrected there; `None` where it is not.
    pub fn tell(&mut self, line: Option<usize>, q: &[f64]) {
        let (known, ways) = self.known();
        self.model.advance(q, &ways);
        self.ways.known = known;
        self.ways.before.clone_from(&self.ways.sure);
        let directions = self.model.directions();
        for c in self.model.keyed() {
            if self.ways.first[*c] == 0 {
                self.ways.first[*c] = directions[*c];
            }
            let placed = (self.control.axes.iter().zip(&self.status))
                .any(|(axis, status)| axis.command.is_some_and(|a| a.0 == *c) && *status == Status::Placed);
            if let Some(line) = line.filter(|_| placed && !ways[*c]) {
                let joint = self.machine.commands()[*c].clone();
                self.report.unknown_ways.push(UnknownWay { line, joint, side: directions[*c] });
            }
        }
    }

    /// Goes where the block goes, and no more.
    pub fn scout(&mut self, block: &Block, motion: &Motion, mut target: Vec<f64>) -> Result<()> {
        let drills = motion.kind == MotionKind::Cycle || self.state.modes().modal_call;
        if drills {
            let normal = self.control.normal;
            for (i, axis) in self.control.axes.iter().enumerate() {
                if axis.tip.is_none_or(|k| k == normal) {
                    target[i] = self.meant.program[i];
                }
            }
        }
        // What is no arc is refused when it is corrected.
        let arc = match motion.kind {
            MotionKind::ArcCw | MotionKind::ArcCcw if !drills => {
                Arc::of(self, block, motion, &self.meant.program, &target).ok()
            }
            _ => None,
        };
        for s in arc.iter().flat_map(Arc::stations) {
            let q = self.joints(block, &arc.as_ref().map_or(target.clone(), |arc| arc.at(s)))?;
            self.tell(None, &q);
        }
        let q = self.joints(block, &target)?;
        self.tell(None, &q);
        self.meant = Position { q, program: target };
        self.written = self.meant.clone();
        if drills {
            self.leave_normal();
        }
        Ok(())
    }

    /// These axes stand where the machine has its reference point: known, but not on which way they went there.
    pub fn refer(&mut self, axes: &[(usize, f64)]) {
        for (i, place) in axes {
            if let Some((c, q)) = self.control.machine_joint(*i, *place) {
                (self.meant.q[c], self.written.q[c]) = (q, q);
            }
        }
        let q = self.meant.q.clone();
        self.tell(None, &q);
        for (i, _) in axes {
            (self.ways.sure[*i], self.ways.before[*i]) = (true, true);
        }
        self.ways.known = self.known().0;
        self.refresh();
    }
}

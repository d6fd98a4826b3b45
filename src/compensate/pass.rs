//! One pass over a program: where it is, how it is corrected, and what there is to tell of it.

use std::f64::consts::TAU;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use super::corrector::{Correction, Corrector, Solvers};
use super::envelope::{Envelope, expected};
use super::event::Event;
use super::fault::CompensateFault;
use super::interpreter::Interpreter;
use super::looks::{Looks, Move, Seen, mid_line};
use super::model::Model;
use super::motion_word::{first_of, motion_word};
use super::options::{CompensateOptions, UnknownAxes};
use super::output::put;
use super::part::Part;
use super::position::Position;
use super::refusal::refuse;
use super::report::{
    ExtrapolatedJoint, Report, Reversal, SingularBlock, UnknownPlace, UnknownWay, Unreached, UnseenPiece,
    Worst,
};
use super::standing::Standing;
use super::style::{Style, plain};
use super::tip_error::TipError;
use super::unseen::UnseenSums;
use super::words;
use crate::chain::Chain;
use crate::error::{Error, Place, Result};
use crate::few::Few;
use crate::inverse::{Outcome, Solution};
use crate::machine::JointKind;
use crate::nc::{Block, Motion, MotionKind, Number};
use crate::scalar::MOST_LANES;

/// Whole turns are told from others within this, rad; lengths from none, m.
const NO_WAY: f64 = 1e-9;

/// A program being corrected.
pub(super) struct Pass<'a, 'm> {
    program: Interpreter<'a>,
    corrector: Corrector<'a, 'm>,
    options: &'m CompensateOptions,
    style: Style,
    /// Motion in force by what has been written.
    written_motion: Option<MotionKind>,
    /// What there is to tell of this batch, and of those before it.
    told: Part,
    before: Part,
    envelope: Envelope,
    /// The last line that went beyond what the calibration has seen.
    extrapolated: usize,
    /// Straight moves that were corrected and are looked at later.
    looks: Looks,
    file: Option<Arc<Path>>,
}

impl<'a, 'm> Pass<'a, 'm> {
    /// From the start of `program`. `first`: direction of the first motion of each command, 0 where that is not known.
    pub fn new(
        mut program: Interpreter<'a>,
        model: &'m mut dyn Model,
        solvers: &'m Solvers<'a>,
        options: &'m CompensateOptions,
        first: &[i8],
    ) -> Self {
        model.restart(first);
        let ways = program.take_way();
        let style = Style::new(options.decimals);
        let start = Standing { program, style, written_motion: None, last: None };
        Pass::told(start, &ways, model, solvers, options)
    }

    /// Behind some lines, for a model without history.
    pub fn behind(
        start: Standing<'a>,
        model: &'m mut dyn Model,
        solvers: &'m Solvers<'a>,
        options: &'m CompensateOptions,
    ) -> Self {
        let ways = start.program.open_ways();
        Pass::told(start, &ways, model, solvers, options)
    }

    fn told(
        start: Standing<'a>,
        ways: &[bool],
        model: &'m mut dyn Model,
        solvers: &'m Solvers<'a>,
        options: &'m CompensateOptions,
    ) -> Self {
        let Standing { program, style, written_motion, last } = start;
        let machine = program.control().machine();
        let mut corrector = Corrector::behind(last, model, solvers);
        corrector.advance(program.meant().q(), ways);
        let report = Report { machine: machine.name().to_string(), ..Report::default() };
        Pass {
            program,
            corrector,
            options,
            style,
            written_motion,
            told: Part { report, unseen: UnseenSums::default() },
            before: Part::default(),
            envelope: Envelope::new(machine, options.max_correction),
            extrapolated: 0,
            looks: Looks::default(),
            file: None,
        }
    }

    /// What stands behind the last line, and what there is to tell since this or [`Pass::end_batch`] began, [`Pass::look`] included.
    pub fn stop(mut self) -> (Part, Standing<'a>) {
        self.settle_unseen();
        let Pass { program, style, written_motion, corrector, .. } = self;
        (self.told, Standing { program, style, written_motion, last: corrector.into_last() })
    }

    /// Sums over moves begin anew here, so that they are the same however many batches are corrected side by side.
    ///
    /// # Errors
    /// As [`Pass::look`].
    pub fn end_batch(&mut self) -> Result<()> {
        self.look()?;
        self.settle_unseen();
        let report = Report { machine: self.told.report.machine.clone(), ..Report::default() };
        let told = std::mem::replace(&mut self.told, Part { report, unseen: UnseenSums::default() });
        self.before.absorb(told);
        Ok(())
    }

    /// Looks at positions that lie ahead, as [`Corrector::foresee`].
    pub fn foresee(&mut self, meant: &[Few<f64>]) {
        self.corrector.foresee(self.program.control(), meant);
    }

    /// Takes up what there is to tell of the lines before.
    pub fn absorb(&mut self, before: Part) {
        self.before.absorb(before);
    }

    /// Whether anything is written otherwise than it was.
    pub fn has_corrected(&self) -> bool {
        self.before.report.has_corrected() || self.told.report.has_corrected()
    }

    pub fn program(&self) -> &Interpreter<'a> {
        &self.program
    }

    pub fn corrector(&self) -> &Corrector<'a, 'm> {
        &self.corrector
    }

    pub fn options(&self) -> &'m CompensateOptions {
        self.options
    }

    pub fn style(&self) -> &Style {
        &self.style
    }

    /// What there is to tell so far.
    pub fn report(&mut self) -> &mut Report {
        &mut self.told.report
    }

    /// Follows a block up to its move under program coordinates, which is the caller's; without one the block is written as it is.
    pub fn begin(
        &mut self,
        block: &mut Block,
        out: &mut dyn Write,
    ) -> Result<Option<(Motion, Few<f64>, bool)>> {
        // Under what holds now.
        if !self.looks.is_empty() && !block.is_plain_motion() {
            self.look()?;
        }
        for event in self.program.block(block)? {
            match event {
                Event::Units => self.style.forget_lengths(),
                Event::Preset { words } => self.put_preset(block, &words)?,
                Event::Drilled => self.told.report.cycles += 1,
                Event::Sent { q, ways, kind } => {
                    self.corrector.advance(&q, &ways);
                    self.written_motion = kind.or(self.written_motion);
                    self.told.report.machine_moves += 1;
                }
                // The last thing that a block makes happen.
                Event::Move { motion, target, drills } => {
                    self.told.report.moves += 1;
                    self.style.read(block, &motion, self.program.control(), self.program.dialect());
                    return Ok(Some((motion, target, drills)));
                }
            }
        }
        put(block, out)?;
        Ok(None)
    }

    /// Adds to the numbers of a preset what the machine stands beside the place that is meant.
    fn put_preset(&mut self, block: &mut Block, words: &[(usize, usize, f64)]) -> Result<()> {
        for &(word, axis, by) in words {
            let control = self.program.control();
            let Some(number) = plain(&block.words()[word]) else { continue };
            let places = self.style.places(control, axis).max(number.decimals);
            let by = control.programmed(axis, by);
            let text = number.write_like(number.value + by, Some(places));
            let mut left = by;
            if by.abs() > 0.500_001 * 10f64.powi(-(places as i32)) {
                let dialect = self.program.dialect();
                let written = Number::parse(text.as_bytes(), dialect).map_or(number.value + by, |n| n.value);
                left = number.value + by - written;
                block.replace(word, &self.style.pointed(&text))?;
                self.told.report.corrected_words += 1;
            }
            let left = control.si(axis, left);
            self.program.set_slip(axis, left);
        }
        Ok(())
    }

    /// Goes to a position that is corrected in this line, or passes it there.
    pub fn tell(&mut self, line: usize, q: &[f64]) {
        let ways = self.program.take_way();
        self.corrector.advance(q, &ways);
        let (control, places) = (self.program.control(), self.program.places());
        let is_placed = |command: usize| {
            let mut axes = control.axes().iter().enumerate();
            axes.any(|(i, axis)| axis.command().is_some_and(|a| a.0 == command) && places.is_placed(i))
        };
        let model = self.corrector.model();
        let unknown = model.keyed().iter().filter(|c| !ways[**c] && is_placed(**c));
        for c in unknown {
            let joint = control.machine().commands()[*c].clone();
            let side = model.directions()[*c];
            self.told.report.unknown_ways.push(UnknownWay { line, joint, side });
        }
    }

    /// As [`Pass::tell`]; where that changes the piece, the step of the correction is noted.
    ///
    /// # Errors
    /// [`CompensateFault::Unseen`] where the model is continued too far.
    pub fn advance(&mut self, block: &Block, q: &[f64]) -> Result<()> {
        let line = block.line();
        self.tell(line, q);
        if self.corrector.model().extrapolates(q) {
            self.go_beyond(block, q)?;
        }
        if let Some(piece) = self.corrector.model().unseen_piece() {
            self.told.report.unseen_directions.push_once(UnseenPiece { line, piece }, line);
        }
        if let Some(step) = self.corrector.step(&self.program) {
            let (step_m, step_rad) = (step.m(), step.rad());
            self.told.report.largest_reversal_m.take(step_m, line);
            if self.options.max_step.is_some_and(|most| step_m > most) {
                self.told.report.large_steps.push(Reversal { line, step_m, step_rad });
            }
            self.told.report.reversals.push(Reversal { line, step_m, step_rad });
        }
        Ok(())
    }

    /// Notes a position beyond what the calibration has seen. What only depends on where the joints are seen to be may be continued as
    /// long as that moves the tip less than what a machine may be off that was never calibrated.
    fn go_beyond(&mut self, block: &Block, q: &[f64]) -> Result<()> {
        let line = block.line();
        if self.extrapolated != line {
            self.extrapolated = line;
            self.told.report.extrapolated_moves += 1;
        }
        let (model, control) = (self.corrector.model(), self.program.control());
        let nearest = model.nearest_seen(q);
        let mut beyond: Few<usize> = Few::new();
        for (c, (q, seen)) in q.iter().zip(&nearest).enumerate() {
            let off = (q - seen).abs();
            let rotary = control.machine().command_joint(c).kind == JointKind::Revolute;
            let by = if rotary { off.rem_euclid(TAU) } else { off };
            if by < NO_WAY || TAU - by < NO_WAY {
                continue;
            }
            beyond.push(c);
            let joint = &control.machine().commands()[c];
            match self.told.report.extrapolated_joints.iter_mut().find(|beyond| beyond.joint == *joint) {
                Some(beyond) => beyond.by.take(by, line),
                None => {
                    let by = Worst { value: by, line };
                    self.told.report.extrapolated_joints.push(ExtrapolatedJoint {
                        joint: joint.clone(),
                        rotary,
                        by,
                    });
                }
            }
        }
        if self.options.force || self.program.places().any_parked() {
            return Ok(());
        }
        let tip = |chain: &Chain<f64>| chain.w_from_t(q) * control.tip();
        let continued = TipError::between(tip(model.chain()), tip(&model.chain_at(&nearest)));
        let bound_m = expected(control, q);
        if continued.m() > bound_m {
            let joints = beyond.iter().map(|c| control.machine().commands()[*c].clone()).collect();
            return refuse(block, 0, CompensateFault::Unseen { joints, by_m: continued.m(), bound_m });
        }
        Ok(())
    }

    /// Refuses or tells a move to `q` that needs axes of which it is not known where they stand; of axes asked of by `is_asked`.
    pub fn need_places(
        &mut self,
        block: &Block,
        motion: &Motion,
        q: &[f64],
        is_asked: &dyn Fn(usize) -> bool,
    ) -> Result<()> {
        let wanted = self.corrector.wants(&self.program, &self.style, q, is_asked);
        if wanted.is_empty() {
            return Ok(());
        }
        let axes: Vec<String> =
            wanted.iter().map(|i| self.program.control().axes()[*i].address().to_string()).collect();
        let keeps = match self.options.unknown {
            Some(unknown) => unknown == UnknownAxes::Keep,
            None => motion.kind == MotionKind::Rapid,
        };
        if !keeps {
            return refuse(block, 0, CompensateFault::UnknownPlace { axes });
        }
        let line = block.line();
        self.told.report.unknown_places.push_once(UnknownPlace { line, axes }, line);
        Ok(())
    }

    /// Corrects a position, as [`Corrector::correct`].
    ///
    /// # Errors
    /// [`CompensateFault::OutOfTravel`] where a joint would have to leave its travel.
    pub fn correct(
        &mut self,
        block: &Block,
        q: &[f64],
        words: Option<&[Option<usize>]>,
    ) -> Result<Correction> {
        let carrier = words.is_some().then_some(block);
        let correction =
            self.corrector.correct(&self.program, &self.style, q, carrier, words.unwrap_or_default());
        self.note(block, correction.solution())?;
        Ok(correction)
    }

    /// Notes what the inverse could not do.
    fn note(&mut self, block: &Block, solution: &Solution) -> Result<()> {
        let line = block.line();
        let left_rad = solution.angle_left_rad;
        match solution.outcome {
            Outcome::OutOfTravel { command, by } => {
                let machine = self.corrector.machine();
                let joint = machine.commands()[command].clone();
                let rotary = machine.command_joint(command).kind == JointKind::Revolute;
                return refuse(block, 0, CompensateFault::OutOfTravel { joint, by, rotary });
            }
            Outcome::Singular { lost_w } => {
                let lost_w = lost_w.to_array();
                self.told.report.singular.push_once(SingularBlock { line, lost_w, left_rad }, line);
            }
            Outcome::Unreachable
                if solution.position_left_m > 1e-9 && self.program.free().iter().all(|f| *f) =>
            {
                let left_m = solution.position_left_m;
                self.told.report.unreachable.push_once(Unreached { line, left_m, left_rad }, line);
            }
            _ => {}
        }
        Ok(())
    }

    /// Puts the numbers of a correction into a block.
    pub fn put_words(&mut self, block: &mut Block, motion: &Motion, correction: &Correction) -> Result<()> {
        let habits = (&self.style, self.program.control());
        words::put_into(block, &motion.words, correction.numbers(), habits, &mut self.told.report)
    }

    /// Writes the block's motion word where what was written before has put another one into force.
    pub fn restate(&mut self, block: &mut Block, motion: &Motion) -> Result<()> {
        let arc = match motion.kind {
            MotionKind::ArcCw => Some("2"),
            MotionKind::ArcCcw => Some("3"),
            _ => None,
        };
        let differs = self.written_motion.is_some_and(|in_force| in_force != motion.kind);
        if let Some(code) = arc.filter(|_| differs && motion_word(block).is_none()) {
            block.insert_before(first_of(block, motion), "G", code)?;
        }
        self.put_in_force(motion.kind);
        Ok(())
    }

    /// Motion in force behind what has been written.
    pub fn put_in_force(&mut self, kind: MotionKind) {
        self.written_motion = Some(kind);
    }

    /// Takes a corrected position as reached.
    ///
    /// # Errors
    /// [`CompensateFault::TooFar`] where it is further off than any machine of these tolerances would be.
    pub fn arrive(&mut self, block: &Block, meant: Position, correction: Correction) -> Result<()> {
        self.look()?;
        let (goal, written) = (*correction.goal(), correction.into_written());
        let control = self.program.control();
        let is_placed = !self.program.places().any_parked();
        let left = is_placed.then(|| self.corrector.error(&goal, written.q()));
        let by = TipError::between(control.tip_pose(written.q()), goal.w_from_tip);
        let seen = Seen {
            line: block.line(),
            meant: Few::from_slice(meant.q()),
            left: left.map(|left| (left.m(), left.rad())),
            correction: (by.m(), by.rad()),
            mid_line_m: None,
        };
        self.file.get_or_insert_with(|| block.file());
        self.see(seen)?;
        self.reach(meant, written);
        Ok(())
    }

    /// As [`Pass::arrive`], by a straight move. `starts`: from where, as meant and as written, where what lies between counts.
    ///
    /// # Errors
    /// As [`Pass::arrive`], and of moves before it.
    pub fn arrive_straight(
        &mut self,
        block: &Block,
        starts: Option<[&Position; 2]>,
        meant: Position,
        correction: Correction,
    ) -> Result<()> {
        if !self.corrector.model().is_constant() {
            if let Some([start, written_start]) = starts {
                let written = (written_start, correction.written());
                let left = mid_line(self.program.control(), &self.corrector, (start, &meant), written);
                self.told.report.largest_mid_line_m.take(left, block.line());
            }
            return self.arrive(block, meant, correction);
        }
        let is_placed = !self.program.places().any_parked();
        let (goal, ends) = (correction.goal(), [&meant, correction.written()]);
        let are_enough = self.looks.wait(Move { line: block.line(), goal, ends, starts, is_placed });
        self.file.get_or_insert_with(|| block.file());
        if are_enough {
            self.look()?;
        }
        self.reach(meant, correction.into_written());
        Ok(())
    }

    /// Looks at the moves that wait for it.
    ///
    /// # Errors
    /// As [`Pass::arrive`], of the first one that is too far.
    pub fn look(&mut self) -> Result<()> {
        if self.looks.is_empty() {
            return Ok(());
        }
        let mut looks = std::mem::take(&mut self.looks);
        let mut all = Vec::with_capacity(MOST_LANES);
        looks.look(self.program.control(), &self.corrector, |seen| all.push(seen));
        self.looks = looks;
        all.into_iter().try_for_each(|seen| self.see(seen))
    }

    /// Notes what there is to see of a move.
    fn see(&mut self, seen: Seen) -> Result<()> {
        let (line, report) = (seen.line, &mut self.told.report);
        // Where an axis stands at a place of the machine, the tip is nowhere that matters.
        if let Some((left_m, left_rad)) = seen.left {
            report.largest_left_m.take(left_m, line);
            report.largest_left_rad.take(left_rad, line);
        }
        let (by_m, by_rad) = seen.correction;
        if let Some(bound_m) = self.envelope.exceeded(self.program.control(), &seen.meant, by_m) {
            let file = self.file.as_deref().unwrap_or(Path::new(""));
            return Err(Error::input(Place::at(file, line, 1), CompensateFault::TooFar { by_m, bound_m }));
        }
        report.largest_correction_m.take(by_m, line);
        report.largest_correction_rad.take(by_rad, line);
        if let Some(mid_line_m) = seen.mid_line_m {
            report.largest_mid_line_m.take(mid_line_m, line);
        }
        Ok(())
    }

    fn settle_unseen(&mut self) {
        if let Some(patterns) = self.corrector.unseen() {
            self.told.unseen.settle(self.program.control(), patterns);
        }
    }

    fn reach(&mut self, meant: Position, written: Position) {
        if let Some(patterns) = self.corrector.unseen().filter(|p| !p.is_empty()) {
            self.told.unseen.add(self.program.control(), patterns, written.q());
        }
        self.program.arrive(meant, written);
    }

    /// Takes a place as reached at which a cycle has run.
    pub fn arrive_behind_cycle(&mut self, meant: Position, written: Position) {
        self.program.arrive(meant, written);
        self.program.leave_normal();
    }

    /// The report of what was followed.
    ///
    /// # Errors
    /// As [`Pass::look`].
    pub fn finish(mut self) -> Result<Report> {
        self.end_batch()?;
        let Part { mut report, unseen } = self.before;
        let machine = self.corrector.machine();
        report.unseen = self.corrector.unseen().map(|patterns| unseen.report(machine, patterns));
        let (left_out, held) = self.corrector.reservations();
        (report.left_out, report.held) = (left_out.to_vec(), held.to_vec());
        if report.moves > 0 {
            let axes = self.program.control().axes().iter().enumerate();
            report.never_programmed = axes
                .filter(|(i, axis)| axis.command().is_some() && !self.program.places().is_named(*i))
                .map(|(_, axis)| axis.address().to_string())
                .collect();
        }
        Ok(report)
    }
}

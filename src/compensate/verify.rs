//! Verification: a compensated program is read anew, and where it takes the tip of the calibrated machine is held against where the
//! original takes that of the nominal one, `docs/compensate.md` (C16).

use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::sync::mpsc;

use serde::{Deserialize, Serialize};

use super::calibrated::model_of;
use super::interpreter::Interpreter;
use super::mark::{Mark, Origin};
use super::model::Model;
use super::options::IntegerUnit;
use super::passage::{Passage, Survey, read_as};
use super::report::{Listed, Worst};
use super::scout::Scout;
use super::setup::Setup;
use super::trace::{Leg, Machine, Sort, Trace};
use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::error::{Error, Result};
use crate::lie::{Pose, Vec3};
use crate::nc::{Dialect, Program};

/// How programs are compared.
#[non_exhaustive]
#[derive(Clone, Copy, Debug)]
pub struct VerifyOptions {
    /// How far the tip may be off at the end of a move, m.
    pub tolerance: f64,
    /// How far it may be off the path between the ends of moves, m; without, that is told and not judged.
    pub between: Option<f64>,
    /// Distance of the places at which a move is looked at, m.
    pub chord: f64,
    /// The dialect, where it is not to be taken from the program.
    pub dialect: Option<Dialect>,
    /// What axis numbers without a point count; without, millimetres and degrees.
    pub integer_unit: Option<IntegerUnit>,
    /// Whether they are compared even where the compensated program says that it was written from something else.
    pub force: bool,
}

impl Default for VerifyOptions {
    /// 2 um at the ends of moves; moves looked at every millimetre.
    fn default() -> Self {
        VerifyOptions {
            tolerance: 2e-6,
            between: None,
            chord: 1e-3,
            dialect: None,
            integer_unit: None,
            force: false,
        }
    }
}

impl VerifyOptions {
    /// The same with another tolerance at the ends of moves, m.
    #[must_use]
    pub fn with_tolerance(mut self, tolerance: f64) -> Self {
        self.tolerance = tolerance;
        self
    }

    /// The same with a tolerance between the ends of moves, m.
    #[must_use]
    pub fn with_between(mut self, between: f64) -> Self {
        self.between = Some(between);
        self
    }

    /// The same with a dialect that is not taken from the programs.
    #[must_use]
    pub fn with_dialect(mut self, dialect: Dialect) -> Self {
        self.dialect = Some(dialect);
        self
    }

    /// The same with another account of numbers without a point.
    #[must_use]
    pub fn with_integer_unit(mut self, unit: IntegerUnit) -> Self {
        self.integer_unit = Some(unit);
        self
    }

    /// The same also where the compensated program says that it was written from something else.
    #[must_use]
    pub fn with_force(mut self) -> Self {
        self.force = true;
        self
    }
}

/// A move whose tip is not where it is meant.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Departure {
    /// Line of the original; 0 for a move that it does not have.
    pub line: usize,
    /// Line of the compensated program.
    pub compensated_line: usize,
    /// How far off at its end, m; none where a move has no counterpart.
    pub end_m: Option<f64>,
    /// How far off the meant path before its end, m; likewise.
    pub between_m: Option<f64>,
}

/// What a comparison found.
#[non_exhaustive]
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Verification {
    /// Name of the machine.
    pub machine: String,
    /// Moves of the original.
    pub moves: u64,
    /// Of these, moves at whose end every axis stands at a known place, so that they could be judged.
    pub judged: u64,
    /// Tip at the ends of moves.
    pub largest_end_m: Worst,
    /// Tool axis at the ends of moves.
    pub largest_axis_rad: Worst,
    /// Tip beside the meant path.
    pub largest_between_m: Worst,
    /// Moves beyond the tolerances, or without a counterpart.
    pub departures: Listed<Departure>,
}

impl Verification {
    /// Whether every move that could be judged is within the tolerances.
    pub fn holds(&self) -> bool {
        self.departures.count == 0
    }
}

/// Reads `original` and `compensated` and compares, move by move, where they take the tip: the original on the nominal machine, the
/// compensated one on the calibrated machine. Memory does not grow with the programs, sub-programs aside.
///
/// # Errors
/// [`Error::Input`] with the line of either program that cannot be followed, or of a mark that says that the compensated one was written
/// from something else; [`Error::File`].
pub fn verify(
    calibrated: &CalibratedMachine,
    original: impl AsRef<Path>,
    compensated: impl AsRef<Path>,
    setup: &Setup,
    options: &VerifyOptions,
) -> Result<Verification> {
    let (original, compensated) = (original.as_ref(), compensated.as_ref());
    verify_written(calibrated, original, (compensated, compensated), setup, options)
}

/// As [`verify`], where the compensated program stands in a file that has not its name yet; file and name.
pub(crate) fn verify_written(
    calibrated: &CalibratedMachine,
    original: &Path,
    (file, name): (&Path, &Path),
    setup: &Setup,
    options: &VerifyOptions,
) -> Result<Verification> {
    let open = |path: &Path| File::open(path).map(BufReader::new).map_err(|e| Error::file(path, e));
    let meant = || Program::new(original, open(original)?);
    let written = || Program::new(name, open(file)?);
    check(calibrated, (&meant, &written), setup, options)
}

/// As [`verify`], of texts.
///
/// # Errors
/// As [`verify`].
pub fn verify_text(
    calibrated: &CalibratedMachine,
    original: impl AsRef<[u8]>,
    compensated: impl AsRef<[u8]>,
    setup: &Setup,
    options: &VerifyOptions,
) -> Result<Verification> {
    let (original, compensated) = (original.as_ref(), compensated.as_ref());
    let meant = || Program::new("original", original);
    let written = || Program::new("compensated", compensated);
    check(calibrated, (&meant, &written), setup, options)
}

/// Opens a program anew.
type Open<'o, R> = &'o (dyn Fn() -> Result<Program<R>> + Sync);

fn check<A: BufRead, B: BufRead>(
    calibrated: &CalibratedMachine,
    (meant, written): (Open<A>, Open<B>),
    setup: &Setup,
    options: &VerifyOptions,
) -> Result<Verification> {
    let machine = calibrated.machine();
    let meant = || {
        let mut program = meant()?;
        read_as(&mut program, options.dialect, options.integer_unit);
        Ok::<_, Error>(program)
    };
    let written = || {
        let mut program = written()?;
        read_as(&mut program, options.dialect, options.integer_unit);
        Ok::<_, Error>(program)
    };
    let (original, compensated) = rayon::join(|| Survey::of(meant()?), || Survey::of(written()?));
    let (mut original, mut compensated) = (original?, compensated?);
    if !options.force {
        let origin = Origin::of(calibrated);
        compensated.refuse_foreign(Mark { program: original.fingerprint, origin })?;
    }
    let start = |dialect| Interpreter::new(machine, setup, dialect);
    let mut model = model_of(calibrated);
    let mut first = vec![0; machine.commands().len()];
    if !model.keyed().is_empty() {
        let program = written()?;
        let mut scout = Scout::new(start(program.dialect()), &mut *model);
        let mut passage = Passage::new(program, &mut compensated.calls);
        while !scout.has_found() && passage.step(&mut scout, &mut std::io::sink())? {}
        first = scout.finish();
    }
    model.restart(&first);
    let written = written()?;
    let trace = Trace::new(start(written.dialect()), Actual(model), options.chord);
    let mut written = Moves::of(followed(trace, Passage::new(written, &mut compensated.calls)));
    std::thread::scope(|scope| {
        // The original is followed beside what was written.
        let (send, receive) = mpsc::sync_channel(BATCHES);
        scope.spawn(move || {
            let mut all = || {
                let program = meant()?;
                let nominal = Nominal(Chain::nominal(machine));
                let trace = Trace::new(start(program.dialect()), nominal, options.chord);
                let mut more = followed(trace, Passage::new(program, &mut original.calls));
                // Nobody listens any more once the comparison has failed.
                while let Some(legs) = more()? {
                    if send.send(Ok(legs)).is_err() {
                        break;
                    }
                }
                Ok(())
            };
            if let Err(error) = all() {
                let _ = send.send(Err(error));
            }
        });
        let mut meant = Moves::of(move || receive.recv().ok().transpose());
        let mut found = compare(&mut meant, &mut written, options)?;
        found.machine = machine.name().to_string();
        Ok(found)
    })
}

/// Moves that are handed from thread to thread together, and how many such batches may wait.
const BATCH: usize = 256;
const BATCHES: usize = 4;

/// The moves of a program, batch by batch.
fn followed<'a, M: Machine, R: BufRead>(
    mut trace: Trace<'a, M>,
    mut passage: Passage<'_, R>,
) -> impl FnMut() -> Result<Option<Vec<Leg>>> {
    move || {
        let mut legs = Vec::with_capacity(BATCH);
        while legs.len() < BATCH && passage.step(&mut trace, &mut std::io::sink())? {
            legs.extend(trace.take());
        }
        Ok(Some(legs).filter(|legs| !legs.is_empty()))
    }
}

struct Nominal(Chain<f64>);

impl Machine for Nominal {
    fn send(&mut self, _: &[f64], _: &[bool]) {}

    fn w_from_t(&self, q: &[f64]) -> Pose<f64> {
        self.0.tool_pose(q)
    }
}

struct Actual<'a>(Box<dyn Model + 'a>);

impl Machine for Actual<'_> {
    fn send(&mut self, q: &[f64], ways: &[bool]) {
        self.0.advance(q, ways);
    }

    fn w_from_t(&self, q: &[f64]) -> Pose<f64> {
        self.0.chain_at(q).tool_pose(q)
    }
}

/// The moves of a program, as far ahead as they are asked for.
struct Moves<F> {
    more: F,
    ahead: VecDeque<Leg>,
}

impl<F: FnMut() -> Result<Option<Vec<Leg>>>> Moves<F> {
    /// `more`: the next of them, `None` behind the last.
    fn of(more: F) -> Self {
        Moves { more, ahead: VecDeque::new() }
    }

    /// The move that comes behind so many others.
    fn ahead(&mut self, count: usize) -> Result<Option<&Leg>> {
        while self.ahead.len() <= count
            && let Some(legs) = (self.more)()?
        {
            self.ahead.extend(legs);
        }
        Ok(self.ahead.get(count))
    }

    fn next(&mut self) -> Result<Option<Leg>> {
        self.ahead(0)?;
        Ok(self.ahead.pop_front())
    }
}

/// Each move of the original against the moves that were written for it: one, or the lines in the place of an arc or of a subdivided move.
fn compare(
    meant: &mut Moves<impl FnMut() -> Result<Option<Vec<Leg>>>>,
    written: &mut Moves<impl FnMut() -> Result<Option<Vec<Leg>>>>,
    options: &VerifyOptions,
) -> Result<Verification> {
    let mut found = Verification::default();
    let mut from: Option<Vec3<f64>> = None;
    while let Some(leg) = meant.next()? {
        found.moves += 1;
        let path: Vec<Vec3<f64>> =
            from.into_iter().chain(leg.tips.iter().map(|pose| pose.translation)).collect();
        let mut count = counterpart(&leg, &path, written, options)?;
        while stays(&leg, meant.ahead(0)?, written.ahead(count)?, options) {
            count += 1;
        }
        let own: Vec<Leg> = written.ahead.drain(..count.min(written.ahead.len())).collect();
        from = leg.tips.last().map(|pose| pose.translation);
        let line = leg.line;
        let Some(last) = own.last().filter(|last| (last.sort == Sort::Sent) == (leg.sort == Sort::Sent))
        else {
            let compensated_line = own.last().map_or(0, |leg| leg.line);
            let lost = Departure { line, compensated_line, end_m: None, between_m: None };
            found.departures.push(lost);
            continue;
        };
        let (Some(goal), Some(tip)) = (leg.tips.last(), last.tips.last()) else { continue };
        if !leg.known {
            continue;
        }
        found.judged += 1;
        let end_m = off(leg.sort, goal, tip);
        let (a, b) = (goal.rotation.column(2), tip.rotation.column(2));
        found.largest_axis_rad.take(a.cross(b).norm().atan2(a.dot(b)), line);
        found.largest_end_m.take(end_m, line);
        let places = own.iter().flat_map(|leg| &leg.tips).map(|pose| pose.translation);
        let between_m = match leg.sort {
            Sort::Cycle => 0.0,
            _ => places.map(|p| beside(&path, p)).fold(0.0, f64::max),
        };
        found.largest_between_m.take(between_m, line);
        if end_m > options.tolerance || options.between.is_some_and(|between| between_m > between) {
            let compensated_line = last.line;
            let (end_m, between_m) = (Some(end_m), Some(between_m));
            found.departures.push(Departure { line, compensated_line, end_m, between_m });
        }
    }
    while let Some(leg) = written.next()? {
        let more = Departure { line: 0, compensated_line: leg.line, end_m: None, between_m: None };
        found.departures.push(more);
    }
    Ok(found)
}

/// How many of the written moves belong to a move of the original: as many as lead along its path to its end.
fn counterpart(
    leg: &Leg,
    path: &[Vec3<f64>],
    written: &mut Moves<impl FnMut() -> Result<Option<Vec<Leg>>>>,
    options: &VerifyOptions,
) -> Result<usize> {
    let goal = leg.tips.last().filter(|_| matches!(leg.sort, Sort::Straight | Sort::Arc));
    // Pieces lie along the path, as near as what may be left between ends.
    let near = options.between.unwrap_or(0.0).max(10.0 * options.tolerance).max(options.chord);
    let mut count = 0;
    while let Some(piece) = written.ahead(count)? {
        let Some(goal) = goal else { break };
        let Some(tip) = piece.tips.last().filter(|_| piece.sort == Sort::Straight || count == 0) else {
            break;
        };
        if off(leg.sort, goal, tip) <= options.tolerance {
            return Ok(count + 1);
        }
        if beside(path, tip.translation) > near {
            break;
        }
        count += 1;
    }
    Ok(1)
}

/// Whether a written move still belongs to `leg`: it ends where that does, and not where the next one does.
fn stays(leg: &Leg, next: Option<&Leg>, piece: Option<&Leg>, options: &VerifyOptions) -> bool {
    let Some(tip) = piece.filter(|piece| piece.sort == Sort::Straight).and_then(|piece| piece.tips.last())
    else {
        return false;
    };
    let ends = |leg: &Leg| {
        leg.sort == Sort::Straight
            && leg.tips.last().is_some_and(|goal| off(leg.sort, goal, tip) <= options.tolerance)
    };
    ends(leg) && !next.is_some_and(ends)
}

/// How far a tip is from its goal, m; of a cycle only across the tool axis.
fn off(sort: Sort, goal: &Pose<f64>, tip: &Pose<f64>) -> f64 {
    let gap = tip.translation - goal.translation;
    let axis = goal.rotation.column(2);
    match sort {
        Sort::Cycle => (gap - axis.times(gap.dot(axis))).norm(),
        _ => gap.norm(),
    }
}

/// Distance from a path, m.
fn beside(path: &[Vec3<f64>], p: Vec3<f64>) -> f64 {
    let to_piece = |a: Vec3<f64>, b: Vec3<f64>| {
        let way = b - a;
        let square = way.dot(way);
        let s = if square > 0.0 { ((p - a).dot(way) / square).clamp(0.0, 1.0) } else { 0.0 };
        (p - a - way.times(s)).norm()
    };
    match path {
        [] => 0.0,
        [only] => (p - *only).norm(),
        _ => path.windows(2).map(|ends| to_piece(ends[0], ends[1])).fold(f64::INFINITY, f64::min),
    }
}

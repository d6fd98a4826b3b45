//! Normal equations, accumulated sample by sample in fixed memory, `docs/model.md` (20).

use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixView, DVector, Matrix6};
use rand::SeedableRng;
use rand::rngs::StdRng;

use super::basis::Basis;
use super::blocks::{Block, Samples};
use super::evaluator::{Evaluator, Moment};
use super::gauge::{EXTRAS, Gauge};
use super::loss::Loss;
use super::noise::Noise;
use super::part::{Part, Piece};
use super::source::{Source, Sources};
use super::stretch::Stretch;
use super::tally::{COUNTS, Tally};
use super::thin::Thin;
use super::unknowns::{Layout, Role, Unknowns};
use crate::chain::deviation_jacobian;
use crate::check::random_command;
use crate::error::{Error, Result};
use crate::error_motion::{Motions, eliminate};
use crate::lie::{Twist, Vec3, Wrench};
use crate::machine::Machine;
use crate::motion::Tracker;
use crate::recording::Chunk;
use crate::sensor::{MOST_READINGS, Sensor};
use crate::units::{ByQuantity, Quantity, Rms};
use crate::variation::Directions;

/// Root mean square over the samples of some sources.
pub(crate) fn rms_over(tallies: &[Tally]) -> Rms {
    ByQuantity::of(|quantity| {
        let own: Vec<&Tally> = tallies.iter().filter(|t| t.residuals[quantity].rows > 0).collect();
        let samples: u64 = own.iter().map(|t| t.samples).sum();
        let squares: f64 = own.iter().map(|t| t.residuals[quantity].squares).sum();
        (samples > 0).then(|| (squares / samples as f64).sqrt())
    })
}

/// Gauss-Newton matrix, gradient and loss of all data at one state, in m and rad; no prior in it.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    pub matrix: DMatrix<f64>,
    /// `Hᵀ W r`: points downhill.
    pub gradient: DVector<f64>,
    pub loss: f64,
    pub tallies: Vec<Tally>,
    /// Best values of the error motions, which are eliminated from the rest, and the number of parameters that they have used up.
    pub motions: Vec<f64>,
    pub used_by_motions: f64,
    /// Matrix and gradient before that, with the error motions at zero; none where no room is left for them.
    pub whole: Option<(DMatrix<f64>, DVector<f64>)>,
}

impl Normal {
    fn zero(layout: &Layout, motions: &Motions, sources: usize) -> Self {
        let len = layout.len + motions.len();
        Normal {
            matrix: DMatrix::zeros(len, len),
            gradient: DVector::zeros(len),
            loss: 0.0,
            tallies: vec![Tally::default(); sources],
            motions: Vec::new(),
            used_by_motions: 0.0,
            whole: None,
        }
    }

    /// With every weight times `factor`, and no room for error motions.
    pub fn times(&self, factor: f64) -> Normal {
        Normal {
            matrix: &self.matrix * factor,
            gradient: &self.gradient * factor,
            loss: self.loss * factor,
            ..self.clone()
        }
    }
}

/// Squared standardised residual per reading of a sample.
pub(crate) fn standardised(residuals: &[f64], sigmas: &[f64]) -> f64 {
    let sum: f64 = residuals.iter().zip(sigmas).map(|(r, s)| (r / s) * (r / s)).sum();
    sum / residuals.len() as f64
}

/// Standard deviations of a source's readings, in order.
pub(crate) fn sigmas(source: &Source, machine: &Machine, noise: Noise) -> Vec<f64> {
    (0..source.sensor.reading_count()).map(|i| noise[source.quantity(machine, i)]).collect()
}

/// One pass over all data.
pub(crate) fn accumulate(
    machine: &Machine,
    sources: &Sources,
    layout: &Layout,
    unknowns: &Unknowns,
    noise: &[Noise],
    loss: Loss,
    motions: &Motions,
) -> Result<Normal> {
    let mut values = unknowns.motions.clone();
    values.resize(motions.len(), 0.0);
    let room = Room { motions, values: &values };
    let evaluators: Vec<_> = sources.all.iter().map(|s| Evaluator::new(machine, unknowns, s)).collect();
    let lanes: Vec<_> = (evaluators.iter().zip(&sources.all))
        .map(|(evaluator, source)| on_lanes(evaluator, layout, source, unknowns, motions))
        .collect();
    let sums = match &sources.replay {
        Some(replay) => {
            let noise = noise.iter().map(|n| [n.m, n.rad]).collect();
            let sums = replay.sums(unknowns.state(), noise, loss)?;
            let sums: Vec<Option<Part>> = sums.into_iter().map(|form| form.map(Part::from)).collect();
            let fits = (sums.iter().zip(&evaluators).zip(&lanes)).all(|((sum, evaluator), lanes)| {
                let width = |at: usize| match lanes {
                    Some(gauges) => gauges.get(at).map(|(_, basis)| basis.features.len()),
                    None => (at < evaluator.piece_count()).then(|| evaluator.width()),
                };
                let pieces = sum.iter().flat_map(|sum| &sum.pieces).enumerate();
                let mut found = pieces.filter_map(|(at, piece)| Some((at, piece.as_ref()?)));
                found.all(|(at, piece)| Some(piece.gradient.len()) == width(at))
            });
            if !fits {
                return Err(Error::Undetermined {
                    what: "the sums of a part are not over the unknowns of this machine".into(),
                    mend: "make the parts anew, with the same kincal for all".into(),
                });
            }
            sums
        }
        None => sums(machine, sources, &evaluators, &lanes, noise, loss, room)?,
    };
    let mut normal = Normal::zero(layout, motions, sources.all.len());
    for (index, sum) in sums.into_iter().enumerate() {
        let Some(mut sum) = sum else { continue };
        for (piece, (_, basis)) in sum.pieces.iter_mut().zip(lanes[index].iter().flatten()) {
            if let Some(piece) = piece {
                (piece.matrix, piece.gradient) = basis.widened(&piece.matrix, &piece.gradient);
            }
        }
        normal.take(sum, index, &evaluators[index], layout, &sources.all[index], unknowns);
    }
    if motions.len() > 0 {
        let rest = eliminate(&normal.matrix, &normal.gradient, &values);
        normal.loss -= rest.gain;
        normal.used_by_motions = rest.used();
        let matrix = std::mem::replace(&mut normal.matrix, rest.matrix);
        let gradient = std::mem::replace(&mut normal.gradient, rest.gradient);
        let seen_from_zero =
            gradient + matrix.columns(layout.len, values.len()) * DVector::from_column_slice(&values);
        normal.whole = Some((matrix, seen_from_zero));
        normal.motions = rest.values;
    }
    Ok(normal)
}

/// What the samples of each recording add up to, over the features of their bases.
fn sums(
    machine: &Machine,
    sources: &Sources,
    evaluators: &[Evaluator],
    lanes: &[Option<Vec<(Gauge, Basis)>>],
    noise: &[Noise],
    loss: Loss,
    room: Room,
) -> Result<Vec<Option<Part>>> {
    let mut sums: Vec<Option<Part>> = sources.all.iter().map(|_| None).collect();
    sources.pass(
        |index, stretch| {
            let sigmas = sigmas(&sources.all[index], machine, noise[index]);
            match &lanes[index] {
                Some(gauges) => part_on_lanes(&evaluators[index], gauges, stretch, &sigmas, loss),
                None => part(&evaluators[index], &sources.all[index], stretch, &sigmas, loss, room),
            }
        },
        |index, part| match &mut sums[index] {
            None => sums[index] = Some(part),
            Some(sum) => sum.add(part),
        },
    )?;
    Ok(sums)
}

/// What [`accumulate`] takes from the samples of each recording, with constant deviations and no room for error motions.
pub(crate) fn sums_at(
    machine: &Machine,
    sources: &Sources,
    layout: &Layout,
    unknowns: &Unknowns,
    noise: &[Noise],
    loss: Loss,
) -> Result<Vec<Option<Part>>> {
    let motions = Motions::default();
    let evaluators: Vec<_> = sources.all.iter().map(|s| Evaluator::new(machine, unknowns, s)).collect();
    let lanes: Vec<_> = (evaluators.iter().zip(&sources.all))
        .map(|(evaluator, source)| on_lanes(evaluator, layout, source, unknowns, &motions))
        .collect();
    sums(machine, sources, &evaluators, &lanes, noise, loss, Room { motions: &motions, values: &[] })
}

/// Error motions with their present values.
#[derive(Clone, Copy)]
pub(crate) struct Room<'a> {
    pub motions: &'a Motions,
    pub values: &'a [f64],
}

/// Recordings with fewer samples take longer to find a basis than it spares them; a matter of time alone.
const WORTH_A_BASIS: u64 = 1000;

/// The way over lanes, with the features that sums are taken over, by piece; none where samples have to be taken one by one.
fn on_lanes<'a>(
    evaluator: &'a Evaluator,
    layout: &Layout,
    source: &Source,
    unknowns: &Unknowns,
    motions: &Motions,
) -> Option<Vec<(Gauge<'a>, Basis)>> {
    if motions.len() > 0 {
        return None;
    }
    let directions = unknowns.varying.directions.as_ref();
    let with_basis = |(piece, gauge): (usize, Gauge<'a>)| {
        let factors = factors(directions, piece);
        let places = places(evaluator, layout, source, &factors, gauge.width());
        let counts: Vec<bool> = places.iter().map(|place| !place.is_empty()).collect();
        let basis = match source.summary.samples < WORTH_A_BASIS {
            true => Basis::plain(&gauge, &counts),
            false => Basis::of(&gauge, evaluator.machine, &counts),
        };
        (gauge, basis)
    };
    Some(evaluator.gauges()?.into_iter().enumerate().map(with_basis).collect())
}

/// What a piece weighs in each set of direction parts.
fn factors(directions: Option<&Directions>, piece: usize) -> Vec<f64> {
    directions.map_or(Vec::new(), |d| (0..d.sets().len()).map(|set| d.factor(set, piece)).collect())
}

/// As [`part`], over the features of the bases alone.
fn part_on_lanes(
    evaluator: &Evaluator,
    gauges: &[(Gauge, Basis)],
    stretch: &Stretch,
    sigmas: &[f64],
    loss: Loss,
) -> Part {
    let mut part = Part { pieces: Vec::new(), loss: 0.0, tally: Tally::default() };
    for (members, (gauge, basis)) in evaluator.members(stretch).iter().zip(gauges) {
        let (samples, features) = (Samples { gauge, stretch, members }, &basis.features[..]);
        let sum = (!members.is_empty()).then(|| Block { samples, sigmas, loss, features }.sum());
        if let Some(sum) = &sum {
            part.loss += sum.loss;
            part.tally.add(&sum.tally);
        }
        part.pieces.push(sum.map(|sum| Piece { matrix: sum.matrix, gradient: sum.gradient }));
    }
    part
}

fn part(
    evaluator: &Evaluator,
    source: &Source,
    stretch: &Stretch,
    sigmas: &[f64],
    loss: Loss,
    room: Room,
) -> Part {
    let (count, own_width) = (source.sensor.reading_count(), evaluator.width());
    let width = own_width + room.motions.len();
    let chunk = &stretch.chunk;
    let values = source.recording.value_count();
    let members = evaluator.members(stretch);
    let mut work = evaluator.workspace();
    let mut plain = vec![0.0; count * own_width];
    let mut total = 0.0;
    let mut tally = Tally { samples: chunk.len as u64, ..Tally::default() };
    let quantities: Vec<Quantity> = (0..count).map(|i| source.quantity(evaluator.machine, i)).collect();
    let most = (BLOCK / (width * count)).max(1);
    let mut rows = DMatrix::<f64>::zeros(width, most * count);
    let mut whitened = DVector::<f64>::zeros(most * count);
    let mut block = |members: &[usize], piece: &mut Piece| {
        for (slot, k) in members.iter().enumerate() {
            let q = stretch.q(*k);
            let measured = &chunk.values[k * values..(k + 1) * values];
            let own = &mut rows.as_mut_slice()[slot * count * width..(slot + 1) * count * width];
            let raw = evaluator.residuals(q, measured, Moment::At(stretch, *k), &mut work, Some(&mut plain));
            let mut left = raw;
            for (i, plain) in plain.chunks_exact(own_width).enumerate() {
                let (row, columns) = own[i * width..(i + 1) * width].split_at_mut(own_width);
                row.copy_from_slice(plain);
                room.motions.columns(evaluator.machine, q, stretch.directions(*k), row, columns);
                left[i] -= columns.iter().zip(room.values).map(|(x, y)| x * y).sum::<f64>();
            }
            let residuals = &left[..count];
            let (rho, weight) = loss.at(standardised(residuals, sigmas));
            total += count as f64 * rho;
            tally.down_weighted += u64::from(weight < 0.5);
            for (i, (residual, sigma)) in residuals.iter().zip(sigmas).enumerate() {
                let factor = weight.sqrt() / sigma;
                whitened[slot * count + i] = residual * factor;
                own[i * width..(i + 1) * width].iter_mut().for_each(|x| *x *= factor);
                let sums = &mut tally.residuals[quantities[i]];
                sums.rows += 1;
                sums.squares += raw[i] * raw[i];
                // The noise is that of the samples that the model claims to describe.
                if weight > COUNTS {
                    sums.inliers += 1;
                    sums.inlier_squares += residual * residual;
                }
            }
        }
        let rows = rows.columns(0, members.len() * count);
        add_square(&rows, &mut piece.matrix);
        piece.gradient.gemv(1.0, &rows, &whitened.rows(0, members.len() * count), 1.0);
    };
    let mut piece = |members: &[usize]| {
        let mut piece = Piece { matrix: DMatrix::zeros(width, width), gradient: DVector::zeros(width) };
        members.chunks(most).for_each(|members| block(members, &mut piece));
        piece.matrix.fill_upper_triangle_with_lower_triangle();
        piece
    };
    let pieces = members.iter().map(|members| (!members.is_empty()).then(|| piece(members))).collect();
    Part { pieces, loss: total, tally }
}

/// Numbers of rows that are multiplied at a time: they stay in a core's cache.
const BLOCK: usize = 1 << 16;
/// So many rows of a square are computed at a time, up to the diagonal and a little beyond.
const STRIP: usize = 64;

/// Adds `R Rᵀ` on and below the diagonal.
fn add_square(rows: &DMatrixView<f64>, to: &mut DMatrix<f64>) {
    let transposed = rows.transpose();
    for from in (0..rows.nrows()).step_by(STRIP) {
        let (strip, to_diagonal) = (STRIP.min(rows.nrows() - from), (from + STRIP).min(rows.nrows()));
        let mut part = to.view_mut((from, 0), (strip, to_diagonal));
        part.gemm(1.0, &rows.rows(from, strip), &transposed.columns(0, to_diagonal), 1.0);
    }
}

/// From increments behind `exp(dh)` to the deviations' own coordinates, `docs/model.md` (12).
fn turn_into_coordinates(piece: &mut Piece, evaluator: &Evaluator, deviations: &[Twist<f64>]) {
    for (j, dh) in deviations.iter().enumerate().filter(|(j, _)| !evaluator.is_turned(*j)) {
        let block = deviation_jacobian(*dh);
        let turn = Matrix6::from_fn(|a, b| block[a][b]);
        let columns = piece.matrix.fixed_columns::<6>(6 * j) * turn;
        piece.matrix.fixed_columns_mut::<6>(6 * j).copy_from(&columns);
        let rows = turn.transpose() * piece.matrix.fixed_rows::<6>(6 * j);
        piece.matrix.fixed_rows_mut::<6>(6 * j).copy_from(&rows);
        let own = turn.transpose() * piece.gradient.fixed_rows::<6>(6 * j);
        piece.gradient.fixed_rows_mut::<6>(6 * j).copy_from(&own);
    }
}

impl Normal {
    /// Adds a source's local sums.
    fn take(
        &mut self,
        sum: Part,
        index: usize,
        evaluator: &Evaluator,
        layout: &Layout,
        source: &Source,
        unknowns: &Unknowns,
    ) {
        let directions = unknowns.varying.directions.as_ref();
        for (at, piece) in sum.pieces.into_iter().enumerate() {
            let Some(mut piece) = piece else { continue };
            if source.sees_frames() {
                turn_into_coordinates(&mut piece, evaluator, evaluator.deviations(at));
            }
            self.scatter(&piece, evaluator, layout, source, &factors(directions, at));
        }
        self.loss += sum.loss;
        self.tallies[index] = sum.tally;
    }

    /// Adds local sums where their unknowns stand in the parameter vector.
    fn scatter(
        &mut self,
        sum: &Piece,
        evaluator: &Evaluator,
        layout: &Layout,
        source: &Source,
        factors: &[f64],
    ) {
        let places = places(evaluator, layout, source, factors, sum.gradient.len());
        for (a, to) in places.iter().enumerate() {
            for (to_a, factor_a) in to {
                self.gradient[*to_a] += factor_a * sum.gradient[a];
                for (b, to) in places.iter().enumerate() {
                    for (to_b, factor_b) in to {
                        self.matrix[(*to_a, *to_b)] += factor_a * factor_b * sum.matrix[(a, b)];
                    }
                }
            }
        }
    }
}

/// Where each column of a row counts in the parameter vector, and with what factor: one of a dyad for its constant deviation and, times
/// the set's factor, for each of its direction parts.
fn places(
    evaluator: &Evaluator,
    layout: &Layout,
    source: &Source,
    factors: &[f64],
    width: usize,
) -> Vec<Vec<(usize, f64)>> {
    let machine = evaluator.machine;
    let dyads = machine.dyads().len();
    let mut places: Vec<Vec<(usize, f64)>> = vec![Vec::new(); width];
    let mut put = |local: usize, len: usize, role: Role, factor: f64| {
        if let Some(block) = layout.block(role).filter(|_| factor != 0.0) {
            (0..len).for_each(|k| places[local + k].push((block.offset + k, factor)));
        }
    };
    for j in 0..dyads {
        let role = if j == machine.w_index() { Role::Setup(source.setup) } else { Role::Dyad(j) };
        put(6 * j, 6, role, 1.0);
        for (set, factor) in factors.iter().enumerate() {
            put(6 * j, 6, Role::Part { set, dyad: j }, *factor);
        }
    }
    if let Some(i) = source.tool_point.unknown() {
        put(6 * dyads, 3, Role::ToolPoint(i), 1.0);
    }
    if let Some(i) = source.zero.unknown() {
        put(6 * dyads + 3, 1, Role::Zero(i), 1.0);
    }
    if let Some(i) = source.length.unknown() {
        put(6 * dyads + 4, 1, Role::Length(i), 1.0);
    }
    if let Some(i) = source.tool_rotation.unknown() {
        put(6 * dyads + 5, 3, Role::ToolRotation(i), 1.0);
    }
    for local in 6 * dyads + EXTRAS..evaluator.width() {
        put(local, 1, Role::Term(local - 6 * dyads - EXTRAS), 1.0);
    }
    for (i, place) in places[evaluator.width()..].iter_mut().enumerate() {
        place.push((layout.len + i, 1.0));
    }
    places
}

/// A point in space from a slice.
pub(crate) fn point(values: &[f64]) -> Vec3<f64> {
    Vec3([values[0], values[1], values[2]])
}

/// What thin samples tell of the set-ups: as the data's matrix, but with frame `w` seen through the measured points. Seen through
/// the modelled ones, which lie off by every error of the machine, two socket points would seem to show the turn about their line.
pub(crate) fn set_up_geometry(
    machine: &Machine,
    sources: &Sources,
    layout: &Layout,
    unknowns: &Unknowns,
    noise: &[Noise],
    thin: &[Thin],
) -> DMatrix<f64> {
    let w = 6 * machine.w_index();
    let mut normal = Normal::zero(layout, &Motions::default(), sources.all.len());
    for (index, source) in sources.all.iter().enumerate() {
        let evaluator = Evaluator::new(machine, unknowns, source);
        let width = evaluator.width();
        let mut rows = vec![0.0; MOST_READINGS * width];
        let mut work = evaluator.workspace();
        let sigmas = sigmas(source, machine, noise[index]);
        let own: Vec<&Thin> = thin.iter().filter(|t| t.source == index).collect();
        let each_stands_for = source.summary.samples as f64 / own.len().max(1) as f64;
        let mut matrix = DMatrix::zeros(width, width);
        for sample in own {
            evaluator.residuals(&sample.q, &sample.values, Moment::Still, &mut work, Some(&mut rows));
            for (i, sigma) in sigmas.iter().enumerate() {
                let row = &mut rows[i * width..(i + 1) * width];
                if i < 3 && matches!(source.sensor, Sensor::Position | Sensor::Pose) {
                    let unit = Vec3(std::array::from_fn(|k| if k == i { 1.0 } else { 0.0 }));
                    let seen = Wrench::at_point(unit, point(&sample.values)).to_array();
                    row[w..w + 6].iter_mut().zip(seen).for_each(|(x, y)| *x = -y);
                }
                let row = nalgebra::DVectorView::from_slice(row, width);
                matrix.ger(each_stands_for / (sigma * sigma), &row, &row, 1.0);
            }
        }
        normal.scatter(&Piece { matrix, gradient: DVector::zeros(width) }, &evaluator, layout, source, &[]);
    }
    normal.matrix
}

/// The data's matrix on general poses of the same instruments: random commands within limits, everything moving both ways.
pub(crate) fn matrix_in_general(
    machine: &Machine,
    sources: &Sources,
    layout: &Layout,
    unknowns: &Unknowns,
) -> DMatrix<f64> {
    let mut rng = StdRng::seed_from_u64(20_260_104);
    let (samples, commands) = (2 * layout.len, machine.commands().len());
    let mut normal = Normal::zero(layout, &Motions::default(), sources.all.len());
    for (index, source) in sources.all.iter().enumerate() {
        let evaluator = Evaluator::new(machine, unknowns, source);
        let chunk = Chunk {
            len: samples,
            commands: (0..samples * commands)
                .map(|i| random_command(machine, i % commands, &mut rng))
                .collect(),
            values: vec![0.0; samples * source.recording.value_count()],
            ..Chunk::default()
        };
        let motion = Tracker::new(vec![0.0; commands], vec![1; commands]).follow(&chunk);
        // What terms see in general is not asked.
        let features = unknowns.varying.features().map(|_| vec![0.0; samples]).collect();
        let stretch = Stretch { chunk: Arc::new(chunk), motion, features, commands };
        let sigmas = vec![1.0; source.sensor.reading_count()];
        let none = Room { motions: &Motions::default(), values: &[] };
        let part = part(&evaluator, source, &stretch, &sigmas, Loss::Squares, none);
        normal.take(part, index, &evaluator, layout, source, unknowns);
    }
    normal.matrix
}

#[cfg(test)]
mod tests;

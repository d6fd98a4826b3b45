//! Where the set-ups stand, from nothing: closed-form starts for unknown frames, tool points, turns of targets and lengths, `docs/model.md` (25), (26).
//!
//! Nothing here uses the nominal frame `w` of the machine file, so a start that is wrong by half a turn cannot mislead it; only
//! what the data leave open (two socket points leave the turn about their line) is taken from there.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVD, Vector3};

use super::normal::point;
use super::source::{Known, Sources};
use super::thin::Thin;
use super::unknowns::Unknowns;
use crate::lie::{Mat3, Pose, Twist, Vec3};
use crate::machine::Machine;
use crate::sensor::Sensor;

/// Below this ratio of singular values a cloud of points is taken for a line, or a line for a point.
const DEGENERATE: f64 = 1e-6;
/// Rounds of turning, moving and shifting the tool points; the exact fit that follows needs a rough start only.
const ROUNDS: usize = 30;
/// Rounds of concentrating on the samples that fit best.
const ATTEMPTS: usize = 12;

/// A sample as the alignment sees it.
struct Sight {
    source: usize,
    /// Pose of `t` in the frame that carries `w`.
    m_from_t: Pose<f64>,
    values: Vec<f64>,
}

/// Fills in starts for whatever the recordings declare unknown.
pub(crate) fn align(machine: &Machine, sources: &Sources, thin: &[Thin], unknowns: &mut Unknowns) {
    for setup in 0..sources.setups.len() {
        let sights = sights(machine, sources, thin, unknowns, setup);
        if sights.is_empty() {
            continue;
        }
        if unknowns.setups[setup].unknown {
            align_setup(sources, setup, sights, unknowns);
        } else {
            let m_from_w = unknowns.setups[setup].pose();
            let everything: Vec<&Sight> = sights.iter().collect();
            shift_tool_points(sources, &everything, m_from_w, unknowns);
            shift_tool_rotations(sources, &everything, m_from_w, unknowns);
        }
    }
    start_lengths(machine, sources, thin, unknowns);
}

fn sights(
    machine: &Machine,
    sources: &Sources,
    thin: &[Thin],
    unknowns: &Unknowns,
    setup: usize,
) -> Vec<Sight> {
    let chain = unknowns.chain(machine, setup);
    let back = unknowns.setups[setup].pose().inverse();
    let seen = thin.iter().filter(|t| {
        let source = &sources.all[t.source];
        source.setup == setup && source.sees_frames()
    });
    seen.map(|t| {
        let sweep = chain.sweep(&t.q);
        let b_from_m = sweep.b_from_w() * back;
        Sight { source: t.source, m_from_t: b_from_m.inverse() * sweep.b_from_t(), values: t.values.clone() }
    })
    .collect()
}

/// Alignment of one set-up whose frame is unknown. Where it is unknown how a target is turned, the frame is found twice: from the measured
/// turns and from the measured points alone. Neither sees it in every recording; the start that leaves less is taken.
fn align_setup(sources: &Sources, setup: usize, sights: Vec<Sight>, unknowns: &mut Unknowns) {
    let nominal = unknowns.setups[setup].previous_from_w;
    let is_turned = |s: &Sight| sources.all[s.source].tool_rotation.unknown().is_some();
    let ways: &[bool] = if sights.iter().any(is_turned) { &[true, false] } else { &[true] };
    let start = unknowns.clone();
    let mut best = f64::INFINITY;
    for by_turns in ways {
        let mut own = start.clone();
        let m_from_w = align_one_way(sources, nominal, &sights, *by_turns, &mut own);
        let left = if ways.len() > 1 { left(sources, &sights, m_from_w, &own) } else { 0.0 };
        if left < best {
            best = left;
            *unknowns = own;
            unknowns.setups[setup].previous_from_w = m_from_w;
        }
    }
}

/// Medians of what points are off by, over their spread, and of what turns are off by, rad.
fn left(sources: &Sources, sights: &[Sight], m_from_w: Pose<f64>, unknowns: &Unknowns) -> f64 {
    let median = |mut sizes: Vec<f64>| {
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)
    };
    let origin = sights[0].m_from_t.translation;
    let spread = median(sights.iter().map(|s| (s.m_from_t.translation - origin).norm()).collect());
    let points = median(sights.iter().filter_map(|s| miss(sources, s, m_from_w, unknowns)).collect());
    let turns = sights.iter().filter(|s| sources.all[s.source].sensor == Sensor::Pose).map(|s| {
        let state = unknowns.values.sensor_state(&sources.all[s.source]);
        let seen = m_from_w.rotation * measured_rotation(s);
        let rotation = seen.transpose() * (s.m_from_t.rotation * state.tool_rotation_t);
        Pose { rotation, translation: Vec3([0.0; 3]) }.rotation_vector().norm()
    });
    points / spread.max(f64::MIN_POSITIVE) + median(turns.collect())
}

/// Alignment from measured turns, or only from those of targets of which it is known how they are turned.
fn align_one_way(
    sources: &Sources,
    nominal: Pose<f64>,
    sights: &[Sight],
    by_turns: bool,
    unknowns: &mut Unknowns,
) -> Pose<f64> {
    let mut kept: Vec<&Sight> = sights.iter().collect();
    let mut m_from_w = nominal;
    for _ in 0..ATTEMPTS {
        start_tool_points(sources, &kept, unknowns);
        if by_turns {
            start_tool_rotations(sources, &kept, unknowns);
        }
        for _ in 0..ROUNDS {
            let next = best_frame(sources, &kept, nominal, by_turns, unknowns);
            let moved = (next.inverse() * m_from_w).log();
            m_from_w = next;
            let shifted = shift_tool_points(sources, &kept, m_from_w, unknowns);
            let turned = shift_tool_rotations(sources, &kept, m_from_w, unknowns);
            if !(shifted || turned) || moved.v.norm() + moved.w.norm() < 1e-7 {
                break;
            }
        }
        // Concentrate on the three quarters that fit best: gross outliers lose their pull, clean data lose nothing by it.
        let mut misses: Vec<(f64, &Sight)> =
            sights.iter().filter_map(|s| Some((miss(sources, s, m_from_w, unknowns)?, s))).collect();
        misses.sort_by(|a, b| a.0.total_cmp(&b.0));
        misses.truncate((3 * misses.len()).div_ceil(4));
        let others = sights.iter().filter(|s| miss(sources, s, m_from_w, unknowns).is_none());
        let next: Vec<&Sight> = misses.into_iter().map(|(_, s)| s).chain(others).collect();
        let same = next.len() == kept.len() && next.iter().zip(&kept).all(|(a, b)| std::ptr::eq(*a, *b));
        kept = next;
        if same {
            break;
        }
    }
    m_from_w
}

fn measured_rotation(sight: &Sight) -> Mat3<f64> {
    Pose::exp(Twist::new(Vec3([0.0; 3]), point(&sight.values[3..]))).rotation
}

/// How the targets are turned in `t`: `R_mw W = R_mt X` for every measured turn `W`, with `R_mw` and `X` unknown. `Σ tr((R_mw W)ᵀ R_mt X)` is
/// bilinear in both, so that the largest singular vectors of its matrix are their best values; only `X` is kept.
fn start_tool_rotations(sources: &Sources, sights: &[&Sight], unknowns: &mut Unknowns) {
    for index in 0..unknowns.values.tool_rotations.len() {
        let mut matrix = SMatrix::<f64, 9, 9>::zeros();
        for sight in sights.iter().filter(|s| sources.all[s.source].tool_rotation.unknown() == Some(index)) {
            let (measured, modelled) = (measured_rotation(sight), sight.m_from_t.rotation);
            for (row, column) in (0..81).map(|i| (i / 9, i % 9)) {
                let (a, b, d, c) = (row / 3, row % 3, column / 3, column % 3);
                matrix[(row, column)] += measured.0[b][c] * modelled.0[a][d];
            }
        }
        let svd = SVD::new(matrix, false, true);
        let Some(v_t) = svd.v_t.filter(|_| matrix.amax() > 0.0) else { continue };
        let largest = svd.singular_values.imax();
        let found = Matrix3::from_fn(|i, j| v_t[(largest, 3 * i + j)]);
        let found = if found.determinant() < 0.0 { -found } else { found };
        unknowns.values.tool_rotations[index] = best_rotation(found, Mat3::identity(0.0));
    }
}

/// Least-squares turn of every target for a given frame; whether there was one.
fn shift_tool_rotations(
    sources: &Sources,
    sights: &[&Sight],
    m_from_w: Pose<f64>,
    unknowns: &mut Unknowns,
) -> bool {
    let mut any = false;
    for index in 0..unknowns.values.tool_rotations.len() {
        let mut turns = Matrix3::zeros();
        for sight in sights.iter().filter(|s| sources.all[s.source].tool_rotation.unknown() == Some(index)) {
            let seen = m_from_w.rotation * measured_rotation(sight);
            turns += matrix3(sight.m_from_t.rotation.transpose() * seen);
            any = true;
        }
        if turns != Matrix3::zeros() {
            let present = unknowns.values.tool_rotations[index];
            unknowns.values.tool_rotations[index] = best_rotation(turns, present);
        }
    }
    any
}

/// How far a sight with a position lies off, m.
fn miss(sources: &Sources, sight: &Sight, m_from_w: Pose<f64>, unknowns: &Unknowns) -> Option<f64> {
    let source = &sources.all[sight.source];
    let p_m = sight.m_from_t.transform(unknowns.values.sensor_state(source).tool_point_t);
    match source.sensor {
        Sensor::Position | Sensor::Pose => Some((m_from_w.transform(point(&sight.values)) - p_m).norm()),
        _ => None,
    }
}

/// (25): `A z + b - R p_t = o`, linear in `A`, `b` and every unknown tool point; of its solution only the tool points are kept.
fn start_tool_points(sources: &Sources, sights: &[&Sight], unknowns: &mut Unknowns) {
    let unknown_point = |s: &Sight| sources.all[s.source].tool_point.unknown();
    let with_position: Vec<&&Sight> = sights
        .iter()
        .filter(|s| matches!(sources.all[s.source].sensor, Sensor::Position | Sensor::Pose))
        .collect();
    let mut points: Vec<usize> = with_position.iter().filter_map(|s| unknown_point(s)).collect();
    points.sort_unstable();
    points.dedup();
    if points.is_empty() {
        return;
    }
    let columns = 12 + 3 * points.len();
    let mut matrix = DMatrix::zeros(3 * with_position.len(), columns);
    let mut right = DVector::zeros(3 * with_position.len());
    for (k, sight) in with_position.iter().enumerate() {
        let (z, turn) = (point(&sight.values), sight.m_from_t.rotation);
        let known = match sources.all[sight.source].tool_point {
            Known::Value(p_t) => turn * p_t,
            Known::Unknown(_) => Vec3([0.0; 3]),
        };
        for i in 0..3 {
            let row = 3 * k + i;
            for j in 0..3 {
                matrix[(row, 3 * i + j)] = z.0[j];
            }
            matrix[(row, 9 + i)] = 1.0;
            if let Some(index) = unknown_point(sight) {
                let at = 12 + 3 * points.iter().position(|p| *p == index).unwrap_or(0);
                for j in 0..3 {
                    matrix[(row, at + j)] = -turn.0[i][j];
                }
            }
            right[row] = sight.m_from_t.translation.0[i] + known.0[i];
        }
    }
    let Some(solution) = least_squares(matrix, &right) else { return };
    for (n, index) in points.iter().enumerate() {
        unknowns.values.tool_points[*index] = point(&solution.as_slice()[12 + 3 * n..]);
    }
}

/// Least-squares shift of every unknown tool point for a given frame; whether there was one.
fn shift_tool_points(
    sources: &Sources,
    sights: &[&Sight],
    m_from_w: Pose<f64>,
    unknowns: &mut Unknowns,
) -> bool {
    let mut any = false;
    for index in 0..unknowns.values.tool_points.len() {
        let own = sights.iter().filter(|s| {
            let source = &sources.all[s.source];
            source.tool_point.unknown() == Some(index)
                && matches!(source.sensor, Sensor::Position | Sensor::Pose)
        });
        let (mut sum, mut count) = (Vec3([0.0; 3]), 0.0);
        for sight in own {
            sum = sum + sight.m_from_t.inverse().transform(m_from_w.transform(point(&sight.values)));
            count += 1.0;
        }
        if count > 0.0 {
            unknowns.values.tool_points[index] = sum.times(1.0 / count);
            any = true;
        }
    }
    any
}

/// The frame that brings measured and modelled points, and measured and modelled directions, together.
fn best_frame(
    sources: &Sources,
    sights: &[&Sight],
    nominal: Pose<f64>,
    by_turns: bool,
    unknowns: &mut Unknowns,
) -> Pose<f64> {
    // Pairs: a point in `w` and the same point in the frame that carries `w`.
    let mut pairs: Vec<(Vec3<f64>, Vec3<f64>)> = Vec::new();
    let mut directions: Vec<(Vec3<f64>, Vec3<f64>)> = Vec::new();
    let mut turns = Matrix3::zeros();
    for (index, source) in sources.all.iter().enumerate() {
        let own: Vec<&&Sight> = sights.iter().filter(|s| s.source == index).collect();
        if own.is_empty() {
            continue;
        }
        let p_t = unknowns.values.sensor_state(source).tool_point_t;
        let modelled = |s: &Sight| s.m_from_t.transform(p_t);
        match &source.sensor {
            Sensor::Position => pairs.extend(own.iter().map(|s| (point(&s.values), modelled(s)))),
            Sensor::Pose => {
                pairs.extend(own.iter().map(|s| (point(&s.values), modelled(s))));
                let target = unknowns.values.sensor_state(source).tool_rotation_t;
                for sight in own.iter().filter(|_| by_turns || source.tool_rotation.unknown().is_none()) {
                    let turned = sight.m_from_t.rotation * target;
                    turns += matrix3(turned * measured_rotation(sight).transpose());
                }
            }
            Sensor::Distance { absolute } => {
                let known = match (absolute, source.length) {
                    (true, _) => Some(0.0),
                    (false, Known::Value(length)) => Some(length),
                    (false, Known::Unknown(_)) => None,
                };
                if let Some((centre_m, length)) = trilaterate(&own, &modelled, known) {
                    pairs.push((source.recording.header().workpiece_point, centre_m));
                    if let (Known::Unknown(i), Some(length)) = (source.length, length) {
                        unknowns.values.lengths[i] = length;
                    }
                }
            }
            Sensor::Displacement { direction_w } => {
                if let Some(direction_m) = slope(&own, &modelled) {
                    directions.push((*direction_w, direction_m));
                }
            }
            Sensor::Joint { .. } => {}
        }
    }
    let count = pairs.len().max(1) as f64;
    let (sum_w, sum_m) =
        pairs.iter().fold((Vec3([0.0; 3]), Vec3([0.0; 3])), |(w, m), (p_w, p_m)| (w + *p_w, m + *p_m));
    let (mean_w, mean_m) = (sum_w.times(1.0 / count), sum_m.times(1.0 / count));
    let mut covariance = Matrix3::zeros();
    for (p_w, p_m) in &pairs {
        covariance += Vector3::from(*p_m - mean_m) * Vector3::from(*p_w - mean_w).transpose();
    }
    for (d_w, d_m) in &directions {
        covariance += Vector3::from(*d_m) * Vector3::from(*d_w).transpose();
    }
    let rotation = if turns == Matrix3::zeros() {
        best_rotation(covariance, nominal.rotation)
    } else {
        best_rotation(turns, nominal.rotation)
    };
    let translation = if pairs.is_empty() { nominal.translation } else { mean_m - rotation * mean_w };
    Pose { rotation, translation }
}

fn matrix3(m: Mat3<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| m.0[i][j])
}

/// The rotation with the largest `tr(Rᵀ C)`; what `C` leaves open is taken from `nominal`.
fn best_rotation(covariance: Matrix3<f64>, nominal: Mat3<f64>) -> Mat3<f64> {
    let svd = SVD::new(covariance, true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return nominal };
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| svd.singular_values[*b].total_cmp(&svd.singular_values[*a]));
    let [first, second, third] = order;
    let s = svd.singular_values;
    if s[first] < 1e-12 {
        return nominal;
    }
    if s[second] < DEGENERATE * s[first] {
        // One direction only: the smallest turn that takes the nominal image of it there.
        let from = nominal * Vec3::from(Vector3::from(v_t.row(first).transpose()));
        let to = Vec3::from(Vector3::from(u.column(first)));
        return smallest_turn(from, to) * nominal;
    }
    let handed = (u * v_t).determinant().signum();
    let mut signs = Matrix3::identity();
    signs[(third, third)] = handed;
    let r = u * signs * v_t;
    Mat3(std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)])))
}

/// The smallest turn that takes one unit vector to another.
fn smallest_turn(from: Vec3<f64>, to: Vec3<f64>) -> Mat3<f64> {
    let (axis, cosine) = (from.cross(to), from.dot(to));
    let sine = axis.norm();
    if sine < 1e-9 && cosine < 0.0 {
        // Opposite: half a turn about anything square to it.
        let other = if from.0[0].abs() < 0.7 { Vec3([1.0, 0.0, 0.0]) } else { Vec3([0.0, 1.0, 0.0]) };
        let square = from.cross(other);
        return Pose::turn(square.times(1.0 / square.norm()), std::f64::consts::PI).rotation;
    }
    if sine < 1e-12 {
        return Mat3::identity(0.0);
    }
    Pose::turn(axis.times(1.0 / sine), sine.atan2(cosine)).rotation
}

/// (26): centre, and length where it is unknown, from distances to moving points.
fn trilaterate(
    sights: &[&&Sight],
    modelled: &dyn Fn(&Sight) -> Vec3<f64>,
    known_length: Option<f64>,
) -> Option<(Vec3<f64>, Option<f64>)> {
    let columns = if known_length.is_some() { 4 } else { 5 };
    let middle =
        sights.iter().fold(Vec3([0.0; 3]), |sum, s| sum + modelled(s)).times(1.0 / sights.len() as f64);
    let mut matrix = DMatrix::zeros(sights.len(), columns);
    let mut right = DVector::zeros(sights.len());
    for (k, sight) in sights.iter().enumerate() {
        let p = modelled(sight) - middle;
        for i in 0..3 {
            matrix[(k, i)] = -2.0 * p.0[i];
        }
        matrix[(k, 3)] = 1.0;
        let reading = sight.values[0] + known_length.unwrap_or(0.0);
        if known_length.is_none() {
            matrix[(k, 4)] = -2.0 * reading;
        }
        right[k] = reading * reading - p.dot(p);
    }
    let solution = least_squares(matrix, &right)?;
    let centre = middle + point(solution.as_slice());
    Some((centre, known_length.is_none().then(|| solution[4])))
}

/// Direction along which a displacement grows, in the frame that carries `w`.
fn slope(sights: &[&&Sight], modelled: &dyn Fn(&Sight) -> Vec3<f64>) -> Option<Vec3<f64>> {
    let mut matrix = DMatrix::from_element(sights.len(), 4, 1.0);
    let mut right = DVector::zeros(sights.len());
    for (k, sight) in sights.iter().enumerate() {
        let p = modelled(sight);
        (0..3).for_each(|i| matrix[(k, i)] = p.0[i]);
        right[k] = sight.values[0];
    }
    let direction = point(least_squares(matrix, &right)?.as_slice());
    let length = direction.norm();
    (length > 1e-9).then(|| direction.times(1.0 / length))
}

/// Minimum-norm least squares.
fn least_squares(matrix: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    if matrix.nrows() == 0 {
        return None;
    }
    let svd = SVD::new(matrix, true, true);
    let cut = 1e-9 * svd.singular_values.max();
    let solution = svd.solve(right, cut).ok()?;
    solution.iter().all(|x| x.is_finite()).then_some(solution)
}

/// A start for lengths that no trilateration has given: what the nominal distances leave over.
fn start_lengths(machine: &Machine, sources: &Sources, thin: &[Thin], unknowns: &mut Unknowns) {
    for index in 0..unknowns.values.lengths.len() {
        if unknowns.values.lengths[index] != 0.0 {
            continue;
        }
        let (mut sum, mut count) = (0.0, 0.0);
        for sample in thin {
            let source = &sources.all[sample.source];
            if source.length.unknown() != Some(index) {
                continue;
            }
            let state = unknowns.values.sensor_state(source);
            let w_from_t = unknowns.chain(machine, source.setup).w_from_t(&sample.q);
            let distance = (w_from_t.transform(state.tool_point_t) - state.workpiece_point_w).norm();
            sum += distance - sample.values[0];
            count += 1.0;
        }
        if count > 0.0 {
            unknowns.values.lengths[index] = sum / count;
        }
    }
}

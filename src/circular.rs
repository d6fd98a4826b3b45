//! Circular tests: distances along a nominal circle or cone, and their figures after ISO 230-4.
//!
//! A ballbar that turns about one of its balls sweeps a circle, or a cone where it stands inclined, as the workpiece, the base or the tool
//! sees it. The angle is taken from the machine, the radial deviation from the reading. Figures are those of ISO 230-4: radial deviation
//! `F` from the nominal circle as the instrument is centred; circular deviation `G`, circular hysteresis `H` and mean bi-directional radial
//! deviation `D` about the least-squares centre. On a cone they are formed in the same way, along the bar.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use serde::{Deserialize, Serialize};

use crate::calibration::CalibratedMachine;
use crate::error::Result;
use crate::lie::Vec3;
use crate::predict::{chain, sensor_state};
use crate::recording::{Measurement, NominalLength, Recording};
use crate::sensor::Sensor;

/// A direction lies this far (1: the length of the bar) off its circle at most, root mean square.
const FLAT: f64 = 0.01;
/// The bar's nominal length varies by no more than this part.
const EVEN: f64 = 0.01;
/// Across its axis the bar sweeps at least this much, root mean square, along both directions.
const SWEPT: f64 = 0.15;
/// A cone this close to a plane is a circle: cosine of the half apex angle.
const PLANE: f64 = 0.02;
/// Angles over which both senses are compared.
const SECTORS: usize = 360;
/// Neighbours farther apart than this have nothing between them, rad.
const FAR_APART: f64 = 0.1;
/// Of recordings with more samples every so manieth is looked at: what is held in memory does not grow with the file.
const MOST_SAMPLES: u64 = 200_000;
/// A turn by less is no motion, rad.
const STILL: f64 = 1e-9;

/// What carries the frame in which the bar turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SeenFrom {
    /// The workpiece, frame `w`.
    Workpiece,
    /// The base.
    Base,
    /// The tool, frame `t`.
    Tool,
}

/// The figures of one sense of turning.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OneSense {
    /// Samples that were looked at: of more than 200000 of a recording every so manieth.
    pub samples: u64,
    /// Circular deviation `G`: between two circles about the least-squares centre that enclose the path, m.
    pub g_m: f64,
    /// Largest radial deviation `F` from the nominal circle, m; `None` where the nominal length is not known.
    pub f_max_m: Option<f64>,
    /// Smallest, m.
    pub f_min_m: Option<f64>,
}

/// One recording along a circle or a cone.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CircularTest {
    /// File name.
    pub recording: String,
    /// Where the bar turns.
    pub seen_from: SeenFrom,
    /// Direction about which it turns there, a unit vector.
    pub axis: [f64; 3],
    /// Half the apex angle of the cone, rad; a right angle is a circle.
    pub half_apex_rad: f64,
    /// Nominal length of the bar, m.
    pub length_m: f64,
    /// Radial deviation of the least-squares circle, m.
    pub radius_m: f64,
    /// Centre of the least-squares circle across the axis, m.
    pub centre_m: [f64; 2],
    /// Figures counter-clockwise about the axis.
    pub counter_clockwise: Option<OneSense>,
    /// Figures clockwise.
    pub clockwise: Option<OneSense>,
    /// Bi-directional circular deviation `G(b)`, m; where both senses were travelled.
    pub g_both_m: Option<f64>,
    /// Circular hysteresis `H`, m.
    pub h_m: Option<f64>,
    /// Mean bi-directional radial deviation `D`, m.
    pub d_m: Option<f64>,
    /// Angle (rad), sense (-1, 0, 1) and radial deviation (m) of every sample, in their order.
    #[serde(skip)]
    pub path: Vec<Turned>,
}

/// A sample of a circular test.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turned {
    /// About the axis, rad, going on over full turns.
    pub angle: f64,
    /// 1 counter-clockwise, -1 clockwise, 0 before it turns.
    pub sense: i8,
    /// Measured less nominal length, m.
    pub deviation: f64,
}

impl CircularTest {
    /// Whether it is a circle, and no cone.
    pub fn is_circle(&self) -> bool {
        self.half_apex_rad.cos().abs() < PLANE
    }
}

/// Every so manieth of these samples is looked at, the first one too.
pub(crate) fn stride(samples: u64) -> usize {
    usize::try_from(samples.div_ceil(MOST_SAMPLES).max(1)).unwrap_or(usize::MAX)
}

/// The circular tests among recordings; angles are those of this machine.
///
/// # Errors
/// If a recording cannot be read, or its set-up is not in the calibrated file.
pub fn circular_tests(calibrated: &CalibratedMachine, recordings: &[Recording]) -> Result<Vec<CircularTest>> {
    let mut tests = Vec::new();
    for recording in recordings {
        tests.extend(circular_test(calibrated, recording)?);
    }
    Ok(tests)
}

fn circular_test(calibrated: &CalibratedMachine, recording: &Recording) -> Result<Option<CircularTest>> {
    let header = recording.header();
    let Measurement::Distance { absolute } = header.measurement else { return Ok(None) };
    let sensor = Sensor::of(header);
    let (chain, state) = (chain(calibrated, header, &sensor)?, sensor_state(calibrated, header, &sensor)?);
    let is_known = matches!(header.nominal_length, NominalLength::Known(_));
    let commands = calibrated.machine().commands().len();
    let (every, mut sample) = (stride(recording.scan()?.samples), 0);
    let mut bars: [Vec<Vec3<f64>>; 3] = Default::default();
    let (mut lengths, mut deviations) = (Vec::new(), Vec::new());
    for chunk in recording.chunks()? {
        let chunk = chunk?;
        for (q, value) in chunk.commands.chunks_exact(commands.max(1)).zip(&chunk.values) {
            sample += 1;
            if !(sample - 1usize).is_multiple_of(every) {
                continue;
            }
            let sweep = chain.sweep(q);
            let w_from_t = sweep.w_from_t();
            let bar_w = w_from_t.transform(state.tool_point_t) - state.workpiece_point_w;
            let length = bar_w.norm();
            let u_w = bar_w.times(length.recip());
            let in_base = sweep.b_from_w().rotation * u_w;
            let in_tool = w_from_t.rotation.transpose() * u_w;
            for (of, u) in bars.iter_mut().zip([u_w, in_base, in_tool]) {
                of.push(u);
            }
            lengths.push(length);
            deviations.push(if absolute { value - length } else { *value });
        }
    }
    let count = lengths.len() as f64;
    let mean = lengths.iter().sum::<f64>() / count;
    let is_even = lengths.iter().all(|length| (length - mean).abs() < EVEN * mean);
    if lengths.len() < 8 || !is_even {
        return Ok(None);
    }
    let frames = [SeenFrom::Workpiece, SeenFrom::Base, SeenFrom::Tool];
    let found = frames.into_iter().zip(&bars).find_map(|(frame, bars)| Some((frame, bars, cone(bars)?)));
    let Some((seen_from, bars, (axis, rise))) = found else { return Ok(None) };
    let path = turned(bars, axis, &deviations);
    let length_m = match header.nominal_length {
        NominalLength::Known(length) => length,
        _ => mean,
    };
    let test = CircularTest {
        recording: recording.name().into(),
        seen_from,
        axis: axis.0,
        half_apex_rad: rise.clamp(-1.0, 1.0).acos(),
        length_m,
        radius_m: 0.0,
        centre_m: [0.0; 2],
        counter_clockwise: None,
        clockwise: None,
        g_both_m: None,
        h_m: None,
        d_m: None,
        path,
    };
    Ok(Some(with_figures(test, is_known)))
}

/// Axis of the cone on which directions lie, and the mean cosine between them and it.
fn cone(directions: &[Vec3<f64>]) -> Option<(Vec3<f64>, f64)> {
    let count = directions.len() as f64;
    let of = |v: &Vec3<f64>| Vector3::from(v.0);
    let mean = directions.iter().map(of).sum::<Vector3<f64>>() / count;
    let spread: Matrix3<f64> =
        directions.iter().map(|u| of(u) - mean).map(|u| u * u.transpose()).sum::<Matrix3<f64>>() / count;
    if !spread.iter().all(|x| x.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(spread);
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let rms = order.map(|k| eigen.eigenvalues[k].max(0.0).sqrt());
    if rms[0] > FLAT || rms[1] < SWEPT {
        return None;
    }
    let column = eigen.eigenvectors.column(order[0]);
    let axis = Vec3([column[0], column[1], column[2]]);
    let largest = axis.0.iter().fold(0.0f64, |m, x| if x.abs() > m.abs() { *x } else { m });
    let axis = if largest < 0.0 { -axis } else { axis };
    Some((axis, axis.dot(Vec3(mean.into()))))
}

/// Angles of directions about an axis, and the senses in which they go on.
fn turned(directions: &[Vec3<f64>], axis: Vec3<f64>, deviations: &[f64]) -> Vec<Turned> {
    let [first, second] = axis.across();
    // Right-handed about the axis.
    let (x, y) = if first.cross(second).dot(axis) > 0.0 { (first, second) } else { (second, first) };
    let mut path: Vec<Turned> = Vec::with_capacity(directions.len());
    for (u, deviation) in directions.iter().zip(deviations) {
        let bare = u.dot(y).atan2(u.dot(x));
        let (angle, sense) = match path.last() {
            None => (bare, 0),
            Some(last) => {
                let turn = (bare - last.angle + std::f64::consts::PI).rem_euclid(TAU) - std::f64::consts::PI;
                let sense = if turn.abs() > STILL { turn.signum() as i8 } else { last.sense };
                (last.angle + turn, sense)
            }
        };
        path.push(Turned { angle, sense, deviation: *deviation });
    }
    // Before the first motion it is on its way there already.
    let first = path.iter().find(|t| t.sense != 0).map_or(0, |t| t.sense);
    path.iter_mut().take_while(|t| t.sense == 0).for_each(|t| t.sense = first);
    path
}

/// Least-squares circle `deviation = radius + x cos + y sin`.
fn circle(path: &[Turned]) -> Option<[f64; 3]> {
    let mut matrix = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for turned in path {
        let row = Vector3::new(1.0, turned.angle.cos(), turned.angle.sin());
        matrix += row * row.transpose();
        right += row * turned.deviation;
    }
    let solved = matrix.cholesky()?.solve(&right);
    solved.iter().all(|x| x.is_finite()).then(|| solved.into())
}

fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
}

/// Radial deviation about a centre.
fn about(turned: &Turned, [radius, x, y]: [f64; 3]) -> f64 {
    turned.deviation - radius - x * turned.angle.cos() - y * turned.angle.sin()
}

fn with_figures(mut test: CircularTest, is_known: bool) -> CircularTest {
    let of = |sense: i8| -> Vec<Turned> { test.path.iter().filter(|t| t.sense == sense).copied().collect() };
    let [ccw, cw] = [of(1), of(-1)];
    let one = |path: &[Turned]| -> Option<OneSense> {
        let circle = circle(path)?;
        let (inner, outer) = ends(path.iter().map(|t| about(t, circle)));
        let (least, most) = ends(path.iter().map(|t| t.deviation));
        Some(OneSense {
            samples: path.len() as u64,
            g_m: outer - inner,
            f_max_m: is_known.then_some(most),
            f_min_m: is_known.then_some(least),
        })
    };
    test.counter_clockwise = one(&ccw);
    test.clockwise = one(&cw);
    let Some(all) = circle(&test.path) else { return test };
    (test.radius_m, test.centre_m) = (all[0], [all[1], all[2]]);
    if test.counter_clockwise.is_some() && test.clockwise.is_some() {
        let (inner, outer) = ends(test.path.iter().map(|t| about(t, all)));
        test.g_both_m = Some(outer - inner);
        test.d_m = is_known.then_some(all[0]);
        test.h_m = hysteresis(&ccw, &cw, all);
    }
    test
}

/// Largest difference of the two senses at one angle: of every sample of the one to the other between its neighbours there, means over
/// sectors.
fn hysteresis(ccw: &[Turned], cw: &[Turned], centre: [f64; 3]) -> Option<f64> {
    let place = |t: &Turned| (t.angle.rem_euclid(TAU), about(t, centre));
    let mut other: Vec<(f64, f64)> = cw.iter().map(place).collect();
    other.sort_by(|a, b| a.0.total_cmp(&b.0));
    let first = *other.first()?;
    let last = *other.last()?;
    // Round the circle, so that every angle has a neighbour on either side.
    other.insert(0, (last.0 - TAU, last.1));
    other.push((first.0 + TAU, first.1));
    let mut sums = vec![(0.0, 0u32); SECTORS];
    for (angle, own) in ccw.iter().map(place) {
        let after = other.partition_point(|(a, _)| *a < angle).clamp(1, other.len() - 1);
        let ((from, start), (to, end)) = (other[after - 1], other[after]);
        if to - from > FAR_APART {
            continue;
        }
        let part = if to > from { (angle - from) / (to - from) } else { 0.5 };
        let sector = ((angle / TAU * SECTORS as f64) as usize).min(SECTORS - 1);
        sums[sector] = (sums[sector].0 + own - start - (end - start) * part, sums[sector].1 + 1);
    }
    let gaps = sums.into_iter().filter(|(_, n)| *n > 0).map(|(sum, n)| (sum / f64::from(n)).abs());
    gaps.max_by(f64::total_cmp)
}

//! An instrument on a machine whose deviations are constant: many samples at a time.
//!
//! [`Evaluator`](super::evaluator::Evaluator) takes one sample of anything. Most passes are over constant deviations and lengths, and
//! there the same rows come from walks along a [`Path`] with as many samples at a time as there are lanes, `docs/model.md` (14) to (17).

use nalgebra::DMatrix;

use crate::chain::{Moved, Path, Row};
use crate::lie::{Vec3, Wrench};
use crate::scalar::Scalar;
use crate::sensor::{Sensor, SensorState};

/// Extra columns of a source behind the six of each dyad: tool point, zero, length, tool rotation.
pub(crate) const EXTRAS: usize = 8;

/// Dyads, instrument and what belongs to it, as one pattern of directions has them.
pub(crate) struct Gauge<'a> {
    path: Path,
    sensor: &'a Sensor,
    state: SensorState<f64>,
    dyads: usize,
}

impl<'a> Gauge<'a> {
    /// None where readings are not lengths between points: poses and single joints.
    pub fn new(path: Path, sensor: &'a Sensor, state: SensorState<f64>, dyads: usize) -> Option<Self> {
        let takes_points =
            matches!(sensor, Sensor::Distance { .. } | Sensor::Position | Sensor::Displacement { .. });
        takes_points.then_some(Gauge { path, sensor, state, dyads })
    }

    /// How many joints the way has.
    pub fn joint_count(&self) -> usize {
        self.path.joint_count()
    }

    /// Columns of a row: six of each dyad, and the extras.
    pub fn width(&self) -> usize {
        6 * self.dyads + EXTRAS
    }

    /// Scalar readings of a sample.
    pub fn reading_count(&self) -> usize {
        self.sensor.reading_count()
    }

    /// What belongs to the instrument, for every lane.
    #[inline(always)]
    pub fn state<T: Scalar>(&self, like: T) -> SensorState<T> {
        SensorState {
            tool_point_t: self.state.tool_point_t.lift(like),
            tool_rotation_t: self.state.tool_rotation_t.lift(like),
            workpiece_point_w: self.state.workpiece_point_w.lift(like),
            length: like.lift(self.state.length),
            zero: like.lift(self.state.zero),
        }
    }

    /// Where the tool point is in `w` at the commands `q`, m; `moved` keeps how the joints stand.
    #[inline(always)]
    pub fn go_to<T: Scalar>(&self, q: &[T], state: &SensorState<T>, moved: &mut [Moved<T>]) -> Vec3<T> {
        self.path.go_to(q, moved);
        self.path.point_w(state.tool_point_t, moved)
    }

    /// Value of reading `i`, m, and the unit vector of frame `w` along which it answers to the point.
    #[inline(always)]
    pub fn reading<T: Scalar>(&self, i: usize, p_w: Vec3<T>, state: &SensorState<T>) -> (T, Vec3<T>) {
        self.sensor.of_point(i, p_w, state)
    }

    /// How many features its rows are made of: those of the path, and one that is constant.
    pub fn feature_count(&self) -> usize {
        self.path.feature_count() + 1
    }

    /// Features of the row of a reading that answers along `n_w`, times `factor`.
    #[inline(always)]
    pub fn features<T: Scalar>(
        &self,
        n_w: Vec3<T>,
        p_w: Vec3<T>,
        factor: f64,
        moved: &[Moved<T>],
        to: &mut (impl Row<T> + ?Sized),
    ) {
        let factor = n_w.0[0].lift(factor);
        self.path.features(Wrench::at_point(n_w.times(factor), p_w), moved, to);
        to.take(self.path.feature_count(), [factor]);
    }

    /// What each feature adds to a row, a row of the matrix for each. No length changes with the tool's rotation.
    pub fn rows_by_feature(&self) -> DMatrix<f64> {
        let extras = 6 * self.dyads;
        let mut rows = self.path.rows_by_feature().resize(self.feature_count(), self.width(), 0.0);
        let constant = rows.nrows() - 1;
        rows[(constant, extras + 3)] = if self.sensor.has_zero() { 1.0 } else { 0.0 };
        let is_relative = matches!(self.sensor, Sensor::Distance { absolute: false });
        rows[(constant, extras + 4)] = if is_relative { -1.0 } else { 0.0 };
        rows
    }
}

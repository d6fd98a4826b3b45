//! An instrument on a machine whose deviations are constant: many samples at a time.
//!
//! [`Evaluator`](super::evaluator::Evaluator) takes one sample of anything. Most passes are over constant deviations and lengths, and
//! there the same rows come from walks along a [`Path`] with as many samples at a time as there are lanes, `docs/model.md` (14) to (17).

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

    /// The row of a reading that answers along `n_w`, times `factor`. Six of the extras stand where those of one more dyad would; the
    /// others, of the tool's rotation, are left as they are: no length changes with that.
    #[inline(always)]
    pub fn row<T: Scalar>(
        &self,
        n_w: Vec3<T>,
        p_w: Vec3<T>,
        factor: f64,
        moved: &[Moved<T>],
        row: &mut (impl Row<T> + ?Sized),
    ) {
        let like = n_w.0[0];
        let n_w = n_w.times(like.lift(factor));
        let Vec3([x, y, z]) = self.path.row(Wrench::at_point(n_w, p_w), moved, row).f;
        let is_relative = matches!(self.sensor, Sensor::Distance { absolute: false });
        let zero = like.lift(if self.sensor.has_zero() { factor } else { 0.0 });
        let length = like.lift(if is_relative { -factor } else { 0.0 });
        row.take(self.dyads, [x, y, z, zero, length, like.lift(0.0)]);
    }
}

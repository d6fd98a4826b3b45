//! Instruments with everything that is wrong with them: noise, resolution, drop-outs, outliers.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use super::plant::State;
use crate::lie::{Mat3, Pose, Twist, Vec3};
use crate::machine::{JointKind, Machine};
use crate::sensor::{Sensor, SensorState};
use crate::units::{ByQuantity, Quantity};

/// How readings scatter; the size is [`Instrument::noise`].
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scatter {
    /// Normal, the size being the standard deviation.
    #[default]
    Normal,
    /// Uniform from 0 to the size, as in the paper: its mean is half the size.
    Uniform,
    /// Uniform from minus the size to the size.
    Symmetric,
}

impl Scatter {
    fn draw(self, size: f64, rng: &mut StdRng) -> f64 {
        match self {
            Scatter::Normal => size * normal(rng),
            Scatter::Uniform => size * rng.random_range(0.0..1.0),
            Scatter::Symmetric => size * rng.random_range(-1.0..1.0),
        }
    }
}

/// An instrument with its noise.
#[non_exhaustive]
#[derive(Clone, Debug)]
pub struct Instrument {
    /// Kind.
    pub sensor: Sensor,
    /// Measured points, zero and length.
    pub state: SensorState<f64>,
    /// Size of the noise of a reading.
    pub noise: ByQuantity<f64>,
    /// How the noise is distributed.
    pub scatter: Scatter,
    /// Step of a reading; 0 for none.
    pub resolution: ByQuantity<f64>,
    /// Part of the samples that are lost, 0 to 1.
    pub drop_outs: f64,
    /// Part of the samples that are far off, 0 to 1.
    pub outliers: f64,
    /// By how much an outlier is off: normal with this standard deviation in each reading.
    pub outlier: ByQuantity<f64>,
}

impl Instrument {
    /// Both measured points at their frames' origins, length and zero 0, normal noise.
    pub fn new(sensor: Sensor, noise_m: f64, noise_rad: f64) -> Self {
        let origin = Vec3([0.0; 3]);
        let state = SensorState {
            tool_point_t: origin,
            tool_rotation_t: Mat3::identity(0.0),
            workpiece_point_w: origin,
            length: 0.0,
            zero: 0.0,
        };
        Instrument {
            sensor,
            state,
            noise: ByQuantity { m: noise_m, rad: noise_rad },
            scatter: Scatter::Normal,
            resolution: ByQuantity::default(),
            drop_outs: 0.0,
            outliers: 0.0,
            outlier: ByQuantity::default(),
        }
    }

    /// What reading `i` measures.
    pub fn quantity(&self, machine: &Machine, i: usize) -> Quantity {
        let prismatic = |dyad: usize| {
            machine.dyads()[dyad].joint.as_ref().is_some_and(|joint| joint.kind == JointKind::Prismatic)
        };
        self.sensor.quantity(i, matches!(self.sensor, Sensor::Joint { dyad } if prismatic(dyad)))
    }

    /// What it reads on the plant at its last sample, noise included, in m and rad (a pose: position, rotation vector); `None`
    /// for a drop-out.
    pub fn read(&self, machine: &Machine, state: &State, q: &[f64], rng: &mut StdRng) -> Option<Vec<f64>> {
        // Drawn in any case, so that the noise of the others does not depend on it.
        let dropped = self.drop_outs > 0.0 && rng.random_range(0.0..1.0) < self.drop_outs;
        let off = self.outliers > 0.0 && rng.random_range(0.0..1.0) < self.outliers;
        let mut noise = |quantity: Quantity| {
            let noise = self.scatter.draw(self.noise[quantity], rng);
            if off { noise + self.outlier[quantity] * normal(rng) } else { noise }
        };
        let mut values = match self.sensor {
            Sensor::Joint { dyad } => {
                // (19)
                let own =
                    machine.dyads()[dyad].joint.as_ref().map_or(Twist::zero(0.0), |joint| joint.twist());
                let dh = state.deviations()[dyad] + state.behind()[dyad];
                let read = state.displacements()[dyad] + own.v.dot(dh.v) + own.w.dot(dh.w);
                vec![read + self.state.zero + noise(self.quantity(machine, 0))]
            }
            _ => {
                let sweep = state.chain().sweep(q);
                let (readings, count) = self.sensor.readings(&sweep, &self.state, Mat3::identity(0.0));
                let mut values: Vec<f64> =
                    readings.iter().take(count.min(3)).map(|r| r.value + noise(Quantity::Length)).collect();
                if let Sensor::Pose = self.sensor {
                    let shake = Twist::new(Vec3([0.0; 3]), Vec3([0, 1, 2].map(|_| noise(Quantity::Angle))));
                    values.extend((Pose::exp(shake) * sweep.w_from_t()).rotation_vector().0);
                }
                values
            }
        };
        let kind = self.sensor.name();
        for (i, value) in values.iter_mut().enumerate() {
            *value += state.added(i, kind);
            let step = self.resolution[self.quantity(machine, i)];
            if step > 0.0 {
                *value = (*value / step).round() * step;
            }
        }
        (!dropped).then_some(values)
    }
}

/// The numbers of an instrument's noise, the same for the same seed and other than those of random deviations.
pub fn noise_of(seed: u64, recording: u64) -> StdRng {
    StdRng::seed_from_u64(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(recording).wrapping_add(1))
}

/// A standard normal number (Box and Muller).
pub(super) fn normal(rng: &mut StdRng) -> f64 {
    let u: f64 = rng.random_range(f64::MIN_POSITIVE..1.0);
    let v: f64 = rng.random_range(0.0..std::f64::consts::TAU);
    (-2.0 * u.ln()).sqrt() * v.cos()
}

//! Velocity and acceleration of commands, `docs/effects.md` (41).
//!
//! There is one way of smoothing in this crate: at every sample a parabola over time is fitted to that sample and its two
//! neighbours on either side, whatever their spacing; its slope and curvature are velocity and acceleration. A pause ends the
//! neighbourhood, and at an edge it is one-sided. The weights depend on the times only, so that all joints share them.

/// Neighbours on either side.
pub(crate) const LOOK_AHEAD: usize = 2;

/// Weights by which one sample's velocity and acceleration follow from the positions around it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rates {
    /// Index of the first neighbour.
    from: usize,
    /// How many there are, the sample itself included.
    count: usize,
    velocity: [f64; 2 * LOOK_AHEAD + 1],
    acceleration: [f64; 2 * LOOK_AHEAD + 1],
}

impl Rates {
    /// Weights for sample `k` of these times (s); a step longer than `pause_after` is a pause.
    pub fn at(times: &[f64], k: usize, pause_after: f64) -> Self {
        let (mut from, mut to) = (k, k);
        while from > 0 && k - from < LOOK_AHEAD && times[from] - times[from - 1] <= pause_after {
            from -= 1;
        }
        while to + 1 < times.len() && to - k < LOOK_AHEAD && times[to + 1] - times[to] <= pause_after {
            to += 1;
        }
        let count = to - from + 1;
        let mut rates = Rates { from, count, velocity: [0.0; 5], acceleration: [0.0; 5] };
        // Times in units of the mean step, so that the matrix is well scaled.
        let step = (times[to] - times[from]) / (count.max(2) - 1) as f64;
        if step.is_nan() || step <= 0.0 {
            return rates;
        }
        let u = |i: usize| (times[from + i] - times[k]) / step;
        let moment = |power: i32| (0..count).map(|i| u(i).powi(power)).sum::<f64>();
        let (s0, s1, s2, s3, s4) = (count as f64, moment(1), moment(2), moment(3), moment(4));
        let determinant = s0 * (s2 * s4 - s3 * s3) - s1 * (s1 * s4 - s2 * s3) + s2 * (s1 * s3 - s2 * s2);
        if count >= 3 && determinant > 1e-9 {
            // Rows 1 and 2 of the inverse of [[s0, s1, s2], [s1, s2, s3], [s2, s3, s4]].
            let slope = [s2 * s3 - s1 * s4, s0 * s4 - s2 * s2, s1 * s2 - s0 * s3];
            let bend = [s1 * s3 - s2 * s2, s1 * s2 - s0 * s3, s0 * s2 - s1 * s1];
            let row = |row: [f64; 3], u: f64| (row[0] + row[1] * u + row[2] * u * u) / determinant;
            for i in 0..count {
                rates.velocity[i] = row(slope, u(i)) / step;
                rates.acceleration[i] = 2.0 * row(bend, u(i)) / (step * step);
            }
        } else {
            // Two samples: a straight line, no acceleration.
            let spread = s0 * s2 - s1 * s1;
            for i in 0..count {
                rates.velocity[i] = if spread > 0.0 { (s0 * u(i) - s1) / (spread * step) } else { 0.0 };
            }
        }
        rates
    }

    /// Velocity and acceleration from the positions that belong to the times.
    pub fn of(&self, positions: &[f64]) -> (f64, f64) {
        let around = &positions[self.from..self.from + self.count];
        // Differences from the first keep the rounding of a large position out.
        let sum = |weights: &[f64]| around.iter().zip(weights).map(|(q, w)| (q - around[0]) * w).sum();
        (sum(&self.velocity), sum(&self.acceleration))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_differentiated_exactly_on_uneven_times_and_at_the_edges() {
        let times = [0.0, 0.011, 0.019, 0.032, 0.040, 0.0525, 0.0611];
        let q = times.map(|t: f64| 0.3 - 2.0 * t + 7.0 * t * t);
        for (k, t) in times.into_iter().enumerate() {
            let (velocity, acceleration) = Rates::at(&times, k, 0.1).of(&q);
            assert!((velocity - (14.0 * t - 2.0)).abs() < 1e-9, "{k}: {velocity}");
            assert!((acceleration - 14.0).abs() < 1e-7, "{k}: {acceleration}");
        }
    }

    #[test]
    fn derivatives_start_again_after_a_pause() {
        let times = [0.0, 0.1, 0.2, 50.0, 50.1, 50.2];
        let q = [0.0, 0.1, 0.2, 9.0, 8.9, 8.8];
        let velocity: Vec<f64> = (0..6).map(|k| Rates::at(&times, k, 1.0).of(&q).0).collect();
        for (got, expected) in velocity.iter().zip([1.0, 1.0, 1.0, -1.0, -1.0, -1.0]) {
            assert!((got - expected).abs() < 1e-9, "{velocity:?}");
        }
    }

    #[test]
    fn a_sample_alone_between_pauses_stands_still() {
        assert_eq!(Rates::at(&[0.0, 9.0, 18.0], 1, 1.0).of(&[0.0, 5.0, 6.0]), (0.0, 0.0));
    }
}

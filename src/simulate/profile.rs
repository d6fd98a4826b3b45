//! How the speed along a path rises and falls: trapezoidal, or with limited jerk.

/// Distance over time along one stretch of a path. Units of length are the caller's: m, or rad of a turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Start (s), distance, speed and acceleration of each phase.
    phases: Vec<(f64, f64, f64, f64)>,
    length: f64,
    /// Time of the trapezoid, s.
    time: f64,
    /// Window of the moving average that limits jerk, s; 0 for none.
    window: f64,
}

impl Profile {
    /// From rest to rest over `length`. With a `jerk`, acceleration rises and falls linearly: the trapezoid is averaged over
    /// `acceleration / jerk` seconds, which keeps the length, the speed and the acceleration within their limits.
    pub fn rest_to_rest(length: f64, speed: f64, acceleration: f64, jerk: Option<f64>) -> Self {
        let window = jerk.map_or(0.0, |jerk| acceleration / jerk);
        // The speed is held for at least the window, so that the changes at start and end do not meet: v²/a + v·window = length.
        let half = acceleration * window / 2.0;
        let highest = (half * half + acceleration * length).sqrt() - half;
        let mut profile = Profile::between(length, 0.0, 0.0, speed.min(highest), acceleration);
        profile.window = window;
        profile
    }

    /// With speeds `from` and `to` at the ends, trapezoidal. Ends that cannot be joined with this acceleration are joined
    /// by a larger one.
    pub fn between(length: f64, from: f64, to: f64, speed: f64, acceleration: f64) -> Self {
        let mut profile = Profile { phases: Vec::new(), length, time: 0.0, window: 0.0 };
        if length <= 0.0 {
            return profile;
        }
        let peak = ((from * from + to * to) / 2.0 + acceleration * length).sqrt();
        let top = speed.min(peak).max(from.max(to));
        let rise = (top * top - from * from) / (2.0 * acceleration);
        let fall = (top * top - to * to) / (2.0 * acceleration);
        let mut phase = |distance: f64, start: f64, end: f64, at: f64| {
            if distance > 0.0 {
                let lasts = 2.0 * distance / (start + end);
                profile.phases.push((profile.time, at, start, (end - start) / lasts));
                profile.time += lasts;
            }
        };
        if rise + fall > length * (1.0 + 1e-12) {
            phase(length, from, to, 0.0);
        } else {
            let cruise = (length - rise - fall).max(0.0);
            phase(rise, from, top, 0.0);
            phase(cruise, top, top, rise);
            phase(fall, top, to, rise + cruise);
        }
        profile
    }

    /// How long it takes, s.
    pub fn duration(&self) -> f64 {
        self.time + self.window
    }

    /// Distance after `t` seconds.
    pub fn at(&self, t: f64) -> f64 {
        if self.window == 0.0 {
            return self.trapezoid(t);
        }
        if t >= self.duration() {
            return self.length;
        }
        ((self.area(t) - self.area(t - self.window)) / self.window).clamp(0.0, self.length)
    }

    fn phase(&self, t: f64) -> Option<(f64, f64, f64, f64)> {
        let after = self.phases.partition_point(|(start, ..)| *start <= t);
        after.checked_sub(1).map(|i| self.phases[i])
    }

    fn trapezoid(&self, t: f64) -> f64 {
        if t >= self.time {
            return self.length;
        }
        let Some((start, s, v, a)) = self.phase(t) else { return 0.0 };
        let dt = t - start;
        (s + v * dt + 0.5 * a * dt * dt).min(self.length)
    }

    /// Integral of the trapezoid's distance from 0 to `t`.
    fn area(&self, t: f64) -> f64 {
        let mut sum = (t - self.time).max(0.0) * self.length;
        for (i, (start, s, v, a)) in self.phases.iter().enumerate() {
            let end = self.phases.get(i + 1).map_or(self.time, |next| next.0);
            let dt = t.min(end) - start;
            if dt > 0.0 {
                sum += dt * (s + dt * (v / 2.0 + dt * a / 6.0));
            }
        }
        sum
    }
}

/// One stretch of a turn between two angles, with a stop at its end.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Where it starts, rad.
    pub from: f64,
    /// Where it ends, rad.
    pub to: f64,
    /// How fast.
    pub pace: Pace,
    /// Standstill at the end, s.
    pub dwell: f64,
    /// Angles between which the instrument records; nothing is recorded without.
    pub recorded: Option<(f64, f64)>,
}

/// How fast a leg is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Evenly spaced, with both ends, one position each sampling interval; the step may be rounded to fit the leg.
    Steps(f64),
    /// By a feed, from rest to rest.
    Feed {
        /// Largest speed, rad/s.
        speed: f64,
        /// Largest acceleration, rad/s².
        acceleration: f64,
        /// Largest jerk, rad/s³.
        jerk: Option<f64>,
    },
}

/// Times (s) and angles of legs, one after the other, at `rate` samples a second; whether each is recorded.
pub fn ticks(legs: &[Leg], rate: f64) -> impl Iterator<Item = (f64, f64, bool)> + Send + '_ {
    // Each leg goes on counting where the one before it stopped: number of the next sample, and the leg's own start in s.
    let mut next = 0u64;
    let mut begins = 0.0;
    legs.iter().flat_map(move |leg| {
        let (first, start) = (next, begins);
        let profile = match leg.pace {
            Pace::Steps(_) => None,
            Pace::Feed { speed, acceleration, jerk } => {
                Some(Profile::rest_to_rest((leg.to - leg.from).abs(), speed, acceleration, jerk))
            }
        };
        let intervals = match leg.pace {
            Pace::Steps(step) => (((leg.to - leg.from).abs() / step).round()).max(1.0),
            Pace::Feed { .. } => 0.0,
        };
        let count = match &profile {
            None => intervals as u64 + 1 + (leg.dwell * rate).round() as u64,
            // Samples from the leg's start up to the last one before the next leg starts.
            Some(profile) => {
                let end = start + profile.duration() + leg.dwell;
                ((end * rate - 1e-9).ceil() as u64).saturating_sub(first).max(1)
            }
        };
        next = first + count;
        begins = match &profile {
            None => next as f64 / rate,
            Some(profile) => start + profile.duration() + leg.dwell,
        };
        let sense = (leg.to - leg.from).signum();
        (0..count).map(move |k| {
            let time = (first + k) as f64 / rate;
            let u = match &profile {
                None => {
                    let part = (k as f64).min(intervals) / intervals;
                    // Whole steps stay whole: 0.1° steps give 0.1°, 0.2° ...
                    leg.from + (leg.to - leg.from) * part
                }
                Some(profile) => leg.from + sense * profile.at(time - start),
            };
            let recorded = leg.recorded.is_some_and(|(low, high)| (low - 1e-12..=high + 1e-12).contains(&u));
            (time, u, recorded)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest speed, acceleration and jerk by differences, and the end.
    fn limits(profile: &Profile) -> [f64; 4] {
        let (n, dt) = (20_000, profile.duration() / 20_000.0);
        let s: Vec<f64> = (0..=n + 3).map(|k| profile.at(k as f64 * dt)).collect();
        let difference = |x: &[f64]| -> Vec<f64> { x.windows(2).map(|w| (w[1] - w[0]) / dt).collect() };
        let largest = |x: &[f64]| x.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let v = difference(&s);
        let a = difference(&v);
        let j = difference(&a);
        [largest(&v), largest(&a), largest(&j), s[n]]
    }

    #[test]
    fn speed_acceleration_and_jerk_keep_their_limits_and_the_length_is_kept() {
        // Long, and too short to reach the speed or even the acceleration.
        for length in [3.0, 0.2, 0.01] {
            let smooth = limits(&Profile::rest_to_rest(length, 0.5, 2.0, Some(20.0)));
            assert!(
                smooth[0] <= 0.5 * 1.001 && smooth[1] <= 2.0 * 1.01 && smooth[2] <= 20.0 * 1.2,
                "{smooth:?}"
            );
            assert!((smooth[3] - length).abs() < 1e-12, "{smooth:?}");
            let plain = limits(&Profile::rest_to_rest(length, 0.5, 2.0, None));
            assert!(plain[0] <= 0.5 * 1.001 && plain[1] <= 2.0 * 1.01, "{plain:?}");
            assert!((plain[3] - length).abs() < 1e-12, "{plain:?}");
        }
        let time = Profile::rest_to_rest(1.0, 0.5, 2.0, None).duration();
        assert!((time - (1.0 / 0.5 + 0.5 / 2.0)).abs() < 1e-12);
    }

    #[test]
    fn speeds_at_the_ends_are_met() {
        let profile = Profile::between(1.0, 0.2, 0.4, 0.6, 1.0);
        let dt = 1e-6;
        assert!((profile.at(dt) / dt - 0.2).abs() < 1e-4);
        let end = profile.duration();
        assert!(((profile.at(end) - profile.at(end - dt)) / dt - 0.4).abs() < 1e-4);
        assert!((profile.at(end) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn four_legs_of_1801_positions_are_7204_samples_on_one_clock() {
        let leg = |from: f64, to: f64| Leg {
            from: from.to_radians(),
            to: to.to_radians(),
            pace: Pace::Steps(0.1f64.to_radians()),
            dwell: 0.0,
            recorded: Some((0.0, 7.0)),
        };
        let legs = [leg(0.0, 180.0), leg(180.0, 360.0), leg(360.0, 180.0), leg(180.0, 0.0)];
        let samples: Vec<(f64, f64, bool)> = ticks(&legs, 100.0).collect();
        assert_eq!(samples.len(), 7204);
        assert!(samples.iter().enumerate().all(|(k, (t, ..))| (t - k as f64 / 100.0).abs() < 1e-9));
        assert!((samples[1801].1.to_degrees() - 180.0).abs() < 1e-12 && samples[7203].1.abs() < 1e-12);
    }

    #[test]
    fn a_dwell_stands_still_and_the_next_leg_goes_on_from_there() {
        let pace = Pace::Feed { speed: 1.0, acceleration: 4.0, jerk: None };
        let leg = |from, to, dwell| Leg { from, to, pace, dwell, recorded: Some((0.0, 1.0)) };
        let samples: Vec<(f64, f64, bool)> =
            ticks(&[leg(0.0, 1.0, 0.5), leg(1.0, 0.0, 0.0)], 100.0).collect();
        let standing = samples.iter().filter(|(_, u, _)| (*u - 1.0).abs() < 1e-12).count();
        assert!((49..=52).contains(&standing), "{standing}");
        let steps = samples.windows(2).map(|w| (w[1].1 - w[0].1).abs()).fold(0.0, f64::max);
        assert!(steps <= 0.01 + 1e-9, "{steps}");
    }
}

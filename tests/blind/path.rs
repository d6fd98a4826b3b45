//! Paths as a machine would run them: legs with real acceleration, dwells between, settled poses of arms.

use std::f64::consts::{PI, TAU};

use super::body::{Body, V3, cross, scaled, sub};
use super::random::Random;

/// One recording's motion. All rows are per sample; m, rad, s.
#[derive(Clone, Debug, Default)]
pub struct Run {
    pub test: String,
    pub time: Vec<f64>,
    pub commands: Vec<Vec<f64>>,
    pub velocity: Vec<Vec<f64>>,
    pub acceleration: Vec<Vec<f64>>,
    /// Whether a pause stands before this sample.
    pub after_pause: Vec<bool>,
    /// Positions are settled, not passed through.
    pub settled: bool,
    /// Nominal length of the bar, m.
    pub length: f64,
    /// Directions of approach, where the recording states them.
    pub stated: Option<Vec<f64>>,
}

/// How a leg speeds up and slows down.
#[derive(Clone, Copy, Debug)]
pub enum Ease {
    Quintic,
    Cycloid,
    /// Constant speed between smooth ramps of this share of the time.
    Ramps(f64),
}

impl Ease {
    pub fn any(random: &mut Random) -> Self {
        match random.below(3) {
            0 => Ease::Quintic,
            1 => Ease::Cycloid,
            _ => Ease::Ramps(random.between(0.08, 0.3)),
        }
    }

    /// Share of the way at the share `t` of the time.
    pub fn at(self, t: f64) -> f64 {
        let t = t.clamp(0.0, 1.0);
        match self {
            Ease::Quintic => t * t * t * (10.0 - 15.0 * t + 6.0 * t * t),
            Ease::Cycloid => t - (TAU * t).sin() / TAU,
            Ease::Ramps(a) => {
                // Speed rises as a smooth step over `a`, so that the way over one ramp is a/2.
                let way = |x: f64| a * (x * x * x - 0.5 * x * x * x * x);
                let raw = if t < a {
                    way(t / a)
                } else if t > 1.0 - a {
                    (1.0 - a) - way((1.0 - t) / a)
                } else {
                    a / 2.0 + (t - a)
                };
                raw / (1.0 - a)
            }
        }
    }
}

/// A stretch between two stops: commands at each share of the way.
type Leg<'a> = Box<dyn Fn(f64) -> Option<Vec<f64>> + 'a>;

/// What the three linear axes of a machine must do so that the tool stands at a point of the workpiece.
pub struct Follower<'a> {
    body: &'a Body,
    linear: [usize; 3],
}

impl<'a> Follower<'a> {
    /// `None` where a machine has not exactly three linear axes that span space.
    pub fn new(body: &'a Body) -> Option<Self> {
        let linear: Vec<usize> = (0..body.commands.len()).filter(|c| !body.revolute[*c]).collect();
        let linear: [usize; 3] = linear.try_into().ok()?;
        let follower = Follower { body, linear };
        follower.reach(&vec![0.0; body.commands.len()], [0.0; 3]).map(|_| follower)
    }

    /// Commands with the turned axes as in `turned` and the tool point at `p_w`.
    pub fn reach(&self, turned: &[f64], p_w: V3) -> Option<Vec<f64>> {
        let mut q = turned.to_vec();
        self.linear.iter().for_each(|c| q[*c] = 0.0);
        let origin = self.body.tool(&q, None).p;
        let mut columns = [[0.0; 3]; 3];
        for (column, c) in columns.iter_mut().zip(self.linear) {
            q[c] = 1.0;
            *column = sub(self.body.tool(&q, None).p, origin);
            q[c] = 0.0;
        }
        let [a, b, c] = columns;
        let determinant = dot3(a, cross(b, c));
        if determinant.abs() < 0.2 {
            return None;
        }
        let d = sub(p_w, origin);
        q[self.linear[0]] = dot3(d, cross(b, c)) / determinant;
        q[self.linear[1]] = dot3(a, cross(d, c)) / determinant;
        q[self.linear[2]] = dot3(a, cross(b, d)) / determinant;
        Some(q)
    }
}

fn dot3(a: V3, b: V3) -> f64 {
    super::body::dot(a, b)
}

/// Point at a distance in a direction given by azimuth and elevation.
fn sphere(length: f64, azimuth: f64, elevation: f64) -> V3 {
    let (se, ce) = elevation.sin_cos();
    let (sa, ca) = azimuth.sin_cos();
    scaled([ce * ca, ce * sa, se], length)
}

/// Windows in which each turned axis is used in this case: (low, high), and whether it can turn all round.
pub fn windows(body: &Body, random: &mut Random) -> Vec<(f64, f64, bool)> {
    let window = |c: usize, random: &mut Random| {
        let (low, high) = body.travel[c];
        if !body.revolute[c] {
            return (low, high, false);
        }
        if high - low > 2.2 * PI && (low < -2.0 * PI || high > 2.0 * PI) {
            return (0.0, TAU, true);
        }
        let low = low.max(-1.75) + 0.05;
        let high = high.min(1.75) - 0.05;
        let width = random.between(1.0, 1.9).min(high - low);
        let from = random.between(low, high - width);
        (from, from + width, false)
    };
    (0..body.commands.len()).map(|c| window(c, random)).collect()
}

/// What is measured while the axes move: a bar of this length about the origin, or a ball nested at a fixed point.
#[derive(Clone, Copy, Debug)]
pub enum Target {
    Bar(f64),
    Nest(V3),
}

/// A point of the workpiece as a function of two angles: on the bar's sphere, or the nest.
fn target_point(target: Target, azimuth: f64, elevation: f64) -> V3 {
    match target {
        Target::Bar(length) => sphere(length, azimuth, elevation),
        Target::Nest(p) => p,
    }
}

/// All turned axes and the bar go their own way: stops at random places, or sums of waves in one long leg.
pub fn weave<'a>(
    follower: &'a Follower<'a>,
    windows: &[(f64, f64, bool)],
    target: Target,
    random: &mut Random,
) -> Vec<(Leg<'a>, f64)> {
    let count = windows.len();
    // The last two coordinates are azimuth and elevation of the bar.
    let mut ranges: Vec<(f64, f64)> = windows.iter().map(|w| (w.0, w.1)).collect();
    let azimuth = random.between(0.0, TAU);
    ranges.push((azimuth, azimuth + random.between(2.0, 6.0)));
    ranges.push((random.between(-0.4, 0.1), random.between(0.6, 1.25)));
    if random.chance(0.35) {
        let waves: Vec<(f64, f64, f64, f64)> = ranges
            .iter()
            .map(|(low, high)| {
                let amplitude = (high - low) / 2.0 * random.between(0.7, 0.98);
                ((low + high) / 2.0, amplitude, random.between(1.2, 5.5), random.between(0.0, TAU))
            })
            .collect();
        let leg = move |u: f64| {
            let at: Vec<f64> = waves.iter().map(|(m, a, k, p)| m + a * (TAU * k * u + p).sin()).collect();
            follower.reach(&at[..count], target_point(target, at[count], at[count + 1]))
        };
        return vec![(Box::new(leg) as Leg, random.between(50.0, 75.0))];
    }
    let stop = |random: &mut Random| -> Vec<f64> {
        ranges.iter().map(|(low, high)| random.between(*low, *high)).collect()
    };
    let legs = 9 + random.below(6);
    let mut from = stop(random);
    (0..legs)
        .map(|_| {
            let to = stop(random);
            let start = std::mem::replace(&mut from, to.clone());
            let leg = move |u: f64| {
                let at: Vec<f64> = start.iter().zip(&to).map(|(a, b)| a + (b - a) * u).collect();
                follower.reach(&at[..count], target_point(target, at[count], at[count + 1]))
            };
            (Box::new(leg) as Leg, random.between(3.5, 7.0))
        })
        .collect()
}

/// One turned axis goes there and back with the others still (spin or tilt); with `swing`, a second one goes to and fro (cone).
pub fn turn<'a>(
    follower: &'a Follower<'a>,
    windows: &[(f64, f64, bool)],
    target: Target,
    turning: usize,
    swing: Option<usize>,
    random: &mut Random,
) -> Vec<(Leg<'a>, f64)> {
    let count = windows.len();
    let rest: Vec<f64> = windows.iter().map(|w| random.between(w.0, w.1)).collect();
    let (azimuth, elevation) = (random.between(0.0, TAU), random.between(-0.3, 1.2));
    let (by_azimuth, by_elevation) = (random.between(-1.5, 1.5), random.between(-0.5, 0.3));
    let ends = |c: usize| (windows[c].0, windows[c].1);
    let phase = random.between(0.5, 1.5);
    let legs = 4;
    (0..legs)
        .map(|k| {
            let rest = rest.clone();
            let (low, high) = ends(turning);
            let swung = swing.map(ends);
            let leg = move |u: f64| {
                let s = if k % 2 == 0 { u } else { 1.0 - u };
                let mut q = rest.clone();
                q[turning] = low + (high - low) * s;
                if let (Some(c), Some((a, b))) = (swing, swung) {
                    q[c] = a + (b - a) * (0.5 - 0.5 * (TAU * phase * (k as f64 + u)).cos());
                }
                // The bar drifts on slowly, so that no two turns see quite the same.
                let along = (k as f64 + u) / legs as f64;
                let p = target_point(target, azimuth + by_azimuth * along, elevation + by_elevation * along);
                follower.reach(&q[..count], p)
            };
            (Box::new(leg) as Leg, random.between(11.0, 18.0))
        })
        .collect()
}

/// Circles of the bar in a plane of the workpiece, both ways, at two feeds.
pub fn circles<'a>(
    follower: &'a Follower<'a>,
    plane: (usize, usize),
    radius: f64,
    centre: V3,
    random: &mut Random,
) -> Vec<(Leg<'a>, f64)> {
    let start = random.between(0.0, TAU);
    let rest = vec![0.0; follower.body.commands.len()];
    let feeds = [random.between(9.0, 14.0), random.between(12.0, 18.0)];
    let order = *random.pick(&[[1.0, 1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0], [-1.0, 1.0, 1.0, -1.0]]);
    (0..4)
        .map(|k| {
            let rest = rest.clone();
            let way = order[k] * TAU;
            let leg = move |u: f64| {
                let mut p = centre;
                p[plane.0] += radius * (start + way * u).cos();
                p[plane.1] += radius * (start + way * u).sin();
                follower.reach(&rest, p)
            };
            (Box::new(leg) as Leg, feeds[k % 2])
        })
        .collect()
}

/// Every command between its own limits, with no instrument to follow: stops, or waves in one long leg.
pub fn sweep<'a>(ranges: Vec<(f64, f64)>, legs: usize, random: &mut Random) -> Vec<(Leg<'a>, f64)> {
    if random.chance(0.4) {
        let waves: Vec<(f64, f64, f64, f64)> = ranges
            .iter()
            .map(|(low, high)| {
                let amplitude = (high - low) / 2.0 * random.between(0.7, 0.98);
                ((low + high) / 2.0, amplitude, random.between(1.5, 6.0), random.between(0.0, TAU))
            })
            .collect();
        let leg =
            move |u: f64| Some(waves.iter().map(|(m, a, k, p)| m + a * (TAU * k * u + p).sin()).collect());
        return vec![(Box::new(leg) as Leg, random.between(60.0, 90.0))];
    }
    let stop = |r: &mut Random| -> Vec<f64> { ranges.iter().map(|(a, b)| r.between(*a, *b)).collect() };
    let mut from = stop(random);
    (0..legs)
        .map(|_| {
            let to = stop(random);
            let start = std::mem::replace(&mut from, to.clone());
            let leg = move |u: f64| Some(start.iter().zip(&to).map(|(a, b)| a + (b - a) * u).collect());
            (Box::new(leg) as Leg, random.between(3.5, 7.0))
        })
        .collect()
}

/// Runs legs on the clock. `None` if a command leaves its travel.
pub fn run(
    body: &Body,
    legs: &[(Leg, f64)],
    start: f64,
    dt: f64,
    ease: Ease,
    skip_dwell: bool,
    random: &mut Random,
) -> Option<Run> {
    const H: f64 = 2e-3;
    let mut out = Run::default();
    let mut clock = start;
    for (leg, duration) in legs {
        let at = |t: f64| leg(ease.at(t / duration));
        let samples = (duration / dt).floor() as usize;
        for k in 0..=samples {
            let t = k as f64 * dt;
            let (b, q, f) = (at(t - H)?, at(t)?, at(t + H)?);
            let inside = q.iter().zip(&body.travel).all(|(q, (low, high))| *q >= *low && *q <= *high);
            if !inside {
                return None;
            }
            out.velocity.push(b.iter().zip(&f).map(|(b, f)| (f - b) / (2.0 * H)).collect());
            let bend = b.iter().zip(&q).zip(&f).map(|((b, q), f)| (f - 2.0 * q + b) / (H * H));
            out.acceleration.push(bend.collect());
            out.commands.push(q);
            out.time.push(clock + t);
            out.after_pause.push(k == 0);
        }
        clock += samples as f64 * dt;
        let dwell = random.between(0.5, 2.5);
        if skip_dwell {
            clock += dwell;
        } else {
            let still = (dwell / dt) as usize;
            let last = out.commands.last()?.clone();
            for k in 1..=still {
                out.velocity.push(vec![0.0; last.len()]);
                out.acceleration.push(vec![0.0; last.len()]);
                out.commands.push(last.clone());
                out.time.push(clock + k as f64 * dt);
                out.after_pause.push(false);
            }
            clock += (still + 1) as f64 * dt;
            // The next leg goes on without a gap.
        }
    }
    if !skip_dwell {
        out.after_pause.iter_mut().skip(1).for_each(|p| *p = false);
    }
    Some(out)
}

/// Settled poses one after another, each reached from the one before.
pub fn poses(ranges: &[(f64, f64)], count: usize, start: f64, every: f64, random: &mut Random) -> Run {
    let zero = vec![0.0; ranges.len()];
    let mut out = Run { test: "poses".into(), settled: true, ..Run::default() };
    for k in 0..count {
        out.commands.push(ranges.iter().map(|(low, high)| random.between(*low, *high)).collect());
        out.velocity.push(zero.clone());
        out.acceleration.push(zero.clone());
        out.time.push(start + k as f64 * every);
        out.after_pause.push(false);
    }
    out
}

/// A single axis over even steps there and back, settled at each: ISO 230-2.
pub fn steps(
    range: (f64, f64),
    targets: usize,
    cycles: usize,
    start: f64,
    every: f64,
    random: &mut Random,
) -> Run {
    let mut out = Run { test: "steps".into(), settled: true, ..Run::default() };
    let pitch = (range.1 - range.0) / targets as f64;
    let places: Vec<f64> =
        (0..targets).map(|k| range.0 + pitch * (k as f64 + random.between(0.2, 0.8))).collect();
    let mut order: Vec<f64> = Vec::new();
    let mut stated = Vec::new();
    for _ in 0..cycles {
        // The axis goes beyond its end targets, so that these too are approached from both sides.
        order.extend(places.iter());
        order.extend(places.iter().rev());
        stated.extend(places.iter().map(|_| 1.0));
        stated.extend(places.iter().map(|_| -1.0));
    }
    out.stated = Some(stated);
    for (k, q) in order.into_iter().enumerate() {
        out.commands.push(vec![q]);
        out.velocity.push(vec![0.0]);
        out.acceleration.push(vec![0.0]);
        out.time.push(start + k as f64 * every);
        out.after_pause.push(false);
    }
    out
}

//! The physics that cases conceal: each by its own law, at unit size.

use std::f64::consts::TAU;

use super::body::{Body, V3, across, add, cross, dot, scaled};
use super::random::Random;
use super::shape::Curve;
use super::track::{JointTrack, Track};

/// Where an effect sits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The joint of this link.
    Joint(usize),
    /// The frame of this link.
    Frame(usize),
    Measurement,
}

/// What an effect of unit size adds, sample by sample.
#[derive(Clone, Debug)]
pub enum Profile {
    /// To the displacement of a link's joint, m or rad.
    Joint(usize, Vec<f64>),
    /// Before a link's joint, (v; w).
    Before(usize, Vec<[f64; 6]>),
    /// Behind a link's joint.
    After(usize, Vec<[f64; 6]>),
    /// To the reading's position part, along this unit vector (its first component for scalars).
    Reading(V3, Vec<f64>),
    /// The reading comes late by so many s.
    Late(Vec<f64>),
}

/// A concealed effect at unit size.
#[derive(Clone, Debug)]
pub struct Effect {
    pub name: &'static str,
    pub place: Place,
    pub profile: Profile,
    /// Coefficients of `contract.md` section 4: name, value, and whether it grows with the size.
    pub coefficients: Vec<(&'static str, f64, bool)>,
    /// Largest size, m and rad, that a machine in use would show.
    pub most: (f64, f64),
}

/// Names on joints that move in a line, on joints that turn, on frames, and on the measurement.
pub const LINEAR: [&str; 11] = [
    "backlash",
    "hysteresis",
    "scale_error",
    "positioning_error",
    "cyclic_error",
    "straightness",
    "angular_error",
    "reversal_spike",
    "servo_lag",
    "inertial_error",
    "local_defect",
];
pub const ROTARY: [&str; 14] = [
    "backlash",
    "hysteresis",
    "direction_dependent_pose",
    "scale_error",
    "positioning_error",
    "cyclic_error",
    "encoder_eccentricity",
    "axis_wobble",
    "radial_runout",
    "reversal_spike",
    "servo_lag",
    "inertial_error",
    "gravity_compliance",
    "local_defect",
];
pub const FRAME: [&str; 2] = ["thermal_drift", "setup_slip"];
pub const MEASUREMENT: [&str; 3] = ["sensor_drift", "latency", "vibration"];

/// Names that need a path that is passed through, not settled positions.
const IN_MOTION: [&str; 6] =
    ["hysteresis", "reversal_spike", "servo_lag", "inertial_error", "latency", "vibration"];

const PLAY: (f64, f64) = (1e-4, 6e-4);
const SHAPE: (f64, f64) = (1.5e-4, 4e-4);

/// All names with their places that this case can conceal.
pub fn all_places(body: &Body, track: &Track) -> Vec<(&'static str, Place)> {
    let mut all = Vec::new();
    for (j, link) in body.links.iter().enumerate() {
        let moves = track.joints[j].as_ref().is_some_and(|t| t.span() > 1e-3);
        if let (Some(joint), true) = (&link.joint, moves) {
            let names: &[&'static str] = if joint.revolute { &ROTARY } else { &LINEAR };
            all.extend(names.iter().map(|n| (*n, Place::Joint(j))));
        }
        all.extend(FRAME.iter().map(|n| (*n, Place::Frame(j))));
    }
    all.extend(MEASUREMENT.iter().map(|n| (*n, Place::Measurement)));
    all.retain(|(name, _)| !(track.settled && IN_MOTION.contains(name)));
    all
}

impl Effect {
    /// Draws an effect of this name at this place; `None` where it cannot be.
    pub fn draw(
        name: &'static str,
        place: Place,
        body: &Body,
        track: &Track,
        wild: bool,
        random: &mut Random,
    ) -> Option<Effect> {
        let effect = |profile, coefficients, most| Some(Effect { name, place, profile, coefficients, most });
        match place {
            Place::Joint(j) => {
                let joint = body.links[j].joint.as_ref()?;
                let t = track.joints[j].as_ref()?;
                let (profile, coefficients) = match name {
                    "straightness" | "angular_error" => carriage(name, j, joint.n, t, wild, random),
                    "axis_wobble" | "radial_runout" | "direction_dependent_pose" => {
                        rotor(name, j, joint.n, t, wild, random)
                    }
                    "gravity_compliance" => gravity(j, body, t, track, wild, random)?,
                    _ => {
                        let (values, coefficients) = displacement(name, joint.revolute, t, wild, random)?;
                        (Profile::Joint(j, values), coefficients)
                    }
                };
                let most = if matches!(name, "backlash" | "hysteresis") { PLAY } else { SHAPE };
                effect(profile, coefficients, most)
            }
            Place::Frame(j) => {
                let twist = frame_twist(wild, random);
                let (course, coefficients) = course(name, track, wild, random);
                let values = course.into_iter().map(|c| twist.map(|x| x * c)).collect();
                effect(Profile::Before(j, values), coefficients, SHAPE)
            }
            Place::Measurement => {
                let n = track.len();
                let direction = random.direction();
                match name {
                    "sensor_drift" => {
                        let curve = if wild { Curve::wild(random) } else { Curve::textbook(random, 1, 2) };
                        let from = curve.at(0.0);
                        let values = peak_one((0..n).map(|k| curve.at(track.age(k)) - from).collect());
                        effect(
                            Profile::Reading(direction, values),
                            vec![("peak", 1.0, true)],
                            (1e-4, SHAPE.1),
                        )
                    }
                    "latency" => {
                        effect(Profile::Late(vec![1.0; n]), vec![("delay", 1.0, true)], (0.05, 0.05))
                    }
                    _ => {
                        let dt = track.time[1] - track.time[0];
                        let frequency = random.log_between(0.7, (0.35 / dt).min(25.0));
                        let (phase, second) = (random.between(0.0, TAU), if wild { 0.25 } else { 0.0 });
                        let wave = |t: f64| {
                            let angle = TAU * frequency * t + phase;
                            angle.sin() + second * (2.0 * angle).cos()
                        };
                        let values = track.time.iter().map(|t| wave(*t)).collect();
                        let coefficients = vec![("amplitude", 1.0, true), ("frequency", frequency, false)];
                        effect(Profile::Reading(direction, values), coefficients, (5e-5, SHAPE.1))
                    }
                }
            }
        }
    }
}

/// The same course with largest absolute value 1.
pub fn peak_one(values: Vec<f64>) -> Vec<f64> {
    let peak = values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    values.into_iter().map(|v| v / peak.max(1e-12)).collect()
}

type Coefficients = Vec<(&'static str, f64, bool)>;

/// Laws that add to a joint's displacement.
fn displacement(
    name: &str,
    revolute: bool,
    t: &JointTrack,
    wild: bool,
    random: &mut Random,
) -> Option<(Vec<f64>, Coefficients)> {
    let n = t.q.len();
    let variant = random.below(2);
    Some(match name {
        "backlash" => {
            let sign = random.sign();
            let (curve, depth) = (Curve::wild(random), if wild { 0.35 } else { 0.0 });
            let lift = peak_one((0..n).map(|k| curve.at(t.share(k))).collect());
            let values = (0..n).map(|k| sign * 0.5 * t.direction[k] * (1.0 + depth * lift[k])).collect();
            (values, if wild { vec![] } else { vec![("width", 1.0, true)] })
        }
        "hysteresis" => {
            let take_up = if revolute {
                random.log_between(1.0, 5.0).to_radians()
            } else {
                random.log_between(1e-3, 6e-3)
            };
            if take_up > 0.25 * t.span() {
                return None;
            }
            let sign = random.sign();
            let mut z = t.direction[0];
            let mut values = Vec::with_capacity(n);
            for k in 0..n {
                let gone = t.step[k].abs() / take_up;
                z = match (wild, variant) {
                    (false, _) => t.direction[k] + (z - t.direction[k]) * (-gone).exp(),
                    // Play with a wide gap: taken up in proportion.
                    (true, 0) => (z + t.step[k] / take_up * 1.26).clamp(-1.0, 1.0),
                    // Friction that yields ever more slowly.
                    _ => {
                        z + (t.direction[k] - z)
                            * (gone * (0.6 + 0.8 * (t.direction[k] - z).abs() / 2.0)).min(1.0)
                    }
                };
                values.push(sign * 0.5 * z);
            }
            (values, if wild { vec![] } else { vec![("width", 1.0, true), ("take_up", take_up, false)] })
        }
        "scale_error" => {
            let bend = if wild { 0.1 } else { 0.0 };
            let span = t.span();
            let values = (0..n).map(|k| (t.q[k] - t.low) / span + bend * (6.0 * t.share(k)).sin() / 6.0);
            (values.collect(), if wild { vec![] } else { vec![("slope", 1.0 / span, true)] })
        }
        "positioning_error" => {
            let curve = if wild { Curve::wild(random) } else { Curve::textbook(random, 2, 5) };
            (peak_one((0..n).map(|k| curve.at(t.share(k))).collect()), vec![("peak", 1.0, true)])
        }
        "cyclic_error" => {
            let period = if revolute {
                TAU / random.between(24.0, 90.99).floor()
            } else {
                *random.pick(&[5e-3, 6e-3, 8e-3, 1e-2, 1.2e-2, 1.6e-2, 2e-2])
            };
            if period > 0.2 * t.span() {
                return None;
            }
            let phase = random.between(0.0, TAU);
            let (second, swell) = if wild { (0.3, 0.3) } else { (0.0, 0.0) };
            let swelling = Curve::wild(random);
            let swelling = peak_one((0..n).map(|k| swelling.at(t.share(k))).collect());
            let values = (0..n).map(|k| {
                let angle = TAU * t.q[k] / period + phase;
                (angle.sin() + second * (2.0 * angle + 1.0).sin()) * (1.0 + swell * swelling[k])
            });
            let known = vec![("amplitude", 1.0, true), ("period", period, false)];
            (values.collect(), if wild { vec![("period", period, false)] } else { known })
        }
        "encoder_eccentricity" => {
            let (phase, second) = (random.between(0.0, TAU), if wild { 0.15 } else { 0.0 });
            let values = t.q.iter().map(|q| (q + phase).sin() + second * (2.0 * q - phase).sin());
            (values.collect(), if wild { vec![] } else { vec![("amplitude", 1.0, true)] })
        }
        "reversal_spike" => {
            let decay = if revolute {
                random.log_between(0.4, 2.0).to_radians()
            } else {
                random.log_between(6e-4, 3e-3)
            };
            if decay > 0.1 * t.span() {
                return None;
            }
            let sign = random.sign();
            let fade = |d: f64| match (wild, variant) {
                (false, _) => (-d).exp(),
                (true, 0) => (-0.5 * d * d).exp(),
                _ => (1.0 + d) * (-1.5 * d).exp(),
            };
            let values = (0..n).map(|k| {
                let d = t.since[k] / decay;
                if d.is_finite() { sign * t.direction[k] * fade(d) } else { 0.0 }
            });
            (
                values.collect(),
                if wild { vec![] } else { vec![("height", 1.0, true), ("decay", decay, false)] },
            )
        }
        "servo_lag" => {
            let fastest = t.v.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            let values = t.v.iter().map(|v| {
                let held = if wild { 1.0 + 0.3 * (v / fastest).powi(2) } else { 1.0 };
                -v / fastest / held
            });
            (values.collect(), if wild { vec![] } else { vec![("lag", 1.0 / fastest, true)] })
        }
        "inertial_error" => {
            let hardest = t.a.iter().fold(0.0, |m: f64, a| m.max(a.abs()));
            let sign = random.sign();
            let values = t.a.iter().map(|a| {
                let held = if wild { 1.0 + 0.3 * (a / hardest).abs() } else { 1.0 };
                sign * a / hardest / held
            });
            (values.collect(), if wild { vec![] } else { vec![("gain", 1.0 / hardest, true)] })
        }
        "local_defect" => {
            let at = random.between(0.15, 0.85);
            let width = random.log_between(0.015, 0.05);
            let sign = random.sign();
            let dent = |x: f64| match (wild, variant) {
                (false, _) => (-0.5 * x * x).exp(),
                (true, 0) => (1.0 - x.abs() / 2.0).max(0.0),
                _ => {
                    if x.abs() < 2.0 {
                        0.5 + 0.5 * (x * TAU / 4.0).cos()
                    } else {
                        0.0
                    }
                }
            };
            let values = (0..n).map(|k| sign * dent((t.share(k) - at) / width)).collect();
            let place = t.low + at * t.span();
            (
                values,
                if wild {
                    vec![("at", place, false)]
                } else {
                    vec![("height", 1.0, true), ("at", place, false)]
                },
            )
        }
        _ => return None,
    })
}

/// Error motions of a carriage, behind its joint.
fn carriage(
    name: &str,
    j: usize,
    n: V3,
    t: &JointTrack,
    wild: bool,
    random: &mut Random,
) -> (Profile, Coefficients) {
    let straight = name == "straightness";
    let curve = match (wild, straight) {
        (true, _) => Curve::wild(random),
        (false, true) => Curve::textbook(random, 2, 4),
        (false, false) => Curve::textbook(random, 1, 3),
    };
    let [u, v] = across(n);
    let angle = random.between(0.0, TAU);
    let side = add(scaled(u, angle.cos()), scaled(v, angle.sin()));
    let direction = if straight { side } else { *random.pick(&[u, v, n, side]) };
    let values = peak_one((0..t.q.len()).map(|k| curve.at(t.share(k))).collect());
    let zero = [0.0; 3];
    let twist = if straight { both(direction, zero) } else { both(zero, direction) };
    let values = values.into_iter().map(|c| twist.map(|x| x * c)).collect();
    (Profile::After(j, values), vec![("peak", 1.0, true)])
}

/// Error motions of a rotary axis, before its joint.
fn rotor(
    name: &str,
    j: usize,
    n: V3,
    t: &JointTrack,
    wild: bool,
    random: &mut Random,
) -> (Profile, Coefficients) {
    let [u, v] = across(n);
    if name == "direction_dependent_pose" {
        let twist = frame_twist(wild, random);
        let soft = if wild { t.span() * random.between(0.002, 0.01) } else { 0.0 };
        let mut z = t.direction[0];
        let values = (0..t.q.len()).map(|k| {
            z = if soft > 0.0 {
                t.direction[k] + (z - t.direction[k]) * (-t.step[k].abs() / soft).exp()
            } else {
                t.direction[k]
            };
            twist.map(|x| x * 0.5 * z)
        });
        return (Profile::Before(j, values.collect()), vec![]);
    }
    let per_rev = if name == "axis_wobble" { 1 + random.below(3) } else { 2 + random.below(3) } as f64;
    let phase = random.between(0.0, TAU);
    let oval = if wild { random.between(0.3, 0.8) } else { *random.pick(&[0.0, 1.0, -1.0]) };
    let turn = random.between(0.0, TAU);
    let (first, second) = (
        add(scaled(u, turn.cos()), scaled(v, turn.sin())),
        add(scaled(u, -turn.sin()), scaled(v, turn.cos())),
    );
    let axial = name == "radial_runout" && random.chance(0.25);
    let third = if wild { 0.2 } else { 0.0 };
    let values = t.q.iter().map(|q| {
        let angle = per_rev * q + phase;
        let wave = angle.cos() + third * (2.0 * angle + 0.7).cos();
        let d = if axial {
            scaled(n, wave)
        } else {
            add(scaled(first, wave), scaled(second, oval * angle.sin()))
        };
        if name == "axis_wobble" { both([0.0; 3], d) } else { both(d, [0.0; 3]) }
    });
    let coefficients = vec![("per_rev", per_rev, false)];
    (Profile::Before(j, values.collect()), coefficients)
}

/// Moment of gravity about a joint times a compliance.
fn gravity(
    j: usize,
    body: &Body,
    t: &JointTrack,
    track: &Track,
    wild: bool,
    random: &mut Random,
) -> Option<(Profile, Coefficients)> {
    let load = [random.between(-0.05, 0.05), random.between(-0.05, 0.05), random.between(0.02, 0.12)];
    let moments =
        peak_one(moments(j, body, track, &|_| vec![(1.0, load)]).into_iter().map(|m| m[0]).collect());
    let mean = moments.iter().sum::<f64>() / moments.len() as f64;
    let spread = (moments.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / moments.len() as f64).sqrt();
    if spread < 0.1 || t.span() < 0.2 {
        return None;
    }
    let yielding = |m: f64| if wild { m + 0.6 * (m.abs() - 0.4).max(0.0) * m.signum() } else { m };
    let values = peak_one(moments.into_iter().map(yielding).collect());
    Some((Profile::Joint(j, values), vec![("peak", 1.0, true)]))
}

/// Moments about a joint, of masses at the end of its branch (and of the machine's own masses, where it states them).
pub fn moments(
    j: usize,
    body: &Body,
    track: &Track,
    loads: &dyn Fn(usize) -> Vec<(f64, V3)>,
) -> Vec<Vec<f64>> {
    let branch = body.links[j].on_workpiece;
    let behind: Vec<usize> =
        (j..body.links.len()).filter(|i| body.links[*i].on_workpiece == branch).collect();
    let Some(end) = behind.last().copied() else { return Vec::new() };
    let n = body.links[j].joint.as_ref().map_or([0.0; 3], |a| a.n);
    let columns = loads(end);
    (0..track.len())
        .map(|k| {
            let q: Vec<f64> = track.joints.iter().map(|t| t.as_ref().map_or(0.0, |t| t.q[k])).collect();
            let poses = body.poses_at(&q);
            let (at, axis) = (poses[j].0.p, poses[j].0.rotate(n));
            let of = |mass: f64, p: V3| {
                let arm = add(p, scaled(at, -1.0));
                mass * dot(axis, cross(arm, body.gravity))
            };
            let own: f64 = behind
                .iter()
                .filter_map(|i| body.links[*i].mass.map(|(m, c)| of(m / 10.0, poses[*i].1.apply(c))))
                .sum();
            columns.iter().map(|(m, c)| own + of(*m, poses[end].1.apply(*c))).collect()
        })
        .collect()
}

fn both(v: V3, w: V3) -> [f64; 6] {
    [v[0], v[1], v[2], w[0], w[1], w[2]]
}

/// A shift, a tilt, or both, of comparable effect at machine size.
fn frame_twist(_wild: bool, random: &mut Random) -> [f64; 6] {
    let (v, w) = (random.direction(), scaled(random.direction(), 3.0));
    match random.below(4) {
        0 | 1 => both(v, [0.0; 3]),
        2 => both(v, w),
        _ => both([0.0; 3], w),
    }
}

/// Course over time of what happens to a frame.
fn course(name: &str, track: &Track, wild: bool, random: &mut Random) -> (Vec<f64>, Coefficients) {
    let seen = track.seen_s();
    if name == "setup_slip" {
        // At a moment that has samples on both sides.
        let k = (track.recorded as f64 * random.between(0.15, 0.85)) as usize;
        let at = track.time[k] + random.between(0.0, 1e-3);
        let creep = if wild && !track.settled { random.between(0.05, 0.5) } else { 0.0 };
        let step = |t: f64| {
            let since = t - at;
            if since < 0.0 {
                0.0
            } else if creep > 0.0 {
                1.0 - (-since / creep).exp()
            } else {
                1.0
            }
        };
        return (track.time.iter().map(|t| step(*t)).collect(), vec![("at_time", at, false)]);
    }
    let constant = seen * random.log_between(0.15, 1.0);
    if wild {
        let (curve, slow) = (Curve::wild(random), constant * 3.0);
        let from = curve.at(0.0);
        let values = (0..track.len()).map(|k| {
            let t = track.time[k] - track.time[0];
            1.2 - 0.7 * (-t / constant).exp() - 0.5 * (-t / slow).exp()
                + 0.12 * (curve.at(track.age(k)) - from)
        });
        return (peak_one(values.collect()), vec![]);
    }
    let values = track.time.iter().map(|t| 1.0 - (-(t - track.time[0]) / constant).exp());
    (peak_one(values.collect()), vec![("time_constant", constant, false)])
}

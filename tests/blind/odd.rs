//! Effects outside every vocabulary.

use std::f64::consts::TAU;

use super::body::Body;
use super::effect::{Effect, Place, Profile, peak_one};
use super::random::Random;
use super::shape::Curve;
use super::track::Track;

/// Draws an odd effect, the joints it depends on beyond its place, and frequencies at which it might look like a vibration.
pub fn draw(body: &Body, track: &Track, random: &mut Random) -> Option<(Effect, Vec<usize>, Vec<f64>)> {
    let moving: Vec<usize> = (0..body.links.len())
        .filter(|j| track.joints[*j].as_ref().is_some_and(|t| t.span() > 1e-3))
        .collect();
    let n = track.len();
    let dt = track.time[1] - track.time[0];
    let fast = if track.settled { None } else { Some((0.3 / dt).min(20.0)) };
    let kinds: &[&str] = match (moving.len() > 1, fast.is_some()) {
        (true, true) => {
            &["islands", "islands", "chirp", "product", "telegraph", "beating", "sum", "crossed", "bursts"]
        }
        (true, false) => &["islands", "islands", "product", "telegraph", "sum", "crossed"],
        (false, true) => &["chirp", "telegraph", "beating", "bursts"],
        (false, false) => &["telegraph"],
    };
    let kind = *random.pick(kinds);
    let direction = random.direction();
    let fast = fast.unwrap_or(1.0);
    let on_reading = |name, values: Vec<f64>, frequencies| {
        let profile = Profile::Reading(direction, peak_one(values));
        let effect =
            Effect { name, place: Place::Measurement, profile, coefficients: vec![], most: (1e-4, 4e-4) };
        Some((effect, vec![], frequencies))
    };
    // Two joints, and where each sample lies between their ends.
    let a = *random.pick(&moving);
    let others: Vec<usize> = moving.iter().copied().filter(|j| *j != a).collect();
    let b = if others.is_empty() { a } else { *random.pick(&others) };
    let (ta, tb) = (track.joints[a].as_ref()?, track.joints[b].as_ref()?);
    let frame = random.chance(0.5);
    let on_joints = |name, values: Vec<f64>| {
        let values = peak_one(values);
        let (place, profile) = if frame {
            let twist = |v: &f64| [direction[0] * v, direction[1] * v, direction[2] * v, 0.0, 0.0, 0.0];
            (Place::Frame(a), Profile::Before(a, values.iter().map(twist).collect()))
        } else {
            (Place::Joint(a), Profile::Joint(a, values))
        };
        let effect = Effect { name, place, profile, coefficients: vec![], most: (1.5e-4, 4e-4) };
        Some((effect, vec![a, b], vec![]))
    };
    match kind {
        "islands" => {
            let count = 2 + random.below(3);
            let islands: Vec<[f64; 5]> = (0..count)
                .map(|_| {
                    // About places that the path really visits.
                    let k = random.below(track.recorded);
                    let (x, y) = (ta.share(k), tb.share(k));
                    [x, y, random.between(0.05, 0.12), random.between(0.05, 0.12), random.normal()]
                })
                .collect();
            let value = |k: usize| {
                let hill = |i: &[f64; 5]| {
                    let (x, y) = ((ta.share(k) - i[0]) / i[2], (tb.share(k) - i[1]) / i[3]);
                    i[4] * (-0.5 * (x * x + y * y)).exp()
                };
                islands.iter().map(hill).sum::<f64>()
            };
            on_joints("odd_islands", (0..n).map(value).collect())
        }
        "product" => {
            let (f, g) = (Curve::wild(random), Curve::wild(random));
            let middle = |c: &Curve| (0..=20).map(|i| c.at(i as f64 / 20.0)).sum::<f64>() / 21.0;
            let (mf, mg) = (middle(&f), middle(&g));
            let value = |k: usize| (f.at(ta.share(k)) - mf) * (g.at(tb.share(k)) - mg);
            on_joints("odd_product", (0..n).map(value).collect())
        }
        "sum" => {
            let (waves, phase) = (random.between(2.0, 6.0), random.between(0.0, TAU));
            let (sign, weight) = (random.sign(), random.between(0.6, 1.6));
            let value =
                |k: usize| (TAU * waves / 2.0 * (ta.share(k) + sign * weight * tb.share(k)) + phase).sin();
            on_joints("odd_sum", (0..n).map(value).collect())
        }
        "crossed" => {
            // The error of one axis follows the place of another, and changes sign with its own direction.
            let curve = Curve::wild(random);
            let value = |k: usize| curve.at(tb.share(k)) * ta.direction[k] * tb.direction[k];
            on_joints("odd_crossed", (0..n).map(value).collect())
        }
        "telegraph" => {
            let (from, to) = (track.time[0], track.time[n - 1]);
            let mut times: Vec<f64> = (0..10 + random.below(14)).map(|_| random.between(from, to)).collect();
            times.sort_by(f64::total_cmp);
            let value =
                |k: usize| if times.partition_point(|t| *t <= track.time[k]) % 2 == 0 { 0.5 } else { -0.5 };
            on_reading("odd_telegraph", (0..n).map(value).collect(), vec![])
        }
        "chirp" => {
            let run = random.below(track.starts.len() - 2);
            let (from, to) = (track.starts[run], track.starts[run + 1] - 1);
            let (t0, t1) = (track.time[from], track.time[to]);
            let (f0, f1) = (random.between(0.2, 0.1 * fast), random.between(0.3 * fast, 0.9 * fast));
            let value = |k: usize| {
                let t = track.time[k] - t0;
                if k < from || k > to {
                    0.0
                } else {
                    (TAU * (f0 * t + 0.5 * (f1 - f0) * t * t / (t1 - t0))).sin()
                }
            };
            let frequencies = (0..60).map(|i| f0 + (f1 - f0) * i as f64 / 59.0).collect();
            on_reading("odd_chirp", (0..n).map(value).collect(), frequencies)
        }
        "beating" => {
            // A vibration whose strength wanders through zero and whose phase wanders too: no few fixed frequencies make it up.
            let f = random.between(0.2 * fast, 0.8 * fast);
            let (strength, phase) = (smooth(random), smooth(random));
            let value = |k: usize| {
                let (t, age) = (track.time[k], track.age(k));
                strength(age) * (TAU * f * t + 4.0 * phase(age)).sin()
            };
            let frequencies = (-60..=60).map(|i| f + f64::from(i) * 0.5 / track.seen_s()).collect();
            on_reading("odd_beating", (0..n).map(value).collect(), frequencies)
        }
        _ => {
            let count = 5 + random.below(8);
            let bursts: Vec<[f64; 4]> = (0..count)
                .map(|_| {
                    let at = track.time[random.below(track.recorded)];
                    [
                        at,
                        random.log_between(0.3, 2.0),
                        random.between(0.1 * fast, 0.8 * fast),
                        random.between(0.0, TAU),
                    ]
                })
                .collect();
            let value = |k: usize| {
                let one = |b: &[f64; 4]| {
                    let t = track.time[k] - b[0];
                    (-0.5 * (t / b[1]).powi(2)).exp() * (TAU * b[2] * t + b[3]).sin()
                };
                bursts.iter().map(one).sum::<f64>()
            };
            let frequencies = bursts.iter().map(|b| b[2]).collect();
            on_reading("odd_bursts", (0..n).map(value).collect(), frequencies)
        }
    }
}

/// A smooth random course over [0, 1] that changes sign a dozen times or more.
fn smooth(random: &mut Random) -> impl Fn(f64) -> f64 + use<> {
    let waves: Vec<(f64, f64, f64)> = (0..24)
        .map(|_| (random.normal() / 4.0, random.between(0.0, 30.0), random.between(0.0, TAU)))
        .collect();
    move |u| waves.iter().map(|(a, k, p)| a * (TAU * k * u + p).sin()).sum()
}

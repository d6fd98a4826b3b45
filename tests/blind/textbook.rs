//! The harness's own textbook: what each named family could at best explain of a given misfit, by least squares.
//!
//! It certifies that an odd effect is odd, and finds the names and places that a recording cannot tell from the truth.

use std::f64::consts::TAU;

use nalgebra::DVector;

use super::body::across;
use super::effect::{Place, all_places, moments};
use super::shape::legendre;
use super::track::JointTrack;
use super::world::{Answers, Instrument};

/// A family at a place and the share of a misfit that it explains at its best nonlinear parameters.
#[derive(Clone, Debug)]
pub struct Share {
    pub name: &'static str,
    pub place: Place,
    pub share: f64,
}

/// Nonlinear parameters that are tried beside the grids: frequencies, and what a case knows of its own effect.
#[derive(Clone, Debug, Default)]
pub struct Hints {
    pub frequencies: Vec<f64>,
    /// Names and values as in an effect's coefficients: `period`, `decay`, `take_up`, `at_time`, `time_constant`.
    pub known: Vec<(&'static str, f64)>,
}

impl Hints {
    /// A grid with the known values of this name.
    fn with(&self, name: &str, grid: &[f64]) -> Vec<f64> {
        let known = self.known.iter().filter(|(n, _)| *n == name).map(|(_, v)| *v);
        grid.iter().copied().chain(known).collect()
    }
}

/// Shares of all families, largest first. `y`: the misfit beyond geometry, in units of the noise.
pub fn shares(answers: &Answers, y: &DVector<f64>, hints: &Hints) -> Vec<Share> {
    ranked(answers, y, hints).into_iter().map(|(share, _)| share).collect()
}

/// The same, each with the columns that explain so much.
pub fn ranked(answers: &Answers, y: &DVector<f64>, hints: &Hints) -> Vec<(Share, Vec<DVector<f64>>)> {
    let track = &answers.world.track;
    let places = all_places(&answers.world.body, track);
    let best_of = |name, place| {
        let mut best = (Share { name, place, share: 0.0 }, Vec::new());
        for columns in candidates(answers, name, place, hints) {
            let share = answers.share(y, &columns);
            if share > best.0.share {
                best = (Share { name, place, share }, columns);
            }
        }
        best
    };
    let mut all: Vec<_> = places.into_iter().map(|(name, place)| best_of(name, place)).collect();
    all.sort_by(|a, b| b.0.share.total_cmp(&a.0.share));
    all
}

/// Sets of columns, one set for each choice of nonlinear parameters.
fn candidates(answers: &Answers, name: &str, place: Place, hints: &Hints) -> Vec<Vec<DVector<f64>>> {
    match place {
        Place::Joint(j) => on_joint(answers, name, j, hints),
        Place::Frame(j) => on_frame(answers, name, j, hints),
        Place::Measurement => on_measurement(answers, name, &hints.frequencies),
    }
}

fn on_joint(answers: &Answers, name: &str, j: usize, hints: &Hints) -> Vec<Vec<DVector<f64>>> {
    let world = answers.world;
    let (Some(t), Some(axis)) = (&world.track.joints[j], &world.body.links[j].joint) else { return vec![] };
    let one = |f: &dyn Fn(usize) -> f64| answers.joint(j, f);
    let unit: f64 = if axis.revolute { 1f64.to_radians() } else { 1e-3 };
    let x = |k: usize| 2.0 * t.share(k) - 1.0;
    match name {
        "backlash" => vec![vec![one(&|k| t.direction[k])]],
        "scale_error" => vec![vec![one(&|k| t.q[k])]],
        "servo_lag" => vec![vec![one(&|k| t.v[k])]],
        "inertial_error" => vec![vec![one(&|k| t.a[k])]],
        "positioning_error" => vec![(1..=5).map(|d| one(&|k| legendre(d, x(k)))).collect()],
        "encoder_eccentricity" => vec![vec![one(&|k| t.q[k].sin()), one(&|k| t.q[k].cos())]],
        "hysteresis" => hints
            .with("take_up", &[1.0, 1.5, 2.2, 3.3, 5.0].map(|l| l * unit))
            .iter()
            .map(|l| {
                let play = taken_up(t, *l);
                vec![one(&|k| play[k])]
            })
            .collect(),
        "reversal_spike" => hints
            .with("decay", &[0.4, 0.65, 1.0, 1.5, 2.2, 3.2].map(|l| l * unit))
            .iter()
            .map(|l| {
                let fade = |k: usize| if t.since[k].is_finite() { (-t.since[k] / l).exp() } else { 0.0 };
                vec![one(&|k| t.direction[k] * fade(k))]
            })
            .collect(),
        "cyclic_error" => hints
            .with("period", &periods(t, axis.revolute))
            .into_iter()
            .map(|p| vec![one(&|k| (TAU * t.q[k] / p).sin()), one(&|k| (TAU * t.q[k] / p).cos())])
            .collect(),
        "local_defect" => {
            let mut sets = Vec::new();
            for width in [0.015, 0.03, 0.05] {
                let count = (0.8 / width) as usize;
                for i in 0..=count {
                    let at = 0.1 + 0.8 * i as f64 / count as f64;
                    sets.push(vec![one(&|k| (-0.5 * ((t.share(k) - at) / width).powi(2)).exp())]);
                }
            }
            sets
        }
        "straightness" | "angular_error" => {
            let [u, v] = across(axis.n);
            let straight = name == "straightness";
            let directions = if straight { vec![u, v] } else { vec![u, v, axis.n] };
            let degrees = if straight { 2..=4 } else { 1..=4 };
            let column = |n: [f64; 3], d: usize| {
                answers.after(j, |k| {
                    let c = n.map(|e| e * legendre(d, x(k)));
                    if straight {
                        [c[0], c[1], c[2], 0.0, 0.0, 0.0]
                    } else {
                        [0.0, 0.0, 0.0, c[0], c[1], c[2]]
                    }
                })
            };
            vec![
                directions
                    .iter()
                    .flat_map(|n| degrees.clone().map(move |d| (*n, d)))
                    .map(|(n, d)| column(n, d))
                    .collect(),
            ]
        }
        "direction_dependent_pose" => {
            let column = |c: usize| {
                answers.before(j, |k| {
                    let mut e = [0.0; 6];
                    e[c] = t.direction[k] * 1e-3;
                    e
                })
            };
            vec![(0..6).map(column).collect()]
        }
        "axis_wobble" | "radial_runout" => {
            let [u, v] = across(axis.n);
            let wobble = name == "axis_wobble";
            let sets: Vec<Vec<[f64; 3]>> =
                if wobble { vec![vec![u, v]] } else { vec![vec![u, v], vec![axis.n]] };
            let orders = if wobble { 1..=3 } else { 1..=4 };
            let column = |n: [f64; 3], order: usize, phase: f64| {
                answers.before(j, |k| {
                    let c = n.map(|e| e * (order as f64 * t.q[k] + phase).cos());
                    if wobble { [0.0, 0.0, 0.0, c[0], c[1], c[2]] } else { [c[0], c[1], c[2], 0.0, 0.0, 0.0] }
                })
            };
            let mut all = Vec::new();
            for set in &sets {
                for order in orders.clone() {
                    all.push(
                        set.iter()
                            .flat_map(|n| [column(*n, order, 0.0), column(*n, order, TAU / 4.0)])
                            .collect(),
                    );
                }
            }
            all
        }
        "gravity_compliance" => {
            let loads = |_| {
                let mut all = vec![(1.0, [0.0; 3])];
                all.extend([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|c| (1.0, c)));
                all
            };
            let moments = moments(j, &world.body, &world.track, &loads);
            vec![(0..4).map(|c| one(&|k| moments[k][c])).collect()]
        }
        _ => vec![],
    }
}

fn on_frame(answers: &Answers, name: &str, j: usize, hints: &Hints) -> Vec<Vec<DVector<f64>>> {
    let track = &answers.world.track;
    let (from, seen) = (track.time[0], track.seen_s());
    let columns = |f: &dyn Fn(f64) -> f64| -> Vec<DVector<f64>> {
        let column = |c: usize| {
            answers.before(j, |k| {
                let mut e = [0.0; 6];
                e[c] = f(track.time[k] - from) * 1e-3;
                e
            })
        };
        (0..6).map(column).collect()
    };
    if name == "thermal_drift" {
        return hints
            .with("time_constant", &[0.15, 0.3, 0.6, 1.2].map(|share| share * seen))
            .iter()
            .map(|constant| columns(&|t| 1.0 - (-t / constant).exp()))
            .collect();
    }
    let moments: Vec<f64> = (1..24).map(|i| from + seen * f64::from(i) / 24.0).collect();
    hints
        .with("at_time", &moments)
        .iter()
        .map(|at| columns(&|t| if t + from < *at { 0.0 } else { 1.0 }))
        .collect()
}

fn on_measurement(answers: &Answers, name: &str, frequencies: &[f64]) -> Vec<Vec<DVector<f64>>> {
    let world = answers.world;
    let track = &world.track;
    let parts: Vec<[f64; 3]> = match world.instrument {
        Instrument::Position | Instrument::Pose => vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        _ => vec![[1.0, 0.0, 0.0]],
    };
    let each = |fs: &[&dyn Fn(usize) -> f64]| -> Vec<DVector<f64>> {
        parts.iter().flat_map(|p| fs.iter().map(move |f| answers.reading(*p, f))).collect()
    };
    match name {
        "sensor_drift" => vec![each(&[
            &|k| legendre(1, 2.0 * track.age(k) - 1.0),
            &|k| legendre(2, 2.0 * track.age(k) - 1.0),
            &|k| legendre(3, 2.0 * track.age(k) - 1.0),
        ])],
        "latency" if matches!(world.instrument, Instrument::Distance { .. }) => vec![],
        "latency" => vec![vec![answers.late()]],
        "vibration" => frequencies
            .iter()
            .map(|f| each(&[&|k| (TAU * f * track.time[k]).sin(), &|k| (TAU * f * track.time[k]).cos()]))
            .collect(),
        _ => vec![],
    }
}

/// Lost motion taken up over `length`.
fn taken_up(t: &JointTrack, length: f64) -> Vec<f64> {
    let mut z = t.direction[0];
    let follow = |k: usize| {
        z = t.direction[k] + (z - t.direction[k]) * (-t.step[k].abs() / length).exp();
        z
    };
    (0..t.q.len()).map(follow).collect()
}

/// Periods fine enough not to miss one over the travel seen.
fn periods(t: &JointTrack, revolute: bool) -> Vec<f64> {
    let (fewest, most, travel) = if revolute { (24.0, 90.0, TAU) } else { (50.0, 200.0, 1.0) };
    // Waves in a whole turn, or in a metre.
    let step = (0.35 * travel / t.span().max(1e-9)).min(1.0);
    let count = ((most - fewest) / step).ceil() as usize;
    (0..=count).map(|i| travel / (fewest + (most - fewest) * i as f64 / count.max(1) as f64)).collect()
}

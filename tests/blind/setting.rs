//! Which machine, which instrument, which tests: everything of a case but its secret.

use super::body::Body;
use super::path::{self, Ease, Follower, Run, Target};
use super::random::Random;
use super::track::Track;
use super::world::{Instrument, World};

/// What kind of tests a machine can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    /// Three linear axes that follow two or more rotary ones.
    Five,
    /// Three linear axes and one rotary.
    Four,
    Three,
    Single,
    Arm,
}

fn class(body: &Body) -> Class {
    let rotary = body.revolute.iter().filter(|r| **r).count();
    match (Follower::new(body).is_some(), rotary, body.commands.len()) {
        (true, 0, _) => Class::Three,
        (true, 1, _) => Class::Four,
        (true, _, _) => Class::Five,
        (false, _, 1) => Class::Single,
        _ => Class::Arm,
    }
}

/// Classes and how often each is drawn.
const CLASSES: [(Class, f64); 5] = [
    (Class::Five, 0.56),
    (Class::Four, 0.05),
    (Class::Three, 0.12),
    (Class::Single, 0.06),
    (Class::Arm, 0.21),
];

/// Draws a setting; `None` if a path left the travel.
pub fn draw(machines: &[kincal::Machine], random: &mut Random) -> Option<World> {
    let (wanted, _) = CLASSES[random.weighted(&CLASSES.map(|c| c.1))];
    let bodies: Vec<Body> = machines.iter().map(Body::of).filter(|b| class(b) == wanted).collect();
    if bodies.is_empty() {
        return None;
    }
    let body = random.pick(&bodies).clone();
    match wanted {
        Class::Arm => arm(body, random),
        Class::Single => single(body, random),
        _ => following(body, random),
    }
}

fn world(body: Body, instrument: Instrument, sigma: (f64, f64), runs: Vec<Run>) -> World {
    let track = Track::of(&body, &runs);
    World { body, instrument, tool_point: [0.0; 3], workpiece_point: [0.0; 3], sigma, runs, track }
}

/// The clock after a run and a pause.
fn after(run: &Run, random: &mut Random) -> f64 {
    run.time.last().copied().unwrap_or(0.0) + random.between(20.0, 90.0)
}

fn following(body: Body, random: &mut Random) -> Option<World> {
    let follower = Follower::new(&body)?;
    let bar = random.chance(0.8);
    let instrument = if bar { Instrument::Distance { absolute: false } } else { Instrument::Position };
    let sigma = if bar { random.between(3e-7, 1e-6) } else { random.between(5e-7, 1.5e-6) };
    let windows = path::windows(&body, random);
    let dt = *random.pick(&[0.01, 0.016, 0.02]);
    let skip_dwell = random.chance(0.7);
    let rotary: Vec<usize> = (0..body.commands.len()).filter(|c| body.revolute[*c]).collect();
    let all_round: Vec<usize> = rotary.iter().copied().filter(|c| windows[*c].2).collect();
    let partly: Vec<usize> = rotary.iter().copied().filter(|c| !windows[*c].2).collect();
    let mut tests: Vec<&str> = match rotary.len() {
        0 if bar => vec!["xy", "yz", "zx"],
        0 => vec!["wander", "wander"],
        _ => {
            let mut tests = vec!["weave"];
            if !all_round.is_empty() {
                tests.push("spin");
            }
            if !partly.is_empty() {
                tests.push("tilt");
            }
            if !all_round.is_empty() && !partly.is_empty() {
                tests.push("cone");
            }
            let keep = 2 + random.below(2);
            while tests.len() > keep {
                // Two tests or three; a weave is always among the first of a pair.
                tests.remove(random.below(tests.len()));
            }
            tests
        }
    };
    for i in (1..tests.len()).rev() {
        tests.swap(i, random.below(i + 1));
    }
    let judge = if rotary.is_empty() {
        if bar { *random.pick(&["xy", "yz", "zx"]) } else { "wander" }
    } else {
        "weave"
    };
    let judge_at = tests.len();
    tests.push(judge);
    let mut runs: Vec<Run> = Vec::new();
    let mut clock = 0.0;
    for (i, test) in tests.iter().enumerate() {
        let length = if i == judge_at { 0.12 } else { *random.pick(&[0.1, 0.15]) };
        let target = if bar {
            Target::Bar(length)
        } else {
            Target::Nest([
                random.between(-0.09, 0.09),
                random.between(-0.09, 0.09),
                random.between(0.0, 0.08),
            ])
        };
        // A path that leaves the travel is drawn again a few times before the whole setting is.
        let mut done = None;
        for _ in 0..6 {
            let plane = |a: usize, b: usize, random: &mut Random| {
                path::circles(&follower, (a, b), length, [0.0; 3], random)
            };
            let legs = match *test {
                "xy" => plane(0, 1, random),
                "yz" => plane(1, 2, random),
                "zx" => plane(2, 0, random),
                "wander" => {
                    let ranges = body.travel.iter().map(|(a, b)| (a.max(-0.25), b.min(0.25))).collect();
                    path::sweep(ranges, 10, random)
                }
                "spin" => path::turn(&follower, &windows, target, *random.pick(&all_round), None, random),
                "tilt" => path::turn(&follower, &windows, target, *random.pick(&partly), None, random),
                "cone" => {
                    let (turning, swing) = (*random.pick(&all_round), *random.pick(&partly));
                    path::turn(&follower, &windows, target, turning, Some(swing), random)
                }
                _ => path::weave(&follower, &windows, target, random),
            };
            done = path::run(&body, &legs, clock, dt, Ease::any(random), skip_dwell, random);
            if done.is_some() {
                break;
            }
        }
        let mut run = done?;
        run.test = (*test).into();
        run.length = length;
        clock = after(&run, random);
        if i + 1 == judge_at {
            clock += 30.0;
        }
        runs.push(run);
    }
    Some(world(body, instrument, (sigma, 1e-6), runs))
}

/// Where an arm moves in its joints: away from their ends, not more than most of a turn.
fn arm_ranges(body: &Body) -> Vec<(f64, f64)> {
    body.travel
        .iter()
        .map(|(low, high)| {
            let (low, high) = (low.max(-1e3), high.min(1e3));
            let middle = (low + high) / 2.0;
            let half = ((high - low) / 2.0 * 0.9).min(2.7);
            (middle - half, middle + half)
        })
        .collect()
}

fn arm(body: Body, random: &mut Random) -> Option<World> {
    let ranges = arm_ranges(&body);
    let (instrument, sigma_m) = match random.below(10) {
        0 => (Instrument::Distance { absolute: true }, random.between(1e-5, 2.5e-5)),
        1 | 2 => (Instrument::Pose, random.between(1e-5, 2.5e-5)),
        _ => (Instrument::Position, random.between(1e-5, 2.5e-5)),
    };
    let sigma = (sigma_m, random.between(2e-5, 6e-5));
    let mut runs = Vec::new();
    if random.chance(0.7) {
        let every = random.between(5.0, 8.0);
        let count = 450 + random.below(300);
        runs.push(path::poses(&ranges, count, 0.0, every, random));
        let clock = after(&runs[0], random);
        runs.push(path::poses(&ranges, 200, clock, every, random));
    } else {
        let dt = *random.pick(&[0.02, 0.04]);
        let mut clock = 0.0;
        let skip_dwell = random.chance(0.5);
        for _ in 0..2 + random.below(2) {
            let legs = path::sweep(ranges.clone(), 12, random);
            let mut run = path::run(&body, &legs, clock, dt, Ease::any(random), skip_dwell, random)?;
            run.test = "sweep".into();
            clock = after(&run, random);
            runs.push(run);
        }
    }
    let mut world = world(body, instrument, sigma, runs);
    let reach = |random: &mut Random, by: f64| {
        let d = random.direction();
        d.map(|x| x * random.between(0.3, 1.0) * by)
    };
    if random.chance(0.5) {
        world.tool_point = reach(random, 0.12);
    }
    if matches!(instrument, Instrument::Distance { .. }) {
        // A draw-wire from a hook beside the arm, out of its reach.
        let mut hook = random.direction();
        hook[2] = hook[2].abs() * 0.5;
        world.workpiece_point = hook.map(|x| x * 4.0);
    }
    Some(world)
}

fn single(body: Body, random: &mut Random) -> Option<World> {
    let turning = body.revolute[0];
    let j = body.links.iter().position(|l| l.joint.is_some())?;
    let range = if turning {
        (-random.between(1.5, 6.0), random.between(1.5, 6.0))
    } else {
        let from = random.between(-0.4, 0.0);
        (from, from + random.between(0.3, 0.8))
    };
    let on_axis =
        |random: &mut Random| if random.chance(0.6) { Instrument::Joint(j) } else { Instrument::Position };
    let instrument = match (turning, random.chance(0.3)) {
        (false, true) => Instrument::Displacement(body.links[j].joint.as_ref()?.n),
        _ => on_axis(random),
    };
    let sigma = (random.between(3e-7, 1e-6), random.between(5e-7, 3e-6));
    let mut runs: Vec<Run> = Vec::new();
    let mut clock = 0.0;
    let steps = random.chance(0.3);
    let dt = *random.pick(&[0.01, 0.02]);
    let skip_dwell = random.chance(0.5);
    for i in 0..3 {
        let mut run = if steps {
            let cycles = if i == 2 { 1 } else { 3 };
            path::steps(range, 40 + random.below(60), cycles, clock, random.between(3.0, 5.0), random)
        } else {
            let legs = path::sweep(vec![range], 8, random);
            path::run(&body, &legs, clock, dt, Ease::any(random), skip_dwell, random)?
        };
        run.test = if steps { "steps" } else { "strokes" }.into();
        clock = after(&run, random);
        runs.push(run);
    }
    let mut world = world(body, instrument, sigma, runs);
    if turning && instrument == Instrument::Position {
        world.tool_point = [random.between(0.08, 0.2), random.between(-0.02, 0.02), random.between(0.0, 0.1)];
    }
    Some(world)
}

//! The machine and the tests whose traces are drawn.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use kincal::Machine;
use kincal::effects::RecordingFacts;
use kincal::lie::Vec3;
use kincal::machine::JointKind;
use kincal::recording::Recording;
use kincal::simulate::{
    At, Balls, Course, Figure, Pace, Pointing, Rounding, Sense, Turning, Turns, plane_of_axes, rest,
};

/// A five-axis machine with a table that tilts, with masses, so that no family lacks what it asks for.
const MACHINE: &str = r#"Machine(
    name: "five_axes", units: (length: mm, angle: deg),
    workpiece: [
        (frame: "a", joint: Revolute(axis: "x", travel: (-400, 400)), mass: 80, centre_of_mass: (0, 25, -40)),
        (frame: "c", at: (0, 0, 40), joint: Revolute(axis: "z", travel: (-800, 800)), mass: 40, centre_of_mass: (15, 0, 30)),
        (frame: "w", at: (0, 0, 60)),
    ],
    tool: [
        (frame: "y", at: (0, 0, 100), joint: Prismatic(axis: "y", travel: (-600, 600)), mass: 300, centre_of_mass: (0, 80, 300)),
        (frame: "x", joint: Prismatic(axis: "x", travel: (-600, 600)), mass: 150, centre_of_mass: (0, -60, 250)),
        (frame: "z", joint: Prismatic(axis: "z", travel: (-600, 600)), mass: 90, centre_of_mass: (40, -150, 200)),
        (frame: "t"),
    ],
)"#;

/// Feed, m/s, acceleration of a turn, rad/s², and samples of a turn.
const FEED: f64 = 1.0 / 60.0;
const ACCELERATION: f64 = 0.3;
const PER_TURN: f64 = 360.0;

/// How the readings of a scene are drawn.
#[derive(Clone, Copy, PartialEq)]
pub enum Drawing {
    /// About the circle, by the angle of the path.
    Polar,
    /// Over where the axis stands, in mm.
    Along,
}

/// A test with its recordings, drawn over `angle` (rad, or mm along an axis).
pub struct Scene {
    pub name: &'static str,
    /// What ran, in a few words.
    pub says: &'static str,
    pub machine: Machine,
    pub recordings: Vec<Recording>,
    pub facts: RecordingFacts,
    pub drawing: Drawing,
    pub angle: Vec<f64>,
    /// Number of the pass, and whether it runs in the positive sense.
    pub pass: Vec<(usize, bool)>,
}

fn machine() -> Machine {
    Machine::parse("five_axes.ron", MACHINE).unwrap_or_else(|e| panic!("{e}"))
}

/// Every scene, those first in which a family is looked for first.
pub fn all() -> Vec<Scene> {
    let machine = machine();
    let held = rest(&machine);
    let plane_w = plane_of_axes(&machine, ["x", "y"], &held).unwrap_or_else(|e| panic!("{e}"));
    let circle = Figure::Circle { plane_w, tool_axis_w: Vec3([0.0, 0.0, 1.0]) };
    let on_table = Balls { workpiece_point_w: Vec3([0.0; 3]), tool_point_t: Vec3([0.0; 3]), length: 0.15 };
    // A circle whose centre is not the middle of anything.
    let aside = Balls { workpiece_point_w: Vec3([0.09, 0.03, 0.0]), ..on_table.clone() };
    let mut scenes = vec![
        scene(
            "circle",
            "a circle of 150 mm in the plane X Y at 1000 mm/min",
            &circle,
            &aside,
            &[FEED],
            (1, 0.0),
        ),
        scene(
            "two feeds",
            "a circle of 150 mm in the plane X Y at 1000 and 4000 mm/min",
            &circle,
            &aside,
            &[FEED, 4.0 * FEED],
            (1, 0.0),
        ),
        scene(
            "an hour",
            "a circle of 150 mm in the plane X Y every 15 min for an hour, from cold",
            &circle,
            &aside,
            &[FEED],
            (4, 900.0),
        ),
        scene(
            "a day",
            "a circle of 150 mm in the plane X Y every 3 h for a day",
            &circle,
            &aside,
            &[FEED],
            (8, 10_800.0),
        ),
        two_setups(&circle, &aside),
    ];
    for (name, axis) in [("c", 1), ("a", 0)] {
        for (pointing, how) in
            [(Pointing::Radial, "radial"), (Pointing::Tangential, "tangential"), (Pointing::Axial, "axial")]
        {
            let figure = Figure::Rotary { command: axis, pointing, turns: true };
            let balls = Balls { workpiece_point_w: Vec3([0.12, 0.0, 0.05]), length: 0.1, ..on_table.clone() };
            let says: &'static str = match (name, how) {
                ("c", "radial") => "a turn of C, the bar pointing away from the axis",
                ("c", "tangential") => "a turn of C, the bar along the motion",
                ("c", _) => "a turn of C, the bar along the axis",
                (_, "radial") => "a turn of A, the bar pointing away from the axis",
                (_, "tangential") => "a turn of A, the bar along the motion",
                _ => "a turn of A, the bar along the axis",
            };
            let balls = match name {
                "a" => Balls { workpiece_point_w: Vec3([0.12, 0.0, 0.1]), ..balls },
                _ => balls,
            };
            let called: &'static str = if name == "c" { "turn of c" } else { "turn of a" };
            scenes.push(scene(called, says, &figure, &balls, &[FEED], (1, 0.0)));
        }
    }
    let cone = Balls { workpiece_point_w: Vec3([0.05, 0.02, 0.0]), length: 0.1, ..on_table };
    scenes.push(scene(
        "cone",
        "a cone of ISO 10791-6 with all five axes (BK4)",
        &Figure::cone(),
        &cone,
        &[FEED],
        (1, 0.0),
    ));
    scenes.push(straight());
    scenes
}

/// One of the tests: both senses at each feed, so often, at such intervals (s).
fn scene(
    name: &'static str,
    says: &'static str,
    figure: &Figure,
    balls: &Balls,
    feeds: &[f64],
    (rounds, apart): (usize, f64),
) -> Scene {
    let machine = machine();
    let radius = balls.length;
    let pace = |feed: &f64| Pace::Feed { speed: feed / radius, acceleration: ACCELERATION, jerk: None };
    let turns = Turns {
        from: 0.0,
        to: TAU,
        senses: vec![Sense::Positive, Sense::Negative],
        parts: 1,
        repeat: 1,
        overshoot: 0.2,
        dwell: 1.0,
        paces: feeds.iter().map(pace).collect(),
    };
    let per_turn = if rounds > 1 { 0.3 * PER_TURN } else { PER_TURN };
    let rate = per_turn * feeds[0] / radius / TAU;
    let held = rest(&machine);
    let course =
        Turning::new(&machine, figure.clone(), balls.clone(), &held, turns.legs(), rate, Rounding::default())
            .unwrap_or_else(|e| panic!("{name}: {e}"));
    let samples =
        || course.samples().unwrap_or_else(|e| panic!("{e}")).map(|s| s.unwrap_or_else(|e| panic!("{e}")));
    let (mut rows, mut angle, mut pass) = (Vec::new(), Vec::new(), Vec::new());
    for round in 0..rounds {
        let mut last: Option<(f64, bool)> = None;
        let mut passes = 0;
        for sample in samples() {
            let At::Turn(u) = sample.at else { continue };
            let positive = match last {
                Some((before, way)) if u == before => way,
                Some((before, _)) => u > before,
                None => true,
            };
            if last.is_some_and(|(_, way)| way != positive) {
                passes += 1;
            }
            last = Some((u, positive));
            if sample.recorded {
                rows.push((sample.time + round as f64 * apart, sample.q));
                angle.push(u);
                pass.push((2 * feeds.len() * round + passes, positive));
            }
        }
    }
    let head = "# measurement: distance\n".to_string() + &points(balls);
    let recordings = vec![recording("test.csv", &machine, &head, "d[m]", &rows)];
    finished(Scene {
        name,
        says,
        facts: nothing(&machine, &recordings),
        machine,
        recordings,
        drawing: Drawing::Polar,
        angle,
        pass,
    })
}

/// The circle in two set-ups, the second after the machine was switched on anew.
fn two_setups(figure: &Figure, balls: &Balls) -> Scene {
    let one = scene(
        "two set-ups",
        "a circle of 150 mm in the plane X Y in two set-ups",
        figure,
        balls,
        &[FEED],
        (1, 0.0),
    );
    let rows = rows_of(&one);
    let setup = |name: &str, later: f64| {
        let rows: Vec<_> = rows.iter().map(|(t, q)| (t + later, q.clone())).collect();
        let head = format!("# measurement: distance\n# setup: {name}\n{}", points(balls));
        recording(&format!("{name}.csv"), &one.machine, &head, "d[m]", &rows)
    };
    let recordings = vec![setup("one", 0.0), setup("two", 3600.0)];
    let again = one.pass.iter().map(|(pass, positive)| (pass + 2, *positive));
    finished(Scene {
        facts: nothing(&one.machine, &recordings),
        recordings,
        angle: one.angle.repeat(2),
        pass: one.pass.iter().copied().chain(again).collect(),
        ..one
    })
}

/// X there and back, a laser along it: what a ballbar cannot see, since the bar keeps its length.
fn straight() -> Scene {
    let machine = machine();
    let x = machine.commands().iter().position(|name| name == "x").expect("an axis");
    let (mut rows, mut angle, mut pass) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..=240 {
        let u = f64::from(k) / 240.0;
        let mut q = rest(&machine);
        q[x] = -0.15 * (TAU * u).cos();
        angle.push(q[x] * 1e3);
        pass.push((usize::from(u > 0.5), u <= 0.5));
        rows.push((60.0 * u, q));
    }
    let recordings = vec![recording("x.csv", &machine, "# measurement: joint\n", "x_meas[m]", &rows)];
    finished(Scene {
        name: "along x",
        says: "X there and back within a minute, read by a laser; the trace of a ballbar shows none of it, since the bar keeps its length however late it is read",
        facts: nothing(&machine, &recordings),
        machine,
        recordings,
        drawing: Drawing::Along,
        angle,
        pass,
    })
}

fn nothing(machine: &Machine, recordings: &[Recording]) -> RecordingFacts {
    RecordingFacts::of(machine, recordings).unwrap_or_else(|e| panic!("{e}"))
}

fn finished(scene: Scene) -> Scene {
    assert_eq!(scene.angle.len() as f64, scene.facts.samples, "{}", scene.name);
    scene
}

fn points(balls: &Balls) -> String {
    let [x, y, z] = balls.workpiece_point_w.0;
    format!("# nominal_length[m]: {}\n# workpiece_point[m]: {x},{y},{z}\n", balls.length)
}

type Rows = Vec<(f64, Vec<f64>)>;

fn rows_of(scene: &Scene) -> Rows {
    let commands = scene.machine.commands().len();
    let chunks = scene.recordings[0].chunks().unwrap_or_else(|e| panic!("{e}"));
    let mut rows = Vec::new();
    for chunk in chunks {
        let chunk = chunk.unwrap_or_else(|e| panic!("{e}"));
        let times = chunk.time.as_ref().expect("times");
        rows.extend(times.iter().copied().zip(chunk.commands.chunks_exact(commands).map(<[f64]>::to_vec)));
    }
    rows
}

/// A recording without errors, with every channel that families ask for.
fn recording(name: &str, machine: &Machine, head: &str, measured: &str, rows: &Rows) -> Recording {
    let mut text = format!("# machine: {}\n{head}t[s]", machine.name());
    for (c, command) in machine.commands().iter().enumerate() {
        let unit = if machine.command_joint(c).kind == JointKind::Prismatic { "m" } else { "rad" };
        let _ = write!(text, ",{command}[{unit}]");
    }
    text.push_str(",temperature[degC],clamped[1],payload[N],spindle[1]");
    machine.commands().iter().for_each(|command| {
        let _ = write!(text, ",{command}_current[A]");
    });
    let _ = writeln!(text, ",{measured}");
    let (from, to) = (rows[0].0, rows[rows.len() - 1].0);
    for (k, (time, q)) in rows.iter().enumerate() {
        let u = (time - from) / (to - from);
        let _ = write!(text, "{time}");
        q.iter().for_each(|x| {
            let _ = write!(text, ",{x}");
        });
        // The shop grows warmer, the axis is clamped for a while, the spindle runs.
        let _ = write!(text, ",{},{},50,1", 20.0 + 4.0 * u, u8::from((0.6..0.75).contains(&u)));
        for (c, x) in q.iter().enumerate() {
            // Friction against the motion, and the pull of a weight.
            let gone = x - rows[k.saturating_sub(1)].1[c];
            let way = if gone == 0.0 { 0.0 } else { gone.signum() };
            let _ = write!(text, ",{}", 2.0 * way + 3.0 * x.sin());
        }
        let reading = if measured.starts_with("x_meas") {
            q[machine.commands().iter().position(|n| n == "x").expect("x")]
        } else {
            0.0
        };
        let _ = writeln!(text, ",{reading}");
    }
    Recording::from_bytes(name, text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

//! Mistakes that people make, put into simulated recordings: by the text of the file, so that nothing is shared with what looks for them.

use std::f64::consts::PI;

use kincal::identify::{CalibrateOptions, Plausibility, calibrate};
use kincal::mistakes::{Nonsense, nonsense};
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Machine};

use super::machine;
use super::random::Random;

/// What is done to the columns of a recording.
#[derive(Clone, Copy, Debug)]
pub enum Mistake {
    Times(&'static [&'static str], f64),
    Plus(&'static str, f64),
    Swapped(&'static str, &'static str),
    /// Readings stand so many rows below their commands.
    Late(usize),
    Backwards,
}
use Mistake::{Backwards, Late, Plus, Swapped, Times};

/// A mistake with what is to be said of it.
#[derive(Clone, Debug)]
pub struct Planted {
    pub machine: &'static str,
    pub measured: Sensor,
    pub mistake: Mistake,
    /// In words, for the table.
    pub what: &'static str,
    pub told: &'static str,
}

const DEGREE: f64 = PI / 180.0;
const INCH: f64 = 0.0254;
const ARM: &[&str] = &["q1", "q2", "q3", "q4", "q5", "q6", "q7"];

const fn planted(
    machine: &'static str,
    measured: Sensor,
    mistake: Mistake,
    what: &'static str,
    told: &'static str,
) -> Planted {
    Planted { machine, measured, mistake, what, told }
}

/// What people get wrong, on six machines.
pub const PLANTED: [Planted; 24] = [
    planted(
        "ac_table_tilting",
        Sensor::Position,
        Times(&["x"], -1.0),
        "x the other way round",
        "the sign of x reversed",
    ),
    planted(
        "ac_table_tilting",
        Sensor::Pose,
        Times(&["a"], -1.0),
        "A the other way round",
        "the sign of a reversed",
    ),
    planted(
        "ac_table_tilting",
        Sensor::Position,
        Times(&["a"], 1.0 / DEGREE),
        "A in degrees, called radians",
        "a read in deg instead of rad",
    ),
    planted(
        "ac_table_tilting",
        Sensor::Position,
        Swapped("x", "y"),
        "columns x and y swapped",
        "y and x swapped",
    ),
    planted(
        "bc_head_table",
        Sensor::Position,
        Times(&["b"], -1.0),
        "B the other way round",
        "the sign of b reversed",
    ),
    planted(
        "bc_head_table",
        Sensor::Pose,
        Late(1),
        "readings one row late",
        "the readings taken 1 row further down",
    ),
    planted(
        "bc_head_table",
        Sensor::Position,
        Times(&["z"], 1.0 / INCH),
        "Z in inch, called m",
        "z read in in instead of m",
    ),
    planted(
        "bc_head_table",
        Sensor::Pose,
        Plus("c", PI / 2.0),
        "zero of C off by 90 deg",
        "-90 deg added to c",
    ),
    planted(
        "bc_head_table",
        Sensor::Position,
        Swapped("b", "c"),
        "columns b and c swapped",
        "c and b swapped",
    ),
    planted(
        "kuka_iiwa14",
        Sensor::Position,
        Times(&["q3"], -1.0),
        "q3 the other way round",
        "the sign of q3 reversed",
    ),
    planted(
        "kuka_iiwa14",
        Sensor::Pose,
        Times(&["q7"], -1.0),
        "q7 the other way round",
        "the sign of q7 reversed",
    ),
    planted(
        "kuka_iiwa14",
        Sensor::Position,
        Swapped("q4", "q6"),
        "columns q4 and q6 swapped",
        "q4 and q6 swapped",
    ),
    planted(
        "kuka_iiwa14",
        Sensor::Position,
        Times(ARM, 1.0 / DEGREE),
        "all joints in degrees, called radians",
        "q1, q2, q3, q4, q5, q6, q7 read in deg instead of rad",
    ),
    planted(
        "kuka_iiwa14",
        Sensor::Pose,
        Times(&["rx", "ry", "rz"], -1.0),
        "turn of w in t instead of t in w",
        "the measured turn in the opposite sense",
    ),
    planted(
        "kuka_iiwa14",
        Sensor::Position,
        Swapped("px", "py"),
        "measured x and y swapped",
        "the measured axes x and y swapped",
    ),
    planted(
        "ur10",
        Sensor::Position,
        Backwards,
        "readings in the opposite order",
        "the readings in the opposite order",
    ),
    planted(
        "ur10",
        Sensor::Position,
        Times(&["py"], -1.0),
        "measured y the other way round",
        "the sign of measured y reversed",
    ),
    planted(
        "ur10",
        Sensor::Position,
        Plus("q2", PI / 2.0),
        "zero of q2 off by 90 deg",
        "-90 deg added to q2",
    ),
    planted(
        "ur10",
        Sensor::Position,
        Late(2),
        "readings two rows late",
        "the readings taken 2 rows further down",
    ),
    planted("puma560", Sensor::Position, Plus("q1", PI), "zero of q1 off by 180 deg", "+180 deg added to q1"),
    planted(
        "puma560",
        Sensor::Position,
        Times(&["px", "py", "pz"], 1.0 / INCH),
        "measured in inch, called m",
        "what was measured read in in instead of m",
    ),
    planted(
        "scara",
        Sensor::Position,
        Times(&["q3"], -1.0),
        "q3 the other way round",
        "the sign of q3 reversed",
    ),
    planted("scara", Sensor::Pose, Times(&["q4"], -1.0), "q4 the other way round", "the sign of q4 reversed"),
    planted("scara", Sensor::Pose, Plus("q1", -PI / 2.0), "zero of q1 off by -90 deg", "+90 deg added to q1"),
];

/// A recording of a machine with errors of this size, its tolerances being 1, by an instrument of 1 um and 5 urad.
fn text(machine: &Machine, instrument: &Instrument, size: f64, samples: usize, seed: u64) -> String {
    let deviations = random_deviations(machine, size, seed);
    let truth = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations);
    recording(&truth, instrument, &random_commands(machine, samples, seed + 1), &[], seed + 2)
}

fn read(text: &str, machine: &Machine) -> Recording {
    Recording::from_bytes("rec.csv", text.as_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

/// The text of a recording with the mistake in it.
pub fn with_mistake(text: &str, mistake: Mistake) -> String {
    let (head, rows): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with('#'));
    let names: Vec<&str> = rows[0].split(',').map(|name| name.split('[').next().expect("a name")).collect();
    let mut cells: Vec<Vec<f64>> =
        rows[1..].iter().map(|row| row.split(',').map(|x| x.parse().expect("a number")).collect()).collect();
    let at = |name: &str| names.iter().position(|own| *own == name).unwrap_or_else(|| panic!("{name}"));
    let read: Vec<usize> =
        (0..names.len()).filter(|i| ["px", "py", "pz", "rx", "ry", "rz"].contains(&names[*i])).collect();
    let before = cells.clone();
    for (k, row) in cells.iter_mut().enumerate() {
        let last = before.len() - 1;
        match mistake {
            Times(columns, factor) => columns.iter().for_each(|name| row[at(name)] *= factor),
            Plus(name, by) => row[at(name)] += by,
            Swapped(a, b) => row.swap(at(a), at(b)),
            Late(rows) => read.iter().for_each(|i| row[*i] = before[k.saturating_sub(rows)][*i]),
            Backwards => read.iter().for_each(|i| row[*i] = before[last - k][*i]),
        }
    }
    let row = |row: &Vec<f64>| row.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(",");
    let lines = head.into_iter().map(String::from).chain([rows[0].to_string()]).chain(cells.iter().map(row));
    lines.collect::<Vec<_>>().join("\n")
}

/// What is said of one.
pub fn said_of(planted: &Planted) -> Option<Nonsense> {
    let machine = machine(planted.machine);
    let instrument = Instrument::new(planted.measured.clone(), 1e-6, 5e-6);
    let text = with_mistake(&text(&machine, &instrument, 1.0, 120, 11), planted.mistake);
    nonsense(&machine, &[read(&text, &machine)], &|_| {}).unwrap_or_else(|e| panic!("{e}"))
}

/// Whether exactly this mistake was named.
pub fn is_named(planted: &Planted, said: &Option<Nonsense>) -> bool {
    said.as_ref().is_some_and(|said| matches!(&said.mistakes[..], [only] if only.what == planted.told))
}

/// Sound recordings: random errors up to three tolerances, any instrument, noise up to a tolerance, up to 10 % outliers, few samples and
/// many. Of each whether it was refused, and how near it came: the largest excess.
pub fn sound(name: &str, draw: u64) -> (Option<Nonsense>, f64) {
    let (machine, recordings) = (machine(name), [sound_recording(name, draw)]);
    let said = nonsense(&machine, &recordings, &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    let (_, fit) = calibrate(&machine, &recordings, CalibrateOptions::default()).expect("sound");
    (said, fit.plausibility.iter().map(Plausibility::excess).fold(0.0, f64::max))
}

/// One of them.
pub fn sound_recording(name: &str, draw: u64) -> Recording {
    let machine = machine(name);
    let mut random = Random::new(draw);
    let kinds = [Sensor::Position, Sensor::Pose, Sensor::Distance { absolute: true }];
    let kind = kinds[draw as usize % kinds.len()].clone();
    let tolerance = machine.default_tolerance();
    let noise = random.between(-3.0, 0.0).exp2();
    let mut instrument = Instrument::new(kind, noise * tolerance.translation, noise * tolerance.rotation);
    instrument.outliers = random.between(0.0, 0.1);
    instrument.outlier = kincal::units::ByQuantity { m: 1.0, rad: 1.0 };
    let samples = random.between(60.0, 400.0) as usize;
    let text = text(&machine, &instrument, random.between(0.0, 3.0), samples, 1000 + draw);
    read(&text, &machine)
}

/// A machine of three to seven joints in any order and direction, on either branch, with tolerances of any size.
pub fn random_machine(random: &mut Random) -> Machine {
    let mut triple = |reach: f64| {
        let [x, y, z] = std::array::from_fn(|_| random.between(-reach, reach));
        format!("({x:.3}, {y:.3}, {z:.3})")
    };
    let joint = |i: usize, at: String, rotation: String, kind: f64, axis: f64| {
        let axis = ["x", "y", "z"][axis as usize];
        let joint = match kind < 0.6 {
            true => format!("Revolute(axis: \"{axis}\", travel: (-170, 170))"),
            false => format!("Prismatic(axis: \"{axis}\", travel: (-300, 300))"),
        };
        format!("(frame: \"j{i}\", at: {at}, rotation: {rotation}, joint: {joint}),")
    };
    let places: Vec<(String, String)> = (0..7).map(|_| (triple(400.0), triple(90.0))).collect();
    let (last_w, last_t) = (triple(100.0), triple(100.0));
    let (joints, on_the_workpiece) = (random.between(3.0, 8.0) as usize, random.between(0.0, 3.0) as usize);
    let all: Vec<String> = (places.into_iter().take(joints).enumerate())
        .map(|(i, (at, turn))| joint(i, at, turn, random.between(0.0, 1.0), random.between(0.0, 3.0)))
        .collect();
    let (workpiece, tool) = all.split_at(on_the_workpiece);
    let mut size = |from: f64, to: f64| 10f64.powf(random.between(from.log10(), to.log10()));
    let (translation, rotation) = (size(0.01, 1.0), size(0.003, 0.2));
    let text = format!(
        "Machine(name: \"drawn\", units: (length: mm, angle: deg), tolerance: (translation: {translation}, rotation: {rotation}), \
         workpiece: [{} (frame: \"w\", at: {last_w})], tool: [{} (frame: \"t\", at: {last_t})])",
        workpiece.concat(),
        tool.concat()
    );
    Machine::parse("drawn.ron", &text).unwrap_or_else(|e| panic!("{e}"))
}

/// Whether a machine that is drawn, with deviations of 1 to 30 tolerances, is found to the noise; else what it was.
pub fn drawn(draw: u64) -> Result<(), String> {
    let mut random = Random::new(draw);
    let machine = random_machine(&mut random);
    let sensor = if draw.is_multiple_of(2) { Sensor::Position } else { Sensor::Pose };
    let size = 30f64.powf(random.between(0.0, 1.0));
    let text = text(&machine, &Instrument::new(sensor.clone(), 1e-6, 5e-6), size, 120, draw);
    let (_, fit) = calibrate(&machine, &[read(&text, &machine)], CalibrateOptions::default())
        .map_err(|e| format!("draw {draw}: {e}"))?;
    let left = fit.rms.m.expect("positions").geometric;
    if left < 3e-6 {
        Ok(())
    } else {
        Err(format!("draw {draw}: {sensor:?}, {size:.1} tolerances: {left:.2e} m"))
    }
}

/// RMS of positions that a calibration leaves where deviations are so many times the tolerances, m, and what is to be careful about.
pub fn far(machine: &Machine, sensor: Sensor, size: f64) -> (f64, Vec<String>) {
    let text = text(machine, &Instrument::new(sensor, 1e-6, 5e-6), size, 120, 5);
    let (_, fit) = calibrate(machine, &[read(&text, machine)], CalibrateOptions::default()).expect("sound");
    (fit.rms.m.expect("positions").geometric, fit.warnings)
}

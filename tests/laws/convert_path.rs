//! Readings that come without positions, laid beside the path that ran, give the parameters that they give with positions.

use kincal::convert::{Converted, Nominal, Request, read};
use kincal::identify::{CalibrateOptions, calibrate};
use kincal::lie::Vec3;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{
    Balls, Course, Faults, Figure, Instrument, Leg, Pace, Plant, Pointing, Rounding, Sense, Turning, Turns,
    noise_of, plane_of_axes, random_deviations, rest, usual_range,
};
use kincal::{CalibratedMachine, Machine};

use crate::common;

const LENGTH: f64 = 0.1;
const NOISE: f64 = 0.4e-6;

/// Turns there and back, with a stop between them.
fn legs((from, to): (f64, f64), senses: &[Sense], speed: f64) -> Vec<Leg> {
    let pace = Pace::Feed { speed, acceleration: 10.0 * speed, jerk: None };
    let (senses, paces) = (senses.to_vec(), vec![pace]);
    Turns { from, to, senses, parts: 1, repeat: 1, overshoot: 0.0, dwell: 0.5, paces }.legs()
}

fn course(machine: &Machine, test: &str, senses: &[Sense], rate: f64) -> Turning {
    let around = (0.0, std::f64::consts::TAU);
    let held = rest(machine);
    let command = |name: &str| machine.commands().iter().position(|c| c == name).expect("an axis");
    let rotary =
        |name: &str| Figure::Rotary { command: command(name), pointing: Pointing::Radial, turns: true };
    let (figure, range, speed) = match test {
        "circle" => {
            let plane_w = plane_of_axes(machine, ["x", "y"], &held).expect("two axes");
            (Figure::Circle { plane_w, tool_axis_w: Vec3([0.0, 0.0, -1.0]) }, around, 0.6)
        }
        "BK1" => (rotary("a"), usual_range(machine, command("a")), 0.3),
        "BK2" => (rotary("c"), around, 0.6),
        _ => (Figure::cone(), around, 0.6),
    };
    let origin = Vec3([0.0; 3]);
    let balls = Balls { workpiece_point_w: origin, tool_point_t: origin, length: LENGTH };
    let legs = legs(range, senses, speed);
    Turning::new(machine, figure, balls, &held, legs, rate, Rounding::default()).expect("within travel")
}

/// What a ballbar reads on a machine along a course, and the commands meanwhile.
fn readings(plant: &Plant, course: &Turning, seed: u64) -> (Vec<Vec<f64>>, Vec<f64>) {
    let mut instrument = Instrument::new(Sensor::Distance { absolute: false }, 0.0, 0.0);
    instrument.state.length = LENGTH;
    let all = || course.samples().expect("it starts");
    let mut state = plant.start(plant.first_directions(all()).expect("it moves"));
    let mut rng = noise_of(seed, 0);
    let sample = |sample: kincal::Result<kincal::simulate::Sample>| {
        let sample = sample.expect("within travel");
        plant.advance(&mut state, &sample);
        let read = instrument.read(plant.machine(), &state, &sample.q, &mut rng).expect("no drop-outs");
        (sample.q, read[0])
    };
    all().map(sample).unzip()
}

fn nominal(machine: &Machine, test: &str, senses: &[Sense]) -> Nominal {
    let course = course(machine, test, senses, 500.0);
    let q = course.samples().expect("it starts").map(|s| s.expect("within travel").q);
    let head = vec![format!("nominal_length[mm]: {}", 1e3 * LENGTH)];
    Nominal::new(0.002, q.collect(), head).expect("a path")
}

/// The file of a ballbar: readings alone, in um with two decimals, the bar standing before and behind.
fn ballbar(d: &[f64], before: usize, behind: usize, seed: u64) -> String {
    let mut normal = common::random::normals(seed);
    let standing = |x: f64, n: usize| std::iter::repeat_n(x, n);
    let all = standing(d[0], before).chain(d.iter().copied()).chain(standing(d[d.len() - 1], behind));
    let rows: String = all.map(|x| format!("{:.2}\n", (x + NOISE * normal()) * 1e6)).collect();
    format!("Radius deviation [um]\n{rows}")
}

fn converted(table: &str, machine: &Machine, path: Nominal, rate: Option<f64>) -> kincal::Result<Converted> {
    let request = Request::default().with_path(path);
    let request = match rate {
        Some(rate) => request.with_sample_rate(rate),
        None => request,
    };
    read("ballbar.txt", table.as_bytes(), Some(machine), &request)
}

/// The recording with the positions: the same readings as in the file of the ballbar.
fn with_positions(table: &str, q: &[Vec<f64>], before: usize, rate: f64, machine: &Machine) -> String {
    let units: Vec<&str> = (0..machine.commands().len())
        .map(|c| match machine.command_joint(c).kind {
            kincal::machine::JointKind::Prismatic => "m",
            kincal::machine::JointKind::Revolute => "rad",
        })
        .collect();
    let names: Vec<String> =
        machine.commands().iter().zip(units).map(|(name, unit)| format!("{name}[{unit}]")).collect();
    let mut text =
        format!("# measurement: distance\n# nominal_length[m]: {LENGTH}\nt[s],{},d[um]\n", names.join(","));
    for (k, (q, d)) in q.iter().zip(table.lines().skip(1 + before)).enumerate() {
        let q: Vec<String> = q.iter().map(|x| format!("{x:.12}")).collect();
        text.push_str(&format!("{:.6},{},{d}\n", k as f64 / rate, q.join(",")));
    }
    text
}

#[test]
fn readings_without_positions_give_the_parameters_that_they_give_with_them() {
    let machine = common::machine("ac_table_tilting");
    let both = [Sense::Positive, Sense::Negative];
    for (seed, test, told) in [(1, "circle", false), (2, "BK1", true), (3, "BK2", true), (4, "BK4", false)] {
        let (rate, before, behind) = (71.0 + 13.7 * seed as f64, 40 + 37 * seed as usize, 90);
        let truth = CalibratedMachine::nominal(machine.clone())
            .with_deviations(random_deviations(&machine, 1.0, seed));
        let (q, d) = readings(&Plant::new(&truth), &course(&machine, test, &both, rate), seed);
        let table = ballbar(&d, before, behind, seed);
        let known = Recording::from_bytes(
            "known.csv",
            with_positions(&table, &q, before, rate, &machine).into_bytes(),
            &machine,
        )
        .expect("a recording");
        let (expected, fit) =
            calibrate(&machine, &[known], CalibrateOptions::default()).expect("it calibrates");
        let told = told.then_some(rate);
        let found = converted(&table, &machine, nominal(&machine, test, &both), told)
            .unwrap_or_else(|e| panic!("{test}: {e}"));
        let a = found.alignment.expect("a path was told");
        let begins = a.start_s * a.sample_rate / rate - before as f64 / rate;
        assert!(begins.abs() < 5.0 * a.start_error_s, "{test}: {begins:.5} s off, {a:?}");
        assert!((a.sample_rate / rate - 1.0).abs() < 2e-3, "{test}: {a:?}");
        assert!(a.hides_m < 0.5 * NOISE && a.left_m < 1.2 * NOISE, "{test}: {a:?}");
        let text = found.recordings[0].text.clone();
        let recording =
            Recording::from_bytes("converted.csv", text.into_bytes(), &machine).expect("a recording");
        let (own, own_fit) =
            calibrate(&machine, &[recording], CalibrateOptions::default()).expect("it calibrates");
        assert_eq!(own_fit.rank, fit.rank, "{test}");
        let rms = |fit: &kincal::identify::Fit| fit.rms.m.expect("lengths").geometric;
        assert!(rms(&own_fit) < 1.05 * rms(&fit), "{test}: {} {}", rms(&own_fit), rms(&fit));
        for (a, b) in own_fit.parameters.iter().zip(&fit.parameters) {
            let (off, sigma) = ((a.value - b.value).abs(), b.std_error);
            assert!(off < 3.0 * sigma, "{test}: {} {} is {off:e} off, {sigma:e}", a.frame, a.component);
        }
        // What both foretell of the machine, without noise: the shift hides no more than it says.
        let off = |model: &CalibratedMachine| {
            let chain = model.chain();
            let one = |(q, d): (&Vec<f64>, &f64)| chain.w_from_t(q).translation.norm() - LENGTH - d;
            (q.iter().zip(&d).map(|all| one(all).powi(2)).sum::<f64>() / d.len() as f64).sqrt()
        };
        let (own, expected) = (off(&own), off(&expected));
        assert!(own < expected + 2.0 * a.hides_m, "{test}: {own:e} {expected:e}, {a:?}");
    }
}

/// A drive with play stands until it is through the gap, which takes a while where it turns round slowly: taken for a later path, that would
/// shift all of it.
#[test]
fn play_does_not_shift_the_path() {
    let machine = common::machine("xyz_mill");
    let (rate, before, both) = (101.0, 200, [Sense::Positive, Sense::Negative]);
    let play = "Faults(units: (length: um, angle: arcsec), backlash: [(joint: \"x\", width: 8)])";
    let play = Faults::parse("play.ron", play, &machine).expect("faults");
    for seed in [1, 2, 3] {
        let truth = CalibratedMachine::nominal(machine.clone())
            .with_deviations(random_deviations(&machine, 1.0, seed));
        let plant = Plant::new(&truth).with_faults(&play);
        let (_, d) = readings(&plant, &course(&machine, "circle", &both, rate), seed);
        let table = ballbar(&d, before, 200, seed);
        let path = nominal(&machine, "circle", &both);
        let found = converted(&table, &machine, path, Some(rate)).expect("a recording");
        let a = found.alignment.expect("a path was told");
        let off = [a.start_s - before as f64 / rate, a.end_s - (before + d.len() - 1) as f64 / rate];
        // Half a reading; what the alignment says of its errors does not know how wide the play is.
        assert!(off.iter().all(|off| off.abs() < 0.5 / rate), "{off:?} s off, {a:?}");
        assert!(a.left_m < 1.05 * NOISE, "{a:?}");
    }
}

#[test]
fn readings_that_no_path_can_be_laid_beside_are_told_with_the_mend() {
    let machine = common::machine("ac_table_tilting");
    let (rate, both) = (97.0, [Sense::Positive, Sense::Negative]);
    let run = |truth: &CalibratedMachine, test: &str, senses: &[Sense]| {
        ballbar(&readings(&Plant::new(truth), &course(&machine, test, senses, rate), 3).1, 50, 50, 3)
    };
    let sound = CalibratedMachine::nominal(machine.clone());
    let off = sound.clone().with_deviations(random_deviations(&machine, 1.0, 3));
    let good = run(&off, "BK4", &both);
    let cut = |lines: usize| good.lines().take(lines).map(|line| format!("{line}\n")).collect::<String>();
    let constant: String = good
        .lines()
        .enumerate()
        .map(|(k, l)| if k == 0 { format!("{l}\n") } else { "1.5\n".into() })
        .collect();
    let moving: String = {
        let all = run(&off, "circle", &both[..1]);
        let count = all.lines().count();
        let inside = |k: usize| k == 0 || (70..count - 160).contains(&k);
        all.lines().enumerate().filter(|(k, _)| inside(*k)).map(|(_, line)| format!("{line}\n")).collect()
    };
    let path = |test: &str, senses: &[Sense]| nominal(&machine, test, senses);
    let unknown = {
        let mut path = path("BK4", &both);
        path = Nominal::new(
            0.002,
            (0..2000).map(|k| path.at(0.02 * f64::from(k))).collect(),
            vec!["nominal_length[mm]: 100".into(), "workpiece_frame: unknown".into()],
        )
        .expect("a path");
        path
    };
    let mut said = String::new();
    for (name, table, path, rate) in [
        ("all readings alike", constant, path("BK4", &both), None),
        ("thirty readings", cut(31), path("BK4", &both), None),
        ("a third of the capture", cut(good.lines().count() / 3), path("BK4", &both), Some(rate)),
        ("a machine without errors", run(&sound, "BK4", &both), path("BK4", &both), None),
        ("one sense, without its ends", moving, path("circle", &both[..1]), None),
        ("another test", good.clone(), path("BK1", &both), Some(rate)),
        ("mm for um", good.replace("[um]", "[m]"), path("BK4", &both), Some(rate)),
        ("frame unknown", good.clone(), unknown, None),
    ] {
        let error = match converted(&table, &machine, path, rate) {
            Ok(found) => panic!("{name}: {:?}", found.alignment),
            Err(error) => error,
        };
        said.push_str(&format!("{name}\n  {error}\n  = {}\n", error.mend()));
    }
    insta::assert_snapshot!(said);
}

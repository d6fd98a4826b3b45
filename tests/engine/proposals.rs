//! What has no name gets a law: put together from the library's own terms, written as a family, found again on other recordings.

use crate::common;
use crate::common::random::Random;
use kincal::diagnose::{DiagnoseOptions, diagnose};
use kincal::effects::Library;
use kincal::lie::Vec3;
use kincal::recording::Recording;
use kincal::{Chain, Machine};
use std::f64::consts::TAU;

/// Noise of the instrument, m.
const SIGMA: f64 = 0.5e-6;
/// Rates of a path, rad/s.
const SEEN: [f64; 3] = [0.31, 0.23, 0.17];

/// What an axis has besides its command, m: of x where it stands and how it accelerates; of z where it stands; of the first component of the
/// reading the time, s; by how much the reading is late, s.
struct Wrong {
    x: fn(f64, f64) -> f64,
    z: fn(f64) -> f64,
    read: fn(f64) -> f64,
    late: f64,
}

const NOTHING: Wrong = Wrong { x: |_, _| 0.0, z: |_| 0.0, read: |_| 0.0, late: 0.0 };
const YIELDS: Wrong = Wrong { x: |_, acceleration| 1e-3 * acceleration, ..NOTHING };
const WARMS_UP: Wrong = Wrong { read: |t| 6e-6 * (1.0 - (-t / 60.0).exp()), ..NOTHING };
const SHAKES: Wrong = Wrong { read: |t| 1.5e-6 * (TAU * 2.3 * t).sin(), ..NOTHING };
const LATE: Wrong = Wrong { late: 1e-3, ..NOTHING };
const DENTED: Wrong = Wrong { z: |z| dent(z - 0.03), ..NOTHING };

/// 8 um over some 10 mm to either side.
fn dent(beside: f64) -> f64 {
    8e-6 * (-0.5 * (beside / 0.008).powi(2)).exp()
}

/// A ball that a mill leads to and fro at these rates, rad/s, read in all three components.
fn path(machine: &Machine, name: &str, wrong: &Wrong, [a, b, c]: [f64; 3]) -> Recording {
    let chain: Chain<f64> = Chain::nominal(machine);
    let mut random = Random::new((1e4 * a) as u64);
    let mut text = String::from(
        "# measurement: position\n# tool_point[mm]: 0, 0, 0\nt[s],x[mm],y[mm],z[mm],px[mm],py[mm],pz[mm]\n",
    );
    for k in 0..900 {
        let t = 0.1 * f64::from(k);
        // Where x, y and z are, and how x accelerates. Of one sine alone the acceleration is a scale error.
        let at_time = |t: f64| {
            let swing =
                |size: f64, rate: f64| (size * (rate * t).sin(), -size * rate * rate * (rate * t).sin());
            let (slow, fast) = (swing(0.12, a), swing(0.04, 2.7 * a));
            ([slow.0 + fast.0, 0.12 * (b * t).sin(), 0.1 * (c * t).cos()], slow.1 + fast.1)
        };
        let (q, _) = at_time(t);
        let (read, acceleration) = at_time(t - wrong.late);
        // The machine's order.
        let at = [read[1], read[0] + (wrong.x)(read[0], acceleration), read[2] + (wrong.z)(read[2])];
        let mut p = chain.w_from_t(&at).transform(Vec3([0.0; 3])).0.map(|x| x + SIGMA * random.normal());
        p[0] += (wrong.read)(t);
        let row: Vec<String> = q.iter().chain(&p).map(|x| format!("{:.6}", 1e3 * x)).collect();
        text += &format!("{t:.3},{}\n", row.join(","));
    }
    Recording::from_bytes(name, text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

/// The file of effects that is proposed, and its law; at this place.
fn proposed(
    machine: &Machine,
    recordings: &[Recording],
    library: &Library,
    at: &str,
) -> Option<(String, Vec<String>)> {
    let request = DiagnoseOptions::default().with_proposals();
    let said = diagnose(machine, recordings, library, &request, &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    let [proposal] = said.proposals.as_slice() else {
        assert!(said.proposals.is_empty(), "{:?}", said.proposals);
        return None;
    };
    assert_eq!(proposal.at, at);
    assert!(!proposal.free);
    Some((said.proposed_library().expect("a file of effects"), proposal.law.clone()))
}

/// The law that is found at a joint where this family is not known, once the file with it has been found again on another path.
fn law_found_again(family: &str, wrong: &Wrong, at: &str) -> Vec<String> {
    let (machine, library) = (common::machine("xyz_mill"), common::library_without(&[family]));
    let seen =
        [path(&machine, "seen.csv", wrong, SEEN), path(&machine, "again.csv", wrong, [0.26, 0.27, 0.15])];
    let (ron, law) = proposed(&machine, &seen, &library, at).expect("a law");
    let library = library.with_text("new.ron", &ron).unwrap_or_else(|e| panic!("{e}"));
    let other = [path(&machine, "other.csv", wrong, [0.36, 0.2, 0.19])];
    let said = diagnose(&machine, &other, &library, &DiagnoseOptions::default(), &|_| {});
    let said = said.unwrap_or_else(|e| panic!("{e}"));
    let found: Vec<_> = said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect();
    assert_eq!(found, [("proposed_1", at)]);
    law
}

#[test]
fn a_law_is_put_together_for_what_has_no_name_and_found_again_on_another_path() {
    assert_eq!(law_found_again("inertial_error", &YIELDS, "x"), ["a"]);
}

#[test]
fn the_law_of_a_short_stretch_is_one_bump() {
    assert_eq!(law_found_again("local_defect", &DENTED, "z"), ["bump((x - at)/width)"]);
}

#[test]
fn what_goes_by_the_clock_gets_a_law_too() {
    let machine = common::machine("xyz_mill");
    let law = |wrong: &Wrong, families: &[&str], at: &str| {
        let seen = [path(&machine, "seen.csv", wrong, SEEN)];
        proposed(&machine, &seen, &common::library_without(families), at).expect("a law").1
    };
    let drifts = ["thermal_drift", "sensor_drift", "setup_slip"];
    assert_eq!(law(&WARMS_UP, &drifts, "x"), ["1 - exp(-t/time_constant)"]);
    // It is as large as the noise, and goes to and fro from reading to reading as that does.
    let tone = ["sin(2π frequency t)", "cos(2π frequency t)"];
    assert_eq!(law(&SHAKES, &["vibration"], "measurement"), tone);
}

#[test]
fn readings_of_another_moment_have_one_law_for_all_joints() {
    let machine = common::machine("xyz_mill");
    let seen = [path(&machine, "seen.csv", &LATE, SEEN)];
    let library = common::library_without(&["latency", "servo_lag", "hysteresis"]);
    let (_, law) = proposed(&machine, &seen, &library, "measurement").expect("a law");
    assert_eq!(law, ["v"]);
}

#[test]
fn what_names_leave_is_modelled_beside_them() {
    let machine = common::machine("xyz_mill");
    let both = Wrong { x: YIELDS.x, ..DENTED };
    let seen = [path(&machine, "seen.csv", &both, SEEN)];
    // As it is seen on one path, a guideway may climb there.
    let library = common::library_without(&["local_defect", "positioning_error"]);
    let said = diagnose(&machine, &seen, &library, &DiagnoseOptions::default(), &|_| {});
    let said = said.unwrap_or_else(|e| panic!("{e}"));
    let found: Vec<_> = said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect();
    assert_eq!(found, [("inertial_error", "x")]);
    let parts = said.unexplained.iter().flat_map(|unexplained| &unexplained.parts);
    let at: Vec<&str> = parts.filter(|part| part.modelled).map(|part| part.at.as_str()).collect();
    assert_eq!(at, ["z"]);
    let left = said.rms.m.expect("lengths").r#final;
    // Of three components.
    assert!(left < 1.05 * 3f64.sqrt() * SIGMA, "{left}");
}

#[test]
fn nothing_is_proposed_for_what_has_a_name_or_is_not_there() {
    let machine = common::machine("xyz_mill");
    for wrong in [YIELDS, NOTHING] {
        let seen = [path(&machine, "seen.csv", &wrong, SEEN)];
        assert!(proposed(&machine, &seen, &Library::standard(), "x").is_none());
    }
}

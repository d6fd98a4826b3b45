//! Settled positions show no course, and their noise is known from what is left alone. What has no name there is modelled all the same.

use crate::common;
use crate::common::random::Random;
use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::lie::Vec3;
use kincal::recording::Recording;
use kincal::{Chain, Machine};

/// Noise of a tracker, m and rad: its angles say little.
const SIGMA: (f64, f64) = (20e-6, 60e-6);

/// What is said where the library has none of these families.
fn said(machine: &Machine, recording: Recording, without: &[&str]) -> Diagnosis {
    let library = common::library_without(without);
    let said = diagnose(machine, &[recording], &library, &DiagnoseOptions::default(), &|_| {});
    said.unwrap_or_else(|e| panic!("{e}"))
}

/// Place of each part that is modelled, and what it depends on.
fn modelled(said: &Diagnosis) -> Vec<(&str, String)> {
    let parts = said.unexplained.iter().flat_map(|unexplained| &unexplained.parts);
    parts.filter(|part| part.modelled).map(|part| (part.at.as_str(), part.depends_on.join(", "))).collect()
}

/// A rotary table that steps to and fro and is read at every step, rad; `play`: all of it.
fn steps(machine: &Machine, play: f64) -> Recording {
    let mut random = Random::new(7);
    let mut text = String::from("# measurement: joint\nt[s],c[deg],c_direction[1],c_meas[deg]\n");
    let there = (0..72).map(|k| (5.0 * f64::from(k), 1.0));
    let back = (0..72).rev().map(|k| (5.0 * f64::from(k), -1.0));
    for (k, (at, side)) in there.chain(back).cycle().take(4 * 144).enumerate() {
        let read = at.to_radians() + 0.5 * play * side + 1e-6 * random.normal();
        text += &format!("{},{at},{side},{:.8}\n", 3 * k, read.to_degrees());
    }
    Recording::from_bytes("steps.csv", text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

/// Poses of an arm, of which one frame moves aside by so much after half of them, m.
fn poses(machine: &Machine, slip: f64) -> Recording {
    let chain: Chain<f64> = Chain::nominal(machine);
    let mut random = Random::new(11);
    let mut text = String::from(
        "# measurement: pose\nt[s],q1[deg],q2[deg],q3[mm],q4[deg],px[mm],py[mm],pz[mm],rx[rad],ry[rad],rz[rad]\n",
    );
    for k in 0..400 {
        let q = [(-105.0, 105.0), (-150.0, 150.0), (0.0, 210.0), (-360.0, 360.0)]
            .map(|(from, to)| random.between(from, to));
        let at = [q[0].to_radians(), q[1].to_radians(), 1e-3 * q[2], q[3].to_radians()];
        let w_from_t = chain.w_from_t(&at);
        let along = at[0] + at[1];
        let aside = if k < 200 { 0.0 } else { slip };
        let Vec3(p) = w_from_t.transform(Vec3([0.0; 3]));
        let p = [p[0] - aside * along.sin(), p[1] + aside * along.cos(), p[2]];
        let p = p.map(|x| 1e3 * (x + SIGMA.0 * random.normal()));
        let Vec3(turned) = w_from_t.rotation_vector();
        let turned = turned.map(|x| x + SIGMA.1 * random.normal());
        let row: Vec<String> = q.iter().chain(&p).chain(&turned).map(|x| format!("{x:.7}")).collect();
        text += &format!("{},{}\n", 8 * k, row.join(","));
    }
    Recording::from_bytes("poses.csv", text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn what_is_all_that_is_there_is_no_chance_beside_itself() {
    let machine = common::machine("rotary_axis");
    let of_direction = [
        "backlash",
        "hysteresis",
        "direction_dependent_pose",
        "angular_play",
        "lateral_play",
        "coupled_lost_motion",
        "reversal_spike",
    ];
    let found = said(&machine, steps(&machine, 20e-6), &of_direction);
    assert_eq!(modelled(&found), [("c", "direction of c".to_string())]);
    let left = found.rms.rad.expect("angles").r#final;
    assert!(left < 1.1e-6, "{left}");
    assert!(modelled(&said(&machine, steps(&machine, 0.0), &of_direction)).is_empty());
}

#[test]
fn what_shifts_a_frame_is_modelled_though_the_angles_read_say_nothing_of_it() {
    let machine = common::machine("scara");
    let of_clock = ["setup_slip", "thermal_drift", "sensor_drift", "scale_drift", "clock_drift"];
    let found = said(&machine, poses(&machine, 200e-6), &of_clock);
    let all = modelled(&found);
    assert!(matches!(all.as_slice(), [(_, on)] if on == "time"), "{all:?}");
    let left = found.rms.m.expect("lengths").r#final;
    assert!(left < 1.1 * 3f64.sqrt() * SIGMA.0, "{left}");
    let sound = said(&machine, poses(&machine, 0.0), &of_clock);
    assert!(sound.findings.is_empty() && modelled(&sound).is_empty());
}

//! No drive is rigid: what every axis does a little is in the model, and is no finding.

use crate::common;
use crate::common::random::normals;
use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::effects::Library;
use kincal::recording::Recording;

/// What is said of an axis with so much play, deg, whose loop gives way to its acceleration by so much, s².
fn said_of(play: f64, gain: f64) -> Diagnosis {
    said_of_axis(11, |speed, acceleration| -0.5 * play * speed.signum() - gain * acceleration)
}

/// What is said of an axis that is off by this, deg, at this speed and acceleration, deg/s and deg/s².
fn said_of_axis(seed: u64, mut off: impl FnMut(f64, f64) -> f64) -> Diagnosis {
    let machine = common::machine("rotary_axis");
    let mut noise = normals(seed);
    let mut text = String::from("# measurement: joint\n# zero: unknown\nt[s],c[deg],c_meas[deg]\n");
    for k in 0..3000 {
        let t = 0.02 * f64::from(k);
        let (at, speed, acceleration) =
            [(60.0, 0.3), (20.0, 0.83)].iter().fold((0.0, 0.0, 0.0), |sum, (a, w)| {
                let (sine, cosine) = (w * t).sin_cos();
                (sum.0 + a * sine, sum.1 + a * w * cosine, sum.2 - a * w * w * sine)
            });
        text += &format!("{t:.2},{at:.6},{:.6}\n", at + off(speed, acceleration) + 2e-4 * noise());
    }
    let recording = Recording::from_bytes("c.csv", text.into_bytes(), &machine).expect("a recording");
    diagnose(&machine, &[recording], &Library::standard(), &DiagnoseOptions::default(), &|_| {})
        .unwrap_or_else(|e| panic!("{e}"))
}

fn companions(said: &Diagnosis) -> Vec<(&str, &str)> {
    said.shared.iter().map(|shared| (shared.effect.as_str(), shared.at.as_str())).collect()
}

#[test]
fn what_every_drive_does_a_little_is_modelled_and_no_finding() {
    // A hundredth of the noise's square, but of three thousand readings.
    let calm = said_of(0.0, 1e-5);
    assert!(calm.findings.is_empty() && calm.unexplained.is_none(), "{:?}", calm.findings);
    assert_eq!(companions(&calm), [("inertial_error", "c")]);
    let loose = said_of(0.01, 1e-5);
    let names: Vec<&str> = loose.findings.iter().map(|finding| finding.effect.as_str()).collect();
    assert_eq!(names, ["backlash"]);
    assert_eq!(companions(&loose), [("inertial_error", "c")]);
    // Nothing is said of a drive that is rigid.
    assert!(companions(&said_of(0.0, 0.0)).is_empty());
}

#[test]
fn a_drive_that_gives_way_more_than_others_do_has_its_name() {
    // From three times the noise to fifty times.
    for gain in [6e-5, 1.5e-4, 1e-3] {
        let said = said_of(0.0, gain);
        let names: Vec<&str> = said.findings.iter().map(|finding| finding.effect.as_str()).collect();
        assert_eq!(names, ["inertial_error"], "{gain}");
        assert!(said.unexplained.is_none() && companions(&said).is_empty(), "{gain}");
    }
}

#[test]
fn drives_do_not_follow_what_they_do_not_foretell() {
    // To and fro at moments of chance, by ten times the noise: some of that goes with any acceleration.
    for seed in 0..6 {
        let (mut chance, mut side) = (normals(seed), 2e-3);
        let said = said_of_axis(100 + seed, |_, _| {
            side *= if chance() > 2.33 { -1.0 } else { 1.0 };
            side
        });
        assert!(companions(&said).is_empty(), "{seed}: {:?}", companions(&said));
    }
}

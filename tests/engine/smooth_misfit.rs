//! A misfit that changes little from reading to reading is no noise with a long memory.

use crate::common;
use crate::common::random::Random;
use kincal::diagnose::{DiagnoseOptions, diagnose};
use kincal::effects::Library;
use kincal::recording::Recording;
use std::f64::consts::TAU;

/// Readings of each joint, half a second apart, and their noise, rad.
const COUNT: usize = 600;
const SIGMA: f64 = 1e-3;

/// What follows a joint through play of this half-width.
fn play(q: &[f64], width: f64) -> Vec<f64> {
    let mut follows = q[0];
    let lost = |q: &f64| {
        follows = follows.clamp(q - width, q + width);
        q - follows
    };
    q.iter().map(lost).collect()
}

/// Two joints of a robot that are driven by cables: plays of three widths in each, and something of the other joint's position.
fn cables(seed: u64) -> Vec<Recording> {
    let machine = common::machine("scara");
    let mut random = Random::new(seed);
    let mut path = || -> Vec<f64> {
        let waves =
            [0.5, 0.4, 0.3].map(|size| (size, TAU * random.between(0.02, 0.12), random.between(0.0, TAU)));
        let at = |k: usize| -> f64 {
            waves.iter().map(|(size, rate, phase)| size * (0.5 * rate * k as f64 + phase).sin()).sum()
        };
        (0..COUNT).map(at).collect()
    };
    let q = [path(), path()];
    let reading = |j: usize| {
        let lost: Vec<Vec<f64>> = [0.05, 0.15, 0.4].iter().map(|width| play(&q[j], *width)).collect();
        let bend = |k: usize| 0.03 * q[1][k] * q[1 - j][k];
        let mut text = format!(
            "# measurement: joint\n# zero: unknown\nt[s],q1[rad],q2[rad],q3[m],q4[rad],q{}_meas[rad]\n",
            j + 1
        );
        for k in 0..COUNT {
            let error =
                0.14 * lost.iter().map(|lost| lost[k]).sum::<f64>() + bend(k) + SIGMA * random.normal();
            text += &format!("{},{},{},0,0,{}\n", 0.5 * k as f64, q[0][k], q[1][k], q[j][k] + error);
        }
        Recording::from_bytes(&format!("q{}.csv", j + 1), text.into_bytes(), &machine)
            .unwrap_or_else(|e| panic!("{e}"))
    };
    [0, 1].map(reading).into()
}

#[test]
fn a_misfit_that_runs_smoothly_is_modelled_and_not_taken_for_what_noise_remembers() {
    let (machine, recordings) = (common::machine("scara"), cables(4));
    let said = diagnose(&machine, &recordings, &Library::standard(), &DiagnoseOptions::default(), &|_| {});
    let said = said.unwrap_or_else(|e| panic!("{e}"));
    let left = said.held_out_rms.rad.expect("angles");
    assert!(left.r#final < 0.3 * left.geometric, "{left:?}");
    let parts = said.unexplained.iter().flat_map(|unexplained| &unexplained.parts);
    let at: Vec<&str> =
        said.findings.iter().map(|f| f.at.as_str()).chain(parts.map(|p| p.at.as_str())).collect();
    assert!(at.contains(&"q1") && at.contains(&"q2"), "{at:?}");
}

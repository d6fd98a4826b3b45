//! Waves along a travel: told with the period that they have, and no multiple of it.

use std::f64::consts::TAU;
use std::ops::Range;

use crate::common;
use crate::common::draws::hold;
use crate::common::random::normals;
use kincal::diagnose::{DiagnoseOptions, diagnose};
use kincal::effects::Library;
use kincal::recording::Recording;
use proptest::prelude::*;

/// Sixty targets about 10 mm apart, not quite evenly, approached from either side three times: 2 um of a wave and 0.4 um of noise.
/// The targets are the same in every draw: once in some hundred, chance would lay them so evenly that they hide a wave.
fn targets(machine: &kincal::Machine, period: f64, phase: f64, seed: u64) -> Recording {
    let mut text =
        String::from("# measurement: joint\n# zero: unknown\nt[s],x[mm],x_direction[1],x_meas[mm]\n");
    let mut noise = normals(seed);
    let mut apart = normals(1);
    let targets: Vec<f64> = (0..60).map(|k| 10.0 * f64::from(k) + 1.8 * apart().clamp(-1.7, 1.7)).collect();
    let mut t = 0.0;
    for _ in 0..3 {
        let there = targets.iter().map(|x| (x, 1));
        for (x, direction) in there.chain(targets.iter().rev().map(|x| (x, -1))) {
            let read = x + 0.002 * (TAU * x / period + phase).sin() + 0.0004 * noise();
            text += &format!("{t:.1},{x:.4},{direction},{read:.6}\n");
            t += 5.0;
        }
    }
    Recording::from_bytes("targets.csv", text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

/// Steps of 0.8 mm to and fro over 320 mm, 2 um of a wave and 0.4 um of noise.
fn recording(machine: &kincal::Machine, period: f64, phase: f64, seed: u64) -> Recording {
    let mut text = String::from("# measurement: joint\n# zero: unknown\nt[s],x[mm],x_meas[mm]\n");
    let mut noise = normals(seed);
    for k in 0..800 {
        let x = if k < 400 { 0.8 * f64::from(k) } else { 0.8 * f64::from(800 - k) };
        let read = x + 0.002 * (TAU * x / period + phase).sin() + 0.0004 * noise();
        text += &format!("{:.2},{x:.3},{read:.6}\n", 0.1 * f64::from(k));
    }
    Recording::from_bytes("wave.csv", text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

/// That one cyclic error of 2 um is found in it, of this period in mm, and nothing else.
fn is_told(machine: &kincal::Machine, recording: Recording, period: f64) -> Result<(), TestCaseError> {
    let said = diagnose(machine, &[recording], &Library::standard(), &DiagnoseOptions::default(), &|_| {});
    let said = said.map_err(|e| TestCaseError::fail(e.to_string()))?;
    let names: Vec<_> = said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect();
    prop_assert_eq!(&names, &[("cyclic_error", "x")]);
    let size = |name: &str| said.findings[0].coefficients.iter().find(|c| c.name == name).map(|c| c.value);
    let (found, amplitude) = (size("period").unwrap_or(f64::NAN), size("amplitude").unwrap_or(f64::NAN));
    prop_assert!((1e3 * found / period - 1.0).abs() < 0.01, "{found} m for {period} mm");
    prop_assert!((amplitude / 2e-6 - 1.0).abs() < 0.1, "{amplitude} m for 2 um");
    Ok(())
}

/// Period in mm, phase, seed of the noise.
fn drawn(periods: Range<f64>) -> impl Strategy<Value = (f64, f64, u64)> {
    (periods, 0.0..TAU, any::<u64>())
}

fn waves_are_told(draws: u32) {
    let machine = common::machine("linear_axis");
    hold(draws, drawn(4.0..40.0), |(period, phase, seed)| {
        is_told(&machine, recording(&machine, period, phase, seed), period)
    });
}

fn waves_between_targets_are_told(draws: u32) {
    let machine = common::machine("linear_axis");
    hold(draws, drawn(7.0..18.0), |(period, phase, seed)| {
        is_told(&machine, targets(&machine, period, phase, seed), period)
    });
}

#[test]
fn a_wave_is_told_with_its_own_period() {
    waves_are_told(3);
}

#[test]
fn uneven_targets_tell_a_wave_finer_than_two_gaps() {
    waves_between_targets_are_told(3);
}

#[test]
#[ignore = "long: 24 diagnoses"]
fn waves_of_more_draws_are_told() {
    waves_are_told(12);
    waves_between_targets_are_told(12);
}

/// Periods of so many waves: their errors over what is said of them.
fn errors_are_as_large_as_is_said(draws: u32) {
    let machine = common::machine("linear_axis");
    let off = |k: u32| {
        let period = 6.0 + 0.731 * f64::from(k);
        let recording = recording(&machine, period, 0.9 * f64::from(k), 77 + 13 * u64::from(k));
        let said =
            diagnose(&machine, &[recording], &Library::standard(), &DiagnoseOptions::default(), &|_| {});
        let said = said.unwrap_or_else(|e| panic!("{e}"));
        let [finding] = &said.findings[..] else { panic!("{period} mm: {:?}", said.findings) };
        let found = finding.coefficients.iter().find(|c| c.name == "period").expect("a period");
        (found.value - 1e-3 * period) / found.std_error
    };
    let squares: Vec<f64> = (0..draws).map(|k| off(k).powi(2)).collect();
    let mean = squares.iter().sum::<f64>() / f64::from(draws);
    println!("mean square of {draws} errors over what is said of them: {mean:.2}");
    // Three standard deviations of a mean square about one.
    let chance = 3.0 * (2.0 / f64::from(draws)).sqrt();
    assert!((mean - 1.0).abs() < chance, "{mean}: {squares:?}");
}

#[test]
fn periods_are_off_by_as_much_as_is_said() {
    errors_are_as_large_as_is_said(10);
}

#[test]
#[ignore = "long: 40 diagnoses"]
fn periods_of_more_draws_are_off_by_as_much_as_is_said() {
    errors_are_as_large_as_is_said(40);
}

//! Waves along a travel: told with the period that they have, and no multiple of it.

mod common;

use std::f64::consts::TAU;

use kincal::diagnose::{Request, diagnose};
use kincal::effects::Library;
use kincal::recording::Recording;
use proptest::prelude::*;

/// Steps of 0.8 mm to and fro over 320 mm, 2 um of a wave and 0.4 um of noise.
fn recording(machine: &kincal::Machine, period: f64, phase: f64, seed: u64) -> Recording {
    let mut text = String::from("# measurement: joint\n# zero: unknown\nt[s],x[mm],x_meas[mm]\n");
    let mut state = seed | 1;
    let mut noise = || {
        // The sum of four even numbers is near enough to normal.
        let sum: f64 = (0..4)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            })
            .sum();
        0.0004 * 3f64.sqrt() * sum
    };
    for k in 0..800 {
        let x = if k < 400 { 0.8 * f64::from(k) } else { 0.8 * f64::from(800 - k) };
        let read = x + 0.002 * (TAU * x / period + phase).sin() + noise();
        text += &format!("{:.2},{x:.3},{read:.6}\n", 0.1 * f64::from(k));
    }
    Recording::from_bytes("wave.csv", text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn a_wave_is_told_with_its_own_period(period in 4.0..40.0f64, phase in 0.0..TAU, seed in any::<u64>()) {
        let machine = common::machine("linear_axis");
        let recording = [recording(&machine, period, phase, seed)];
        let said = diagnose(&machine, &recording, &Library::standard(), &Request::default(), &|_| {});
        let said = said.map_err(|e| TestCaseError::fail(e.to_string()))?;
        let names: Vec<_> = said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect();
        prop_assert_eq!(&names, &[("cyclic_error", "x")]);
        let size = |name: &str| said.findings[0].coefficients.iter().find(|c| c.name == name).map(|c| c.value);
        let (found, amplitude) = (size("period").unwrap_or(f64::NAN), size("amplitude").unwrap_or(f64::NAN));
        prop_assert!((1e3 * found / period - 1.0).abs() < 0.01, "{found} m for {period} mm");
        prop_assert!((amplitude / 2e-6 - 1.0).abs() < 0.1, "{amplitude} m for 2 um");
    }
}

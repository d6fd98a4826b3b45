//! Instruments whose noise remembers and whose readings are rounded: no structure is seen in that, and what is there is named.

use crate::common;
use crate::common::draws::hold;
use crate::common::random::normals;
use kincal::Machine;
use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::effects::Library;
use kincal::recording::Recording;
use proptest::prelude::*;

/// To and fro over 320 mm in 4000 readings: `scale` (1) of the axis, noise of 1 um that remembers `rho` of itself, rounded to `step` (mm).
fn recording(machine: &Machine, scale: f64, rho: f64, step: f64, seed: u64) -> Recording {
    let mut text = String::from("# measurement: joint\n# zero: unknown\nt[s],x[mm],x_meas[mm]\n");
    let mut fresh = normals(seed);
    let mut noise = 0.0;
    for k in 0..4000 {
        noise = rho * noise + 0.001 * (1.0 - rho * rho).sqrt() * fresh();
        let x = if k < 2000 { 0.16 * f64::from(k) } else { 0.16 * f64::from(4000 - k) };
        let read = ((x * (1.0 + scale) + noise) / step).round() * step;
        text += &format!("{:.2},{x:.3},{read:.7}\n", 0.02 * f64::from(k));
    }
    Recording::from_bytes("rounded.csv", text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

fn said(scale: f64, rho: f64, step: f64, seed: u64) -> Result<Diagnosis, TestCaseError> {
    let machine = common::machine("linear_axis");
    let recording = [recording(&machine, scale, rho, step, seed)];
    let said = diagnose(&machine, &recording, &Library::standard(), &DiagnoseOptions::default(), &|_| {});
    said.map_err(|e| TestCaseError::fail(e.to_string()))
}

/// What the noise remembers of itself, the step of the readings in mm, the seed.
fn drawn() -> impl Strategy<Value = (f64, f64, u64)> {
    (0.3..0.85f64, 0.0005..0.0015f64, any::<u64>())
}

fn noise_is_no_structure(draws: u32) {
    hold(draws, drawn(), |(rho, step, seed)| {
        let said = said(0.0, rho, step, seed)?;
        prop_assert!(said.findings.is_empty(), "{:?}", said.findings.first().map(|f| &f.effect));
        prop_assert!(said.unexplained.is_none());
        Ok(())
    });
}

fn an_effect_is_named(draws: u32) {
    hold(draws, drawn(), |(rho, step, seed)| {
        let said = said(1e-5, rho, step, seed)?;
        let names: Vec<_> = said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect();
        prop_assert_eq!(&names, &[("scale_error", "x")]);
        prop_assert!(said.unexplained.is_none());
        Ok(())
    });
}

#[test]
fn noise_that_remembers_and_is_rounded_is_no_structure() {
    noise_is_no_structure(2);
}

#[test]
fn an_effect_beneath_it_is_named() {
    an_effect_is_named(2);
}

#[test]
#[ignore = "long: 12 diagnoses"]
fn so_it_is_in_more_draws() {
    noise_is_no_structure(6);
    an_effect_is_named(6);
}

//! Resolvers out and back at one speed: their waves are named by what they come from, and their delay is no lost motion.

use std::f64::consts::TAU;

use crate::common;
use crate::common::draws::hold;
use crate::common::random::normals;
use kincal::diagnose::{DiagnoseOptions, Diagnosis, Finding, diagnose};
use kincal::effects::Library;
use kincal::recording::Recording;
use proptest::prelude::*;

/// Speed, deg/s; ramps, s; rest at either end, s; time between samples, s.
const SPEED: f64 = 36.0;
const RAMP: f64 = 0.1;
const REST: f64 = 4.0;
const STEP: f64 = 0.01;

/// What a resolver makes of an axis.
#[derive(Clone, Copy, Debug)]
struct Resolver {
    /// Waves per turn, their size in deg, and where they begin, rad.
    order: u8,
    amplitude: f64,
    phase: f64,
    /// What the reading is short of, part of the turn.
    scale: f64,
    /// s
    delay: f64,
}

impl Resolver {
    /// What is read of an axis that stands here, deg.
    fn reads(&self, at: f64) -> f64 {
        let turn = at.to_radians();
        at * (1.0 + self.scale) + self.amplitude * (f64::from(self.order) * turn + self.phase).sin()
    }
}

/// Where the axis is told to be, deg: a turn out, a rest, and back.
fn command(t: f64) -> f64 {
    // Way from rest, of a move that takes a turn.
    let way = |t: f64| {
        let (turn, whole) = (360.0, 360.0 / SPEED + RAMP);
        match t {
            t if t < 0.0 => 0.0,
            t if t < RAMP => 0.5 * SPEED * t * t / RAMP,
            t if t < whole - RAMP => SPEED * (t - 0.5 * RAMP),
            t if t < whole => turn - 0.5 * SPEED * (whole - t).powi(2) / RAMP,
            _ => turn,
        }
    };
    let back = 2.0 * REST + 360.0 / SPEED + RAMP;
    way(t - REST) - way(t - back)
}

fn diagnosis(resolver: Resolver, seed: u64) -> Result<Diagnosis, TestCaseError> {
    let machine = common::machine("rotary_axis");
    let mut noise = normals(seed);
    let mut text = String::from("# measurement: joint\n# zero: unknown\nt[s],c[deg],c_meas[deg]\n");
    let count = ((3.0 * REST + 2.0 * (360.0 / SPEED + RAMP)) / STEP) as usize;
    for t in (0..count).map(|k| STEP * k as f64) {
        let read = resolver.reads(command(t - resolver.delay)) + 0.02 * noise();
        text += &format!("{t:.2},{:.5},{read:.5}\n", command(t));
    }
    let fail = |e: kincal::Error| TestCaseError::fail(e.to_string());
    let recording = Recording::from_bytes("resolver.csv", text.into_bytes(), &machine).map_err(fail)?;
    diagnose(&machine, &[recording], &Library::standard(), &DiagnoseOptions::default(), &|_| {}).map_err(fail)
}

fn draws() -> u32 {
    std::env::var("KINCAL_DRAWS").ok().and_then(|n| n.parse().ok()).unwrap_or(5)
}

/// Size of a finding's number of this name, SI.
fn size(finding: &Finding, name: &str) -> f64 {
    finding.coefficients.iter().find(|c| c.name == name).map_or(f64::NAN, |c| c.value)
}

/// That its delay is found, and no lost motion, and its wave.
fn is_told(resolver: Resolver, seed: u64) -> Result<(), TestCaseError> {
    let said = diagnosis(resolver, seed)?;
    let names: Vec<_> = said.findings.iter().map(|f| (&f.effect, &f.form)).collect();
    let found = |effect: &'static str| said.findings.iter().filter(move |f| f.effect == effect);
    let is_near = |value: f64, truth: f64| (value / truth - 1.0).abs() < 0.1;
    let lag = found("servo_lag").map(|f| size(f, "lag"));
    let late: f64 = lag.chain(found("latency").map(|f| size(f, "delay"))).sum();
    prop_assert!(is_near(late, resolver.delay), "{late} s of {resolver:?}: {names:?}");
    let wave = found("cyclic_error").map(|f| size(f, "amplitude").to_degrees()).fold(f64::NAN, f64::max);
    prop_assert!(is_near(wave, resolver.amplitude), "{wave} deg of {resolver:?}: {names:?}");
    let lost = ["backlash", "hysteresis", "direction_dependent_pose"];
    prop_assert!(!names.iter().any(|(effect, _)| lost.contains(&effect.as_str())), "{resolver:?}: {names:?}");
    Ok(())
}

fn resolvers_are_told(draws: u32) {
    let drawn = (2u8..7, 1.0..8.0f64, 0.0..TAU, -3e-3..3e-3f64, 0.02..0.05f64, any::<u64>());
    hold(draws, drawn, |(order, amplitude, phase, scale, delay, seed)| {
        is_told(Resolver { order, amplitude, phase, scale, delay }, seed)
    });
}

#[test]
fn the_delay_of_a_resolver_is_no_lost_motion_and_its_wave_has_its_order() {
    resolvers_are_told(1);
}

/// `KINCAL_DRAWS` of them where somebody has the time.
#[test]
#[ignore = "long: five diagnoses"]
fn more_resolvers_are_told() {
    resolvers_are_told(draws());
}

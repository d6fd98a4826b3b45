//! Makes a recording of what a program has measured itself, without a file, and calibrates from it.
//!
//! A tracker reads a point on the carriage of a linear axis; the carriage is pitched by 50 urad, so that the point sinks. One reading
//! is lost.
//!
//!     cargo run --release --example recording_from_arrays

use kincal::identify::{CalibrateOptions, calibrate};
use kincal::lie::Vec3;
use kincal::machine::MachineFault;
use kincal::predict::predict;
use kincal::recording::{Arrays, RecordingFault};
use kincal::{Machine, Result};

/// What the axis does, rad and m.
const PITCH: f64 = 50e-6;
const NOISE: f64 = 5e-7;

fn main() -> Result<()> {
    let machine = Machine::parse("linear_axis.ron", include_str!("../machines/linear_axis.ron"))?;

    // SI throughout: m, rad, s. A reading that is NaN is a drop-out.
    let commands: Vec<f64> = (0..50).map(|k| 0.01 * f64::from(k)).collect();
    let time: Vec<f64> = (0..50).map(f64::from).collect();
    let rattle = |k: usize| NOISE * (7.0 * k as f64).sin();
    let mut measured: Vec<[f64; 3]> = Vec::new();
    for (k, x) in commands.iter().enumerate() {
        measured.push([x + rattle(k), rattle(k + 50), 0.1 - PITCH * x + rattle(k + 100)]);
    }
    measured[7][1] = f64::NAN;

    let arrays = Arrays::position(&measured)
        .command("x", &commands)
        .time(&time)
        .tool_point(Vec3([0.0, 0.0, 0.1]))
        .sigma(NOISE);
    let recording = arrays.recording("tracker", &machine)?;

    let (calibrated, fit) =
        calibrate(&machine, std::slice::from_ref(&recording), CalibrateOptions::default())?;
    println!("{} samples used, {} dropped", fit.samples, fit.dropped);
    assert_eq!((fit.samples, fit.dropped), (49, 1));

    // What the calibrated machine says that the tracker reads.
    let prediction = predict(&calibrated, &recording, None)?;
    let rms = prediction.rms.m.expect("positions are lengths");
    let nominal = fit.rms.m.expect("positions are lengths").nominal;
    println!("RMS {:.2} um before, {:.2} um after", 1e6 * nominal, 1e6 * rms);
    assert!(nominal > 5e-6 && rms < 2.0 * NOISE);

    // How the carriage runs: the direction of X in the workpiece frame.
    let chain = calibrated.chain();
    let way = chain.w_from_t(&[0.4]).translation - chain.w_from_t(&[0.0]).translation;
    println!("the carriage sinks by {:.1} um over 400 mm", -1e6 * way.0[2]);
    assert!((way.0[2] / 0.4 + PITCH).abs() < 2e-6);

    // What is wrong with arrays is told as what is wrong with files: where, what, and how to mend it.
    let error = arrays.clone().command("x", &commands).recording("twice", &machine).unwrap_err();
    println!("{error}; {}", error.mend());
    assert!(error.fault::<RecordingFault>().is_some() && error.fault::<MachineFault>().is_none());
    let short = Arrays::position(&measured).command("x", &commands[..3]);
    let error = short.recording("short", &machine).unwrap_err();
    assert!(matches!(error.fault(), Some(RecordingFault::UnequalArrays { .. })));
    Ok(())
}

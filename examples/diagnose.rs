//! Finds play that no constant geometry explains, and writes the model that has it.
//!
//! A three-axis mill runs circles under a ballbar, in both senses. Its X axis has 12 um of play, which nobody tells the diagnosis.
//!
//!     cargo run --release --example diagnose [CALIBRATED.ron]

use std::f64::consts::TAU;

use kincal::diagnose::{DiagnoseOptions, diagnose};
use kincal::effects::Library;
use kincal::sensor::Sensor;
use kincal::simulate::{Faults, Instrument, Plant, recording_of};
use kincal::{CalibratedMachine, Error, Machine, Recording, Result};

/// Radius of the circles, which is the length of the bar, m.
const RADIUS: f64 = 0.1;
/// Total width of the play, m.
const PLAY: f64 = 12e-6;

/// Two turns in one sense and two in the other, 600 samples each.
fn circles(machine: &Machine) -> Vec<Vec<f64>> {
    let at = |angle: f64| -> Vec<f64> {
        let of = |name: &String| match name.as_str() {
            "x" => RADIUS * angle.cos(),
            "y" => RADIUS * angle.sin(),
            _ => 0.0,
        };
        machine.commands().iter().map(of).collect()
    };
    let there = (0..1200).map(|k| TAU * f64::from(k) / 600.0);
    there.clone().chain(there.rev()).map(at).collect()
}

fn main() -> Result<()> {
    let machine = Machine::parse("xyz_mill.ron", include_str!("../machines/xyz_mill.ron"))?;

    let faults = r#"Faults(units: (length: um, angle: arcsec), backlash: [(joint: "x", width: 12)])"#;
    let faults = Faults::parse("faults.ron", faults, &machine)?;
    let plant = Plant::new(&CalibratedMachine::nominal(machine.clone())).with_faults(&faults);
    let mut ballbar = Instrument::new(Sensor::Distance { absolute: false }, 3e-7, 0.0);
    ballbar.state.length = RADIUS;
    let header = [format!("nominal_length[m]: {RADIUS}")];
    let csv = recording_of(&plant, &ballbar, &circles(&machine), &header, 1);
    let recordings = [Recording::from_bytes("circles.csv", csv.into_bytes(), &machine)?];

    let options = DiagnoseOptions::default();
    let silent = |_: &str| ();
    let mut diagnosis = diagnose(&machine, &recordings, &Library::standard(), &options, &silent)?;
    let calibrated = diagnosis.model(&machine, &recordings, options.options, &silent)?;

    let rms = diagnosis.rms.m.expect("distances are lengths");
    println!(
        "RMS {:.2} um with geometry alone, {:.2} um with what was found",
        1e6 * rms.geometric,
        1e6 * rms.r#final
    );
    for finding in &diagnosis.findings {
        println!("{} at {}: {}", finding.name(), finding.at, finding.explanation);
        for size in &finding.coefficients {
            println!("  {} = {:.3e} ± {:.1e} {}", size.name, size.value, size.std_error, size.unit);
        }
    }
    assert!(rms.r#final < 0.5 * rms.geometric, "the play is not explained");
    let [finding] = &diagnosis.findings[..] else { panic!("one effect was concealed") };
    assert_eq!((finding.effect.as_str(), finding.at.as_str()), ("backlash", "x"));
    let width = finding.coefficients.iter().find(|size| (size.value.abs() - PLAY).abs() < 1e-6);
    assert!(width.is_some(), "its width is told");

    // The calibrated file carries the effect by name; whatever reads a calibrated machine reads it.
    let ron = calibrated.to_ron();
    let read = CalibratedMachine::parse("calibrated.ron", &ron)?;
    assert_eq!(read.effects().len(), 1);
    if let Some(path) = std::env::args_os().nth(1) {
        std::fs::write(&path, ron).map_err(|source| Error::File { path: path.into(), source })?;
    }
    Ok(())
}

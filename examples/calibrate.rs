//! Calibrates a five-axis machine from a recording, and compares what was found with what was put in.
//!
//! The machine is one of those that come with kincal: A tilts the table, C turns on it. Its errors are drawn from its tolerances. A
//! tracker reads the position of the tool at 400 poses all over the travel, with 2 um of noise.
//!
//!     cargo run --release --example calibrate

use kincal::identify::{CalibrateOptions, calibrate};
use kincal::lie::Vec3;
use kincal::location::location_errors;
use kincal::predict::predict;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Machine, Recording, Result};

fn main() -> Result<()> {
    let machine = Machine::parse("ac_table_tilting.ron", include_str!("../machines/ac_table_tilting.ron"))?;

    // The machine as it really is, and what an instrument reads on it. Whoever has a recording opens it:
    // `Recording::open("tracker.csv", &machine)?`.
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 1));
    let tracker = Instrument::new(Sensor::Position, 2e-6, 0.0);
    let csv = recording(&truth, &tracker, &random_commands(&machine, 400, 1), &[], 1);
    let recordings = [Recording::from_bytes("tracker.csv", csv.into_bytes(), &machine)?];

    let (calibrated, fit) = calibrate(&machine, &recordings, CalibrateOptions::default())?;

    let rms = fit.rms.m.expect("positions are lengths");
    println!(
        "{} samples, RMS {:.1} um before and {:.2} um after",
        fit.samples,
        1e6 * rms.nominal,
        1e6 * rms.geometric
    );
    // Three coordinates of 2 um each.
    assert!(rms.nominal > 2e-5 && rms.geometric < 4e-6);

    let seen = fit.combinations.iter().filter(|combination| combination.share > 0.5).count();
    println!("{seen} of {} combinations of deviations come mostly from the data", fit.combinations.len());
    assert!(0 < seen && seen < fit.combinations.len());

    // The same geometry as ISO 230-1 location errors, with the share of each that comes from the data.
    let put_in = location_errors(&machine, truth.deviations(), Vec3::zero(0.0), None);
    println!("{:>6} {:>10} {:>10} {:>8} {:>7}", "name", "found", "put in", "u", "share");
    for (found, put_in) in fit.location_errors.errors.iter().zip(&put_in.errors) {
        assert_eq!(found.name, put_in.name);
        let (found_um, put_in_um, error_um) = (1e6 * found.value, 1e6 * put_in.value, 1e6 * found.std_error);
        let (name, share, unit) = (&found.name, 100.0 * found.share, &found.unit);
        println!(
            "{name:>6} {found_um:>10.2} {put_in_um:>10.2} {error_um:>8.2} {share:>5.1} %  (1e-6 {unit})"
        );
        assert!((found.value - put_in.value).abs() < 5.0 * found.std_error, "{name} is not what was put in");
    }
    assert!(fit.location_errors.errors.iter().any(|error| error.identified));

    // The calibrated machine is a machine file with one more field. It says of the recording what it said before it was written.
    let read = CalibratedMachine::parse("calibrated.ron", &calibrated.to_ron())?;
    let rms = |calibrated| {
        Ok::<_, kincal::Error>(predict(calibrated, &recordings[0], None)?.rms.m.expect("lengths"))
    };
    assert!((rms(&read)? - rms(&calibrated)?).abs() < 1e-12);
    Ok(())
}

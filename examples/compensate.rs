//! Rewrites an NC program, so that a machine with known errors cuts what the program means.
//!
//! The machine tilts its table about A and turns it about C. The program is in plain machine coordinates, with a work offset that
//! the set-up gives.
//!
//!     cargo run --release --example compensate

use kincal::compensate::{CompensateOptions, Setup, compensate_text};
use kincal::simulate::random_deviations;
use kincal::{CalibratedMachine, Machine, Result};

const PROGRAM: &str = "\
%
(FACE AND SLOT)
N10 G90 G21 G54
N20 G0 X0. Y0. Z50. A0. C0.
N30 G1 Z0. F500
N40 X80.
N50 Y40. A-30. C15. (tilted)
N60 Z5.
N70 M30
%
";

fn main() -> Result<()> {
    let machine = Machine::parse("ac_table_tilting.ron", include_str!("../machines/ac_table_tilting.ron"))?;
    // Of a machine that was measured: `CalibratedMachine::open("calibrated.ron")?`.
    let calibrated =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 7));
    let setup = Setup::parse("setup.ron", r#"Setup(work_offsets: {"G54": {"X": -20, "Y": 15, "Z": 30}})"#)?;

    let options = CompensateOptions::default().with_decimals(4);
    let (corrected, report) = compensate_text(&calibrated, "part.nc", PROGRAM, &setup, &options)?;

    println!("{corrected}");
    println!(
        "{} words corrected, {} inserted; tip corrected by {:.1} um at most, off by {:.3} um at most afterwards",
        report.corrected_words,
        report.inserted_words,
        1e6 * report.largest_correction_m.value,
        1e6 * report.largest_left_m.value,
    );
    // What is left is the rounding to 0.1 um.
    assert!(report.largest_correction_m.value > 1e-5 && report.largest_left_m.value < 5e-7);
    assert!(report.unknown_places.first.is_empty());

    // Only numbers and words of axes are touched.
    let lines = || PROGRAM.lines().zip(corrected.lines());
    assert_eq!(PROGRAM.lines().count(), corrected.lines().count());
    assert!(
        lines()
            .filter(|(before, _)| !before.contains(['X', 'Y', 'Z']))
            .all(|(before, after)| before == after)
    );
    assert!(lines().any(|(before, after)| before.contains("(tilted)") && after.ends_with("(tilted)")));

    // A machine without errors gets its program back, byte for byte.
    let (same, _) =
        compensate_text(&CalibratedMachine::nominal(machine), "part.nc", PROGRAM, &setup, &options)?;
    assert_eq!(same, PROGRAM);
    Ok(())
}

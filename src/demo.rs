//! The demonstration: the reference machine, a simulated ballbar recording of its errors, and the calibration that finds them.

use crate::calibration::CalibratedMachine;
use crate::error::{Error, Result};
use crate::identify::{Fit, Options, calibrate};
use crate::lie::Twist;
use crate::machine::Machine;
use crate::recording::Recording;
use crate::sensor::Sensor;
use crate::simulate::{Instrument, cone, random_deviations, recording};

/// The reference machine's file.
pub const REFERENCE: &str = include_str!("../machines/ac_table_tilting.ron");
/// Length of the bar, m.
const BAR: f64 = 0.1;
/// Noise of the ballbar, m.
const NOISE: f64 = 5e-7;

/// What the demonstration has to show.
#[derive(Debug)]
pub struct Demo {
    /// The machine with the errors that were put in.
    pub truth: CalibratedMachine,
    /// Cone frusta (BK4), inclined by 10° and 30°, as recording files would have them.
    pub recordings: Vec<String>,
    /// The calibrated machine.
    pub calibrated: CalibratedMachine,
    /// What the identification says.
    pub fit: Fit,
}

/// Runs it; the same seed gives the same figures.
///
/// # Errors
/// None that a user could cause: everything is embedded.
pub fn demo(seed: u64) -> Result<Demo> {
    let machine = Machine::parse("ac_table_tilting.ron", REFERENCE)?;
    let mut deviations = random_deviations(&machine, 1.0, seed);
    deviations[machine.w_index()] = Twist::zero(0.0);
    let truth = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations);
    let mut instrument = Instrument::new(Sensor::Distance { absolute: false }, NOISE, 0.0);
    instrument.state.length = BAR;
    let header = [format!("nominal_length[m]: {BAR}")];
    let (mut texts, mut recordings) = (Vec::new(), Vec::new());
    for degrees in [10u8, 30] {
        let path =
            cone(&machine, BAR, f64::from(degrees).to_radians(), 900).ok_or_else(|| Error::Undetermined {
                what: format!("the reference machine does not reach the cone inclined by {degrees}°"),
                mend: String::new(),
            })?;
        let noise_seed = seed.wrapping_add(u64::from(degrees));
        let text = recording(&truth, &instrument, &path, &header, noise_seed);
        // One clock for both: the second cone begins a minute after the first.
        let text = later(&text, 60.0 * recordings.len() as f64);
        let name = format!("bk4_{degrees}deg.csv");
        recordings.push(Recording::from_bytes(&name, text.clone().into_bytes(), &machine)?);
        texts.push(text);
    }
    let (calibrated, fit) = calibrate(&machine, &recordings, Options::default())?;
    Ok(Demo { truth, recordings: texts, calibrated, fit })
}

/// The recording with its clock, the first column, so many seconds on.
fn later(text: &str, seconds: f64) -> String {
    let row = |line: &str| match line.split_once(',') {
        Some((t, rest)) => match t.parse::<f64>() {
            Ok(t) => format!("{:.3},{rest}\n", t + seconds),
            Err(_) => format!("{line}\n"),
        },
        None => format!("{line}\n"),
    };
    text.lines().map(row).collect()
}

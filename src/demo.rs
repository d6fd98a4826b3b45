//! The demonstration: the reference machine, simulated ballbar recordings of its errors and of two effects that no geometry explains, the
//! calibration, and the diagnosis that names the effects.

use crate::calibration::CalibratedMachine;
use crate::diagnose::{Diagnosis, Request, diagnose};
use crate::effects::Library;
use crate::error::{Error, Result};
use crate::identify::{Fit, Options, calibrate};
use crate::lie::Twist;
use crate::machine::Machine;
use crate::recording::Recording;
use crate::sensor::Sensor;
use crate::simulate::{
    At, Claims, Course, Faults, Instrument, Plant, Run, Sample, Samples, Style, cone, random_deviations,
    recordings,
};

/// The reference machine's file.
pub const REFERENCE: &str = include_str!("../machines/ac_table_tilting.ron");
/// What is concealed: play of one axis, by the play operator of [`crate::simulate`], and a cyclic error of another.
pub const CONCEALED: &str = include_str!("demo.ron");
/// Length of the bar, m.
const BAR: f64 = 0.1;
/// Noise of the ballbar, m.
const NOISE: f64 = 5e-7;
/// Poses of a cone in each sense of travel, and the time from one to the next, s.
const POSES: usize = 900;
const STEP: f64 = 0.025;
/// Inclinations of the cones, degrees.
const INCLINATIONS: [u8; 2] = [10, 30];

/// What the demonstration has to show.
#[derive(Debug)]
pub struct Demo {
    /// The machine with the geometry that was put in.
    pub truth: CalibratedMachine,
    /// Cone frusta (BK4), inclined by 10° and 30°, as recording files would have them.
    pub recordings: Vec<String>,
    /// The machine calibrated by constant geometry.
    pub calibrated: CalibratedMachine,
    /// What the identification says.
    pub fit: Fit,
    /// What the diagnosis says.
    pub diagnosis: Diagnosis,
    /// The machine with geometry and what was named.
    pub diagnosed: CalibratedMachine,
}

/// Poses that follow each other by the same time.
struct Poses(Vec<Vec<f64>>);

impl Course for Poses {
    fn samples(&self) -> Result<Samples<'_>> {
        let sample = |(k, q): (usize, &Vec<f64>)| Sample {
            time: STEP * k as f64,
            q: q.clone(),
            directions: None,
            recorded: true,
            at: At::Pose(k + 1),
        };
        Ok(Box::new(self.0.iter().enumerate().map(sample).map(Ok)))
    }
}

/// Runs it; the same seed gives the same figures. `progress` is told what is being done.
///
/// # Errors
/// None that a user could cause: everything is embedded.
pub fn demo(seed: u64, progress: &dyn Fn(&str)) -> Result<Demo> {
    let machine = Machine::parse("ac_table_tilting.ron", REFERENCE)?;
    let mut deviations = random_deviations(&machine, 1.0, seed);
    deviations[machine.w_index()] = Twist::zero(0.0);
    let truth = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations);
    let plant = Plant::new(&truth).with_faults(&Faults::parse("demo.ron", CONCEALED, &machine)?);
    let mut instrument = Instrument::new(Sensor::Distance { absolute: false }, NOISE, 0.0);
    instrument.state.length = BAR;
    let mut runs = Vec::new();
    for degrees in INCLINATIONS {
        let path = cone(&machine, BAR, f64::from(degrees).to_radians(), POSES).ok_or_else(|| {
            Error::Undetermined {
                what: format!("the reference machine does not reach the cone inclined by {degrees}°"),
                mend: String::new(),
            }
        })?;
        runs.push(Run {
            course: Box::new(Poses(path)),
            instrument: instrument.clone(),
            claims: Claims::default(),
            directions: false,
        });
    }
    let texts = self::recordings(&plant, &runs, &Style::si(), seed)?;
    let read = (texts.iter().zip(INCLINATIONS)).map(|(text, degrees)| {
        Recording::from_bytes(&format!("bk4_{degrees}deg.csv"), text.clone().into_bytes(), &machine)
    });
    let read = read.collect::<Result<Vec<_>>>()?;
    progress("calibrating");
    let (calibrated, fit) = calibrate(&machine, &read, Options::default())?;
    let request = Request::default();
    let mut diagnosis = diagnose(&machine, &read, &Library::standard(), &request, progress)?;
    let diagnosed = diagnosis.model(&machine, &read, request.options, progress)?;
    Ok(Demo { truth, recordings: texts, calibrated, fit, diagnosis, diagnosed })
}

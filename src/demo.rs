//! The demonstration: the reference machine, simulated ballbar recordings of its errors and of two effects that no geometry explains, the
//! calibration, and the diagnosis that names the effects.

use crate::calibration::CalibratedMachine;
use crate::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use crate::effects::Library;
use crate::error::Result;
use crate::identify::{CalibrateOptions, Fit, calibrate};
use crate::lie::{Twist, Vec3};
use crate::machine::Machine;
use crate::recording::Recording;
use crate::sensor::Sensor;
use crate::simulate::{
    Balls, Claims, Faults, Figure, Instrument, Pace, Plant, Rounding, Run, Sense, Session, Style, Turning,
    Turns, random_deviations, rest,
};

/// The reference machine's file.
pub const REFERENCE: &str = include_str!("../machines/ac_table_tilting.ron");
/// What is concealed: play of one axis, by the play operator of [`crate::simulate`], and a cyclic error of another.
pub const CONCEALED: &str = include_str!("demo.ron");
/// Length of the bar, m.
const BAR: f64 = 0.1;
/// Noise of the ballbar, m.
const NOISE: f64 = 5e-7;
/// From one sample to the next the bar turns by this, rad; samples a second.
const STEP: f64 = 0.4 * std::f64::consts::PI / 180.0;
const RATE: f64 = 40.0;
/// Seconds from the beginning of one recording to that of the next.
const APART: f64 = 60.0;
/// By how much the tool leads the bar, rad: where both turn in step, the bar stands still as the tool sees it, and a good part of the errors
/// with it.
const LEAD: f64 = std::f64::consts::FRAC_PI_3;
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

impl Demo {
    /// The recordings, read.
    ///
    /// # Errors
    /// None that a user could cause.
    pub fn read(&self) -> Result<Vec<Recording>> {
        read(&self.recordings, self.calibrated.machine())
    }
}

fn read(texts: &[String], machine: &Machine) -> Result<Vec<Recording>> {
    let one = |(text, degrees): (&String, u8)| {
        Recording::from_bytes(&format!("bk4_{degrees}deg.csv"), text.clone().into_bytes(), machine)
    };
    texts.iter().zip(INCLINATIONS).map(one).collect()
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
    let turns = Turns {
        from: 0.0,
        to: std::f64::consts::TAU,
        senses: vec![Sense::Positive, Sense::Negative],
        parts: 1,
        repeat: 1,
        overshoot: 0.0,
        dwell: 0.0,
        paces: vec![Pace::Steps(STEP)],
    };
    let mut texts = Vec::new();
    for (i, degrees) in INCLINATIONS.into_iter().enumerate() {
        let figure = Figure::Cone {
            half_apex: std::f64::consts::FRAC_PI_4,
            inclination: f64::from(degrees).to_radians(),
            lead: LEAD,
            tool_centre_point: true,
            reversed: false,
        };
        let origin = Vec3([0.0; 3]);
        let balls = Balls { workpiece_point_w: origin, tool_point_t: origin, length: BAR };
        let held = rest(&machine);
        let course = Turning::new(&machine, figure, balls, &held, turns.legs(), RATE, Rounding::default())?;
        let run = Run {
            course: Box::new(course),
            instrument: instrument.clone(),
            claims: Claims::default(),
            directions: false,
        };
        // Each recording is a run of its own: what the machine did before it is not known.
        let (runs, style) = ([run], Style::si());
        let mut session = Session::new(&plant, &runs, &style, 0.0, seed.wrapping_add(u64::from(degrees)))?
            .beginning_at(APART * i as f64);
        let mut text = Vec::new();
        session.record(&mut text, |_| ())?;
        texts.push(String::from_utf8_lossy(&text).into_owned());
    }
    let read = read(&texts, &machine)?;
    progress("calibrating");
    let (calibrated, fit) = calibrate(&machine, &read, CalibrateOptions::default())?;
    let request = DiagnoseOptions::default();
    let mut diagnosis = diagnose(&machine, &read, &Library::standard(), &request, progress)?;
    let diagnosed = diagnosis.model(&machine, &read, request.options, progress)?;
    Ok(Demo { truth, recordings: texts, calibrated, fit, diagnosis, diagnosed })
}

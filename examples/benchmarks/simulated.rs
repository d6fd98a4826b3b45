//! Every shipped machine simulated: whether identification finds what was put in, and whether the Jacobians are right.

use kincal::check::check;
use kincal::identify::{COMPONENTS, CalibrateOptions, Fit, calibrate};
use kincal::lie::Vec3;
use kincal::machine::Tolerance;
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Machine};

use crate::outcome::{Failure, Outcome, given};
use crate::sets::{Data, machines};
use crate::table::Table;

/// Tolerances as a part of the file's. What the data do not see is known to a tolerance only, and its square must stay below the noise for
/// a linear comparison with the truth.
const SIZE: f64 = 0.004;

/// The machine with smaller tolerances.
fn tightened(machine: &Machine) -> Outcome<Machine> {
    let smaller = |t: Tolerance| Tolerance { translation: SIZE * t.translation, rotation: SIZE * t.rotation };
    let mut dyads = machine.dyads().to_vec();
    for (j, dyad) in dyads.iter_mut().enumerate() {
        dyad.tolerance = Some(smaller(machine.tolerance(j)));
    }
    let tool = dyads.split_off(machine.workpiece_count());
    Ok(Machine::new(machine.name(), machine.units(), dyads, tool)?)
}

/// An instrument whose noise is a twentieth of the machine's own tolerance, and what its recordings declare.
fn instrument(machine: &Machine, sensor: Sensor) -> (Instrument, Vec<String>) {
    let tolerance = machine.tolerance(0);
    let mut instrument =
        Instrument::new(sensor.clone(), 0.05 * tolerance.translation, 0.05 * tolerance.rotation);
    let mut header = Vec::new();
    if !matches!(sensor, Sensor::Joint { .. }) {
        instrument.state.tool_point_t = Vec3([0.04, -0.03, 0.02]);
        header.push("tool_point[m]: 0.04, -0.03, 0.02".to_string());
    }
    if let Sensor::Distance { absolute } = sensor {
        instrument.state.workpiece_point_w = Vec3([0.03, 0.05, -0.06]);
        header.push("workpiece_point[m]: 0.03, 0.05, -0.06".into());
        if !absolute {
            instrument.state.length = 0.25;
            header.push("nominal_length[m]: 0.25".into());
        }
    }
    (instrument, header)
}

/// Errors of the combinations that the data see, in standard errors.
fn errors(truth: &CalibratedMachine, fit: &Fit) -> Outcome<Vec<f64>> {
    let machine = truth.machine();
    let mut miss = Vec::new();
    for p in &fit.parameters {
        let broken = || Failure::Broken(format!("no deviation {}.{}", p.frame, p.component));
        let dyad = machine.frame_index(&p.frame).ok_or_else(broken)?;
        let k = COMPONENTS.iter().position(|c| *c == p.component).ok_or_else(broken)?;
        miss.push((p.value - truth.deviations()[dyad].to_array()[k]) / p.tolerance);
    }
    let information = &fit.information;
    let seen = (0..information.strength.len()).filter(|i| information.share(*i) > 0.5);
    Ok(seen
        .map(|i| {
            let along: f64 = information.directions.column(i).iter().zip(&miss).map(|(d, m)| d * m).sum();
            along.abs() * (1.0 + information.strength[i]).sqrt()
        })
        .collect())
}

pub fn truth(_: &Data) -> Outcome<String> {
    let mut table = Table::new(&["measurement", "cases", "combinations", "beyond 2", "beyond 3", "largest"]);
    let mut by_sensor: Vec<(String, usize, Vec<f64>)> = Vec::new();
    for (n, (_, machine)) in machines()?.into_iter().enumerate() {
        let machine = tightened(&machine)?;
        let joint = given(machine.joints().next(), "joint")?.0;
        let seed = 100 + n as u64;
        let truth = CalibratedMachine::nominal(machine.clone())
            .with_deviations(random_deviations(&machine, 1.0, seed));
        let sensors = [
            ("pose", Sensor::Pose),
            ("position", Sensor::Position),
            ("distance, bar", Sensor::Distance { absolute: false }),
            ("distance, absolute", Sensor::Distance { absolute: true }),
            ("displacement", Sensor::Displacement { direction_w: Vec3([0.48, 0.6, 0.64]) }),
            ("joint", Sensor::Joint { dyad: joint }),
        ];
        for (name, sensor) in sensors {
            let (instrument, header) = instrument(&machine, sensor.clone());
            let commands = random_commands(&machine, 800 / sensor.reading_count(), seed + 10_000);
            let csv = recording(&truth, &instrument, &commands, &header, seed + 20_000);
            let recordings = [Recording::from_bytes("simulated.csv", csv.into_bytes(), &machine)?];
            let (_, fit) = calibrate(&machine, &recordings, CalibrateOptions::default())?;
            let found = errors(&truth, &fit)?;
            match by_sensor.iter_mut().find(|(known, ..)| known == name) {
                Some((_, cases, all)) => {
                    *cases += 1;
                    all.extend(found);
                }
                None => by_sensor.push((name.into(), 1, found)),
            }
        }
    }
    for (name, cases, all) in by_sensor {
        let beyond = |limit: f64| {
            let count = all.iter().filter(|e| **e > limit).count();
            format!("{count} ({:.1} %)", 100.0 * count as f64 / all.len() as f64)
        };
        let largest = all.iter().copied().fold(0.0, f64::max);
        table.row(&[
            name,
            cases.to_string(),
            all.len().to_string(),
            beyond(2.0),
            beyond(3.0),
            format!("{largest:.2}"),
        ]);
    }
    Ok(table.after(&format!(
        "Every shipped machine with deviations drawn at random, some 800 readings with noise, identified. Errors of the combinations of \
         deviations that the data see, in standard errors; normal errors are beyond 2 in 4.6 % and beyond 3 in 0.3 %. Tolerances, deviations \
         and noise are {SIZE} times those of the machine files, so that the comparison is linear."
    )))
}

pub fn new_poses(_: &Data) -> Outcome<String> {
    let mut table = Table::new(&["measurement", "machines", "least", "mean", "largest"]);
    let sensors = [
        ("pose", Sensor::Pose, 3.0f64),
        ("position", Sensor::Position, 3.0),
        ("distance", Sensor::Distance { absolute: false }, 1.0),
    ];
    for (name, sensor, values) in sensors {
        let mut ratios = Vec::new();
        for (n, (_, machine)) in machines()?.into_iter().enumerate() {
            let seed = 500 + 10 * n as u64;
            let truth = CalibratedMachine::nominal(machine.clone())
                .with_deviations(random_deviations(&machine, 1.0, seed));
            let (mut instrument, header) = instrument(&machine, sensor.clone());
            let record = |instrument: &Instrument, seed: u64| {
                let commands = random_commands(&machine, 600, seed);
                let csv = recording(&truth, instrument, &commands, &header, seed + 1);
                Recording::from_bytes("simulated.csv", csv.into_bytes(), &machine)
            };
            let learnt = [record(&instrument, seed + 2)?];
            let (calibrated, fit) = calibrate(&machine, &learnt, CalibrateOptions::default())?;
            let noise = instrument.noise.m;
            (instrument.noise.m, instrument.noise.rad) = (0.0, 0.0);
            let error = given(predict(&calibrated, &record(&instrument, seed + 4)?, None)?.rms.m, "lengths")?;
            ratios.push(error / (noise * (values * fit.information.used / fit.readings as f64).sqrt()));
        }
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = ratios.iter().copied().fold(0.0, f64::max);
        table.row(&[
            name.to_string(),
            ratios.len().to_string(),
            format!("{least:.2}"),
            format!("{mean:.2}"),
            format!("{largest:.2}"),
        ]);
    }
    Ok(table.after(
        "Deviations of the full tolerance, 600 samples with noise; then 600 new poses without. Error over `sigma sqrt(parameters / readings)`, \
         which is what the noise allows.",
    ))
}

pub fn jacobians(_: &Data) -> Outcome<String> {
    let mut table = Table::new(&["machine", "worst difference"]);
    for (stem, machine) in machines()? {
        let worst = check(&machine, 20, 1).iter().map(|check| check.worst).fold(0.0, f64::max);
        table.row(&[format!("`{stem}`"), format!("{worst:.1e}")]);
    }
    Ok(table.after(
        "Analytic Jacobians of pose, position, distance, displacement and joint readings, by deviations, commands and tool point, at 20 random \
         poses each with nominal, small and large deviations, against forward-mode automatic differentiation; relative to their block. \
         `kincal check MACHINE.ron` prints each.",
    ))
}

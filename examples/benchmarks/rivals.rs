//! Rivals on real recordings, and the filter against least squares.

use kincal::identify::{COMPONENTS, CalibrateOptions, Loss, calibrate};
use kincal::lie::Vec3;
use kincal::recording::Recording;
use kincal::rivals::{Arena, Kalman, KalmanOptions, Rival, Tuning, Verdict, split};
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Machine};

use crate::outcome::{Failure, Outcome, given};
use crate::sets::{self, Data};
use crate::table::{Table, three};

/// How many samples each rival is fitted to.
const SAMPLES: u64 = 60;

pub fn real(data: &Data) -> Outcome<String> {
    let sets = [("fanuc_r2000ic", "mark A"), ("dlr_justin right", "")];
    let mut judged: Vec<Vec<Verdict>> = Vec::new();
    for (name, _) in sets {
        let set = sets::arm(data, name)?;
        let whole = set.texts[0].whole(&set.machine)?;
        let (picked, rest) = split(&whole, &set.machine, SAMPLES)?;
        let (fit_on, judge_on) = ([given(picked, "samples")?], [given(rest, "samples to judge by")?]);
        let arena = Arena {
            machine: &set.machine,
            fit_on: &fit_on,
            judge_on: &judge_on,
            truth: None,
            fit_setup: false,
        };
        let named = Rival::named(Tuning::default());
        let verdicts: kincal::Result<Vec<Verdict>> =
            named.iter().map(|(name, rival)| arena.judge(name, rival)).collect();
        judged.push(verdicts?);
    }
    let titles: Vec<String> = (sets.iter())
        .flat_map(|(name, part)| {
            let part = if part.is_empty() { String::new() } else { format!(", {part}") };
            [format!("{name}{part}: fitted, mm"), "judged, mm".into()]
        })
        .collect();
    let columns: Vec<&str> = ["rival"].into_iter().chain(titles.iter().map(String::as_str)).collect();
    let mut table = Table::new(&columns);
    for (i, verdict) in judged[0].iter().enumerate() {
        let figures = judged.iter().flat_map(|verdicts| {
            let verdict = &verdicts[i];
            let mm = |mean: Option<f64>| mean.map_or_else(String::new, |m| three(1e3 * m));
            match &verdict.failed {
                Some(_) => ["failed".into(), String::new()],
                None => [verdict.fitted, verdict.judged].map(|r| mm(r.and_then(|r| r.mean.m))),
            }
        });
        let row: Vec<String> = [format!("`{}`", verdict.rival)].into_iter().chain(figures).collect();
        table.row(&row);
    }
    Ok(table.after(&format!(
        "{SAMPLES} evenly spread samples for the fit, the others for the judgement; mean distance. The same by hand: `kincal compare \
         machines/fanuc_r2000ic_165f.ron DIR/fanuc_r2000ic/mark_A.csv --samples {SAMPLES}`."
    )))
}

/// A recording of a machine with random deviations, 400 samples, noise 10 um.
fn measured(machine: &Machine, size: f64, sensor: Sensor) -> Outcome<Recording> {
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(machine, size, 11));
    // Stated a little above the noise, so that least squares weighs by it and not by what it sees.
    let mut head = vec!["sigma[um]: 13".to_string()];
    let mut instrument = Instrument::new(sensor, 1e-5, 0.0);
    if let Sensor::Distance { .. } = instrument.sensor {
        instrument.state.workpiece_point_w = Vec3([0.03, 0.05, -0.06]);
        head.push("workpiece_point[m]: 0.03, 0.05, -0.06".into());
    }
    let csv = recording(&truth, &instrument, &random_commands(machine, 400, 12), &head, 13);
    Ok(Recording::from_bytes("made.csv", csv.into_bytes(), machine)?)
}

/// Largest difference of a deviation between filter and least squares with the same prior, in its standard error.
fn difference(machine: &Machine, recording: Recording) -> Outcome<f64> {
    let recordings = [recording];
    let (_, fit) = calibrate(machine, &recordings, CalibrateOptions::default().with_loss(Loss::Squares))?;
    let mut filter = Kalman::new(machine, KalmanOptions::default());
    filter.follow(&recordings[0])?;
    let found = filter.calibrated();
    let mut largest = 0.0f64;
    // Frame w belongs to the set-up.
    for p in fit.parameters.iter().filter(|p| p.frame != "w") {
        let broken = || Failure::Broken(format!("no deviation {}.{}", p.frame, p.component));
        let dyad = machine.frame_index(&p.frame).ok_or_else(broken)?;
        let k = COMPONENTS.iter().position(|c| *c == p.component).ok_or_else(broken)?;
        largest = largest.max((found.deviations()[dyad].to_array()[k] - p.value).abs() / p.std_error);
    }
    Ok(largest)
}

pub fn filter(_: &Data) -> Outcome<String> {
    let machines = [
        ("ac_table_tilting", 1.0, "tolerances"),
        ("bc_head_table", 1.0, "tolerances"),
        ("scara", 1.0, "tolerances"),
        ("six_r_arm", 0.1, "a tenth of the tolerances"),
    ];
    let mut table = Table::new(&["machine", "deviations", "by position", "by distance"]);
    for (stem, size, words) in machines {
        let machine = sets::machine(stem)?;
        let mut row = vec![format!("`{stem}`"), words.to_string()];
        for sensor in [Sensor::Position, Sensor::Distance { absolute: true }] {
            row.push(format!("{:.1e}", difference(&machine, measured(&machine, size, sensor)?)?));
        }
        table.row(&row);
    }
    Ok(table.after(
        "Largest difference of any deviation between the filter after the last of 400 samples and least squares with the same prior, in its \
         own standard error. Noise 10 um.",
    ))
}

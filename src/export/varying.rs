//! What of a calibrated machine is not constant, and what each part of it makes at the tool.

use super::Remainder;
use super::travel::poses;
use crate::calibration::CalibratedMachine;
use crate::error::Result;
use crate::predict::predict;
use crate::recording::Arrays;
use crate::variation::{Variation, Varying};

/// Corners of the path on which parts are looked at.
const CORNERS: usize = 40;
/// Steps between two of them.
const STEPS: usize = 6;

/// Every part that varies with the error that it makes at the tip over the travel. `because`: why it is not in the file.
///
/// # Errors
/// As [`predict`].
pub(super) fn varying(calibrated: &CalibratedMachine, because: &str) -> Result<Vec<Remainder>> {
    let mut found = Vec::new();
    let variation = calibrated.variation();
    let only = |variation: Variation| {
        let bare = CalibratedMachine::nominal(calibrated.machine().clone());
        bare.with_deviations(calibrated.deviations().to_vec()).with_variation(variation)
    };
    if let Some(directions) = &variation.varying.directions {
        let axes: Vec<&str> =
            directions.axes().iter().map(|c| calibrated.machine().commands()[*c].as_str()).collect();
        let what = format!("deviations that change with the direction of travel of {}", axes.join(", "));
        let parts = Variation {
            varying: Varying { directions: Some(directions.clone()), terms: Vec::new() },
            parts: variation.parts.clone(),
            dead_bands: variation.dead_bands.clone(),
            samples: variation.samples.clone(),
            ..Variation::default()
        };
        let because = format!("the file holds the mean of both directions; {because}");
        found.push(size(calibrated, &only(parts), what, because)?);
    }
    if !variation.motions.is_empty() {
        let motions = Variation { motions: variation.motions.clone(), ..Variation::default() };
        let what = "error motions of the axes".to_string();
        found.push(size(calibrated, &only(motions), what, because.into())?);
    }
    for effect in calibrated.effects() {
        let what = format!("{} at {}", effect.effect, effect.at);
        if effect.at == "measurement" || effect.of_setup {
            let because = "it belongs to the measurement, not to the machine".into();
            found.push(Remainder { what, max_m: None, rms_m: None, because });
            continue;
        }
        let bare = CalibratedMachine::nominal(calibrated.machine().clone());
        let bare = bare.with_deviations(calibrated.deviations().to_vec());
        // It was bound when the file was read.
        if let Ok(with) = bare.with_effects(vec![effect.clone()], dead_bands(calibrated)) {
            found.push(size(calibrated, &with, what, because.into())?);
        }
    }
    Ok(found)
}

fn dead_bands(calibrated: &CalibratedMachine) -> Vec<f64> {
    let mut bands = calibrated.variation().dead_bands.clone();
    bands.resize(calibrated.machine().commands().len(), 0.0);
    bands
}

/// How far the tip is off where only one part varies, along a path through the whole travel.
fn size(
    calibrated: &CalibratedMachine,
    with: &CalibratedMachine,
    what: String,
    because: String,
) -> Result<Remainder> {
    let machine = calibrated.machine();
    let corners = poses(calibrated, CORNERS);
    let mut path = vec![corners[0].clone()];
    for pair in corners.windows(2) {
        for step in 1..=STEPS {
            let share = step as f64 / STEPS as f64;
            path.push(pair[0].iter().zip(&pair[1]).map(|(a, b)| a + (b - a) * share).collect());
        }
    }
    let chain = calibrated.chain();
    let points: Vec<[f64; 3]> = path.iter().map(|q| chain.w_from_t(q).translation.0).collect();
    let mut arrays = Arrays::position(&points);
    for (c, name) in machine.commands().iter().enumerate() {
        arrays = arrays.command(name, &path.iter().map(|q| q[c]).collect::<Vec<f64>>());
    }
    let prediction = predict(with, &arrays.recording("travel", machine)?, None)?;
    // What goes by speed, time or a channel has no size along a path that nobody has run.
    let (max_m, rms_m) = match prediction.left_out.is_empty() {
        true => (prediction.max.m, prediction.rms.m),
        false => (None, None),
    };
    Ok(Remainder { what, max_m, rms_m, because })
}

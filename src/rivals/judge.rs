//! How well a model does: on recordings, and against a machine whose deviations are known.

use serde::{Deserialize, Serialize};

use super::scheme::measured_rotation;
use crate::calibration::CalibratedMachine;
use crate::error::{Error, Result};
use crate::predict::{chain, predict, sensor_state};
use crate::recording::Recording;
use crate::residual::Sizes;
use crate::sensor::Sensor;
use crate::units::{ByQuantity, Quantity, Rms, field_by_quantity};

field_by_quantity!(mean, rms, max);

/// Residuals of a model over recordings, SI. A sample's residual is its Euclidean norm (of a pose: position and rotation apart).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Residuals {
    /// Samples.
    pub samples: u64,
    /// Mean; where distances were measured this is the paper's radial error.
    #[serde(flatten, with = "mean")]
    pub mean: Rms,
    /// Root mean square.
    #[serde(flatten, with = "rms")]
    pub rms: Rms,
    /// Largest.
    #[serde(flatten, with = "max")]
    pub max: Rms,
}

/// Distance of a model from the true machine over the samples of recordings, SI.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AgainstTruth {
    /// `dp`: mean distance of the measured point, as modelled, from where it truly is in frame `w`, m.
    pub dp_m: f64,
    /// `dr`: mean angle between the tool frame as modelled and as it truly is, rad.
    pub dr_rad: f64,
    /// Mean angle between the tool axes (z of frame `t`), rad; less than `dr` where a turn about the tool itself is wrong too.
    pub tilt_rad: f64,
    /// Mean length between readings as modelled and as they would be without noise, m; of a distance the radial error against the truth.
    pub reading_m: f64,
}

/// Residuals of a model over recordings.
///
/// # Errors
/// As [`predict`].
pub fn residuals(model: &CalibratedMachine, recordings: &[Recording]) -> Result<Residuals> {
    let (mut sizes, mut samples) = (ByQuantity::<Sizes>::default(), 0);
    for recording in recordings {
        let p = predict(model, recording, None)?;
        samples += p.samples;
        for quantity in [Quantity::Length, Quantity::Angle] {
            if let (Some(rms), Some(mean), Some(max)) =
                (p.rms[quantity], p.mean_abs[quantity], p.max[quantity])
            {
                sizes[quantity].add(&Sizes::of(p.samples, rms, mean, max));
            }
        }
    }
    Ok(Residuals { samples, mean: sizes.mean(), rms: sizes.rms(), max: sizes.largest() })
}

/// A model against the true machine at the commands of recordings; `None` where they have no sample that sees frames `w` and `t`.
///
/// # Errors
/// If a recording cannot be read, or model or truth do not know its set-up.
pub fn against_truth(
    model: &CalibratedMachine,
    truth: &CalibratedMachine,
    recordings: &[Recording],
) -> Result<Option<AgainstTruth>> {
    let mut sums = AgainstTruth::default();
    let mut count = 0.0;
    for recording in recordings.iter().filter(|r| r.header().measurement.sees_frames()) {
        let header = recording.header();
        let sensor = Sensor::of(header);
        let own = (chain(model, header, &sensor)?, sensor_state(model, header, &sensor)?);
        // The truth may be a file that was never calibrated on this set-up: frame w is then the one that it declares.
        let true_chain = truth.chain_of_setup(&header.setup).unwrap_or_else(|| truth.chain());
        let real = (true_chain, sensor_state(truth, header, &sensor).map_err(of_truth)?);
        let (commands, values) = (model.machine().commands().len(), recording.value_count());
        for chunk in recording.chunks()? {
            let chunk = chunk?;
            for k in 0..chunk.len {
                let q = &chunk.commands[k * commands..(k + 1) * commands];
                let rotation = measured_rotation(&sensor, &chunk.values[k * values..(k + 1) * values]);
                let (sweep, true_sweep) = (own.0.sweep(q), real.0.sweep(q));
                let (w_from_t, true_w_from_t) = (sweep.w_from_t(), true_sweep.w_from_t());
                let p_w = w_from_t.transform(own.1.tool_point_t);
                let true_p_w = true_w_from_t.transform(real.1.tool_point_t);
                sums.dp_m += (p_w - true_p_w).norm();
                sums.dr_rad += (w_from_t.inverse() * true_w_from_t).rotation_vector().norm();
                let (axis, true_axis) = (w_from_t.rotation.column(2), true_w_from_t.rotation.column(2));
                sums.tilt_rad += axis.cross(true_axis).norm().atan2(axis.dot(true_axis));
                count += 1.0;
                let (modelled, n) = sensor.readings(&sweep, &own.1, rotation);
                let (real_readings, _) = sensor.readings(&true_sweep, &real.1, rotation);
                let off = (0..n.min(3)).map(|i| (modelled[i].value - real_readings[i].value).powi(2));
                sums.reading_m += off.sum::<f64>().sqrt();
            }
        }
    }
    Ok((count > 0.0).then(|| AgainstTruth {
        dp_m: sums.dp_m / count,
        dr_rad: sums.dr_rad / count,
        tilt_rad: sums.tilt_rad / count,
        reading_m: sums.reading_m / count,
    }))
}

/// What only a file of the truth can know is not to be found from a recording.
fn of_truth(error: Error) -> Error {
    match error {
        Error::Undetermined { what, .. } => Error::Undetermined {
            what: format!("true machine: {what}"),
            mend: "state it in the `calibration` of the true machine's file, or judge without it".into(),
        },
        other => other,
    }
}

//! How well a model does: on recordings, and against a machine whose deviations are known.

use serde::Serialize;

use super::scheme::measured_rotation;
use crate::calibration::CalibratedMachine;
use crate::error::{Error, Result};
use crate::predict::{chain, predict, sensor_state};
use crate::recording::Recording;
use crate::sensor::Sensor;

/// Residuals of a model over recordings, SI. A sample's residual is its Euclidean norm (of a pose: position and rotation apart).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Residuals {
    /// Samples.
    pub samples: u64,
    /// Mean of lengths, m; where distances were measured this is the paper's radial error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_m: Option<f64>,
    /// Root mean square of lengths, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_m: Option<f64>,
    /// Largest length, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_m: Option<f64>,
    /// Mean of angles, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_rad: Option<f64>,
    /// Root mean square of angles, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_rad: Option<f64>,
    /// Largest angle, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_rad: Option<f64>,
}

/// Distance of a model from the true machine over the samples of recordings, SI.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
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

/// Sums over recordings.
#[derive(Default)]
struct Sums {
    count: f64,
    total: f64,
    squares: f64,
    largest: f64,
}

impl Sums {
    fn add(&mut self, samples: u64, mean: Option<f64>, rms: Option<f64>, max: Option<f64>) {
        if let (Some(mean), Some(rms), Some(max)) = (mean, rms, max) {
            let n = samples as f64;
            self.count += n;
            self.total += n * mean;
            self.squares += n * rms * rms;
            self.largest = self.largest.max(max);
        }
    }

    fn figures(&self) -> [Option<f64>; 3] {
        let n = self.count;
        [self.total / n, (self.squares / n).sqrt(), self.largest].map(|x| (n > 0.0).then_some(x))
    }
}

/// Residuals of a model over recordings.
///
/// # Errors
/// As [`predict`].
pub fn residuals(model: &CalibratedMachine, recordings: &[Recording]) -> Result<Residuals> {
    let (mut lengths, mut angles, mut samples) = (Sums::default(), Sums::default(), 0);
    for recording in recordings {
        let p = predict(model, recording, None)?;
        samples += p.samples;
        lengths.add(p.samples, p.mean_abs_m, p.rms_m, p.max_m);
        angles.add(p.samples, p.mean_abs_rad, p.rms_rad, p.max_rad);
    }
    let ([mean_m, rms_m, max_m], [mean_rad, rms_rad, max_rad]) = (lengths.figures(), angles.figures());
    Ok(Residuals { samples, mean_m, rms_m, max_m, mean_rad, rms_rad, max_rad })
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

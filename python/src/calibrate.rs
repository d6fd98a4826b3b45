//! Calibration, prediction and diagnosis, each as its command does it.

use std::path::PathBuf;

use kincal::effects::Library;
use kincal::face;
use kincal::identify::{CalibrateOptions, ErrorModel, Loss, fit_setup};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::told;
use crate::machine::Machine;
use crate::recording::{AllGiven, Given, Sources, detached};

/// The dictionary of a JSON text.
fn dictionary<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyDict>> {
    Ok(py.import("json")?.call_method1("loads", (json,))?.cast_into::<PyDict>()?)
}

/// The loss of that name.
fn loss(py: Python<'_>, name: &str, tuning: Option<f64>) -> PyResult<Loss> {
    if let Some(tuning) = tuning.filter(|tuning| !(*tuning > 0.0 && tuning.is_finite())) {
        return Err(told(py, format!("tuning is {tuning}"), "give a number above zero"));
    }
    match name {
        "squares" => Ok(Loss::Squares),
        "huber" => Ok(Loss::Huber { k: tuning.unwrap_or(3.0) }),
        "tukey" => Ok(Loss::Tukey { c: tuning.unwrap_or(4.685) }),
        other => Err(told(py, format!("loss {other:?} is not known"), "write one of: squares huber tukey")),
    }
}

/// Finds the deviations of a machine from recordings.
#[pyfunction]
#[pyo3(signature = (
    machine, recordings, *, loss = "huber", tuning = None, prior = true, directions = None, error_motions = 0.0, force = false
))]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
pub fn calibrate<'py>(
    py: Python<'py>,
    machine: &Machine,
    recordings: AllGiven,
    loss: &str,
    tuning: Option<f64>,
    prior: bool,
    directions: Option<Vec<String>>,
    error_motions: f64,
    force: bool,
) -> PyResult<(Machine, Bound<'py, PyDict>)> {
    if !(0.0..=1.0).contains(&error_motions) {
        return Err(told(py, format!("error_motions is {error_motions}"), "give a number from 0 to 1"));
    }
    let options = CalibrateOptions::default().with_loss(self::loss(py, loss, tuning)?).with_prior(prior);
    let sources = Sources::of(recordings);
    let declared = machine.calibrated.machine();
    let (calibrated, json) = detached(py, || {
        let recordings = sources.open(declared, &machine.file)?;
        let axes: Vec<&str> = directions.iter().flatten().map(String::as_str).collect();
        let model = match axes[..] {
            [] => ErrorModel::default(),
            _ => ErrorModel::by_direction(declared, &axes)?,
        };
        face::calibrated(declared, &recordings, &model.with_error_motions(error_motions), options, force)
    })?;
    Ok((Machine { calibrated, file: machine.file.clone() }, dictionary(py, &json)?))
}

/// Names what the geometry leaves over, and models it.
#[pyfunction]
#[pyo3(signature = (machine, recordings, *, effects = None, without = None, force = false))]
pub fn diagnose<'py>(
    py: Python<'py>,
    machine: &Machine,
    recordings: AllGiven,
    effects: Option<Vec<PathBuf>>,
    without: Option<Vec<String>>,
    force: bool,
) -> PyResult<(Machine, Bound<'py, PyDict>)> {
    let sources = Sources::of(recordings);
    let declared = machine.calibrated.machine();
    let (calibrated, json) = detached(py, || {
        let recordings = sources.open(declared, &machine.file)?;
        let mut library = Library::standard();
        for path in effects.iter().flatten() {
            library = library.with_file(path)?;
        }
        for name in without.iter().flatten() {
            library = library.without(name)?;
        }
        face::diagnosed(declared, &recordings, &library, force)
    })?;
    Ok((Machine { calibrated, file: machine.file.clone() }, dictionary(py, &json)?))
}

/// What the instrument would read on the machine, sample by sample.
#[pyfunction]
#[pyo3(signature = (machine, recording, *, fit_setup = false))]
pub fn predict<'py>(
    py: Python<'py>,
    machine: &Machine,
    recording: Given,
    fit_setup: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let sources = Sources::of(AllGiven::One(recording));
    let (json, columns) = detached(py, || {
        let mut calibrated = machine.calibrated.clone();
        let recordings = sources.open(calibrated.machine(), &machine.file)?;
        if fit_setup {
            calibrated = self::fit_setup(&calibrated, &recordings, Loss::default())?;
        }
        let mut csv = Vec::new();
        let prediction = kincal::predict::predict(&calibrated, &recordings[0], Some(&mut csv))?;
        if prediction.samples == 0 {
            // Says what is missing.
            recordings[0].scan()?;
        }
        let json = serde_json::to_string(&prediction).unwrap_or_default();
        Ok((json, columns(&String::from_utf8_lossy(&csv))))
    })?;
    let result = dictionary(py, &json)?;
    let arrays = PyDict::new(py);
    for (name, values) in columns {
        arrays.set_item(name, PyArray1::from_vec(py, values))?;
    }
    result.set_item("columns", arrays)?;
    Ok(result)
}

/// The columns of model and residual; a cell that is empty is NaN.
fn columns(csv: &str) -> Vec<(String, Vec<f64>)> {
    let mut lines = csv.lines().filter(|line| !line.starts_with('#') && !line.trim().is_empty());
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let is_ours = |name: &str| {
        let stem = name.split('[').next().unwrap_or_default();
        stem.ends_with("_model") || stem.ends_with("_residual")
    };
    // They stand behind all others.
    let ours = header.iter().rev().take_while(|name| is_ours(name)).count();
    let mut columns: Vec<(String, Vec<f64>)> =
        header[header.len() - ours..].iter().map(|name| (name.to_string(), Vec::new())).collect();
    for line in lines {
        for ((_, values), cell) in columns.iter_mut().rev().zip(line.rsplit(',')) {
            values.push(cell.trim().parse().unwrap_or(f64::NAN));
        }
    }
    columns
}

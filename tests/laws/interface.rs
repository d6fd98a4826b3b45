//! What the interface promises beside its functions: values that go from thread to thread, and results that read back as they were written.

use kincal::compensate::{CompensateOptions, Report, Setup, compensate_text};
use kincal::convert::{self, Request};
use kincal::describe::{Description, describe};
use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::effects::{Library, StoredEffect};
use kincal::error::Fault;
use kincal::export::{self, ExportOptions, Format};
use kincal::identify::{CalibrateOptions, ErrorModel, Fit, Reach, calibrate, calibrate_model, reach};
use kincal::import::{self, Form, ImportOptions, Imported};
use kincal::inverse::{Goal, Inverse, InverseOptions, Solution};
use kincal::lie::{Pose, Twist, Vec3, Wrench};
use kincal::location::LocationErrors;
use kincal::machine::{Dyad, Joint, MachineFault};
use kincal::num_dual::Dual64;
use kincal::predict::{Prediction, predict};
use kincal::recording::{Arrays, Joined, RecordingFault};
use kincal::sensor::Sensor;
use kincal::simulate::{Faults, Instrument, Plant, recording_of};
use kincal::{CalibratedMachine, Chain, Error, LeftOut, Machine, Place, Recording, Sweep};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::common::machine;

/// Holds where it compiles.
const fn goes_from_thread_to_thread<T: Send + Sync>() {}

const _: () = {
    goes_from_thread_to_thread::<Machine>();
    goes_from_thread_to_thread::<Dyad>();
    goes_from_thread_to_thread::<Joint>();
    goes_from_thread_to_thread::<CalibratedMachine>();
    goes_from_thread_to_thread::<Recording>();
    goes_from_thread_to_thread::<Arrays>();
    goes_from_thread_to_thread::<Joined>();
    goes_from_thread_to_thread::<Chain<f64>>();
    goes_from_thread_to_thread::<Chain<Dual64>>();
    goes_from_thread_to_thread::<Sweep<f64>>();
    goes_from_thread_to_thread::<Pose<f64>>();
    goes_from_thread_to_thread::<Twist<f64>>();
    goes_from_thread_to_thread::<Wrench<f64>>();
    goes_from_thread_to_thread::<Vec3<f64>>();
    goes_from_thread_to_thread::<Error>();
    goes_from_thread_to_thread::<Box<dyn Fault>>();
    goes_from_thread_to_thread::<MachineFault>();
    goes_from_thread_to_thread::<RecordingFault>();
    goes_from_thread_to_thread::<Place>();
    goes_from_thread_to_thread::<CalibrateOptions>();
    goes_from_thread_to_thread::<ErrorModel>();
    goes_from_thread_to_thread::<Fit>();
    goes_from_thread_to_thread::<Reach>();
    goes_from_thread_to_thread::<LocationErrors>();
    goes_from_thread_to_thread::<Prediction>();
    goes_from_thread_to_thread::<LeftOut>();
    goes_from_thread_to_thread::<Description>();
    goes_from_thread_to_thread::<Library>();
    goes_from_thread_to_thread::<StoredEffect>();
    goes_from_thread_to_thread::<DiagnoseOptions>();
    goes_from_thread_to_thread::<Diagnosis>();
    goes_from_thread_to_thread::<Inverse<'static>>();
    goes_from_thread_to_thread::<InverseOptions>();
    goes_from_thread_to_thread::<Goal>();
    goes_from_thread_to_thread::<Solution>();
    goes_from_thread_to_thread::<CompensateOptions>();
    goes_from_thread_to_thread::<Setup>();
    goes_from_thread_to_thread::<Report>();
    goes_from_thread_to_thread::<Plant>();
    goes_from_thread_to_thread::<Faults>();
    goes_from_thread_to_thread::<Instrument>();
};

/// The result as JSON, after it has been read back as the same. Values, not their text: how exactly decimals are read is the reader's.
fn there_and_back<T: Serialize + DeserializeOwned>(result: &T) -> serde_json::Value {
    let written = serde_json::to_value(result).expect("a result is JSON");
    let read: T = serde_json::from_value(written.clone()).unwrap_or_else(|e| panic!("{e} in {written}"));
    assert_eq!(serde_json::to_value(&read).expect("a result is JSON"), written);
    written
}

/// A mill whose X has play, seen by a tracker on two paths to and fro along every axis.
fn recording(machine: &Machine) -> Recording {
    let faults = r#"Faults(units: (length: um, angle: arcsec), backlash: [(joint: "x", width: 12)],
        deviations: [(frame: "z", w: (20, -15, 0))])"#;
    let faults = Faults::parse("faults.ron", faults, machine).unwrap_or_else(|e| panic!("{e}"));
    let plant = Plant::new(&CalibratedMachine::nominal(machine.clone())).with_faults(&faults);
    let path = |k: usize| {
        let turns = |n: f64| (std::f64::consts::TAU * n * k as f64 / 600.0).sin();
        machine.commands().iter().zip([2.0, 3.0, 5.0]).map(|(_, n)| 0.2 * turns(n)).collect::<Vec<f64>>()
    };
    let commands: Vec<Vec<f64>> = (0..600).map(path).collect();
    let tracker = Instrument::new(Sensor::Position, 5e-7, 0.0);
    let csv = recording_of(&plant, &tracker, &commands, &[], 3);
    Recording::from_bytes("tracker.csv", csv.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn results_read_back_as_they_were_written() -> kincal::Result<()> {
    let machine = machine("xyz_mill");
    let recordings = [recording(&machine)];
    let options = CalibrateOptions::default();
    let (calibrated, fit) = calibrate(&machine, &recordings, options)?;
    let json = there_and_back(&fit);
    assert_eq!(json["samples"], 600);
    // What is not determined has a standard error without bound, which JSON has no number for.
    assert!(fit.location_errors.errors.iter().any(|error| error.identified));
    there_and_back(&fit.location_errors);
    let (_, without_prior) = calibrate(&machine, &recordings, options.with_prior(false))?;
    assert!(without_prior.parameters.iter().any(|parameter| parameter.std_error.is_infinite()));
    there_and_back(&without_prior);
    there_and_back(&predict(&calibrated, &recordings[0], None)?);
    there_and_back(&reach(&machine, &recordings)?);
    there_and_back(&describe(&machine));

    let model = ErrorModel::by_direction(&machine, &["x"])?.with_samples(40);
    let (pieces, fit) = calibrate_model(&machine, &recordings, &model, options, &|_| ())?;
    assert!(fit.held_out.is_some() && fit.pieces.len() > 1);
    there_and_back(&fit);

    let request = DiagnoseOptions::default();
    let mut diagnosis = diagnose(&machine, &recordings, &Library::standard(), &request, &|_| ())?;
    let with_play = diagnosis.model(&machine, &recordings, request.options, &|_| ())?;
    let json = there_and_back(&diagnosis);
    assert_eq!(json["findings"][0]["effect"], "backlash");

    let program = "G90 G21\nG1 X0. Y0. Z0. F600\nX100. Y50.\nX20.\nG53 G0 Z0.\nM30\n";
    for machine in [&calibrated, &pieces, &with_play] {
        let (setup, options) = (Setup::default(), CompensateOptions::default());
        let (_, report) = compensate_text(machine, "part.nc", program, &setup, &options)?;
        let json = there_and_back(&report);
        assert_eq!((&json["moves"], &json["machine_moves"]), (&3.into(), &1.into()), "{json}");
    }
    Ok(())
}

#[test]
fn results_of_foreign_files_read_back_as_they_were_written() -> kincal::Result<()> {
    let mill = machine("xyz_mill");
    let table = "Target [mm];1+ [um];1- [um];2+ [um];2- [um]\n0;-1,2;8,1;-1,0;8,4\n100;0,3;9,9;0,1;9,7\n200;1,8;11,2;2,1;11,0\n";
    let request = Request::default().with_head("fixed y[mm]: 0").with_head("fixed z[mm]: 0").with_joint("x");
    let converted = convert::read("laser.csv", table.as_bytes(), Some(&mill), &request)?;
    let json = there_and_back(&converted);
    assert_eq!((&json["positioning"]["joint"], &json["positioning"]["unit"]), (&"x".into(), &"m".into()));

    let sheet =
        "joint,kind,theta[deg],d[mm],a[mm],alpha[deg]\nq1,revolute,0,387,325,0\nq2,prismatic,0,0,0,0\n";
    let imported = import::read_with("arm.csv", sheet, &ImportOptions::default().with_form(Form::Dh))?;
    let json = there_and_back(&imported);
    let read: Imported = serde_json::from_value(json).expect("it was read before");
    assert_eq!(read, imported);
    let refused = serde_json::json!({"text": "Machine(", "told": [], "beside": []});
    let error = serde_json::from_value::<Imported>(refused).expect_err("no machine");
    assert!(error.to_string().starts_with("imported:1:"), "{error}");

    let exported =
        export::export(&CalibratedMachine::nominal(imported.machine), Format::Dh, &ExportOptions::default())?;
    let json = there_and_back(&exported);
    assert!(json["numbers"][0]["declared"].is_number(), "{json}");
    Ok(())
}

/// A calibrated file says what the calibrated machine says; degrees round in the last place.
#[test]
fn a_calibrated_machine_reads_back_from_its_text() -> kincal::Result<()> {
    let machine = machine("xyz_mill");
    let recordings = [recording(&machine)];
    let (options, silent) = (CalibrateOptions::default(), |_: &str| ());
    let model = ErrorModel::by_direction(&machine, &["y", "x"])?;
    let (pieces, _) = calibrate_model(&machine, &recordings, &model, options, &silent)?;
    let smooth = ErrorModel::default().with_error_motions(0.03);
    let (motions, _) = calibrate_model(&machine, &recordings, &smooth, options, &silent)?;
    let mut diagnosis =
        diagnose(&machine, &recordings, &Library::standard(), &DiagnoseOptions::default(), &silent)?;
    let named = diagnosis.model(&machine, &recordings, options, &silent)?;
    for calibrated in [&pieces, &motions, &named] {
        let read = CalibratedMachine::parse("calibrated.ron", &calibrated.to_ron())?;
        assert_eq!(read.machine(), calibrated.machine());
        for (a, b) in read.deviations().iter().zip(calibrated.deviations()) {
            assert!(
                a.to_array().iter().zip(b.to_array()).all(|(a, b)| (a - b).abs() <= 1e-15 * b.abs()),
                "{a:?} {b:?}"
            );
        }
        let (mut before, mut after) = (Vec::new(), Vec::new());
        let residuals = predict(calibrated, &recordings[0], Some(&mut before))?.rms.m.expect("lengths");
        let again = predict(&read, &recordings[0], Some(&mut after))?.rms.m.expect("lengths");
        assert!((residuals - again).abs() < 1e-14, "{residuals} {again}");
        let rows = 600 + recordings[0].preamble().lines().count();
        assert_eq!(before.iter().filter(|byte| **byte == b'\n').count(), rows);
        assert_eq!(before.len(), after.len());
    }
    Ok(())
}

#[test]
fn a_model_is_keyed_on_axes_by_name() {
    let machine = machine("ac_table_tilting");
    let model = ErrorModel::by_direction(&machine, &["a", "c"]).unwrap_or_else(|e| panic!("{e}"));
    let directions = model.varying.directions.expect("keyed on directions");
    let names: Vec<&str> = directions.axes().iter().map(|c| machine.commands()[*c].as_str()).collect();
    assert_eq!(names, ["a", "c"]);
    for (axes, mend) in [
        (&["a", "b"][..], "name one of: a, c, y, x, z"),
        (&["a", "a"], "name every axis once"),
        (&[], "name 1 to 7 axes"),
        (&[""], "name one of: a, c, y, x, z"),
    ] {
        let error = ErrorModel::by_direction(&machine, axes).expect_err("it cannot be");
        assert!(matches!(error, Error::Undetermined { .. }), "{error}");
        assert_eq!(error.mend(), mend);
    }
}

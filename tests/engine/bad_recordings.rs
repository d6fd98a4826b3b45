//! Recordings that read well or badly and do not determine what is asked for: message, mend and warnings.

use std::path::{Path, PathBuf};

use crate::common;
use kincal::identify::{CalibrateOptions, Fit, calibrate, fit_setup};
use kincal::lie::Vec3;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Error, Machine};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad/identification")
}

/// The machine that a file is for: the one of its first line, but for the file that names the wrong one.
fn machine_of(path: &Path) -> Machine {
    let text = std::fs::read_to_string(path).expect("a text");
    let named = text.lines().next().and_then(|l| l.strip_prefix("# machine: ")).expect("a machine first");
    common::machine(if path.ends_with("wrong_machine.csv") { "linear_axis" } else { named })
}

fn error_of(path: &Path) -> Error {
    let machine = machine_of(path);
    Recording::open(path, &machine)
        .and_then(|r| calibrate(&machine, &[r], CalibrateOptions::default()))
        .map(|_| ())
        .expect_err(&path.display().to_string())
}

#[test]
fn every_recording_that_determines_nothing_has_a_message_and_a_mend() {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder()).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    files.sort();
    assert!(files.len() >= 10);
    let parent = format!("{}/", folder().display());
    let lines = files.iter().map(|path| {
        let error = error_of(path);
        assert!(!error.mend().is_empty(), "{error}");
        let name = path.file_name().expect("a name").to_string_lossy();
        format!("{name}\n  {}\n  = {}", error.to_string().replace(&parent, ""), error.mend())
    });
    insta::assert_snapshot!(lines.collect::<Vec<_>>().join("\n"));
}

#[test]
fn a_set_up_with_too_few_readings_cannot_be_found_again_either() {
    let path = folder().join("unknown_frame_one_distance.csv");
    let machine = machine_of(&path);
    let recordings = [Recording::open(&path, &machine).unwrap_or_else(|e| panic!("{e}"))];
    let calibrated = CalibratedMachine::nominal(machine);
    let error = fit_setup(&calibrated, &recordings, Default::default()).expect_err("3 readings, 6 unknowns");
    assert!(matches!(error, Error::Undetermined { .. }), "{error}");
}

/// A simulated recording of a machine with errors, and what its calibration says.
struct Case {
    machine: Machine,
    instrument: Instrument,
    header: Vec<String>,
    commands: Vec<Vec<f64>>,
}

impl Case {
    fn new(stem: &str, sensor: Sensor, samples: usize) -> Self {
        let machine = common::machine(stem);
        let mut instrument = Instrument::new(sensor, 1e-6, 1e-6);
        instrument.state.tool_point_t = Vec3([0.03, -0.02, 0.05]);
        let commands = random_commands(&machine, samples, 11);
        let header = vec!["tool_point[mm]: 30, -20, 50".to_string()];
        Case { machine, instrument, header, commands }
    }

    fn text(&self) -> String {
        let deviations = random_deviations(&self.machine, 0.1, 12);
        let truth = CalibratedMachine::nominal(self.machine.clone()).with_deviations(deviations);
        recording(&truth, &self.instrument, &self.commands, &self.header, 13)
    }

    fn fit(&self, text: String) -> Fit {
        let recordings = [Recording::from_bytes("case.csv", text.into_bytes(), &self.machine)
            .unwrap_or_else(|e| panic!("{e}"))];
        let (_, fit) = calibrate(&self.machine, &recordings, CalibrateOptions::default())
            .unwrap_or_else(|e| panic!("{e}"));
        fit
    }
}

fn assert_warns(fit: &Fit, part: &str) {
    assert!(fit.warnings.iter().any(|w| w.contains(part)), "no `{part}` in {:#?}", fit.warnings);
}

#[test]
fn a_good_recording_has_no_warning() {
    let case = Case::new("xyz_mill", Sensor::Position, 100);
    let fit = case.fit(case.text());
    assert!(fit.warnings.is_empty(), "{:#?}", fit.warnings);
    assert_eq!(fit.readings, 300);
}

#[test]
fn too_few_readings_are_told() {
    let case = Case::new("six_r_arm", Sensor::Position, 40);
    let fit = case.fit(case.text());
    assert_warns(&fit, "120 readings for 27 identifiable parameters: fewer than five each");
}

#[test]
fn joints_that_never_move_are_named() {
    let mut case = Case::new("xyz_mill", Sensor::Position, 100);
    case.commands.iter_mut().for_each(|q| q[1] = 0.02);
    let still = case.machine.commands()[1].clone();
    let fit = case.fit(case.text());
    assert!(fit.rank < fit.rank_in_general);
    assert_warns(&fit, &format!("would see {}; these joints never move: {still}", fit.rank_in_general));
}

#[test]
fn joints_that_only_move_together_are_told() {
    let mut case = Case::new("xyz_mill", Sensor::Position, 100);
    case.commands.iter_mut().enumerate().for_each(|(k, q)| *q = vec![1e-3 * k as f64; 3]);
    let fit = case.fit(case.text());
    assert_warns(&fit, "vary the joints independently of each other");
}

#[test]
fn down_weighted_samples_are_counted_and_listed() {
    let case = Case::new("xyz_mill", Sensor::Distance { absolute: true }, 100);
    let text = case.text();
    let row = text.lines().nth(10).expect("a row").to_string();
    let (rest, reading) = row.rsplit_once(',').expect("columns");
    let spoilt = format!("{rest},{}", reading.parse::<f64>().expect("a number") + 1e-3);
    let fit = case.fit(text.replace(&row, &spoilt));
    assert_warns(&fit, "1 sample counts less than half for lying far off");
    assert_eq!((fit.down_weighted, fit.suspects.len(), fit.suspects[0].line), (1, 1, 11));
}

#[test]
fn residuals_above_the_stated_sigma_are_told_once_for_all_recordings() {
    let mut case = Case::new("xyz_mill", Sensor::Position, 100);
    case.header.push("sigma[um]: 0.1".into());
    let text = case.text();
    let open = |name: &str| {
        Recording::from_bytes(name, text.clone().into_bytes(), &case.machine)
            .unwrap_or_else(|e| panic!("{e}"))
    };
    let recordings = [open("one.csv"), open("two.csv")];
    let (_, fit) =
        calibrate(&case.machine, &recordings, CalibrateOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    assert_warns(&fit, "one.csv, two.csv: residuals are 9.");
    assert_warns(&fit, "times the stated sigma: something besides constant geometry is at work");
    assert_eq!(fit.warnings.iter().filter(|w| w.contains("stated sigma")).count(), 1);
    // The larger of the two counts.
    assert!((0.8e-6..1.2e-6).contains(&fit.recordings[0].sigma), "{}", fit.recordings[0].sigma);
}

#[test]
fn what_no_reading_says_of_a_set_up_is_told() {
    // One distance does not see the turns of w about its own centre.
    let mut case = Case::new("xyz_mill", Sensor::Distance { absolute: true }, 100);
    case.header.push("workpiece_frame: unknown".into());
    let fit = case.fit(case.text());
    assert_eq!(fit.open.len(), 3, "{:#?}", fit.open);
    assert_warns(&fit, "not seen by the recordings, left as declared: ");
}

#[test]
fn warnings_of_the_reader_come_along_with_the_name_of_the_file() {
    let mut case = Case::new("xyz_mill", Sensor::Position, 100);
    case.header.push("operator: N. N.".into());
    let fit = case.fit(case.text());
    assert_warns(&fit, "case.csv: line 4: ignored header key `operator`");
}

#[test]
fn an_encoder_with_an_arbitrary_zero_says_nothing_about_constant_deviations() {
    let mut case = Case::new("rotary_axis", Sensor::Joint { dyad: 1 }, 50);
    case.header = vec!["zero: unknown".into()];
    assert_warns(&case.fit(case.text()), "no constant deviation of the machine shows in these recordings");
    case.header.clear();
    assert!(case.fit(case.text()).warnings.is_empty());
}

#[test]
fn instruments_of_one_kind_with_different_sigma_keep_their_own_noise() {
    let fine = Case::new("xyz_mill", Sensor::Position, 200);
    let mut coarse = Case::new("xyz_mill", Sensor::Position, 200);
    coarse.instrument.noise.m = 1e-4;
    let with = |case: &mut Case, sigma: &str| {
        case.header.push(format!("sigma[um]: {sigma}"));
        Recording::from_bytes("r.csv", case.text().into_bytes(), &case.machine)
            .unwrap_or_else(|e| panic!("{e}"))
    };
    let (mut fine, machine) = (fine, coarse.machine.clone());
    let recordings = [with(&mut fine, "1"), with(&mut coarse, "100")];
    let (_, fit) =
        calibrate(&machine, &recordings, CalibrateOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    for (recording, sigma) in fit.recordings.iter().zip([1e-6, 1e-4]) {
        assert!((0.9..1.2).contains(&(recording.sigma / sigma)), "{} m, stated {sigma} m", recording.sigma);
        assert!(recording.birge.is_some_and(|b| (0.8..1.2).contains(&b)), "{:?}", recording.birge);
    }
}

#[test]
fn a_ballbar_of_unknown_length_is_found_from_nothing() {
    for unknown_frame in [false, true] {
        let mut case = Case::new("xyz_mill", Sensor::Distance { absolute: false }, 300);
        // On a sphere about the centre: the reading hardly varies.
        case.commands.iter_mut().for_each(|q| {
            let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
            q.iter_mut().for_each(|x| *x *= 0.1 / norm);
        });
        case.instrument.state.tool_point_t = Vec3([0.0; 3]);
        case.instrument.state.length = 0.0998;
        case.header = vec!["nominal_length: unknown".into()];
        if unknown_frame {
            case.header.push("workpiece_frame: unknown".into());
        }
        let recordings = [Recording::from_bytes("bar.csv", case.text().into_bytes(), &case.machine)
            .unwrap_or_else(|e| panic!("{e}"))];
        let (calibrated, fit) = calibrate(&case.machine, &recordings, CalibrateOptions::default())
            .unwrap_or_else(|e| panic!("{e}"));
        let (_, length) = calibrated.lengths().next().expect("a length");
        let rms = fit.rms.m.expect("lengths");
        println!(
            "unknown frame {unknown_frame}: length {length}, rms {rms:?}, {} steps {}",
            fit.steps, fit.stop
        );
        assert!(rms.geometric < 1.1e-6, "{rms:?}");
        assert!((length - 0.0998).abs() < 1e-5, "{length}");
        assert!(fit.steps < 30, "{}", fit.steps);
    }
}

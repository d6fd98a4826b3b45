//! A user's whole way through kincal, by its public interface alone: a machine from a text, recordings from arrays, calibration,
//! prediction, the inverse, diagnosis, compensation, and errors told apart.

use std::f64::consts::TAU;
use std::thread;

use kincal::compensate::{CompensateFault, CompensateOptions, Setup, compensate_text};
use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::effects::Library;
use kincal::identify::{CalibrateOptions, ErrorModel, Fit, Loss, Solver, calibrate, calibrate_model};
use kincal::inverse::{Goal, Inverse, InverseOptions, Outcome};
use kincal::lie::{Pose, Twist, Vec3};
use kincal::machine::MachineFault;
use kincal::nalgebra::{Isometry3, Point3, Vector6};
use kincal::num_dual::Dual64;
use kincal::predict::predict;
use kincal::recording::{Arrays, RecordingFault};
use kincal::{CalibratedMachine, Chain, Error, Machine, Recording, Result, Scalar};

const MACHINE: &str = r#"Machine(
    name: "table_mill", units: (length: mm, angle: deg), tolerance: (translation: 0.03, rotation: 0.004),
    workpiece: [
        (frame: "c", at: (0, 0, -120), joint: Revolute(axis: "z", travel: (-370, 370))),
        (frame: "w", at: (0, 0, 120)),
    ],
    tool: [
        (frame: "x", joint: Prismatic(axis: "x", travel: (-300, 300))),
        (frame: "y", joint: Prismatic(axis: "y", travel: (-300, 300))),
        (frame: "z", joint: Prismatic(axis: "z", travel: (-200, 300))),
        (frame: "t"),
    ],
)"#;
/// Standard deviation of what the tracker reads, about, m.
const NOISE: f64 = 5e-7;
/// Half the play of X that is concealed in the second recording, m.
const HALF_PLAY: f64 = 6e-6;

/// A point on the tool side as any scalar: with a dual number the same lines give its derivative.
fn height<S: Scalar>(machine: &Machine, tilt_of_x: S, q: &[f64]) -> S {
    let zero = tilt_of_x.lift(0.0);
    let mut deviations = vec![Twist::zero(zero); machine.dyads().len()];
    let x = machine.frame_index("x").expect("a frame of the machine");
    deviations[x].w.0[1] = tilt_of_x;
    let q: Vec<S> = q.iter().map(|value| zero.lift(*value)).collect();
    Chain::new(machine, &deviations).w_from_t(&q).translation.0[2]
}

/// Noise without a generator: well spread, the same every time.
fn rattle(k: usize) -> f64 {
    let sine = (12.9898 * (k + 1) as f64).sin() * 43758.5453;
    3f64.sqrt() * NOISE * (2.0 * (sine - sine.floor()) - 1.0)
}

/// The deviations that the machine really has.
fn truth(machine: &Machine) -> CalibratedMachine {
    let mut deviations = vec![Twist::zero(0.0); machine.dyads().len()];
    let mut put = |frame: &str, twist: [f64; 6]| {
        deviations[machine.frame_index(frame).expect("a frame of the machine")] = Vector6::from(twist).into();
    };
    // The turntable stands off by 20 um and is tilted; Y is out of square with X by 60 urad; Z leans.
    put("c", [20e-6, -15e-6, 0.0, 30e-6, -25e-6, 0.0]);
    put("y", [0.0, 0.0, 0.0, 0.0, 0.0, 60e-6]);
    put("z", [0.0, 0.0, 0.0, -20e-6, 35e-6, 0.0]);
    CalibratedMachine::nominal(machine.clone()).with_deviations(deviations)
}

/// Commands of the calibration, one row a joint in machine order: all over the travel, by incommensurable frequencies.
fn commands() -> [Vec<f64>; 4] {
    let course = |amplitude: f64, turns: f64| -> Vec<f64> {
        (0..300).map(|k| amplitude * (TAU * turns * f64::from(k) / 300.0).sin()).collect()
    };
    [course(3.0, 3.3), course(0.25, 7.1), course(0.25, 11.7), course(0.15, 17.9)]
}

/// Poses of the tool as a tracker with a six-degree-of-freedom probe reads them on this machine.
fn tracked(real: &CalibratedMachine, commands: &[Vec<f64>; 4]) -> Result<Recording> {
    let chain = real.chain();
    let read = |k: usize| {
        let noise = |i: usize| rattle(6 * k + i);
        let shake = Twist::new(Vec3([0, 1, 2].map(noise)), Vec3([3, 4, 5].map(noise)));
        chain.w_from_t(&commands.each_ref().map(|row| row[k])) * Pose::exp(shake)
    };
    let poses: Vec<Pose<f64>> = (0..commands[0].len()).map(read).collect();
    let names = real.machine().commands().iter().zip(commands);
    names
        .fold(Arrays::pose(&poses), |arrays, (name, row)| arrays.command(name, row))
        .recording("probe", real.machine())
}

fn calibrated_and_predicted(machine: &Machine, real: &CalibratedMachine) -> Result<(CalibratedMachine, Fit)> {
    let recordings = [tracked(real, &commands())?];
    let options =
        CalibrateOptions::default().with_loss(Loss::Huber { k: 3.0 }).with_solver(Solver::LevenbergMarquardt);
    let (calibrated, fit) = calibrate(machine, &recordings, options)?;
    let (lengths, angles) = (fit.rms.m.expect("lengths"), fit.rms.rad.expect("angles"));
    assert!(lengths.nominal > 1e-5 && lengths.geometric < 3.0 * NOISE, "{lengths:?}");
    assert!(angles.nominal > 1e-5 && angles.geometric < 3.0 * NOISE, "{angles:?}");
    let prediction = predict(&calibrated, &recordings[0], None)?;
    assert!(prediction.rms.m.is_some_and(|rms| rms < 3.0 * NOISE) && prediction.extrapolated_samples == 0);

    // What was put in is found.
    let squareness =
        fit.location_errors.errors.iter().find(|error| error.name == "EC0Y").expect("Y against X");
    assert!(squareness.identified && (squareness.value - 60e-6).abs() < 1e-6, "{squareness:?}");

    // As a text there and back; degrees round in the last place.
    let read = CalibratedMachine::parse("calibrated.ron", &calibrated.to_ron())?;
    let apart = |(a, b): (&Twist<f64>, &Twist<f64>)| (Vector6::from(*a) - Vector6::from(*b)).norm();
    assert!(read.deviations().iter().zip(calibrated.deviations()).map(apart).all(|d| d < 1e-18));
    Ok((calibrated, fit))
}

fn inverted(real: &CalibratedMachine, calibrated: &CalibratedMachine) {
    let machine = calibrated.machine();
    let options = InverseOptions::default().with_steps(30);
    let inverse = Inverse::new(machine).with_options(options);
    let free = vec![true; machine.commands().len()];
    let q = [0.7, 0.1, -0.2, 0.1];
    let goal = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: Chain::nominal(machine).w_from_t(&q) };
    let found =
        inverse.with_mode(kincal::inverse::Mode::Position).solve(&calibrated.chain(), &goal, &q, &free);
    assert_eq!(found.outcome, Outcome::Reached);
    // On the real machine, whose errors the calibrated one knows but for the noise.
    let there = real.chain().w_from_t(&found.commands).translation;
    assert!((there - goal.w_from_tip.translation).norm() < 1e-6);

    let far = Isometry3::translation(0.9, 0.0, 0.0);
    let goal = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: far.into() };
    let only_slides: Vec<bool> = machine.commands().iter().map(|name| name != "c").collect();
    let position = inverse.with_mode(kincal::inverse::Mode::Position);
    match position.solve(&calibrated.chain(), &goal, &[0.0; 4], &only_slides).outcome {
        Outcome::OutOfTravel { command, by } => {
            assert_eq!(machine.commands()[command], "x");
            assert!((by - 0.6).abs() < 1e-3);
        }
        other => panic!("x ends at 0.3 m, but the outcome is {other:?}"),
    }
}

/// X runs to and fro against a scale, with play.
fn scale(machine: &Machine) -> Result<Recording> {
    let x: Vec<f64> = (0..1200).map(|k| 0.2 * (TAU * f64::from(k) / 240.0).sin()).collect();
    let side = |k: usize| if (TAU * (k as f64 - 0.5) / 240.0).cos() > 0.0 { -HALF_PLAY } else { HALF_PLAY };
    let read: Vec<f64> = x.iter().enumerate().map(|(k, x)| x + side(k) + rattle(k)).collect();
    let still = vec![0.0; x.len()];
    Arrays::joint("x", &read)
        .command("x", &x)
        .command("y", &still)
        .command("z", &still)
        .command("c", &still)
        .time(&(0..1200).map(|k| 0.05 * f64::from(k)).collect::<Vec<_>>())
        .recording("scale", machine)
}

fn diagnosed(machine: &Machine) -> Result<(Diagnosis, CalibratedMachine)> {
    let recordings = [scale(machine)?];
    let options = DiagnoseOptions::default().with_options(CalibrateOptions::default());
    let mut diagnosis = diagnose(machine, &recordings, &Library::standard(), &options, &|_| ())?;
    let named: Vec<_> =
        diagnosis.findings.iter().map(|finding| (finding.effect.as_str(), finding.at.as_str())).collect();
    assert_eq!(named, [("backlash", "x")]);
    let model = diagnosis.model(machine, &recordings, options.options, &|_| ())?;
    assert_eq!(model.effects().len(), 1);

    // A model for each direction of travel of X says the same without a name.
    let by_direction = ErrorModel::by_direction(machine, &["x"])?.with_dead_bands(vec![None; 4]);
    let (pieces, fit) = calibrate_model(machine, &recordings, &by_direction, options.options, &|_| ())?;
    assert!(!fit.pieces.is_empty());
    let left = predict(&pieces, &recordings[0], None)?.rms.m.expect("lengths");
    let constant = diagnosis.rms.m.expect("lengths").geometric;
    assert!(constant > 0.8 * HALF_PLAY && left < 0.3 * constant, "{constant} {left}");
    Ok((diagnosis, model))
}

fn compensated(calibrated: &CalibratedMachine) -> Result<()> {
    let options = CompensateOptions::default().with_decimals(4).with_split(1e-6);
    let program = "G90 G21\nG1 X0. Y0. Z0. C0. F600\nX100. Y50. (corner)\nM30\n";
    let (text, report) = compensate_text(calibrated, "part.nc", program, &Setup::default(), &options)?;
    assert!(text != program && text.contains("(corner)") && text.ends_with("M30\n"));
    assert!(report.largest_left_m.value < 1e-6 && report.corrected_words > 0, "{report:?}");

    // What a program needs and the set-up does not say is told with its line.
    let error = compensate_text(calibrated, "part.nc", "G54\nG1 X1. F100\n", &Setup::default(), &options)
        .unwrap_err();
    match &error {
        Error::Input { place, .. } => assert_eq!((place.file.to_str(), place.line), (Some("part.nc"), 2)),
        other => panic!("a work offset is missing, not: {other}"),
    }
    assert!(error.fault::<CompensateFault>().is_some() && !error.mend().is_empty());
    Ok(())
}

fn errors_told_apart(machine: &Machine) {
    let error = Machine::parse("bad.ron", &MACHINE.replace(r#""w""#, r#""v""#)).unwrap_err();
    match &error {
        Error::Input { place, .. } => assert!(place.line > 0, "{place}"),
        Error::File { .. } | Error::Undetermined { .. } | Error::Motion { .. } => panic!("{error}"),
        _ => panic!("kinds of error may be added"),
    }
    assert!(matches!(error.fault::<MachineFault>(), Some(MachineFault::LastFrame { .. })));
    assert!(error.fault::<RecordingFault>().is_none());

    let error = Recording::open("nothing/here.csv", machine).unwrap_err();
    assert!(matches!(&error, Error::File { .. }) && error.place().is_none() && !error.mend().is_empty());

    let error = ErrorModel::by_direction(machine, &["x", "u"]).unwrap_err();
    assert!(matches!(&error, Error::Undetermined { .. }) && error.mend().contains("c, x, y, z"), "{error}");

    // A caller's own error type takes ours by `?`.
    fn opened() -> std::result::Result<Machine, Box<dyn std::error::Error + Send + Sync>> {
        Ok(Machine::open("nothing/here.ron")?)
    }
    assert!(opened().is_err());
}

fn main() -> Result<()> {
    let machine = Machine::parse("table_mill.ron", MACHINE)?;

    // By f64 and by dual numbers: a tilt of X about Y lowers the tool by its lever.
    let q = [0.0, 0.2, 0.0, 0.0];
    let by_tilt = height(&machine, Dual64::from(0.0).derivative(), &q).eps;
    assert_eq!(height(&machine, 0.0, &q), 0.0);
    assert!((by_tilt + 0.2).abs() < 1e-12);

    // Poses to nalgebra's and back.
    let w_from_t = Chain::nominal(&machine).w_from_t(&[0.5, 0.1, 0.2, 0.05]);
    let isometry = Isometry3::from(w_from_t);
    let p_t = Vec3([0.01, 0.02, 0.03]);
    let p_w = Vec3::from(isometry * Point3::from(p_t));
    assert!((p_w - w_from_t.transform(p_t)).norm() < 1e-15);

    let real = truth(&machine);
    // Machines, recordings and results go from thread to thread.
    let (geometry, physics) = thread::scope(|scope| {
        let geometry = scope.spawn(|| calibrated_and_predicted(&machine, &real));
        let physics = scope.spawn(|| diagnosed(&machine));
        (geometry.join().expect("no panic"), physics.join().expect("no panic"))
    });
    let (calibrated, fit) = geometry?;
    let (diagnosis, with_play) = physics?;
    inverted(&real, &calibrated);
    compensated(&calibrated)?;
    compensated(&with_play)?;
    errors_told_apart(&machine);
    println!(
        "calibrated from {} samples: {} of {} combinations seen; diagnosed: {}",
        fit.samples,
        fit.rank,
        fit.unknowns,
        diagnosis.findings.iter().map(|finding| finding.explanation.as_str()).collect::<Vec<_>>().join("; "),
    );
    Ok(())
}

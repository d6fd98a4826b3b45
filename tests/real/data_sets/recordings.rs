//! Recordings of real machines, other people's data beside the project: geometry alone, judged where it was not fitted.
//!
//! `cargo test --release --test real_recordings -- --nocapture` prints the figures of `docs/accuracy.md`; with
//! `KINCAL_COMPARE=1` also how losses and tolerances compare.

use super::sets::{Fold, Set, all, fanuc, gen3_lites, hilti, justin, kuka, pandas};
use kincal::identify::{Loss, Options, calibrate, fit_setup};
use kincal::machine::Tolerance;
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::{CalibratedMachine, Machine};

/// RMS of 3-D position in mm: set-ups fitted to the machine as declared, and calibrated; on all rows, and on rows left out.
#[derive(Clone, Copy, Debug)]
struct Figures {
    nominal: f64,
    geometric: f64,
    held_out_nominal: f64,
    held_out: f64,
}

/// Root mean square over recordings, mm.
fn rms(calibrated: &CalibratedMachine, recordings: &[Recording]) -> (f64, u64) {
    recordings.iter().fold((0.0, 0), |(sum, count), recording| {
        let found = predict(calibrated, recording, None).unwrap_or_else(|e| panic!("{e}"));
        let mm = 1e3 * found.rms.m.expect("positions");
        (sum + mm * mm * found.samples as f64, count + found.samples)
    })
}

/// Cross-validation of a set with a machine, which may differ from the set's own in its tolerances.
fn cross_validate(set: &Set, folds: &[Fold], machine: &Machine, options: Options) -> (f64, f64) {
    let nominal = CalibratedMachine::nominal(machine.clone());
    let (mut before, mut after, mut samples) = (0.0, 0.0, 0);
    for fold in folds {
        let (learnt, _) =
            calibrate(machine, &fold.train, options).unwrap_or_else(|e| panic!("{}: {e}", set.name));
        let place = if fold.setup.is_empty() { &fold.train } else { &fold.setup };
        let placed = |known: &CalibratedMachine| {
            fit_setup(known, place, options.loss).unwrap_or_else(|e| panic!("{}: {e}", set.name))
        };
        // What was learnt knows where its own set-up stands.
        let learnt = if fold.setup.is_empty() { learnt } else { placed(&learnt) };
        before += rms(&placed(&nominal), &fold.test).0;
        let (sum, count) = rms(&learnt, &fold.test);
        after += sum;
        samples += count;
    }
    let mean = |sum: f64| (sum / samples as f64).sqrt();
    (mean(before), mean(after))
}

fn figures(set: &Set, options: Options) -> Figures {
    let (_, fit) =
        calibrate(&set.machine, &set.whole(), options).unwrap_or_else(|e| panic!("{}: {e}", set.name));
    let all = fit.rms.m.expect("positions");
    let (held_out_nominal, held_out) = cross_validate(set, &set.folds(), &set.machine, options);
    let figures =
        Figures { nominal: 1e3 * all.nominal, geometric: 1e3 * all.geometric, held_out_nominal, held_out };
    println!(
        "{:<24} {:>5} samples  nominal {:6.3}  geometric {:6.3}  left out: nominal {:6.3}  geometric {:6.3} mm  ({} steps, {}, {} down-weighted)",
        set.name,
        fit.samples,
        figures.nominal,
        figures.geometric,
        figures.held_out_nominal,
        figures.held_out,
        fit.steps,
        fit.stop,
        fit.down_weighted
    );
    figures
}

/// What a set must reach, mm.
struct Limit {
    set: &'static str,
    /// Calibrated, on all rows.
    geometric: f64,
    /// Calibrated, on rows left out.
    held_out: f64,
}

/// Fits and cross-validates every set that is here, against limits a few percent above what is reached.
fn reaches(sets: impl IntoIterator<Item = Set>, limits: &[(&'static str, f64, f64)]) {
    let limit = |set: &str| {
        let found = limits.iter().find(|(name, ..)| *name == set);
        let (set, geometric, held_out) = *found.unwrap_or_else(|| panic!("{set} has no limit"));
        Limit { set, geometric, held_out }
    };
    let mut missed = Vec::new();
    for set in sets {
        let (found, limit) = (figures(&set, Options::default()), limit(&set.name));
        let mut check = |what: &str, value: f64, limit_mm: f64| {
            if value.is_nan() || value > limit_mm {
                missed.push(format!("{} {what}: {value:.3} mm, expected {limit_mm} mm at most", limit.set));
            }
        };
        check("on all rows", found.geometric, limit.geometric);
        check("on rows left out", found.held_out, limit.held_out);
        check("calibrated instead of nominal", found.held_out, found.held_out_nominal);
    }
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
#[ignore = "needs the data sets"]
fn kuka_iiwa_14_at_a_place_that_was_left_out() {
    reaches([kuka()], &[("kuka_14", 0.135, 0.145)]);
}

#[test]
#[ignore = "needs the data sets"]
fn panda_arms_at_a_place_that_was_left_out() {
    let limits = [
        ("panda_1", 0.50, 1.36),
        ("panda_2", 0.61, 0.66),
        ("panda_3", 0.21, 0.22),
        ("panda_4", 0.255, 0.415),
        ("panda_6", 0.21, 0.315),
        ("panda_7 right", 0.21, 0.25),
    ];
    reaches(pandas(), &limits);
}

#[test]
#[ignore = "needs the data sets"]
fn gen3_lite_arms_at_a_place_that_was_left_out() {
    reaches(gen3_lites(), &[("dinova_1", 1.85, 5.3), ("dinova_2", 1.72, 3.1)]);
}

#[test]
#[ignore = "needs the data sets"]
fn hilti_jaibot_in_a_trial_that_was_left_out() {
    reaches([hilti()], &[("hilti_jaibot", 4.13, 4.32)]);
}

#[test]
#[ignore = "needs the data sets"]
fn dlr_justin_at_poses_that_were_left_out() {
    reaches(justin(), &[("dlr_justin right", 11.8, 12.3), ("dlr_justin left", 11.35, 11.95)]);
}

#[test]
#[ignore = "needs the data sets"]
fn fanuc_r2000ic_at_a_pose_that_was_left_out() {
    reaches([fanuc()], &[("fanuc_r2000ic", 0.17, 0.235)]);
}

/// Comparisons are for reading, and take minutes: only on demand.
fn wanted() -> bool {
    let wanted = std::env::var_os("KINCAL_COMPARE").is_some();
    if !wanted {
        println!("skipped: set KINCAL_COMPARE=1 to see this comparison");
    }
    wanted
}

#[test]
#[ignore = "needs the data sets"]
fn losses_side_by_side() {
    if !wanted() {
        return;
    }
    let losses = [
        ("squares", Loss::Squares),
        ("huber 3", Loss::Huber { k: 3.0 }),
        ("huber 2", Loss::Huber { k: 2.0 }),
        ("huber 1.345", Loss::Huber { k: 1.345 }),
        ("tukey 4.685", Loss::Tukey { c: 4.685 }),
    ];
    for set in all() {
        let folds = set.folds();
        let column = losses.map(|(name, loss)| {
            let (_, held_out) =
                cross_validate(&set, &folds, &set.machine, Options { loss, ..Options::default() });
            format!("{name} {held_out:7.4}")
        });
        println!("{:<24} left out, mm: {}", set.name, column.join("  "));
    }
}

/// The machine with another tolerance (mm, deg) of the frames that state none.
fn with_tolerance(machine: &Machine, mm: f64, deg: f64) -> Machine {
    let tolerance = Tolerance { translation: 1e-3 * mm, rotation: deg.to_radians() };
    machine.clone().with_tolerance(tolerance).expect("positive")
}

#[test]
#[ignore = "needs the data sets"]
fn tolerances_side_by_side() {
    if !wanted() {
        return;
    }
    const DEGREES: [f64; 5] = [0.03, 0.1, 0.3, 1.0, 3.0];
    for set in all() {
        let folds = set.folds();
        println!("{}, left out, mm; across: tolerance {DEGREES:?} deg", set.name);
        for mm in [0.2, 0.5, 1.0, 2.0, 5.0] {
            let held_out = DEGREES.map(|deg| {
                let machine = with_tolerance(&set.machine, mm, deg);
                format!("{:7.3}", cross_validate(&set, &folds, &machine, Options::default()).1)
            });
            println!("{mm:8} mm  {}", held_out.join("  "));
        }
    }
}

//! Recordings of real machines, other people's data beside the project: geometry alone, judged where it was not fitted.
//!
//! `cargo test --release --test engine data_sets::recordings -- --ignored --nocapture` prints the figures of `docs/accuracy.md`;
//! the sections `losses` and `tolerances` of `examples/benchmarks` say how losses and tolerances compare.

use kincal::identify::{CalibrateOptions, calibrate};

use super::left_out::cross_validate;
use super::sets::{Set, fanuc, gen3_lites, hilti, justin, kuka, pandas};

/// RMS of 3-D position in mm: set-ups fitted to the machine as declared, and calibrated; on all rows, and on rows left out.
#[derive(Clone, Copy, Debug)]
struct Figures {
    nominal: f64,
    geometric: f64,
    held_out_nominal: f64,
    held_out: f64,
}

fn figures(set: &Set, options: CalibrateOptions) -> Figures {
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
        let (found, limit) = (figures(&set, CalibrateOptions::default()), limit(&set.name));
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

//! Physics by name on recordings of real machines: effects that are given, not searched for, judged where they were not fitted.
//!
//! `cargo test --release --test engine data_sets::physics -- --ignored --nocapture` prints the figures of `docs/real-recordings.md`.

use kincal::effects::Library;
use kincal::identify::{CalibrateOptions, ErrorModel, calibrate_model};
use kincal::variation::Varying;

use super::sets::{SETS, Set};
use super::terms::{figures, terms};

fn set(name: &str) -> &'static Set {
    SETS.iter().find(|set| set.name == name).unwrap_or_else(|| panic!("no set {name}"))
}

/// What given physics must reach: set, terms, RMS on all rows and on rows left out, mm or mdeg; limits a few percent above what is
/// reached.
const REACHED: [(&str, &str, f64, f64); 16] = [
    ("kuka_14", "gravity_compliance@*#1", 0.082, 0.100),
    ("panda_3", "gravity_compliance@*#1,cyclic_error@*:240#2", 0.156, 0.175),
    ("panda_4", "gravity_compliance@*#1,cyclic_error@*:240#2", 0.180, 0.315),
    ("panda_7 right", "cyclic_error@*:240#2", 0.136, 0.190),
    ("dlr_justin left", "gravity_compliance@*", 8.5, 9.0),
    ("dlr_justin right", "gravity_compliance@*", 9.3, 9.9),
    ("dlr_justin left with right", "gravity_compliance@*#40,lateral_compliance@*", 2.75, 3.9),
    ("dlr_justin right with left", "gravity_compliance@*#40,lateral_compliance@*", 2.9, 4.2),
    ("tracker", "position_dependent_backlash@c#3,positioning_error@c#2", 0.66, 0.71),
    ("stroke", "cyclic_error@c:61.5#2", 2.1, 2.1),
    ("resolver_fourth", RESOLVER, 695.0, 695.0),
    ("resolver_second", RESOLVER, 250.0, 250.0),
    ("reversals", "presliding_friction@c", 3.0, 3.0),
    ("open_loop", "cyclic_error@x:0.00025#4", 0.00105, 0.00105),
    ("axis1_laser_10.0", "positioning_error@x#4,position_dependent_backlash@x#3", 0.0028, 0.0033),
    ("axis2_laser_10.2", "positioning_error@x#4,position_dependent_backlash@x#2", 0.0036, 0.0038),
];
const RESOLVER: &str = "servo_lag@c,graduation_error@c:4#4,coupling_misalignment@c,encoder_eccentricity@c";
const COLUMN: &str = "gravity_compliance@*#1,lateral_compliance@*,column_compliance@column#9,\
     guide_clearance@column:30;1.98#6,straightness@column#3,angular_error@column#3";

fn reaches(name: &str, asked: &str, fitted: f64, left_out: f64) {
    let set = set(name);
    let library = Library::standard();
    let bare = figures(set, &Varying::default(), &[]);
    let (varying, names) = terms(set, &library, asked);
    let found = figures(set, &varying, &names);
    println!(
        "{name:<18} fitted {:.4} -> {:.4}  left out {:.4} -> {:.4}  {asked}",
        bare.fitted, found.fitted, bare.left_out, found.left_out
    );
    assert!(found.fitted <= fitted, "{name}: {:.4} on all rows, expected {fitted} at most", found.fitted);
    assert!(
        found.left_out <= left_out,
        "{name}: {:.4} left out, expected {left_out} at most",
        found.left_out
    );
    assert!(found.left_out < bare.left_out, "{name}: {asked} does not help on rows left out");
}

#[test]
#[ignore = "needs the data sets"]
fn named_physics_explains_what_geometry_leaves_on_rows_left_out() {
    REACHED.iter().for_each(|(name, asked, fitted, left_out)| reaches(name, asked, *fitted, *left_out));
}

#[test]
#[ignore = "needs the data sets"]
fn a_lifting_column_that_bends_and_leans_explains_its_robot() {
    reaches("hilti_jaibot", COLUMN, 1.38, 1.78);
}

/// The terms that a set is given.
fn asked_of(name: &str) -> &'static str {
    REACHED.iter().find(|reached| reached.0 == name).expect("a set of the list").1
}

/// Of a set and one term of it: its coefficients.
fn coefficients(name: &str, asked: &str) -> Vec<f64> {
    let set = set(name);
    let (varying, _) = terms(set, &Library::standard(), asked);
    let model = ErrorModel::default().with_varying(varying);
    let found = calibrate_model(&set.machine, &set.whole(), &model, CalibrateOptions::default(), &|_| {});
    let (_, fit) = found.unwrap_or_else(|e| panic!("{e}"));
    fit.coefficients.iter().map(|c| c.value).collect()
}

/// Within a part of what an independent source says.
fn near(what: &str, found: f64, expected: f64, part: f64) {
    println!("{what}: {found:.4}, expected {expected}");
    assert!((found - expected).abs() <= part * expected.abs(), "{what}: {found} instead of {expected}");
}

#[test]
#[ignore = "needs the data sets"]
fn sizes_agree_with_what_independent_sources_say() {
    let mdeg = |rad: f64| 1e3 * rad.to_degrees();
    let c = coefficients("tracker", asked_of("tracker"));
    // Width at 0, 20 and 40 deg: ends and middle of the travel.
    near("play at 0 deg, mdeg", mdeg(c[0] - c[1] + c[2]), 34.1, 0.02);
    near("play at 20 deg, mdeg", mdeg(c[0] - c[2]), 38.6, 0.02);
    near("play at 40 deg, mdeg", mdeg(c[0] + c[1] + c[2]), 31.2, 0.02);
    let c = coefficients("stroke", asked_of("stroke"));
    near("pinion, mdeg", mdeg(c[0].hypot(c[1])), 4.3, 0.05);
    let c = coefficients("resolver_fourth", RESOLVER);
    near("delay, s", c[0], 0.034, 0.05);
    near("fourth harmonic, deg", c[1].hypot(c[2]).to_degrees(), 8.16, 0.05);
    let c = coefficients("resolver_second", RESOLVER);
    near("delay, s", c[0], 0.034, 0.05);
    near("second harmonic, deg", c[5].hypot(c[6]).to_degrees(), 1.54, 0.05);
    let c = coefficients("open_loop", asked_of("open_loop"));
    near("cyclic error of 0.250 mm, um", 1e6 * c[0].hypot(c[1]), 20.6, 0.02);
}

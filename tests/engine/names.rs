//! What names mean: with its own name left out of the library, what is concealed has none, though a wider name would take it.

use crate::common;
use crate::common::random::normals;
use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::effects::Library;
use kincal::recording::Recording;

/// A rotary axis to and fro over growing strokes, with an error of this size in deg; 0.2 mdeg of noise.
fn said_of(mut error: impl FnMut(f64, f64) -> f64, without: &[&str]) -> Diagnosis {
    let machine = common::machine("rotary_axis");
    let mut noise = normals(3);
    let mut text = String::from("# measurement: joint\n# zero: unknown\nt[s],c[deg],c_meas[deg]\n");
    // Of one wave alone the acceleration is its position, and a drive that gives way has an error of scale.
    let way = |t: f64| (60.0 + 4.0 * t) * (0.3 * t).sin() + 20.0 * (0.83 * t).sin();
    for k in 0..3000 {
        let t = 0.02 * f64::from(k);
        let (at, side) = (way(t), (way(t + 1e-4) - way(t)).signum());
        text += &format!("{t:.2},{at:.6},{:.6}\n", at + error(at, side) + 2e-4 * noise());
    }
    let recording = Recording::from_bytes("c.csv", text.into_bytes(), &machine).expect("a recording");
    let library = without
        .iter()
        .fold(Library::standard(), |library, name| library.without(name).unwrap_or_else(|e| panic!("{e}")));
    diagnose(&machine, &[recording], &library, &DiagnoseOptions::default(), &|_| {})
        .unwrap_or_else(|e| panic!("{e}"))
}

fn names(said: &Diagnosis) -> Vec<&str> {
    said.findings.iter().map(|f| f.effect.as_str()).collect()
}

#[test]
fn a_straight_line_is_no_positioning_error() {
    let line = |at: f64, _: f64| 2e-5 * at;
    assert_eq!(names(&said_of(line, &[])), ["scale_error"]);
    let said = said_of(line, &["scale_error"]);
    assert!(said.findings.is_empty(), "{:?}", names(&said));
    assert_eq!(said.unexplained.expect("there is structure").at, "c");
    // What bends keeps its name.
    let bent = |at: f64, _: f64| 2e-5 * at + 2e-3 * (at / 200.0).powi(2);
    assert_eq!(names(&said_of(bent, &["scale_error"])), ["positioning_error"]);
}

/// What turns round slowly is seen to cross its play: seven samples for 0.05 deg.
#[test]
fn play_that_is_seen_to_be_crossed_is_no_hysteresis() {
    let mut driven = -0.025;
    let play = |at: f64, _: f64| {
        driven = f64::clamp(driven, at - 0.025, at + 0.025);
        driven - at
    };
    let said = said_of(play, &[]);
    assert_eq!(names(&said), ["backlash"]);
    let width = said.findings[0].coefficients[0].value.to_degrees();
    assert!((width - 0.05).abs() < 5e-4, "{width} deg");
}

#[test]
fn play_that_is_crossed_at_once_is_no_hysteresis() {
    let play = |_: f64, side: f64| -1e-3 * side;
    assert_eq!(names(&said_of(play, &[])), ["backlash"]);
    let said = said_of(play, &["backlash"]);
    assert!(said.findings.is_empty(), "{:?}", names(&said));
    assert_eq!(said.unexplained.expect("there is structure").at, "c");
}

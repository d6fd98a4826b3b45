//! Names that the readings cannot tell apart have their probabilities each, and what cannot be is none of them.

use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::effects::Library;
use kincal::machine::Machine;
use kincal::recording::Recording;

use crate::common::random::normals;

/// What is said of a rotary axis in this direction that is read off by a sine once per turn.
fn said_of(axis: &str) -> Diagnosis {
    let machine = format!(
        r#"Machine(
            name: "one", about: "an axis", units: (length: mm, angle: deg),
            tolerance: (translation: 0.03, rotation: 0.004),
            workpiece: [(frame: "w")],
            tool: [(frame: "c", joint: Revolute(axis: "{axis}", travel: (-180, 180))), (frame: "t")],
        )"#
    );
    let machine = Machine::parse("one.ron", &machine).expect("a machine");
    let mut noise = normals(8);
    let mut text = String::from("# measurement: joint\n# zero: unknown\nt[s],c[deg],c_meas[deg]\n");
    for k in 0..3000 {
        let t = 0.02 * f64::from(k);
        let c = 170.0 * (0.2 * t).sin();
        let error = 4e-3 * (c.to_radians() + 0.7).sin();
        text += &format!("{t:.2},{c:.6},{:.6}\n", c + error + 2e-4 * noise());
    }
    let recording = Recording::from_bytes("c.csv", text.into_bytes(), &machine).expect("a recording");
    diagnose(&machine, &[recording], &Library::standard(), &DiagnoseOptions::default(), &|_| {})
        .unwrap_or_else(|e| panic!("{e}"))
}

/// Names of what was found first, with their probabilities.
fn names(said: &Diagnosis) -> Vec<(&str, f64)> {
    let first = said.findings.first().expect("something");
    let others = first.confusable_with.iter().map(|other| (other.effect.as_str(), other.probability));
    [(first.effect.as_str(), first.probability)].into_iter().chain(others).collect()
}

#[test]
fn once_per_turn_a_lying_axis_may_be_heavy_or_its_encoder_eccentric() {
    let said = said_of("x");
    let names = names(&said);
    let of = |name: &str| names.iter().find(|(own, _)| *own == name).map_or(0.0, |(_, p)| *p);
    assert!(of("encoder_eccentricity") > 0.2 && of("gravity_compliance") > 0.2, "{names:?}");
    assert!(names.iter().map(|(_, p)| p).sum::<f64>() <= 1.0 + 1e-9, "{names:?}");
}

#[test]
fn no_weight_twists_an_upright_axis() {
    let said = said_of("z");
    let names = names(&said);
    assert_eq!(names[0].0, "encoder_eccentricity", "{names:?}");
    assert!(names[0].1 > 0.9 && names.iter().all(|(name, _)| *name != "gravity_compliance"), "{names:?}");
}

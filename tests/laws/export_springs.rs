//! Compliance in an exported model of MuJoCo: a spring under the masses of the model is deflected by what the calibrated file says.

use kincal::CalibratedMachine;
use kincal::export::{ExportOptions, Exported, Format, export};
use kincal::predict::residuals;
use kincal::recording::Arrays;

/// Compliance, rad/Nm.
const COMPLIANCE: f64 = 2e-5;
const GRAVITY: f64 = 9.80665;

/// An arm of two joints about level axes, masses as told; its first joint yields to its weight.
fn arm(effect: &str, masses: bool) -> CalibratedMachine {
    let [one, two, three] = match masses {
        true => [
            ", mass: 5, centre_of_mass: (200, 0, 0)",
            ", mass: 3, centre_of_mass: (150, 0, 20)",
            ", mass: 2, centre_of_mass: (0, 0, 30)",
        ],
        false => [""; 3],
    };
    let text = format!(
        "Machine(name: \"arm\", units: (length: mm, angle: deg), workpiece: [(frame: \"w\")],
        tool: [(frame: \"q1\", joint: Revolute(axis: \"y\"){one}), (frame: \"q2\", at: (400, 0, 0), joint: Revolute(axis: \"y\"){two}), (frame: \"t\", at: (300, 0, 0){three})],
        calibration: (deviations: [], unseen: [], effects: [{effect}]))"
    );
    CalibratedMachine::parse("arm.ron", &text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn effect(value: f64, feature: &str) -> String {
    format!(
        "(effect: \"gravity_compliance\", at: \"q1\", terms: [(value: {value:e}, parts: [(slot: Before(\"q1\"), v: (0, 0, 0), w: (0, 1, 0), feature: Of(\"q1\", {feature}))])])"
    )
}

fn model(calibrated: &CalibratedMachine) -> Exported {
    export(calibrated, Format::Mjcf, &ExportOptions::default()).expect("a model")
}

/// Torque by gravity about the first joint, Nm: the turn about y carries x to -z.
fn torque(q1: f64, q2: f64) -> f64 {
    let turned = |x: f64, z: f64, q: f64| [x * q.cos() + z * q.sin(), -x * q.sin() + z * q.cos()];
    let hinge = turned(0.4, 0.0, q1)[0];
    let flange = hinge + turned(0.3, 0.0, q1 + q2)[0];
    let lever = 5.0 * turned(0.2, 0.0, q1)[0]
        + 3.0 * (hinge + turned(0.15, 0.02, q1 + q2)[0])
        + 2.0 * (flange + turned(0.0, 0.03, q1 + q2)[0]);
    GRAVITY * lever
}

#[test]
fn a_spring_under_the_masses_of_the_model_yields_as_the_file_says() {
    let calibrated = arm(&effect(COMPLIANCE, "Gravity"), true);
    let exported = model(&calibrated);
    assert!(exported.left_out.is_empty(), "{:?}", exported.left_out);
    let tendon = exported.text.lines().find(|line| line.contains("\"compliance of q1\"")).expect("a tendon");
    let stiffness: f64 = tendon
        .split("stiffness=\"")
        .nth(1)
        .and_then(|rest| rest.split('"').next()?.parse().ok())
        .expect("a number");
    assert!((stiffness - 1.0 / COMPLIANCE).abs() < 1e-9 / COMPLIANCE);
    let number = &exported.numbers[0];
    assert_eq!((number.name.as_str(), number.unit.as_str()), ("stiffness of q1", "Nm/rad"));
    let commands: Vec<(f64, f64)> =
        (0..24).map(|k| (f64::from(k) * 0.5 - 6.0, f64::from(k * k % 7) - 3.0)).collect();
    let (q1, q2): (Vec<f64>, Vec<f64>) = commands.iter().copied().unzip();
    let arrays = Arrays::joint("q1", &q1).command("q1", &q1).command("q2", &q2);
    let recording = arrays.recording("poses", calibrated.machine()).expect("sound");
    let mut yields = Vec::new();
    residuals(&calibrated, &recording, |left| yields.push(-left[0])).expect("predicted");
    let largest = yields.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    assert!(largest > 5e-4, "{largest}");
    for ((motor, other), said) in commands.iter().zip(&yields) {
        // Where the spring holds the weight.
        let mut own = *motor;
        for _ in 0..50 {
            own = motor + torque(own, *other) / stiffness;
        }
        // The file counts the torque where the joint was commanded: off by the compliance times its change.
        assert!((own - motor - said).abs() < 2e-3 * largest, "{} {said}", own - motor);
    }
}

#[test]
fn masses_that_nobody_states_are_weights_of_their_own() {
    // Where the file states no mass, the effect counts 1 kg at every frame beyond, and so does the model.
    let exported = model(&arm(&effect(COMPLIANCE, "Gravity"), false));
    assert!(exported.left_out.is_empty(), "{:?}", exported.left_out);
    let weights = exported.text.lines().filter(|line| line.contains("<body name=\"weight "));
    assert_eq!(weights.filter(|line| line.contains("mass=\"1\"")).count(), 2);
    // Besides what it states, 3 kg at the end, and a first moment of -0.5 kg m across the first joint.
    let part = |value: f64, feature: &str| {
        format!(
            "(value: {value:e}, parts: [(slot: Before(\"q1\"), v: (0, 0, 0), w: (0, 1, 0), feature: Of(\"q1\", {feature}))])"
        )
    };
    let terms = [(1.0, "Gravity"), (3.0, "Load"), (-0.5, "Lever(0, 0)")]
        .map(|(by, feature)| part(by * COMPLIANCE, feature));
    let effect = format!("(effect: \"gravity_compliance\", at: \"q1\", terms: [{}])", terms.join(", "));
    let exported = model(&arm(&effect, true));
    assert!(exported.left_out.is_empty(), "{:?}", exported.left_out);
    let weights: Vec<&str> =
        exported.text.lines().filter(|line| line.contains("<body name=\"weight ")).collect();
    assert_eq!(weights.len(), 3);
    assert_eq!(weights.iter().filter(|line| line.contains("mass=\"0.5\"")).count(), 2);
    // One of the two that make a moment pulls upwards.
    assert_eq!(weights.iter().filter(|line| line.contains("gravcomp=\"2\"")).count(), 1);
    assert!(weights.iter().any(|line| line.contains("mass=\"3") && line.contains("of t\"")), "{weights:?}");
}

#[test]
fn what_is_no_spring_is_listed() {
    for (calibrated, why) in [
        (arm(&effect(-COMPLIANCE, "Gravity"), true), "it would push against its load"),
        (arm(&effect(COMPLIANCE, "Load"), true), "the stated masses have no part in it"),
    ] {
        let exported = model(&calibrated);
        assert!(!exported.text.contains("compliance of"), "{why}");
        let listed: Vec<&str> = exported.left_out.iter().map(|left| left.what.as_str()).collect();
        assert_eq!(listed, ["gravity_compliance at q1"], "{why}");
        assert!(exported.left_out[0].because.contains("no spring does that"), "{why}");
    }
}
